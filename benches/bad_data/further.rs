//! Corruptions of a second round of development: written once the first half had been tuned on, to see how far the checks carry beyond it, and
//! tuned on since. The reserved half was not looked at when they were written.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, Part, RATES, VELOCITY};
use phyture::flight::Column;
use phyture::flight::attitude::cross;

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

const FOOT_M: f64 = 0.3048;

/// The second round.
pub const FURTHER: &[Corruption] = &[
    Corruption {
        id: "u1_clipped",
        kind: Kind::Sticks,
        says: "the lateral cyclic is cut off at ±0.15",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::U1], |value| value.clamp(-0.15, 0.15))),
        right: &[&["u1", "clip"], &["u1", "cut off"], &["u1", "satur"], &["u1", "limit"]],
    },
    Corruption {
        id: "u2_still",
        kind: Kind::Sticks,
        says: "the longitudinal cyclic was not recorded: it keeps its first value",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.take(&[Column::U2], |_| 0)),
        right: &[&["u2", "still"], &["u2", "frozen"], &["u2", "not recorded"]],
    },
    Corruption {
        id: "controls_of_another_time",
        kind: Kind::Sticks,
        says: "the controls are of another part of the flight: 8 s late",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.late(&CONTROLS, 8.0)),
        right: &[
            &["controls", " late"],
            &["sticks", "explain nothing"],
            &["sticks", "do not belong"],
            &["controls", "do not belong"],
        ],
    },
    Corruption {
        id: "u3_noisy",
        kind: Kind::Noise,
        says: "the tail stick has noise of 0.1",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| log.noise(&[Column::U3], 0.1, chance)),
        right: &[&["u3", "nois"]],
    },
    Corruption {
        id: "rates_exchanged",
        kind: Kind::Frames,
        says: "roll rate and pitch rate stand in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.swap(Column::Wx, Column::Wy)),
        right: &[&["wx = \"wy\""], &["wx", "wy", "exchanged"], &["rates", "exchanged"]],
    },
    Corruption {
        id: "compass_turned",
        kind: Kind::Frames,
        says: "the heading is 30° off",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::Yaw], |yaw| yaw + 30.0_f64.to_radians())),
        right: &[&["heading", "30"], &["yaw", "30"], &["heading", "turned"], &["yaw", "off"], &["yaw", "turned"]],
    },
    Corruption {
        id: "roll_offset",
        kind: Kind::Frames,
        says: "the roll angle is 6° too large",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Roll], |roll| roll + 6.0_f64.to_radians())),
        right: &[&["roll", "offset"], &["attitude", "offset"], &["roll", "deg"], &["attitude", "turned"], &["roll", "off by"]],
    },
    Corruption {
        id: "vz_up",
        kind: Kind::Frames,
        says: "the vertical velocity has the other sign",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::Vz], -1.0)),
        right: &[&["vz = \"-vz\""], &["vz", "sign"]],
    },
    Corruption {
        id: "acceleration_of_inertial_axes",
        kind: Kind::Frames,
        says: "the linear accelerations are those of the velocity in inertial axes, turned into the body",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let turning = cross(log.vector(RATES, sample), log.vector(VELOCITY, sample));
                let derivative = log.vector(LINEAR, sample);
                log.set_vector(LINEAR, sample, [0, 1, 2].map(|axis| derivative[axis] + turning[axis]));
            }
        }),
        right: &[&["coriolis"], &["inertial_derivative"], &["targets", "inertial"], &["w x v"]],
    },
    Corruption {
        id: "vx_feet",
        kind: Kind::Units,
        says: "the forward velocity alone is in ft/s",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::Vx], 1.0 / FOOT_M)),
        right: &[&["vx", "feet"], &["vx", "ft"], &["vx", "scale"], &["vx", "3.28"], &["vx", "times"]],
    },
    Corruption {
        id: "wy_degrees",
        kind: Kind::Units,
        says: "the pitch rate alone is in degrees a second",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::Wy], 180.0 / std::f64::consts::PI)),
        right: &[&["wy", "deg"], &["wy", "scale"], &["wy", "57"]],
    },
    Corruption {
        id: "half_the_rate",
        kind: Kind::Timing,
        says: "the log was written at 50 Hz and stamped at 100 Hz",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let order: Vec<usize> = (0..log.len()).step_by(2).collect();
            log.rows(&order);
        }),
        right: &[&["time", "scale"], &["clock"], &["stamp"], &["time", "2.0"], &["step", "time"]],
    },
    Corruption {
        id: "dropouts",
        kind: Kind::Cells,
        says: "ten times all measurements keep their values for half a second",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let length = log.samples(0.5);
            for _ in 0..10 {
                let start = chance.below(log.len());
                let hold = |sample: usize| if (start..start + length).contains(&sample) { start } else { sample };
                [ATTITUDE, VELOCITY, RATES, LINEAR, ANGULAR].iter().for_each(|columns| log.take(columns, hold));
            }
        }),
        right: &[&["freez"], &["frozen"], &["held"], &["dropout"], &["dropped"], &["repeat"]],
    },
    Corruption {
        id: "targets_slow",
        kind: Kind::Timing,
        says: "all accelerations went through a filter of 60 ms",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| [LINEAR, ANGULAR].iter().for_each(|columns| log.lag(columns, 0.06))),
        right: &[&["targets", " late"], &["targets", "filter"], &["acceleration", " late"]],
    },
    Corruption {
        id: "acceleration_spikes",
        kind: Kind::Cells,
        says: "five cells of vx_dot are 200 m/s²",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::VxDot, 5, 1, chance, |_| 200.0)),
        right: &[&["vx_dot", "spike"], &["vx_dot", "far outside"]],
    },
    Corruption {
        id: "rate_offset",
        kind: Kind::Noise,
        says: "the roll rate has an offset of 0.2 rad/s",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Wx], |rate| rate + 0.2)),
        right: &[&["wx", "offset"], &["wx", "bias"], &["rates", "offset"], &["rates", "bias"]],
    },
];
