//! `predict`: the accelerations that a hybrid or a model predicts, as CSV or Parquet.

use crate::arguments::{Data, STRIDES, count};
use crate::context::Context;
use crate::output::Progress;
use phyture::flight::write;
use phyture::physics::Model;
use phyture::workflow::{Predictor, read_network};
use phyture::{Error, Result};
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

/// Predicts and writes one table: flight, manoeuvre, t, measured and predicted accelerations.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let format = Format::of(&wanted.output)?;
    let target = context.new_file(&wanted.output, &[])?;
    let model = wanted.model.as_ref().map(Model::read).transpose()?;
    let network = wanted.network.as_deref().map(read_network).transpose()?;
    let place = wanted.model.as_ref().map_or_else(|| "command line".to_owned(), |path| path.display().to_string());
    let predictor = Predictor::new(model.as_ref(), network.as_ref(), &place)?;
    let set = context.flights(&wanted.data, predictor.history())?;
    let mut progress: Option<Progress> = None;
    let predictions = predictor.predict(&set, wanted.stride, context.threads(), &mut |done, all| {
        progress.get_or_insert_with(|| Progress::new("predicting", all as u64, 0)).at(done as u64, String::new);
        true
    })?;
    drop(progress);
    let table = predictions.table(&set);
    let path = context.ready(&target)?;
    match format {
        Format::Csv => write::table_csv(path, &table.columns())?,
        Format::Parquet => write::table_parquet(path, &table.columns())?,
    }
    let (rows, of) = (predictions.windows.len(), predictions.of);
    context.say(format!("{rows} predictions of the {of} written to {}", wanted.output.display()));
    context.json(&predictions.summary(&set, Some(wanted.output.clone())))?;
    Ok(ExitCode::SUCCESS)
}
