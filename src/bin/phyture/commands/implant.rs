//! `implant`: a known effect in recorded flights, with the truth written beside them.

use super::effect::find;
use crate::arguments::Data;
use crate::context::{Context, data_sha256};
use phyture::disk::write_atomically;
use phyture::flight::{Channel, Column, DataSet, Span, write};
use phyture::physics::{Effect, Model, calibrate, implant, spread_over_flights, typical};
use phyture::suggest::did_you_mean;
use phyture::{Error, Result};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Name of an effect that was given as a formula.
const IMPLANTED: &str = "implanted";

/// A factor.
fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().map_err(|error| error.to_string())?;
    if number.is_finite() { Ok(number) } else { Err("expected a finite number".into()) }
}

/// Add a known effect to recorded flights, so that the truth is known under real noise
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture implant flights implanted --effect ground_effect --scale 2 -m n9-calibrated.toml\n  phyture implant flights implanted --effect rotor_droop --size k=-0.2 --size tau_s=0.5\n  phyture implant flights implanted --formula \"wx_dot = 1.5*sin(3*height)\""
)]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Folder to write
    pub dir: PathBuf,
    /// Effect of the catalogue
    #[arg(long, required_unless_present = "formula", conflicts_with = "formula")]
    pub effect: Option<String>,
    /// Something else: `channel = formula`
    #[arg(long, value_name = "FORMULA")]
    pub formula: Option<String>,
    /// Times its usual size
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true, value_parser = finite)]
    pub scale: f64,
    /// A coefficient or parameter in place of the usual one; repeatable
    #[arg(long, value_name = "NAME=VALUE", conflicts_with = "formula")]
    pub size: Vec<String>,
    /// Calibrated model file [default: DATA/model.toml or the paper's baseline, calibrated on the flights]
    #[arg(short, long)]
    pub model: Option<PathBuf>,
}

/// Implants, writes the flights and `truth.json`.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let Args { data, dir: folder, .. } = wanted;
    let set = context.flights(data, 1)?;
    refuse_recorded(&set, &data.data, folder)?;
    let model = match &wanted.model {
        Some(path) => {
            let model = Model::read(path)?;
            model.check_flights(&set.flights)?;
            model
        }
        None => {
            let whole = |(flight, log): (usize, &phyture::flight::Flight)| Span { flight, start: 0, end: log.len() };
            let spans: Vec<Span> = set.flights.iter().enumerate().map(whole).collect();
            let model = context.model(None, data)?;
            context.say("no model given with -m: calibrated on these flights first");
            calibrate(&model, &set.flights, &spans)?.0
        }
    };
    let effect = match (wanted.effect.as_deref(), wanted.formula.as_deref()) {
        (Some(id), _) => sized(typical(find(id)?, wanted.scale, &model), &wanted.size)?,
        (None, Some(formula)) => of_formula(formula, wanted.scale)?,
        (None, None) => return Err(fault("--effect", "nothing".into(), "--effect EFFECT or --formula \"channel = formula\"")),
    };
    let effect = spread_over_flights(effect, &set.flights);
    let changed = implant(&set, &model, &effect)?;
    let new = context.new_folder(folder)?;
    write::data_set_csv(folder, &changed.flights)?;
    let rms = rms(&set, &changed);
    let truth = json!({
        "effect": wanted.effect.as_deref().unwrap_or(IMPLANTED),
        "scale": wanted.scale,
        "formulas": effect.to_string().lines().collect::<Vec<_>>(),
        "coefficients": effect.coefficients,
        "parameters": effect.parameters,
        "rms": rms,
        "data_sha256": data_sha256(&set),
        "version": env!("CARGO_PKG_VERSION"),
    });
    let text = serde_json::to_string_pretty(&truth).map_err(|error| Error::Undetermined(error.to_string()))?;
    write_atomically(folder.join("truth.json"), |file| writeln!(file, "{text}"))?;
    new.close()?;
    context.say(format!("\n{effect}\n"));
    for (channel, value) in rms.iter().filter(|(_, value)| value.as_f64() != Some(0.0)) {
        context.say(format!("{channel:<7} changed by {:.4} rms", value.as_f64().unwrap_or_default()));
    }
    context.say(format!("{} flights written to {} with truth.json", changed.flights.len(), folder.display()));
    context.json(&truth)?;
    Ok(ExitCode::SUCCESS)
}

