//! How long a piece of work took.

use std::time::Instant;

/// The moment at which a piece of work began. WebAssembly without a system has no clock, and asking for the time there is a panic.
pub(crate) struct Stopwatch(Option<Instant>);

impl Stopwatch {
    /// From now on.
    pub fn start() -> Self {
        let clock = !cfg!(all(target_family = "wasm", target_os = "unknown"));
        Self(clock.then(Instant::now))
    }

    /// Seconds since then; 0 where there is no clock.
    pub fn seconds(&self) -> f64 {
        self.0.map_or(0.0, |begun| begun.elapsed().as_secs_f64())
    }
}
