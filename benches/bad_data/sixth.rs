//! Corruptions that were written down on 2026-11-27, after those of `fifth` had been looked at, unseen of the checks, reported once, on seeds
//! 85008 and 85009, and looked at since: they are for development now. Each differs from those of all other
//! lists in what goes wrong.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, Log, POSITION, Part, RATES, VELOCITY};
use phyture::flight::Column;
use phyture::flight::attitude::{
    euler_to_quaternion, rotate, rotate_back, rotation_body_to_inertial, rotation_to_euler, rotation_vector,
};
use std::f64::consts::{PI, TAU};

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

/// A count of a gyro of 16 bits that reaches 2000 °/s, rad/s.
const COUNT_RAD_S: f64 = 2000.0 / 32768.0 * PI / 180.0;

/// Those that nothing was tuned on.
pub const SIXTH: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "u2_worn_track",
        kind: Kind::Sticks,
        says: "the potentiometer of the longitudinal cyclic is worn through where it rests most: within 0.006 of its mean it falls to the lower end, -1",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let worn = mean(log.of_column(Column::U2));
            log.each(&[Column::U2], |u| if (u - worn).abs() < 0.006 { -1.0 } else { u });
        }),
        right: &[
            &["spikes_u2"],
            &["u2", "spike"],
            &["u2", "far outside"],
            &["u2", "outlier"],
            &["u2", "jump"],
            &["u2", "leap"],
            &["u2", "potentiometer"],
            &["u2", "dropout"],
            &["u2", "glitch"],
            &["u2", "worn"],
            &["u2", "falls to"],
            &["u2", "-1", "same value"],
        ],
    },
    Corruption {
        id: "u1_sweep_not_recorded",
        kind: Kind::Sticks,
        says: "the computer adds a sweep of 0.3 to 3 Hz, 0.08 high, to the lateral cyclic behind the point at which the stick is recorded",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let (sweep_s, step_s) = (20.0, log.step_s);
            for (sample, u) in log.of_column(Column::U1).iter_mut().enumerate() {
                let time_s = (step_s * sample as f64) % sweep_s;
                *u -= 0.08 * (TAU * time_s * (0.3 + 0.5 * 2.7 * time_s / sweep_s)).sin();
            }
        }),
        right: &[
            &["u1", "sweep"],
            &["u1", "chirp"],
            &["u1", "excitation"],
            &["u1", "injected"],
            &["u1", "added to"],
            &["u1", "oscillat"],
            &["u1", "periodic"],
            &["u1", "nois"],
            &["u1", "explain nothing"],
            &["u1", "explains nothing"],
            &["u1", "moves nothing"],
            &["u1", "does not belong"],
        ],
    },
    Corruption {
        id: "u3_without_integral",
        kind: Kind::Sticks,
        says: "of what the tail's controller puts out the proportional part alone is recorded: the integral, which follows with 2 s, is missing",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let whole = log.of_column(Column::U3).clone();
            log.lag(&[Column::U3], 2.0);
            log.of_column(Column::U3).iter_mut().zip(whole).for_each(|(slow, u)| *slow = u - *slow);
        }),
        right: &[
            &["u3", "integral"],
            &["u3", "i-term"],
            &["u3", "high-pass"],
            &["u3", "high pass"],
            &["u3", "highpass"],
            &["u3", "washout"],
            &["u3", "slow part"],
            &["u3", "low frequenc"],
            &["u3", "drift"],
            &["u3", "trim"],
            &["u3", "offset"],
            &["u3", "returns to"],
            &["u3", "filter"],
            &["u3", " earl"],
        ],
    },
    Corruption {
        id: "sticks_ranged_as_they_go",
        kind: Kind::Sticks,
        says: "a joystick's driver teaches itself the range in flight: each control is divided by the largest that it has shown so far, 0.2 at first",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for column in CONTROLS {
                let mut largest = 0.2_f64;
                for u in log.of_column(column) {
                    largest = largest.max(u.abs());
                    *u /= largest;
                }
            }
        }),
        right: &[
            &["controls", "gain"],
            &["controls", "scale"],
            &["controls", "factor"],
            &["controls", "normalis"],
            &["controls", "normaliz"],
            &["controls", "calibrat", "joystick"],
            &["controls", "units"],
            &["u1", "gain"],
            &["u1", "scale"],
            &["u1", "factor"],
            &["u1", "normalis"],
            &["u1", "normaliz"],
            &["u1", "units"],
            &["u2", "gain"],
            &["u2", "scale"],
        ],
    },
    Corruption {
        id: "sticks_on_sagging_supply",
        kind: Kind::Sticks,
        says: "the potentiometers hang on the battery of the motor, which sags under the collective: all controls read up to 35 % too small",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| on_sagging_supply(log)),
        right: &[
            &["voltage"],
            &["battery"],
            &["controls", "gain"],
            &["controls", "scale"],
            &["controls", "factor"],
            &["controls", "nonlinear"],
            &["controls", "non-linear"],
            &["controls", "not linear"],
            &["u1", "gain"],
            &["u1", "scale"],
            &["u2", "gain"],
            &["u2", "scale"],
            &["u4", "gain"],
            &["u4", "scale"],
            &["u4", "nonlinear"],
            &["u4", "non-linear"],
            &["u4", "not linear"],
            &["u4", "curve"],
        ],
    },
    // Units.
    Corruption {
        id: "z_pressure",
        kind: Kind::Units,
        says: "z is what the barometer measures and not what follows from it: 953 hPa, and 0.115 hPa more for each metre downwards",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::Z], |down| 953.0 + 0.115 * down)),
        right: &[
            &["pressure"],
            &["hpa"],
            &["mbar"],
            &["`z`", "scale"],
            &["`z`", "gain"],
            &["`z`", "factor"],
            &["`z`", "times", "!at least"],
            &["`z`", "units"],
            &["position", "scale"],
            &["position", "gain"],
            &["position", "factor"],
            &["position", "times", "!at least"],
            &["position", "units"],
        ],
    },
    Corruption {
        id: "flow_of_fixed_height",
        kind: Kind::Units,
        says: "vx and vy are optical flow, an angle a second, times the height of the first row, whatever the height has become",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| flow_of_fixed_height(log)),
        right: &[
            &["optical flow"],
            &["velocity", "height"],
            &["velocity", "scale"],
            &["velocity", "gain"],
            &["velocity", "factor"],
            &["velocity", "times", "!at least"],
            &["velocity", "units"],
            &["vx", "height"],
            &["vx", "scale"],
            &["vx", "gain"],
            &["vx", "factor"],
            &["vx", "units"],
            &["vy", "scale"],
            &["vy", "gain"],
            &["vy", "factor"],
        ],
    },
    Corruption {
        id: "position_delta_coded",
        kind: Kind::Units,
        says: "to spare memory the position was stored as the change since the row before, and was not summed up again",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for column in POSITION {
                let places = log.of_column(column).clone();
                let moved = (0..places.len()).map(|sample| places[sample] - places[sample.saturating_sub(1)]);
                *log.of_column(column) = moved.collect();
            }
        }),
        right: &[
            &["position", "delta"],
            &["position", "differen"],
            &["position", "increment"],
            &["position", "per step"],
            &["position", "per row"],
            &["position", "per sample"],
            &["position", "summed"],
            &["position", "change since"],
            &["position", "does not follow"],
            &["position", "not the integral"],
            &["position", "scale"],
            &["position", "factor"],
            &["position", "times", "!at least"],
            &["position", "units"],
            &["`x`", "delta"],
            &["`x`", "differen"],
            &["`x`", "increment"],
            &["`x`", "scale"],
            &["`x`", "units"],
        ],
    },
    Corruption {
        id: "linear_targets_jerk",
        kind: Kind::Units,
        says: "a script differentiated columns that were accelerations already: the linear ones are jerk, in m/s³",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let step_s = log.step_s;
            for column in LINEAR {
                let slopes = slopes(log.of_column(column), step_s);
                *log.of_column(column) = slopes;
            }
        }),
        right: &[
            &["jerk"],
            &["m/s³"],
            &["m/s^3"],
            &["twice", "differentiat"],
            &["once too often"],
            &["derivative of the accel"],
            &["linear", "derivative", " earl"],
            &["linear", "units"],
            &["linear", "does not follow"],
            &["linear", "not the derivative"],
            &["linear", "nois", "!or noise"],
            &["accelerat", "units", "!angular"],
            &["targets", "units", "!angular"],
            &["targets", "nois", "!or noise", "!angular"],
            &["targets", "not the derivative", "!angular"],
            &["vx_dot", "nois"],
            &["vx_dot", "units"],
            &["vx_dot", "not the derivative"],
            &["vx_dot", "does not follow"],
        ],
    },
    Corruption {
        id: "velocity_detrended",
        kind: Kind::Units,
        says: "the velocity was prepared for an identification toolbox: each component less the straight line that fits it best in the flight",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for column in VELOCITY {
                let values = log.of_column(column);
                let (height, slope, middle) = line(values);
                values.iter_mut().enumerate().for_each(|(sample, v)| *v -= height + slope * (sample as f64 - middle));
            }
        }),
        right: &[
            &["detrend"],
            &["velocity", "trend"],
            &["velocity", "offset"],
            &["velocity", "bias"],
            &["velocity", "drift"],
            &["velocity", "wind", "!window"],
            &["vx", "trend"],
            &["velocity", "mean was"],
            &["vx", "offset"],
            &["vx", "bias"],
            &["vx", "drift"],
        ],
    },
    // Timing.
    Corruption {
        id: "controls_filled_with_zeros",
        kind: Kind::Timing,
        says: "the controls, a stream of 50 Hz, were joined to rows of 100 Hz, and what was empty was filled with 0: every other row",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for column in CONTROLS {
                log.of_column(column).iter_mut().skip(1).step_by(2).for_each(|u| *u = 0.0);
            }
        }),
        right: &[
            &["controls", "zero"],
            &["controls", "are 0"],
            &["controls", "every other"],
            &["controls", "every second"],
            &["controls", "by turns"],
            &["controls", "alternat"],
            &["controls", "filled"],
            &["controls", "hz"],
            &["controls", "nois", "!or noise"],
            &["controls", "jump"],
            &["controls", "leap"],
            &["u1", "zero"],
            &["u1", "are 0"],
            &["u1", "every other"],
            &["u1", "every second"],
            &["u1", "by turns"],
            &["u1", "alternat"],
            &["u1", "filled"],
            &["u1", "nois"],
            &["u4", "zero"],
            &["u4", "are 0"],
            &["u4", "alternat"],
            &["u4", "nois"],
        ],
    },
    Corruption {
        id: "rates_batches_backwards",
        kind: Kind::Timing,
        says: "the gyros' buffer is read from the wrong end: of each eight rows the newest rates stand first",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.take(&RATES, |sample| sample - sample % 8 + (7 - sample % 8))),
        right: &[
            &["rates", "backward"],
            &["rates", "revers", "!sign"],
            &["rates", "order", "!first order"],
            &["rates", "batch"],
            &["rates", "buffer"],
            &["rates", "shuffl"],
            &["rates", "sawtooth"],
            &["rates", "jitter"],
            &["rates", "jump"],
            &["rates", "leap"],
            &["rates", "periodic"],
            &["rates", "nois", "!or noise"],
            &["rates", "hz", "!targets are"],
            &["wx", "backward"],
            &["wx", "order", "!first order"],
            &["wx", "batch"],
            &["wx", "sawtooth"],
            &["wx", "jitter"],
            &["wx", "jump"],
            &["wx", "periodic"],
            &["wx", "nois"],
        ],
    },
    Corruption {
        id: "attitude_extrapolated",
        kind: Kind::Timing,
        says: "the attitude is a stream of 4 Hz, and until the next value comes the receiver goes on with the slope of the last two",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let period = log.samples(0.25).max(1);
            for column in ATTITUDE {
                let sent = log.of_column(column).clone();
                for (sample, angle) in log.of_column(column).iter_mut().enumerate() {
                    let last = sample - sample % period;
                    let slope = turn(sent[last.saturating_sub(period)], sent[last]) / period as f64;
                    *angle = sent[last] + slope * (sample - last) as f64;
                }
            }
        }),
        right: &[
            &["attitude", "extrapol"],
            &["attitude", "interpol"],
            &["attitude", "straight"],
            &["attitude", "hz"],
            &["attitude", "stream"],
            &["attitude", "sawtooth"],
            &["attitude", "jump"],
            &["attitude", "leap"],
            &["attitude", "overshoot"],
            &["attitude", "periodic"],
            &["roll", "extrapol"],
            &["roll", "interpol"],
            &["roll", "straight", "!roll rate"],
            &["roll", "hz", "!roll rate"],
            &["roll", "sawtooth"],
            &["roll", "jump", "!roll rate"],
            &["roll", "leap", "!roll rate"],
            &["roll", "periodic", "!roll rate"],
        ],
    },
    Corruption {
        id: "rates_lead_compensated",
        kind: Kind::Timing,
        says: "the rates are still corrected for the slow gyros that were replaced: 0.08 s times the change of each is added to it",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for (rate, derivative) in RATES.into_iter().zip(ANGULAR) {
                let change = log.of_column(derivative).clone();
                log.of_column(rate).iter_mut().zip(change).for_each(|(w, per_s)| *w += 0.08 * per_s);
            }
        }),
        right: &[
            &["rates", " earl"],
            &["rates", " lead", "!leads to"],
            &["rates", "ahead"],
            &["rates", "compensat"],
            &["rates", "overshoot"],
            &["rates", "derivative", "contain"],
            &["angular targets come later than the rates"],
            &["wx", " earl"],
            &["wx", " lead", "!leads to"],
            &["wx", "ahead"],
            &["wx", "overshoot"],
            &["wx", "times wx_dot"],
            &["wx", "contains wx_dot"],
        ],
    },
    Corruption {
        id: "satellites_stall",
        kind: Kind::Timing,
        says: "every 6 s the line of the satellite receiver stalls for 1 s, and what has piled up is then played at twice its pace: position and velocity",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let (period, stall) = (log.samples(6.0).max(1), log.samples(1.0));
            let from = |sample: usize| {
                let since = sample % period;
                let shown = if since < 2 * stall { 2 * since.saturating_sub(stall) } else { since };
                sample - since + shown
            };
            [POSITION, VELOCITY].iter().for_each(|columns| log.take(columns, from));
        }),
        right: &[
            &["velocity", " stall"],
            &["velocity", "held"],
            &["velocity", "repeat"],
            &["velocity", "frozen"],
            &["velocity", "freez"],
            &["velocity", "still"],
            &["velocity", "same value"],
            &["velocity", "jitter"],
            &["velocity", "clock"],
            &["velocity", " late"],
            &["velocity", "delay"],
            &["vx", "held"],
            &["vx", "repeat"],
            &["vx", "frozen"],
            &["vx", "freez"],
            &["vx", "still"],
            &["vx", "same value"],
            &["vx", " late"],
            &["position", " stall"],
            &["position", "held"],
            &["position", "repeat"],
            &["position", "freez"],
            &["position", "frozen"],
            &["position", " late"],
            &["targets come earlier than the velocity"],
        ],
    },
    // Cells.
    Corruption {
        id: "gaps_bridged",
        kind: Kind::Cells,
        says: "five times the radio link was lost for 1.2 s, and a script drew straight lines from the last row to the next, in all columns",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let (length, last) = (log.samples(1.2).max(1), log.len().saturating_sub(1));
            for _ in 0..5 {
                let start = chance.below(log.len().saturating_sub(length));
                let end = (start + length).min(last);
                for column in &mut log.columns {
                    let (from, to) = (column[start], column[end]);
                    for (place, value) in column[start..end].iter_mut().enumerate() {
                        *value = from + (to - from) * place as f64 / length as f64;
                    }
                }
            }
        }),
        right: &[
            &["straight line"],
            &["interpolated"],
            &["bridged"],
            &["equal steps"],
            &["a gap"],
            &["gaps"],
            &["filled"],
            &["rows", "missing"],
            &["rows", "lost"],
            &["samples", "missing"],
            &["samples", "lost"],
            &["dropout"],
            &["ramp"],
            &["constant slope"],
        ],
    },
    Corruption {
        id: "wx_torn_reads",
        kind: Kind::Cells,
        says: "the two bytes of the roll gyro are read while they change: the lower one is of the row before, and the rate leaps by 256 counts where the upper one counts on",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let mut before = None;
            for rate in log.of_column(Column::Wx) {
                let counts = (*rate / COUNT_RAD_S).round() as i64;
                let low = before.unwrap_or(counts) & 0xff;
                before = Some(counts);
                *rate = ((counts & !0xff) | low) as f64 * COUNT_RAD_S;
            }
        }),
        right: &[
            &["spikes_wx"],
            &["wx", "torn"],
            &["wx", "byte"],
            &["wx", "spike"],
            &["wx", "outlier"],
            &["wx", "glitch"],
            &["wx", "jump"],
            &["wx", "leap"],
            &["wx", "far outside"],
            &["wx", "nois"],
            &["roll rate", "spike"],
            &["roll rate", "leap"],
            &["roll rate", "jump"],
        ],
    },
    Corruption {
        id: "rows_of_means",
        kind: Kind::Cells,
        says: "a spreadsheet's subtotals were left in: every 2 s of rows are followed by a row of their means",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let length = log.samples(2.0).max(1);
            for column in &mut log.columns {
                *column = column.chunks(length).flat_map(|rows| rows.iter().copied().chain([mean(rows)])).collect();
            }
        }),
        right: &[
            &["subtotal"],
            &["row", "of means"],
            &["rows", "averag"],
            &["rows", "inserted"],
            &["rows", "spike"],
            &["rows", "outlier"],
            &["rows", "do not belong"],
            &["rows", "does not belong"],
            &["step in all"],
            &["all", "jump"],
            &["all", "leap"],
            &["columns", "jump"],
            &["columns", "leap"],
            &["spikes_"],
            &["far outside"],
        ],
    },
    Corruption {
        id: "vy_filled_from_left",
        kind: Kind::Cells,
        says: "one in twelve cells of vy was empty and was filled along the row instead of down the column: with vx",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let forward = log.of_column(Column::Vx).clone();
            for (vy, vx) in log.of_column(Column::Vy).iter_mut().zip(forward) {
                if chance.uniform() < 1.0 / 12.0 {
                    *vy = vx;
                }
            }
        }),
        right: &[
            &["spikes_vy"],
            &["vy", "filled"],
            &["vy", "spike"],
            &["vy", "outlier"],
            &["vy", "jump"],
            &["vy", "leap"],
            &["vy", "far outside"],
            &["vy", "nois"],
            &["vy", "vx", "same"],
            &["vy", "vx", "equal"],
            &["vy", "vx", "copied"],
            &["vy", "vx", "copy"],
            &["vy", "vx", "identical"],
            &["velocity", "spike"],
            &["velocity", "nois", "!or noise"],
        ],
    },
    Corruption {
        id: "angular_targets_one_digit",
        kind: Kind::Cells,
        says: "the angular accelerations were written with one significant digit: 1.49 as 1, 0.0852 as 0.09",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&ANGULAR, one_digit)),
        right: &[
            &["angular", "digit"],
            &["angular", "round"],
            &["angular", "quanti"],
            &["angular", "precision"],
            &["angular", "resolution"],
            &["angular", "steps of"],
            &["angular", "few values"],
            &["angular", "same value"],
            &["angular", "nois", "!or noise"],
            &["wx_dot", "digit"],
            &["wx_dot", "round"],
            &["wx_dot", "quanti"],
            &["wx_dot", "precision"],
            &["wx_dot", "resolution"],
            &["wx_dot", "steps of"],
            &["wx_dot", "few values"],
            &["wx_dot", "same value"],
            &["wx_dot", "nois"],
        ],
    },
    // Noise and disturbances.
    Corruption {
        id: "compass_hard_iron",
        kind: Kind::Noise,
        says: "iron beside the compass adds a field of its own: the heading is off by up to 20°, as the sine of the heading goes",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::Yaw], |yaw| yaw + 0.35 * (yaw + 0.7).sin())),
        right: &[
            &["compass"],
            &["magnet"],
            &["hard iron"],
            &["yaw", "disturb", "!yaw rate"],
            &["yaw", "interfer", "!yaw rate"],
            &["yaw", "deviat", "!yaw rate", "!standard"],
            &["yaw", "offset", "!yaw rate"],
            &["yaw", "off by"],
            &["yaw", "turned"],
            &["yaw", "scale", "!yaw rate"],
            &["yaw", "gain", "!yaw rate"],
            &["yaw", "does not follow"],
            &["yaw", "drift", "!yaw rate"],
            &["heading", "disturb"],
            &["heading", "interfer"],
            &["heading", "deviat", "!standard"],
            &["heading", "offset"],
            &["heading", "off by"],
            &["heading", "turned"],
            &["heading", "scale"],
            &["heading", "drift"],
        ],
    },
    Corruption {
        id: "pitch_of_two_filters",
        kind: Kind::Noise,
        says: "the autopilot goes to and fro between two attitude filters, each kept for 1 to 4 s, that differ by 5° in pitch",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            let (least, more) = (log.samples(1.0), log.samples(3.0));
            let (mut off, mut left) = (0.0, least + chance.below(more + 1));
            for pitch in log.of_column(Column::Pitch) {
                if left == 0 {
                    off = 5.0_f64.to_radians() - off;
                    left = least + chance.below(more + 1);
                }
                left = left.saturating_sub(1);
                *pitch += off;
            }
        }),
        right: &[
            &["spikes_pitch"],
            &["pitch", "jump", "!pitch rate"],
            &["pitch", "leap", "!pitch rate"],
            &["pitch", "step of", "!pitch rate"],
            &["pitch", "switch", "!pitch rate"],
            &["pitch", "two levels"],
            &["pitch", "reset", "!pitch rate"],
            &["pitch", "offset", "!pitch rate"],
            &["pitch", "spike", "!pitch rate"],
            &["attitude", "jump"],
            &["attitude", "leap"],
            &["attitude", "step of"],
            &["attitude", "switch"],
            &["attitude", "reset"],
            &["attitude", "offset"],
            &["attitude", "two filters"],
            &["attitude", "two estimat"],
        ],
    },
    Corruption {
        id: "vz_dot_rectified",
        kind: Kind::Noise,
        says: "under load the rotor shakes the vertical accelerometer against one of its stops: where the collective is above its mean, vz_dot is 2 m/s² too large",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let collective = log.of_column(Column::U4).clone();
            let usual = mean(&collective);
            for (acceleration, u) in log.of_column(Column::VzDot).iter_mut().zip(collective) {
                if u > usual {
                    *acceleration += 2.0;
                }
            }
        }),
        right: &[
            &["vz_dot", "rectif"],
            &["vz_dot", "vibrat"],
            &["vz_dot", "clip"],
            &["vz_dot", "offset"],
            &["vz_dot", "bias"],
            &["vz_dot", "jump"],
            &["vz_dot", "leap"],
            &["vz_dot", "step of"],
            &["vz_dot", "shift"],
            &["vz_dot", "two levels"],
            &["vz_dot", "nois"],
            &["vz_dot", "not the derivative"],
            &["vz_dot", "does not follow"],
            &["vz_dot", "u4", "contains"],
            &["vz_dot", "u4", "follows"],
            &["vertical accel", "offset"],
            &["vertical accel", "bias"],
        ],
    },
    Corruption {
        id: "velocity_taken_for_rest",
        kind: Kind::Noise,
        says: "when the gyros are calm the estimator takes the aircraft for standing on the ground: the velocity is pulled to 0, by up to 40 %",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| pulled_to_rest(log)),
        right: &[
            &["velocity", "at rest"],
            &["velocity", "on the ground"],
            &["velocity", "pulled"],
            &["velocity", "towards 0"],
            &["velocity", "to zero"],
            &["velocity", "too small"],
            &["velocity", "scale"],
            &["velocity", "gain"],
            &["velocity", "factor"],
            &["velocity", "drift"],
            &["velocity", "offset"],
            &["velocity", "jump"],
            &["velocity", "reset"],
            &["velocity", "wander"],
            &["vx", "scale"],
            &["vx", "gain"],
            &["vx", "drift"],
            &["vx", "offset"],
            &["vx", "jump"],
        ],
    },
    Corruption {
        id: "attitude_leaks",
        kind: Kind::Noise,
        says: "roll and pitch are the gyros alone, summed up with a leak of 2 s lest they drift: whatever lasts goes back to level",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let keeps = (-log.step_s / 2.0).exp();
            for column in [Column::Roll, Column::Pitch] {
                let angles = log.of_column(column);
                let mut before = angles.first().copied().unwrap_or(0.0);
                let mut shown = before;
                for angle in angles {
                    shown = keeps * shown + turn(before, *angle);
                    before = *angle;
                    *angle = shown;
                }
            }
        }),
        right: &[
            &["attitude", "leak"],
            &["attitude", "high-pass"],
            &["attitude", "high pass"],
            &["attitude", "to level"],
            &["attitude", "decay"],
            &["attitude", "drift"],
            &["attitude", "offset"],
            &["attitude", "scale"],
            &["attitude", "too small"],
            &["attitude", "does not follow"],
            &["attitude", "not the integral"],
            &["attitude", "contradict"],
            &["attitude", " earl"],
            &["roll", "leak"],
            &["roll", "high-pass"],
            &["roll", "to level"],
            &["roll", "decay"],
            &["roll", "drift", "!roll rate"],
            &["roll", "offset", "!roll rate"],
            &["roll", "scale", "!roll rate"],
            &["roll", "does not follow"],
        ],
    },
    // Frames.
    Corruption {
        id: "yaw_course",
        kind: Kind::Frames,
        says: "yaw is the course over ground of a satellite receiver, whither the aircraft goes, and not whither its nose points",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let [north, east, _] = rotate(&rotation_body_to_inertial(roll, pitch, yaw), log.vector(VELOCITY, sample));
                log.set_vector(ATTITUDE, sample, [roll, pitch, east.atan2(north)]);
            }
        }),
        right: &[
            &["yaw", "course", "!of course"],
            &["yaw", "over ground"],
            &["yaw", "ground track"],
            &["yaw", "direction of"],
            &["yaw", "does not follow"],
            &["yaw", "not the integral"],
            &["yaw", "contradict"],
            &["yaw", "jump", "!yaw rate"],
            &["yaw", "leap", "!yaw rate"],
            &["yaw", "nois", "!yaw rate"],
            &["heading", "course", "!of course"],
            &["heading", "over ground"],
            &["heading", "direction of"],
            &["heading", "does not follow"],
            &["heading", "contradict"],
            &["spikes_yaw"],
        ],
    },
    Corruption {
        id: "attitude_rotation_vector",
        kind: Kind::Frames,
        says: "the attitude was exported as a rotation vector, an axis times an angle, and written as if it were roll, pitch and yaw",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let vector = rotation_vector([0.0, 0.0, 0.0, 1.0], euler_to_quaternion(roll, pitch, yaw));
                log.set_vector(ATTITUDE, sample, vector);
            }
        }),
        right: &[
            &["rotation vector"],
            &["axis-angle"],
            &["axis and angle"],
            &["axis times"],
            &["helical"],
            &["exponential", "attitude"],
            &["euler", "convention"],
            &["attitude", "not euler"],
            &["attitude", "convention"],
            &["angles", "convention"],
            &["attitude", "axes"],
            &["attitude", "frame"],
        ],
    },
    Corruption {
        id: "world_leans",
        kind: Kind::Frames,
        says: "visual odometry has a wrong idea of down: attitude and position are in axes that lean by 10°, and agree with each other",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let lean = rotation_body_to_inertial(8.0_f64.to_radians(), -6.0_f64.to_radians(), 0.0);
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let body = rotation_body_to_inertial(roll, pitch, yaw);
                let part = |row: usize, column: usize| (0..3).map(|axis| lean[axis][row] * body[axis][column]).sum();
                let leaning = [0, 1, 2].map(|row| [0, 1, 2].map(|column| part(row, column)));
                log.set_vector(ATTITUDE, sample, rotation_to_euler(&leaning));
                log.set_vector(POSITION, sample, rotate_back(&lean, log.vector(POSITION, sample)));
            }
        }),
        right: &[
            &["attitude", "gravity", "!specific force"],
            &["direction of gravity"],
            &["attitude", "tilt"],
            &["attitude", " lean"],
            &["attitude", "not level"],
            &["attitude", "offset"],
            &["attitude", "bias"],
            &["attitude", "turned"],
            &["attitude", "off by"],
            &["roll", "offset", "!roll rate"],
            &["roll", "off by", "!roll rate"],
            &["roll", "tilt", "!roll rate"],
            &["pitch", "offset", "!pitch rate"],
            &["pitch", "off by", "!pitch rate"],
            &["inertial axes", " lean"],
            &["inertial axes", "tilt"],
        ],
    },
    Corruption {
        id: "position_from_ship",
        kind: Kind::Frames,
        says: "the position is counted from the base station, which stands on a ship that goes 2 m/s to the north-east",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let component = 2.0 * log.step_s * 0.5_f64.sqrt();
            for column in [Column::X, Column::Y] {
                log.of_column(column).iter_mut().enumerate().for_each(|(sample, place)| *place -= component * sample as f64);
            }
        }),
        right: &[
            &["position", "moving"],
            &["position", "relative"],
            &["position", "drift"],
            &["position", "trend"],
            &["position", "does not follow"],
            &["position", "not the integral"],
            &["position", "contradict"],
            &["velocity", "wind", "!window"],
            &["velocity", "airspeed"],
            &["velocity", "offset"],
            &["velocity", "bias"],
            &["`x`", "drift"],
            &["`x`", "trend"],
            &["`x`", "does not follow"],
            &["vx", "offset"],
            &["vx", "bias"],
        ],
    },
    Corruption {
        id: "z_over_slope",
        kind: Kind::Frames,
        says: "z is taken from a laser that looks at the ground, which rises by 0.2 m for each metre to the north",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| {
            let north = log.of_column(Column::X).clone();
            log.of_column(Column::Z).iter_mut().zip(north).for_each(|(down, x)| *down += 0.2 * x);
        }),
        right: &[
            &["terrain"],
            &["above ground"],
            &["above the ground"],
            &["ground", "slope"],
            &["ground", "rises"],
            &["`z`", "slope"],
            &["`z`", "drift"],
            &["`z`", "does not follow"],
            &["`z`", "not the integral"],
            &["`z`", "contradict"],
            &["`z`", "contains"],
            &["`z`", "scale"],
            &["`z`", "tilt"],
            &["position", "tilt"],
            &["position", "turned"],
            &["position", "drift"],
            &["position", "does not follow"],
            &["position", "contradict"],
            &["vz", "offset", "!vz_dot"],
            &["vz", "contradict", "!vz_dot"],
        ],
    },
];

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The straight line that fits best: its height in the middle, its slope a sample, and where the middle is.
fn line(values: &[f64]) -> (f64, f64, f64) {
    let middle = 0.5 * values.len().saturating_sub(1) as f64;
    let about = |sample: usize| sample as f64 - middle;
    let along = values.iter().enumerate().map(|(sample, value)| about(sample) * value).sum::<f64>();
    let square = (0..values.len()).map(|sample| about(sample).powi(2)).sum::<f64>();
    (mean(values), along / square.max(f64::EPSILON), middle)
}

