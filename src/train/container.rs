//! The container of a training checkpoint: magic, version, length, checksum, then the state in bincode.
//!
//! The one file that knows the codec. A file that is cut, changed, of another kind or of a newer version gives an
//! [`Error::File`] that says so: never a panic, never a large allocation.
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | `PHYTURE\n` |
//! | 4 | version, little-endian |
//! | 8 | length of the payload |
//! | 4 | CRC-32 of the payload |
//! | … | payload: bincode 1.3.3, fixed-width integers, no trailing bytes |

use crate::disk::write_atomically;
use crate::error::{Error, Result};
use bincode::Options;
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

const MAGIC: [u8; 8] = *b"PHYTURE\n";

/// Version written and read. 2: a convolution's weight lies as `[taps, in, out]`. 3: a state holds the losses of its epochs and the best one.
pub const VERSION: u32 = 3;

fn codec(limit: u64) -> impl Options {
    bincode::DefaultOptions::new().with_fixint_encoding().reject_trailing_bytes().with_limit(limit)
}

/// Writes `state` to `path` by way of a temporary name, synced and renamed: the file is the old one or the new one, never half.
///
/// # Errors
/// [`Error::Io`] if it cannot be written; [`Error::File`] if the state cannot be encoded.
pub fn write<S: Serialize>(path: &Path, state: &S) -> Result<()> {
    let payload = codec(u64::MAX).serialize(state).map_err(|error| fault(path, format!("the state cannot be written: {error}")))?;
    write_atomically(path, |file| {
        file.write_all(&MAGIC)?;
        file.write_all(&VERSION.to_le_bytes())?;
        file.write_all(&(payload.len() as u64).to_le_bytes())?;
        file.write_all(&crc32fast::hash(&payload).to_le_bytes())?;
        file.write_all(&payload)
    })
}

/// Reads what [`write()`] wrote.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::File`] saying whether it is of another kind, newer, cut or changed.
pub fn read<S: DeserializeOwned>(path: &Path) -> Result<S> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    decode(&bytes).map_err(|message| fault(path, message))
}

fn fault(path: &Path, message: String) -> Error {
    Error::File { path: path.into(), message }
}

fn decode<S: DeserializeOwned>(bytes: &[u8]) -> Result<S, String> {
    let (magic, rest) = bytes.split_first_chunk::<8>().ok_or("is too short to be a checkpoint")?;
    if *magic != MAGIC {
        return Err("is not a checkpoint of phyture (its first bytes differ)".into());
    }
    let cut = || format!("is cut: {} bytes, fewer than its header says; an earlier copy is needed", bytes.len());
    let (version, rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
    let version = u32::from_le_bytes(*version);
    if version != VERSION {
        return Err(format!("has format version {version}; this program reads version {VERSION}: use the phyture that wrote it"));
    }
    let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(cut)?;
    let (checksum, payload) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
    let length = u64::from_le_bytes(*length);
    if length != payload.len() as u64 {
        return Err(format!("holds {} bytes of state and should hold {length}; an earlier copy is needed", payload.len()));
    }
    if u32::from_le_bytes(*checksum) != crc32fast::hash(payload) {
        return Err("does not match its checksum: it was changed or damaged after writing; an earlier copy is needed".into());
    }
    codec(length).deserialize(payload).map_err(|error| format!("does not decode (version {version}): {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type State = (String, Vec<f32>, Vec<u64>, Option<f64>);

    fn file(state: &State) -> Result<Vec<u8>> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("checkpoint");
        write(&path, state)?;
        std::fs::read(&path).map_err(Error::io(&path))
    }

    fn example() -> State {
        ("config".into(), vec![1.5, -0.0, f32::MIN_POSITIVE], vec![7, u64::MAX], Some(0.1))
    }

    #[test]
    fn round_trip_keeps_every_bit() -> Result<()> {
        let state = example();
        let back: State = decode(&file(&state)?).map_err(Error::Undetermined)?;
        assert_eq!(back, state);
        assert_eq!(back.1[1].to_bits(), (-0.0f32).to_bits());
        Ok(())
    }

    #[test]
    fn every_truncation_and_every_single_bit_flip_is_an_error() -> Result<()> {
        let bytes = file(&example())?;
        for length in 0..bytes.len() {
            assert!(decode::<State>(&bytes[..length]).is_err(), "cut to {length}");
        }
        for bit in 0..bytes.len() * 8 {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(decode::<State>(&changed).is_err(), "bit {bit}");
        }
        Ok(())
    }

    #[test]
    fn a_newer_version_is_refused_by_name() -> Result<()> {
        let mut bytes = file(&example())?;
        bytes[8] = 200;
        assert!(matches!(decode::<State>(&bytes), Err(text) if text.contains("version 200")));
        Ok(())
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..200), keep_magic: bool) {
            if keep_magic && bytes.len() >= 24 {
                bytes[..8].copy_from_slice(&MAGIC);
            }
            prop_assert!(decode::<State>(&bytes).is_err());
        }
    }
}
