//! `compare`: measured against predicted for every model and network given, beside honest yardsticks.

use super::predict::read_network;
use super::{Context, data_sha256};
use crate::arguments::{Data, Division};
use phyture::critique::shares::{self, shares};
use phyture::critique::uncertainty::{Effort, uncertainty};
use phyture::critique::{Comparison, Row, compare, finite_difference, ridge};
use phyture::disk::{Target, write_atomically};
use phyture::flight::split::{Part, Split};
use phyture::flight::windows::{TEST_STRIDE, windows};
use phyture::flight::{DataSet, Span, Window};
use phyture::hybrid::Hybrid;
use phyture::hybrid::linear::LinearConfig;
use phyture::physics::Model;
use phyture::report::{CompareReport, Page, compare_page, page};
use phyture::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What was asked for.
pub struct Wanted<'a> {
    /// Model files.
    pub models: &'a [PathBuf],
    /// Run folders.
    pub networks: &'a [PathBuf],
    /// Folder for the page.
    pub report: Option<&'a Path>,
    /// Samples between windows.
    pub stride: Option<usize>,
    /// Every flight, not the test part.
    pub all: bool,
    /// Lags of a ridge regression beside the models.
    pub ridge: Option<usize>,
    /// How far the networks' predictions move with the intervals of their models' coefficients.
    pub uncertainty: bool,
}

/// Compares on the test part (locked flights where there are any) and prints; writes the page if asked to.
pub fn run(context: &Context, data: &Data, wanted: &Wanted, division: &Division) -> Result<ExitCode> {
    let page = wanted.report.map(|folder| context.new_page(folder, "comparison.html")).transpose()?;
    let networks = wanted.networks.iter().map(|path| Ok((name(path), read_network(path)?))).collect::<Result<Vec<_>>>()?;
    let models = wanted.models.iter().map(|path| Ok((name(path), Model::read(path)?))).collect::<Result<Vec<_>>>()?;
    let history = networks.iter().map(|(_, hybrid)| hybrid.description().config.history()).max().unwrap_or(1);
    let set = context.flights(data, history)?;
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
    let stride = wanted.stride.unwrap_or(if networks.is_empty() { 1 } else { TEST_STRIDE });
    let rows_needed = history.max(wanted.ridge.unwrap_or(1)).max(2);
    let contest = Contest {
        models: &models,
        networks: &networks,
        ridge: wanted.ridge,
        history: rows_needed,
        stride,
        uncertainty: wanted.uncertainty,
    };
    let result = contest.run(context, &set, &split)?;
    context.say(format!("\n{}", result.comparison));
    if let Some(target) = page {
        let provenance = [
            ("data".to_owned(), data.data.display().to_string()),
            ("SHA-256 of the data".to_owned(), data_sha256(data)?),
            ("seed".to_owned(), context.seed().to_string()),
        ];
        write_page(&result.page(&set, &provenance)?, &target)?;
        context.say(format!("report: {}", target.path().display()));
    }
    context.json(&result.comparison)?;
    Ok(ExitCode::SUCCESS)
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
        let windows = windows(&split.test, self.history, self.stride);
        if windows.is_empty() {
            return Err(Error::Undetermined(format!(
                "no run of test samples is as long as the {} samples of history; give longer flights or lock whole flights with --lock",
                self.history
            )));
        }
        let mut rows = vec![finite_difference(&set.flights, &windows)?];
        if let Some(lags) = self.ridge {
            let training = phyture::flight::windows::windows(&split.training, lags, 1);
            rows.push(ridge(&set.flights, &training, &windows, &LinearConfig { lags, ..LinearConfig::default() })?);
        }
        for (name, model) in self.models {
            let columns = set.flights.iter().map(|flight| model.predict(flight)).collect::<Result<Vec<_>>>()?;
            let at = |window: &Window| std::array::from_fn(|channel| columns[window.flight][channel][window.last]);
            rows.push(Row { name: name.clone(), predicted: windows.iter().map(at).collect() });
        }
        let reference = rows.len() - self.models.len();
        let mut judged = Vec::new();
        for (name, hybrid) in self.networks {
            let stages = hybrid.stages(&set.flights, &windows, context.threads())?;
            let own = &hybrid.description().model;
            // The first model is what the shares are of, unless the network was trained on that very model.
            let other = self.models.first().is_some_and(|(_, model)| model.effects != own.effects);
            let model = self.models.iter().find(|(_, model)| model.effects == own.effects).map_or(&own.name, |(name, _)| name);
            let row = other.then(|| rows.get(reference)).flatten();
            judged.push(shares(&set.flights, &windows, row, &shares::Judged { name, model, stages: &stages })?);
            rows.push(Row { name: name.clone(), predicted: stages.hybrid });
        }
        let mut comparison = compare(&set.flights, &windows, &rows, split.tested)?;
        comparison.shares = judged;
        for (name, hybrid) in self.networks.iter().filter(|_| self.uncertainty) {
            let effort = Effort::for_history(hybrid.description().config.history(), context.seed());
            comparison.uncertainty.push(uncertainty(name, hybrid, &set.flights, &windows, effort, context.threads())?);
        }
        Ok(Judged { comparison, windows, focus: rows.len() - 1, rows })
    }
}

impl Judged {
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
