//! `predict`: the accelerations that a hybrid or a model predicts, as CSV or Parquet.

use crate::arguments::{Data, STRIDES, count};
use crate::context::Context;
use crate::output::Progress;
use phyture::critique::coverage::outside;
use phyture::flight::windows::windows;
use phyture::flight::write::{self, Values};
use phyture::flight::{Channel, DataSet, Flight, PerChannel, Span, Window};
use phyture::hybrid::envelope::Envelope;
use phyture::hybrid::intervals::Intervals;
use phyture::hybrid::{Hybrid, check_finite};
use phyture::physics::Model;
use phyture::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Predictions for every sample: of a network, where there is a full history; or of a model alone
///
/// Where the network has intervals, half of each stands in a column `…_half_width`; where it has an envelope, `outside` names the quantity that
/// is farthest beyond what calibration and training saw (`all together` where each by itself is within), and is empty inside.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture predict flights -n run -o predictions.parquet\n  phyture predict flights -m n9-calibrated.toml -o physics.csv     # physics alone"
)]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file: predicts alone without -n; with -n it has to be the run's own, which is taken where it is left out
    #[arg(short, long, required_unless_present = "network")]
    pub model: Option<PathBuf>,
    /// Run folder
    #[arg(short, long)]
    pub network: Option<PathBuf>,
    /// File to write: .csv or .parquet
    #[arg(short, long)]
    pub output: PathBuf,
    /// Samples between predictions
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_parser = count(STRIDES))]
    pub stride: usize,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    predictions: PathBuf,
    /// `hybrid` or `physics`.
    of: &'static str,
    rows: usize,
    flights: usize,
}

/// A network by its run folder or by its file.
pub fn read_network(path: &Path) -> Result<Hybrid> {
    Hybrid::read(&if path.is_dir() { path.join("network.safetensors") } else { path.into() })
}

/// A file that can be written, by its ending.
#[derive(Clone, Copy)]
enum Format {
    Csv,
    Parquet,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            _ => Err(Error::Config {
                place: "command line".into(),
                field: "--output".into(),
                found: format!("`{}`", path.display()),
                expected: "a file that ends in .csv or .parquet".into(),
            }),
        }
    }
}

/// What predicts.
enum Predictor {
    Hybrid(Box<Hybrid>),
    Physics(Model),
}

impl Predictor {
    fn new(wanted: &Args) -> Result<Self> {
        let model = wanted.model.as_ref().map(Model::read).transpose()?;
        let Some(network) = &wanted.network else {
            return model.map(Self::Physics).ok_or_else(|| Error::Config {
                place: "command line".into(),
                field: "--model, --network".into(),
                found: "neither".into(),
                expected: "a model, a network, or both".into(),
            });
        };
        let hybrid = read_network(network)?;
        match (&wanted.model, model) {
            (Some(path), Some(model)) if model.effects != hybrid.description().model.effects => Err(Error::Config {
                place: path.display().to_string(),
                field: "effect".into(),
                found: "effects or coefficients other than those the network was trained on".into(),
                expected: "the model of the run (a residual belongs to its baseline); train again, or leave out -m".into(),
            }),
            _ => Ok(Self::Hybrid(Box::new(hybrid))),
        }
    }

    const fn name(&self) -> &'static str {
        match self {
            Self::Hybrid(_) => "hybrid",
            Self::Physics(_) => "physics",
        }
    }

    /// What the network says of its own limits.
    const fn limits(&self) -> (Option<&Intervals>, Option<&Envelope>) {
        match self {
            Self::Hybrid(hybrid) => (hybrid.description().intervals.as_ref(), hybrid.description().envelope.as_ref()),
            Self::Physics(_) => (None, None),
        }
    }

    const fn model(&self) -> &Model {
        match self {
            Self::Hybrid(hybrid) => &hybrid.description().model,
            Self::Physics(model) => model,
        }
    }

    /// Samples that a prediction needs.
    fn history(&self) -> usize {
        match self {
            Self::Hybrid(hybrid) => hybrid.description().config.history(),
            Self::Physics(_) => 1,
        }
    }

    /// At the windows of one flight, all of them finite.
    fn predict(&self, context: &Context, flight: &Flight, windows: &[Window]) -> Result<Vec<PerChannel<f64>>> {
        match self {
            Self::Hybrid(hybrid) => hybrid.predict(std::slice::from_ref(flight), windows, context.threads()),
            Self::Physics(model) => {
                let columns = model.predict(flight)?;
                let at = |window: &Window| {
                    let values = PerChannel::from_fn(|channel| columns[channel][window.last]);
                    check_finite(flight, window.last, &values).map(|()| values)
                };
                windows.iter().map(at).collect()
            }
        }
    }
}

