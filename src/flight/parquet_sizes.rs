//! What a Parquet file claims of its own structure, looked at before a foreign reader believes it.
//!
//! Footer and page headers are in Thrift's compact protocol. The `parquet` crate (60.1) passes over what it does not know: a list of truth values
//! there has no bytes, and one of two thousand million takes it seconds, a file of such lists days; and it asks for the memory that a page is said to
//! unpack to. Here a list has no more elements than there are bytes, and a page is no larger than its compression can have made it smaller. What the
//! structure means is not looked at.

/// Structures within structures; the crate goes as deep.
const MOST_DEPTH: usize = 64;

/// Behind the footer stand its length and a mark.
const TAIL: usize = 8;

/// Bytes that one byte of Snappy can stand for: a copy of 64 takes three.
const MOST_UNPACKED: i64 = 32;

/// Bytes of any page, however small.
const SMALL_PAGE: i64 = 1 << 16;

/// Refuses a footer with longer lists than it has bytes. A file without a footer is left to the reader.
pub(super) fn check_footer(file: &[u8]) -> Result<(), String> {
    let Some((content, tail)) = file.split_last_chunk::<TAIL>() else { return Ok(()) };
    let [a, b, c, d, ..] = *tail;
    let length = u32::from_le_bytes([a, b, c, d]) as usize;
    let Some(footer) = content.len().checked_sub(length).and_then(|start| content.get(start..)) else { return Ok(()) };
    let end = Walk::new(footer).structure(MOST_DEPTH, &mut |_, _| ());
    end.ok_or_else(|| format!("a footer that claims more than its {length} bytes hold"))
}

/// Refuses the pages of a column that claim more than they have bytes, or than these can stand for.
pub(super) fn check_pages(mut chunk: &[u8]) -> Result<(), String> {
    while !chunk.is_empty() {
        let (mut unpacked, mut packed) = (0, 0);
        let mut walk = Walk::new(chunk);
        let end = walk.structure(MOST_DEPTH, &mut |id, number| match id {
            2 => unpacked = number,
            3 => packed = number,
            _ => {}
        });
        end.ok_or_else(|| format!("the head of a page that claims more than the {} bytes left", chunk.len()))?;
        if !(0..=packed.saturating_mul(MOST_UNPACKED).saturating_add(SMALL_PAGE)).contains(&unpacked) {
            return Err(format!("a page of {packed} bytes that is said to unpack to {unpacked}"));
        }
        let next = usize::try_from(packed).ok().and_then(|packed| walk.at.checked_add(packed));
        let rest = next.and_then(|next| chunk.get(next..));
        chunk = rest.ok_or_else(|| format!("a page of {packed} bytes where {} are left", chunk.len() - walk.at))?;
    }
    Ok(())
}

/// Passes over values; `None` where the bytes end, or are fewer than elements.
struct Walk<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Elements of lists that may still come.
    left: usize,
}

impl<'a> Walk<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, left: bytes.len() }
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn skip(&mut self, length: usize) -> Option<()> {
        self.at = self.at.checked_add(length).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }

    /// Seven bits a byte, the lowest first.
    fn number(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    fn count(&mut self) -> Option<usize> {
        usize::try_from(self.number()?).ok()
    }

    /// Fields up to the end of the structure; `seen` is told of whole numbers by their field.
    fn structure(&mut self, depth: usize, seen: &mut dyn FnMut(i64, i64)) -> Option<()> {
        let mut id = 0_i64;
        loop {
            let head = self.byte()?;
            let (step, kind) = (head >> 4, head & 0x0f);
            if kind == 0 {
                return Some(());
            }
            id = if step == 0 { signed(self.number()?) } else { id.wrapping_add(i64::from(step)) };
            if matches!(kind, 4..=6) {
                seen(id, signed(self.number()?));
            } else {
                self.value(kind, depth)?;
            }
        }
    }

    fn value(&mut self, kind: u8, depth: usize) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            1 | 2 => Some(()),
            3 => self.skip(1),
            4..=6 => self.number().map(drop),
            7 => self.skip(8),
            8 => {
                let length = self.count()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.count()? } else { usize::from(head >> 4) };
                self.elements(count, &[head & 0x0f], depth)
            }
            11 => {
                let count = self.count()?;
                let kinds = if count > 0 { self.byte()? } else { 0 };
                self.elements(count, &[kinds >> 4, kinds & 0x0f], depth)
            }
            12 => self.structure(depth, &mut |_, _| ()),
            13 => self.skip(16),
            _ => None,
        }
    }

    fn elements(&mut self, count: usize, kinds: &[u8], depth: usize) -> Option<()> {
        self.left = self.left.checked_sub(count)?;
        (0..count).try_for_each(|_| kinds.iter().try_for_each(|kind| self.value(*kind, depth)))
    }
}

/// A number whose sign is its lowest bit.
fn signed(number: u64) -> i64 {
    (number >> 1) as i64 ^ -((number & 1) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of nothing but this footer.
    fn file(footer: &[u8]) -> Vec<u8> {
        [footer, &(footer.len() as u32).to_le_bytes(), b"PAR1"].concat()
    }

    #[test]
    fn lists_are_no_longer_than_the_bytes_are_many() {
        // Field 9, a list of truth values: two of them, and 2^31 - 1.
        assert_eq!(check_footer(&file(&[0x99, 0x22, 0])), Ok(()));
        let hostile = [0x99, 0xf2, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        assert!(check_footer(&file(&hostile)).is_err_and(|text| text.contains("its 8 bytes")));
        // Many lists of as many as there are bytes, within a list.
        let many: Vec<u8> = [0x99, 0xf9, 100].into_iter().chain([0xf2, 100].repeat(100)).chain([0]).collect();
        assert!(check_footer(&file(&many)).is_err());
        assert!(check_footer(&file(&[0x9c; 200])).is_err(), "structures without end");
        assert_eq!((check_footer(b"PAR1"), check_footer(&[0xff; 12])), (Ok(()), Ok(())));
    }

    #[test]
    fn pages_unpack_to_no_more_than_they_can() {
        // Type 0, then both sizes, zigzag: 40 and 10 bytes.
        let page = |unpacked: &[u8]| [&[0x15, 0, 0x15], unpacked, &[0x15, 20, 0], &[7; 10]].concat();
        assert_eq!(check_pages(&[page(&[80]), page(&[80])].concat()), Ok(()));
        assert!(check_pages(&page(&[0xfe, 0xff, 0xff, 0xff, 0x0f])).is_err_and(|text| text.contains("unpack to 2147483647")));
        assert!(check_pages(&page(&[80])[..12]).is_err_and(|text| text.contains("a page of 10 bytes where 5 are left")));
    }
}
