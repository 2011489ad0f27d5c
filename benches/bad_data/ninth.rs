//! Ninth list: faults of the data as users of real autopilots, telemetry, loggers, motion capture, estimators, radios and their own export
//! scripts get them: a column under another's name, a frame or a unit that the message's documentation said in passing, stamps of another
//! clock, holes that pandas filled. The common ones stand first, nine rarer ones after them.
//!
//! Written on 2026-11-28 by someone who had seen neither the checks nor the other lists. Reported once, on seeds 85501 and 85502, and looked at since: they are
//! for development now.

use crate::change::Change::Columns;
use crate::change::Kind::{Cells, Frames, Noise, Sticks, Timing, Units};
use crate::change::Part::{All, Half, One};
use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Corruption, LINEAR, POSITION, RATES, VELOCITY};
use crate::words::{
    ATTITUDE_NAMES, CONTROL_NAMES, LATE, LINEAR_NAMES, RATE_NAMES, SIGN, VELOCITY_NAMES, body_to_inertial, joined, pairs, right,
    spans, with_each_sample,
};
use phyture::flight::Column;
use phyture::flight::attitude::{cross, euler_to_quaternion, gravity_body, rotate, rotate_back};
use std::f64::consts::TAU;

pub const NINTH: &[Corruption] = &[
    Corruption {
        id: "receiver_channels_aetr_exported_as_aert",
        kind: Sticks,
        says: "The receiver's channels come as aileron, elevator, throttle, rudder, and the export script took the third for the rudder: pedal and collective stand under each other's names.",
        parts: [All, Half],
        change: Columns(|log, _| log.swap(Column::U3, Column::U4)),
        right: right!(
            ["u3", "u4", "pedal", "tail", "collective", "controls", "sticks", "inputs"],
            ORDER,
            [&[r#"u3 = "u4""#], &[r#"u4 = "u3""#], &["u3 and u4"], &["`u3` and `u4`"], &["pedal and collective"]]
        ),
    },
    Corruption {
        id: "pitch_servo_pulse_falls_with_rising_collective",
        kind: Sticks,
        says: "The collective was logged as the pulse width of a servo that is mounted the other way round, so that more pitch is less pulse.",
        parts: [All, Half],
        change: Columns(|log, _| log.scale(&[Column::U4], -1.0)),
        right: right!(["u4", "collective", "controls", "sticks", "inputs"], SIGN, [&[r#""-u4""#], &["-1", "u4"]]),
    },
    Corruption {
        id: "transmitter_trim_tabs_missing_from_the_stick_log",
        kind: Sticks,
        says: "The trainer port gives the sticks without the trim tabs, and for these flights the pilot had trimmed both cyclic axes.",
        parts: [Half, One],
        change: Columns(|log, _| {
            log.each(&[Column::U1], |stick| stick + 0.15);
            log.each(&[Column::U2], |stick| stick - 0.2);
        }),
        right: right!(
            CONTROL_NAMES,
            ["offset", "trim", "bias", "shifted", "neutral", "centre", "center", "zero point", "constant", " mean ", "moved by"],
            [&["trim tab"]]
        ),
    },
    Corruption {
        id: "sensor_combined_gyro_plotted_and_saved_in_degrees",
        kind: Units,
        says: "The notebook multiplied the gyro by 180/pi for a plot and saved the frame afterwards, so the body rates are in degrees per second.",
        parts: [All, Half],
        change: Columns(|log, _| log.each(&RATES, f64::to_degrees)),
        right: right!(
            RATE_NAMES,
            ["deg", "°", "57.", "0.01745", "0.0175", "180", "unit", "scale", "factor", "times too", "too large", "too big"],
            []
        ),
    },
    Corruption {
        id: "nmea_speed_over_ground_left_in_knots",
        kind: Units,
        says: "The velocity of these flights comes from a receiver's NMEA sentences, in knots.",
        parts: [Half, One],
        change: Columns(|log, _| log.scale(&VELOCITY, 3600.0 / 1852.0)),
        right: right!(
            VELOCITY_NAMES,
            [
                "knot",
                "unit",
                "scale",
                "factor",
                "km/h",
                "1.94",
                "0.51",
                "too large",
                "too big",
                "too fast",
                "faster",
                "times",
                "ratio"
            ],
            []
        ),
    },
    Corruption {
        id: "np_gradient_given_the_sample_time_of_the_old_logger",
        kind: Units,
        says: "The accelerations were made by numpy's gradient with the 0.02 s of an older logger in place of 0.01 s: all six are half of what they should be.",
        parts: [All, Half],
        change: Columns(|log, _| log.scale(&Column::TARGETS, 0.5)),
        right: right!(
            TARGET_NAMES,
            [
                "factor",
                "scale",
                "half",
                "halv",
                "twice",
                "double",
                "too small",
                "times",
                "unit",
                "time step",
                "sample time",
                "sampling",
                "0.5",
                "2 *",
                "2.0",
                "ratio",
            ],
            []
        ),
    },
    Corruption {
        id: "throttle_field_of_manual_control_runs_from_zero_to_one",
        kind: Units,
        says: "The collective of these flights was read from a firmware whose throttle field runs from 0 to 1 and not from -1 to 1.",
        parts: [Half, One],
        change: Columns(|log, _| log.each(&[Column::U4], |stick| 0.5 * (stick + 1.0))),
        right: right!(
            ["u4", "collective", "throttle", "controls", "sticks", "inputs"],
            [
                "range", "scale", "scaling", "factor", "0 to 1", "0..1", "0 and 1", "[0, 1]", "half", "twice", "double", "offset",
                "unit", "normali", "negative", "gain", "2 *", "2*",
            ],
            []
        ),
    },
    Corruption {
        id: "joystick_topic_stamped_when_it_reached_the_laptop",
        kind: Timing,
        says: "The sticks were recorded over the radio link and carry the time of their arrival on the ground, 0.15 s after they moved.",
        parts: [All, Half],
        change: Columns(|log, _| log.late(&CONTROLS, 0.15)),
        right: right!(CONTROL_NAMES, LATE, [&["before", "stick"], &["before", "control"], &["precede"], &["acausal"]]),
    },
    Corruption {
        id: "gps_velocity_forward_filled_by_merge_asof",
        kind: Timing,
        says: "Velocity came at 5 Hz and was joined to the 100 Hz of the rest by merge_asof, which repeats the last value.",
        parts: [All, Half],
        change: Columns(|log, _| log.held(&VELOCITY, 0.2)),
        right: right!(
            VELOCITY_NAMES,
            [
                "held",
                "hold",
                "repeat",
                "stair",
                "slow",
                "5 hz",
                "5.0 hz",
                "0.2 s",
                "0.20 s",
                "200 ms",
                "20 samples",
                "constant",
                "same value",
                "frozen",
                "stale",
                "update",
                "low rate",
                "lower rate",
                "unchanged",
                "sampled at",
            ],
            []
        ),
    },
    Corruption {
        id: "sd_card_stalls_hidden_by_a_rebuilt_time_column",
        kind: Timing,
        says: "Whenever the card stalled the logger lost some tenths of a second of rows, and the export numbered the rest through at 10 ms.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            let lost = spans(log, 2.0, 0.15..0.5, chance);
            let kept: Vec<usize> = (0..log.len()).filter(|row| !lost.iter().any(|span| span.contains(row))).collect();
            log.rows(&kept);
        }),
        right: right!(
            ["rows", "samples", "log", "flight", "column", "time", "state", "record"],
            [
                "jump",
                " gap",
                "missing",
                "lost",
                "dropped",
                "drop out",
                "dropout",
                "drops",
                "discontinu",
                "splice",
                "skip",
                "torn",
                "left out",
                "cut out",
                "break",
                "hole",
            ],
            []
        ),
    },
    Corruption {
        id: "untracked_mocap_frames_after_fillna_zero",
        kind: Cells,
        says: "Frames in which the cameras lost the body were empty, and fillna(0) made pose and velocity zero there.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            for span in spans(log, 1.5, 0.05..0.25, chance) {
                for column in [POSITION, ATTITUDE, VELOCITY].as_flattened() {
                    log.of_column(*column)[span.clone()].fill(0.0);
                }
            }
        }),
        right: right!(
            [
                "attitude", "roll", "pitch", "yaw", "velocit", "vx", "vy", "vz", "position", "x,", "`x`", "cells", "samples",
                "rows", "values", "columns",
            ],
            [
                "zero",
                " 0 ",
                "`0`",
                "0.0",
                "fill",
                "missing",
                "dropout",
                "drop out",
                "lost",
                "placeholder",
                "jump",
                "outlier",
                "spike",
                "gap",
                "glitch",
                "constant",
                "repeat",
                "frozen",
                "held",
                "same value",
                "stuck",
            ],
            []
        ),
    },
    Corruption {
        id: "bit_errors_of_the_imu_spi_bus",
        kind: Cells,
        says: "On a long cable to the gyro a high bit flips in one word of a hundred, which adds or takes 8.192 rad/s for a single sample.",
        parts: [All, One],
        change: Columns(|log, chance| {
            for column in RATES {
                for value in log.of_column(column) {
                    if chance.uniform() < 0.01 {
                        *value += if chance.uniform() < 0.5 { 8.192 } else { -8.192 };
                    }
                }
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "spike",
                "outlier",
                "glitch",
                "jump",
                "impossible",
                "implausible",
                "single sample",
                "single value",
                "cells",
                "isolated",
                " bit",
                "out of range",
                "stray",
                "impuls",
            ],
            []
        ),
    },
    Corruption {
        id: "ahrs_node_hung_and_latched_topic_kept_its_last_message",
        kind: Cells,
        says: "The AHRS driver hangs for a second or two at a time, and the recorder writes its last message, attitude and rates, again and again.",
        parts: [Half, One],
        change: Columns(|log, chance| {
            for span in spans(log, 6.0, 1.0..2.5, chance) {
                for column in [ATTITUDE, RATES].as_flattened() {
                    let values = log.of_column(*column);
                    let last = values[span.start];
                    values[span.clone()].fill(last);
                }
            }
        }),
        right: right!(
            [
                "attitude",
                "euler",
                "angles",
                "roll",
                "pitch",
                "yaw",
                "rates",
                "gyro",
                "angular velocit",
                "wx",
                "wy",
                "wz",
                "cells",
                "samples",
                "sensor",
                "columns",
            ],
            [
                "frozen",
                "froze",
                "freez",
                "held",
                "hold",
                "constant",
                "stuck",
                "stale",
                "repeat",
                "same value",
                "does not change",
                "do not change",
                "unchanged",
                "flat",
                "stand still",
                "stands still",
                "hang",
                "hung",
                "identical",
                "dropout",
            ],
            []
        ),
    },
    Corruption {
        id: "rotor_vibration_folded_down_by_gyro_without_low_pass",
        kind: Noise,
        says: "The gyro was decimated to 100 Hz without a filter, and the rotor's vibration of 131 Hz stands as one of 31 Hz in the rates.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            let step_s = log.step_s;
            for (column, size) in RATES.into_iter().zip([0.6, 0.5, 0.3]) {
                let phase = chance.uniform();
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    *value += size * (TAU * (131.0 * step_s * sample as f64 + phase)).sin();
                }
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "noise", "noisy", "vibrat", "oscillat", "alias", " hz", "hum", "sinus", "periodic", "tone", "spectr", "frequenc",
                "rough"
            ],
            []
        ),
    },
    Corruption {
        id: "to_csv_with_float_format_of_one_decimal",
        kind: Noise,
        says: "The table was written with float_format='%.1f', which is enough for metres and leaves tenths of angles, rates and sticks.",
        parts: [All, Half],
        change: Columns(|log, _| {
            for columns in [&ATTITUDE[..], &RATES, &CONTROLS] {
                log.round(columns, 0.1);
            }
        }),
        right: right!(
            [
                "attitude",
                "euler",
                "angles",
                "roll",
                "pitch",
                "yaw",
                "rates",
                "gyro",
                "angular velocit",
                "wx",
                "wy",
                "wz",
                "controls",
                "sticks",
                "inputs",
                "u1",
                "u2",
                "u3",
                "u4",
                "column",
                "values",
            ],
            [
                "round",
                "quanti",
                "resolution",
                "coarse",
                "decimal",
                "digit",
                "stair",
                "multiple",
                "levels",
                "distinct",
                "grid",
                "steps of",
                "step of",
                "precision",
            ],
            []
        ),
    },
    Corruption {
        id: "mocap_positions_differenced_twice_without_filter",
        kind: Noise,
        says: "The linear accelerations are second differences of motion capture positions, whose 0.2 mm of noise become some m/s².",
        parts: [All, Half],
        change: Columns(|log, chance| {
            let size = 0.0002 / (log.step_s * log.step_s);
            for column in LINEAR {
                let (mut before, mut at) = (chance.normal(), chance.normal());
                for value in log.of_column(column) {
                    let after = chance.normal();
                    *value += size * (before - 2.0 * at + after);
                    (before, at) = (at, after);
                }
            }
        }),
        right: right!(
            LINEAR_NAMES,
            ["noise", "noisy", "rough", "difference", "differentiat", "scatter", "white", "frequenc", "jitter", "spectr", "hz"],
            []
        ),
    },
    Corruption {
        id: "gyro_calibrated_cold_drifts_while_it_warms_up",
        kind: Noise,
        says: "These flights began right after power-on: the gyro's zero wanders off while the board warms up.",
        parts: [Half, One],
        change: Columns(|log, _| {
            let step_s = log.step_s;
            for (column, bias) in RATES.into_iter().zip([0.35, -0.3, 0.4]) {
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    *value += bias * (1.0 - (-step_s * sample as f64 / 12.0).exp());
                }
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "bias",
                "offset",
                "drift",
                "wander",
                " mean ",
                "zero point",
                "zero-rate",
                "zero rate",
                "constant",
                "shifted by",
                "creep"
            ],
            []
        ),
    },
    Corruption {
        id: "local_position_ned_velocity_taken_for_body_velocity",
        kind: Frames,
        says: "vx, vy and vz were copied from a message whose velocity is north, east and down.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let world = rotate(&body_to_inertial(log, sample), log.vector(VELOCITY, sample));
                log.set_vector(VELOCITY, sample, world);
            });
        }),
        right: right!(
            VELOCITY_NAMES,
            [
                "inertial",
                "world",
                "earth",
                " ned",
                "ned ",
                "north",
                "body axes",
                "body frame",
                "body component",
                "global",
                "rotat",
                "frame",
                "axes",
                "ground axes",
            ],
            []
        ),
    },
    Corruption {
        id: "scipy_as_euler_zyx_unpacked_as_roll_pitch_yaw",
        kind: Frames,
        says: "as_euler('ZYX') returns yaw, pitch, roll, and the script unpacked them as roll, pitch, yaw.",
        parts: [All, Half],
        change: Columns(|log, _| log.swap(Column::Roll, Column::Yaw)),
        right: right!(
            ATTITUDE_NAMES,
            ORDER,
            [
                &[r#"roll = "yaw""#],
                &[r#"yaw = "roll""#],
                &["roll", "yaw", "swap"],
                &["roll", "yaw", "exchang"],
                &["roll and yaw"],
                &["`roll` and `yaw`"],
            ]
        ),
    },
    Corruption {
        id: "imu_board_turned_a_quarter_without_board_rotation_set",
        kind: Frames,
        says: "The IMU of these flights sits turned by 90° about the vertical and its driver was not told: rates and angular accelerations are in the board's axes.",
        parts: [Half, One],
        change: Columns(|log, _| {
            for [x, y, _] in [RATES, ANGULAR] {
                log.swap(x, y);
                log.scale(&[y], -1.0);
            }
        }),
        right: right!(
            RATE_NAMES,
            [
                "turned",
                "rotat",
                "90",
                "mount",
                "axes",
                "frame",
                "quarter",
                "orientation",
                "swap",
                "exchang",
                "interchang",
                "permut",
                "order"
            ],
            [
                &[r#"wx = "-wy""#],
                &[r#"wy = "wx""#],
                &[r#"wx = "wy""#],
                &[r#"wy = "-wx""#],
                &["wx and wy"],
                &["`wx` and `wy`"],
                &["gyro", "axis"],
            ]
        ),
    },
    Corruption {
        id: "imu_data_linear_acceleration_used_as_velocity_derivative",
        kind: Frames,
        says: "The linear accelerations are the accelerometer's, gravity and the turning of the axes and all, in place of the derivatives of the body velocities.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let [roll, pitch, _] = log.vector(ATTITUDE, sample);
                let gravity = gravity_body(roll, pitch);
                let turning = cross(log.vector(RATES, sample), log.vector(VELOCITY, sample));
                let derivative = log.vector(LINEAR, sample);
                log.set_vector(LINEAR, sample, sum(derivative, turning, gravity.map(|part| -part)));
            });
        }),
        right: right!(
            LINEAR_NAMES,
            ["gravit", "specific force", "accelerometer", "g₀", "9.8", "proper", "coriolis", "transport", "weight", "turning"],
            [&["specific force"], &["accelerometer"]]
        ),
    },
    Corruption {
        id: "stick_dead_zone_of_flight_controller_applied_in_log_only",
        kind: Sticks,
        says: "The logged cyclic and pedal went through the flight controller's dead zone of 0.1, the passed-through servos did not.",
        parts: [All, Half],
        change: Columns(|log, _| {
            log.each(&[Column::U1, Column::U2, Column::U3], |stick| (stick.abs() - 0.1).max(0.0).copysign(stick));
        }),
        right: right!(
            CONTROL_NAMES,
            [
                "dead",
                "zero",
                " 0 ",
                "threshold",
                "small values",
                "insensitive",
                "nonlinear",
                "non-linear",
                "not linear",
                "flat",
                "same value",
                "held",
                "hold",
                "constant",
                "stuck",
            ],
            []
        ),
    },
    Corruption {
        id: "ccpm_swashplate_servos_logged_as_cyclic_and_collective",
        kind: Sticks,
        says: "The logger sat behind the mixer: lateral, longitudinal and collective are the three swashplate servos at 120°.",
        parts: [All, Half],
        change: Columns(|log, _| {
            const SWASHPLATE: [Column; 3] = [Column::U1, Column::U2, Column::U4];
            with_each_sample(log, |log, sample| {
                let [lateral, longitudinal, collective] = log.vector(SWASHPLATE, sample);
                let (across, along) = (0.75_f64.sqrt() * lateral, 0.5 * longitudinal);
                let servos = [collective + across - along, collective + longitudinal, collective - across - along];
                log.set_vector(SWASHPLATE, sample, servos.map(|servo| 0.5 * servo));
            });
        }),
        right: right!(
            CONTROL_NAMES,
            [
                "mix",
                "servo",
                "swash",
                "ccpm",
                "combin",
                "linear map",
                "matrix",
                "cross",
                "permut",
                "swap",
                "exchang",
                "rotated",
                "correlat",
                "order",
                "each other",
            ],
            []
        ),
    },
    Corruption {
        id: "orientation_xyz_of_the_quaternion_read_as_angles",
        kind: Units,
        says: "orientation.x, .y and .z of the pose message, parts of a quaternion, were taken for roll, pitch and yaw.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let [x, y, z, w] = euler_to_quaternion(roll, pitch, yaw);
                log.set_vector(ATTITUDE, sample, [x, y, z].map(|part| part * w.signum()));
            });
        }),
        right: right!(
            ATTITUDE_NAMES,
            [
                "quaternion",
                "half",
                "halv",
                "scale",
                "factor",
                "too small",
                "unit",
                " sine",
                "twice",
                "double",
                "gain",
                "ratio",
                "2 *",
                "2.0"
            ],
            [&["quaternion"]]
        ),
    },
    Corruption {
        id: "stick_frames_counted_as_ten_milliseconds_each",
        kind: Timing,
        says: "The stick logger numbers its frames at 10 ms though they come a little faster, so the sticks fall behind by 12 ms in every second.",
        parts: [All, Half],
        change: Columns(|log, _| log.take(&CONTROLS, |sample| (0.988 * sample as f64).round() as usize)),
        right: right!(
            CONTROL_NAMES,
            [
                "drift",
                "skew",
                "clock",
                "grow",
                "stretch",
                "increas",
                "more and more",
                " late",
                " lag",
                "lagg",
                "delay",
                "latency",
                "behind",
                "time shift",
                "shifted in time",
                "out of sync",
                "not synchron",
            ],
            []
        ),
    },
    Corruption {
        id: "accelerations_smoothed_with_lfilter_instead_of_filtfilt",
        kind: Timing,
        says: "All six accelerations went through a low pass of 2 Hz forwards only, so they trail behind the motion.",
        parts: [All, Half],
        change: Columns(|log, _| log.lag(&Column::TARGETS, 0.08)),
        right: right!(
            TARGET_NAMES,
            [
                " late",
                " lag",
                "lagg",
                "delay",
                "latency",
                "behind",
                "time shift",
                "shifted in time",
                "shifted by",
                "out of sync",
                "not synchron",
                "filter",
                "smooth",
                "causal",
                "phase",
                "low pass",
                "low-pass",
                "lowpass",
                "attenuat",
                "damped",
            ],
            []
        ),
    },
    Corruption {
        id: "rows_sorted_by_row_number_as_text",
        kind: Cells,
        says: "The log passed through a database in which the row number is text: 10 comes after 1, and 1000 to 1009 come between 100 and 101.",
        parts: [Half, One],
        change: Columns(|log, _| {
            let mut rows: Vec<usize> = (0..log.len()).collect();
            rows.sort_by_key(usize::to_string);
            log.rows(&rows);
        }),
        right: right!(
            ["rows", "samples", "log", "flight", "time", "column", "state", "record"],
            [
                "order",
                "sort",
                "shuffl",
                "jump",
                "discontinu",
                "scrambl",
                "torn",
                " gap",
                "mixed",
                "break",
                "splice",
                "spike",
                "outlier",
                "not continu",
                "sequence",
                "missing",
            ],
            []
        ),
    },
    Corruption {
        id: "lost_separator_moves_the_rest_of_the_row_to_the_left",
        kind: Cells,
        says: "Where the serial link dropped a character the rest of the row, from vy on, stands one column too far to the left, for some samples at a time.",
        parts: [All, Half],
        change: Columns(|log, chance| {
            for span in spans(log, 1.5, 0.05..0.2, chance) {
                for sample in span {
                    for column in Column::Vy as usize..Column::COUNT {
                        log.columns[column][sample] = log.columns.get(column + 1).map_or(0.0, |next| next[sample]);
                    }
                }
            }
        }),
        right: right!(
            [
                "cells",
                "rows",
                "samples",
                "columns",
                "values",
                "velocit",
                "vy",
                "vz",
                "rates",
                "wx",
                "wy",
                "wz",
                "controls",
                "u1",
                "u2",
                "u3",
                "u4",
                "targets",
                "accelerations",
            ],
            [
                "shift",
                "displac",
                "wrong column",
                "next column",
                "moved",
                "jump",
                "outlier",
                "spike",
                "glitch",
                "implausible",
                "impossible",
                "neighbour",
                "discontinu",
                "isolated",
                "corrupt",
                "torn",
                "to the left",
            ],
            []
        ),
    },
    Corruption {
        id: "compass_heading_pulled_by_motor_current",
        kind: Noise,
        says: "The compass sits beside the power lead, so the heading errs with the collective, and the estimator turned the velocity into body axes with that heading.",
        parts: [Half, One],
        change: Columns(|log, _| {
            let collective = log.columns[Column::U4 as usize].clone();
            let mean = collective.iter().sum::<f64>() / collective.len() as f64;
            with_each_sample(log, |log, sample| {
                let world = rotate(&body_to_inertial(log, sample), log.vector(VELOCITY, sample));
                let yaw = &mut log.of_column(Column::Yaw)[sample];
                *yaw = wrapped(*yaw + 1.5 * (collective[sample] - mean));
                let body = rotate_back(&body_to_inertial(log, sample), world);
                log.set_vector(VELOCITY, sample, body);
            });
        }),
        right: right!(
            ["yaw", "heading", "compass", "magnet", "azimuth"],
            [
                "u4",
                "collective",
                "current",
                "error",
                "drift",
                "wander",
                "inconsist",
                "disagree",
                "does not match",
                "do not match",
                "does not agree",
                "do not agree",
                "does not fit",
                "do not fit",
                "contradict",
                "offset",
                "bias",
                "turned",
                "interfer",
                "distort",
                "disturb",
                "noise",
                "noisy",
                "scatter",
                "jitter",
                "does not follow",
                "do not follow",
                "unreliable",
                "off by",
            ],
            [&["compass"], &["magnetometer"]]
        ),
    },
    Corruption {
        id: "velocity_of_the_antenna_on_the_tail_boom",
        kind: Frames,
        says: "The satellite antenna sits 1.2 m behind and 0.2 m above the centre of mass, and its velocity was logged as the aircraft's.",
        parts: [All, Half],
        change: Columns(|log, _| {
            with_each_sample(log, |log, sample| {
                let turning = cross(log.vector(RATES, sample), [-1.2, 0.0, -0.2]);
                let velocity = log.vector(VELOCITY, sample);
                log.set_vector(VELOCITY, sample, sum(velocity, turning, [0.0; 3]));
            });
        }),
        right: right!(
            VELOCITY_NAMES,
            [
                "lever",
                "antenna",
                "moment arm",
                "another point",
                "other point",
                "different point",
                "centre of",
                "center of",
                "cross",
                "away from",
                "behind the",
                "sensor position",
                "position of the sensor",
                "reference point",
                "mounted",
                "cg",
                "c.g.",
                "tail boom",
                "× r",
                "x r",
            ],
            [&["lever arm"], &["vy =", "wz"], &["vz =", "wy"], &["vx =", "wy"]]
        ),
    },
];

/// What may be said of columns under each other's names.
const ORDER: [&str; 11] = [
    "swap",
    "exchang",
    "interchang",
    "order",
    "permut",
    "mixed up",
    "crossed",
    "each other",
    "wrong column",
    "wrong name",
    "mislabel",
];

/// What the six accelerations may be called.
const TARGET_NAMES: [&str; 12] = [
    "linear accel",
    "angular accel",
    "linear target",
    "angular target",
    "accelerations",
    "targets",
    "vx_dot",
    "vy_dot",
    "vz_dot",
    "wx_dot",
    "wy_dot",
    "wz_dot",
];

fn sum(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis] + c[axis])
}

/// Into (-π, π].
fn wrapped(angle: f64) -> f64 {
    let (sine, cosine) = angle.sin_cos();
    sine.atan2(cosine)
}
