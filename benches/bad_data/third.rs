//! Corruptions that were written down on 2026-11-24, after `second` had been looked at, unseen of the checks; reported on 2026-11-24 on seeds 85000
//! and 85001, and on 2026-11-25 on 85002 and 85003, and looked at since: they are for development now. Each differs from those of the lists before in what goes wrong or in what it hits.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, Log, POSITION, Part, RATES, VELOCITY};
use phyture::flight::attitude::{cross, euler_rates, euler_to_quaternion, rotate, rotate_back, rotation_body_to_inertial};
use phyture::flight::{Column, GRAVITY_M_S2};
use std::f64::consts::TAU;

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

/// A degree of latitude on a sphere of 6371 km.
const DEGREE_M: f64 = 111_195.0;

/// North of the equator on a map in metres: single precision has steps of half a metre there.
const NORTHING_M: f64 = 5.25e6;

/// Reserved once, after those of `second`.
pub const THIRD: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "swash_turned",
        kind: Kind::Sticks,
        says: "the two cyclic sticks are recorded behind the mixer, which turns the swash plate by 20°",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let (sine, cosine) = 20.0_f64.to_radians().sin_cos();
            let sticks = [Column::U1, Column::U2, Column::U3];
            for sample in 0..log.len() {
                let [u1, u2, u3] = log.vector(sticks, sample);
                log.set_vector(sticks, sample, [cosine * u1 - sine * u2, sine * u1 + cosine * u2, u3]);
            }
        }),
        right: &[
            &["u1", "u2", "turned"],
            &["u1", "u2", "mix"],
            &["u1", "u2", "rotat"],
            &["u1", "u2", "cross"],
            &["u1", "u2", "combin"],
            &["cyclic", "turned"],
            &["cyclic", "mix"],
        ],
    },
    Corruption {
        id: "u4_zero_to_one",
        kind: Kind::Sticks,
        says: "the collective is recorded from 0 to 1 instead of from -1 to 1",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::U4], |u| 0.5 + 0.5 * u)),
        right: &[&["u4", "gain"], &["u4", "scale"], &["u4", "offset"], &["u4", "trim"], &["u4", "0 to 1"]],
    },
    Corruption {
        id: "u3_dead_zone",
        kind: Kind::Sticks,
        says: "the receiver has a dead zone: within 0.05 of its middle the tail stick is recorded as in the middle",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| {
            let middle = log.of_column(Column::U3).iter().sum::<f64>() / log.len() as f64;
            log.each(&[Column::U3], |u| if (u - middle).abs() < 0.05 { middle } else { u });
        }),
        right: &[&["u3", "dead"], &["u3", "middle"], &["u3", "held"], &["u3", "still"], &["u3", "repeat"], &["u3", "same value"]],
    },
    Corruption {
        id: "u2_copied",
        kind: Kind::Sticks,
        says: "the channel of the lateral cyclic was logged twice: it stands in the column of the longitudinal one, too",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let lateral = log.of_column(Column::U1).clone();
            *log.of_column(Column::U2) = lateral;
        }),
        right: &[
            &["u1", "u2", "same"],
            &["u1", "u2", "copy"],
            &["u1", "u2", "copied"],
            &["u1", "u2", "identical"],
            &["u1", "u2", "equal"],
            &["u1", "u2", "duplicate"],
            &["u1", "u2", "twice"],
        ],
    },
    Corruption {
        id: "u1_trim_step",
        kind: Kind::Sticks,
        says: "the trim of the lateral cyclic was moved in flight and recorded with it: 0.15 more in the last two fifths",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let at = 3 * log.len() / 5;
            log.of_column(Column::U1).iter_mut().skip(at).for_each(|u| *u += 0.15);
        }),
        right: &[&["u1", "trim"], &["u1", "offset"], &["u1", "bias"], &["u1", "jump"], &["u1", "shift"], &["u1", "step of"]],
    },
    Corruption {
        id: "controls_failsafe",
        kind: Kind::Sticks,
        says: "the recording receiver, not that which steers, lost the radio three times for 1.5 s: all controls are 0",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let length = log.samples(1.5);
            for _ in 0..3 {
                let start = chance.below(log.len());
                for control in CONTROLS {
                    log.of_column(control).iter_mut().skip(start).take(length).for_each(|u| *u = 0.0);
                }
            }
        }),
        right: &[
            &["failsafe"],
            &["u1", "held"],
            &["u1", "still"],
            &["u1", "frozen"],
            &["u1", "freez"],
            &["u1", "constant"],
            &["u1", "zero"],
            &["u1", "dropout"],
            &["controls", "held"],
            &["controls", "still"],
            &["controls", "frozen"],
            &["controls", "freez"],
            &["controls", "zero"],
            &["controls", "dropout"],
        ],
    },
    // Units.
    Corruption {
        id: "position_latitude",
        kind: Kind::Units,
        says: "north and east are latitude and longitude in degrees",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let latitude = 47.3_f64;
            log.each(&[Column::X], |north| latitude + north / DEGREE_M);
            log.each(&[Column::Y], |east| 8.5 + east / (DEGREE_M * latitude.to_radians().cos()));
        }),
        right: &[
            &["latitude"],
            &["position", "deg"],
            &["position", "scale"],
            &["position", "units"],
            &["position", "times"],
            &["`x`", "deg"],
            &["`x`", "scale"],
            &["`x`", "units"],
        ],
    },
    Corruption {
        id: "attitude_quaternion",
        kind: Kind::Units,
        says: "the vector part of the quaternion was written as if it were roll, pitch and yaw",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let [x, y, z, _] = euler_to_quaternion(roll, pitch, yaw);
                log.set_vector(ATTITUDE, sample, [x, y, z]);
            }
        }),
        right: &[
            &["quaternion"],
            &["roll", "half as"],
            &["roll", "scale"],
            &["roll", "gain"],
            &["roll", "times"],
            &["attitude", "half as"],
            &["attitude", "scale"],
            &["attitude", "gain"],
            &["angles", "half as"],
            &["angles", "scale"],
            &["angles", "units"],
        ],
    },
    Corruption {
        id: "angular_targets_half",
        kind: Kind::Units,
        says: "the angular accelerations were made with a step of 20 ms from samples 10 ms apart: they are half as large",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&ANGULAR, 0.5)),
        right: &[
            &["angular", "half as"],
            &["angular", "scale"],
            &["angular", "gain"],
            &["angular", "factor"],
            &["angular", "units"],
            &["angular", "times"],
            &["wx_dot", "half as"],
            &["wx_dot", "scale"],
            &["wx_dot", "gain"],
            &["wx_dot", "factor"],
            &["wx_dot", "units"],
            &["wx_dot", "times"],
        ],
    },
    Corruption {
        id: "wx_overflow",
        kind: Kind::Units,
        says: "the counts of the roll gyro overflow at 60 % of what it reaches in the flight and go on from the other end",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let largest = log.of_column(Column::Wx).iter().fold(0.0_f64, |largest, rate| largest.max(rate.abs()));
            let limit = 0.6 * largest;
            log.each(&[Column::Wx], |rate| if rate.abs() > limit { rate - 2.0 * limit * rate.signum() } else { rate });
        }),
        right: &[
            &["spikes_wx"],
            &["wx", "overflow"],
            &["wx", "wrap"],
            &["wx", "spike"],
            &["wx", "leap"],
            &["wx", "jump"],
            &["wx", "far outside"],
        ],
    },
    // Timing.
    Corruption {
        id: "position_late",
        kind: Kind::Timing,
        says: "the position of the satellite receiver comes 300 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&POSITION, 0.3)),
        right: &[
            &["position", " late"],
            &["position", "delay"],
            &["position", " lag"],
            &["`x`", " late"],
            &["velocity", "earlier", "position"],
        ],
    },
    Corruption {
        id: "controls_jitter",
        kind: Kind::Timing,
        says: "the controls came over a busy radio link: each second they are late by another time of up to 200 ms",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let (second, longest) = (log.samples(1.0).max(1), log.samples(0.2));
            let delays: Vec<usize> = (0..=log.len() / second).map(|_| chance.below(longest + 1)).collect();
            log.take(&CONTROLS, |sample| sample.saturating_sub(delays[sample / second]));
        }),
        right: &[
            &["controls", " late"],
            &["controls", "delay"],
            &["controls", "jitter"],
            &["control_delay"],
            &["u1", " late"],
            &["u1", "delay"],
            &["u1", "jitter"],
        ],
    },
    Corruption {
        id: "attitude_interpolated",
        kind: Kind::Timing,
        says: "the attitude is a stream of 4 Hz, with straight lines drawn from value to value",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let period = log.samples(0.25).max(1);
            for column in ATTITUDE {
                let values = log.of_column(column).clone();
                let last = values.len().saturating_sub(1);
                for (sample, value) in log.of_column(column).iter_mut().enumerate() {
                    let before = sample - sample % period;
                    let (from, to) = (values[before], values[(before + period).min(last)]);
                    *value = from + (to - from) * (sample - before) as f64 / period as f64;
                }
            }
        }),
        right: &[
            &["roll", "interpol"],
            &["roll", "straight"],
            &["roll", "hz"],
            &["roll", "filter"],
            &["roll", "smooth"],
            &["roll", "slow"],
            &["attitude", "interpol"],
            &["attitude", "straight"],
            &["attitude", "hz"],
            &["attitude", "filter"],
            &["attitude", "smooth"],
            &["attitude", "slow"],
        ],
    },
    Corruption {
        id: "wz_cells_inserted",
        kind: Kind::Timing,
        says: "cells were inserted in a spreadsheet: from the middle of the flight on the yaw rate comes 200 ms late",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let (middle, delay) = (log.len() / 2, log.samples(0.2));
            log.take(&[Column::Wz], |sample| if sample < middle { sample } else { sample.saturating_sub(delay).max(middle) });
        }),
        right: &[
            &["wz", " late"],
            &["wz", "delay"],
            &["wz", "shift"],
            &["yaw rate", " late"],
            &["rates", " late"],
            &["rates", "delay"],
            &["rates", "shift"],
        ],
    },
    Corruption {
        id: "vz_slow",
        kind: Kind::Timing,
        says: "the vertical velocity is that of a barometer, which follows with a time constant of 0.4 s",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.lag(&[Column::Vz], 0.4)),
        right: &[&["vz", " late"], &["vz", "delay"], &["vz", "filter"], &["vz", " lag"], &["vz", "slow"], &["vz", "smooth"]],
    },
    // Cells.
    Corruption {
        id: "y_decimal_point",
        kind: Kind::Cells,
        says: "a spreadsheet took the point of fifteen cells of y for that of thousands: they are 1000 times too large",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::Y, 15, 1, chance, |east| 1000.0 * east)),
        right: &[
            &["spikes_y", "!yaw"],
            &["`y`", "spike"],
            &["`y`", "far outside"],
            &["`y`", "1000"],
            &["position", "spike"],
            &["position", "far outside"],
            &["decimal"],
        ],
    },
    Corruption {
        id: "packets_overtaken",
        kind: Kind::Cells,
        says: "packets of five rows were written as they came: one in ten pairs stands in the wrong order",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let mut order: Vec<usize> = (0..log.len()).collect();
            for pair in order.chunks_exact_mut(10) {
                if chance.uniform() < 0.1 {
                    pair.rotate_left(5);
                }
            }
            log.rows(&order);
        }),
        right: &[
            &["out of order"],
            &["wrong order"],
            &["order of time"],
            &["order of the rows"],
            &["time", "backward"],
            &["rows", "exchanged"],
            &["shuffl"],
            &["step in all"],
            &["rows", "jump"],
        ],
    },
    Corruption {
        id: "parts_in_wrong_order",
        kind: Kind::Cells,
        says: "the log came in two files, which were joined the wrong way round",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let samples = log.len();
            let cut = samples / 3 + chance.below(samples / 3);
            let order: Vec<usize> = (cut..samples).chain(0..cut).collect();
            log.rows(&order);
        }),
        right: &[&["step in all"], &["jump"], &["joined"], &["merged"], &["wrong order"], &["order of time"], &["a gap"]],
    },
    Corruption {
        id: "file_padded",
        kind: Kind::Cells,
        says: "the logger went on for 10 s after the flight computer had stopped: the last row is repeated",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let last = log.len().saturating_sub(1);
            let order: Vec<usize> = (0..log.len() + log.samples(10.0)).map(|sample| sample.min(last)).collect();
            log.rows(&order);
        }),
        right: &[
            &["repeat"],
            &["freez"],
            &["frozen"],
            &["held"],
            &["padded"],
            &["rows", "same"],
            &["rows", "still"],
            &["columns", "still"],
            &["duplicate"],
        ],
    },
    Corruption {
        id: "vy_sign_lost",
        kind: Kind::Cells,
        says: "the minus signs of the velocity to starboard were lost in conversion: it is never below 0",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Vy], f64::abs)),
        right: &[
            &["vy", "sign"],
            &["vy", "negative"],
            &["vy", "positive"],
            &["vy", "absolute"],
            &["vy", "magnitude"],
            &["vy", "below 0"],
        ],
    },
    // Noise and disturbances.
    Corruption {
        id: "rates_vibration",
        kind: Kind::Noise,
        says: "the turning of the main rotor, 22 Hz, shakes the gyros: 0.1 rad/s in roll and pitch rate",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let step_s = log.step_s;
            for (column, phase) in [(Column::Wx, 0.0), (Column::Wy, 0.25)] {
                for (sample, rate) in log.of_column(column).iter_mut().enumerate() {
                    *rate += 0.1 * (TAU * (22.0 * step_s * sample as f64 + phase)).sin();
                }
            }
        }),
        right: &[
            &["wx", "vibrat"],
            &["wx", "oscillat"],
            &["wx", "periodic"],
            &["wx", "nois"],
            &["rates", "vibrat"],
            &["rates", "oscillat"],
            &["rates", "periodic"],
            &["rates", "nois", "!or noise"],
        ],
    },
    Corruption {
        id: "angular_targets_noisy",
        kind: Kind::Noise,
        says: "the angular accelerations are differences of neighbouring samples: they have noise of 2 rad/s²",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.noise(&ANGULAR, 2.0, chance)),
        right: &[&["wx_dot", "nois"], &["angular", "nois", "!or noise"], &["targets", "nois", "!or noise"]],
    },
    Corruption {
        id: "attitude_settling",
        kind: Kind::Noise,
        says: "the attitude filter was started in the air: roll and pitch begin 9° and 6° off and settle with 4 s",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let left = (-log.step_s * sample as f64 / 4.0).exp();
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let off = [9.0_f64, -6.0].map(|degrees| degrees.to_radians() * left);
                log.set_vector(ATTITUDE, sample, [roll + off[0], pitch + off[1], yaw]);
            }
        }),
        right: &[
            &["roll", "settl"],
            &["roll", "start"],
            &["roll", "converg"],
            &["roll", "drift"],
            &["roll", "offset"],
            &["attitude", "settl"],
            &["attitude", "start"],
            &["attitude", "converg"],
            &["attitude", "drift"],
            &["attitude", "offset"],
        ],
    },
    Corruption {
        id: "yaw_by_current",
        kind: Kind::Noise,
        says: "the current of the motor turns the compass: the heading is off by 0.3 rad times the collective",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let collective = log.of_column(Column::U4).clone();
            log.of_column(Column::Yaw).iter_mut().zip(collective).for_each(|(yaw, u)| *yaw += 0.3 * u);
        }),
        right: &[
            &["yaw", "disturb"],
            &["yaw", "interfer"],
            &["yaw", "compass"],
            &["yaw", "magnet"],
            &["yaw", "u4", "!rate", "!stick"],
            &["yaw", "collective", "!rate", "!stick"],
            &["heading", "disturb"],
            &["heading", "interfer"],
            &["heading", "compass"],
            &["heading", "magnet"],
            &["heading", "u4"],
            &["heading", "collective"],
        ],
    },
    Corruption {
        id: "position_single_precision",
        kind: Kind::Noise,
        says: "north went through map coordinates in single precision: it has steps of 0.5 m",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::X], |north| f64::from((NORTHING_M + north) as f32) - NORTHING_M)),
        right: &[
            &["`x`", "round"],
            &["`x`", "quanti"],
            &["`x`", "steps of"],
            &["`x`", "resolution"],
            &["position", "round"],
            &["position", "quanti"],
            &["position", "steps of"],
            &["position", "resolution"],
        ],
    },
    // Frames.
    Corruption {
        id: "euler_rates",
        kind: Kind::Frames,
        says: "the rates are those of the angles roll, pitch and yaw instead of those about the axes of the body",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, _] = log.vector(ATTITUDE, sample);
                let rates = log.vector(RATES, sample);
                log.set_vector(RATES, sample, euler_rates(roll, pitch, rates));
            }
        }),
        right: &[
            &["rates", "euler"],
            &["wx", "euler"],
            &["wz", "euler"],
            &["rates", "of the angles"],
            &["rates", "not", "body axes"],
            &["rates", "axes of the body"],
        ],
    },
    Corruption {
        id: "velocity_of_air",
        kind: Kind::Frames,
        says: "the velocity is that through the air, in a wind of 5 m/s, instead of that over ground",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| through_the_air(log, [3.0, 4.0, 0.0])),
        right: &[
            &["wind", "!window"],
            &["airspeed"],
            &["velocity", "the air", "!the aircraft", "!the airframe"],
            &["velocity", "offset"],
            &["velocity", "bias"],
            &["vx", "offset"],
            &["vx", "bias"],
        ],
    },
    Corruption {
        id: "velocity_level",
        kind: Kind::Frames,
        says: "the velocity is in level axes that turn with the heading alone, neither rolled nor pitched",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, _] = log.vector(ATTITUDE, sample);
                let velocity = log.vector(VELOCITY, sample);
                log.set_vector(VELOCITY, sample, rotate(&rotation_body_to_inertial(roll, pitch, 0.0), velocity));
            }
        }),
        right: &[
            &["velocity", "level", "axes"],
            &["velocity", "horizontal"],
            &["velocity", "axes", "!inertial", "!targets"],
            &["velocity", "frame", "!inertial", "!targets"],
        ],
    },
    Corruption {
        id: "gravity_twice",
        kind: Kind::Frames,
        says: "gravity was taken off the vertical acceleration once too often: it is 9.81 m/s² too small",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::VzDot], |acceleration| acceleration - GRAVITY_M_S2)),
        right: &[
            &["vz_dot", "gravity"],
            &["vz_dot", "9.8"],
            &["vz_dot", "offset"],
            &["vz_dot", "bias"],
            &["acceleration", "gravity"],
            &["targets", "gravity"],
        ],
    },
    Corruption {
        id: "acceleration_off_centre",
        kind: Kind::Frames,
        says: "the linear accelerations are those of a sensor 40 cm before and 15 cm below the centre of gravity",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let arm = [0.4, 0.0, 0.15];
            for sample in 0..log.len() {
                let rates = log.vector(RATES, sample);
                let (along, inwards) = (cross(log.vector(ANGULAR, sample), arm), cross(rates, cross(rates, arm)));
                let derivative = log.vector(LINEAR, sample);
                log.set_vector(LINEAR, sample, [0, 1, 2].map(|axis| derivative[axis] + along[axis] + inwards[axis]));
            }
        }),
        right: &[
            &["lever"],
            &["centre of gravity"],
            &["centre of mass"],
            &["off the centre"],
            &["acceler", "mounted"],
            &["sensor", "mounted"],
        ],
    },
];

/// Velocities less the wind, which is given in inertial axes.
fn through_the_air(log: &mut Log, wind: [f64; 3]) {
    for sample in 0..log.len() {
        let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
        let felt = rotate_back(&rotation_body_to_inertial(roll, pitch, yaw), wind);
        let velocity = log.vector(VELOCITY, sample);
        log.set_vector(VELOCITY, sample, [0, 1, 2].map(|axis| velocity[axis] - felt[axis]));
    }
}
