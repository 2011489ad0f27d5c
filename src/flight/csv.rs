//! CSV files as raw tables: comma-separated, one header line, numbers.
//!
//! A cell without a number is NaN and is judged later, when it is known whether a repair rule covers it; text in a number is refused at once.

use super::format::{Format, Place, Reader};
use super::source::Read;
use super::table::{RawTable, check_header, fault};
use crate::error::{Error, Result};
use std::path::Path;

/// CSV among the formats.
pub(super) const CSV: Format =
    Format { kind: "a CSV file", place: Place::File("csv"), description: None, reader: Reader::Table(read_csv) };

const NOT_A_NUMBER: &str = "a number; a column that holds something else can be named in `ignore` of dataset.toml";

/// Reads a CSV file: comma-separated, one header line, numbers. Only columns that `wanted` accepts are kept.
///
/// # Errors
/// [`Error::Io`]; [`Error::Log`] for a file that is not CSV or has no rows; [`Error::Cell`] for text in a number, a row of
/// another length, a doubled column.
pub(super) fn read_csv(path: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<RawTable> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let content = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    if content.starts_with(b"PAR1") || content.iter().take(4096).any(|&byte| byte == 0) {
        return Err(fault(path, "binary content in a file named .csv", "comma-separated text with a header line"));
    }
    if content.iter().all(u8::is_ascii_whitespace) {
        return Err(fault(path, "an empty file", "a header line and at least one row; remove the file if the flight is void"));
    }
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(content);
    let mut record = csv::ByteRecord::new();
    reader.read_byte_record(&mut record).map_err(|error| csv_fault(path, &error))?;
    let names = header(path, &record)?;
    check_header(path, &names, wanted)?;
    let kept: Vec<usize> = (0..names.len()).filter(|&index| wanted(&names[index])).collect();

    let mut columns = vec![Vec::new(); kept.len()];
    let mut lines = Vec::new();
    while reader.read_byte_record(&mut record).map_err(|error| csv_fault(path, &error))? {
        let line = line_of_record_before(content, reader.position());
        if record.len() != names.len() {
            let column = names.get(record.len().min(names.len() - 1)).cloned().unwrap_or_default();
            let found = format!("{} cells in the row", record.len());
            let expected = format!("{}, as in the header", names.len());
            return Err(Error::Cell { path: path.into(), line, column, found, expected });
        }
        for (values, &index) in columns.iter_mut().zip(&kept) {
            let cell = record.get(index).unwrap_or_default();
            let value = number(cell).ok_or_else(|| Error::Cell {
                path: path.into(),
                line,
                column: names[index].clone(),
                found: format!("`{}`", String::from_utf8_lossy(cell.trim_ascii())),
                expected: NOT_A_NUMBER.into(),
            })?;
            values.push(value);
        }
        lines.push(line);
    }
    if lines.is_empty() {
        return Err(fault(path, "a header and no rows", "at least one row; remove the file if the flight is void"));
    }
    let names = kept.into_iter().map(|index| names[index].clone()).collect();
    Ok(RawTable { path: path.into(), names, columns, lines, read: Some(Read::of(path, &bytes)) })
}

/// An empty cell is "no number", NaN; so is the word NaN. Text is none. Blanks around it do not matter.
fn number(cell: &[u8]) -> Option<f64> {
    let cell = cell.trim_ascii();
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    std::str::from_utf8(cell).ok()?.parse().ok()
}

fn header(path: &Path, record: &csv::ByteRecord) -> Result<Vec<String>> {
    let names: Vec<String> = record.iter().map(|name| String::from_utf8_lossy(name.trim_ascii()).into_owned()).collect();
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        let expected = "a header line with the columns' names";
        return Err(fault(
            path,
            format!("numbers in the first line (`{}`, …)", names.first().map_or("", String::as_str)),
            expected,
        ));
    }
    if let [only] = names.as_slice()
        && only.contains([';', '\t'])
    {
        return Err(fault(
            path,
            "a header separated by semicolons or tabs",
            "commas between the columns and points in the numbers",
        ));
    }
    Ok(names)
}

/// Line of the record that ends just before `position`; blank lines before the record do not count into it.
fn line_of_record_before(content: &[u8], position: &csv::Position) -> usize {
    let end = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let line = usize::try_from(position.line()).unwrap_or(usize::MAX);
    let past_newline = end.checked_sub(1).and_then(|last| content.get(last)) == Some(&b'\n');
    line - usize::from(past_newline)
}

fn csv_fault(path: &Path, error: &csv::Error) -> Error {
    fault(path, format!("unreadable CSV ({error})"), "comma-separated text with a header line")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(content: &[u8]) -> Result<RawTable> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("a.csv");
        std::fs::write(&path, content).map_err(Error::io(&path))?;
        read_csv(&path, &|name| name != "comment")
    }

    #[test]
    fn lines_are_the_files_own_whatever_ends_them() -> Result<()> {
        for content in ["t,x\n0,1\n\n1,2\n2,3", "t,x\r\n0,1\r\n\r\n1,2\r\n2,3\r\n", "\u{FEFF}t, x\n0, 1\n\n1 ,2\n2,3\n"] {
            let table = read(content.as_bytes())?;
            assert_eq!(table.names, ["t", "x"], "{content:?}");
            assert_eq!(table.lines, [2, 4, 5], "{content:?}");
            assert_eq!(table.column("x"), Some([1.0, 2.0, 3.0].as_slice()));
        }
        Ok(())
    }

    #[test]
    fn an_ignored_column_may_hold_text_and_commas() -> Result<()> {
        let table = read(b"t,comment,x\n0,\"gust, left\",5\n")?;
        assert_eq!((table.names.len(), table.column("x")), (2, Some([5.0].as_slice())));
        Ok(())
    }

    #[test]
    fn what_is_not_a_log_is_refused_with_its_place() {
        for (content, part) in [
            (b"t,x\n0,1\n1,fast\n".as_slice(), "line 3, column `x`: found `fast`, expected a number"),
            (b"t,x\n0,1\n1\n", "line 3, column `x`: found 1 cells in the row, expected 2"),
            (b"t,x,x\n0,1,1\n", "line 1, column `x`: found the same name twice"),
            (b"t,x\n", "a header and no rows"),
            (b" \n", "an empty file"),
            (b"0,1\n1,2\n", "numbers in the first line"),
            (b"t;x\n0;1\n", "semicolons"),
            (b"t,x\n\0\0\0", "binary content"),
            (b"t,\n0,1\n", "a column without a name, number 2"),
        ] {
            let refused = read(content).map_err(|error| error.to_string());
            assert!(matches!(&refused, Err(text) if text.contains(part)), "{refused:?} should contain {part:?}");
        }
    }
}
