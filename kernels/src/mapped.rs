//! Numbers in a file that nobody else can open: read as memory is, and held there no longer than they are used. No kernel; it stands here
//! because all `unsafe` of the project does.

use memmap2::{Mmap, UncheckedAdvice};
use std::fs::{File, OpenOptions, remove_file};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Numbers in a file without a name, which goes with the process.
#[derive(Debug)]
pub struct Mapped {
    map: Mmap,
}

impl Mapped {
    /// Writes rows one after the other to a file in `folder`.
    ///
    /// # Errors
    /// Those of the file; where a file that is open cannot lose its name, [`io::ErrorKind::Unsupported`].
    ///
    /// ```
    /// let rows = phyture_kernels::mapped::Mapped::new(&std::env::temp_dir(), &[&[1.0, 2.0], &[3.0, 4.0]])?;
    /// rows.rest();
    /// assert_eq!(rows.as_slice(), [1.0, 2.0, 3.0, 4.0]);
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn new(folder: &Path, rows: &[&[f64]]) -> io::Result<Self> {
        let mut file = BufWriter::new(nameless(folder)?);
        for value in rows.iter().copied().flatten() {
            file.write_all(&value.to_ne_bytes())?;
        }
        let file = file.into_inner()?;
        // SAFETY: the file has no name and this is its only handle, so nobody can write to it or cut it short while it is mapped; it was
        // written in full, so every page is there.
        let map = unsafe { Mmap::map(&file)? };
        Ok(Self { map })
    }

    /// All rows, one after the other.
    pub fn as_slice(&self) -> &[f64] {
        // SAFETY: pages begin at multiples of what a number is aligned to, the file holds whole numbers, and any bits are one.
        unsafe { std::slice::from_raw_parts(self.map.as_ptr().cast(), self.map.len() / size_of::<f64>()) }
    }

    /// Says that the numbers are not needed for now: the memory that they take is free for others, and the next look brings them back.
    pub fn rest(&self) {
        // SAFETY: of a file that nobody writes to the system brings the same bytes again.
        let advised = unsafe { self.map.unchecked_advise(UncheckedAdvice::DontNeed) };
        // Advice that is not taken changes nothing but the memory in use.
        drop(advised);
    }
}

/// A new file that has lost its name already.
fn nameless(folder: &Path) -> io::Result<File> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    if !cfg!(unix) {
        return Err(io::ErrorKind::Unsupported.into());
    }
    let name = format!(".phyture-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let path = folder.join(name);
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
    remove_file(&path)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_bit_for_bit_before_and_after_a_rest_and_leave_no_file() -> io::Result<()> {
        let folder = std::env::temp_dir().join(format!("phyture-mapped-{}", std::process::id()));
        std::fs::create_dir_all(&folder)?;
        // More than a page, odd values among them.
        let long: Vec<f64> = (0..3000).map(|k| f64::from(k).sin() / 3.0).collect();
        let odd = [f64::MIN_POSITIVE / 4.0, -0.0, f64::INFINITY, 1e308];
        let mapped = Mapped::new(&folder, &[&long, &odd])?;
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let expected = [bits(&long), bits(&odd)].concat();
        assert_eq!(bits(mapped.as_slice()), expected);
        mapped.rest();
        assert_eq!(bits(mapped.as_slice()), expected);
        assert_eq!(std::fs::read_dir(&folder)?.count(), 0);
        std::fs::remove_dir(&folder)
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        assert!(Mapped::new(Path::new("/nowhere/at/all"), &[&[1.0]]).is_err());
    }
}
