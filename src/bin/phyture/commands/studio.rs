//! `studio`: the model and the measurements in a browser on this machine.

use crate::arguments::{Data, Division};
use crate::context::{Context, interruption};
use phyture::Result;
use phyture::studio::server::Server;
use phyture::studio::{Opening, Studio};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Compare, diagnose, add effects and watch the error fall, in a browser on this machine
///
/// Prints an address to open. The server listens on 127.0.0.1 alone and answers nobody who lacks the token in that address; everything the page
/// needs is in the program. Ctrl-C ends it; steps that were not saved lie in a file beside the model and are offered when it is opened again, and so is a training.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  phyture studio flights -m n9.toml\n  phyture studio phyture-demo/flights --port 8421")]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]; one without numbers is calibrated first
    #[arg(short, long)]
    pub model: Option<PathBuf>,
    /// Port of 127.0.0.1; 0 is a free one
    #[arg(long, default_value_t = 0, value_name = "PORT")]
    pub port: u16,
    /// What is fitted and searched, and what only judges.
    #[command(flatten)]
    pub division: Division,
}

/// Serves the studio until Ctrl-C.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let Args { data, model: path, port, division } = wanted;
    let server = Server::bind(*port)?;
    let set = context.flights(data, 1)?;
    let mut model = context.model(path.as_deref(), data)?;
    let split = context.search_split(&set.flights, &model, division)?;
    division.wanted().note(&mut model);
    let file = path.clone().or_else(|| Context::model_file(data));
    let opening = Opening { set, split, model, data: data.data.clone(), file, seed: context.seed() };
    let studio = Arc::new(Studio::open(opening)?);
    let end = interruption()?;
    context.json(&json!({ "url": server.url(), "port": server.port() }))?;
    context.print(format!("\nstudio: {}\nopen this address in a browser; Ctrl-C ends the studio", server.url()));
    server.run(Arc::clone(&studio), &end)?;
    if let Some(run) = studio.finish() {
        context.say(format!("the training in {} was stopped and is saved; the studio goes on with it, in Train", run.display()));
    }
    let kept = studio
        .kept()
        .map_or_else(String::new, |file| format!("; steps that are not saved lie in {file} and are offered next time"));
    context.say(format!("studio ended{kept}"));
    Ok(ExitCode::SUCCESS)
}
