//! Where figures come from, for a page: the command, the data with the hash of what was read, the models, the seed, the version. Model files
//! carry theirs by [`Model::note_source`](crate::physics::Model::note_source).

use crate::flight::DataSet;
use crate::report::DATA_NOTE;
use std::path::Path;

/// Lines of provenance. `models` are names; the notes of the reader come last, each a line of its own.
pub fn provenance(command: &str, data: &Path, set: &DataSet, models: &[&str], seed: u64) -> Vec<(String, String)> {
    let own = [
        ("command", command.to_owned()),
        ("data", data.display().to_string()),
        ("SHA-256 of the data", set.source.sha256.clone()),
        ("model", models.join(", ")),
        ("seed", seed.to_string()),
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let notes = set.notes.iter().map(|note| (DATA_NOTE.to_owned(), note.clone()));
    own.into_iter().filter(|(_, value)| !value.is_empty()).map(|(key, value)| (key.to_owned(), value)).chain(notes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_left_out_and_notes_come_last() {
        let set = DataSet { notes: vec!["one cell was repaired".into()], ..DataSet::default() };
        let found = provenance("compare", Path::new("flights"), &set, &[], 7);
        let keys: Vec<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
        assert_eq!(keys, ["command", "data", "seed", "version", DATA_NOTE]);
    }
}
