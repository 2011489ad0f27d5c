//! How long a prediction takes in flight: a hybrid fed at the rate of its log, sample by sample in real time, on one thread. Prints one JSON line.
//!
//! `cargo bench --features sim --bench latency -- HISTORY WIDTH SECONDS [EVERY] [FOLDER]`: a Phy-Ture of this history and width, untrained (time does
//! not depend on weights), on a physics with the whole catalogue switched on, with envelope and intervals; the network looks at every EVERY-th sample.
//! The same samples then go through the physics alone. Between samples the thread sleeps, as it does in flight, so caches and clock
//! are as cold as they are there. `run.py` beside it does the same with other programs, and makes the table.
//!
//! With a FOLDER, `hybrid.safetensors` and `window.safetensors` are left there: the weights, one window as the network sees it (`input.state` and
//! `input.physics`, standardised) and what the network says about it, on its unit scale (`output`), so that another program can compute the same.

use phyture::flight::split::{Protocol, Split};
use phyture::flight::windows::windows;
use phyture::flight::{DataSet, PerChannel, Window};
use phyture::hybrid::{Description, Hybrid, sequence};
use phyture::nn::PhyTureConfig;
use phyture::nn::safetensors::{Numbers, SafeTensors, Tensor};
use phyture::physics::{Model, catalogue, typical};
use phyture::sim::{Simulation, simulate};
use phyture::tape::Threads;
use phyture::{Error, Result};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Largest and present resident memory of this process, MiB; Linux tells.
fn memory_mib() -> [Option<f64>; 2] {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    ["VmHWM:", "VmRSS:"].map(|key| {
        let kib = status.lines().find_map(|line| line.strip_prefix(key))?.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()?;
        Some(kib / 1024.0)
    })
}

/// The paper's baseline with every effect of the catalogue that does not sum over listed rotors, at the usual sizes.
fn physics() -> Result<Model> {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    for definition in catalogue::definitions().filter(|definition| definition.notes.is_some_and(|notes| notes.searched)) {
        let effect = typical(definition, 1.0, &model);
        if !effect.reads_rotors() {
            model.effects.push(effect);
        }
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

/// Weights, a window and what the network says about it, for other programs.
fn exchange(folder: &Path, hybrid: &Hybrid, set: &DataSet, history: usize) -> Result<()> {
    let (description, window) = (hybrid.description(), Window { flight: 0, last: history });
    let flights = set.flights.get(..1).unwrap_or_default();
    let sequences = sequence::sequences(flights, description)?;
    let [sequence] = sequences.as_slice() else { unreachable!("a sequence for each flight") };
    let said = hybrid.predict(flights, &[window], Threads(1))?;
    let (baseline, scales) = (sequence.baseline(window.last), &description.scaling.output);
    let on_unit_scale = |said: &PerChannel<f64>| {
        PerChannel::from_fn(|channel| (said[channel] - baseline[channel] - scales[channel].mean) / scales[channel].deviation)
            .into_array()
    };
    let (mut state, mut physics) = (vec![0.0; history * description.inputs.len()], vec![0.0; history * 6]);
    sequence.history(window.last, &mut state, &mut physics);
    let rows = |numbers: Vec<f32>| Tensor { shape: vec![1, history, numbers.len() / history], numbers: Numbers::F32(numbers) };
    let tensors = [
        ("input.state".into(), rows(state)),
        ("input.physics".into(), rows(physics)),
        ("output".into(), Tensor { shape: vec![1, 1, 6], numbers: Numbers::F64(said.iter().flat_map(on_unit_scale).collect()) }),
    ];
    SafeTensors { metadata: [].into(), tensors: tensors.into() }.write(&folder.join("window.safetensors"))?;
    hybrid.write(&folder.join("hybrid.safetensors"))
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

fn run(history: usize, width: usize, seconds: usize, every: NonZeroUsize, folder: Option<&Path>) -> Result<String> {
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
    let resident = memory_mib()[1];
    // Last: what it frees would be counted to the stream.
    if let Some(folder) = folder {
        exchange(folder, &hybrid, &set, history)?;
    }
    let line = serde_json::json!({
        "seconds": whole, "physics_seconds": physics, "stream_mib": of_stream, "resident_mib": resident,
        "version": format!("phyture {}", env!("CARGO_PKG_VERSION")),
    });
    Ok(line.to_string())
}

fn main() -> std::process::ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let numbers: Vec<usize> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    let folder = arguments.iter().find(|argument| argument.parse::<usize>().is_err()).map(PathBuf::from);
    let (sizes, every) = match numbers.as_slice() {
        [sizes @ .., every] if sizes.len() == 3 => (sizes, NonZeroUsize::new(*every)),
        sizes => (sizes, NonZeroUsize::new(1)),
    };
    let (&[history, width, seconds], Some(every)) = (sizes, every) else {
        // `cargo test` may start benches too; there is nothing to check here.
        eprintln!("usage: HISTORY WIDTH SECONDS [EVERY] [FOLDER]");
        return std::process::ExitCode::SUCCESS;
    };
    match run(history, width, seconds, every, folder.as_deref()) {
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
