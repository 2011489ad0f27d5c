//! `compare`: measured against predicted for every model and network given, beside honest yardsticks.

use super::explainable;
use super::predict::read_network;
use crate::arguments::{Data, Division, STRIDES, count};
use crate::context::{Context, data_sha256};
use phyture::critique::diagnose::{Met, met};
use phyture::critique::shares::{self, shares};
use phyture::critique::table::ordinal;
use phyture::critique::uncertainty::{Effort, uncertainty};
use phyture::critique::wrap::wrapped;
use phyture::critique::{Comparison, Row, compare, finite_difference, floor, ridge};
use phyture::disk::{Target, write_atomically};
use phyture::flight::split::{Part, Split};
use phyture::flight::windows::windows;
use phyture::flight::{DataSet, Flight, Span, Window};
use phyture::hybrid::Hybrid;
use phyture::hybrid::linear::LinearConfig;
use phyture::physics::Model;
pub use phyture::report::DATA_NOTE;
use phyture::report::{CompareReport, Page, compare_page, page};
use phyture::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Measured against predicted for each model given, per channel, manoeuvre and regime
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture compare flights -m n9-calibrated.toml -n run --report report\n  phyture compare flights -m n9-calibrated.toml --explainable floor     # simulated flights: with the floor"
)]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file; repeatable
    #[arg(short, long, required_unless_present = "network")]
    pub model: Vec<PathBuf>,
    /// Trained network: a run folder; repeatable
    #[arg(short, long)]
    pub network: Vec<PathBuf>,
    /// Folder for the page comparison.html
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Samples between evaluated windows [default: 1, or what lets the networks take about a minute]
    #[arg(long, allow_negative_numbers = true, value_parser = count(STRIDES))]
    pub stride: Option<usize>,
    /// Evaluate every flight, also those that were trained on
    #[arg(long)]
    pub all: bool,
    /// Add a ridge regression on so many lags (1 to 157), fitted on the training part, as a further row
    #[arg(long, value_name = "LAGS", allow_negative_numbers = true, value_parser = count(1..=LinearConfig::MOST_LAGS))]
    pub ridge: Option<usize>,
    /// Show how far each network's prediction moves with the intervals of its model's coefficients
    #[arg(long, requires = "network")]
    pub uncertainty: bool,
    /// Explainable part of simulated flights, as `simulate --explainable` writes it: adds the floor that no model can go below
    #[arg(long, value_name = "DIR")]
    pub explainable: Option<PathBuf>,
    /// What trains and what tests.
    #[command(flatten)]
    pub division: Division,
}

/// Compares on the test part (locked flights where there are any) and prints; writes the page if asked to.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let Args { data, division, explainable: truth, .. } = wanted;
    let page = wanted.report.as_deref().map(|folder| context.new_page(folder, "comparison.html")).transpose()?;
    truth.as_deref().map_or(Ok(()), |folder| explainable::apart(data, folder))?;
    let networks = wanted.network.iter().map(|path| Ok((name(path), read_network(path)?))).collect::<Result<Vec<_>>>()?;
    let models = wanted.model.iter().map(|path| Ok((name(path), Model::read(path)?))).collect::<Result<Vec<_>>>()?;
    let history = networks.iter().map(|(_, hybrid)| hybrid.description().config.history()).max().unwrap_or(1);
    let set = context.flights(data, history)?;
    let of_networks = networks.iter().map(|(_, hybrid)| &hybrid.description().model);
    models.iter().map(|(_, model)| model).chain(of_networks).try_for_each(|model| model.check_flights(&set.flights))?;
    let first = models.first().map(|(_, model)| model).or_else(|| networks.first().map(|(_, hybrid)| &hybrid.description().model));
    let Some(first) = first else {
        return Err(Error::Config {
            place: "command line".into(),
            field: "--model".into(),
            found: "nothing".into(),
            expected: "a model file or a network".into(),
        });
    };
    let mut split = context.split(&set.flights, first, division);
    if wanted.all {
        let whole: Vec<Span> =
            set.flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
        split = Ok(Split {
            training: split.map(|split| split.training).unwrap_or_default(),
            validation: Vec::new(),
            test: whole,
            tested: Part::All,
        });
    }
    let split = split?;
    let rows_needed = history.max(wanted.ridge.unwrap_or(1)).max(2);
    let stride = match wanted.stride {
        Some(stride) => stride,
        None => affordable(context, &set, &windows(&split.test, rows_needed, 1), &networks)?,
    };
    let contest = Contest {
        models: &models,
        networks: &networks,
        ridge: wanted.ridge,
        history: rows_needed,
        stride,
        uncertainty: wanted.uncertainty,
    };
    let mut result = contest.run(context, &set, &split)?;
    if let Some(folder) = truth {
        result.set_floor(&set, &explainable::read(data, folder)?)?;
    }
    context.say(format!("\n{}", result.comparison));
    if let Some(target) = page {
        let own = [
            ("data".to_owned(), data.data.display().to_string()),
            ("SHA-256 of the data".to_owned(), data_sha256(&set)),
            ("seed".to_owned(), context.seed().to_string()),
        ];
        let notes = set.notes.iter().map(|note| (DATA_NOTE.to_owned(), note.clone()));
        let provenance: Vec<(String, String)> = own.into_iter().chain(notes).collect();
        write_page(&result.page(&set, &provenance)?, &target)?;
        context.say(format!("report: {}", target.path().display()));
    }
    context.json(&result.comparison)?;
    Ok(ExitCode::SUCCESS)
}