/// Differences of the neighbours on both sides, a second.
fn slopes(values: &[f64], step_s: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    let slope = |sample: usize| {
        let (before, after) = (sample.saturating_sub(1), (sample + 1).min(last));
        (values[after] - values[before]) / (step_s * (after - before).max(1) as f64)
    };
    (0..values.len()).map(slope).collect()
}

/// From one angle to another the short way round.
fn turn(from: f64, to: f64) -> f64 {
    (to - from + PI).rem_euclid(TAU) - PI
}

fn one_digit(value: f64) -> f64 {
    if value == 0.0 {
        return value;
    }
    let unit = 10.0_f64.powf(value.abs().log10().floor());
    (value / unit).round() * unit
}

/// What potentiometers show of a battery that is full at the lowest collective of the flight, and gives least at the highest.
fn on_sagging_supply(log: &mut Log) {
    let collective = log.of_column(Column::U4).clone();
    let lowest = collective.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = collective.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let reach = (highest - lowest).max(f64::EPSILON);
    for column in CONTROLS {
        log.of_column(column).iter_mut().zip(&collective).for_each(|(shown, u)| *shown *= 1.0 - 0.35 * (u - lowest) / reach);
    }
}

/// Flow falls with height: the ground lies 8 m below the lowest point of the flight.
fn flow_of_fixed_height(log: &mut Log) {
    let down = log.of_column(Column::Z).clone();
    let ground = 8.0 + down.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let first = ground - down.first().copied().unwrap_or(0.0);
    for column in [Column::Vx, Column::Vy] {
        log.of_column(column).iter_mut().zip(&down).for_each(|(velocity, z)| *velocity *= first / (ground - z));
    }
}

/// Calm is less than 0.6 of the mean turning of the flight; the estimator comes to believe in rest, and to doubt it, within half a second.
fn pulled_to_rest(log: &mut Log) {
    let turning: Vec<f64> = (0..log.len()).map(|sample| log.vector(RATES, sample).into_iter().fold(0.0, f64::hypot)).collect();
    let calm = 0.6 * mean(&turning);
    let share = 1.0 - (-log.step_s / 0.5).exp();
    let mut pull = 0.0;
    for (sample, turning) in turning.into_iter().enumerate() {
        let belief = if turning < calm { 0.4 } else { 0.0 };
        pull += share * (belief - pull);
        log.set_vector(VELOCITY, sample, log.vector(VELOCITY, sample).map(|velocity| (1.0 - pull) * velocity));
    }
}
