//! Writing what must not be lost: files that appear in one step, things that exist and stay, one writer at a time.
//!
//! This folder knows paths and bytes. What is written, and what a person is told to do when it is refused, is the callers' business.
//!
//! | file | subject |
//! | --- | --- |
//! | `atomic` | a file is the old one or the new one, never half of either |
//! | `target` | a file or folder that a command is going to write: checked before the work, and never overwritten unasked |
//! | `lock` | one program at a time writes a file or a folder; a lock ends with its process |
//! | `lines` | lines at the end of a file that is only ever added to |
//! | `date` | the day in a name, for old files that are kept |

mod atomic;
mod date;
mod lines;
mod lock;
mod target;

pub use atomic::write_atomically;
pub use lines::append_lines;
pub use lock::Lock;
pub use target::{Existing, Target};
