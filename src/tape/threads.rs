//! On how many threads a session works, and the two ways to get there: a pool of its own, and a fork into two.
//!
//! Without the feature `rayon` everything runs on the calling thread.

#[cfg(feature = "rayon")]
use crate::tape::error::Error;
use crate::tape::error::Result;

/// How many threads a session works on, at most [`Threads::MOST`]; 0 means all cores. Without the feature `rayon`, always the calling
/// one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads(pub usize);

impl Threads {
    /// Most threads of a session.
    pub const MOST: usize = 1024;

    /// The number meant.
    pub(super) fn count(self) -> usize {
        match self.0 {
            _ if cfg!(not(feature = "rayon")) => 1,
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            count => count,
        }
    }
}

/// Whether work may be shared with the other threads of the pool it runs in: an argument of all that may do so, never a global.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parallelism {
    /// On the calling thread.
    Sequential,
    /// On any thread of the session's pool.
    #[cfg(feature = "rayon")]
    Shared,
}

impl Parallelism {
    /// Two closures, side by side if that is allowed and a thread is idle.
    pub(super) fn join(self, a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
        match self {
            Self::Sequential => {
                a();
                b();
            }
            #[cfg(feature = "rayon")]
            Self::Shared => {
                rayon::join(a, b);
            }
        }
    }
}

/// The threads of a session.
pub(super) struct Workers {
    #[cfg(feature = "rayon")]
    pool: Option<rayon::ThreadPool>,
}

impl Workers {
    /// This many threads.
    ///
    /// # Errors
    /// [`Error::Threads`] if they are more than [`Threads::MOST`](super::Threads::MOST), or cannot be started.
    #[cfg(feature = "rayon")]
    pub(super) fn new(count: usize) -> Result<Self> {
        if count > Threads::MOST {
            let expected = format!("0 (all cores) to {}", Threads::MOST);
            return Err(Error::Threads { found: count.to_string(), expected });
        }
        Ok(Self { pool: if count > 1 { Some(pool(count)?) } else { None } })
    }

    /// The calling thread, whatever the number.
    #[cfg(not(feature = "rayon"))]
    pub(super) fn new(_: usize) -> Result<Self> {
        Ok(Self {})
    }

    /// Does some work, telling it how it may be shared.
    pub(super) fn run(&self, work: impl FnOnce(Parallelism) + Send) {
        #[cfg(feature = "rayon")]
        if let Some(pool) = &self.pool {
            return pool.install(|| work(Parallelism::Shared));
        }
        work(Parallelism::Sequential);
    }
}

#[cfg(feature = "rayon")]
fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let named = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|index| format!("phyture-{index}"));
    named.build().map_err(|error| Error::Threads {
        found: format!("{threads} ({error})"),
        expected: "a number of threads that the system can start".into(),
    })
}
