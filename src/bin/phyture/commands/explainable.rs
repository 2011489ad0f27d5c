//! The explainable part of simulated flights, as `simulate --explainable` writes it: read beside the flights for the floor of their error,
//! and never as part of what is searched or judged.

use crate::arguments::Data;
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{DataSet, Flight};
use phyture::{Error, Result};
use std::path::Path;

/// Refuses a folder that lies in that of the flights, is it, or holds it: flights would be read as truth, or the truth as flights.
pub fn apart(data: &Data, folder: &Path) -> Result<()> {
    // What is missing is said by whoever reads it.
    let (Ok(flights), Ok(truth)) = (data.data.canonicalize(), folder.canonicalize()) else { return Ok(()) };
    let how = match (truth.starts_with(&flights), flights.starts_with(&truth)) {
        (false, false) => return Ok(()),
        (true, true) => "the flights themselves",
        (true, false) => "inside the folder of the flights",
        (false, true) => "a folder that holds the flights",
    };
    Err(Error::Config {
        place: "command line".into(),
        field: "--explainable".into(),
        found: format!("{}, {how}", folder.display()),
        expected: "a folder elsewhere: what is searched must not hold the truth".into(),
    })
}

/// Reads it as the flights were read.
pub fn read(data: &Data, folder: &Path) -> Result<Vec<Flight>> {
    Ok(read_set(data, folder)?.flights)
}

/// The same with what tells it from another.
pub fn read_set(data: &Data, folder: &Path) -> Result<DataSet> {
    apart(data, folder)?;
    let options = ReadOptions { split_at_gaps: data.split_at_gaps, dataset: data.dataset.clone(), ..ReadOptions::default() };
    data_set(folder, &options)
}
