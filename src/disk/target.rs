//! A file that a command is going to write: looked at before the work begins, so that hours of it are not lost to a missing folder, and
//! nothing that exists is overwritten unasked.
//!
//! Writing itself is [`super::write_atomically`].

use super::atomic::{Place, folder_of};
use super::date::today;
use super::lock::Lock;
use crate::error::{Error, Result};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What becomes of something that exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// It stays, and the work is refused.
    Keep,
    /// It is overwritten.
    Replace,
}

impl Existing {
    /// Refuses where `what` stands at `path` and stays.
    ///
    /// # Errors
    /// [`Error::Exists`].
    pub fn refuse(self, path: &Path, what: &str) -> Result<()> {
        match self {
            Self::Replace => Ok(()),
            Self::Keep => Err(Error::Exists { path: path.into(), what: what.into() }),
        }
    }
}

/// A file to be written, and until then held against other programs.
#[derive(Debug)]
pub struct Target {
    path: PathBuf,
    keep_old: bool,
    _lock: Option<Lock>,
}

impl Target {
    /// Looks whether a file can be written to `path` when the work is done.
    ///
    /// A file that is one of `read`, from which the work starts, may be named without asking: it is kept beside the new one with the date.
    ///
    /// # Errors
    /// [`Error::Exists`] if there is something and `existing` says that it stays; [`Error::Busy`] if another program writes it;
    /// [`Error::Io`] if the folder is missing or cannot be written to, or a folder or a read-only file has that name.
    pub fn file(path: &Path, existing: Existing, read: &[&Path]) -> Result<Self> {
        let (end, there) = match Place::of(path).map_err(Error::io(path))? {
            Place::Node => return Ok(Self { path: path.into(), keep_old: false, _lock: None }),
            Place::New(end) => (end, false),
            Place::File(end, _) => (end, true),
        };
        let folder = folder_of(&end);
        if !folder.is_dir() {
            let missing = io::Error::new(io::ErrorKind::NotFound, "the folder to write to is missing; make it first");
            return Err(Error::io(folder)(missing));
        }
        let keep_old = there && read.iter().any(|read| fs::canonicalize(read).is_ok_and(|read| read == end));
        if there && !keep_old {
            existing.refuse(path, "a file")?;
        }
        Ok(Self { path: path.into(), keep_old, _lock: Some(Lock::of_file(&end)?) })
    }

    /// The path, for saying.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path, for writing now: an old file that stays has been copied aside. Gives the name of the copy, too.
    ///
    /// # Errors
    /// [`Error::Io`] if the old file cannot be copied.
    pub fn ready(&self) -> Result<(&Path, Option<PathBuf>)> {
        let kept = if self.keep_old { Some(copy_aside(&self.path)?) } else { None };
        Ok((&self.path, kept))
    }
}

/// Copies `model.toml` to `model.2026-11-22.toml`, or `model.2026-11-22-2.toml` if there is one already, and so on.
fn copy_aside(path: &Path) -> Result<PathBuf> {
    let (stem, today) = (path.file_stem().unwrap_or_default().to_string_lossy(), today());
    let ending = path.extension().map_or(String::new(), |ending| format!(".{}", ending.to_string_lossy()));
    let mut source = fs::File::open(path).map_err(Error::io(path))?;
    for count in 1_u64.. {
        let number = if count == 1 { String::new() } else { format!("-{count}") };
        let aside = path.with_file_name(format!("{stem}.{today}{number}{ending}"));
        match fs::OpenOptions::new().write(true).create_new(true).open(&aside) {
            Ok(mut file) => {
                let copied = io::copy(&mut source, &mut file).and_then(|_| file.sync_all());
                return copied.map(|()| aside.clone()).map_err(Error::io(aside));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(Error::io(aside)(error)),
        }
    }
    unreachable!("a folder with 2^64 files")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::disk::write_atomically;

    fn folder() -> Result<tempfile::TempDir> {
        tempfile::tempdir().map_err(Error::io("temporary folder"))
    }

    fn put(path: &Path, text: &str) -> Result<()> {
        write_atomically(path, |file| file.write_all(text.as_bytes()))
    }

    #[test]
    fn what_exists_stays_unless_asked() -> Result<()> {
        let folder = folder()?;
        let path = folder.path().join("model.toml");
        drop(Target::file(&path, Existing::Keep, &[])?);
        put(&path, "old")?;
        let refused = Target::file(&path, Existing::Keep, &[]).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains("--force")), "{refused:?}");
        drop(Target::file(&path, Existing::Replace, &[])?);
        assert!(fs::read(&path).is_ok_and(|content| content == b"old"));
        Ok(())
    }

    #[test]
    fn the_file_that_was_read_is_kept_with_the_date() -> Result<()> {
        let folder = folder()?;
        let path = folder.path().join("model.toml");
        let mut copies = Vec::new();
        for text in ["first", "second", "third"] {
            if text != "first" {
                let target = Target::file(&path, Existing::Keep, &[&path])?;
                let (at, kept) = target.ready()?;
                assert_eq!(at, path);
                copies.extend(kept);
            }
            put(&path, text)?;
        }
        let contents: Vec<String> = copies.iter().map(|copy| fs::read_to_string(copy).unwrap_or_default()).collect();
        assert_eq!(contents, ["first", "second"]);
        assert!(copies[1].to_string_lossy().ends_with("-2.toml"), "{copies:?}");
        assert_eq!(fs::read_to_string(&path).map_err(Error::io(&path))?, "third");
        Ok(())
    }

    #[test]
    fn a_missing_folder_and_a_second_writer_are_noticed_before_the_work() -> Result<()> {
        let folder = folder()?;
        let missing = Target::file(&folder.path().join("no/model.toml"), Existing::Keep, &[]).map_err(|error| error.to_string());
        assert!(matches!(&missing, Err(text) if text.contains("folder to write to is missing")), "{missing:?}");
        let path = folder.path().join("model.toml");
        let first = Target::file(&path, Existing::Keep, &[])?;
        assert!(matches!(Target::file(&path, Existing::Keep, &[]), Err(Error::Busy { .. })));
        drop(first);
        drop(Target::file(&path, Existing::Keep, &[])?);
        Ok(())
    }
}
