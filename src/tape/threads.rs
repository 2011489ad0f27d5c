//! On how many threads a session works, and the two ways to get there: a pool of its own, and a fork into two.
//!
//! Without the feature `rayon` everything runs on the calling thread.

#[cfg(feature = "rayon")]
use crate::error::{Error, Result};

/// How many threads a session works on; 0 means all cores. Without the feature `rayon`, always the calling one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads(pub usize);

#[cfg(feature = "rayon")]
pub(super) fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let named = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|index| format!("phyture-{index}"));
    named.build().map_err(|error| Error::Config {
        place: "session".into(),
        field: "threads".into(),
        found: format!("{threads} ({error})"),
        expected: "a number of threads that the system can start".into(),
    })
}

/// Two closures, on two threads if a pool is there.
pub(super) fn join(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    #[cfg(feature = "rayon")]
    if rayon::current_thread_index().is_some() {
        rayon::join(a, b);
        return;
    }
    a();
    b();
}
