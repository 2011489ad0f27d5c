//! `rollout`: models and networks integrated forward from measured states, their errors by step.

use super::compare::name;
use crate::arguments::{Data, Division, HORIZONS, STRIDES, count};
use crate::context::Context;
use crate::pages::Pages;
use phyture::Result;
use phyture::physics::Model;
use phyture::report::rollout_page;
use phyture::workflow::{Rolling, provenance, read_network};
use std::path::PathBuf;
use std::process::ExitCode;

/// Open-loop prediction from measured states under the measured controls: errors by step, beside yardsticks
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture rollout flights -m n9-calibrated.toml --report report\n  phyture rollout flights -m n9-calibrated.toml -n run --horizon 100 --json rollout.json"
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
    /// Steps of the log to predict
    #[arg(long, default_value_t = 50, value_name = "STEPS", allow_negative_numbers = true, value_parser = count(HORIZONS))]
    pub horizon: usize,
    /// Samples between starts
    #[arg(long, default_value_t = 10, allow_negative_numbers = true, value_parser = count(STRIDES))]
    pub stride: usize,
    /// The page rollout.html.
    #[command(flatten)]
    pub pages: Pages,
    /// Start in every flight, also in those that were trained on
    #[arg(long)]
    pub all: bool,
    /// What trains and what tests.
    #[command(flatten)]
    pub division: Division,
}

/// Rolls out on the test part (locked flights where there are any) and prints; writes the page if asked to.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let page = wanted.pages.open(context, "rollout.html")?;
    let networks = wanted.network.iter().map(|path| Ok((name(path), read_network(path)?))).collect::<Result<Vec<_>>>()?;
    let models = wanted.model.iter().map(|path| Ok((name(path), Model::read(path)?))).collect::<Result<Vec<_>>>()?;
    let history = networks.iter().map(|(_, hybrid)| hybrid.description().config.history()).max().unwrap_or(1);
    let set = context.flights(&wanted.data, history)?;
    let of_networks = networks.iter().map(|(_, hybrid)| &hybrid.description().model);
    let all: Vec<&Model> = models.iter().map(|(_, model)| model).chain(of_networks).collect();
    let split = context.judged_split(&set.flights, &all, &wanted.division, wanted.all)?;
    let rolling = Rolling { models: &models, networks: &networks, horizon: wanted.horizon, stride: wanted.stride };
    let result = rolling.run(&set, &split)?;
    context.say(format!("\n{result}"));
    if let Some(page) = page {
        let names: Vec<&str> =
            models.iter().map(|(name, _)| name).chain(networks.iter().map(|(name, _)| name)).map(String::as_str).collect();
        let provenance = provenance("rollout", &wanted.data.data, &set, &names, context.seed());
        page.write(context, &rollout_page(&result, &provenance))?;
    }
    context.json(&result)?;
    Ok(ExitCode::SUCCESS)
}
