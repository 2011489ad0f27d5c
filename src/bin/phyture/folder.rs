//! A folder that a command fills: `simulate`, `implant` and `demo`. New or empty, or one that the program has filled before and may fill
//! again; never one with something of the user's in it.

use phyture::disk::{Existing, Lock, write_atomically};
use phyture::{Error, Result};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Lists what the program put into the folder, one path a line. Where it is empty, the program was ended before it was done, and all is its own.
const LIST: &str = ".phyture-files";

/// A folder to fill, held against other programs until it is closed.
pub struct NewFolder {
    path: PathBuf,
    _lock: Lock,
}

impl NewFolder {
    /// Opens `path`, which is made if it is not there.
    ///
    /// # Errors
    /// [`Error::Exists`] if the folder is not empty, unless `existing` says that what the program wrote there goes; [`Error::Config`] if
    /// there is anything that it did not write.
    pub fn open(path: &Path, existing: Existing) -> Result<Self> {
        fs::create_dir_all(path).map_err(Error::io(path))?;
        let there = files(path)?;
        if !there.is_empty() {
            existing.refuse(path, "a folder with files in it")?;
        }
        let lock = Lock::of_folder(path)?;
        let own = list(path)?;
        if let Some(strange) = there.iter().find(|file| own.as_ref().is_none_or(|own| !own.is_empty() && !own.contains(*file))) {
            return Err(Error::Config {
                place: path.display().to_string(),
                field: "--force".into(),
                found: format!("`{}`, which this program did not write there", strange.display()),
                expected: "an empty folder, or one that it has filled before; give another folder".into(),
            });
        }
        write_list(path, &BTreeSet::new())?;
        for file in &there {
            let file = path.join(file);
            fs::remove_file(&file).map_err(Error::io(&file))?;
        }
        remove_empty(path)?;
        Ok(Self { path: path.into(), _lock: lock })
    }

    /// Says that all is written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn close(self) -> Result<()> {
        write_list(&self.path, &files(&self.path)?)
    }
}

fn write_list(folder: &Path, files: &BTreeSet<PathBuf>) -> Result<()> {
    write_atomically(folder.join(LIST), |out| files.iter().try_for_each(|file| writeln!(out, "{}", file.display())))
}

fn list(folder: &Path) -> Result<Option<BTreeSet<PathBuf>>> {
    let path = folder.join(LIST);
    if !path.exists() {
        return Ok(None);
    }
    let text = fs::read_to_string(&path).map_err(Error::io(path))?;
    Ok(Some(text.lines().map(PathBuf::from).collect()))
}

/// All files below a folder by their paths in it, but those whose names begin with a dot. Links are files, wherever they lead.
fn files(folder: &Path) -> Result<BTreeSet<PathBuf>> {
    let mut found = BTreeSet::new();
    let mut open = vec![PathBuf::new()];
    while let Some(inside) = open.pop() {
        let place = folder.join(&inside);
        for entry in fs::read_dir(&place).map_err(Error::io(&place))? {
            let entry = entry.map_err(Error::io(&place))?;
            let name = inside.join(entry.file_name());
            if entry.file_type().map_err(Error::io(entry.path()))?.is_dir() {
                open.push(name);
            } else if !entry.file_name().to_string_lossy().starts_with('.') {
                found.insert(name);
            }
        }
    }
    Ok(found)
}

/// Removes the folders below `folder` that hold nothing.
fn remove_empty(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io(folder))? {
        let entry = entry.map_err(Error::io(folder))?;
        if entry.file_type().map_err(Error::io(entry.path()))?.is_dir() {
            remove_empty(&entry.path())?;
            // One that holds something stays.
            let _ = fs::remove_dir(entry.path());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(path: &Path) -> Result<()> {
        fs::create_dir_all(path.parent().unwrap_or(path)).map_err(Error::io(path))?;
        fs::write(path, "text").map_err(Error::io(path))
    }

    #[test]
    fn what_was_written_before_goes_only_when_forced_and_only_that() -> Result<()> {
        let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let folder = place.path().join("flights");
        let fill = |existing, names: &[&str]| -> Result<()> {
            let new = NewFolder::open(&folder, existing)?;
            names.iter().try_for_each(|name| put(&folder.join(name)))?;
            new.close()
        };
        fill(Existing::Keep, &["hover/hover_0.csv", "chaos/chaos_0.csv", "truth.json"])?;
        assert!(matches!(fill(Existing::Keep, &["truth.json"]), Err(Error::Exists { .. })));
        assert_eq!(files(&folder)?.len(), 3);
        fill(Existing::Replace, &["hover/hover_0.csv", "truth.json"])?;
        assert!(!folder.join("chaos").exists(), "flights of the first time would mix with those of the second");
        put(&folder.join("hover/of_the_user.csv"))?;
        let refused = fill(Existing::Replace, &["truth.json"]).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains("of_the_user.csv")), "{refused:?}");
        assert_eq!(files(&folder)?.len(), 3);
        Ok(())
    }

    #[test]
    fn a_folder_that_was_never_finished_can_be_forced() -> Result<()> {
        let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let new = NewFolder::open(place.path(), Existing::Keep)?;
        put(&place.path().join("hover/hover_0.csv"))?;
        drop(new);
        assert!(matches!(NewFolder::open(place.path(), Existing::Keep), Err(Error::Exists { .. })));
        NewFolder::open(place.path(), Existing::Replace)?.close()?;
        assert!(files(place.path())?.is_empty());
        Ok(())
    }

    #[test]
    fn a_folder_of_the_user_is_never_written_over() -> Result<()> {
        let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        put(&place.path().join("flight.csv"))?;
        assert!(matches!(NewFolder::open(place.path(), Existing::Replace), Err(Error::Config { .. })));
        assert!(place.path().join("flight.csv").exists());
        Ok(())
    }
}
