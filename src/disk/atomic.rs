//! Writing a file so that a reader sees the old content or the new one, never a half of it.
//!
//! The content goes to a temporary name in the same folder, is synced to the disk, and is renamed into place; the folder is synced after
//! that. A symbolic link stays one, and what it points at is replaced. What is no plain file (`/dev/null`, a pipe) is written to as it is.
//! Whether something that exists may be replaced at all is decided in [`super::target`].

use crate::error::{Error, Result};
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Calls `content` with a buffered writer and puts what it wrote at `path`, replacing what was there, in one step.
///
/// If anything fails, the file at `path` is as it was and the temporary file is removed. The folder must exist. A read-only file and a
/// folder are refused.
///
/// # Errors
/// [`Error::Io`] with `path`, whatever step failed.
pub fn write_atomically(path: impl AsRef<Path>, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let path = path.as_ref();
    let written = match Place::of(path) {
        Ok(Place::New(file)) => replace(&file, None, content),
        Ok(Place::File(file, permissions)) => replace(&file, Some(permissions), content),
        Ok(Place::Node) => write_through(path, content),
        Err(error) => Err(error),
    };
    written.map_err(Error::io(path))
}

/// What stands at a path, and where it really is.
pub(super) enum Place {
    /// Nothing. The path is the end of the symbolic links, if there are any.
    New(PathBuf),
    /// A plain file that may be written, at the end of the symbolic links.
    File(PathBuf, Permissions),
    /// A pipe, a terminal, a device: nothing that a rename could replace.
    Node,
}

/// Folders in which the system shows devices and open files by name. Their links are no links to a place in a file system.
const OF_THE_SYSTEM: [&str; 2] = ["/dev", "/proc"];

/// A folder among them that holds plain files, in memory.
const SHARED_MEMORY: &str = "/dev/shm";

/// As many links as Linux follows.
const MOST_LINKS: usize = 40;

impl Place {
    /// Looks at `path`.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        if OF_THE_SYSTEM.iter().any(|folder| path.starts_with(folder)) && !path.starts_with(SHARED_MEMORY) {
            return Ok(Self::Node);
        }
        match fs::metadata(path) {
            Ok(there) if there.is_dir() => {
                Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder, expected the name of a file"))
            }
            Ok(there) if !there.is_file() => Ok(Self::Node),
            Ok(there) if there.permissions().readonly() => {
                Err(io::Error::new(io::ErrorKind::PermissionDenied, "is read-only; make it writable or give another name"))
            }
            Ok(there) => Ok(Self::File(fs::canonicalize(path)?, there.permissions())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => end_of_links(path).map(Self::New),
            Err(error) => Err(error),
        }
    }
}

/// Where a file is made that `path` names, which may be a link to nothing yet.
fn end_of_links(path: &Path) -> io::Result<PathBuf> {
    let mut end = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&end) {
            // A link is relative to its own folder; an absolute one replaces the path when joined.
            Ok(target) => end = folder_of(&end).join(target),
            Err(_) => return Ok(end),
        }
    }
    Err(io::Error::other("symbolic links that lead round in a circle"))
}

/// The folder of a file, `.` for a bare name.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn write_through(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(BUFFER, OpenOptions::new().write(true).open(path)?);
    content(&mut writer)?;
    writer.flush()
}

const BUFFER: usize = 1 << 18;

fn replace(
    path: &Path,
    permissions: Option<Permissions>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let (temporary, file) = create_beside(path)?;
    let permit = || permissions.map_or(Ok(()), |permissions| fs::set_permissions(&temporary, permissions));
    let written = fill(file, content).and_then(|()| permit()).and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // The first failure is the one to report; a temporary file that cannot be removed changes nothing for the reader.
        let _ = fs::remove_file(&temporary);
    }
    written.and_then(|()| sync_folder(path))
}