/// Refuses a folder in which a recorded flight would be overwritten, whatever was forced: what is recorded cannot be had again.
fn refuse_recorded(set: &DataSet, data: &Path, folder: &Path) -> Result<()> {
    let recorded: BTreeSet<PathBuf> = set.source.files.iter().filter_map(|file| file.canonicalize().ok()).collect();
    let whole = |path: &Path| path.canonicalize().ok();
    let same = data.is_dir() && whole(data).is_some() && whole(data) == whole(folder);
    let written = set.flights.iter().map(|flight| write::csv_path(folder, flight));
    let hit = written.chain([folder.join("dataset.toml")]).find(|path| whole(path).is_some_and(|path| recorded.contains(&path)));
    let found = match (same, hit) {
        (true, _) => "the folder of the recorded flights".to_owned(),
        (false, Some(path)) => format!("a folder in which {} is a recorded flight or describes one", path.display()),
        (false, None) => return Ok(()),
    };
    Err(Error::Config {
        place: "command line".into(),
        field: "DIR".into(),
        found: format!("`{}`, {found}", folder.display()),
        expected: "another folder; implanted flights never take the place of the recorded ones, and no option changes that".into(),
    })
}

fn fault(field: &str, found: String, expected: &str) -> Error {
    Error::Config { place: "command line".into(), field: field.into(), found, expected: expected.into() }
}

/// Sets coefficients and parameters by `name=value`.
fn sized(mut effect: Effect, sizes: &[String]) -> Result<Effect> {
    for size in sizes {
        let (name, value) = size.split_once('=').unwrap_or((size, ""));
        let value: f64 = value
            .trim()
            .parse()
            .ok()
            .filter(|value: &f64| value.is_finite())
            .ok_or_else(|| fault("--size", format!("`{size}`"), "NAME=VALUE with a number, as in k=-0.2"))?;
        let coefficients = effect.coefficients.iter_mut().map(|coefficient| (&coefficient.name, &mut coefficient.value));
        let parameters = effect.parameters.iter_mut().map(|parameter| (&parameter.name, &mut parameter.value));
        let mut known: Vec<(&String, &mut f64)> = coefficients.chain(parameters).collect();
        match known.iter_mut().find(|(known, _)| *known == name.trim()) {
            Some((_, place)) => **place = value,
            None => {
                let hint = did_you_mean(name, known.iter().map(|(name, _)| name.as_str()));
                return Err(fault("--size", format!("`{name}`{hint}"), "a coefficient or parameter of the effect"));
            }
        }
    }
    Ok(effect)
}

/// `wx_dot = 1.5 * sin(3 * height)` as an effect.
fn of_formula(text: &str, scale: f64) -> Result<Effect> {
    let names = Channel::ALL.map(Channel::name);
    let (channel, formula) = text.split_once('=').map_or((text, ""), |(channel, formula)| (channel.trim(), formula.trim()));
    let channel = Channel::from_name(channel).ok_or_else(|| {
        let hint = did_you_mean(channel, names);
        fault(
            "--formula",
            format!("channel `{channel}`{hint}"),
            &format!("`channel = formula`, the channel one of {}", names.join(", ")),
        )
    })?;
    Effect::formula(IMPLANTED, channel, formula, scale)
}

/// Root mean square of what was added, by channel.
fn rms(before: &DataSet, after: &DataSet) -> Map<String, Value> {
    let rows: usize = before.flights.iter().map(phyture::flight::Flight::len).sum();
    let pairs = || before.flights.iter().zip(&after.flights);
    let squares = |column: Column| -> f64 {
        let of_flight = |(before, after): (&phyture::flight::Flight, &phyture::flight::Flight)| -> f64 {
            before.column(column).iter().zip(after.column(column)).map(|(before, after)| (after - before).powi(2)).sum()
        };
        pairs().map(of_flight).sum()
    };
    Column::TARGETS
        .into_iter()
        .map(|column| (column.name().to_owned(), json!((squares(column) / rows.max(1) as f64).sqrt())))
        .collect()
}
