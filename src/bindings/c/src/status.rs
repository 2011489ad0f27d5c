//! What a call came to: a number for the program, and what each number means. The sentence about the case at hand is `border`'s.

use std::ffi::{CStr, c_char};

/// What a call came to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhytureStatus {
    /// Done.
    Ok = 0,
    /// A pointer that has to point somewhere is NULL.
    Null = 1,
    /// An array has another length than it has to have.
    Length = 2,
    /// A file cannot be read, or is not what it should be.
    File = 3,
    /// The model cannot be streamed like this: another step than the trained one, a formula that does not fit.
    Model = 4,
    /// A number that was given is not finite. Nothing was taken.
    NotFinite = 5,
    /// The predicted accelerations are not finite. The sample was taken.
    Prediction = 6,
    /// A fault of this library. The handle refuses everything from now on and can only be freed.
    Panic = 7,
}

impl PhytureStatus {
    const ALL: [Self; 8] =
        [Self::Ok, Self::Null, Self::Length, Self::File, Self::Model, Self::NotFinite, Self::Prediction, Self::Panic];

    const fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"done",
            Self::Null => c"a pointer is NULL",
            Self::Length => c"an array has another length than expected",
            Self::File => c"the file cannot be read",
            Self::Model => c"the model cannot be streamed like this",
            Self::NotFinite => c"a number is not finite; the sample was not taken",
            Self::Prediction => c"the prediction is not finite; the sample was taken",
            Self::Panic => c"a fault of the library; the handle can only be freed",
        }
    }
}

/// What a status means, in general; a static text. A number that is no PhytureStatus is called unknown.
#[unsafe(no_mangle)]
pub extern "C" fn phyture_status_text(status: i32) -> *const c_char {
    let known = PhytureStatus::ALL.into_iter().find(|known| *known as i32 == status);
    known.map_or(c"unknown", PhytureStatus::text).as_ptr()
}

/// Version of the library, as in "0.1.0"; a static text.
#[unsafe(no_mangle)]
pub extern "C" fn phyture_version() -> *const c_char {
    const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => panic!("a version holds no zero"),
    };
    VERSION.as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_text_of_its_own_and_others_are_unknown() {
        // SAFETY: both functions return static texts that end with a zero.
        let text = |status: i32| unsafe { CStr::from_ptr(phyture_status_text(status)) };
        for (place, status) in PhytureStatus::ALL.into_iter().enumerate() {
            assert_eq!(status as usize, place);
            assert_eq!(text(status as i32), status.text());
            assert!(PhytureStatus::ALL.into_iter().skip(place + 1).all(|other| other.text() != status.text()));
        }
        assert_eq!((text(8), text(-1)), (c"unknown", c"unknown"));
        // SAFETY: as above.
        assert_eq!(unsafe { CStr::from_ptr(phyture_version()) }.to_str(), Ok(env!("CARGO_PKG_VERSION")));
    }
}