fn fill(file: File, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(BUFFER, file);
    content(&mut writer)?;
    writer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

const ENDING: &str = ".partial";

/// A new file next to `path`; its name starts with a dot and carries the process and a count, so that writers do not meet. It is locked
/// while it is written, so that one whose writer was killed is known and removed.
fn create_beside(path: &Path) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "a path without a file name"))?;
    remove_abandoned(folder_of(path), name);
    loop {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let temporary = path.with_file_name(format!(".{}.{}-{count}{ENDING}", name.to_string_lossy(), std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Ok(file) => {
                // A file system without locks never has its files taken for abandoned.
                let _ = file.try_lock();
                return Ok((temporary, file));
            }
            // Left over from a process of the same number that was killed: take the next count.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// A temporary file younger than this may belong to a writer that has not come to locking it.
const YOUNG: Duration = Duration::from_secs(60);

/// Removes temporary files of `name` whose writers are gone. What cannot be looked at stays; it is in nobody's way.
fn remove_abandoned(folder: &Path, name: &OsStr) {
    let start = format!(".{}.", name.to_string_lossy());
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let own = entry.file_name();
        let own = own.to_string_lossy();
        let middle = own.strip_prefix(&start).and_then(|rest| rest.strip_suffix(ENDING));
        let numbered = |middle: &str| middle.chars().all(|character| character.is_ascii_digit() || character == '-');
        if middle.is_some_and(numbered) && is_abandoned(&entry.path()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn is_abandoned(path: &Path) -> bool {
    let Ok(file) = OpenOptions::new().write(true).open(path) else { return false };
    let age = file.metadata().and_then(|there| there.modified()).ok().and_then(|changed| changed.elapsed().ok());
    age.is_some_and(|age| age > YOUNG) && file.try_lock().is_ok()
}

/// The rename itself must reach the disk too: on Unix it is an entry of the folder.
#[cfg(unix)]
fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder_of(path))?.sync_all()
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

    #[test]
    fn what_a_killed_writer_left_is_removed_and_what_a_living_one_writes_stays() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("model.toml");
        let long_ago = std::time::SystemTime::now() - 2 * YOUNG;
        let partial = |name: &str| -> io::Result<File> {
            let file = File::create(folder.path().join(name))?;
            file.set_modified(long_ago)?;
            Ok(file)
        };
        drop(partial(".model.toml.4711-0.partial")?);
        drop(partial(".other.toml.4711-0.partial")?);
        drop(partial(".model.toml.notes.partial")?);
        let living = partial(".model.toml.4712-3.partial")?;
        living.try_lock()?;
        write_atomically(&path, |out| out.write_all(b"new"))?;
        let mut there = names(folder.path())?;
        there.sort();
        assert_eq!(there, [".model.toml.4712-3.partial", ".model.toml.notes.partial", ".other.toml.4711-0.partial", "model.toml"]);
        Ok(())
    }

    #[test]
    fn a_folder_in_place_of_a_file_is_refused() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let failed = write_atomically(folder.path(), |out| out.write_all(b"x"));
        assert!(matches!(failed, Err(error) if error.to_string().contains("is a folder")));
        Ok(())
    }

    #[cfg(unix)]
    mod unix {
        use super::*;
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        use std::process::Command;

        #[test]
        fn a_link_stays_a_link_and_its_end_is_replaced() -> Result<(), Box<dyn std::error::Error>> {
            let folder = tempfile::tempdir()?;
            let (end, middle, link) = (folder.path().join("end"), folder.path().join("middle"), folder.path().join("link"));
            symlink("middle", &link)?;
            symlink(&end, &middle)?;
            for content in ["made through a link to nothing", "replaced"] {
                write_atomically(&link, |out| out.write_all(content.as_bytes()))?;
                assert_eq!(fs::read_to_string(&end)?, content);
                assert!(fs::symlink_metadata(&link)?.is_symlink() && fs::symlink_metadata(&middle)?.is_symlink());
            }
            symlink("round", folder.path().join("round"))?;
            assert!(write_atomically(folder.path().join("round"), |out| out.write_all(b"x")).is_err());
            Ok(())
        }

        #[test]
        fn pipes_and_devices_are_written_to_as_they_are() -> Result<(), Box<dyn std::error::Error>> {
            let folder = tempfile::tempdir()?;
            let pipe = folder.path().join("pipe");
            assert!(Command::new("mkfifo").arg(&pipe).status()?.success());
            let reader = std::thread::spawn({
                let pipe = pipe.clone();
                move || fs::read(pipe)
            });
            write_atomically(&pipe, |out| out.write_all(b"through"))?;
            assert_eq!(reader.join().map_err(|_| "the reader panicked")??, b"through");
            assert!(fs::symlink_metadata(&pipe)?.file_type().is_fifo());
            write_atomically("/dev/null", |out| out.write_all(b"away"))?;
            assert!(fs::metadata("/dev/null")?.file_type().is_char_device());
            Ok(())
        }

        #[test]
        fn permissions_are_kept_and_a_read_only_file_is_refused() -> Result<(), Box<dyn std::error::Error>> {
            let folder = tempfile::tempdir()?;
            let path = folder.path().join("model.toml");
            write_atomically(&path, |out| out.write_all(b"old"))?;
            fs::set_permissions(&path, Permissions::from_mode(0o640))?;
            write_atomically(&path, |out| out.write_all(b"new"))?;
            assert_eq!(fs::metadata(&path)?.permissions().mode() & 0o777, 0o640);
            fs::set_permissions(&path, Permissions::from_mode(0o440))?;
            let failed = write_atomically(&path, |out| out.write_all(b"third"));
            assert!(matches!(failed, Err(error) if error.to_string().contains("read-only")));
            assert_eq!(fs::read(&path)?, b"new");
            Ok(())
        }
    }
}
