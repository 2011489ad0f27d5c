//! How results reach people and programs: text on standard output, JSON where asked, progress on standard error.

use crate::style;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use phyture::critique::wrap::wrapped;
use phyture::disk::write_atomically;
use phyture::workflow::document;
use phyture::{Error, Result};
use serde::{Deserialize, Serialize};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Writes the machine-readable result, to standard output for `-`.
pub fn json(target: Option<&Path>, content: &impl Serialize) -> Result<()> {
    let Some(path) = target else { return Ok(()) };
    let text = document(content).map_err(|error| Error::File { path: path.into(), message: error.to_string() })?;
    if path == Path::new("-") {
        return std::io::stdout().write_all(text.as_bytes()).map_err(Error::io(path));
    }
    write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// The machine-readable form of a failure.
#[derive(Serialize, Deserialize)]
struct Failure {
    error: Reason,
    exit_code: u8,
}

#[derive(Serialize, Deserialize)]
struct Reason {
    kind: String,
    message: String,
}

/// Writes the machine-readable form of a failure where a result was asked for. The file of an earlier result stays unless forced.
pub fn failure(target: Option<&Path>, force: bool, kind: &str, message: String, code: u8) {
    let stays = !force && target.is_some_and(|path| path != Path::new("-") && path.is_file() && !is_failure(path));
    if !stays {
        // What is wrong has been said on standard error, and a second failure would only hide it.
        let _ = json(target, &Failure { error: Reason { kind: kind.into(), message }, exit_code: code });
    }
}

/// Longest failure that is looked for, bytes.
const LONGEST_FAILURE: u64 = 1 << 20;

/// Whether a plain file holds a failure, which holds nothing that anybody would miss: the same command, put right, may write over it.
pub fn is_failure(path: &Path) -> bool {
    let is_short = std::fs::metadata(path).is_ok_and(|there| there.is_file() && there.len() <= LONGEST_FAILURE);
    is_short && std::fs::read(path).is_ok_and(|text| serde_json::from_slice::<Failure>(&text).is_ok())
}

/// Text for a person: on standard output, unless that carries the JSON; then on standard error.
pub fn say(json: Option<&Path>, text: impl std::fmt::Display) {
    let text = printable(&text.to_string());
    if json == Some(Path::new("-")) {
        eprintln!("{}", style::for_error(&text));
    } else {
        // A closed pipe (`phyture … | head`) is no error of the work.
        let _ = writeln!(std::io::stdout(), "{}", style::for_output(&text));
    }
}

/// A warning: on standard error, whatever becomes of the rest.
pub fn warn(text: &str) {
    eprintln!("{}", style::for_error(&printable(&wrapped("warning: ", text))));
}

/// Whether progress is shown; `--quiet` turns it off for the whole run.
static QUIET: AtomicBool = AtomicBool::new(false);

/// No progress from here on.
pub fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether it is so.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// An error for a person, on standard error.
pub fn complain(text: impl std::fmt::Display) {
    eprintln!("{}", style::for_error(&printable(&text.to_string())));
}

/// Names of files, flights and columns come from outside: whatever in them would command the terminal (control characters but for newline
/// and tab, and those that turn the direction of writing) is shown as an escape.
pub fn printable(text: &str) -> String {
    let commands = |c: char| {
        (c.is_control() && c != '\n' && c != '\t')
            || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().map(|c| if commands(c) { format!("\\u{{{:x}}}", u32::from(c)) } else { c.to_string() }).collect()
}

/// Progress of long work: a bar with time left on a terminal, a plain line now and then otherwise.
pub struct Progress {
    bar: ProgressBar,
    plain: bool,
    quiet: bool,
    begun: Instant,
    told: Instant,
    /// When and where the first report came: what was done before, in an earlier run perhaps, tells nothing of the pace.
    first: Option<(Instant, u64)>,
    what: String,
}

/// How often a plain line is written when there is no terminal.
pub const PLAIN_INTERVAL: Duration = Duration::from_secs(10);

impl Progress {
    /// A bar of `steps` steps, `done` of which are behind already.
    pub fn new(what: &str, steps: u64, done: u64) -> Self {
        let quiet = is_quiet();
        let plain = quiet || !std::io::stderr().is_terminal();
        let bar = ProgressBar::with_draw_target(
            Some(steps),
            if plain { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() },
        );
        if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len}  {msg}  {elapsed} gone, {eta} left") {
            bar.set_style(style);
        }
        bar.set_prefix(what.to_owned());
        bar.set_position(done);
        bar.reset_eta();
        let now = Instant::now();
        Self { bar, plain, quiet, begun: now, told: now, first: None, what: what.to_owned() }
    }

    /// Moves to `position` with a short message (loss, rate).
    pub fn at(&mut self, position: u64, message: impl FnOnce() -> String) {
        let news = self.first.is_none();
        let (since, from) = *self.first.get_or_insert_with(|| (Instant::now(), position));
        if !self.plain {
            self.bar.set_message(message());
            self.bar.set_position(position);
            if news {
                self.bar.reset_eta();
            }
        } else if !self.quiet && self.told.elapsed() >= PLAIN_INTERVAL {
            self.told = Instant::now();
            self.bar.set_position(position);
            let (length, gone) = (self.bar.length().unwrap_or(position), self.begun.elapsed().as_secs_f64());
            let left = seconds_left(since.elapsed().as_secs_f64(), [from, position, length]);
            let left = left.map_or(String::new(), |left| format!(", about {left:.0} s left"));
            eprintln!("{} {position}/{length}  {}  {gone:.0} s gone{left}", self.what, message());
        }
    }
}

/// Time for the rest, s, if it goes on as it went in the seconds since a first position: at a position of a length. None before anything was done.
fn seconds_left(seconds: f64, [from, position, length]: [u64; 3]) -> Option<f64> {
    let done = position.checked_sub(from).filter(|done| *done > 0)?;
    Some(seconds / done as f64 * length.saturating_sub(position) as f64)
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::{printable, seconds_left};

    #[test]
    fn what_commands_a_terminal_is_shown_and_the_rest_is_kept() {
        assert_eq!(printable("v\u{307}, m/s\u{b2}\tok\n"), "v\u{307}, m/s\u{b2}\tok\n");
        assert_eq!(printable("a\u{1b}[2J\u{9b}1m\u{202e}b\r\u{7}"), "a\\u{1b}[2J\\u{9b}1m\\u{202e}b\\u{d}\\u{7}");
    }

    #[test]
    fn the_time_left_is_that_of_the_work_done_here() {
        assert_eq!(seconds_left(10.0, [900, 950, 1000]), Some(10.0));
        assert_eq!(seconds_left(10.0, [0, 250, 1000]), Some(30.0));
        assert_eq!(seconds_left(10.0, [0, 1000, 1000]), Some(0.0));
        assert_eq!(seconds_left(10.0, [950, 950, 1000]), None);
    }
}