/// Time that the networks together may take by default, s.
const BUDGET_S: f64 = 60.0;
/// A measurement of their speed takes about this long, s.
const MEASURED_S: f64 = 0.3;
/// Windows of the first measurement.
const FIRST_WINDOWS: usize = 16;

/// Samples from one window to the next with which all networks take at most about a minute: 1 where they can do every window.
///
/// Measured on a few windows, more of them until it takes long enough to be a measure; then rounded up to 1, 2 or 5 times a power of ten,
/// so that the next run on this machine most likely has the same.
fn affordable(context: &Context, set: &DataSet, every: &[Window], networks: &[(String, Hybrid)]) -> Result<usize> {
    let mut seconds = 0.0;
    for (_, hybrid) in networks {
        let mut count = FIRST_WINDOWS;
        loop {
            let some = every.get(..count).unwrap_or(every);
            let begun = Instant::now();
            hybrid.stages(&set.flights, some, context.threads())?;
            let gone = begun.elapsed().as_secs_f64();
            if gone >= MEASURED_S || some.len() == every.len() {
                seconds += gone / some.len().max(1) as f64;
                break;
            }
            count *= 4;
        }
    }
    let stride = round_stride(seconds * every.len() as f64 / BUDGET_S);
    if stride > 1 {
        let all = seconds * every.len() as f64;
        context.say(wrapped(
            "",
            &format!(
                "every {stride}{} sample is judged, the same for all rows: every sample would take the networks about {:.0} min \
                 (`--stride 1`)",
                ordinal(stride),
                all / 60.0
            ),
        ));
    }
    Ok(stride)
}

/// The smallest of 1, 2, 5, 10, 20, 50 … that is no less than `wanted`.
fn round_stride(wanted: f64) -> usize {
    let mut power = 1;
    loop {
        for factor in [1, 2, 5] {
            let stride = factor * power;
            if stride as f64 >= wanted || stride >= 1_000_000 {
                return stride;
            }
        }
        power *= 10;
    }
}

fn name(path: &Path) -> String {
    path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned())
}

/// Who is compared, and on what.
pub struct Contest<'a> {
    /// Physical models by name.
    pub models: &'a [(String, Model)],
    /// Hybrids by name.
    pub networks: &'a [(String, Hybrid)],
    /// Lags of a ridge regression fitted on the training part, if it is wanted.
    pub ridge: Option<usize>,
    /// Rows that every window must have before it is judged: the longest history of all.
    pub history: usize,
    /// Samples between windows.
    pub stride: usize,
    /// Whether the uncertainty of the physical coefficients is carried through the networks.
    pub uncertainty: bool,
}

/// A comparison and what it was made from.
pub struct Judged {
    /// The numbers.
    pub comparison: Comparison,
    windows: Vec<Window>,
    rows: Vec<Row>,
    focus: usize,
}

