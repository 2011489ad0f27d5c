//! Words by which a right cause may be named, for lists whose authors do not know how checks put it: names of groups of columns, and what may be
//! said of them; and some more tools for changes. No list of corruptions.

use crate::change::{ATTITUDE, Chance, Log};
use phyture::flight::attitude::rotation_body_to_inertial;
use std::ops::Range;

/// Each name beside each word.
pub const fn pairs<const N: usize>(names: &[&'static str], words: &[&'static str]) -> [[&'static str; 2]; N] {
    let mut made = [[""; 2]; N];
    let mut at = 0;
    while at < N {
        made[at] = [names[at / words.len()], words[at % words.len()]];
        at += 1;
    }
    made
}

/// Those and some more.
pub const fn joined<const N: usize, const ALL: usize>(
    pairs: &'static [[&'static str; 2]; N],
    more: &[&'static [&'static str]],
) -> [&'static [&'static str]; ALL] {
    let mut made: [&[&str]; ALL] = [&[]; ALL];
    let mut at = 0;
    while at < ALL {
        made[at] = if at < N { &pairs[at] } else { more[at - N] };
        at += 1;
    }
    made
}

/// Any of these names with any of these words, or any of some more alternatives.
macro_rules! right {
    ($names:expr, $words:expr, $more:expr) => {{
        const NAMES: &[&str] = &$names;
        const WORDS: &[&str] = &$words;
        const MORE: &[&[&str]] = &$more;
        const PAIRS: [[&str; 2]; NAMES.len() * WORDS.len()] = pairs(NAMES, WORDS);
        const ALL: [&[&str]; NAMES.len() * WORDS.len() + MORE.len()] = joined(&PAIRS, MORE);
        &ALL
    }};
}

// What the groups of columns may be called. The sign after `vx` and `wx` keeps `vx_dot` and `wx_dot` away.
#[rustfmt::skip]
pub const RATE_NAMES: [&str; 19] = [
    "rates", "gyro", "angular velocit", "angular rate", "roll rate", "pitch rate", "yaw rate", "wx ", "wx`", "wx,", "wx:", "wy ", "wy`",
    "wy,", "wy:", "wz ", "wz`", "wz,", "wz:",
];
#[rustfmt::skip]
pub const VELOCITY_NAMES: [&str; 14] = [
    "velocit", "speed", "vx ", "vx`", "vx,", "vx:", "vy ", "vy`", "vy,", "vy:", "vz ", "vz`", "vz,", "vz:",
];
#[rustfmt::skip]
pub const ATTITUDE_NAMES: [&str; 19] = [
    "attitude", "euler", "angles", "roll angle", "pitch angle", "yaw angle", "heading", "roll and pitch", "roll, pitch", "pitch and yaw",
    "`roll`", "`pitch`", "`yaw`", "roll =", "pitch =", "yaw =", "roll by", "pitch by", "yaw by",
];
pub const CONTROL_NAMES: [&str; 10] = ["controls", "sticks", "inputs", "cyclic", "collective", "pedal", "u1", "u2", "u3", "u4"];
pub const LINEAR_NAMES: [&str; 7] = ["linear accel", "linear target", "accelerations", "targets", "vx_dot", "vy_dot", "vz_dot"];
pub const ANGULAR_NAMES: [&str; 7] = ["angular accel", "angular target", "accelerations", "targets", "wx_dot", "wy_dot", "wz_dot"];

// What may be said of them.
#[rustfmt::skip]
pub const SIGN: [&str; 11] = [
    "sign of", " sign ", " signs", "wrong sign", "opposite", "revers", "invert", "negat", "flip", "mirror", "upside",
];
#[rustfmt::skip]
pub const LATE: [&str; 12] = [
    " late", " lag", "lagg", "delay", "latency", "behind", "time shift", "shifted in time", "shifted by", "old values", "out of sync",
    "not synchron",
];

pub(crate) use right;

/// R_b^in of a sample.
pub fn body_to_inertial(log: &Log, sample: usize) -> [[f64; 3]; 3] {
    let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
    rotation_body_to_inertial(roll, pitch, yaw)
}

pub fn with_each_sample(log: &mut Log, change: impl Fn(&mut Log, usize)) {
    (0..log.len()).for_each(|sample| change(log, sample));
}

/// Spans of samples somewhere in the flight: one in so many seconds, but at least one, each of a length between these two.
pub fn spans(log: &Log, every_s: f64, lengths_s: Range<f64>, chance: &mut Chance) -> Vec<Range<usize>> {
    let samples = log.len();
    let count = ((samples as f64 * log.step_s / every_s) as usize).max(1);
    let mut one = || {
        let length = log.samples(lengths_s.start + (lengths_s.end - lengths_s.start) * chance.uniform()).min(samples);
        let start = chance.below(samples - length + 1);
        start..start + length
    };
    (0..count).map(|_| one()).collect()
}
