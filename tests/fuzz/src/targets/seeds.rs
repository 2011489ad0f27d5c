//! What a fuzzer begins with: small inputs that each reader takes, made anew so that they are always of today's formats.

use super::logs::BETWEEN;
use super::{Folder, flight, networks};
use phyture::flight::{Column, write};
use phyture::formula::Formula;
use phyture::nn::Architecture;
use phyture::physics::{Effect, Model, Rotor, Turning, catalogue};
use phyture::train::TrainConfig;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The definitions of a log and half a second, cut in a message.
pub(super) const ULOG: &[u8] = include_bytes!("../../../../fixtures/logs/px4.ulg").split_at(KEPT).0;
const DATAFLASH: &[u8] = include_bytes!("../../../../fixtures/logs/ardupilot.bin").split_at(KEPT).0;
const KEPT: usize = 12_000;

/// The seeds of a target: texts from files, the rest made.
pub fn seeds(target: &str) -> Vec<Vec<u8>> {
    let is_seed = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("seed-"));
    let mut seeds: Vec<Vec<u8>> = hostile(target)
        .iter()
        .filter(|path| is_seed(path))
        .map(|path| std::fs::read(path).expect("a file that is there"))
        .collect();
    seeds.extend(match target {
        "csv" => vec![csv(&Column::ALL), csv(Column::STATE)],
        "parquet" => vec![parquet()],
        "ulog" => vec![ULOG.to_vec()],
        "dataflash" => vec![DATAFLASH.to_vec()],
        "stanford" => vec![stanford()],
        "model" => model_files(),
        "training" => training(),
        "network" => vec![networks::file()],
        "description" => vec![networks::description_text()],
        "checkpoint" => vec![networks::fresh_checkpoint()],
        _ => Vec::new(),
    });
    seeds
}

/// What lies in a folder of `fixtures/hostile`, wherever this is compiled.
pub fn hostile(folder: &str) -> Vec<PathBuf> {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|above| above.join("fixtures/hostile"));
    let root = above.into_iter().find(|root| root.is_dir()).expect("fixtures/hostile above the crate");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(root.join(folder)).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    files.sort();
    files
}

/// Rows of a log with these columns, with few digits.
fn csv(columns: &[Column]) -> Vec<u8> {
    let mut text = "t".to_owned();
    columns.iter().for_each(|column| text += &format!(",{}", column.name()));
    for row in 0..24 {
        // Writing to a String does not fail.
        let _ = write!(text, "\n{:.2}", flight().time_s(row));
        columns.iter().for_each(|column| text += &format!(",{:.3}", flight().column(*column)[row]));
    }
    text.into_bytes()
}

fn parquet() -> Vec<u8> {
    let folder = Folder::new();
    let path = folder.path("log.parquet");
    let short = flight().slice(0..24, "a").expect("some samples");
    write::parquet(&short, &path).expect("a flight can be written");
    std::fs::read(path).expect("what was written can be read")
}

fn stanford() -> Vec<u8> {
    let folder = Folder::new();
    let mut flight = flight().slice(0..24, "a").expect("some samples");
    flight.name = "a".into();
    write::stanford(&folder.path(""), &[flight]).expect("a flight can be written");
    let part = |name: &str| std::fs::read(folder.path(name)).expect("what was written can be read");
    [&part("a/smoother.txt"), BETWEEN, &part("a/controls.txt")].concat()
}

/// The baseline, and the baseline with every effect of the catalogue.
fn model_files() -> Vec<Vec<u8>> {
    let baseline = Model::paper("small", 4.58, [0.18, 0.34, 0.28], 0.8);
    let mut whole = baseline.clone();
    let known: Vec<&str> = whole.effects.iter().map(|effect| effect.kind.as_str()).collect();
    let others: Vec<Effect> =
        catalogue::definitions().filter(|other| !known.contains(&other.kind)).map(|other| other.effect(4.58, 0.8)).collect();
    whole.effects.extend(others);
    whole.rotors = vec![Rotor {
        speed: Formula::parse("lag(300 + 50 * u4, 0.03)").expect("a formula"),
        position_m: [0.1, -0.1, 0.0],
        axis: [0.0, 0.1, -1.0],
        turns: Turning::Clockwise,
    }];
    [baseline, whole].iter().filter_map(|model| model.to_toml().ok()).map(String::into_bytes).collect()
}

fn training() -> Vec<Vec<u8>> {
    let configs = [TrainConfig::default(), TrainConfig::in_minutes()];
    let mut files: Vec<Vec<u8>> = configs.iter().filter_map(|config| config.template().ok()).map(String::into_bytes).collect();
    let kinds =
        Architecture::KINDS.iter().map(|kind| format!("epochs = 3\n[network]\nkind = \"{kind}\"\nhistory = 64\n").into_bytes());
    files.extend(kinds);
    files
}
