//! Corruptions that were written down on 2026-11-25, after those of `third` had been looked at, unseen of the checks; reported on 2026-11-26 on seeds
//! 85004 and 85005, and looked at since: they are for development now. Each differs from those of all other
//! lists in what goes wrong.

use crate::change::{ANGULAR, ATTITUDE, Change, Corruption, Kind, LINEAR, Log, POSITION, Part, RATES, VELOCITY};
use phyture::flight::attitude::{gravity_body, rotate, rotate_back, rotation_body_to_inertial};
use phyture::flight::{Column, GRAVITY_M_S2};
use phyture::sim::INERTIA_KG_M2;
use std::f64::consts::{PI, TAU};

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

/// Half of the density of air, kg/m³.
const HALF_DENSITY_KG_M3: f64 = 0.6125;

/// A count of the pitch gyro, rad/s, and the bit of its converter that is stuck, worth 0.25 rad/s.
const COUNT_RAD_S: f64 = 1.0 / 1024.0;
const STUCK_BIT: i64 = 1 << 8;

/// Those that nothing was tuned on.
pub const FOURTH: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "u3_collective_mixed",
        kind: Kind::Sticks,
        says: "the tail is recorded before the mixer that takes 0.4 times the collective off it",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let collective = log.of_column(Column::U4).clone();
            log.of_column(Column::U3).iter_mut().zip(collective).for_each(|(tail, u)| *tail += 0.4 * u);
        }),
        right: &[
            &["u3", "u4", "mix"],
            &["u3", "u4", "combin"],
            &["u3", "u4", "cross"],
            &["u3", "u4", "times u4"],
            &["u3", "u4", "follows"],
            &["u3", "u4", "contains"],
            &["u3", "u4", "correlat"],
            &["u3", "collective", "mix"],
            &["tail", "collective", "mix"],
        ],
    },
    Corruption {
        id: "u2_negative_throw",
        kind: Kind::Sticks,
        says: "the lower end point of the channel was never taught in: below 0 the longitudinal cyclic is recorded at half of its size",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::U2], |u| if u < 0.0 { 0.5 * u } else { u })),
        right: &[
            &["u2", "one side"],
            &["u2", "asymmetr"],
            &["u2", "uneven"],
            &["u2", "negative"],
            &["u2", "below 0"],
            &["u2", "nonlinear"],
            &["u2", "non-linear"],
            &["u2", "not linear"],
            &["u2", "curve"],
            &["u2", "gain"],
            &["u2", "scale"],
        ],
    },
    Corruption {
        id: "u4_backlash",
        kind: Kind::Sticks,
        says: "the potentiometer of the collective lever has a play of 0.12: it stays until the lever has gone through it",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| {
            let mut shown = log.of_column(Column::U4).first().copied().unwrap_or(0.0);
            for u in log.of_column(Column::U4) {
                shown = shown.clamp(*u - 0.06, *u + 0.06);
                *u = shown;
            }
        }),
        right: &[
            &["u4", "backlash"],
            &["u4", "hysteres"],
            &["u4", "slack"],
            &["u4", "play of"],
            &["u4", "dead"],
            &["u4", "stick", "held"],
            &["u4", "held"],
            &["u4", "repeat"],
            &["u4", "same value"],
            &["u4", " late"],
            &["u4", " lag"],
            &["u4", "delay"],
        ],
    },
    Corruption {
        id: "u3_rate_command",
        kind: Kind::Sticks,
        says: "the tail channel is the yaw rate that is asked of a heading-hold gyro, full stick 5 rad/s, 80 ms before it is there",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let rate = log.of_column(Column::Wz).clone();
            *log.of_column(Column::U3) = rate;
            log.early(&[Column::U3], 0.08);
            log.scale(&[Column::U3], 0.2);
        }),
        right: &[
            &["u3", "gyro"],
            &["u3", "heading hold"],
            &["u3", "heading-hold"],
            &["u3", "yaw rate", "!sign"],
            &["u3", "rate command"],
            &["u3", "demand"],
            &["u3", "set point"],
            &["u3", "setpoint"],
            &["u3", "wz", "follows"],
            &["u3", "wz", "copy"],
            &["u3", "wz", "same"],
            &["u3", "wz", "instead"],
            &["u3", "explains nothing"],
            &["u3", "explain nothing"],
            &["u3", "does not belong"],
            &["u3", "do not belong"],
            &["u3", "does not move"],
            &["u3", "moves nothing"],
        ],
    },
    Corruption {
        id: "cyclic_range_switched",
        kind: Kind::Sticks,
        says: "a switch on the transmitter changed the range of the recorded channels: from the middle of the flight on both cyclics have 60 % of their size",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let middle = log.len() / 2;
            for column in [Column::U1, Column::U2] {
                log.of_column(column).iter_mut().skip(middle).for_each(|u| *u *= 0.6);
            }
        }),
        right: &[
            &["u1", "gain"],
            &["u1", "scale"],
            &["u1", "dual rate"],
            &["u2", "gain"],
            &["u2", "scale"],
            &["u2", "dual rate"],
            &["controls", "gain"],
            &["controls", "scale"],
            &["cyclic", "gain"],
        ],
    },
    Corruption {
        id: "u4_throttle",
        kind: Kind::Sticks,
        says: "the throttle stands in the column of the collective: a curve that rises to both ends, 0.6 + 0.4 |u|",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::U4], |u| 0.6 + 0.4 * u.abs())),
        right: &[
            &["u4", "throttle"],
            &["u4", "curve"],
            &["u4", "absolute"],
            &["u4", "gain"],
            &["u4", "scale"],
            &["u4", "offset"],
            &["u4", "trim"],
            &["u4", "nonlinear"],
            &["u4", "non-linear"],
            &["u4", "not linear"],
            &["u4", "never below"],
        ],
    },
    // Units.
    Corruption {
        id: "angular_targets_moments",
        kind: Kind::Units,
        says: "the angular accelerations are moments in N m: each is multiplied by the moment of inertia of its axis",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            ANGULAR.into_iter().zip(INERTIA_KG_M2).for_each(|(column, inertia)| log.scale(&[column], inertia));
        }),
        right: &[
            &["moments"],
            &["torque", "units"],
            &["angular", "n m"],
            &["angular", "inertia"],
            &["angular", "scale"],
            &["angular", "gain"],
            &["angular", "factor"],
            &["angular", "units"],
            &["angular", "times"],
            &["wx_dot", "inertia"],
            &["wx_dot", "scale"],
            &["wx_dot", "gain"],
            &["wx_dot", "factor"],
            &["wx_dot", "units"],
            &["wx_dot", "times"],
        ],
    },
    Corruption {
        id: "vx_dynamic_pressure",
        kind: Kind::Units,
        says: "the root was forgotten: the forward velocity is the pressure of the pitot tube in Pa, with the sign of the velocity",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Vx], |v| HALF_DENSITY_KG_M3 * v * v.abs())),
        right: &[
            &["vx", "pressure"],
            &["vx", "square"],
            &["vx", "nonlinear"],
            &["vx", "non-linear"],
            &["vx", "not linear"],
            &["vx", "units"],
            &["vx", "scale"],
            &["vx", "gain"],
            &["vx", "times"],
            &["vx", "factor"],
        ],
    },
    Corruption {
        id: "east_without_cosine",
        kind: Kind::Units,
        says: "east was made of the longitude without the cosine of the latitude, 47.3°: it is 1.47 times too large",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.scale(&[Column::Y], 1.0 / 47.3_f64.to_radians().cos())),
        right: &[
            &["longitude"],
            &["cosine"],
            &["`y`", "scale"],
            &["`y`", "gain"],
            &["`y`", "factor"],
            &["`y`", "times"],
            &["`y`", "1.47"],
            &["`y`", "0.68"],
            &["east", "scale"],
            &["east", "times", "!at least"],
            &["position", "scale"],
            &["position", "gain"],
            &["position", "times"],
            &["position", "factor"],
            &["position", "units"],
        ],
    },
    Corruption {
        id: "attitude_units_change",
        kind: Kind::Units,
        says: "new settings came into force in flight: from the middle on the attitude is in degrees",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let middle = log.len() / 2;
            for column in ATTITUDE {
                log.of_column(column).iter_mut().skip(middle).for_each(|angle| *angle = angle.to_degrees());
            }
        }),
        right: &[
            &["attitude", "deg"],
            &["angles", "deg"],
            &["roll", "deg", "!degree of"],
            &["attitude", "units"],
            &["angles", "units"],
            &["roll", "units"],
            &["attitude", "scale"],
            &["roll", "scale"],
            &["attitude", "57"],
            &["roll", "57"],
        ],
    },
    // Timing.
    Corruption {
        id: "clock_set_right",
        kind: Kind::Timing,
        says: "the clock of attitude and velocity is slow and is set right every 5 s: they are late by a time that grows from 0 to 200 ms, again and again",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let period = log.samples(5.0).max(1);
            let from = |sample: usize| sample - ((sample % period) as f64 * 0.04).round() as usize;
            [ATTITUDE, VELOCITY].iter().for_each(|columns| log.take(columns, from));
        }),
        right: &[
            &["clock"],
            &["jitter"],
            &["attitude", "drift"],
            &["velocity", "drift"],
            &["attitude", " late", "!rates come later"],
            &["velocity", " late"],
            &["attitude", "delay"],
            &["velocity", "delay"],
            &["roll", " late"],
            &["vx", " late"],
            &["rates come earlier than the attitude"],
            &["targets come earlier than the velocity"],
        ],
    },
    Corruption {
        id: "write_gaps",
        kind: Kind::Timing,
        says: "while the card is written, twice a second, 50 to 110 ms of rows are lost, and the rows are numbered on as if nothing were missing",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let (period, least, more) = (log.samples(0.5).max(1), log.samples(0.05), log.samples(0.06));
            let lost: Vec<usize> = (0..=log.len() / period).map(|_| least + chance.below(more + 1)).collect();
            let order: Vec<usize> = (0..log.len()).filter(|sample| sample % period >= lost[sample / period]).collect();
            log.rows(&order);
        }),
        right: &[
            &["step in all"],
            &["rows", "missing"],
            &["rows", "lost"],
            &["samples", "missing"],
            &["samples", "lost"],
            &["dropped"],
            &["a gap"],
            &["gaps"],
            &["joined"],
            &["all", "jump"],
            &["time", "scale"],
            &["clock"],
            &["stamp"],
            &["step", "time", "!time constant"],
        ],
    },
    Corruption {
        id: "loop_slows_down",
        kind: Kind::Timing,
        says: "the loop of the logger takes 20 ms instead of 10 ms for 2 s out of 5 s, and the rows are stamped as if it always took 10 ms",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let (period, slow) = (log.samples(5.0).max(1), log.samples(3.0));
            let order: Vec<usize> = (0..log.len()).filter(|sample| sample % period < slow || sample.is_multiple_of(2)).collect();
            log.rows(&order);
        }),
        right: &[
            &["time", "scale"],
            &["time", "uneven"],
            &["time", "irregular"],
            &["clock"],
            &["stamp"],
            &["step", "time", "!time constant"],
            &["rows", "missing"],
            &["rows", "lost"],
            &["samples", "missing"],
            &["samples", "lost"],
            &["jitter"],
        ],
    },
    Corruption {
        id: "rates_of_two_gyros",
        kind: Kind::Timing,
        says: "the rates come by turns of two gyros, and what the second one says is 40 ms old",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let old = log.samples(0.04);
            log.take(&RATES, |sample| if sample.is_multiple_of(2) { sample } else { sample.saturating_sub(old) });
        }),
        right: &[
            &["rates", "by turns"],
            &["rates", "alternat"],
            &["rates", "two sensors"],
            &["rates", "two gyros"],
            &["rates", "every other"],
            &["rates", "every second"],
            &["rates", "jitter"],
            &["rates", "nois", "!or noise"],
            &["rates", " late"],
            &["rates", "delay"],
            &["wx", "by turns"],
            &["wx", "alternat"],
            &["wx", "every other"],
            &["wx", "every second"],
            &["wx", "nois"],
            &["wx", "periodic"],
            &["wx", "oscillat"],
            &["wx", " late"],
        ],
    },
    Corruption {
        id: "angular_targets_stutter",
        kind: Kind::Timing,
        says: "the angular accelerations are differences of rates that come at 20 Hz and are repeated: 0 in four rows of five, and the whole change in the fifth",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let (period, step_s) = (log.samples(0.05).max(1), log.step_s);
            for (rate, derivative) in RATES.into_iter().zip(ANGULAR) {
                let rates = log.of_column(rate).clone();
                let change = |sample: usize| (rates[sample] - rates[sample.saturating_sub(period)]) / step_s;
                let stutters = (0..rates.len()).map(|sample| if sample.is_multiple_of(period) { change(sample) } else { 0.0 });
                *log.of_column(derivative) = stutters.collect();
            }
        }),
        right: &[
            &["angular", "hz"],
            &["angular", "repeat"],
            &["angular", "held"],
            &["angular", "zero"],
            &["angular", "are 0"],
            &["angular", "spike"],
            &["angular", "stutter"],
            &["angular", "nois", "!or noise"],
            &["angular", "differen", "rates", "held"],
            &["wx_dot", "hz"],
            &["wx_dot", "repeat"],
            &["wx_dot", "held"],
            &["wx_dot", "zero"],
            &["wx_dot", "are 0"],
            &["wx_dot", "spike"],
            &["wx_dot", "stutter"],
            &["wx_dot", "nois"],
        ],
    },
    // Cells.
    Corruption {
        id: "cells_shifted",
        kind: Kind::Cells,
        says: "in 25 rows the roll angle was left out: all that follows in the row stands one column to the left, and 0 in the last",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            for _ in 0..25 {
                let row = chance.below(log.len());
                for column in Column::Roll as usize..Column::COUNT {
                    log.columns[column][row] = log.columns.get(column + 1).map_or(0.0, |next| next[row]);
                }
            }
        }),
        right: &[
            &["rows", "shift"],
            &["rows", "columns", "left"],
            &["columns", "shift"],
            &["cells", "shift"],
            &["rows", "misaligned"],
            &["rows", "corrupt"],
            &["rows", "broken"],
            &["rows", "damaged"],
            &["rows", "spike"],
            &["spikes_"],
            &["spike"],
            &["far outside"],
        ],
    },
    Corruption {
        id: "wx_exponent_lost",
        kind: Kind::Cells,
        says: "roll rates below 0.01 rad/s were written with an exponent, which a narrow field cut off: 5.31E-03 has become 5.31",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let mantissa = |rate: f64| rate / 10.0_f64.powf(rate.abs().log10().floor());
            log.each(&[Column::Wx], |rate| if rate != 0.0 && rate.abs() < 0.01 { mantissa(rate) } else { rate });
        }),
        right: &[
            &["wx", "exponent"],
            &["spikes_wx"],
            &["wx", "spike"],
            &["wx", "leap"],
            &["wx", "jump"],
            &["wx", "outlier"],
            &["wx", "far outside"],
            &["wx", "never", "small"],
            &["roll rate", "spike"],
        ],
    },
    Corruption {
        id: "wy_bit_stuck",
        kind: Kind::Cells,
        says: "a bit of the converter of the pitch gyro is stuck: what is worth 0.25 rad/s is always set",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| {
            log.each(&[Column::Wy], |rate| ((rate / COUNT_RAD_S).round() as i64 | STUCK_BIT) as f64 * COUNT_RAD_S);
        }),
        right: &[
            &["wy", " bit "],
            &["wy", "stuck"],
            &["wy", "jump"],
            &["wy", "leap"],
            &["wy", "never between"],
            &["wy", "values are missing"],
            &["wy", "missing codes"],
            &["wy", "offset"],
            &["wy", "bias"],
            &["wy", "nonlinear"],
            &["wy", "non-linear"],
            &["spikes_wy"],
        ],
    },
    Corruption {
        id: "windows_overlap",
        kind: Kind::Cells,
        says: "windows that overlap were written out as flights: the last two thirds of a flight stand twice beside the whole of it",
        parts: ALL_OR_HALF,
        change: Change::Copies(|log, _| {
            let order: Vec<usize> = (log.len() / 3..log.len()).collect();
            log.rows(&order);
        }),
        right: &[
            &["overlap"],
            &["same numbers"],
            &["same rows"],
            &["copies"],
            &["copied"],
            &["copy of"],
            &["duplicate"],
            &["part of another flight"],
            &["same flight"],
        ],
    },
    Corruption {
        id: "targets_exchanged",
        kind: Kind::Cells,
        says: "a header put linear and angular accelerations in each other's columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| LINEAR.into_iter().zip(ANGULAR).for_each(|(linear, angular)| log.swap(linear, angular))),
        right: &[
            &["vx_dot", "wx_dot", "exchanged"],
            &["vx_dot", "wx_dot", "swapped"],
            &["vx_dot = \"wx_dot\""],
            &["linear", "angular", "exchanged"],
            &["linear", "angular", "swapped"],
            &["linear", "angular", "each other"],
            &["linear", "angular", "instead of"],
            &["targets", "exchanged"],
            &["targets", "swapped"],
        ],
    },
    // Noise and disturbances.
    Corruption {
        id: "rates_averaged",
        kind: Kind::Noise,
        says: "the rates were smoothed after the flight with a mean over 0.3 s about each sample: nothing is late, but what is quick is gone",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let reach = log.samples(0.15);
            for column in RATES {
                let rates = log.of_column(column).clone();
                for (sample, rate) in log.of_column(column).iter_mut().enumerate() {
                    let about = &rates[sample.saturating_sub(reach)..(sample + reach + 1).min(rates.len())];
                    *rate = about.iter().sum::<f64>() / about.len() as f64;
                }
            }
        }),
        right: &[
            &["rates", "smooth"],
            &["rates", "filter"],
            &["rates", "averag"],
            &["rates", "slow"],
            &["rates", "bandwidth"],
            &["rates", "hz", "!targets are"],
            &["wx", "smooth"],
            &["wx", "filter"],
            &["wx", "averag"],
            &["wx", "slow"],
            &["wx", "bandwidth"],
        ],
    },
    Corruption {
        id: "velocity_of_rounded_position",
        kind: Kind::Noise,
        says: "the velocity is differences, ten a second, of a position in steps of 5 cm: it goes in steps of 0.5 m/s",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| of_rounded_position(log)),
        right: &[
            &["velocity", "round"],
            &["velocity", "quanti"],
            &["velocity", "steps of"],
            &["velocity", "nois", "!or noise"],
            &["velocity", "hz"],
            &["velocity", "held"],
            &["velocity", "repeat"],
            &["velocity", "differen", "position"],
            &["velocity", " late"],
            &["vx", "round"],
            &["vx", "quanti"],
            &["vx", "steps of"],
            &["vx", "nois"],
            &["vx", "hz"],
            &["vx", "held"],
            &["vx", "repeat"],
            &["vx", " late"],
        ],
    },
    Corruption {
        id: "acceleration_saturated",
        kind: Kind::Noise,
        says: "the range of the accelerometers was set too small: each axis ends at 35 % of what it reaches in the flight",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for column in LINEAR {
                let largest = log.of_column(column).iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
                log.each(&[column], |value| value.clamp(-0.35 * largest, 0.35 * largest));
            }
        }),
        right: &[
            &["_dot", "saturat"],
            &["_dot", "clip"],
            &["_dot", "cut off"],
            &["_dot", "limit"],
            &["_dot", "end of its range"],
            &["_dot", "same value"],
            &["accelerat", "saturat"],
            &["accelerat", "clip"],
            &["accelerat", "cut off"],
            &["accelerat", "limit"],
            &["targets", "saturat"],
            &["targets", "clip"],
            &["targets", "cut off"],
        ],
    },
    Corruption {
        id: "wy_drift",
        kind: Kind::Noise,
        says: "the pitch gyro warms up: its offset grows from 0 by 0.01 rad/s each second",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let step_s = log.step_s;
            for (sample, rate) in log.of_column(Column::Wy).iter_mut().enumerate() {
                *rate += 0.01 * step_s * sample as f64;
            }
        }),
        right: &[
            &["wy", "drift"],
            &["wy", "trend"],
            &["wy", "grows"],
            &["wy", "offset"],
            &["wy", "bias"],
            &["rates", "drift"],
            &["rates", "offset"],
            &["rates", "bias"],
            &["pitch rate", "drift"],
            &["pitch rate", "offset"],
            &["pitch rate", "bias"],
        ],
    },
    Corruption {
        id: "velocity_dead_reckoning",
        kind: Kind::Noise,
        says: "three times the satellites were lost for 4 s: the velocity runs away by up to 2.6 m/s and leaps back",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let length = log.samples(4.0);
            for _ in 0..3 {
                let (start, direction) = (chance.below(log.len().saturating_sub(length)), TAU * chance.uniform());
                for sample in start..(start + length).min(log.len()) {
                    let off = 0.65 * log.step_s * (sample - start) as f64;
                    let [vx, vy, vz] = log.vector(VELOCITY, sample);
                    log.set_vector(VELOCITY, sample, [vx + off * direction.cos(), vy + off * direction.sin(), vz]);
                }
            }
        }),
        right: &[
            &["velocity", "jump"],
            &["velocity", "leap"],
            &["velocity", "step of"],
            &["velocity", "drift"],
            &["velocity", "reset"],
            &["velocity", "offset"],
            &["velocity", "dead reckoning"],
            &["vx", "jump"],
            &["vx", "leap"],
            &["vx", "step of"],
            &["vx", "drift"],
            &["vx", "reset"],
            &["vx", "spike"],
            &["vy", "jump"],
            &["vy", "leap"],
            &["vy", "step of"],
            &["vy", "drift"],
            &["vy", "reset"],
            &["vy", "spike"],
        ],
    },
    // Frames.
    Corruption {
        id: "attitude_other_sequence",
        kind: Kind::Frames,
        says: "the three angles are of another sequence of turns: about x first, then y, then z, where z, y, x is meant",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let [[r11, r12, r13], [_, _, r23], [_, _, r33]] = rotation_body_to_inertial(roll, pitch, yaw);
                let angles = [(-r23).atan2(r33), r13.clamp(-1.0, 1.0).asin(), (-r12).atan2(r11)];
                log.set_vector(ATTITUDE, sample, angles);
            }
        }),
        right: &[
            &["sequence"],
            &["euler", "order"],
            &["euler", "xyz"],
            &["euler", "convention"],
            &["order of the angles"],
            &["order of rotation"],
            &["attitude", "convention"],
            &["angles", "convention"],
        ],
    },
    Corruption {
        id: "gyros_tilted",
        kind: Kind::Frames,
        says: "the gyros are mounted 15° nose down: roll and yaw rate are in their axes, and so are the angular accelerations made of them",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let tilted = rotation_body_to_inertial(0.0, -15.0_f64.to_radians(), 0.0);
            for sample in 0..log.len() {
                for columns in [RATES, ANGULAR] {
                    log.set_vector(columns, sample, rotate_back(&tilted, log.vector(columns, sample)));
                }
            }
        }),
        right: &[
            &["mounted"],
            &["mounting"],
            &["misalign"],
            &["rates", "tilt"],
            &["rates", "turned"],
            &["rates", "rotated"],
            &["gyro", "tilt"],
            &["gyro", "turned"],
            &["wx", "wz", "mix"],
            &["wx", "wz", "turned"],
            &["rates", "15", "deg"],
            &["rates", "15°"],
        ],
    },
    Corruption {
        id: "rates_in_earth_axes",
        kind: Kind::Frames,
        says: "the rates are about north, east and down instead of about the axes of the body",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let rates = log.vector(RATES, sample);
                log.set_vector(RATES, sample, rotate(&rotation_body_to_inertial(roll, pitch, yaw), rates));
            }
        }),
        right: &[
            &["rates", "inertial"],
            &["rates", "earth"],
            &["rates", "world"],
            &["rates", "local axes"],
            &["rates", "not", "body axes"],
            &["rates", "axes of the body"],
            &["rates", "about north"],
            &["wx", "inertial"],
        ],
    },
    Corruption {
        id: "gravity_taken_off_level",
        kind: Kind::Frames,
        says: "gravity was taken off the accelerations as though the aircraft were level at all times",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, _] = log.vector(ATTITUDE, sample);
                let (gravity, derivative) = (gravity_body(roll, pitch), log.vector(LINEAR, sample));
                let level = [0.0, 0.0, GRAVITY_M_S2];
                log.set_vector(LINEAR, sample, [0, 1, 2].map(|axis| derivative[axis] - gravity[axis] + level[axis]));
            }
        }),
        right: &[
            &["accelerat", "gravity", "!specific force"],
            &["targets", "gravity", "!specific force"],
            &["_dot", "gravity", "!specific force"],
            &["level", "accelerat", "tilt"],
        ],
    },
    Corruption {
        id: "yaw_reset",
        kind: Kind::Frames,
        says: "the estimator took off with a heading 50° off and set it right in one step after two fifths of the flight",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let (at, off) = (2 * log.len() / 5, 50.0_f64.to_radians());
            log.of_column(Column::Yaw).iter_mut().take(at).for_each(|yaw| *yaw = (*yaw + off + PI).rem_euclid(TAU) - PI);
        }),
        right: &[
            &["yaw", "jump", "!yaw rate"],
            &["yaw", "leap", "!yaw rate"],
            &["yaw", "step of", "!yaw rate"],
            &["yaw", "reset", "!yaw rate"],
            &["yaw", "turned"],
            &["yaw", "offset", "!yaw rate"],
            &["yaw", "off by"],
            &["heading", "jump"],
            &["heading", "leap"],
            &["heading", "step of"],
            &["heading", "reset"],
            &["heading", "turned"],
            &["heading", "offset"],
            &["heading", "off by"],
            &["spikes_yaw"],
        ],
    },
];

/// The velocity as differences of a position that is rounded, turned into the body; each is kept until the next.
fn of_rounded_position(log: &mut Log) {
    const GRID_M: f64 = 0.05;
    let period = log.samples(0.1).max(1);
    let time_s = period as f64 * log.step_s;
    let last = log.len().saturating_sub(1);
    for sample in 0..log.len() {
        let at = (sample - sample % period).max(period).min(last);
        let [before, now] = [at.saturating_sub(period), at].map(|place| log.vector(POSITION, place).map(|m| (m / GRID_M).round()));
        let over_ground = [0, 1, 2].map(|axis| GRID_M * (now[axis] - before[axis]) / time_s);
        let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
        log.set_vector(VELOCITY, sample, rotate_back(&rotation_body_to_inertial(roll, pitch, yaw), over_ground));
    }
}