/// Predicts and writes one table: flight, manoeuvre, t, measured and predicted accelerations.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let format = Format::of(&wanted.output)?;
    let target = context.new_file(&wanted.output, &[])?;
    let predictor = Predictor::new(wanted)?;
    let history = predictor.history();
    let set = context.flights(&wanted.data, history)?;
    predictor.model().check_flights(&set.flights)?;
    let whole = |flight: usize| Span { flight, start: 0, end: set.flights[flight].len() };
    let all = windows(&(0..set.flights.len()).map(whole).collect::<Vec<_>>(), history, wanted.stride);
    let mut predicted = Vec::with_capacity(all.len());
    let mut progress = Progress::new("predicting", all.len() as u64, 0);
    for flight in &set.flights {
        // One flight at a time, so that there is something to show.
        let of_flight = windows(&[Span { flight: 0, start: 0, end: flight.len() }], history, wanted.stride);
        predicted.extend(predictor.predict(context, flight, &of_flight)?);
        progress.at(predicted.len() as u64, String::new);
    }
    drop(progress);
    write(context.ready(&target)?, format, &set, &Rows { windows: &all, predicted: &predicted, limits: predictor.limits() })?;
    let of = predictor.name();
    context.say(format!("{} predictions of the {of} written to {}", all.len(), wanted.output.display()));
    context.json(&Output { predictions: wanted.output.clone(), of, rows: all.len(), flights: set.flights.len() })?;
    Ok(ExitCode::SUCCESS)
}

/// What is written, a row a window.
struct Rows<'r> {
    windows: &'r [Window],
    predicted: &'r [PerChannel<f64>],
    limits: (Option<&'r Intervals>, Option<&'r Envelope>),
}

fn write(path: &Path, format: Format, set: &DataSet, rows: &Rows<'_>) -> Result<()> {
    let Rows { windows, predicted, limits: (intervals, envelope) } = *rows;
    let numbers = |value: &dyn Fn(usize) -> f64| (0..windows.len()).map(value).collect::<Vec<f64>>();
    let flight_of = |row: usize| &set.flights[windows[row].flight];
    let text = |value: &dyn Fn(usize) -> String| (0..windows.len()).map(value).collect::<Vec<String>>();
    let (manoeuvres, flights) = (text(&|row| flight_of(row).manoeuvre.clone()), text(&|row| flight_of(row).name.clone()));
    let mut columns = vec![("t".to_owned(), numbers(&|row| flight_of(row).time_s(windows[row].last)))];
    for channel in Channel::ALL {
        let column = channel.column();
        columns.push((column.name().to_owned(), numbers(&|row| flight_of(row).column(column)[windows[row].last])));
        columns.push((format!("{}_predicted", column.name()), numbers(&|row| predicted[row][channel])));
    }
    if let Some(intervals) = intervals {
        let half: Vec<PerChannel<f64>> =
            windows.iter().map(|window| intervals.half_width(&set.flights[window.flight].state(window.last))).collect();
        columns.extend(Channel::ALL.map(|channel| (format!("{}_half_width", channel.name()), numbers(&|row| half[row][channel]))));
    }
    let outside =
        envelope.map(|envelope| text(&|row| outside(envelope, flight_of(row), windows[row].last).unwrap_or_default().to_owned()));
    let mut table = vec![("manoeuvre", Values::Text(&manoeuvres)), ("flight", Values::Text(&flights))];
    table.extend(columns.iter().map(|(name, values)| (name.as_str(), Values::Numbers(values))));
    table.extend(outside.as_ref().map(|outside| ("outside", Values::Text(outside))));
    match format {
        Format::Csv => write::table_csv(path, &table),
        Format::Parquet => write::table_parquet(path, &table),
    }
}
