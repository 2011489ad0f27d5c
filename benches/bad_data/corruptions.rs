//! Corruptions that development looks at: the half on which checks are tuned. Those that version 0.1.0 was seen to turn into sure and wrong
//! verdicts are all here. The other half stands in `second`.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, Log, POSITION, Part, RATES, VELOCITY};
use phyture::flight::attitude::{cross, gravity_body, rotate, rotation_body_to_inertial};
use phyture::flight::{Column, GRAVITY_M_S2};
use std::f64::consts::FRAC_PI_2;

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

const FOOT_M: f64 = 0.3048;

/// The half that development runs.
pub const DEVELOPMENT: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "u1_u2_exchanged",
        kind: Kind::Sticks,
        says: "the two cyclic sticks stand in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.swap(Column::U1, Column::U2)),
        right: &[&["exchanged", "u1", "u2"], &["stick_order", "u1", "u2"]],
    },
    Corruption {
        id: "u1_u3_exchanged",
        kind: Kind::Sticks,
        says: "lateral cyclic and tail stand in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.swap(Column::U1, Column::U3)),
        right: &[&["exchanged", "u1", "u3"], &["stick_order", "u1", "u3"]],
    },
    Corruption {
        id: "u3_u4_exchanged",
        kind: Kind::Sticks,
        says: "tail and collective stand in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.swap(Column::U3, Column::U4)),
        right: &[&["exchanged", "u3", "u4"], &["stick_order", "u3", "u4"]],
    },
    Corruption {
        id: "u1_reversed",
        kind: Kind::Sticks,
        says: "the lateral cyclic has the other sign",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::U1], -1.0)),
        right: &[&["u1", "sign"], &["u1", "revers"]],
    },
    Corruption {
        id: "controls_zero",
        kind: Kind::Sticks,
        says: "no control was recorded: all are 0",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&CONTROLS, 0.0)),
        right: &[&["u1", "still"], &["controls", "still"], &["u1", "not recorded"], &["controls", "zero"], &["u1", "frozen"]],
    },
    Corruption {
        id: "sticks_percent",
        kind: Kind::Sticks,
        says: "controls are in per cent",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&CONTROLS, 100.0)),
        right: &[&["controls = \"%\""], &["per cent"], &["u1", "units"], &["u1", "times the gain"]],
    },
    Corruption {
        id: "u4_gain_half",
        kind: Kind::Sticks,
        says: "the collective is recorded at half of its size",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::U4], 0.5)),
        right: &[&["u4", "gain"], &["u4", "scale"]],
    },
    // Units.
    Corruption {
        id: "flight_feet",
        kind: Kind::Units,
        says: "positions, velocities and accelerations are in feet",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            [POSITION, VELOCITY, LINEAR].iter().for_each(|columns| log.scale(columns, 1.0 / FOOT_M));
        }),
        right: &[&["feet"], &["\"ft"], &["ft/s"]],
    },
    Corruption {
        id: "attitude_degrees",
        kind: Kind::Units,
        says: "the attitude is in degrees",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&ATTITUDE, 180.0 / std::f64::consts::PI)),
        right: &[&["angles", "degrees"], &["angles = \"deg\""], &["attitude", "degrees"]],
    },
    Corruption {
        id: "acceleration_g",
        kind: Kind::Units,
        says: "the linear accelerations are in g",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&LINEAR, 1.0 / GRAVITY_M_S2)),
        right: &[&["in units of g"], &["acceleration = \"g\""]],
    },
    Corruption {
        id: "angular_targets_degrees",
        kind: Kind::Units,
        says: "the angular accelerations are in degrees",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&ANGULAR, 180.0 / std::f64::consts::PI)),
        right: &[&["angular", "degrees"], &["deg/s^2"]],
    },
    Corruption {
        id: "velocity_scaled",
        kind: Kind::Units,
        says: "the velocity is 10 % too large",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&VELOCITY, 1.1)),
        right: &[&["velocity", "1.1"], &["velocity", "0.91"], &["velocity", "scale"], &["velocity", "gain"], &["vx", "gain"]],
    },
    // Timing.
    Corruption {
        id: "angular_targets_late",
        kind: Kind::Timing,
        says: "the angular accelerations come 50 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&ANGULAR, 0.05)),
        right: &[&["angular targets", " late"], &["wx_dot", " late"], &["rates come earlier than the angular"]],
    },
    Corruption {
        id: "controls_late",
        kind: Kind::Timing,
        says: "the controls come 100 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&CONTROLS, 0.1)),
        right: &[&["controls", " late"], &["control_delay"], &["controls", "after they act"], &["u1", " late"]],
    },
    Corruption {
        id: "attitude_late",
        kind: Kind::Timing,
        says: "the attitude comes 60 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&ATTITUDE, 0.06)),
        right: &[&["rates come earlier than the attitude"], &["attitude", " late", "!rates come later"], &["roll", " late"]],
    },
    Corruption {
        id: "u4_late",
        kind: Kind::Timing,
        says: "the collective alone comes 80 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&[Column::U4], 0.08)),
        right: &[&["u4", " late"], &["u4", "delay"]],
    },
    Corruption {
        id: "velocity_held",
        kind: Kind::Timing,
        says: "the velocity is a stream of 5 Hz, each value repeated to 100 Hz",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.held(&VELOCITY, 0.2)),
        right: &[
            &["velocity", "hz"],
            &["vx", "hz"],
            &["velocity", "held"],
            &["vx", "held"],
            &["vx", "repeat"],
            &["velocity", "repeat"],
        ],
    },
    Corruption {
        id: "clock_drift",
        kind: Kind::Timing,
        says: "the clock of the controls runs 0.5 % fast",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.take(&CONTROLS, |sample| (1.005 * sample as f64).round() as usize)),
        right: &[&["clock"], &["drift"], &["controls", "earl"], &["controls", " late"], &["control_delay"]],
    },
    // Cells.
    Corruption {
        id: "u4_cells_30",
        kind: Kind::Cells,
        says: "seven cells of u4 are 30",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::U4, 7, 1, chance, |_| 30.0)),
        right: &[&["spikes_u4"], &["u4", "spike"], &["u4", "far outside"]],
    },
    Corruption {
        id: "u4_cell_million",
        kind: Kind::Cells,
        says: "one cell of u4 is 10⁶",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::U4, 1, 1, chance, |_| 1e6)),
        right: &[&["spikes_u4"], &["u4", "spike"], &["u4", "far outside"]],
    },
    Corruption {
        id: "flights_copied",
        kind: Kind::Cells,
        says: "flights are there three times, under other names",
        parts: ALL_OR_HALF,
        change: Change::Copies(|_, _| {}),
        right: &[&["same numbers"], &["copies"], &["copied"], &["copy of"], &["duplicate"]],
    },
    Corruption {
        id: "position_frozen",
        kind: Kind::Cells,
        says: "the position keeps its first value",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.take(&POSITION, |_| 0)),
        right: &[&["position", "still"], &["position", "frozen"], &["position", "constant"], &["`x`", "still"], &["x", "frozen"]],
    },
    Corruption {
        id: "rate_constant",
        kind: Kind::Cells,
        says: "the pitch rate is 0.05 rad/s throughout",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Wy], |_| 0.05)),
        right: &[&["wy", "still"], &["wy", "constant"], &["wy", "frozen"], &["wy", "freez"]],
    },
    Corruption {
        id: "rate_spikes",
        kind: Kind::Cells,
        says: "five times the pitch rate is 30 rad/s for three samples",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::Wy, 5, 3, chance, |_| 30.0)),
        right: &[&["spikes_wy"], &["wy", "spike"], &["wy", "far outside"]],
    },
    Corruption {
        id: "position_jump",
        kind: Kind::Cells,
        says: "the position jumps by 5 m to the north in mid flight, as when the receiver starts anew",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let at = chance.below(log.len());
            log.of_column(Column::X).iter_mut().skip(at).for_each(|x| *x += 5.0);
        }),
        right: &[&["position", "jump"], &["`x`", "jump"], &["x jumps"], &["position", "step of"]],
    },
    // Noise and quantisation.
    Corruption {
        id: "controls_rounded",
        kind: Kind::Noise,
        says: "the controls are rounded to 0.1",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.round(&CONTROLS, 0.1)),
        right: &[&["u1", "round"], &["u1", "quanti"], &["controls", "round"], &["controls", "quanti"], &["u1", "steps of"]],
    },
    Corruption {
        id: "rates_rounded",
        kind: Kind::Noise,
        says: "the rates are rounded to 0.1 rad/s",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.round(&RATES, 0.1)),
        right: &[&["wx", "round"], &["wx", "quanti"], &["rates", "round"], &["rates", "quanti"], &["wx", "steps of"]],
    },
    Corruption {
        id: "rates_noisy",
        kind: Kind::Noise,
        says: "the rates have noise of 0.1 rad/s, ten times what they have elsewhere",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.noise(&RATES, 0.1, chance)),
        right: &[&["wx", "nois"], &["rates", "nois", "!or noise"]],
    },
    // Frames.
    Corruption {
        id: "east_north_up",
        kind: Kind::Frames,
        says: "axes are east-north-up, and nose-port-up in the body",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| east_north_up(log)),
        right: &[&["enu/flu"], &["east-north-up"]],
    },
    Corruption {
        id: "inertial_velocity",
        kind: Kind::Frames,
        says: "the velocity is written in inertial axes",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let velocity = log.vector(VELOCITY, sample);
                log.set_vector(VELOCITY, sample, rotate(&rotation_body_to_inertial(roll, pitch, yaw), velocity));
            }
        }),
        right: &[&["velocity", "in inertial axes", "!targets"]],
    },
    Corruption {
        id: "specific_force",
        kind: Kind::Frames,
        says: "the linear accelerations are specific force, as an accelerometer measures it",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, _] = log.vector(ATTITUDE, sample);
                let turning = cross(log.vector(RATES, sample), log.vector(VELOCITY, sample));
                let (gravity, derivative) = (gravity_body(roll, pitch), log.vector(LINEAR, sample));
                log.set_vector(LINEAR, sample, [0, 1, 2].map(|axis| derivative[axis] + turning[axis] - gravity[axis]));
            }
        }),
        right: &[&["specific force"], &["specific_force"]],
    },
    Corruption {
        id: "wz_reversed",
        kind: Kind::Frames,
        says: "the yaw rate has the other sign",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::Wz], -1.0)),
        right: &[&["wz = \"-wz\"", "!wx = ", "!wy = "], &["yaw rate", "sign"], &["wz", "sign", "!wx", "!wy"]],
    },
    Corruption {
        id: "roll_pitch_exchanged",
        kind: Kind::Frames,
        says: "roll and pitch stand in each other's columns",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.swap(Column::Roll, Column::Pitch)),
        right: &[&["roll", "pitch", "exchanged"], &["roll = \"pitch\""]],
    },
];

/// From north-east-down and nose-starboard-down.
fn east_north_up(log: &mut Log) {
    log.swap(Column::X, Column::Y);
    log.scale(&[Column::Z, Column::Pitch], -1.0);
    log.each(&[Column::Yaw], |yaw| FRAC_PI_2 - yaw);
    for columns in [VELOCITY, RATES, LINEAR, ANGULAR] {
        log.scale(&columns[1..], -1.0);
    }
}
