//! The border itself: pointers and lengths that come from C, sentences that go there, and panics that stop here. What the functions do is
//! in `model` and `stream`.

use crate::status::PhytureStatus;
use phyture::flight::Column;
use std::ffi::{CStr, c_char};
use std::fmt::{self, Display, Write};
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

/// Why a call failed. Those that a program in flight may meet hold nothing on the heap.
#[derive(Debug)]
pub enum Fault {
    /// The argument of this name is null.
    Null(&'static str),
    /// The argument of this name has another length.
    Length { name: &'static str, found: usize, expected: usize },
    /// A state, by its place, is not finite.
    State(usize, f64),
    /// A column of the log's own, by its place, is not finite.
    Own(usize, f64),
    /// A time is not finite.
    Start(f64),
    /// A network that looks at no sample.
    Every,
    /// What the physics predicts is not finite.
    Physics,
    /// What the library says.
    Library(PhytureStatus, phyture::Error),
    /// What a panic said.
    Panic(String),
    /// There was a panic before.
    Broken,
}

impl Fault {
    /// What the library says about a file.
    pub fn file(error: phyture::Error) -> Self {
        Self::Library(PhytureStatus::File, error)
    }

    /// What the library says about a model.
    pub fn model(error: phyture::Error) -> Self {
        Self::Library(PhytureStatus::Model, error)
    }

    pub const fn status(&self) -> PhytureStatus {
        match self {
            Self::Null(_) => PhytureStatus::Null,
            Self::Length { .. } | Self::Every => PhytureStatus::Length,
            Self::State(..) | Self::Own(..) | Self::Start(_) => PhytureStatus::NotFinite,
            Self::Physics => PhytureStatus::Prediction,
            Self::Library(status, _) => *status,
            Self::Panic(_) | Self::Broken => PhytureStatus::Panic,
        }
    }
}

impl Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null(name) => write!(f, "`{name}` is NULL"),
            Self::Length { name, found, expected } => write!(f, "`{name}` has {found} numbers, expected {expected}"),
            Self::State(place, value) => {
                write!(f, "`{}` is {value}, not a finite number; the sample was not taken", Column::STATE[*place].name())
            }
            Self::Own(place, value) => write!(f, "own[{place}] is {value}, not a finite number; the sample was not taken"),
            Self::Start(value) => write!(f, "`start_s` is {value}, not a finite number"),
            Self::Every => f.write_str("`samples` is 0, expected 1 or more"),
            Self::Physics => f.write_str("the physics is not finite here: look at this state, and at the formulas of the model"),
            Self::Library(_, error) => error.fmt(f),
            Self::Panic(said) => write!(f, "a fault of the library: {said}"),
            Self::Broken => f.write_str("there was a fault of the library before; this handle can only be freed"),
        }
    }
}

/// A text that is cut to its room, at a whole character, and always ends with a zero.
pub struct Text<'a> {
    room: &'a mut [MaybeUninit<u8>],
    used: usize,
    full: bool,
}

impl<'a> Text<'a> {
    /// An empty text in this room; in no room nothing is written.
    pub fn new(room: &'a mut [MaybeUninit<u8>]) -> Self {
        if let Some(first) = room.first_mut() {
            first.write(0);
        }
        Self { room, used: 0, full: false }
    }

    /// The caller's buffer.
    ///
    /// # Safety
    /// `start` is null, or `length` bytes there can be written and nobody else touches them for as long as the text lives.
    pub unsafe fn at(start: *mut c_char, length: usize) -> Self {
        if start.is_null() || length > isize::MAX as usize {
            return Self::new(&mut []);
        }
        // SAFETY: the caller keeps the contract above; `MaybeUninit` as the bytes may never have been written.
        Self::new(unsafe { std::slice::from_raw_parts_mut(start.cast(), length) })
    }
}

impl Write for Text<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for letter in text.chars().filter(|letter| *letter != '\0') {
            let mut bytes = [0; 4];
            let bytes = letter.encode_utf8(&mut bytes).as_bytes();
            self.full |= self.used + bytes.len() >= self.room.len();
            if self.full {
                break;
            }
            for byte in bytes.iter().chain(&[0]) {
                self.room[self.used].write(*byte);
                self.used += 1;
            }
            // The zero is overwritten by what follows.
            self.used -= 1;
        }
        Ok(())
    }
}

/// Runs the work of a call. A fault, be it a panic, becomes a status, and its sentence is written down.
pub fn guarded(message: &mut Text<'_>, work: impl FnOnce() -> Result<(), Fault>) -> PhytureStatus {
    // What the work was changing is a new handle that nobody gets, or a stream that refuses everything from then on.
    let done = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|said| {
        let text = said.downcast_ref::<String>().map(String::as_str).or_else(|| said.downcast_ref::<&str>().copied());
        Err(Fault::Panic(text.unwrap_or("no reason given").to_owned()))
    });
    match done {
        Ok(()) => PhytureStatus::Ok,
        Err(fault) => {
            // A text that is cut is no error.
            let _ = write!(message, "{fault}");
            fault.status()
        }
    }
}

/// Drops what a handle points at; null is nothing.
///
/// # Safety
/// `handle` is null or came from [`Box::into_raw`], and nobody uses it any more.
pub unsafe fn free<T>(handle: *mut T) {
    if handle.is_null() {
        return;
    }
    // SAFETY: the caller keeps the contract above.
    let owned = unsafe { Box::from_raw(handle) };
    guarded(&mut Text::new(&mut []), || {
        drop(owned);
        Ok(())
    });
}

