//! `check`: conventions, timing and excitation of a data set, and the description that mends what is at fault.

use super::CHECK_FAILED;
use crate::arguments::Data;
use crate::context::Context;
use phyture::Result;
use phyture::critique::check::{CheckReport, Mending, Suggestion, check, mend};
use phyture::critique::wrap::wrapped;
use phyture::disk::{Target, write_atomically};
use phyture::flight::DataSet;
use phyture::physics::Model;
use std::path::PathBuf;
use std::process::ExitCode;

/// Conventions, timing and excitation of a data set; exit code 3 on a convention fault
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture check flights --json check.json\n  phyture check flights --suggest flights/dataset.toml"
)]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file [default: DATA/model.toml if there is one]
    #[arg(short, long)]
    pub model: Option<PathBuf>,
    /// Write a dataset.toml that mends what is at fault, on top of the one in force; where it takes the name of that one, the old one is kept
    /// beside it
    #[arg(long, value_name = "FILE")]
    pub suggest: Option<PathBuf>,
}

/// Checks and prints; exit code 3 on a convention fault, after the report and what was asked for are written.
pub fn run(context: &Context, Args { data, model, suggest }: &Args) -> Result<ExitCode> {
    let in_force = data.dataset.clone().unwrap_or_else(|| data.data.join("dataset.toml"));
    let target = suggest.as_deref().map(|path| context.new_file(path, &[&in_force])).transpose()?;
    let set = context.flights(data, 1)?;
    let model = context.model_if_any(model.as_deref(), data)?;
    let report = check(&set, model.as_ref());
    // The notes on the data have been said, and folded.
    context.say(format!("\n{}", CheckReport { notes: Vec::new(), ..report.clone() }));
    match target {
        Some(target) => write(context, (&report, model.as_ref()), &set, &target, data)?,
        None if report.suggestion(&set.source).is_some_and(|suggestion| !suggestion.mends.is_empty()) => {
            context.say("--suggest FILE writes a dataset.toml with the lines that mend this");
        }
        None => {}
    }
    context.json(&report)?;
    Ok(if report.fault { ExitCode::from(CHECK_FAILED) } else { ExitCode::SUCCESS })
}

/// Writes what mends the faults, one behind the other as they show, and says what is left to a person.
fn write(
    context: &Context,
    (report, model): (&CheckReport, Option<&Model>),
    set: &DataSet,
    target: &Target,
    data: &Data,
) -> Result<()> {
    let Some(first) = report.suggestion(&set.source) else {
        context.say(format!("nothing is at fault; {} is not written", target.path().display()));
        return Ok(());
    };
    let made = mend(set, report, model, |text| Context::flights_described(data, text));
    let open = made.as_ref().map_or(&first.open, |made| &made.suggestion.open);
    open.iter().for_each(|open| context.say(wrapped("", &format!("left to you: {}; {}", open.name, open.reason))));
    let Some(made) = made else {
        context.say(format!("no line of a description mends this; {} is not written", target.path().display()));
        return Ok(());
    };
    let Suggestion { text, mends, .. } = &made.suggestion;
    let path = context.ready(target)?;
    write_atomically(path, |file| file.write_all(text.as_bytes()))?;
    context.say(wrapped("", &format!("written to {}, which mends {}; {}", path.display(), mends.join(", "), told(&made))));
    let of = if path.file_name() == Some("dataset.toml".as_ref()) && path.parent() == Some(&data.data) {
        String::new()
    } else {
        format!(" --dataset {}", path.display())
    };
    context.say(format!("next: phyture check {}{of}", data.data.display()));
    Ok(())
}

/// What stands at the end of it.
fn told(made: &Mending) -> String {
    let rounds = if made.rounds == 1 { "read once with it".to_owned() } else { format!("in {} rounds", made.rounds) };
    match &made.report {
        Some(report) if report.fault => format!("{rounds}, after which {}", report.summary),
        Some(_) => format!("{rounds}, after which nothing is at fault"),
        None => "the flights cannot be read with it, the next check says why".into(),
    }
}
