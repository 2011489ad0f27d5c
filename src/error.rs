//! The one error type of the crate.
//!
//! Every variant carries its operands and its message tells the person what to do next. Messages about input name the file,
//! the line (1-based, the header is line 1), the column, what was found and what was expected.

use phyture_kernels::instruction_set::{ENVIRONMENT_VARIABLE, InstructionSetError};
use std::io;
#[cfg(feature = "disk")]
use std::path::Path;
use std::path::PathBuf;

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can go wrong on the way from a log to a prediction.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be read or written.
    #[error("{}: {}", path.display(), plain(source))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// One cell of a log is not what it should be.
    #[error("{}, line {line}, column `{column}`: found {found}, expected {expected}", path.display())]
    Cell {
        /// The log.
        path: PathBuf,
        /// Line in the file, the header being line 1.
        line: usize,
        /// Column name as it stands in the file.
        column: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// A log as a whole, or its header, is not what it should be.
    #[error("{}: found {found}, expected {expected}", path.display())]
    Log {
        /// The log or data folder.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What was expected, and what to do.
        expected: String,
    },
    /// A configuration value (model file, `dataset.toml`, training configuration, command line) is out of its range.
    #[error("{place}: `{field}` is {found}, expected {expected}")]
    Config {
        /// File or command the value comes from.
        place: String,
        /// Name of the field, dotted.
        field: String,
        /// The value found.
        found: String,
        /// The range or form expected.
        expected: String,
    },
    /// A formula does not parse or names something unknown. Two further lines show the formula and a caret under the place.
    #[error("formula: {message}\n  {formula}\n  {:>width$}", "^", width = at + 1)]
    Formula {
        /// What is wrong, and what was expected.
        message: String,
        /// The formula as written.
        formula: String,
        /// Character (0-based) the error points at.
        at: usize,
    },
    /// Shapes that do not fit an operation of the tape.
    #[error("{operation}: {message}")]
    Shape {
        /// Operation by name.
        operation: &'static str,
        /// Both shapes and what would fit.
        message: String,
    },
    /// The data do not determine what was asked of them.
    #[error("{0}")]
    Undetermined(String),
    /// A file of this project's own formats is damaged, of another kind, or of a newer version.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        message: String,
    },
    /// Something is there already and is not overwritten unasked.
    #[error("{}: {what} is there already; give another name, or --force to overwrite it", path.display())]
    Exists {
        /// Where.
        path: PathBuf,
        /// What is there, with its article.
        what: String,
    },
    /// Another program works on the same file or folder.
    #[error("{}: {holder} works on it; wait for it to end, or give another name", path.display())]
    Busy {
        /// The file or folder.
        path: PathBuf,
        /// Process and host.
        holder: String,
    },
    /// The work was interrupted and its state saved.
    #[error("interrupted; {saved}")]
    Interrupted {
        /// What was saved, and where.
        saved: String,
    },
}

impl Error {
    /// An instruction set was asked for that is not there.
    pub(crate) fn instruction_set(error: InstructionSetError) -> Self {
        Self::Config {
            place: "environment".into(),
            field: ENVIRONMENT_VARIABLE.into(),
            found: error.to_string(),
            expected: "a level of this processor, or nothing".into(),
        }
    }

