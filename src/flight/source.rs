//! Where a data set came from: the files that were read, one hash over them, and what its description said.
//!
//! The reader fills it in; flights that were made and not read have an empty one.

use super::attitude::{Axes, QuaternionOrder};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The files behind a data set, and how they were read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// Every file that was read: the logs, then the description in force, wherever it was found.
    pub files: Vec<PathBuf>,
    /// SHA-256 over the names of these files (relative to the data set; a description is `dataset.toml` wherever it lay) and their
    /// contents, in the order of the names, as 64 hexadecimal digits. Nothing else in the folder enters. Empty if nothing was read.
    pub sha256: String,
    /// Axes the logs were read in.
    pub axes: Axes,
    /// Order in which quaternions were read, if every log's attitude is one.
    pub quaternion: Option<QuaternionOrder>,
    /// What the description states: `axes`, `velocity`, `units.vx`, `columns.roll`, `drift.controls`, … with the text or number given. A group of units stands under
    /// each of its columns, too, and `held.roll` under each column of the file whose held rows a `[[repair]]` bridges.
    pub stated: BTreeMap<String, String>,
    /// The text of the description in force.
    pub description: Option<String>,
    /// Flights that were read, or could not be, and left out since, by name.
    pub left_out: Vec<String>,
}

impl Source {
    /// Whether the description moves all controls in time.
    pub fn moves_controls(&self) -> bool {
        ["late.controls", "drift.controls"].iter().any(|key| self.stated.contains_key(*key))
    }

    /// Whether the description makes roll or pitch by taking something off it, or adding something.
    pub fn shifts_attitude(&self) -> bool {
        let shifts = |text: &String| [" + ", " - "].iter().any(|sign| text.contains(sign));
        ["columns.roll", "columns.pitch"].iter().any(|key| self.stated.get(*key).is_some_and(shifts))
    }
}

#[cfg(feature = "files")]
mod digest {
    use super::Source;
    use sha2::{Digest, Sha256};
    use std::path::{Path, PathBuf};

    /// A file that was read, and the SHA-256 of the bytes that were.
    #[derive(Clone, Debug)]
    pub(in crate::flight) struct Read {
        pub path: PathBuf,
        pub content: [u8; 32],
    }

    impl Read {
        pub fn of(path: &Path, bytes: &[u8]) -> Self {
            Self { path: path.into(), content: Sha256::digest(bytes).into() }
        }
    }

    impl Source {
        /// Records the logs of the data set at `data`, and its description.
        pub(in crate::flight) fn record(&mut self, data: &Path, logs: Vec<Read>, description: Option<Read>) {
            let mut named: Vec<(String, Read)> = logs.into_iter().map(|read| (relative(data, &read.path), read)).collect();
            named.extend(description.map(|read| ("dataset.toml".to_owned(), read)));
            named.sort_by(|a, b| a.0.cmp(&b.0));
            let mut digest = Sha256::new();
            for (name, read) in &named {
                digest.update((name.len() as u64).to_le_bytes());
                digest.update(name.as_bytes());
                digest.update(read.content);
            }
            self.sha256 = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
            self.files = named.into_iter().map(|(_, read)| read.path).collect();
        }
    }

    /// The path below the data set with `/` between its parts; of a single log, the name of the file.
    fn relative(data: &Path, path: &Path) -> String {
        let below = path.strip_prefix(data).ok().filter(|below| !below.as_os_str().is_empty());
        let below = below.unwrap_or_else(|| path.file_name().map_or(path, Path::new));
        below.components().map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
    }
}

#[cfg(feature = "files")]
pub(super) use digest::Read;
