//! `compare`: measured against predicted for every model and network given, beside honest yardsticks.

use super::explainable;
use crate::arguments::{Data, Division, STRIDES, count};
use crate::context::Context;
use crate::pages::Pages;
use phyture::Result;
use phyture::critique::table::ordinal;
use phyture::critique::wrap::wrapped;
use phyture::flight::windows::windows;
use phyture::flight::{DataSet, Window};
use phyture::hybrid::Hybrid;
use phyture::hybrid::linear::LinearConfig;
use phyture::physics::Model;
use phyture::report::compare_page;
use phyture::workflow::{Contest, affordable_stride, provenance, read_network, rows_needed};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
    /// The page comparison.html.
    #[command(flatten)]
    pub pages: Pages,
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
    let page = wanted.pages.open(context, "comparison.html")?;
    truth.as_deref().map_or(Ok(()), |folder| explainable::apart(data, folder))?;
    let networks = wanted.network.iter().map(|path| Ok((name(path), read_network(path)?))).collect::<Result<Vec<_>>>()?;
    let models = wanted.model.iter().map(|path| Ok((name(path), Model::read(path)?))).collect::<Result<Vec<_>>>()?;
    let history = networks.iter().map(|(_, hybrid)| hybrid.description().config.history()).max().unwrap_or(1);
    let set = context.flights(data, history)?;
    let of_networks = networks.iter().map(|(_, hybrid)| &hybrid.description().model);
    let all: Vec<&Model> = models.iter().map(|(_, model)| model).chain(of_networks).collect();
    let split = context.judged_split(&set.flights, &all, division, wanted.all)?;
    let rows_needed = rows_needed(&networks, wanted.ridge);
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
        seed: context.seed(),
        threads: context.threads(),
    };
    let mut result = contest.run(&set, &split)?;
    if let Some(folder) = truth {
        result.set_floor(&set, &explainable::read(data, folder)?)?;
    }
    context.say(format!("\n{}", result.comparison));
    if let Some(page) = page {
        contest.trace(&set, &split, &mut result)?;
        let names: Vec<&str> =
            models.iter().map(|(name, _)| name).chain(networks.iter().map(|(name, _)| name)).map(String::as_str).collect();
        let provenance = provenance("compare", &data.data, &set, &names, context.seed());
        page.write(context, &compare_page(&result.report(&set, &provenance))?)?;
    }
    context.json(&result.comparison)?;
    Ok(ExitCode::SUCCESS)
}

/// The stride that the networks can afford, which is said where it is not every sample.
fn affordable(context: &Context, set: &DataSet, every: &[Window], networks: &[(String, Hybrid)]) -> Result<usize> {
    let found = affordable_stride(&set.flights, every, networks, context.threads())?;
    if found.stride > 1 {
        context.say(wrapped(
            "",
            &format!(
                "every {}{} sample is judged, the same for all rows: every sample would take the networks about {:.0} min \
                 (`--stride 1`)",
                found.stride,
                ordinal(found.stride),
                found.every_s / 60.0
            ),
        ));
    }
    Ok(found.stride)
}

/// What a row of a file or folder is called.
pub fn name(path: &Path) -> String {
    path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned())
}
