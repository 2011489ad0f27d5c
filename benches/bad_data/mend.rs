//! Through files: flights as the reader gives them back, with a description beside them.

use phyture::flight::{DataSet, Flight, read, write};
use phyture::{Error, Result};

/// These flights as the reader gives them back, with this description beside them.
pub fn through_files(flights: &[Flight], description: Option<&str>) -> Result<DataSet> {
    let folder = tempfile::tempdir().map_err(Error::io(std::env::temp_dir()))?;
    write::data_set_csv(folder.path(), flights)?;
    if let Some(text) = description {
        let path = folder.path().join("dataset.toml");
        std::fs::write(&path, text).map_err(Error::io(&path))?;
    }
    read::data_set(folder.path(), &read::ReadOptions::default())
}
