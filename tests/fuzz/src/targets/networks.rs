//! Networks, what stands beside their weights, training configurations, and checkpoints: a file's sizes are claims, and what is read can be used.

use super::{Folder, check_error, flight};
use phyture::flight::Span;
use phyture::flight::split::{Part, Split};
use phyture::hybrid::Hybrid;
use phyture::nn::safetensors::SafeTensors;
use phyture::nn::{Network, OutputScale, PhyTureConfig};
use phyture::physics::Model;
use phyture::tape::Threads;
use phyture::train::{Job, RunFolder, State, TrainConfig, Trainer, container};
use std::path::Path;
use std::sync::OnceLock;

/// Under this key a network's file has everything but the weights.
const KEY: &str = "phyture_hybrid";

/// History of a network that is flown with, samples.
const LONGEST_FLOWN: usize = 48;

/// Bytes of a checkpoint before its payload: magic, version, length, checksum.
const HEAD: usize = 8 + 4 + 8 + 4;

/// The digest of the small run's data.
const DATA: u64 = 7;

/// A run that is small enough to be done a thousand times a second, prepared and not trained.
struct Small {
    config: TrainConfig,
    job: Job,
    network: Network<f32>,
    file: SafeTensors,
}

fn small() -> &'static Small {
    static SMALL: OnceLock<Small> = OnceLock::new();
    SMALL.get_or_init(|| made().expect("a small network"))
}

fn made() -> phyture::Result<Small> {
    let sizes = PhyTureConfig {
        history: 4,
        state_channels: 2,
        d_model: 2,
        heads: 1,
        levels: 1,
        stacks: 1,
        moving_average: 3,
        ..PhyTureConfig::default()
    };
    let config = TrainConfig {
        network: sizes.into(),
        inputs: vec!["vx".into(), "lag(u1, 0.1)".into()],
        epochs: 2,
        batch: 2,
        stride: 8,
        ..TrainConfig::default()
    };
    let span = |start, end| vec![Span { flight: 0, start, end }];
    let split = Split { training: span(0, 40), validation: Vec::new(), test: span(40, 50), tested: Part::Test };
    let flights = std::slice::from_ref(flight());
    let model = Model::paper("small", 4.58, [0.18, 0.34, 0.28], 0.8);
    let job = Job::new(flights, &split, &model, &config)?;
    let network = job.description.network(false)?;
    let folder = Folder::new();
    let path = folder.path("network.safetensors");
    Hybrid::new(job.description.clone(), network.initial(1))?.write(&path)?;
    let file = SafeTensors::read(&path)?;
    Ok(Small { config, job, network, file })
}

/// The small network's file.
pub(super) fn file() -> Vec<u8> {
    small().file.to_bytes()
}

/// What stands in it beside the weights.
pub(super) fn description_text() -> Vec<u8> {
    small().file.metadata.get(KEY).map_or_else(Vec::new, |text| text.clone().into_bytes())
}

/// A checkpoint of the small run before its first step.
pub(super) fn fresh_checkpoint() -> Vec<u8> {
    let Small { config, job, network, .. } = small();
    let trainer = Trainer::new(config, network, &job.sequences, &job.windows, None, Threads(1)).expect("a run that begins");
    let folder = Folder::new();
    let path = folder.path("checkpoint.phyture");
    let text = serde_json::to_string(config).expect("a configuration is JSON");
    container::write(&path, &(text, DATA, trainer.state())).expect("a checkpoint can be written");
    std::fs::read(path).expect("what was written can be read")
}

/// A training configuration: what it writes reads back the same.
pub fn training(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let (path, base) = (Path::new("train.toml"), TrainConfig::default());
    let config = match TrainConfig::from_text(text, path, &base) {
        Ok(config) => config,
        Err(error) => return check_error(&error, &["train.toml"]),
    };
    // TOML has no seeds beyond 2^63.
    let Ok(written) = config.template() else { return true };
    let again = TrainConfig::from_text(&written, path, &base).expect("what was written can be read");
    assert!(again == config, "another configuration comes back:\n{written}");
    let _ = Network::<f32>::new(&config.network, &OutputScale::unit(config.network.outputs()), false);
    true
}

/// A file of weights, and of a network where it says that it is one.
pub fn network(bytes: &[u8]) -> bool {
    if let Ok(file) = SafeTensors::parse(bytes) {
        let written = file.to_bytes();
        let again = SafeTensors::parse(&written).expect("what was written can be read");
        assert!(again.to_bytes() == written, "other weights come back");
    }
    let folder = Folder::new();
    hybrid(&folder, &folder.put("network.safetensors", bytes))
}

/// What stands beside the weights, with the weights of a small network.
pub fn description(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let mut file = small().file.clone();
    file.metadata.insert(KEY.into(), text.into());
    let folder = Folder::new();
    hybrid(&folder, &folder.put("network.safetensors", &file.to_bytes()))
}

/// Reads a network, writes it, and flies with it.
fn hybrid(folder: &Folder, path: &Path) -> bool {
    let hybrid = match Hybrid::read(path) {
        Ok(hybrid) => hybrid,
        Err(error) => return check_error(&error, &["network.safetensors"]),
    };
    let again = folder.path("again.safetensors");
    hybrid.write(&again).expect("what was read can be written");
    let again = Hybrid::read(&again).expect("what was written can be read");
    assert!(again.description() == hybrid.description(), "another network comes back");
    // Longer ones are no danger, and work for minutes.
    if hybrid.description().config.history() > LONGEST_FLOWN {
        return true;
    }
    let Ok(mut stream) = hybrid.stream() else { return true };
    let own = vec![0.5; stream.own_columns().len()];
    for sample in 0..stream.history() + 2 {
        let _ = stream.push_parts(&flight().state(sample), &own);
    }
    true
}

/// A checkpoint as it is; and its payload alone, which a checksum would keep from every fuzzer.
pub fn checkpoint(bytes: &[u8]) -> bool {
    let is_taken = resume(bytes);
    let folder = Folder::new();
    let path = folder.path("checkpoint.phyture");
    container::write(&path, &()).expect("an empty checkpoint can be written");
    let mut whole = std::fs::read(&path).expect("what was written can be read");
    let payload = bytes.get(HEAD..).unwrap_or_default();
    whole.truncate(HEAD - 12);
    whole.extend((payload.len() as u64).to_le_bytes());
    whole.extend(crc32fast::hash(payload).to_le_bytes());
    whole.extend(payload);
    resume(&whole) || is_taken
}

/// Resumes the small run, one step, where a checkpoint is accepted.
fn resume(bytes: &[u8]) -> bool {
    let Small { config, job, network, .. } = small();
    let folder = Folder::new();
    folder.put("run/checkpoint.phyture", bytes);
    let run = RunFolder::create(folder.path("run")).expect("a run folder");
    let state = match run.resume(config, DATA) {
        Ok(state) => state,
        Err(error) => return check_error(&error, &["checkpoint.phyture"]),
    };
    let path = folder.path("again");
    container::write(&path, &state).expect("what was read can be written");
    let again: State = container::read(&path).expect("what was written can be read");
    container::write(&folder.path("twice"), &again).expect("what was read can be written");
    assert!(std::fs::read(&path).ok() == std::fs::read(folder.path("twice")).ok(), "another state comes back");
    let resumed = Trainer::new(config, network, &job.sequences, &job.windows, Some(state), Threads(1));
    let Ok(mut trainer) = resumed else { return true };
    let _ = trainer.step();
    true
}