/// What an argument points at.
///
/// # Safety
/// `pointer` is null or points at a value that nobody changes for as long as the reference lives.
pub unsafe fn shared<'a, T>(pointer: *const T, name: &'static str) -> Result<&'a T, Fault> {
    // SAFETY: the caller keeps the contract above.
    unsafe { pointer.as_ref() }.ok_or(Fault::Null(name))
}

/// So many numbers.
///
/// # Safety
/// `pointer` is null or points at `found` numbers that nobody changes for as long as the slice lives.
pub unsafe fn numbers<'a>(pointer: *const f64, found: usize, expected: usize, name: &'static str) -> Result<&'a [f64], Fault> {
    if found != expected {
        return Err(Fault::Length { name, found, expected });
    }
    match (pointer.is_null(), expected) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(Fault::Null(name)),
        // SAFETY: not null, and the caller keeps the contract above for as many numbers as were asked for.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(pointer, expected) }),
    }
}

/// A path: bytes as they are where paths are bytes, else UTF-8.
///
/// # Safety
/// `pointer` is null or points at a text that ends with a zero and that nobody changes meanwhile.
pub unsafe fn path(pointer: *const c_char) -> Result<PathBuf, Fault> {
    if pointer.is_null() {
        return Err(Fault::Null("path"));
    }
    // SAFETY: not null, and the caller keeps the contract above.
    let text = unsafe { CStr::from_ptr(pointer) };
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        Ok(std::ffi::OsStr::from_bytes(text.to_bytes()).into())
    }
    #[cfg(not(unix))]
    match text.to_str() {
        Ok(text) => Ok(text.into()),
        Err(_) => Err(Fault::file(phyture::Error::File {
            path: text.to_string_lossy().as_ref().into(),
            message: "a path that is no UTF-8".into(),
        })),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `say` writes into a room of so many bytes, up to its zero; the bytes behind the room stay as they are.
    fn written(length: usize, say: &str) -> Vec<u8> {
        let mut room = [0x55_u8; 64];
        // SAFETY: the room is longer than any length asked for.
        let mut text = unsafe { Text::at(room.as_mut_ptr().cast(), length) };
        let _ = text.write_str(say);
        let _ = text.write_str(say);
        assert!(room[length..].iter().all(|byte| *byte == 0x55));
        room[..length].iter().copied().take_while(|byte| *byte != 0).collect()
    }

    #[test]
    fn texts_are_cut_at_a_whole_character_and_end_with_a_zero() {
        assert_eq!(written(20, "m/s²"), "m/s²m/s²".as_bytes());
        assert_eq!(written(11, "m/s²"), "m/s²m/s²".as_bytes());
        assert_eq!(written(10, "m/s²"), "m/s²m/s".as_bytes());
        // What comes after a cut does not fill the gap.
        assert_eq!(written(5, "m/s²"), "m/s".as_bytes());
        assert_eq!(written(1, "m"), b"");
        assert_eq!(written(0, "m"), b"");
        assert_eq!(written(9, "a\0b"), b"abab");
        // SAFETY: null is allowed.
        let mut nowhere = unsafe { Text::at(std::ptr::null_mut(), 10) };
        assert!(nowhere.write_str("lost").is_ok());
    }

    #[test]
    fn a_panic_stops_here_with_what_it_said() {
        let mut room = [MaybeUninit::new(0); 80];
        let mut text = Text::new(&mut room);
        assert_eq!(guarded(&mut text, || panic!("index {} of {}", 7, 3)), PhytureStatus::Panic);
        let used = text.used;
        let said: Vec<u8> = room
            .iter()
            .take(used)
            .map(|byte| {
                // SAFETY: the room was written as a whole when it was made.
                unsafe { byte.assume_init() }
            })
            .collect();
        assert_eq!(said, b"a fault of the library: index 7 of 3");
        assert_eq!(guarded(&mut Text::new(&mut []), || Ok(())), PhytureStatus::Ok);
    }

    #[test]
    fn lengths_and_null_are_refused_before_anything_is_read() {
        let three = [1.0, 2.0, 3.0];
        // SAFETY: null, or three numbers where three are asked for; a wrong length is refused before the pointer is looked at.
        unsafe {
            assert!(numbers(three.as_ptr(), 3, 3, "state").is_ok_and(|found| found == three));
            let refused = |found: Result<&[f64], Fault>| found.err().map(|fault| (fault.status(), fault.to_string()));
            let length = Some((PhytureStatus::Length, "`state` has 3 numbers, expected 16".to_owned()));
            assert_eq!(refused(numbers(three.as_ptr(), 3, 16, "state")), length);
            assert_eq!(
                refused(numbers(std::ptr::null(), 16, 16, "state")),
                Some((PhytureStatus::Null, "`state` is NULL".to_owned()))
            );
            assert!(numbers(std::ptr::null(), 0, 0, "own").is_ok_and(<[f64]>::is_empty));
            assert!(shared::<f64>(std::ptr::null(), "model").is_err());
            assert!(path(std::ptr::null()).is_err());
            assert!(path(c"a/b.toml".as_ptr()).is_ok_and(|path| path.to_str() == Some("a/b.toml")));
        }
    }
}
