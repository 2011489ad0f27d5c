//! Lines at the end of a file that is only ever added to, such as a ledger.

use super::write_atomically;
use crate::error::{Error, Result};
use std::fs;
use std::io;
use std::path::Path;

/// Adds `lines` at the end of the file at `path`, which is made if it is not there, in one step.
///
/// What is there stays. A line that is there already is not added again, so that work which was killed after writing and is done again
/// leaves no line twice. A last line without its end was never written whole, and goes.
///
/// # Errors
/// [`Error::Io`]; where the file is no text, too.
pub fn append_lines(path: &Path, lines: &[String]) -> Result<()> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
        Err(error) => return Err(Error::io(path)(error)),
    };
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let new = lines.iter().filter(|line| !whole.lines().any(|there| there == line.as_str()));
    write_atomically(path, |file| {
        file.write_all(whole.as_bytes())?;
        new.into_iter().try_for_each(|line| writeln!(file, "{line}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_added_once_and_a_torn_one_goes() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("ledger.jsonl");
        let add = |lines: &[&str]| append_lines(&path, &lines.iter().map(|&line| line.into()).collect::<Vec<_>>());
        add(&["first"])?;
        add(&["first", "second"])?;
        let text = fs::read_to_string(&path).map_err(Error::io(&path))?;
        assert_eq!(text, "first\nsecond\n");
        fs::write(&path, "first\nsecond\nthi").map_err(Error::io(&path))?;
        add(&["third"])?;
        assert_eq!(fs::read_to_string(&path).map_err(Error::io(&path))?, "first\nsecond\nthird\n");
        Ok(())
    }
}
