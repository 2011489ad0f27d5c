//! One row of the comparison with other programs: a training step or a forward pass, timed step by step, as one JSON line.
//!
//! `cargo bench --bench peers -- CASE THREADS BATCH HISTORY REPEATS`, where CASE is `dropout`, `nodropout`, `forward`, or `peer-KIND` for a
//! training step of another network (`peer-tcn`) at its own sizes without dropout. Also printed:
//! the instruction-set level, the peak of fused multiply-adds measured just before and just after, on one thread and on as many as work,
//! and the peak memory of the process. Started by `run.py` beside it, in turn with the other programs; statistics are made there.

use phyture::nn::{Architecture, Network, OutputScale, PhyTureConfig};
use phyture::tape::{DropoutKey, Session, Threads};
use phyture_kernels::adam::Adam;
use phyture_kernels::random::Stream;
use phyture_kernels::{InstructionSet, peak};
use std::time::Instant;

/// Steps before the first timed one.
const WARM_UP: usize = 2;

/// More columns than any input has.
const COLUMNS: u64 = 40;

/// Numbers that look like standardised inputs. They are there before a step begins, as the other programs' tensors are; a step copies them, as a
/// training copies a window from its flight. The same for every sample, for time does not depend on them.
fn inputs(history: usize) -> Vec<f32> {
    let stream = Stream::new(1, 0, 0, 0);
    (0..COLUMNS * history as u64).map(|at| (2.0 * stream.uniform(at) - 1.0) as f32).collect()
}

/// Largest resident memory of this process so far, MiB; Linux tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()?;
    Some(kib / 1024.0)
}

/// Peak of multiply-adds, 10⁹ operations a second, of this many threads together (0: all cores).
fn peak_gflops(isa: InstructionSet, threads: usize) -> f64 {
    let threads = if threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { threads };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(|| peak::f32_gflops(isa))).collect();
        let own = peak::f32_gflops(isa);
        own + others.into_iter().filter_map(|other| other.join().ok()).sum::<f64>()
    })
}

/// An error in words.
fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn run() -> Result<String, String> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let usage = "usage: dropout|nodropout|forward|peer-KIND THREADS BATCH HISTORY REPEATS";
    let [case, numbers @ ..] = arguments.as_slice() else { return Err(usage.into()) };
    let numbers: Result<Vec<usize>, _> = numbers.iter().map(|number| number.parse()).collect();
    let Ok(&[threads, batch, history, repeats]) = numbers.as_deref() else { return Err(usage.into()) };
    if !["dropout", "nodropout", "forward"].contains(&case.as_str()) && !case.starts_with("peer-") {
        return Err(usage.into());
    }

    let isa = InstructionSet::detect().map_err(|error| error.to_string())?;
    let (alone, before) = (peak_gflops(isa, 1), peak_gflops(isa, threads));
    let config: Architecture = match case.strip_prefix("peer-") {
        Some(kind) => {
            let sizes = serde_json::json!({ "kind": kind, "history": history, "dropout": 0.0 });
            serde_json::from_value(sizes.clone())
                // DLinear has no dropout to switch off.
                .or_else(|_| serde_json::from_value(serde_json::json!({ "kind": kind, "history": history })))
                .map_err(|error| error.to_string())?
        }
        None => PhyTureConfig { history, ..PhyTureConfig::default() }.into(),
    };
    let network = Network::<f32>::new(&config, &OutputScale::unit(config.outputs()), false).map_err(text)?;
    let mut parameters = network.initial(0);
    let numbers = inputs(history);
    let fill = |_: usize, inputs: &mut [&mut [f32]]| {
        inputs.iter_mut().for_each(|slab| slab.copy_from_slice(&numbers[..slab.len()]));
    };
    let mut seconds = Vec::new();
    match case.as_str() {
        "forward" => {
            let mut session = Session::infer(network.graph(), &[network.output()], Threads(threads)).map_err(text)?;
            session.load(&parameters).map_err(text)?;
            for _ in 0..WARM_UP + repeats {
                let start = Instant::now();
                session.predict(batch, &fill, &mut |_, _| {}).map_err(text)?;
                seconds.push(start.elapsed().as_secs_f64());
            }
        }
        _ => {
            let mut session = Session::train(network.graph(), network.loss(), &[], Threads(threads)).map_err(text)?;
            let (mut first, mut second) = (vec![0.0; parameters.len()], vec![0.0; parameters.len()]);
            for step in 0..(WARM_UP + repeats) as u64 {
                let start = Instant::now();
                let random = case != "nodropout" && config.is_random();
                let key = random.then_some(DropoutKey { seed: 0, step });
                session.step(&parameters, batch, key, &fill).map_err(text)?;
                session.adam(&Adam::default(), step + 1, &mut parameters, &mut first, &mut second).map_err(text)?;
                seconds.push(start.elapsed().as_secs_f64());
            }
        }
    }
    seconds.drain(..WARM_UP);
    let after = peak_gflops(isa, threads);
    let line = serde_json::json!({
        "seconds": seconds, "peak_mib": peak_mib(), "parameters": parameters.len(), "level": isa.name(),
        "peak_gflops_alone": alone, "peak_gflops": [before, after],
        "version": format!("phyture {}", env!("CARGO_PKG_VERSION")),
    });
    Ok(line.to_string())
}

fn main() -> std::process::ExitCode {
    // `cargo test` builds and starts benches too; there is nothing to check here.
    if std::env::args().len() <= 2 && !std::env::args().any(|argument| argument == "forward") {
        return std::process::ExitCode::SUCCESS;
    }
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
