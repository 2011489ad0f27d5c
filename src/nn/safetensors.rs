//! Safetensors: weights and test vectors in the format that PyTorch programs exchange. f32 and f64 tensors, and text metadata.
//!
//! Layout: header length (u64, little-endian), header (JSON: name → dtype, shape, byte offsets), raw row-major little-endian data.
//! A damaged or hostile file is an [`Error::File`], never a panic, and never makes this allocate more than the file is long.
//! Training checkpoints are another format.

#[cfg(feature = "disk")]
use crate::disk::write_atomically;
#[cfg(feature = "disk")]
use crate::error::Error;
use crate::error::Result;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
#[cfg(feature = "disk")]
use std::path::Path;

/// Longest header accepted, bytes; the limit of the format's reference implementation.
const LONGEST_HEADER: u64 = 100_000_000;

/// Bytes of the header length.
const PREFIX: usize = 8;

/// Key of the metadata in the header.
const METADATA: &str = "__metadata__";

/// Numbers of one tensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// dtype `F32`.
    F32(Vec<f32>),
    /// dtype `F64`.
    F64(Vec<f64>),
}

impl Numbers {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(numbers) => numbers.len(),
            Self::F64(numbers) => numbers.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `F32` or `F64`.
    pub const fn dtype(&self) -> &'static str {
        match self {
            Self::F32(_) => "F32",
            Self::F64(_) => "F64",
        }
    }

    /// As f64, exactly.
    pub fn to_f64(&self) -> Vec<f64> {
        match self {
            Self::F32(numbers) => numbers.iter().map(|&number| f64::from(number)).collect(),
            Self::F64(numbers) => numbers.clone(),
        }
    }
}

/// A named tensor's shape and numbers, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Lengths of the axes; empty for a scalar.
    pub shape: Vec<usize>,
    /// As many as the product of the lengths.
    pub numbers: Numbers,
}

/// The content of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SafeTensors {
    /// Text by key.
    pub metadata: BTreeMap<String, String>,
    /// Tensors by name.
    pub tensors: BTreeMap<String, Tensor>,
}

impl SafeTensors {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read, [`Error::File`] if it is not a sound safetensors file of f32 and f64 tensors.
    #[cfg(feature = "disk")]
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        Self::parse(&bytes).map_err(|message| Error::File { path: path.into(), message })
    }

    /// Writes a file in one step: a reader sees the old one or the new one.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    #[cfg(feature = "disk")]
    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomically(path, |file| file.write_all(&self.to_bytes()))
    }

    /// The bytes of a file. Tensors lie in the order of their names, without gaps.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut header = Map::new();
        if !self.metadata.is_empty() {
            header.insert(METADATA.into(), json!(self.metadata));
        }
        let mut data = Vec::new();
        for (name, tensor) in &self.tensors {
            let start = data.len();
            match &tensor.numbers {
                Numbers::F32(numbers) => numbers.iter().for_each(|number| data.extend(number.to_le_bytes())),
                Numbers::F64(numbers) => numbers.iter().for_each(|number| data.extend(number.to_le_bytes())),
            }
            let entry = json!({"dtype": tensor.numbers.dtype(), "shape": tensor.shape, "data_offsets": [start, data.len()]});
            header.insert(name.clone(), entry);
        }
        let mut header = Value::Object(header).to_string().into_bytes();
        // The data start at a multiple of eight, as the format recommends.
        header.resize(header.len().next_multiple_of(PREFIX), b' ');
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header);
        bytes.extend(data);
        bytes
    }

    /// Reads the bytes of a file; the error says what is wrong and what to do.
    ///
    /// # Errors
    /// A text for a person.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let (prefix, rest) = bytes.split_first_chunk::<PREFIX>().ok_or("shorter than 8 bytes; write the file again")?;
        let header_len = u64::from_le_bytes(*prefix);
        let header_end = usize::try_from(header_len).ok().filter(|_| header_len <= LONGEST_HEADER);
        let Some((header, data)) = header_end.and_then(|end| rest.split_at_checked(end)) else {
            return Err(format!(
                "the header claims {header_len} bytes, {} are there; not a safetensors file, or cut short",
                rest.len()
            ));
        };
        let header: Map<String, Value> =
            serde_json::from_slice(header).map_err(|error| format!("the header is no JSON object: {error}"))?;
        let mut file = Self::default();
        let mut ranges = Vec::with_capacity(header.len());
        for (name, entry) in header {
            if name == METADATA {
                file.metadata =
                    serde_json::from_value(entry).map_err(|error| format!("`{METADATA}` is no map of texts: {error}"))?;
                continue;
            }
            let entry: Entry = serde_json::from_value(entry).map_err(|error| format!("tensor `{name}`: {error}"))?;
            let [start, end] = entry.data_offsets;
            ranges.push((start, end));
            let tensor = entry.tensor(data).map_err(|message| format!("tensor `{name}`: {message}"))?;
            file.tensors.insert(name, tensor);
        }
        ranges.sort_unstable();
        let covered = ranges.iter().try_fold(0, |at, &(start, end)| (start == at).then_some(end));
        match covered {
            Some(end) if end == data.len() => Ok(file),
            Some(end) => Err(format!("{} bytes of data, the tensors need {end}; the file is cut short or has a tail", data.len())),
            None => Err("the tensors overlap or leave gaps; write the file again".into()),
        }
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

