//! Corruptions that were written down on 2026-11-26, after those of `fourth` had been looked at, unseen of the checks; reported on 2026-11-26 on seeds
//! 85006 and 85007, and looked at since: they are for development now. Each differs from those of all other
//! lists in what goes wrong.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Change, Corruption, Kind, LINEAR, Log, Part, RATES, VELOCITY};
use phyture::flight::attitude::{
    cross, euler_to_quaternion, gravity_body, quaternion_to_euler, rotate, rotate_back, rotation_body_to_inertial,
    rotation_to_euler,
};
use phyture::flight::{Column, GRAVITY_M_S2};
use std::f64::consts::TAU;

const ALL_OR_HALF: [Part; 2] = [Part::All, Part::Half];
const ALL_OR_ONE: [Part; 2] = [Part::All, Part::One];
const HALF_OR_ONE: [Part; 2] = [Part::Half, Part::One];

/// What a yaw gyro of 16 bits that counts in mrad/s is off by where its sign is not read, rad/s.
const UNSIGNED_RAD_S: f64 = 65.536;

/// Those that nothing was tuned on.
pub const FIFTH: &[Corruption] = &[
    // Sticks.
    Corruption {
        id: "u1_exponential",
        kind: Kind::Sticks,
        says: "the lateral cyclic is recorded before the exponential of the transmitter, which makes 0.4 s + 0.6 s³ of a stick s",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| log.each(&[Column::U1], before_exponential)),
        right: &[
            &["u1", "expo"],
            &["u1", "cubic"],
            &["u1", "curve"],
            &["u1", "nonlinear"],
            &["u1", "non-linear"],
            &["u1", "not linear"],
            &["u1", "gain"],
            &["u1", "scale"],
            &["u1", "steeper"],
        ],
    },
    Corruption {
        id: "u2_slew_limited",
        kind: Kind::Sticks,
        says: "the longitudinal cyclic is read back from a spare servo in place of the fast one: it moves by 0.3 a second at most",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let most = 0.3 * log.step_s;
            let mut shown = log.of_column(Column::U2).first().copied().unwrap_or(0.0);
            for u in log.of_column(Column::U2) {
                shown = u.clamp(shown - most, shown + most);
                *u = shown;
            }
        }),
        right: &[
            &["u2", "slew"],
            &["u2", "rate limit"],
            &["u2", "never faster"],
            &["u2", "ramp"],
            &["u2", "straight line"],
            &["u2", "slow"],
            &["u2", "smooth"],
            &["u2", "filter"],
            &["u2", " lag"],
            &["u2", " late"],
            &["u2", "delay"],
        ],
    },
    Corruption {
        id: "u1_before_stabiliser",
        kind: Kind::Sticks,
        says: "the lateral cyclic is recorded before the stabiliser, which takes 0.15 times the roll rate off it",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let rate = log.of_column(Column::Wx).clone();
            log.of_column(Column::U1).iter_mut().zip(rate).for_each(|(stick, w)| *stick += 0.15 * w);
        }),
        right: &[
            &["u1", "stabili"],
            &["u1", "flybar"],
            &["u1", "feedback"],
            &["u1", "gyro"],
            &["u1", "roll rate", "!sign"],
            &["u1", "wx", "mix"],
            &["u1", "wx", "follows"],
            &["u1", "wx", "contains"],
            &["u1", "wx", "correlat"],
            &["u1", "times wx"],
        ],
    },
    Corruption {
        id: "u3_gain_switch",
        kind: Kind::Sticks,
        says: "the channel of the tail gyro's gain was recorded in place of the tail: a switch at 0.4 or -0.4, thrown twice in the flight",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let third = (log.len() / 3).max(1);
            for (sample, u) in log.of_column(Column::U3).iter_mut().enumerate() {
                *u = if sample / third == 1 { -0.4 } else { 0.4 };
            }
        }),
        right: &[
            &["u3", "switch"],
            &["u3", "two values"],
            &["u3", "few values"],
            &["u3", "still"],
            &["u3", "constant"],
            &["u3", "frozen"],
            &["u3", "freez"],
            &["u3", "held"],
            &["u3", "same value"],
            &["u3", "quanti"],
            &["u3", "round"],
            &["u3", "explains nothing"],
            &["u3", "explain nothing"],
            &["u3", "does not belong"],
            &["u3", "moves nothing"],
        ],
    },
    Corruption {
        id: "swash_servos",
        kind: Kind::Sticks,
        says: "not the sticks but the three servos of the swash plate, 120° apart, stand in the columns of both cyclics and of the collective",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let sticks = [Column::U1, Column::U2, Column::U4];
            for sample in 0..log.len() {
                let [sideways, along, collective] = log.vector(sticks, sample);
                let (behind, across) = (collective - 0.5 * along, 0.75_f64.sqrt() * sideways);
                log.set_vector(sticks, sample, [behind + across, collective + along, behind - across]);
            }
        }),
        right: &[
            &["servo"],
            &["swash"],
            &["ccpm"],
            &["u1", "u4", "mix"],
            &["u2", "u4", "mix"],
            &["u1", "u4", "combin"],
            &["u2", "u4", "combin"],
            &["u1", "u4", "cross"],
            &["u2", "u4", "cross"],
            &["u1", "u4", "correlat"],
            &["u2", "u4", "correlat"],
            &["controls", "mix"],
        ],
    },
    Corruption {
        id: "trainer_cord",
        kind: Kind::Sticks,
        says: "for 2 s out of 5 s the teacher flew, and what was recorded are the sticks of the pupil, which moved no less and did nothing",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let (last, period, taken) = (log.len().saturating_sub(1), log.samples(5.0).max(1), log.samples(2.0));
            log.take(&CONTROLS, |sample| if sample % period < taken { last - sample } else { sample });
        }),
        right: &[
            &["trainer"],
            &["pupil"],
            &["controls", "another time"],
            &["controls", "another flight"],
            &["controls", "do not belong"],
            &["controls", "explain nothing"],
            &["controls", "move nothing"],
            &["controls", "part of the"],
            &["controls", "stretch"],
            &["controls", "jump"],
            &["controls", "leap"],
            &["u1", "explain", "nothing"],
            &["u1", "jump"],
            &["u1", "leap"],
        ],
    },
    // Units.
    Corruption {
        id: "rates_per_step",
        kind: Kind::Units,
        says: "the rates are angles turned in a step of the log, as the sensor sums them up, and were not divided by the step",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let step_s = log.step_s;
            log.scale(&RATES, step_s);
        }),
        right: &[
            &["rates", "per step"],
            &["rates", "per sample"],
            &["rates", "increment"],
            &["rates", "delta"],
            &["rates", "units"],
            &["rates", "scale"],
            &["rates", "gain"],
            &["rates", "factor"],
            &["rates", "times", "!at least"],
            &["wx", "per step"],
            &["wx", "units"],
            &["wx", "scale"],
            &["wx", "factor"],
            &["wx", "times", "!at least"],
        ],
    },
    Corruption {
        id: "wz_range_switches",
        kind: Kind::Units,
        says: "beyond 35 % of what it reaches in the flight the yaw gyro goes over to its coarse range, and its counts are converted as of the fine one: halved",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let largest = log.of_column(Column::Wz).iter().fold(0.0_f64, |largest, rate| largest.max(rate.abs()));
            log.each(&[Column::Wz], |rate| if rate.abs() > 0.35 * largest { 0.5 * rate } else { rate });
        }),
        right: &[
            &["wz", "range"],
            &["wz", "jump"],
            &["wz", "leap"],
            &["wz", "spike"],
            &["wz", "nonlinear"],
            &["wz", "non-linear"],
            &["wz", "not linear"],
            &["wz", "scale"],
            &["wz", "gain"],
            &["yaw rate", "scale"],
            &["yaw rate", "gain"],
        ],
    },
    Corruption {
        id: "velocity_turned_by_degrees",
        kind: Kind::Units,
        says: "the velocity over ground was turned into the body with angles in degrees, which the sines took for radians",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let angles = log.vector(ATTITUDE, sample);
                let turned = |[roll, pitch, yaw]: [f64; 3]| rotation_body_to_inertial(roll, pitch, yaw);
                let over_ground = rotate(&turned(angles), log.vector(VELOCITY, sample));
                log.set_vector(VELOCITY, sample, rotate_back(&turned(angles.map(f64::to_degrees)), over_ground));
            }
        }),
        right: &[
            &["velocity", "axes"],
            &["velocity", "frame"],
            &["velocity", "turned"],
            &["velocity", "rotat"],
            &["velocity", "degrees"],
            &["velocity", "direction"],
            &["vx", "vy", "axes"],
            &["vx", "vy", "frame"],
            &["vx", "vy", "turned"],
            &["vx", "vy", "rotat"],
        ],
    },
    Corruption {
        id: "linear_targets_standardised",
        kind: Kind::Units,
        says: "the linear accelerations were prepared for a network: each less its mean in the flight, through its standard deviation",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for column in LINEAR {
                let (mean, deviation) = mean_and_deviation(log.of_column(column));
                log.each(&[column], |value| (value - mean) / deviation.max(f64::EPSILON));
            }
        }),
        right: &[
            &["standardis"],
            &["standardiz"],
            &["normalis"],
            &["normaliz"],
            &["standard deviation", "_dot"],
            &["linear", "scale"],
            &["linear", "gain"],
            &["linear", "factor"],
            &["linear", "units"],
            &["linear", "times", "!at least"],
            &["accelerat", "units"],
            &["vx_dot", "scale"],
            &["vx_dot", "factor"],
            &["vx_dot", "units"],
            &["vz_dot", "scale"],
            &["vz_dot", "factor"],
            &["vz_dot", "units"],
        ],
    },
    // Timing.
    Corruption {
        id: "attitude_sorted_after_wrap",
        kind: Kind::Timing,
        says: "the counter that stamps the attitude began again in mid flight: sorted by the stamp, rows of both halves stand by turns, each at twice its pace",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| {
            let middle = log.len() / 2;
            log.take(&ATTITUDE, |sample| sample / 2 + (sample % 2) * middle);
        }),
        right: &[
            &["attitude", "by turns"],
            &["attitude", "alternat"],
            &["attitude", "every other"],
            &["attitude", "order"],
            &["attitude", "interleav"],
            &["attitude", "stamp"],
            &["attitude", "nois", "!or noise"],
            &["attitude", "jump"],
            &["attitude", "leap"],
            &["attitude", "another time"],
            &["roll", "by turns"],
            &["roll", "alternat"],
            &["roll", "every other"],
            &["roll", "nois", "!roll rate"],
            &["roll", "jump", "!roll rate"],
            &["roll", "leap", "!roll rate"],
            &["spikes_yaw"],
        ],
    },
    Corruption {
        id: "velocity_not_resampled",
        kind: Kind::Timing,
        says: "the velocity, a stream of 50 Hz, was pasted beside rows of 100 Hz: it is over after half of the flight, and its last value fills the rest",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.take(&VELOCITY, |sample| 2 * sample)),
        right: &[
            &["velocity", "clock"],
            &["velocity", "stamp"],
            &["velocity", "resampl"],
            &["velocity", "twice as fast"],
            &["velocity", "another time"],
            &["velocity", "hz"],
            &["velocity", "still"],
            &["velocity", "constant", "!time constant"],
            &["velocity", "frozen"],
            &["velocity", "held"],
            &["velocity", "same value"],
            &["velocity", "repeat"],
            &["vx", "still"],
            &["vx", "constant", "!time constant"],
            &["vx", "frozen"],
            &["vx", "held"],
            &["vx", "same value"],
            &["vx", "repeat"],
        ],
    },
    Corruption {
        id: "attitude_sent_on_change",
        kind: Kind::Timing,
        says: "to spare the radio link an angle is sent only when it has changed by 4°, and stays as it is until then",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let least = 4.0_f64.to_radians();
            for column in ATTITUDE {
                let mut sent = log.of_column(column).first().copied().unwrap_or(0.0);
                for angle in log.of_column(column) {
                    if (*angle - sent).abs() >= least {
                        sent = *angle;
                    }
                    *angle = sent;
                }
            }
        }),
        right: &[
            &["attitude", "on change"],
            &["attitude", "held"],
            &["attitude", "repeat"],
            &["attitude", "stream"],
            &["attitude", "same value"],
            &["attitude", "steps of"],
            &["attitude", "round"],
            &["attitude", "quanti"],
            &["attitude", "dead"],
            &["attitude", " late", "!rates come later"],
            &["roll", "held", "!roll rate"],
            &["roll", "repeat", "!roll rate"],
            &["roll", "same value", "!roll rate"],
            &["roll", "steps of", "!roll rate"],
            &["roll", "round", "!roll rate"],
            &["roll", "quanti", "!roll rate"],
        ],
    },
    Corruption {
        id: "rates_filled_backwards",
        kind: Kind::Timing,
        says: "the rates come at 7 Hz, and the rows between were filled from the value that follows, not from the one before",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let period = log.samples(0.14).max(1);
            log.take(&RATES, |sample| sample.next_multiple_of(period));
        }),
        right: &[
            &["rates", "hz", "!targets are"],
            &["rates", "held"],
            &["rates", "repeat"],
            &["rates", "stream"],
            &["rates", "same value"],
            &["rates", "filled"],
            &["rates", "earl"],
            &["wx", "hz"],
            &["wx", "held"],
            &["wx", "repeat"],
            &["wx", "same value"],
            &["wx", "earl"],
        ],
    },
    Corruption {
        id: "angular_targets_uneven_step",
        kind: Kind::Timing,
        says: "differences of rates were divided by the time from arrival to arrival, 10 ms give or take 6 ms: each angular acceleration has a factor of its own",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, chance| {
            for sample in 0..log.len() {
                let factor = 1.0 / (1.0 + 1.2 * (chance.uniform() - 0.5));
                log.set_vector(ANGULAR, sample, log.vector(ANGULAR, sample).map(|value| factor * value));
            }
        }),
        right: &[
            &["angular", "nois", "!or noise"],
            &["angular", "uneven"],
            &["angular", "jitter"],
            &["angular", "factor"],
            &["angular", "scale"],
            &["angular", "gain"],
            &["angular", "spike"],
            &["wx_dot", "nois"],
            &["wx_dot", "factor"],
            &["wx_dot", "scale"],
            &["wx_dot", "gain"],
            &["wx_dot", "spike"],
        ],
    },
    Corruption {
        id: "row_asked_in_turn",
        kind: Kind::Timing,
        says: "the logger asks for one value after another over a slow bus: in a row each column is 8 ms newer than the one to its left",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for (place, column) in Column::ALL.into_iter().enumerate() {
                log.early(&[column], 0.008 * place as f64);
            }
        }),
        right: &[
            &["controls", " late"],
            &["controls", "earl"],
            &["controls", "delay"],
            &["targets", "earl"],
            &["targets", " late"],
            &["rates", "earl"],
            &["rates", " late"],
            &["attitude", " late"],
            &["attitude", "earl"],
            &["attitude", "delay"],
            &["velocity", " late"],
            &["velocity", "earl"],
            &["velocity", "delay"],
            &["position", " late"],
            &["position", "delay"],
            &["columns", "different times"],
        ],
    },
    // Cells.
    Corruption {
        id: "wy_sorted",
        kind: Kind::Cells,
        says: "in a spreadsheet 3 s of the column of the pitch rate, and of no other, were sorted by size",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let length = log.samples(3.0);
            let start = chance.below(log.len().saturating_sub(length) + 1);
            let end = (start + length).min(log.len());
            log.of_column(Column::Wy)[start..end].sort_by(f64::total_cmp);
        }),
        right: &[
            &["wy", "sort"],
            &["wy", "monoton"],
            &["wy", "rises"],
            &["wy", "ramp"],
            &["wy", "jump"],
            &["wy", "leap"],
            &["wy", "stretch"],
            &["wy", "part of the"],
            &["wy", "smooth"],
            &["wy", "does not belong"],
            &["pitch rate", "sort"],
        ],
    },
    Corruption {
        id: "roll_filled_down",
        kind: Kind::Cells,
        says: "four times 1.5 s of missing roll angles were filled by dragging: the spreadsheet counts on in equal steps from the last two cells",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let length = log.samples(1.5);
            let samples = log.len();
            for _ in 0..4 {
                let start = 2 + chance.below(samples.saturating_sub(length + 1));
                let rolls = log.of_column(Column::Roll);
                for sample in start..(start + length).min(samples) {
                    rolls[sample] = 2.0 * rolls[sample - 1] - rolls[sample - 2];
                }
            }
        }),
        right: &[
            &["roll", "straight line", "!roll rate"],
            &["roll", "linear", "!nonlinear", "!non-linear", "!not linear"],
            &["roll", "interpol"],
            &["roll", "filled"],
            &["roll", "equal steps"],
            &["roll", "ramp", "!roll rate"],
            &["roll", "jump", "!roll rate"],
            &["roll", "leap", "!roll rate"],
            &["roll", "drift", "!roll rate"],
            &["roll", "spike", "!roll rate"],
        ],
    },
    Corruption {
        id: "flights_mirrored",
        kind: Kind::Cells,
        says: "to have more flights, each was written twice more with port and starboard exchanged, as if the rotors had no sense of turning",
        parts: ALL_OR_HALF,
        change: Change::Copies(|log, _| {
            let [roll, yaw, sideways] = [Column::Roll, Column::Yaw, Column::Y];
            let moved = [Column::Vy, Column::Wx, Column::Wz, Column::U1, Column::U3, Column::VyDot, Column::WxDot, Column::WzDot];
            log.scale(&[roll, yaw, sideways], -1.0);
            log.scale(&moved, -1.0);
        }),
        right: &[
            &["mirror"],
            &["reflect"],
            &["port and starboard"],
            &["same numbers"],
            &["copies"],
            &["copied"],
            &["copy of"],
            &["duplicate"],
            &["same flight"],
            &["augment"],
        ],
    },
    Corruption {
        id: "wz_unsigned",
        kind: Kind::Cells,
        says: "the counts of the yaw gyro were read without their sign: what is below 0 is 65.536 rad/s too large",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, _| log.each(&[Column::Wz], |rate| if rate < 0.0 { rate + UNSIGNED_RAD_S } else { rate })),
        right: &[
            &["wz", "unsigned"],
            &["wz", "overflow"],
            &["wz", "wrap"],
            &["wz", "jump"],
            &["wz", "leap"],
            &["wz", "spike"],
            &["wz", "far outside"],
            &["wz", "never below"],
            &["wz", "never negative"],
        ],
    },
    Corruption {
        id: "sticks_tried_on_ground",
        kind: Kind::Cells,
        says: "6 s on the ground with the rotor at rest, in which the pilot tried the sticks, stand before the flight: controls move, and nothing else does",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| ground_before(log)),
        right: &[
            &["ground"],
            &["take-off"],
            &["take off"],
            &["at rest"],
            &["not flying"],
            &["before the flight"],
            &["stands still"],
            &["measurements", "still"],
            &["measurements", "held"],
            &["velocity", "still"],
            &["velocity", "held"],
            &["velocity", "frozen"],
            &["rates", "still"],
            &["rates", "held"],
            &["targets", "zero"],
            &["vx", "still"],
            &["vx", "held"],
            &["vx", "repeat"],
            &["wx", "still"],
            &["wx", "held"],
            &["wx", "repeat"],
        ],
    },
    Corruption {
        id: "outliers_deleted",
        kind: Kind::Cells,
        says: "rows in which a rate is off its mean by more than 1.8 standard deviations were thrown out as outliers, and the rest was joined",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let limits = RATES.map(|rate| mean_and_deviation(log.of_column(rate)));
            let stays = |sample: &usize| {
                log.vector(RATES, *sample)
                    .iter()
                    .zip(limits)
                    .all(|(rate, (mean, deviation))| (rate - mean).abs() <= 1.8 * deviation)
            };
            let order: Vec<usize> = (0..log.len()).filter(stays).collect();
            log.rows(&order);
        }),
        right: &[
            &["outlier", "rows"],
            &["step in all"],
            &["rows", "missing"],
            &["rows", "lost"],
            &["rows", "deleted"],
            &["samples", "missing"],
            &["samples", "lost"],
            &["dropped"],
            &["a gap"],
            &["gaps"],
            &["joined"],
            &["all", "jump"],
            &["stamp"],
        ],
    },
    // Noise and disturbances.
    Corruption {
        id: "attitude_of_apparent_gravity",
        kind: Kind::Noise,
        says: "roll and pitch are taken from the accelerometers alone: they follow apparent gravity, which stays below the rotor however the aircraft tilts",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [x, y, z] = specific_force(log, sample);
                let yaw = log.vector(ATTITUDE, sample)[2];
                log.set_vector(ATTITUDE, sample, [(-y).atan2(-z), x.atan2(y.hypot(z)), yaw]);
            }
        }),
        right: &[
            &["apparent gravity"],
            &["accelerometer", "attitude"],
            &["accelerometer", "roll"],
            &["attitude", "tilt"],
            &["attitude", "scale"],
            &["attitude", "does not follow"],
            &["attitude", "not the integral"],
            &["attitude", "too small"],
            &["attitude", "contradict"],
            &["roll", "does not follow"],
            &["roll", "scale", "!roll rate"],
            &["roll", "pitch", "contradict"],
        ],
    },
    Corruption {
        id: "gyros_feel_acceleration",
        kind: Kind::Noise,
        says: "old gyros feel acceleration: 0.03 rad/s in pitch rate for each m/s² downwards beyond hover, and in roll rate for each m/s² to starboard",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [_, y, z] = specific_force(log, sample);
                let [wx, wy, wz] = log.vector(RATES, sample);
                log.set_vector(RATES, sample, [wx + 0.03 * y, wy + 0.03 * (z + GRAVITY_M_S2), wz]);
            }
        }),
        right: &[
            &["gyro", "accelerat", "!angular"],
            &["g-sensitiv"],
            &["rates", "depend", "accelerat", "!angular"],
            &["wy", "vz_dot", "follows"],
            &["wy", "vz_dot", "correlat"],
            &["wy", "offset"],
            &["wy", "bias"],
            &["wy", "drift"],
            &["wy", "nois"],
            &["rates", "offset"],
            &["rates", "bias"],
            &["rates", "drift"],
        ],
    },
    Corruption {
        id: "rates_ring_on_foam",
        kind: Kind::Noise,
        says: "the gyros swing on soft foam, at 4 Hz with a damping of 0.06: they ring after each quick motion",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let (frequency, damping, step_s) = (TAU * 4.0, 0.06, log.step_s);
            for column in RATES {
                let rates = log.of_column(column);
                let (mut shown, mut change) = (rates.first().copied().unwrap_or(0.0), 0.0);
                for rate in rates {
                    change += step_s * frequency * (frequency * (*rate - shown) - 2.0 * damping * change);
                    shown += step_s * change;
                    *rate = shown;
                }
            }
        }),
        right: &[
            &["rates", "reson"],
            &["rates", "ring"],
            &["rates", "oscillat"],
            &["rates", "periodic"],
            &["rates", "vibrat"],
            &["rates", "hz", "!targets are"],
            &["rates", "nois", "!or noise"],
            &["rates", " lag"],
            &["rates", " late"],
            &["rates", "delay"],
            &["wx", "reson"],
            &["wx", "oscillat"],
            &["wx", "periodic"],
            &["wx", "nois"],
            &["wx", " late"],
        ],
    },
    Corruption {
        id: "velocity_wanders",
        kind: Kind::Noise,
        says: "between walls the satellites' signals arrive by detours: the velocity wanders by 0.8 m/s, each way within 2 s",
        parts: HALF_OR_ONE,
        change: Change::Columns(|log, chance| {
            let keeps = (-log.step_s / 2.0).exp();
            let fresh = 0.8 * (1.0 - keeps * keeps).sqrt();
            for column in VELOCITY {
                let mut off = 0.8 * chance.normal();
                for velocity in log.of_column(column) {
                    *velocity += off;
                    off = keeps * off + fresh * chance.normal();
                }
            }
        }),
        right: &[
            &["velocity", "wander"],
            &["velocity", "drift"],
            &["velocity", "random walk"],
            &["velocity", "multipath"],
            &["velocity", "nois", "!or noise"],
            &["velocity", "offset"],
            &["vx", "wander"],
            &["vx", "drift"],
            &["vx", "random walk"],
            &["vx", "nois"],
            &["vx", "offset"],
        ],
    },
    // Frames.
    Corruption {
        id: "quaternion_order",
        kind: Kind::Frames,
        says: "the attitude was made of quaternions w, x, y, z that were read as x, y, z, w",
        parts: ALL_OR_ONE,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let [x, y, z, w] = euler_to_quaternion(roll, pitch, yaw);
                log.set_vector(ATTITUDE, sample, quaternion_to_euler([w, x, y, z]));
            }
        }),
        right: &[
            &["quaternion"],
            &["wxyz"],
            &["xyzw"],
            &["upside down"],
            &["attitude", "convention"],
            &["attitude", "frame"],
            &["attitude", "axes"],
            &["attitude", "180"],
            &["roll", "180"],
        ],
    },
    Corruption {
        id: "attitude_of_earth_in_body",
        kind: Kind::Frames,
        says: "the angles are of the turn the other way, from the body's axes to north, east and down: the matrix was transposed",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
                let [[a, b, c], [d, e, f], [g, h, i]] = rotation_body_to_inertial(roll, pitch, yaw);
                log.set_vector(ATTITUDE, sample, rotation_to_euler(&[[a, d, g], [b, e, h], [c, f, i]]));
            }
        }),
        right: &[
            &["transpos"],
            &["conjugate"],
            &["attitude", "inverse"],
            &["attitude", "other way"],
            &["attitude", "sign"],
            &["attitude", "convention"],
            &["angles", "sign"],
            &["angles", "convention"],
            &["roll", "sign", "!roll rate"],
            &["yaw", "sign", "!yaw rate"],
        ],
    },
    Corruption {
        id: "velocity_of_antenna",
        kind: Kind::Frames,
        says: "the velocity is that of the antenna, on the tail boom 1.1 m behind the centre of gravity and 0.3 m above it",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            let arm = [-1.1, 0.0, -0.3];
            for sample in 0..log.len() {
                let (velocity, turning) = (log.vector(VELOCITY, sample), cross(log.vector(RATES, sample), arm));
                log.set_vector(VELOCITY, sample, [0, 1, 2].map(|axis| velocity[axis] + turning[axis]));
            }
        }),
        right: &[
            &["lever"],
            &["antenna"],
            &["centre of gravity"],
            &["off the centre"],
            &["velocity", "arm"],
            &["velocity", "mounted"],
            &["velocity", "sensor", " m behind"],
            &["velocity", "times the rates"],
            &["vy", "wz", "contains"],
        ],
    },
    Corruption {
        id: "velocity_polar",
        kind: Kind::Frames,
        says: "the velocity is given as a wind tunnel has it: vx is the speed, vy the angle of sideslip and vz the angle of attack, in radians",
        parts: ALL_OR_HALF,
        change: Change::Columns(|log, _| {
            for sample in 0..log.len() {
                let [vx, vy, vz] = log.vector(VELOCITY, sample);
                let level = vx.hypot(vz);
                log.set_vector(VELOCITY, sample, [level.hypot(vy), vy.atan2(level), vz.atan2(vx)]);
            }
        }),
        right: &[
            &["sideslip"],
            &["angle of attack"],
            &["polar"],
            &["vx", "speed", "angle"],
            &["vx", "never below"],
            &["vx", "absolute"],
            &["velocity", "magnitude"],
            &["velocity", "axes"],
            &["velocity", "frame"],
            &["velocity", "units"],
            &["velocity", "scale"],
            &["vy", "scale"],
            &["vy", "units"],
        ],
    },
];