    /// The kind of error in one word, for programs.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Io { .. } => "io",
            Self::Cell { .. } => "cell",
            Self::Log { .. } => "log",
            Self::Config { .. } => "config",
            Self::Formula { .. } => "formula",
            Self::Shape { .. } => "shape",
            Self::Undetermined(_) => "undetermined",
            Self::File { .. } => "file",
            Self::Exists { .. } => "exists",
            Self::Busy { .. } => "busy",
            Self::Interrupted { .. } => "interrupted",
        }
    }

    /// An error in a formula with the place where the formula stands before what is wrong; another as it is.
    #[cfg(feature = "files")]
    pub(crate) fn standing_in(self, place: &str) -> Self {
        match self {
            Self::Formula { message, formula, at } => Self::Formula { message: format!("{place}: {message}"), formula, at },
            other => other,
        }
    }

    /// An [`Error::Io`] that remembers its path: `std::fs::read(p).map_err(Error::io(p))`. Where the folder of the path is what is
    /// missing, it says so.
    #[cfg(feature = "disk")]
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| {
            let source = match missing_folder(&path) {
                Some(folder) if source.kind() == io::ErrorKind::NotFound && source.get_ref().is_none() => {
                    let says = format!("the folder {} does not exist", folder.display());
                    io::Error::new(source.kind(), says)
                }
                _ => source,
            };
            Self::Io { path, source }
        }
    }
}

/// The uppermost folder on the way to a file that is not there.
#[cfg(feature = "disk")]
fn missing_folder(path: &Path) -> Option<&Path> {
    let absent = |folder: &&Path| !folder.as_os_str().is_empty() && matches!(folder.try_exists(), Ok(false));
    path.ancestors().skip(1).take_while(absent).last()
}

/// What the operating system said, as a sentence without error numbers.
fn plain(source: &io::Error) -> String {
    use io::ErrorKind as Kind;
    if source.get_ref().is_some() {
        return source.to_string();
    }
    let known = match source.kind() {
        Kind::NotFound => "there is no such file or folder",
        Kind::PermissionDenied => "permission denied; look at who owns it and who may read or write it",
        Kind::AlreadyExists => "is there already",
        Kind::IsADirectory => "is a folder, where a file was expected",
        Kind::NotADirectory => "a part of this path is a file, where a folder was expected",
        Kind::DirectoryNotEmpty => "is a folder that is not empty",
        Kind::StorageFull => "no space is left on the device",
        Kind::QuotaExceeded => "the quota of the disk is used up",
        Kind::ReadOnlyFilesystem => "the file system can only be read",
        Kind::FileTooLarge => "the file is too large for this file system",
        Kind::InvalidFilename => "the name is too long, or none that this file system allows",
        Kind::InvalidData => "is not UTF-8 text",
        Kind::Interrupted => "the work on it was interrupted",
        Kind::UnexpectedEof => "the file ends too early",
        Kind::BrokenPipe => "the program at the other end of the pipe is gone",
        _ => "",
    };
    if known.is_empty() { without_number(&source.to_string()).to_owned() } else { known.to_owned() }
}

/// `Too many levels of symbolic links (os error 40)` without what stands in brackets.
fn without_number(text: &str) -> &str {
    text.rfind(" (os error").map_or(text, |end| &text[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formula_errors_point_at_the_character() {
        let error = Error::Formula { message: "unknown name `vq`".into(), formula: "vx + vq".into(), at: 5 };
        assert_eq!(error.to_string(), "formula: unknown name `vq`\n  vx + vq\n       ^");
    }

    #[cfg(feature = "disk")]
    #[test]
    fn the_operating_systems_words_become_sentences_without_numbers() {
        let message = |kind: io::ErrorKind| Error::io("a.csv")(kind.into()).to_string();
        assert_eq!(message(io::ErrorKind::NotFound), "a.csv: there is no such file or folder");
        assert_eq!(message(io::ErrorKind::IsADirectory), "a.csv: is a folder, where a file was expected");
        let far = Error::io("no_such/folder/a.csv")(io::ErrorKind::NotFound.into()).to_string();
        assert_eq!(far, "no_such/folder/a.csv: the folder no_such does not exist");
        // ELOOP has no kind of its own that is stable.
        let loops = Error::io("a.csv")(io::Error::from_raw_os_error(40)).to_string();
        assert!(!loops.contains("os error") && loops.len() > "a.csv: ".len(), "{loops}");
        let own = Error::io("a.csv")(io::Error::other("written elsewhere")).to_string();
        assert_eq!(own, "a.csv: written elsewhere");
    }
}