impl Entry {
    fn tensor(self, data: &[u8]) -> Result<Tensor, String> {
        let [start, end] = self.data_offsets;
        let bytes =
            data.get(start..end).ok_or_else(|| format!("bytes {start} to {end} of {}; the file is cut short", data.len()))?;
        let count = self.shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length));
        let expect = |size: usize| match count.and_then(|count| count.checked_mul(size)) {
            Some(expected) if expected == bytes.len() => Ok(()),
            _ => Err(format!("{} bytes for shape {:?} of {}", bytes.len(), self.shape, self.dtype)),
        };
        let numbers = match self.dtype.as_str() {
            "F32" => {
                expect(size_of::<f32>())?;
                Numbers::F32(bytes.as_chunks().0.iter().map(|chunk| f32::from_le_bytes(*chunk)).collect())
            }
            "F64" => {
                expect(size_of::<f64>())?;
                Numbers::F64(bytes.as_chunks().0.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect())
            }
            other => return Err(format!("dtype {other}; expected F32 or F64: convert it before export")),
        };
        Ok(Tensor { shape: self.shape, numbers })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> SafeTensors {
        let tensor = |shape: &[usize], numbers| Tensor { shape: shape.to_vec(), numbers };
        SafeTensors {
            metadata: [("config".to_owned(), r#"{"d_model": 8}"#.to_owned())].into(),
            tensors: [
                ("b".to_owned(), tensor(&[2, 2], Numbers::F32(vec![1.0, -2.5, f32::MIN_POSITIVE, f32::INFINITY]))),
                ("a".to_owned(), tensor(&[3], Numbers::F64(vec![0.1, -0.0, f64::MAX]))),
                ("scalar".to_owned(), tensor(&[], Numbers::F64(vec![7.0]))),
                ("empty".to_owned(), tensor(&[0, 4], Numbers::F32(vec![]))),
            ]
            .into(),
        }
    }

    fn with_header(header: &str, data: &[u8]) -> Vec<u8> {
        [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), data].concat()
    }

    #[cfg(feature = "disk")]
    #[test]
    fn files_round_trip_bitwise() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("weights.safetensors");
        sample().write(&path)?;
        assert_eq!(SafeTensors::read(&path)?, sample());
        assert_eq!(SafeTensors::parse(&sample().to_bytes()), Ok(sample()));
        Ok(())
    }

    #[test]
    fn every_truncation_is_refused() {
        let bytes = sample().to_bytes();
        for len in 0..bytes.len() {
            assert!(SafeTensors::parse(&bytes[..len]).is_err(), "cut to {len} of {} bytes", bytes.len());
        }
    }

    #[test]
    fn hostile_headers_are_refused_by_name() {
        let entry = |dtype: &str, shape: &str, offsets: &str| {
            format!(r#"{{"x": {{"dtype": "{dtype}", "shape": {shape}, "data_offsets": {offsets}}}}}"#)
        };
        for (header, word) in [
            (entry("F32", "[18446744073709551615, 2]", "[0, 8]"), "shape"),
            (entry("F32", "[4611686018427387905]", "[0, 8]"), "shape"),
            (entry("F32", "[2]", "[0, 99]"), "cut short"),
            (entry("F32", "[2]", "[8, 0]"), "bytes"),
            (entry("F16", "[4]", "[0, 8]"), "F16"),
            (entry("F32", "[1]", "[4, 8]"), "gaps"),
            (entry("F32", "[1]", "[0, 4]"), "tail"),
            (entry("F32", "[-1]", "[0, 8]"), "x"),
            (format!("{}{}", "[".repeat(100_000), "]".repeat(100_000)), "JSON"),
            ("[]".into(), "JSON"),
        ] {
            let message = SafeTensors::parse(&with_header(&header, &[0; 8])).err().unwrap_or_default();
            assert!(message.contains(word), "{:.80}: {message:.200}", header);
        }
        assert!(SafeTensors::parse(&u64::MAX.to_le_bytes()).is_err());
    }

    proptest! {
        #[test]
        fn no_change_of_one_byte_panics(at in 0_usize..600, value: u8) {
            let mut bytes = sample().to_bytes();
            let at = at % bytes.len();
            bytes[at] = value;
            // A change in the numbers is a valid file; one in the header is refused or names something else.
            if let Ok(file) = SafeTensors::parse(&bytes) {
                prop_assert!(file.tensors.values().map(|tensor| tensor.numbers.len()).sum::<usize>() <= bytes.len());
            }
        }
    }
}
