//! Panics of code that is not ours, turned into errors at the one border where that code reads a file from outside.
//!
//! Nothing of our own is called in here: a broken invariant of the program stays loud.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is reading a file behind the border, so that a panic will become an error. A program's panic hook may ask, and
/// then print nothing.
pub fn inside() -> bool {
    INSIDE.get()
}

/// Runs `read`; what a panic said, if it panics. What `read` was changing is not to be used then.
pub(super) fn guarded<T>(read: impl FnOnce() -> T) -> Result<T, String> {
    let before = INSIDE.replace(true);
    let result = catch_unwind(AssertUnwindSafe(read));
    INSIDE.set(before);
    result.map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str).or_else(|| payload.downcast_ref::<&str>().copied());
        text.unwrap_or("no reason given").to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_text_and_the_border_is_left() {
        assert_eq!(guarded(|| 3), Ok(3));
        let caught = guarded(|| -> i32 { panic!("index {} is out of range", 7) });
        assert_eq!(caught, Err("index 7 is out of range".to_owned()));
        assert_eq!((guarded(inside), inside()), (Ok(true), false));
    }
}
