//! One program at a time writes a file or a folder.
//!
//! A lock is a file with a lock of the operating system on it. That one ends with its process, however the process ends, so that no lock
//! is ever left over; what stands in the file (process and host) is there to be read by a person. On a file system without locks
//! nothing is locked.

use crate::error::{Error, Result};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// A lock that is held until it is dropped.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Takes the lock of a file that is going to be written: `.NAME.lock` beside it. The folder must exist.
    ///
    /// # Errors
    /// [`Error::Busy`] naming process and host if another program holds it, [`Error::Io`] if the folder cannot be written to.
    pub fn of_file(path: &Path) -> Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Self::take(path.with_file_name(format!(".{name}.lock")), path)
    }

    /// Takes the lock of a folder: `.lock` in it.
    ///
    /// # Errors
    /// As [`Lock::of_file`].
    pub fn of_folder(folder: &Path) -> Result<Self> {
        Self::take(folder.join(".lock"), folder)
    }

    fn take(path: PathBuf, what: &Path) -> Result<Self> {
        loop {
            let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
            let mut file = opened.map_err(Error::io(&path))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut holder = String::new();
                    // Who it is helps; that somebody is there is enough.
                    let _ = file.read_to_string(&mut holder);
                    let holder = if holder.is_empty() { "another program".into() } else { holder.trim_end().into() };
                    return Err(Error::Busy { path: what.into(), holder });
                }
                Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
                Err(TryLockError::Error(error)) => return Err(Error::io(&path)(error)),
            }
            // Between opening and locking, its last holder may have removed the file: then this is the lock of nothing.
            if !is_at(&file, &path) {
                continue;
            }
            let signed = file.set_len(0).and_then(|()| file.rewind());
            let signed = signed.and_then(|()| writeln!(file, "process {} on {}", std::process::id(), host()));
            signed.map_err(Error::io(&path))?;
            return Ok(Self { path, file });
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Removed while it is held, so that nobody's lock is removed but this one. A file that stays is found unlocked by the next.
        if cfg!(unix) {
            let _ = fs::remove_file(&self.path);
        }
        let _ = self.file.unlock();
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |there: fs::Metadata| (there.dev(), there.ino());
    match (file.metadata(), fs::metadata(path)) {
        (Ok(own), Ok(named)) => place(own) == place(named),
        _ => false,
    }
}

/// Elsewhere a lock's file is never removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").ok().or_else(|| std::env::var("COMPUTERNAME").ok());
    name.map_or_else(|| "this host".into(), |name| name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_is_told_who_the_first_is_and_then_follows() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let first = Lock::of_folder(folder.path())?;
        let message = Lock::of_folder(folder.path()).map_err(|error| error.to_string());
        let process = format!("process {} on ", std::process::id());
        assert!(matches!(&message, Err(text) if text.contains(&process)), "{message:?}");
        assert!(Lock::of_file(&folder.path().join("model.toml")).is_ok(), "another lock");
        drop(first);
        assert!(fs::read_dir(folder.path()).is_ok_and(|mut entries| entries.next().is_none()), "nothing is left");
        drop(Lock::of_folder(folder.path())?);
        Ok(())
    }

    #[test]
    fn a_lock_whose_process_is_gone_is_none() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        fs::write(folder.path().join(".lock"), "process 1 on elsewhere\n").map_err(Error::io("lock"))?;
        Lock::of_folder(folder.path()).map(drop)
    }

    #[test]
    fn of_many_at_once_one_works_at_a_time() -> Result<()> {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let (inside, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..2000 {
                        if let Ok(_lock) = Lock::of_folder(folder.path()) {
                            assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                            done.fetch_add(1, Ordering::SeqCst);
                            assert_eq!(inside.fetch_sub(1, Ordering::SeqCst), 1);
                        }
                    }
                });
            }
        });
        assert!(done.load(Ordering::SeqCst) > 0);
        Ok(())
    }
}
