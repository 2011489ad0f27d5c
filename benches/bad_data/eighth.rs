//! Bad data of real logs of unmanned aircraft: what users of PX4, ArduPilot, Betaflight, Crazyflie, RC telemetry, motion capture and ROS
//! bags report to each other. Twenty-one common faults first, then nine rarer ones; five of each kind. Written on 2026-11-28 by someone who
//! had seen neither the checks nor the other lists, so that some repeat what those have. Reported once, on seeds
//! 85014 and 85015, and looked at since: they are for development now.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, POSITION, Part, RATES, VELOCITY};
use crate::words::*;
use phyture::flight::attitude::{cross, rotate, rotate_back, rotation_body_to_inertial};
use phyture::flight::{Column, GRAVITY_M_S2};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// The common ones first.
#[rustfmt::skip]
pub const EIGHTH: &[Corruption] = &[
    Corruption {
        id: "velocity_in_ned",
        kind: Kind::Frames,
        says: "The estimator's local velocity north, east and down stands in the columns of the body velocity.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| with_each_sample(log, |log, sample| {
            let to_inertial = body_to_inertial(log, sample);
            log.set_vector(VELOCITY, sample, rotate(&to_inertial, log.vector(VELOCITY, sample)));
        })),
        right: right!(
            VELOCITY_NAMES,
            [
                "inertial axes", "inertial frame", "inertial component", "are inertial", "is inertial", "in inertial", "world", "earth",
                " ned", "north", "navigation", "ground frame", "local frame", "not in body", "not body", "instead of body", "wrong frame",
                "wrong axes", "other axes", "not rotated", "unrotated",
            ],
            []
        ),
    },
    Corruption {
        id: "attitude_in_degrees_too",
        kind: Kind::Units,
        says: "Roll, pitch and yaw are in degrees, as in the ATT message of ArduPilot and in the logs of the Crazyflie; the rates are not.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&ATTITUDE, 1.0_f64.to_degrees())),
        right: right!(ATTITUDE_NAMES, ["deg", "57.3", "57.2", "/57", "/ 57", "180", "unit", "radian", "0.0174", "0.0175"], []),
    },
    Corruption {
        id: "collective_direction",
        kind: Kind::Sticks,
        says: "The collective servo is reversed in the set-up, and the log stores the value after the reversal.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&[Column::U4], -1.0)),
        right: right!(["u4", "collective"], SIGN, [&["-u4"], &["- u4"], &["u4 = \"-"], &["-1 * u4"], &["-1*u4"], &["-1.0*u4"]]),
    },
    Corruption {
        id: "channels_in_other_order",
        kind: Kind::Sticks,
        says: "The receiver's channels come as aileron, elevator, throttle; the export names them throttle, aileron, elevator.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| {
            // Named lateral: longitudinal; named longitudinal: collective; named collective: lateral.
            log.swap(Column::U1, Column::U2);
            log.swap(Column::U2, Column::U4);
        }),
        right: right!(
            ["u1", "u2", "u4", "controls", "sticks", "channels", "inputs", "cyclic", "collective"],
            [
                "swap", "exchang", "interchang", "permut", "mixed up", "mix-up", "confus", "channel order", "order of the",
                "out of order", "wrong order", "other order", "reorder", "cycled", "each other", "wrong column", "wrong name", "misnamed",
                "mislabel", "relabel", "renam", "assign", "mapped", "mapping", "channel map", "another control", "other control",
                "in place of",
            ],
            [
                &["u1 = \"u4"], &["u2 = \"u1"], &["u4 = \"u2"], &["u1 is u4"], &["u2 is u1"], &["u4 is u2"], &["u1 holds u2"],
                &["u2 holds u4"], &["u4 holds u1"],
            ]
        ),
    },
    Corruption {
        id: "velocity_from_gps",
        kind: Kind::Timing,
        says: "The velocity comes from the GPS receiver, 200 ms after the motion, and has the time at which its message arrived.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.late(&VELOCITY, 0.2)),
        right: right!(
            VELOCITY_NAMES,
            LATE,
            [
                &["linear accel", " earl"], &["linear accel", "ahead"], &["linear target", " earl"], &["linear target", "ahead"],
                &["vx_dot", " earl"], &["vx_dot", "ahead"], &["vy_dot", " earl"], &["vy_dot", "ahead"], &["vz_dot", " earl"],
                &["vz_dot", "ahead"],
            ]
        ),
    },
    Corruption {
        id: "attitude_stream_of_10_hz",
        kind: Kind::Timing,
        says: "The attitude message is streamed at 10 Hz over the telemetry link; the export repeats each until the next one.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.held(&ATTITUDE, 0.1)),
        right: right!(
            ATTITUDE_NAMES,
            [
                " held", " hold ", " holds", "stale", "slow", "10 hz", "10.0 hz", "repeat", "stair", "steps of", "in steps", "0.1 s",
                "100 ms", "10 samples", "10 rows", "sampled", "sample rate", "sampling rate", "update", "refresh", "zero-order",
                "zero order", "same value", "low rate", "lower rate", "resampl", "upsampl", "interpol", "each tenth", "every tenth",
            ],
            []
        ),
    },
    Corruption {
        id: "card_too_slow",
        kind: Kind::Cells,
        says: "The SD card blocks for 0.3 to 0.7 s now and then, the logger drops what comes meanwhile, and the rows close up.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, chance| {
            let lost = spans(log, 10.0, 0.3..0.7, chance);
            let kept: Vec<usize> = (0..log.len()).filter(|sample| !lost.iter().any(|span| span.contains(sample))).collect();
            log.rows(&kept);
        }),
        right: right!(
            ["row", "sample", "all columns", "every column", "several columns", "columns together", "at once", "time", "log"],
            [
                "missing", "lost", " loss", "dropped", "dropout", "drop-out", "drop out", "skip", "cut out", "splice", "joined", "hole",
                "interrupt", "removed", "left off", "not consecutive", "not contiguous",
            ],
            [
                &["gap"], &["dropout"], &["jump", "all columns"], &["jump", "every column"], &["jump", "several columns"],
                &["jump", "at once"], &["jump", "together"], &["jump", "in time"], &["time jump"], &["discontinu", "rows"],
                &["discontinu", "at once"], &["discontinu", "all columns"], &["discontinu", "in time"],
            ]
        ),
    },
    Corruption {
        id: "controls_freeze",
        kind: Kind::Cells,
        says: "The downlink that carries the servo commands drops out for 0.5 to 2 s, and the ground logger repeats the last ones.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, chance| {
            for span in spans(log, 12.0, 0.5..2.0, chance) {
                let last = CONTROLS.map(|control| log.of_column(control)[span.start]);
                for (control, value) in CONTROLS.into_iter().zip(last) {
                    log.of_column(control)[span.clone()].fill(value);
                }
            }
        }),
        right: right!(
            CONTROL_NAMES,
            [
                "frozen", "freez", "froze", "stuck", " held", " hold ", " holds", "constant", "repeat", "stale", "same value",
                "not change", "not move", "unchanged", "flat", "dropout", "drop-out", "lost", "stand still", "stands still", "stop",
                "gap", "missing",
            ],
            []
        ),
    },
    Corruption {
        id: "markers_hidden",
        kind: Kind::Cells,
        says: "The motion capture loses sight of the markers for 0.1 to 0.4 s and writes zeros for position and attitude.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, chance| {
            for span in spans(log, 8.0, 0.1..0.4, chance) {
                for column in [POSITION, ATTITUDE].concat() {
                    log.of_column(column)[span.clone()].fill(0.0);
                }
            }
        }),
        right: right!(
            ["position", "pose", "attitude", "roll", "pitch", "yaw", "`x`", "`y`", "`z`", " x ", " y ", " z ", "cells"],
            [
                "zeros", "to zero", "exactly 0", "exactly zero", "of zero", "are zero", "is zero", "value 0", "is 0 ", "are 0 ", "at 0 ",
                "0 in ", "missing", "dropout", "drop-out", "lost", "occlu", "outlier", "glitch", "spike", "filled", "placeholder",
                "no value", "invalid",
            ],
            [&["zeros"], &["= 0 stands for"], &["jump", "position"], &["jump", "attitude"]]
        ),
    },
    Corruption {
        id: "rotor_shakes_the_imu",
        kind: Kind::Noise,
        says: "The autopilot is mounted hard: the main rotor's 23 Hz is on the gyros and on the accelerations.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, chance| {
            let sizes = [(Column::Wx, 0.25), (Column::Wy, 0.35), (Column::Wz, 0.1)].into_iter();
            let of_linear = LINEAR.map(|column| (column, 3.0)).into_iter();
            for (column, size) in sizes.chain(of_linear).chain(ANGULAR.map(|column| (column, 8.0))) {
                let (phase, step_s) = (TAU * chance.uniform(), log.step_s);
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    let time_s = step_s * sample as f64;
                    // The governor lets the speed of the rotor wander by some per cent.
                    *value += size * (TAU * 23.3 * time_s + 3.0 * (0.4 * time_s).sin() + phase).sin();
                }
            }
        }),
        right: right!(
            ["rates", "gyro", "wx", "wy", "wz", "angular", "accel", "targets", "vx_dot", "vy_dot", "vz_dot", "imu"],
            [
                "vibrat", "noise", "noisy", "oscillat", "periodic", "harmonic", "rotor speed", "rotor freq", "revolution", "per rev",
                "tone", "23 hz", "23.3 hz", "near 23", "spectr", "resonan", "sinus", "high frequenc", "high-frequenc", "shak",
            ],
            [&["vibrat"]]
        ),
    },
    Corruption {
        id: "velocity_by_differences",
        kind: Kind::Noise,
        says: "The velocity is the plain difference of a motion capture's positions, which are good to 2 mm.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, chance| {
            let per_s = 0.002 / log.step_s;
            for column in VELOCITY {
                let mut before = chance.normal();
                for value in log.of_column(column) {
                    let now = chance.normal();
                    *value += per_s * (now - before);
                    before = now;
                }
            }
        }),
        right: right!(
            VELOCITY_NAMES,
            [
                "noise", "noisy", "finite differenc", "differenced", "numerical", "rough", "jitter", "scatter", "unfiltered",
                "not filtered", "not smooth", "random", "high frequenc", "high-frequenc",
            ],
            []
        ),
    },
    Corruption {
        id: "angular_accelerations_smoothed",
        kind: Kind::Noise,
        says: "The angular accelerations come from gyros behind a causal low-pass filter of 2 Hz, set against vibration.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.lag(&ANGULAR, 0.08)),
        right: right!(
            ANGULAR_NAMES,
            [
                "filter", "smooth", "low-pass", "low pass", "lowpass", "bandwidth", "slow", "damped", "attenuat", "averag", " late",
                " lag", "lagg", "delay", "latency", "behind", "time shift", "shifted in time", "shifted by", "out of sync",
                "not synchron",
            ],
            [
                &["rates", " earl"], &["rates", "ahead"], &["controls", " earl"], &["controls", "ahead"], &["u1", " earl"], &["u1", "ahead"],
                &["u2", " earl"], &["u2", "ahead"], &["u3", " earl"], &["u3", "ahead"], &["wx ", " earl"], &["wy ", " earl"],
                &["wz ", " earl"], &["wx ", "ahead"], &["wy ", "ahead"], &["wz ", "ahead"],
            ]
        ),
    },
    Corruption {
        id: "moved_while_starting",
        kind: Kind::Noise,
        says: "The aircraft was moved while the gyros found their zero, so that the rates have a bias of some degrees per second.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, chance| {
            for column in RATES {
                let sign = if chance.uniform() < 0.5 { -1.0 } else { 1.0 };
                let bias = sign * (0.06 + 0.08 * chance.uniform());
                log.each(&[column], |value| value + bias);
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "bias", "offset", "drift", "zero point", "zero error", "zero-rate", "zero rate", "not zero", "average", "mean of", "constant",
                "shifted by",
            ],
            []
        ),
    },
    Corruption {
        id: "speed_in_knots",
        kind: Kind::Units,
        says: "The speeds are in knots, as in GPS sentences and in RC telemetry.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&VELOCITY, 3600.0 / 1852.0)),
        right: right!(
            VELOCITY_NAMES,
            [
                "knot", " kt", " kn ", "unit", "0.51", "1.94", "scale", "factor", "too large", "too big", "too high", "times too",
                "times the", "times as",
            ],
            []
        ),
    },
    Corruption {
        id: "accelerations_over_g",
        kind: Kind::Units,
        says: "The linear accelerations are in multiples of standard gravity, as in the logs of the Crazyflie and of most loggers.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&LINEAR, 1.0 / GRAVITY_M_S2)),
        right: right!(
            LINEAR_NAMES,
            [
                "9.8", "0.102", "0.101", "0.10 ", "0.1 ", "unit", " in g ", " in g,", " in g:", " in g;", " in g.", "in g's", "g units",
                "multiples of g", "standard gravity", "scale", "factor", "too small", "too low", "times too", "times the", "times as",
            ],
            []
        ),
    },
    Corruption {
        id: "servo_pulses",
        kind: Kind::Units,
        says: "The controls are pulse widths of the servo outputs in microseconds about 1500.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.each(&CONTROLS, |value| 1500.0 + 400.0 * value)),
        right: right!(
            CONTROL_NAMES,
            [
                "pwm", "microsecond", "µs", " us ", "1500", "1000", "1100", "1900", "pulse", "unit", "range", "normali", "scale", "servo",
                "beyond", "outside", "too large", "larger than", "greater than", "above 1", "exceed", "[-1, 1]",
            ],
            []
        ),
    },
    Corruption {
        id: "every_second_row",
        kind: Kind::Timing,
        says: "The logger writes at 50 Hz, and who exports the log believes that it is 100 Hz.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.rows(&(0..log.len()).step_by(2).collect::<Vec<_>>())),
        right: right!(
            [
                "sampling rate", "sample rate", "sampling step", "sampling interval", "sampling period", "sample period", "sampling time",
                "sampling frequency", "sample frequency", "logging rate", "time step", "time steps", "step of time", "step_s", "rate_hz",
                "time column", "column of time", "time axis", "time base", "time scale", "clock", "timestamps", "time stamps", "times of",
                "`t`", "t = ", "log rate",
            ],
            [
                "factor", "twice", "half", "double", "0.5", "2.0", "2.00", "2 times", "two times", "too fast", "too slow", "too short",
                "too long", "too small", "too high", "too low", "wrong", "not the one", "50 hz", "50.0 hz", "unit", "0.02", "20 ms",
                "stretch", "compress", "faster", "slower", "scaled", "do not fit", "does not fit",
            ],
            [&["50 hz"], &["all derivatives", "twice"], &["all derivatives", "factor"]]
        ),
    },
    Corruption {
        id: "dual_rate",
        kind: Kind::Sticks,
        says: "Some flights are flown with the dual-rate switch low: the cyclic servos get 60 % of the sticks that are logged.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, _| log.scale(&[Column::U1, Column::U2], 1.0 / 0.6)),
        right: right!(
            ["u1", "u2", "cyclic", "controls", "sticks", "inputs"],
            [
                "scale", "gain", "factor", "dual rate", "dual-rate", "travel", "times too", "times the", "times as", "unit", "sensitiv",
                "effectiveness", "less effect", "smaller effect", "authority", "1.67", "1.66", "0.60", "0.6*", "0.6 *", "weaker",
                "stronger", "too large", "differs from", "differ from", "different from", "amplitude",
            ],
            []
        ),
    },
    Corruption {
        id: "elevator_trim",
        kind: Kind::Sticks,
        says: "The elevator trim was clicked between flights: the servo gets the trim, and the logged stick is without it.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, _| log.each(&[Column::U2], |value| value - 0.12)),
        right: right!(
            ["u2", "longitudinal cyclic", "pitch stick", "elevator", "cyclic", "controls", "sticks"],
            [
                "offset", "bias", "trim", "zero point", "zero error", "neutral", "centred", "centered", "shifted", "constant shift",
                "constant error", "displac", "mean of", "average", "differs from", "differ from", "different from",
            ],
            [&["u2 + 0.1"], &["u2 - -0.1"]]
        ),
    },
    Corruption {
        id: "horizon_not_level",
        kind: Kind::Frames,
        says: "The level horizon was calibrated on a sloping bench: pitch reads 5° and roll -4° when the aircraft is level.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| {
            log.each(&[Column::Pitch], |value| value + 0.09);
            log.each(&[Column::Roll], |value| value - 0.07);
        }),
        right: right!(
            [
                "attitude", "euler", "angles", "roll angle", "pitch angle", "roll and pitch", "pitch and roll", "roll, pitch", "`roll`",
                "`pitch`", "roll =", "pitch =", "roll by", "pitch by", "roll is", "pitch is", "roll has", "pitch has", "horizon",
            ],
            [
                "offset", "bias", "trim", "not level", "misalign", "mount", "tilt", "shifted", "zero point", "zero error", "constant",
                "inclin", "sloping",
            ],
            [&["mount", "misalign"], &["roll - -0.0"], &["roll + 0.0"], &["pitch - 0.0"], &["roll - -0.1"], &["pitch - 0.1"], &["pitch + -0.0"]]
        ),
    },
    Corruption {
        id: "imu_topic_in_flu",
        kind: Kind::Frames,
        says: "Gyros and angular accelerations come from a ROS topic in axes nose-port-up; everything else is nose-starboard-down.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&[Column::Wy, Column::Wz, Column::WyDot, Column::WzDot], -1.0)),
        right: right!(
            ["rates", "gyro", "angular", "pitch rate", "yaw rate", "wy", "wz", "imu"],
            [
                "sign of", " sign ", " signs", "wrong sign", "opposite", "revers", "invert", "negat", "flip", "mirror", "upside", "flu ", "/flu",
                "flu,", "flu\"", "flu)", "flu:", "nose-port-up", "forward-left-up", "port and up", "other axes", "wrong axes",
                "different axes", "other frame", "wrong frame", "180",
            ],
            [&["-wy"], &["-wz"], &["- wy"], &["- wz"]]
        ),
    },
    // Rarer ones.
    Corruption {
        id: "three_servo_outputs",
        kind: Kind::Sticks,
        says: "The log has the outputs of the three swashplate servos (CCPM, 120°) where lateral, longitudinal and collective should be.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| with_each_sample(log, |log, sample| {
            let [sideways, ahead, up] = log.vector([Column::U1, Column::U2, Column::U4], sample);
            let (left, right) = (up + 0.5 * ahead + 0.866 * sideways, up + 0.5 * ahead - 0.866 * sideways);
            log.set_vector([Column::U1, Column::U2, Column::U4], sample, [left, right, up - ahead]);
        })),
        right: right!(
            ["u1", "u2", "u4", "controls", "sticks", "inputs", "cyclic", "collective", "channels"],
            [
                "servo", "swash", "ccpm", "mixer", "mixed with", "mixed into", "are mixed", "is mixed", "mixing", "mixture", "demix",
                "unmix", "combination", "combine", "sum of", "sums of", "matrix", "depend on each other", "rotated into",
            ],
            [&["swash"], &["ccpm"]]
        ),
    },
    Corruption {
        id: "gyro_range_halved",
        kind: Kind::Units,
        says: "The gyro's range is set to twice what the driver believes: rates and angular accelerations are half of what they were.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&[RATES, ANGULAR].concat(), 0.5)),
        right: right!(
            RATE_NAMES,
            [
                "scale", "gain", "factor", "half", "halv", "double", "twice", "unit", "sensitiv", "full scale", "full-scale", "0.5",
                "2.0 ", "2 times", "too small", "too low", "times too", "times the", "times as",
            ],
            [&["0.5*wx"], &["2*wx"], &["2*wy"], &["2*wz"], &["wx/0.5"], &["wx*2"]]
        ),
    },
    Corruption {
        id: "resonator_for_a_clock",
        kind: Kind::Timing,
        says: "The controls come from a second logger whose clock is off by 0.4 %, so that they are later the longer the flight lasts.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.take(&CONTROLS, |sample| sample - (0.004 * sample as f64) as usize)),
        right: right!(
            CONTROL_NAMES,
            [
                "drift", "clock", "stretch", "more and more", "time scale", "time base", "changing delay", "varying delay",
                "delay changes", "sampling rate", "sample rate", "slower", " late", " lag", "lagg", "delay", "latency", "behind",
                "time shift", "shifted in time", "shifted by", "out of sync", "not synchron",
            ],
            [
                &["targets", " earl"], &["targets", "ahead"], &["accelerations", " earl"], &["accelerations", "ahead"], &["rates", " earl"],
                &["rates", "ahead"],
            ]
        ),
    },
    Corruption {
        id: "clocks_synchronized_again",
        kind: Kind::Timing,
        says: "The companion computer sets its clock anew in flight: from then on, position, attitude and velocity are 200 ms late.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, chance| {
            let from = (log.len() as f64 * (0.3 + 0.3 * chance.uniform())) as usize;
            let delay = log.samples(0.2);
            let late = |sample: usize| if sample < from { sample } else { sample.saturating_sub(delay) };
            log.take(&[POSITION, ATTITUDE, VELOCITY].concat(), late);
        }),
        right: right!(
            [
                "position", "pose", "attitude", "velocit", "roll", "pitch", "yaw", "states", "vx ", "vx`", "vx,", "vy ", "vy`", "vz ",
                "vz`", "`x`", "`y`", "`z`",
            ],
            [
                " late", " lag", "lagg", "delay", "latency", "behind", "time shift", "shifted in time", "shifted by", "out of sync",
                "not synchron", "clock", "jump in time", "time jump", "repeat", "synchron",
            ],
            [
                &["controls", " earl"], &["controls", "ahead"], &["targets", " earl"], &["targets", "ahead"], &["accelerations", " earl"],
                &["accelerations", "ahead"], &["rates", " earl"], &["rates", "ahead"], &["wx ", " earl"], &["wy ", " earl"], &["wz ", " earl"],
            ]
        ),
    },
    Corruption {
        id: "bad_frames_of_the_gyro",
        kind: Kind::Cells,
        says: "A bad frame of the gyro's queue reads -32768 on all three axes, which is -2000°/s, in single samples.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, chance| {
            for span in spans(log, 5.0, 0.0..0.0, chance) {
                log.set_vector(RATES, span.start.min(log.len() - 1), [-2000.0_f64.to_radians(); 3]);
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "spike", "outlier", "glitch", "implausib", "impossib", "unphysical", "full scale", "full-scale", "satur", "34.9", "2000",
                "jump", "clip", "single", "isolated", "bad cell", "bad sample", "bad value", "bad frame", "wild", "extreme", "lone",
                "invalid",
            ],
            []
        ),
    },
    Corruption {
        id: "markers_look_alike",
        kind: Kind::Cells,
        says: "The pattern of the markers is nearly symmetric: for 0.3 to 1 s at a time the motion capture sees the body turned by 180°.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, chance| {
            for span in spans(log, 12.0, 0.3..1.0, chance) {
                for sample in span {
                    let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                    log.set_vector(ATTITUDE, sample, [-roll, -pitch, yaw - PI.copysign(yaw)]);
                }
            }
        }),
        right: right!(
            ["attitude", "euler", "heading", "yaw", "roll", "pitch", "quaternion"],
            [
                "flips", "jump", "180", "half turn", "half a turn", "discontinu", "spike", "outlier", "glitch", "turned", "symmetr",
                "marker", "3.14", "not continuous", "leap",
            ],
            []
        ),
    },
    Corruption {
        id: "speed_in_whole_metres",
        kind: Kind::Noise,
        says: "The telemetry protocol carries the speeds as whole metres per second.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.round(&VELOCITY, 1.0)),
        right: right!(
            VELOCITY_NAMES,
            [
                "round", "quanti", "resolution", "steps of", "in steps", "coarse", "integer", "whole", "discret", "stair", "multiples of",
                "granular", "few values", "few different", "distinct values", "decimal", "digit", "truncat",
            ],
            []
        ),
    },
    Corruption {
        id: "logger_mounted_diagonally",
        kind: Kind::Frames,
        says: "The logger with the gyros is mounted diagonally, turned by 45° about the vertical axis, and nobody turned its axes back.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| {
            let turned = rotation_body_to_inertial(0.0, 0.0, FRAC_PI_4);
            with_each_sample(log, |log, sample| {
                for columns in [RATES, ANGULAR] {
                    log.set_vector(columns, sample, rotate_back(&turned, log.vector(columns, sample)));
                }
            });
        }),
        right: right!(
            ["rates", "gyro", "angular", "wx", "wy", "imu", "logger"],
            [
                "rotated", "is turned", "are turned", "turned by", "mount", "misalign", "not aligned", "45°", "44°", "46°", "45 deg",
                "45.0", "0.785", "0.707", "0.71*", "0.71 *", "0.7*", "0.7 *", "skew", "yawed", "other axes", "wrong axes",
                "different axes", "other frame", "wrong frame", "mixed", "mixture", "combination",
            ],
            []
        ),
    },
    Corruption {
        id: "accelerometer_on_the_tail_boom",
        kind: Kind::Frames,
        says: "The accelerometer sits 0.7 m behind the centre of gravity, and the linear accelerations are those of its place.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| {
            let arm = [-0.7, 0.0, -0.1];
            with_each_sample(log, |log, sample| {
                let (rates, angular) = (log.vector(RATES, sample), log.vector(ANGULAR, sample));
                let (tangential, centripetal) = (cross(angular, arm), cross(rates, cross(rates, arm)));
                let linear = log.vector(LINEAR, sample);
                log.set_vector(LINEAR, sample, std::array::from_fn(|axis| linear[axis] + tangential[axis] + centripetal[axis]));
            });
        }),
        right: right!(
            ["linear accel", "linear target", "accelerometer", "vx_dot", "vy_dot", "vz_dot", "imu", "sensor"],
            [
                "centre of gravity", "center of gravity", "centre of mass", "center of mass", " cg", " c.g.", "off-centre", "off-center",
                "off centre", "off center", "lever", "moment arm", "sits behind", "m behind", "mounted away", "away from the cent",
                "0.7 m", "tangential", "centripetal",
            ],
            [
                &["lever arm"], &["lever-arm"], &["sensor position"], &["accelerometer position"], &["imu position"],
                &["place of the accelerometer"], &["vy_dot", "0.7*wz_dot"], &["vz_dot", "0.7*wy_dot"], &["vy_dot", "0.7 * wz_dot"],
                &["vz_dot", "0.7 * wy_dot"],
            ]
        ),
    },
];
