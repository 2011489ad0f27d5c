//! Writing a file so that a reader sees the old content or the new one, never a half of it.
//!
//! The content goes to a temporary name in the same folder, is synced to the disk, and is renamed into place. What is written
//! is the caller's business.

use crate::error::{Error, Result};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Calls `content` with a buffered writer and puts what it wrote at `path`, replacing what was there, in one step.
///
/// If anything fails, the file at `path` is as it was and the temporary file is removed. The folder must exist.
///
/// # Errors
/// [`Error::Io`] with `path`, whatever step failed.
pub fn write_atomically(path: impl AsRef<Path>, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let path = path.as_ref();
    replace(path, content).map_err(Error::io(path))
}

fn replace(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let (temporary, file) = create_beside(path)?;
    let written = fill(file, content).and_then(|()| fs::rename(&temporary, path)).and_then(|()| sync_folder(path));
    if written.is_err() {
        // The first failure is the one to report; a temporary file that cannot be removed changes nothing for the reader.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn fill(file: File, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(1 << 18, file);
    content(&mut writer)?;
    writer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

/// A new file next to `path`; its name starts with a dot and carries the process and a count, so that writers do not meet.
fn create_beside(path: &Path) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "a path without a file name"))?;
    loop {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let temporary = path.with_file_name(format!(".{}.{}-{count}.partial", name.to_string_lossy(), std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Ok(file) => return Ok((temporary, file)),
            // Left over from a process of the same number that was killed: take the next count.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// The rename itself must reach the disk too: on Unix it is an entry of the folder.
#[cfg(unix)]
fn sync_folder(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> io::Result<Vec<String>> {
        fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned())).collect()
    }

    #[test]
    fn the_new_content_replaces_the_old_one() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("model.toml");
        write_atomically(&path, |out| out.write_all(b"old"))?;
        write_atomically(&path, |out| out.write_all(b"new"))?;
        assert_eq!(fs::read(&path)?, b"new");
        assert_eq!(names(folder.path())?, ["model.toml"]);
        Ok(())
    }

    #[test]
    fn a_failure_half_way_leaves_the_old_content_and_no_other_file() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("model.toml");
        write_atomically(&path, |out| out.write_all(b"old"))?;
        let failed = write_atomically(&path, |out| {
            out.write_all(&[b'x'; 1 << 19])?;
            Err(io::Error::other("no more"))
        });
        assert!(matches!(failed, Err(Error::Io { path: named, .. }) if named == path));
        assert_eq!(fs::read(&path)?, b"old");
        assert_eq!(names(folder.path())?, ["model.toml"]);
        Ok(())
    }

    #[test]
    fn a_missing_folder_is_named() {
        let path = Path::new("no_such_folder_here/a.csv");
        let failed = write_atomically(path, |out| out.write_all(b"x"));
        assert!(matches!(failed, Err(error) if error.to_string().contains("no_such_folder_here")));
    }
}
