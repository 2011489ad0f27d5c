//! One row of the comparison with other Rust frameworks: a training step or a forward pass of Phy-Ture, timed step by step, as
//! one JSON line. Not a library and no reference for results: only time and memory are compared.
//!
//! `peers-rust candle|burn CASE THREADS BATCH HISTORY REPEATS`, where CASE is the dropout of a training step, `0.2` or `0`, or
//! `forward`. The frameworks take their threads from RAYON_NUM_THREADS, which `rust.py` sets; it has to agree with THREADS.
//! The network is that of `torch_step.py`, layer by layer.

mod burn;
mod candle;

use std::time::Instant;

const WIDTH: usize = 64;
const HEADS: usize = 4;
const STATES: usize = 16;
const PHYSICS: usize = 6;
const OUTPUTS: usize = 6;
const LEVELS: usize = 3;
const STACKS: usize = 2;
/// Width of the moving average.
const AVERAGE: usize = 25;
/// Kernels of the two convolutions of a module.
const KERNELS: [usize; 2] = [5, 3];
/// Padding on each side, for both convolutions at once.
const PAD: usize = (KERNELS[0] + KERNELS[1] - 2) / 2;
const LEAK: f64 = 0.01;
const LEARNING_RATE: f64 = 1e-3;
/// Steps before the first timed one.
const WARM_UP: usize = 2;

/// What to time.
struct Row {
    /// Dropout of a training step; a forward pass has none.
    dropout: Option<f32>,
    batch: usize,
    history: usize,
    repeats: usize,
}

impl Row {
    /// Seconds of each step after the warm-up.
    fn time<E>(&self, mut step: impl FnMut() -> Result<(), E>) -> Result<Vec<f64>, E> {
        let mut seconds = Vec::new();
        for _ in 0..WARM_UP + self.repeats {
            let start = Instant::now();
            step()?;
            seconds.push(start.elapsed().as_secs_f64());
        }
        Ok(seconds.split_off(WARM_UP))
    }

    /// Sines and cosines of the positions, a row for each sample of the history.
    fn encoding(&self) -> Vec<f32> {
        let value = |row: usize, column: usize| {
            let angle = row as f64 * (-(10000f64.ln()) * (column - column % 2) as f64 / WIDTH as f64).exp();
            if column.is_multiple_of(2) { angle.sin() as f32 } else { angle.cos() as f32 }
        };
        (0..self.history).flat_map(|row| (0..WIDTH).map(move |column| value(row, column))).collect()
    }
}

/// Largest resident memory of this process so far, MiB; Linux tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()?;
    Some(kib / 1024.0)
}

/// The version pinned in Cargo.toml.
fn version(package: &str) -> Option<&'static str> {
    let line = include_str!("../Cargo.toml").lines().find(|line| line.starts_with(package))?;
    line.split("\"=").nth(1)?.split('"').next()
}

fn run() -> Result<String, String> {
    let usage = "usage: candle|burn 0.2|0|forward THREADS BATCH HISTORY REPEATS";
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [framework, case, numbers @ ..] = arguments.as_slice() else { return Err(usage.into()) };
    let numbers: Result<Vec<usize>, _> = numbers.iter().map(|number| number.parse()).collect();
    let Ok(&[threads, batch, history, repeats]) = numbers.as_deref() else { return Err(usage.into()) };
    let dropout = match case.as_str() {
        "forward" => None,
        rate => Some(rate.parse().map_err(|_| usage)?),
    };
    if std::env::var("RAYON_NUM_THREADS").ok() != Some(threads.to_string()) {
        return Err(format!("RAYON_NUM_THREADS is not {threads}"));
    }
    let row = Row { dropout, batch, history, repeats };
    let ((seconds, parameters), package) = match framework.as_str() {
        "candle" => (candle::run(&row).map_err(|error| error.to_string())?, "candle-core"),
        "burn" => (burn::run(&row)?, "burn"),
        _ => return Err(usage.into()),
    };
    let line = serde_json::json!({
        "seconds": seconds, "peak_mib": peak_mib(), "parameters": parameters,
        "version": format!("{framework} {}", version(package).unwrap_or("unknown")),
    });
    Ok(line.to_string())
}

fn main() -> std::process::ExitCode {
    match run() {
        Ok(line) => {
            println!("{line}");
            std::process::ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            std::process::ExitCode::FAILURE
        }
    }
}
