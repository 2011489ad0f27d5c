//! How long a prediction takes in flight: a hybrid fed at the rate of its log, sample by sample in real time, on one thread. Prints one JSON line.
//!
//! `cargo bench --features sim --bench latency -- HISTORY WIDTH SECONDS [EVERY]`: a Phy-Ture of this history and width, untrained (time does not
//! depend on weights), on a physics with the whole catalogue switched on, with envelope and intervals; the network looks at every EVERY-th sample. The
//! same samples then go through the physics alone. Between samples the thread sleeps, as it does in flight, so caches and clock
//! are as cold as they are there. `run.py` beside it does the same with other programs, and makes the table.

use phyture::flight::split::{Protocol, Split};
use phyture::flight::windows::windows;
use phyture::flight::{DataSet, PerChannel};
use phyture::hybrid::{Description, Hybrid, sequence};
use phyture::nn::PhyTureConfig;
use phyture::physics::{Model, catalogue, typical};
use phyture::sim::{Simulation, simulate};
use phyture::tape::Threads;
use phyture::{Error, Result};
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

/// Largest and present resident memory of this process, MiB; Linux tells.
fn memory_mib() -> [Option<f64>; 2] {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    ["VmHWM:", "VmRSS:"].map(|key| {
        let kib = status.lines().find_map(|line| line.strip_prefix(key))?.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()?;
        Some(kib / 1024.0)
    })
}

/// The paper's baseline with every effect of the catalogue, at the usual sizes.
fn physics() -> Result<Model> {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    for definition in catalogue::definitions().filter(|definition| definition.notes.is_some_and(|notes| notes.searched)) {
        let effect = typical(definition, 1.0, &model);
        model.effects.push(effect);
    }
    model.check()?;
    Ok(model)
}

fn hybrid(set: &DataSet, history: usize, width: usize) -> Result<Hybrid> {
    let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
    let (model, inputs) = (physics()?, phyture::train::TrainConfig::default().inputs);
    let levels = if history.is_multiple_of(8) { 3 } else { 2 };
    let config = PhyTureConfig { history, d_model: width, levels, ..PhyTureConfig::default() }.into();
    let mut description = Description {
        scaling: sequence::scaling(&set.flights, &split.training, &model, &inputs, None, &config)?,
        model,
        config,
        inputs,
        linear: None,
        gate: PerChannel::splat(1.0),
        step_s: 0.01,
        envelope: None,
        intervals: None,
    };
    description.set_envelope(&set.flights, &split.training)?;
    let weights = description.network(false)?.initial(1);
    let mut hybrid = Hybrid::new(description, weights)?;
    hybrid.set_intervals(&set.flights, &split.training, &windows(&split.training, history, 500), Threads(1))?;
    Ok(hybrid)
}

/// Sleeps to the next multiple of `step` and times what is done then, s.
fn paced(samples: usize, step: Duration, mut work: impl FnMut(usize) -> Result<()>) -> Result<Vec<f64>> {
    let begun = Instant::now();
    let mut seconds = Vec::with_capacity(samples);
    for sample in 0..samples {
        let tick = begun + step * sample as u32;
        std::thread::sleep(tick.saturating_duration_since(Instant::now()));
        let start = Instant::now();
        work(sample)?;
        seconds.push(start.elapsed().as_secs_f64());
    }
    Ok(seconds)
}

fn run(history: usize, width: usize, seconds: usize, every: NonZeroUsize) -> Result<String> {
    let set = simulate(&Simulation { minutes: 3.0, seed: 8, ..Simulation::default() })?;
    let hybrid = hybrid(&set, history, width)?;
    let states: Vec<[f64; 16]> =
        set.flights.iter().flat_map(|flight| (0..flight.len()).map(|sample| flight.state(sample))).collect();
    let (before, step) = (memory_mib()[1], Duration::from_millis(10));
    let mut stream = hybrid.stream()?;
    stream.set_network_every(every);
    let at = |sample: usize| &states[sample % states.len()];
    // The history is filled before the clock counts.
    for sample in 0..history {
        stream.push(at(sample))?;
    }
    let whole = paced(seconds * 100, step, |sample| {
        let parts = stream.push_parts(at(history + sample), &[])?;
        match parts.acceleration.is_some() && parts.half_width.is_some() && parts.place.is_some() {
            true => Ok(()),
            false => Err(Error::Undetermined(format!("sample {sample} has no prediction, no interval or no place"))),
        }
    })?;
    let of_stream = memory_mib()[1].zip(before).map(|(after, before)| after - before);
    let mut alone = hybrid.description().model.stream(0.01)?;
    let physics = paced((seconds * 100).min(1000), step, |sample| alone.push(at(sample)).map(|_| ()))?;
    let line = serde_json::json!({
        "seconds": whole, "physics_seconds": physics, "stream_mib": of_stream, "resident_mib": memory_mib()[1],
        "version": format!("phyture {}", env!("CARGO_PKG_VERSION")),
    });
    Ok(line.to_string())
}

fn main() -> std::process::ExitCode {
    let numbers: Vec<usize> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let (sizes, every) = match numbers.as_slice() {
        [sizes @ .., every] if sizes.len() == 3 => (sizes, NonZeroUsize::new(*every)),
        sizes => (sizes, NonZeroUsize::new(1)),
    };
    let (&[history, width, seconds], Some(every)) = (sizes, every) else {
        // `cargo test` may start benches too; there is nothing to check here.
        eprintln!("usage: HISTORY WIDTH SECONDS [EVERY]");
        return std::process::ExitCode::SUCCESS;
    };
    match run(history, width, seconds, every) {
        Ok(line) => {
            println!("{line}");
            std::process::ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            std::process::ExitCode::FAILURE
        }
    }
}
