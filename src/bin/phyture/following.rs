//! A search that is followed while it runs: a line that says what it is at, and Ctrl-C that stops it at its next step. Nothing of its results.

use crate::output::{PLAIN_INTERVAL, is_quiet, printable};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use phyture::critique::diagnose::Watch;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// How often the line is drawn anew.
const INTERVAL: Duration = Duration::from_millis(100);

/// The line, for whoever has something else to say meanwhile.
pub struct Line(ProgressBar);

impl Line {
    /// Says something above the line.
    pub fn aside(&self, say: impl FnOnce()) {
        self.0.suspend(say);
    }
}

/// Ends the following, also where the work panics.
struct Ended<'a>(&'a AtomicBool, thread::Thread);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        self.1.unpark();
    }
}

/// Does `work` while a line says what `watch` is at: on a terminal one that changes, else a plain one now and then. Once `interrupted` is raised,
/// the search is stopped at its next step.
pub fn followed<T>(what: &str, watch: &Watch, interrupted: &AtomicBool, work: impl FnOnce(&Line) -> T) -> T {
    let is_plain = is_quiet() || !std::io::stderr().is_terminal();
    let target = if is_plain { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{spinner} {prefix}: {wide_msg} {elapsed} gone").expect("a template of known fields");
    let bar = ProgressBar::with_draw_target(None, target).with_style(style).with_prefix(what.to_owned());
    let ended = AtomicBool::new(false);
    thread::scope(|scope| {
        let (line, ended) = (Line(bar.clone()), &ended);
        let follower = scope.spawn(move || {
            let begun = Instant::now();
            let mut told = (String::new(), begun);
            while !ended.load(Ordering::Relaxed) {
                if interrupted.load(Ordering::Relaxed) {
                    watch.stop();
                }
                let stage = if watch.is_stopped() { "stopping, when this step is done".into() } else { printable(&watch.stage()) };
                bar.set_message(stage.clone());
                bar.tick();
                if is_plain && !is_quiet() && stage != told.0 && told.1.elapsed() >= PLAIN_INTERVAL {
                    eprintln!("{what}: {stage}, {:.0} s gone", begun.elapsed().as_secs_f64());
                    told = (stage, Instant::now());
                }
                thread::park_timeout(INTERVAL);
            }
            bar.finish_and_clear();
        });
        let _ended = Ended(ended, follower.thread().clone());
        work(&line)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raised_flag_stops_the_search_and_what_it_came_to_is_handed_on() {
        let (watch, interrupted) = (Watch::default(), AtomicBool::new(false));
        assert_eq!(followed("search", &watch, &interrupted, |_| 1), 1);
        assert!(!watch.is_stopped());
        let found = followed("search", &watch, &interrupted, |line| {
            line.aside(|| interrupted.store(true, Ordering::Relaxed));
            while watch.at("searching").is_ok() {
                thread::sleep(Duration::from_millis(1));
            }
            2
        });
        assert_eq!((found, watch.stage().as_str()), (2, "searching"));
    }

    #[test]
    fn a_panic_of_the_work_ends_the_following() {
        let (watch, interrupted) = (Watch::default(), AtomicBool::new(false));
        let outcome = std::panic::catch_unwind(|| followed("search", &watch, &interrupted, |_| panic!("as it may")));
        assert!(outcome.is_err());
    }
}
