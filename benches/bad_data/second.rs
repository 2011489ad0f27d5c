//! Corruptions that were written down before checks were tuned on this benchmark, reported on 2026-11-24 on seeds 83000 to 83005, and looked at
//! since: they are for development now.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, POSITION, Part, RATES, VELOCITY};
use phyture::flight::Column;

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

/// Reserved once.
pub const SECOND: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "u2_u4_exchanged",
        kind: Kind::Sticks,
        says: "longitudinal cyclic and collective stand in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.swap(Column::U2, Column::U4)),
        right: &[&["exchanged", "u2", "u4"], &["stick_order", "u2", "u4"]],
    },
    Corruption {
        id: "sticks_cycled",
        kind: Kind::Sticks,
        says: "u1, u2 and u3 stand one column further on each",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            log.swap(Column::U1, Column::U2);
            log.swap(Column::U1, Column::U3);
        }),
        right: &[&["exchanged", "u1", "u2", "u3"], &["stick_order", "u1", "u2", "u3"]],
    },
    Corruption {
        id: "u3_reversed",
        kind: Kind::Sticks,
        says: "the tail stick has the other sign",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::U3], -1.0)),
        right: &[&["u3", "sign"], &["u3", "revers"]],
    },
    Corruption {
        id: "sticks_pulses",
        kind: Kind::Sticks,
        says: "controls are pulses in microseconds, 1500 + 500 u",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&CONTROLS, |u| 1500.0 + 500.0 * u)),
        right: &[&["pulses"], &["1500"], &["pwm"], &["u1", "units"], &["u1", "times the gain"]],
    },
    Corruption {
        id: "u2_frozen",
        kind: Kind::Sticks,
        says: "u2 keeps its value from the middle of the flight on",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let middle = log.len() / 2;
            log.take(&[Column::U2], |sample| sample.min(middle));
        }),
        right: &[&["u2", "still"], &["u2", "frozen"], &["u2", "freez"], &["u2", "not recorded"], &["u2", "constant"]],
    },
    Corruption {
        id: "u1_saturated",
        kind: Kind::Sticks,
        says: "u1 is cut off at half of what it reaches in the flight",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let largest = log.of_column(Column::U1).iter().fold(0.0_f64, |largest, u| largest.max(u.abs()));
            log.each(&[Column::U1], |u| u.clamp(-0.5 * largest, 0.5 * largest));
        }),
        right: &[&["u1", "saturat"], &["u1", "limit"], &["u1", "cut off"], &["u1", "clip"], &["u1", "stop"]],
    },
    Corruption {
        id: "u2_trimmed",
        kind: Kind::Sticks,
        says: "u2 is recorded with a trim of 0.2",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::U2], |u| u + 0.2)),
        right: &[&["u2", "trim"], &["u2", "offset"], &["u2", "bias"], &["u2", "shifted"]],
    },
    // Units.
    Corruption {
        id: "rates_degrees",
        kind: Kind::Units,
        says: "the rates are in degrees a second",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&RATES, 180.0 / std::f64::consts::PI)),
        right: &[&["rates", "degrees"], &["rates = \"deg/s\""]],
    },
    Corruption {
        id: "velocity_knots",
        kind: Kind::Units,
        says: "the velocity is in knots",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&VELOCITY, 3600.0 / 1852.0)),
        right: &[&["knots"], &["velocity = \"kt\""]],
    },
    Corruption {
        id: "position_cm",
        kind: Kind::Units,
        says: "the position is in centimetres",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&POSITION, 100.0)),
        right: &[&["position", "cm"], &["position", "centimetre"]],
    },
    Corruption {
        id: "rates_scaled",
        kind: Kind::Units,
        says: "the gyros show 5 % too much",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&RATES, 1.05)),
        right: &[
            &["rates", "1.05"],
            &["rates", "0.95"],
            &["rates", "scale"],
            &["rates", "gain"],
            &["wx", "scale"],
            &["wx", "gain"],
        ],
    },
    Corruption {
        id: "yaw_degrees",
        kind: Kind::Units,
        says: "the heading is in degrees from 0 to 360, roll and pitch are in radians",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Yaw], |yaw| yaw.to_degrees().rem_euclid(360.0))),
        right: &[&["yaw", "degrees"], &["yaw = \"deg\""], &["heading", "degrees"]],
    },
    // Timing.
    Corruption {
        id: "linear_targets_late",
        kind: Kind::Timing,
        says: "the linear accelerations come 50 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&LINEAR, 0.05)),
        right: &[&["targets", " late", "!angular"], &["vx_dot", " late"]],
    },
    Corruption {
        id: "velocity_late",
        kind: Kind::Timing,
        says: "the velocity comes 80 ms late",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.late(&VELOCITY, 0.08)),
        right: &[&["velocity", " late"], &["targets come earlier than the velocity", "!angular"]],
    },
    Corruption {
        id: "rates_early",
        kind: Kind::Timing,
        says: "the rates come 40 ms early",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.early(&RATES, 0.04)),
        right: &[&["rates", "earl"], &["angular targets come later than the rates"]],
    },
    Corruption {
        id: "controls_early",
        kind: Kind::Timing,
        says: "the controls come 60 ms early",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.early(&CONTROLS, 0.06)),
        right: &[&["controls", "earl"], &["control_delay"], &["u1", "earl"]],
    },
    Corruption {
        id: "controls_held",
        kind: Kind::Timing,
        says: "the controls are a stream of 10 Hz, each value repeated to 100 Hz",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.held(&CONTROLS, 0.1)),
        right: &[
            &["u1", "hz"],
            &["controls", "hz"],
            &["u1", "held"],
            &["controls", "held"],
            &["u1", "repeat"],
            &["controls", "repeat"],
        ],
    },
    Corruption {
        id: "time_reversed",
        kind: Kind::Timing,
        says: "the rows stand in the order of falling time",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let order: Vec<usize> = (0..log.len()).rev().collect();
            log.rows(&order);
        }),
        right: &[&["time", "revers"], &["time", "backward"], &["rows", "revers"], &["order of time"]],
    },
    // Cells.
    Corruption {
        id: "attitude_spikes",
        kind: Kind::Cells,
        says: "five times roll leaps by 2 rad for two samples",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::Roll, 5, 2, chance, |roll| roll + 2.0)),
        right: &[&["spikes_roll"], &["roll", "spike"], &["roll", "far outside"], &["roll", "leap"]],
    },
    Corruption {
        id: "target_spikes",
        kind: Kind::Cells,
        says: "ten cells of vz_dot are 200 m/s²",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::VzDot, 10, 1, chance, |_| 200.0)),
        right: &[&["spikes_vz_dot"], &["vz_dot", "spike"], &["vz_dot", "far outside"]],
    },
    Corruption {
        id: "u2_sentinel",
        kind: Kind::Cells,
        says: "where u2 was not received, three times for 0.4 s, it is -999",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.cells(Column::U2, 3, 40, chance, |_| -999.0)),
        right: &[&["spikes_u2"], &["u2", "-999"], &["u2", "sentinel"], &["u2", "far outside"], &["u2", "cells"]],
    },
    Corruption {
        id: "rows_repeated",
        kind: Kind::Cells,
        says: "a buffer of one second was written twice, three times in the flight",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let second = log.samples(1.0);
            for _ in 0..3 {
                let end = second + chance.below(log.len().saturating_sub(2 * second));
                let order: Vec<usize> = (0..end).chain(end - second..log.len() - second).collect();
                log.rows(&order);
            }
        }),
        right: &[&["rows", "twice"], &["rows", "repeat"], &["rows", "duplicate"], &["samples", "repeat"], &["samples", "twice"]],
    },
    Corruption {
        id: "samples_dropped",
        kind: Kind::Cells,
        says: "every tenth sample of all states, by chance, was lost and holds the one before",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let mut last = 0;
            let kept: Vec<usize> = (0..log.len())
                .map(|sample| {
                    if sample == 0 || chance.uniform() > 0.1 {
                        last = sample;
                    }
                    last
                })
                .collect();
            log.take(Column::STATE, |sample| kept.get(sample).copied().unwrap_or(sample));
        }),
        right: &[&["dropped"], &["lost"], &["held", "samples"], &["repeat", "samples"], &["repeat", "rows"]],
    },
    Corruption {
        id: "piece_missing",
        kind: Kind::Cells,
        says: "two parts of the flight stand side by side as if nothing lay between",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let samples = log.len();
            let order: Vec<usize> = (0..2 * samples / 5).chain(3 * samples / 5..samples).collect();
            log.rows(&order);
        }),
        right: &[&["step in all"], &["piece", "missing"], &["rows", "missing"], &["jump"], &["joined"], &["a gap"]],
    },
    Corruption {
        id: "copies_rounded",
        kind: Kind::Cells,
        says: "flights are there three times under other names, twice rounded to four digits after the point",
        parts: ALL_OR_HALF,
        change: Change::Copies(|log, _| log.round(&Column::ALL, 1e-4)),
        right: &[&["same numbers"], &["copies"], &["copied"], &["copy of"], &["duplicate"], &["same flight"]],
    },
    // Noise and quantisation.
    Corruption {
        id: "attitude_rounded",
        kind: Kind::Noise,
        says: "the attitude is in whole degrees",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.round(&ATTITUDE, std::f64::consts::PI / 180.0)),
        right: &[&["roll", "round"], &["roll", "quanti"], &["attitude", "round"], &["attitude", "quanti"], &["roll", "steps of"]],
    },
    Corruption {
        id: "targets_filtered",
        kind: Kind::Noise,
        says: "the accelerations went through a filter of first order of 0.1 s",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            log.lag(&LINEAR, 0.1);
            log.lag(&ANGULAR, 0.1);
        }),
        right: &[
            &["targets", "filter"],
            &["accelerations", "filter"],
            &["targets", " late"],
            &["vx_dot", "filter"],
            &["wx_dot", "filter"],
        ],
    },
    Corruption {
        id: "velocity_noisy",
        kind: Kind::Noise,
        says: "the velocity has noise of 0.3 m/s, ten times and more what it has elsewhere",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| log.noise(&VELOCITY, 0.3, chance)),
        right: &[&["vx", "nois"], &["velocity", "nois", "!or noise"]],
    },
    // Frames.
    Corruption {
        id: "vy_reversed",
        kind: Kind::Frames,
        says: "the velocity to starboard has the other sign",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::Vy], -1.0)),
        right: &[&["vy = \"-vy\"", "!vz = ", "!vx = "], &["vy", "sign", "!vz", "!vx"]],
    },
    Corruption {
        id: "pitch_reversed",
        kind: Kind::Frames,
        says: "pitch has the other sign",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.scale(&[Column::Pitch], -1.0)),
        right: &[&["pitch has the other sign", "!roll"], &["pitch = \"-pitch\"", "!roll"]],
    },
    Corruption {
        id: "z_height",
        kind: Kind::Frames,
        says: "z is height",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&[Column::Z], -1.0)),
        right: &[&["z is height"], &["z = \"-z\"", "!y = "]],
    },
    Corruption {
        id: "vx_vy_exchanged",
        kind: Kind::Frames,
        says: "vx and vy stand in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.swap(Column::Vx, Column::Vy)),
        right: &[&["vx", "vy", "exchanged"], &["vx = \"vy\""]],
    },
    Corruption {
        id: "wx_wy_exchanged",
        kind: Kind::Frames,
        says: "wx and wy stand in each other's columns",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.swap(Column::Wx, Column::Wy)),
        right: &[&["wx", "wy", "exchanged"], &["wx = \"wy\""], &["roll rate", "pitch rate", "exchanged"]],
    },
];