impl Contest<'_> {
    /// Predicts and compares on the test part of `split`. The yardsticks come first, the models after them.
    pub fn run(&self, context: &Context, set: &DataSet, split: &Split) -> Result<Judged> {
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Model> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        let Met { models: met, judged: spans, own_from_first_half } = met(&set.flights, &all, &split.test)?;
        let (models, of_networks) = met.split_at(self.models.len());
        let windows = windows(&spans, self.history, self.stride);
        if windows.is_empty() {
            return Err(Error::Undetermined(format!(
                "no run of test samples is as long as the {} samples of history{}; give longer flights or lock whole flights with --lock",
                self.history,
                if own_from_first_half {
                    ", second halves of flights judging models that know each flight from its first"
                } else {
                    ""
                }
            )));
        }
        let mut rows = vec![finite_difference(&set.flights, &windows)?];
        if let Some(lags) = self.ridge {
            let training = phyture::flight::windows::windows(&split.training, lags, 1);
            rows.push(ridge(&set.flights, &training, &windows, &LinearConfig { lags, ..LinearConfig::default() })?);
        }
        for ((name, _), model) in self.models.iter().zip(models) {
            let columns = set.flights.iter().map(|flight| model.predict(flight)).collect::<Result<Vec<_>>>()?;
            let at = |window: &Window| std::array::from_fn(|channel| columns[window.flight][channel][window.last]);
            rows.push(Row { name: name.clone(), predicted: windows.iter().map(at).collect() });
        }
        let reference = rows.len() - self.models.len();
        let mut judged = Vec::new();
        let networks = self.networks.iter().zip(of_networks).map(|((name, hybrid), model)| Ok((name, hybrid.on(model.clone())?)));
        let networks: Vec<(&String, Hybrid)> = networks.collect::<Result<_>>()?;
        for (name, hybrid) in &networks {
            let stages = hybrid.stages(&set.flights, &windows, context.threads())?;
            let own = &hybrid.description().model;
            // The first model is what the shares are of, unless the network was trained on that very model.
            let other = models.first().is_some_and(|model| model.effects != own.effects);
            let same = models.iter().position(|model| model.effects == own.effects);
            let model = same.map_or(&own.name, |index| &self.models[index].0);
            let row = other.then(|| rows.get(reference)).flatten();
            judged.push(shares(&set.flights, &windows, row, &shares::Judged { name, model, stages: &stages })?);
            rows.push(Row { name: (*name).clone(), predicted: stages.hybrid });
        }
        let mut comparison = compare(&set.flights, &windows, &rows, split.tested)?;
        comparison.stride = self.stride;
        comparison.own_from_first_half = own_from_first_half;
        comparison.shares = judged;
        for (name, hybrid) in networks.iter().filter(|_| self.uncertainty) {
            let effort = Effort::for_history(hybrid.description().config.history(), context.seed());
            comparison.uncertainty.push(uncertainty(name, hybrid, &set.flights, &windows, effort, context.threads())?);
        }
        Ok(Judged { comparison, windows, focus: rows.len() - 1, rows })
    }
}

impl Judged {
    /// Adds the floor, from the explainable part of the flights.
    pub fn set_floor(&mut self, set: &DataSet, explainable: &[Flight]) -> Result<()> {
        self.comparison.set_floor(floor(&set.flights, &self.windows, explainable)?);
        Ok(())
    }

    /// The page, to be written or put into a larger one.
    pub fn page(&self, set: &DataSet, provenance: &[(String, String)]) -> Result<Page> {
        compare_page(&CompareReport {
            comparison: &self.comparison,
            flights: &set.flights,
            windows: &self.windows,
            rows: &self.rows,
            focus: self.focus,
            yardstick: Some(0),
            provenance,
        })
    }
}

/// Writes a page.
pub fn write_page(content: &Page, target: &Target) -> Result<()> {
    let html = page(content);
    write_atomically(target.path(), |file| file.write_all(html.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::round_stride;

    #[test]
    fn strides_are_one_two_or_five_times_a_power_of_ten_and_never_too_small() {
        for (wanted, stride) in
            [(0.0, 1), (1.0, 1), (1.01, 2), (2.5, 5), (5.1, 10), (73.0, 100), (101.0, 200), (f64::INFINITY, 1_000_000)]
        {
            assert_eq!(round_stride(wanted), stride, "{wanted}");
        }
    }
}
