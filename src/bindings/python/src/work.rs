//! Work that takes a while: on a thread of its own, with the interpreter free for others, told of by a callback, stopped by Ctrl-C, and with
//! panics that stop here. What the work is, nothing here knows.

use crate::error::{fault, raised};
use phyture::critique::diagnose::Watch;
use pyo3::prelude::*;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How often signals are looked for and the callback is told.
const BETWEEN: Duration = Duration::from_millis(50);

/// What work and whoever waits for it share. All clones are one.
#[derive(Clone, Default)]
pub struct Watched {
    /// What a search is at, and the way to stop anything.
    pub watch: Watch,
    told: Arc<Mutex<Told>>,
}

/// How far it is: what is done, how much of it, of how much; 0 of 0 where that is not known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Told {
    stage: String,
    done: u64,
    of: u64,
}

impl Watched {
    /// The work is so far. Whether it is to go on.
    pub fn at(&self, stage: impl Into<String>, done: u64, of: u64) -> bool {
        *self.told.lock().unwrap_or_else(PoisonError::into_inner) = Told { stage: stage.into(), done, of };
        !self.watch.is_stopped()
    }

    fn told(&self) -> Told {
        let told = self.told.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if told == Told::default() { Told { stage: self.watch.stage(), ..told } } else { told }
    }
}

/// What becomes of work that is interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interrupted {
    /// It is asked to stop and left to itself: it ends at its next step, and what it found is dropped.
    IsLeft,
    /// It is asked to stop and waited for: it writes what must not be lost.
    IsWaitedFor,
}

type Ended<T> = std::thread::Result<phyture::Result<T>>;

/// Runs `run` on a thread of its own and waits for it. `progress(stage, done, of)` is called now and then, on the calling thread.
///
/// # Errors
/// `phyture.Error` for what the library refuses and for panics; `KeyboardInterrupt`, or whatever else a signal or `progress` raises.
pub fn work<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    interrupted: Interrupted,
    run: impl FnOnce(&Watched) -> phyture::Result<T> + Send + 'static,
) -> PyResult<T> {
    let watched = Watched::default();
    let (send, mut ends) = channel::<Ended<T>>();
    let own = watched.clone();
    let thread = move || {
        let ended = catch_unwind(AssertUnwindSafe(|| run(&own)));
        // Whoever waited may have been interrupted.
        let _ = send.send(ended);
    };
    std::thread::Builder::new().name("phyture".into()).spawn(thread)?;
    let mut shown = Told::default();
    loop {
        let (back, waited) = py.detach(move || waited(ends));
        ends = back;
        match waited {
            Ok(ended) => return finished(ended),
            Err(RecvTimeoutError::Disconnected) => return Err(fault("its thread is gone")),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let goes_on = py.check_signals().and_then(|()| tell(progress, &watched, &mut shown));
        if let Err(reason) = goes_on {
            watched.watch.stop();
            if interrupted == Interrupted::IsWaitedFor {
                py.detach(move || drop(ends.recv()));
            }
            return Err(reason);
        }
    }
}

/// The end of the work, if it comes soon; and what to wait for further.
fn waited<T: Send>(ends: Receiver<Ended<T>>) -> (Receiver<Ended<T>>, Result<Ended<T>, RecvTimeoutError>) {
    let found = ends.recv_timeout(BETWEEN);
    (ends, found)
}

/// Calls the callback where there is something new to say.
fn tell(progress: Option<&Bound<'_, PyAny>>, watched: &Watched, shown: &mut Told) -> PyResult<()> {
    let Some(progress) = progress else { return Ok(()) };
    let told = watched.told();
    if told != *shown {
        progress.call1((told.stage.as_str(), told.done, told.of))?;
        *shown = told;
    }
    Ok(())
}

fn finished<T>(ended: Ended<T>) -> PyResult<T> {
    match ended {
        Ok(result) => result.map_err(|error| raised(&error)),
        Err(payload) => Err(fault(said(payload.as_ref()))),
    }
}

/// What a panic said.
fn said(payload: &(dyn Any + Send)) -> &str {
    let owned = payload.downcast_ref::<String>().map(String::as_str);
    owned.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no reason given")
}

/// Panics as a fault of the library would, for the test of this border; in development builds alone.
#[cfg(debug_assertions)]
#[pyfunction]
pub fn panics(py: Python<'_>, says: String) -> PyResult<()> {
    work(py, None, Interrupted::IsLeft, move |_| panic!("{says}"))
}
