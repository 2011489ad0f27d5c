//! The bytes of a binary log, read forwards, with the place of each: what ULog and DataFlash have in common.
//!
//! Little-endian numbers in fixed places. A read beyond the end is an error with its offset; nothing is allocated for what a file claims to hold.

use super::table::fault;
use crate::error::{Error, Result};
use std::path::Path;

/// A file's content up to `end`, and how far it is read.
pub(super) struct Bytes<'a> {
    path: &'a Path,
    content: &'a [u8],
    at: usize,
    end: usize,
}

impl<'a> Bytes<'a> {
    pub fn new(path: &'a Path, content: &'a [u8]) -> Self {
        Self { path, content, at: 0, end: content.len() }
    }

    /// Offset of what is read next.
    pub fn at(&self) -> usize {
        self.at
    }

    pub fn is_at_end(&self) -> bool {
        self.at >= self.end
    }

    /// Goes on at an offset, and stops before another; both within the file.
    pub fn go(&mut self, at: usize, end: usize) {
        self.end = end.min(self.content.len());
        self.at = at.min(self.end);
    }

    /// The next bytes, which are `what`.
    ///
    /// # Errors
    /// [`Error::Log`] if the file ends before.
    pub fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8]> {
        let taken = self.at.checked_add(length).filter(|end| *end <= self.end).and_then(|end| self.content.get(self.at..end));
        let left = self.end - self.at;
        let taken = taken.ok_or_else(|| self.fault(self.at, format!("{left} bytes of {what}, which has {length}")))?;
        self.at += length;
        Ok(taken)
    }

    /// An error about what stands at an offset.
    pub fn fault(&self, offset: usize, found: impl std::fmt::Display) -> Error {
        const EXPECTED: &str =
            "a whole log; copy it from the aircraft again, or say `damaged = \"stop\"` in dataset.toml to read it up to there";
        fault(self.path, format!("{found}, at byte {offset}"), EXPECTED)
    }
}

/// The unsigned number in up to eight bytes.
pub(super) fn unsigned(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte))
}

/// The signed number in one to eight bytes.
pub(super) fn signed(bytes: &[u8]) -> i64 {
    let unused = 64 - 8 * bytes.len().clamp(1, 8) as u32;
    (unsigned(bytes) << unused) as i64 >> unused
}

/// The number in four or eight bytes; none in others.
pub(super) fn float(bytes: &[u8]) -> f64 {
    match bytes.len() {
        4 => f64::from(f32::from_bits(unsigned(bytes) as u32)),
        8 => f64::from_bits(unsigned(bytes)),
        _ => f64::NAN,
    }
}

/// Text up to the first zero, without blanks around it.
pub(super) fn text(bytes: &[u8]) -> String {
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(bytes).trim().to_owned()
}

/// Reads a log cut off at every place. Every error has its place; how often there is none, since a message has just ended.
#[cfg(test)]
pub(super) fn ends_between_messages<T>(log: &[u8], read: impl Fn(&[u8]) -> Result<T>) -> usize {
    let ends = |length: &usize| match read(&log[..*length]) {
        Ok(_) => true,
        Err(Error::Log { found, .. }) => {
            assert!(found.contains("at byte") || found.contains("does not begin"), "{length}: {found}");
            false
        }
        Err(other) => panic!("{length}: {other}"),
    };
    (0..log.len()).filter(ends).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_little_endian_and_an_end_has_its_place() {
        assert_eq!((unsigned(&[1, 2]), signed(&[0xff, 0xff]), signed(&[0xfe]), signed(&[0xff; 8])), (513, -1, -2, -1));
        assert_eq!((float(&1.5_f32.to_le_bytes()), float(&(-2.5_f64).to_le_bytes())), (1.5, -2.5));
        assert_eq!(text(b" IMU \0xx"), "IMU");
        let mut bytes = Bytes::new(Path::new("a.ulg"), b"abc");
        assert_eq!(bytes.take(2, "a name").ok(), Some(b"ab".as_slice()));
        let refused = bytes.take(usize::MAX, "a name").map_err(|error| error.to_string());
        assert!(matches!(refused, Err(text) if text.contains("1 bytes of a name") && text.contains("at byte 2")));
    }
}
