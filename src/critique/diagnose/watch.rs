//! A search that is watched while it runs: what it is at, for whoever waits, and a way to stop it. It judges nothing.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What a search and whoever waits for it share. All clones are one.
#[derive(Clone, Debug, Default)]
pub struct Watch(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    stage: Mutex<String>,
    stopped: AtomicBool,
}

impl Watch {
    /// What the search is at, in words; empty before it begins.
    pub fn stage(&self) -> String {
        self.0.stage.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Asks the search to stop; it does so at its next step.
    pub fn stop(&self) {
        self.0.stopped.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked to stop.
    pub fn is_stopped(&self) -> bool {
        self.0.stopped.load(Ordering::Relaxed)
    }

    /// The search is at `stage` now.
    ///
    /// # Errors
    /// [`Error::Interrupted`] where it was asked to stop.
    pub fn at(&self, stage: impl Into<String>) -> Result<()> {
        if self.is_stopped() {
            return Err(Error::Interrupted { saved: "the search was stopped, and nothing was changed".into() });
        }
        *self.0.stage.lock().unwrap_or_else(PoisonError::into_inner) = stage.into();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stopped_watch_ends_the_next_step_and_keeps_the_last_stage() {
        let watch = Watch::default();
        let other = watch.clone();
        assert!(watch.at("first").is_ok());
        other.stop();
        assert!(matches!(watch.at("second"), Err(Error::Interrupted { .. })));
        assert_eq!(other.stage(), "first");
    }
}
