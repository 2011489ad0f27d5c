//! Tenth list: faults of real logs as they show in bug reports of autopilots, telemetry links, motion capture and export scripts, the common
//! ones first in mind and some rarer ones among them. Some can be mended (a unit, a sign, an order, a delay), some only be left out or warned
//! of. Written on 2026-11-28 by someone who had seen neither the checks nor the other lists. Reported on seeds
//! 85506 to 85515, and looked at since: for development now.

use crate::change::Change::Columns;
use crate::change::Kind::{Cells, Frames, Noise, Sticks, Timing, Units};
use crate::change::Part::{All, Half, One};
use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Chance, Corruption, LINEAR, Log, POSITION, RATES, VELOCITY};
use crate::words::{
    ANGULAR_NAMES, ATTITUDE_NAMES, CONTROL_NAMES, LINEAR_NAMES, RATE_NAMES, VELOCITY_NAMES, body_to_inertial, joined, pairs, right,
    spans, with_each_sample,
};
use phyture::flight::Column;
use phyture::flight::attitude::rotate;
use std::f64::consts::{PI, TAU};

// Lists of words are not one word a line.
#[rustfmt::skip]
pub const TENTH: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "elevator_channel_reversed_in_the_transmitter_between_two_flying_days",
        kind: Sticks,
        says: "The servo of the longitudinal cyclic was turned round and its channel reversed in the transmitter, whose output is what is logged: \
               u2 has the opposite sign from then on.",
        parts: [Half, One],
        change: Columns(|log, _| log.scale(&[Column::U2], -1.0)),
        right: right!(
            ["u2", "longitudinal", "elevator", "pitch stick", "pitch cyclic", "fore-aft", "fore and aft"],
            [
                "sign of", " sign ", " signs", " sign,", " sign:", " sign.", "wrong sign", "opposite", "revers", "invert", "negat",
                "flip", "mirror", "-u2", "- u2", "-`u2`", "by -1", "* -1", "× -1", "times -1", "= -1", "minus",
            ],
            [&["-u2"], &["- u2"], &["-`u2`"], &["u2 = -"], &["u2: -"]]
        ),
    },
    Corruption {
        id: "taer_channel_map_written_straight_into_u1_to_u4",
        kind: Sticks,
        says: "The receiver sends throttle, aileron, elevator, rudder and the script took them in this order for u1 to u4: collective, both \
               cyclics and pedal stand one column further on.",
        parts: [All, Half],
        change: Columns(|log, _| {
            log.swap(Column::U3, Column::U4);
            log.swap(Column::U2, Column::U3);
            log.swap(Column::U1, Column::U2);
        }),
        right: right!(
            ["controls", "sticks", "inputs", "channel", "cyclic", "collective", "pedal", "u1", "u2", "u3", "u4"],
            [
                "swap", "swop", "exchang", "interchang", "permut", "mixed up", "reorder", "rearrang", "shuffl", "wrong order",
                "order of the", "order of c", "column order", "channel order", "another order", "other order", "different order",
                "channel map", "mislabel", "wrong column", "wrong channel", "other column", "each other's", "one column", "taer", "aetr",
                "stands in", "belongs in", "belong in", "in place of",
            ],
            [
                &["u1 = u2"], &["u1=u2"], &["u2 = u3"], &["u2=u3"], &["u3 = u4"], &["u3=u4"], &["u4 = u1"], &["u4=u1"], &["u1: u2"],
                &["u2: u3"], &["u3: u4"], &["u4: u1"], &["`u1` = `u2`"], &["`u4` = `u1`"], &["u1 is u4"], &["u1 is the collective"],
                &["u1 holds"], &["collective is in u1"], &["collective in u1"],
            ]
        ),
    },
    Corruption {
        id: "throttle_of_old_firmware_runs_from_zero_to_one",
        kind: Sticks,
        says: "Until an update the firmware logged the throttle stick from 0 to 1, since then from -1 to 1: the collective of the older flights \
               has half the range and an offset of a half.",
        parts: [Half, One],
        change: Columns(|log, _| log.each(&[Column::U4], |value| 0.5 * (value + 1.0))),
        right: right!(
            ["u4", "collective", "throttle"],
            [
                "scale", "scaling", "factor", " range", "offset", " unit", "0 to 1", "0..1", "0 - 1", "[0, 1]", "between 0 and 1",
                "halved", "half its", "half range", "half the range", "half as", "by half", "by 0.5", "of 0.5", "0.50", "twice",
                "double", "zero to one", "normalis", "normaliz", "never negative", "only positive", "not negative", " gain", "too small",
                "2 u4", "2 * u4", "2u4", "2.0 u4", "2.0 * u4", "- 1", "mapping", "mapped", "linear map", "affine",
            ],
            [&["2 * u4"], &["2 u4"], &["u4 = 2"], &["2u4"]]
        ),
    },
    Corruption {
        id: "receiver_in_hold_failsafe_repeats_the_last_frame_for_a_second",
        kind: Sticks,
        says: "The radio link dropped out for a second or two at a time and the receiver went on sending its last frame: all four controls \
               stand still there while the aircraft flew on what the second receiver got.",
        parts: [One, Half],
        change: Columns(|log, chance| {
            for span in spans(log, 6.0, 1.0..2.4, chance) {
                hold(log, &CONTROLS, span.start, span.end);
            }
        }),
        right: right!(
            ["controls", "sticks", "inputs", "cyclic", "collective", "pedal", "u1", "u2", "u3", "u4", "channels"],
            [
                "frozen", "froze", "freez", "stuck", " held", " hold ", " holds ", "hold-last", "sample-and-hold", "constant for",
                "constant over", "constant in", "stay constant", "stays constant", "are constant", "is constant", "kept constant",
                "remain constant", "constant value", "constant stretch", "not change", "unchanged", "not changing", "not move",
                "no change", "repeat", "same value", "same for", " flat", "stale", "dropout", "drop-out", "drop out", "last value",
                "failsafe", "stand still", "stands still", "standstill", "link lo", "signal lo",
            ],
            []
        ),
    },
    Corruption {
        id: "swashplate_servo_outputs_logged_in_place_of_cyclic_and_collective",
        kind: Sticks,
        says: "The log took the outputs to the three servos of a 120 degree swashplate for u1, u2 and u4: each of them is a mix of collective, \
               longitudinal and lateral cyclic.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let [roll, pitch, heave] = log.vector([Column::U1, Column::U2, Column::U4], sample);
                let side = 0.75_f64.sqrt() * roll;
                let servos = [heave - 0.5 * pitch + side, heave + pitch, heave - 0.5 * pitch - side];
                log.set_vector([Column::U1, Column::U2, Column::U4], sample, servos);
            });
        }),
        right: right!(
            ["controls", "sticks", "inputs", "swash", "cyclic", "collective", "u1", "u2", "u4"],
            [
                "mixing", "mixer", "mixed in", "mixture", "mixes", "unmix", "de-mix", "demix", "mix of", "are mixed", "is mixed",
                "a mix", "mixed with", "ccpm", "120 deg", "120°", "120-degree", "servo", "combination", "combine", "superpos", "sum of",
                "sums of", "linear map", "matrix", "actuator", "motor output", "blend",
            ],
            [&["swashplate"]]
        ),
    },
    // Units.
    Corruption {
        id: "velocity_of_the_navigation_unit_taken_over_in_knots",
        kind: Units,
        says: "The navigation unit gives velocities in knots, as in aviation, and nobody converted them: vx, vy and vz are 1.94 times too large.",
        parts: [All, Half],
        change: Columns(|log, _| log.scale(&VELOCITY, 3600.0 / 1852.0)),
        right: right!(
            VELOCITY_NAMES,
            [
                "knot", "1.94", "0.514", "0.515", " unit", "scale", "scaling", "factor", "times too", "too large", "too big", "too high",
                " gain", "multipl", "convert", " ratio", " kn ", " kt", "kn)",
            ],
            []
        ),
    },
    Corruption {
        id: "yaw_taken_from_the_hud_message_in_degrees",
        kind: Units,
        says: "Roll and pitch come from the attitude message in radians, the yaw from the heads-up-display message, which has it in degrees.",
        parts: [All, Half],
        change: Columns(|log, _| log.each(&[Column::Yaw], f64::to_degrees)),
        right: right!(
            ["yaw", "heading", "azimuth"],
            [
                "in degrees",
                "degrees instead",
                "degrees not",
                "degrees, not",
                "degrees rather",
                "are degrees",
                "is degrees",
                "as degrees",
                "like degrees",
                "deg2rad",
                "to radians",
                "into radians",
                "not radians",
                "not in radians",
                "in deg",
                "from degrees",
                "of degrees",
                "(degrees",
                "deg to rad",
                "deg ->",
                "= deg",
                "= \"deg",
                " unit",
                "57.3",
                "57.2",
                "0.01745",
                "0.0174",
                "scale",
                "scaling",
                "factor",
                "convert",
                "pi/180",
                "pi / 180",
                "180/pi",
                "180 / pi",
            ],
            [&["angles", "in degrees"], &["attitude", "in degrees"], &["attitude", "degrees"], &["angles", " deg"]]
        ),
    },
    Corruption {
        id: "body_accelerations_left_in_multiples_of_g",
        kind: Units,
        says: "The blackbox gives accelerations in multiples of 9.81 m/s2 and the export passed them on: vx_dot, vy_dot and vz_dot are 9.81 \
               times too small.",
        parts: [All, Half],
        change: Columns(|log, _| log.scale(&LINEAR, 1.0 / 9.80665)),
        right: right!(
            LINEAR_NAMES,
            [
                " in g ",
                " in g,",
                " in g;",
                " in g.",
                " in g)",
                " in g:",
                "in units of g",
                "units of g",
                "g units",
                "g instead",
                "multiples of g",
                "by 9.8",
                "* 9.8",
                "× 9.8",
                "times 9.8",
                "factor",
                "scale",
                "scaling",
                " unit",
                "too small",
                "too low",
                "0.102",
                " gain",
                "multipl",
                "convert",
                " ratio",
                "= \"g\"",
            ],
            []
        ),
    },
    Corruption {
        id: "angular_accelerations_differentiated_with_the_step_of_a_slower_log",
        kind: Units,
        says: "The rates were differentiated with the step of 0.02 s from a script for another log: wx_dot, wy_dot and wz_dot are half of what \
               they should be.",
        parts: [All, Half],
        change: Columns(|log, _| log.scale(&ANGULAR, 0.5)),
        right: right!(
            ANGULAR_NAMES,
            [
                "scale", "scaling", "factor", " unit", "halved", "half the s", "half of w", "half as", "only half", "are half",
                "by half", "half too", "by 0.5", "of 0.5", "twice", "doubl", "by 2 ", "by 2,", "by 2)", "by 2;", "by 2.0", "* 2", "× 2",
                "2.0 *", "2 *", "times 2", "0.50", "too small", "too low", " gain", "multipl", " ratio", "convert", "wrong step",
                "wrong time step", "0.02 s", "divided by",
            ],
            []
        ),
    },
    Corruption {
        id: "gyro_counts_converted_with_the_sensitivity_of_another_chip",
        kind: Units,
        says: "The raw counts of the gyro were divided by 14.375, the sensitivity of the older chip, in place of 16.4 per degree and second: all \
               rates are 14 % too large.",
        parts: [Half, All],
        change: Columns(|log, _| log.scale(&RATES, 16.4 / 14.375)),
        right: right!(
            RATE_NAMES,
            [
                "scale", "scaling", "factor", " unit", "1.14", "0.877", "14 %", "14%", "too large", "too big", "too high", "sensitivit",
                " gain", "multipl", " ratio", "convert", "calibrat",
            ],
            []
        ),
    },
    // Timing.
    Corruption {
        id: "navigation_message_stamped_on_arrival_a_good_while_after_the_fix",
        kind: Timing,
        says: "Position and velocity come from the satellite receiver and were stamped when its message had arrived: both are 0.12 to 0.2 s late.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            let delay_s = 0.12 + 0.08 * chance.uniform();
            log.late(&POSITION, delay_s);
            log.late(&VELOCITY, delay_s);
        }),
        right: right!(
            [
                "velocit", "speed", "position", "height", "altitude", "gps", "gnss", "navigation", "vx ", "vx`", "vx,", "vx:", "vy ",
                "vz ", "`x`", "x, y", "x y z",
            ],
            [
                " late", " lag", "lagg", "delay", "latency", "behind", "time shift", "shifted in time", "shifted by", "old values",
                "out of sync", "not synchron", "earlier by", "later than", "time offset",
            ],
            []
        ),
    },
    Corruption {
        id: "transmitter_log_aligned_by_hand_starts_too_soon",
        kind: Timing,
        says: "The sticks were logged in the transmitter and joined by hand with the log of the aircraft, a bit off: u1 to u4 are a quarter of \
               a second early.",
        parts: [One, Half],
        change: Columns(|log, chance| {
            let lead_s = 0.2 + 0.12 * chance.uniform();
            log.early(&CONTROLS, lead_s);
        }),
        right: right!(
            CONTROL_NAMES,
            [
                " early", " earlier", "ahead", " lead of", " lead by", "leads the", "leads by", "lead time", "sooner", "too soon",
                "advanc", "shifted in time", "time shift", "time offset", "misalign", "not aligned", "delay", "out of sync",
                "not synchron", "shifted by",
            ],
            [
                &["response", " late"], &["response", " lag"], &["respond", " lag"], &["respond", " late"], &["answers", " late"],
                &["all others", " late"], &["rest", " late"],
            ]
        ),
    },
    Corruption {
        id: "gyro_telemetry_of_ten_hertz_filled_forward_into_the_fast_rows",
        kind: Timing,
        says: "The rates come from a telemetry stream of about 10 Hz and were joined with the fast rows by filling forward: each value stands \
               for a tenth of a second.",
        parts: [All, Half],
        change: Columns(|log, _| log.held(&RATES, 0.1)),
        right: right!(
            RATE_NAMES,
            [
                " held", " hold", "-hold", "repeat", "stair", "stepwise", "step-wise", "in steps", "zero-order", "slow stream", "slower",
                "sample rate", "sampling rate", "sampled", "update", "at 10 hz", "of 10 hz", "about 10 hz", "10 hz stream", "at 10.0 hz",
                "about 10.0 hz", "every 10", "every 0.1", "each 10", "for 0.1", "of 0.1 s", "of 0.10 s", "resampl", "ffill",
                "forward fill", "forward-fill", "filling forward", "filled forward", "filled", "same value", "constant for", "unchanged",
                "not change", "new value", "stale", "frozen", "froze", "freez", "stuck", "slow rate", "low rate", "upsampl", "duplicat",
            ],
            []
        ),
    },
    Corruption {
        id: "writing_to_the_card_stalled_and_the_missing_rows_were_closed_up",
        kind: Timing,
        says: "The logger lost a few tenths of a second at a time and the rows left were put one after the other: with time as row number, \
               every column jumps at these places.",
        parts: [Half, All],
        change: Columns(|log, chance| {
            let lost = spans(log, 4.0, 0.15..0.5, chance);
            let kept: Vec<usize> = (0..log.len()).filter(|sample| !lost.iter().any(|span| span.contains(sample))).collect();
            log.rows(&kept);
        }),
        right: right!(
            [" row", "rows", "sample", "time", "logger", "record", "columns", "streams", "stretch", "everything", "all signals"],
            [
                "missing", "dropped", "dropout", "drop-out", "drop out", " lost", "skipped", " skip", " gap", "cut out", "left out of",
                "in time jump", "jump in time", "jumps in time", "time jump", "time leap", "jump together", "jump at once", "all jump",
                "columns jump", "streams jump", "not consecutive", "closed up", "not continuous", "not contiguous", "interrupt",
                "absent", "spliced",
            ],
            []
        ),
    },
    Corruption {
        id: "motion_capture_ran_a_little_slow_and_was_taken_for_100_hz",
        kind: Timing,
        says: "The cameras ran a bit under their nominal rate and their frames were counted instead of timed, so position and attitude lag \
               behind the rest more and more, from nothing to a quarter of a second.",
        parts: [Half, One],
        change: Columns(|log, chance| {
            let share = 0.992 + 0.002 * chance.uniform();
            for column in POSITION.into_iter().chain(ATTITUDE) {
                let before = log.of_column(column).clone();
                let turns = ATTITUDE.contains(&column);
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    *value = between(&before, share * sample as f64, turns);
                }
            }
        }),
        right: right!(
            [
                "position", "attitude", " pose", "pose ", "mocap", "motion capture", "clock", "angles", "euler", "x, y", "`x`", "`roll`",
                "roll, pitch",
            ],
            [
                "clock", "drifts in time", "drift in time", "drifting in time", "time drift", "drifting delay", "drifting lag",
                "delay drifts", "lag drifts", "growing delay", "growing lag", "delay grows", "lag grows", "later and later",
                "more and more", "delay increas", "lag increas", "increasing delay", "increasing lag", "increasingly late",
                "delay changes", "lag changes", "delay varies", "varying delay", "changing delay", "stretched", "time stretch",
                "stretches", "time scale", "timescale", "time base", "timebase", "sample rate", "sampling rate", "frame rate",
                "different rate", "skew", "runs slow", "ran slow", "too slow", "slower", "from the start to the end",
                "grows over the flight", "grows along the flight", "late at the end", "by the end", "99.2 hz", "99.3 hz", "99.4 hz",
                "0.6 %", "0.7 %", "0.8 %", "0.992", "0.993", "0.994",
            ],
            []
        ),
    },
    // Cells.
    Corruption {
        id: "gaps_of_the_velocity_filled_with_zeros_by_the_join",
        kind: Cells,
        says: "Where the velocity stream had a gap the join of the tables left cells empty and a fillna(0) made zeros of them: vx, vy and vz are \
               exactly 0 for some tenths of a second, several times.",
        parts: [Half, All],
        change: Columns(|log, chance| {
            for span in spans(log, 2.5, 0.15..0.6, chance) {
                for sample in span {
                    log.set_vector(VELOCITY, sample, [0.0; 3]);
                }
            }
        }),
        right: right!(
            VELOCITY_NAMES,
            [
                "zero", "exactly 0", "are 0", "is 0", " 0 for", " 0.0 ", "= 0", "missing", "dropout", "drop-out", "drop out", " gap",
                "empty", "fill", "placeholder", "blank", "sentinel", "null", "lost", "no data",
            ],
            []
        ),
    },
    Corruption {
        id: "gnss_multipath_moves_the_horizontal_position_for_some_seconds",
        kind: Cells,
        says: "Reflected signals near a building put the horizontal position 5 to 9 m aside for some seconds at a time, with a jump at either \
               end; height and velocity are as they should be.",
        parts: [One, Half],
        change: Columns(|log, chance| {
            for span in spans(log, 6.0, 2.0..4.5, chance) {
                let aside = [Column::X, Column::Y].map(|column| (column, side(chance) * (5.0 + 4.0 * chance.uniform())));
                for (column, by) in aside {
                    log.of_column(column)[span.clone()].iter_mut().for_each(|value| *value += by);
                }
            }
        }),
        right: right!(
            [
                "position", "x and y", "x, y", "`x`", "`y`", "gps", "gnss", "in x", "in y", "of x ", "of y ", "x jumps", "y jumps",
                "column x", "column y", "trajectory", "x: ", "x = ",
            ],
            [
                "jump", "discontinu", "sudden", "glitch", "leap", "displac", "outlier", "step change", "a step", "steps by",
                "for a while", "teleport", "excursion", "multipath", "reset", "bad sample", "bad cell", "aside", "implausib", "spike",
            ],
            []
        ),
    },
    Corruption {
        id: "wrapped_angles_interpolated_straight_through_the_turn_over",
        kind: Cells,
        says: "The angles came at 5 Hz within plus and minus pi and were interpolated as plain numbers: wherever one wraps, it runs through all \
               values between pi and -pi in a fifth of a second.",
        parts: [All, Half],
        change: Columns(|log, _| {
            let period = log.samples(0.2).max(1);
            for column in ATTITUDE {
                let before = log.of_column(column).clone();
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    let start = sample - sample % period;
                    let end = (start + period).min(before.len() - 1);
                    *value = before[start] + (before[end] - before[start]) * (sample - start) as f64 / period as f64;
                }
            }
        }),
        right: right!(
            ["attitude", "euler", "angles", "yaw", "roll", "heading"],
            [
                "wrap", "interpolat", "turn over", "turn-over", "turnover", "through zero", "through 0", "branch", "2 pi", "2pi", "2π",
                "±pi", "+-pi", "+/-pi", "±π", "±180", "-180", "180°", "180 deg", "full turn", "whole turn", "between pi and -pi",
                "from pi to -pi", "across pi", "resampl", "5 hz", "5.0 hz", "every 0.2", "every 20",
            ],
            []
        ),
    },
    Corruption {
        id: "angular_accelerations_explode_where_two_time_stamps_nearly_coincide",
        kind: Cells,
        says: "The rates were differentiated with logged time stamps, some of which nearly coincide: there wx_dot, wy_dot and wz_dot are 8 to 20 \
               times too large for a single row.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            for _ in 0..log.len() / 60 {
                let sample = chance.below(log.len());
                let by = 8.0 + 12.0 * chance.uniform();
                log.set_vector(ANGULAR, sample, log.vector(ANGULAR, sample).map(|value| by * value));
            }
        }),
        right: right!(
            ANGULAR_NAMES,
            [
                "spike", "outlier", "glitch", "impuls", "single sample", "single row", "single cell", "isolated", "bad cell",
                "bad sample", "one sample", " lone ", "burst", "explod", "implausib", "impossib", "too large in", "stick out", "extreme",
                "heavy tail", "heavy-tailed", "jump", "out of range", "wild",
            ],
            []
        ),
    },
    Corruption {
        id: "buffer_of_the_logger_written_to_the_card_twice",
        kind: Cells,
        says: "After a write error the logger wrote its buffer once more: a block of about a second of all columns stands twice in a row, and the \
               log jumps back in time at its end.",
        parts: [One, Half],
        change: Columns(|log, chance| {
            let blocks = spans(log, 8.0, 0.6..1.5, chance);
            let mut order = Vec::new();
            for sample in 0..log.len() {
                order.push(sample);
                for block in blocks.iter().filter(|block| block.end == sample + 1) {
                    order.extend(block.clone());
                }
            }
            log.rows(&order);
        }),
        right: right!(
            [" row", "rows", "sample", "block", " log", "record", "columns", "stretch", "section", "segment", "passage"],
            [
                "duplicat", "repeat", "twice", "copied", "a copy", "copies", "copy of", "second time", "once more", "doubled",
                "same rows", "jump back", "jumps back", "back in time", "identical block", "identical stretch", "identical row",
                "identical to earlier", "same as earlier", "occur again", "occurs again", "come again", "comes again", "seen before",
            ],
            []
        ),
    },
    // Noise.
    Corruption {
        id: "once_per_rev_of_the_rotor_shakes_a_hard_mounted_gyro",
        kind: Noise,
        says: "The autopilot is screwed on without damping: roll and pitch rate carry a tone at the speed of the rotor, 21 to 25 Hz, about a \
               third of a radian per second high.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            let (hertz, phase) = (21.0 + 4.0 * chance.uniform(), TAU * chance.uniform());
            let sizes = [0.3 + 0.1 * chance.uniform(), 0.3 + 0.1 * chance.uniform()];
            let step_s = log.step_s;
            for (number, column) in [Column::Wx, Column::Wy].into_iter().enumerate() {
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    *value += sizes[number] * (TAU * hertz * sample as f64 * step_s + phase + 0.5 * PI * number as f64).sin();
                }
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "vibrat", "noise", "noisy", " tone", "periodic", "oscillat", "sinus", "spectr", "resonan", "rotor", "alias", "per rev",
                "per-rev", "1/rev", "hz peak", "peak at", "peak near", "peak of", "narrow", "line at", "ripple", "shak", "buzz",
                "harmonic", "notch",
            ],
            []
        ),
    },
    Corruption {
        id: "angular_accelerations_differenced_from_unfiltered_gyro_samples",
        kind: Noise,
        says: "The angular accelerations are differences of raw gyro samples without any filter: on top of wx_dot, wy_dot and wz_dot lies noise \
               that grows with frequency, nearly as large as the signal.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            let step_s = log.step_s;
            for column in ANGULAR {
                let raw: Vec<f64> = (0..log.len() + 2).map(|_| 0.03 * chance.normal()).collect();
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    *value += (raw[sample + 2] - raw[sample]) / (2.0 * step_s);
                }
            }
        }),
        right: right!(
            ANGULAR_NAMES,
            [
                "noise", "noisy", "scatter", "jitter", " rough", "unfiltered", "not smooth", "not filtered", "signal-to-noise",
                "high frequenc", "high-frequenc", "random", "fluctuat", "grass", "smooth them", "filter them",
            ],
            []
        ),
    },
    Corruption {
        id: "linear_accelerations_smoothed_over_half_a_second",
        kind: Noise,
        says: "The accelerations went through a smoothing window of half a second, centred, so nothing is late, but quick changes of vx_dot, \
               vy_dot and vz_dot are flattened.",
        parts: [All, Half],
        change: Columns(|log, _| {
            let reach = log.samples(0.25);
            for column in LINEAR {
                let before = log.of_column(column).clone();
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    let window = &before[sample.saturating_sub(reach)..(sample + reach + 1).min(before.len())];
                    *value = window.iter().sum::<f64>() / window.len() as f64;
                }
            }
        }),
        right: right!(
            LINEAR_NAMES,
            [
                "smoothed", "smoothing", "too smooth", "smoother", "smooth out", " filtered", " a filter", "low-pass", "low pass",
                "lowpass", "averag", "bandwidth", "attenuat", "flatten", "blur", "cut-off", "cutoff", "cut off", "fast changes",
                "quick changes", "no high", "lack", "missing high", "rounded off", "dull",
            ],
            []
        ),
    },
    Corruption {
        id: "slow_attitude_filter_follows_the_aircraft_with_a_lag",
        kind: Noise,
        says: "The attitude is that of a sluggish filter in the autopilot, which follows with a time constant of 0.15 s: roll, pitch and yaw are \
               late and their quick motions too small.",
        parts: [All, Half],
        change: Columns(|log, _| {
            let share = 1.0 - (-log.step_s / 0.15).exp();
            for column in ATTITUDE {
                let values = log.of_column(column);
                let mut state = values[0];
                for value in values {
                    state = turned(state + share * turned(*value - state));
                    *value = state;
                }
            }
        }),
        right: right!(
            ATTITUDE_NAMES,
            [
                " late", " lag", "lagg", "delay", "latency", "behind", "time shift", "shifted in time", "shifted by", "old values",
                "out of sync", "not synchron", "filter", "smooth", "low-pass", "low pass", "lowpass", "bandwidth", "attenuat",
                "sluggish", "time constant", "follows slowly", "slowly follow", "too slow", "damped",
            ],
            []
        ),
    },
    Corruption {
        id: "velocity_estimate_runs_away_without_aiding",
        kind: Noise,
        says: "The filter had no velocity to correct with and integrated the accelerations alone: a slow error that wanders off, to a few metres \
               per second at the end, lies on vx, vy and vz.",
        parts: [Half, One],
        change: Columns(|log, chance| {
            let samples = log.len();
            for column in VELOCITY {
                let slope = side(chance) * (1.5 + 1.5 * chance.uniform());
                let mut walk = 0.0;
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    walk += 0.008 * chance.normal();
                    *value += slope * sample as f64 / samples as f64 + walk;
                }
            }
        }),
        right: right!(
            VELOCITY_NAMES,
            [
                "drift", " bias", "offset", "wander", "random walk", "creep", "trend", "slow error", "slowly", "low-frequency",
                "low frequency", "run away", "runs away", "diverg", "grows over", "growing error", "error grows", "accumulat", "ramp",
                "dead reckoning", "dead-reckoning",
            ],
            []
        ),
    },
    // Frames.
    Corruption {
        id: "velocity_of_the_local_frame_copied_into_the_body_columns",
        kind: Frames,
        says: "The topic with the velocity in the local inertial frame was exported in place of the one in the body frame: vx, vy and vz are the \
               rates of change of x, y and z.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let turned = rotate(&body_to_inertial(log, sample), log.vector(VELOCITY, sample));
                log.set_vector(VELOCITY, sample, turned);
            });
        }),
        right: right!(
            VELOCITY_NAMES,
            [
                "inertial frame",
                "inertial axes",
                "inertial velocit",
                "in inertial",
                "are inertial",
                "inertial instead",
                "inertial, not",
                "inertial compon",
                "inertial coord",
                "= \"inertial",
                "world",
                "earth frame",
                "earth axes",
                "earth-",
                "ground frame",
                "ground axes",
                "local frame",
                "local axes",
                " enu",
                " ned",
                "navigation frame",
                "not body",
                "instead of body",
                "body instead",
                "not the body",
                "rather than body",
                "to body axes",
                "into body",
                "to the body",
                "global frame",
                "are the derivatives of",
                "not in body",
                "wrong frame",
                "another frame",
                "other frame",
                "rotated",
                "rotate them",
                "other axes",
                "derivatives of x",
                "rates of change of x",
            ],
            []
        ),
    },
    Corruption {
        id: "accelerometer_readings_copied_into_the_derivatives_of_velocity",
        kind: Frames,
        says: "The accelerometer was taken for the derivative of the body velocity: vx_dot, vy_dot and vz_dot hold the specific force, with \
               gravity and without the term of the turning axes.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let rotation = body_to_inertial(log, sample);
                let [vx, vy, vz] = log.vector(VELOCITY, sample);
                let [wx, wy, wz] = log.vector(RATES, sample);
                let [ax, ay, az] = log.vector(LINEAR, sample);
                let [gx, gy, gz] = rotation[2].map(|share| 9.80665 * share);
                let force = [ax + wy * vz - wz * vy + gx, ay + wz * vx - wx * vz + gy, az + wx * vy - wy * vx + gz];
                log.set_vector(LINEAR, sample, force);
            });
        }),
        right: right!(
            LINEAR_NAMES,
            [
                "gravit", "specific force", "acceleromet", "coriolis", "cross product", "transport term", "omega x v", "w x v", "ω×v",
                "ω × v", "centripetal", "centrifugal", "+9.8", "9.8 too", "offset of 9.8", "raw imu", "of the turning axes",
                "proper accel",
            ],
            []
        ),
    },
    Corruption {
        id: "compass_heading_without_declination",
        kind: Frames,
        says: "The yaw counts from magnetic north and the position from true north, or the compass was mounted askew: yaw is 14 degrees \
               too large all along.",
        parts: [All, Half],
        change: Columns(|log, _| log.each(&[Column::Yaw], |value| turned(value + 0.25))),
        right: right!(
            ["yaw", "heading", "compass", "azimuth"],
            [
                "offset", " bias", "declination", "rotated", "north", "misalign", "constant error", "off by", "is off", "turned by",
                "magnetic", "boresight", "zero point", "shifted by a constant", "wrong by", "reference direction", "too large by",
                "too high by", "14 deg", "14.3",
            ],
            [
                &["position", "rotated about"], &["position", "turned about"], &["position", "horizontally rotated"],
                &["trajectory", "rotated"], &["position", "rotated by"], &["position", "turned by"],
            ]
        ),
    },
    Corruption {
        id: "north_east_down_position_written_as_x_y_z",
        kind: Frames,
        says: "The autopilot logs its local position as north, east, down and it was taken for east, north, up: x and y are exchanged and z has \
               the opposite sign, attitude and velocity are right.",
        parts: [All, Half],
        change: Columns(|log, _| {
            log.swap(Column::X, Column::Y);
            log.scale(&[Column::Z], -1.0);
        }),
        right: right!(
            ["position", "x and y", "x, y", "`x`", "`y`", "`z`", "x with y", "height", "altitude", "trajectory", "coordinates"],
            [
                " ned", "north", " enu", "swap", "exchang", "interchang", "permut", "mixed up", "wrong order", "column order", "z down",
                "z is down", "z points down", "points down", "downward", "positive down", "up and down", "wrong frame", "other frame",
                "another frame", "other axes", "rotated", "sign of z", "sign of `z`", "-`z`", "z = -", "upside", "(ned", "`ned", "/ned",
                "for each other",
            ],
            [&["x = y"], &["y = x"], &["`x` = `y`"], &["`y` = `x`"], &["z = -z"], &["north", "east"], &["x <-> y"]]
        ),
    },
    Corruption {
        id: "euler_angles_taken_from_the_matrix_in_the_intrinsic_order_xyz",
        kind: Frames,
        says: "The script asked its library for angles \"XYZ\" in place of \"xyz\" and so got those of Rx Ry Rz in place of Rz Ry Rx: right only \
               while at most one angle is large.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let r = body_to_inertial(log, sample);
                let angles = [(-r[1][2]).atan2(r[2][2]), r[0][2].clamp(-1.0, 1.0).asin(), (-r[0][1]).atan2(r[0][0])];
                log.set_vector(ATTITUDE, sample, angles);
            });
        }),
        right: right!(
            ["attitude", "euler", "angles", "roll, pitch", "roll and pitch", "yaw", "rotation"],
            [
                "order of",
                "rotation order",
                "euler order",
                "axis order",
                "wrong order",
                "another order",
                "other order",
                "different order",
                "= \"xyz",
                "xyz",
                "zyx",
                "sequence",
                "convention",
                "extrinsic",
                "intrinsic",
                "1-2-3",
                "3-2-1",
                "rx ry rz",
                "rx*ry*rz",
                "rx · ry · rz",
                "rz ry rx",
                "yaw first",
                "roll first",
                "yaw last",
                "roll last",
                "reverse order",
            ],
            []
        ),
    },
];

/// These columns stay as they are at the first of these samples.
fn hold(log: &mut Log, columns: &[Column], start: usize, end: usize) {
    for column in columns {
        let values = log.of_column(*column);
        let first = values[start];
        values[start..end].fill(first);
    }
}

/// Between two samples; angles take the shorter way.
fn between(values: &[f64], at: f64, turns: bool) -> f64 {
    let before = (at as usize).min(values.len() - 1);
    let change = values[(before + 1).min(values.len() - 1)] - values[before];
    let share = at - before as f64;
    if turns { turned(values[before] + share * turned(change)) } else { values[before] + share * change }
}

/// An angle within plus and minus pi.
fn turned(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// 1 or -1.
const fn side(chance: &mut Chance) -> f64 {
    if chance.uniform() < 0.5 { -1.0 } else { 1.0 }
}