/// The stick of which an exponential makes this: Newton's method, which comes down to it from above.
fn before_exponential(u: f64) -> f64 {
    let mut stick = (u.abs() / 0.6).cbrt().max(u.abs());
    for _ in 0..20 {
        stick -= (0.4 * stick + 0.6 * stick.powi(3) - u.abs()) / (0.4 + 1.8 * stick * stick);
    }
    stick.copysign(u)
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    (mean, square.sqrt())
}

/// What accelerometers at the centre of gravity show, m/s².
fn specific_force(log: &Log, sample: usize) -> [f64; 3] {
    let [roll, pitch, _] = log.vector(ATTITUDE, sample);
    let (derivative, gravity) = (log.vector(LINEAR, sample), gravity_body(roll, pitch));
    let turning = cross(log.vector(RATES, sample), log.vector(VELOCITY, sample));
    [0, 1, 2].map(|axis| derivative[axis] + turning[axis] - gravity[axis])
}

/// Rows before the flight, level and at rest where it begins, while one stick after the other is moved.
fn ground_before(log: &mut Log) {
    let (ground, time_s) = (log.samples(6.0), 1.5);
    let order: Vec<usize> = std::iter::repeat_n(0, ground).chain(0..log.len()).collect();
    log.rows(&order);
    let level = [Column::Roll, Column::Pitch];
    for column in level.into_iter().chain(VELOCITY).chain(RATES).chain(LINEAR).chain(ANGULAR) {
        log.of_column(column).iter_mut().take(ground).for_each(|value| *value = 0.0);
    }
    let turn = log.samples(time_s).max(1);
    for (place, control) in CONTROLS.into_iter().enumerate() {
        for (sample, u) in log.of_column(control).iter_mut().take(ground).enumerate() {
            let moves = sample / turn == place;
            *u = if moves { 0.6 * (TAU * sample as f64 / turn as f64).sin() } else { 0.0 };
        }
    }
}
