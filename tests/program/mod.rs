//! The program as a process: started in a folder, what it said, and what it left there. Shared by the tests of the command line.
#![allow(dead_code, reason = "each test program uses its part")]

use phyture::{Error, Result};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The program with its arguments, to be started in `folder`.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phyture"));
    command.args(arguments).current_dir(folder);
    command
}

/// Runs it to its end.
pub fn phyture(folder: &Path, arguments: &[&str]) -> Result<Output> {
    command(folder, arguments).output().map_err(Error::io("phyture"))
}

/// What a run that must succeed says on standard output.
pub fn succeed(folder: &Path, arguments: &[&str]) -> Result<String> {
    let output = phyture(folder, arguments)?;
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What a run that must be refused says on standard error.
pub fn refused(folder: &Path, arguments: &[&str]) -> Result<String> {
    let output = phyture(folder, arguments)?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
    Ok(text)
}

/// A folder that goes with the test.
pub fn folder() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(Error::io("temporary folder"))
}

/// Every file below a folder with its content.
pub fn contents(folder: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>> {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(inside) = open.pop() {
        for entry in fs::read_dir(&inside).map_err(Error::io(&inside))? {
            let path = entry.map_err(Error::io(&inside))?.path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.insert(path.clone(), fs::read(&path).map_err(Error::io(path))?);
            }
        }
    }
    Ok(found)
}
