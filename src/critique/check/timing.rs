//! Streams of a log against each other in time: which comes late, and by how much; and how late the controls act.
//!
//! An error is profiled over shifts of one stream by whole samples, of a log faster than 200 Hz by 5 ms, so that the work grows with the
//! rate and not with its square; the minimum is refined by a parabola, and its interval is from leaving out one block at a time
//! (jackknife). A flight whose step differs from the first's is left out.

use super::finding::{Finding, Severity, Subject};
use super::increments::{Instant, Motion, Vector};
use super::regression::BlockRegression;
use super::sticks::{EXPLAINED, STICKS};
use crate::blocks::FEW_BLOCKS;
use crate::flight::attitude::{Matrix3, cross, rotate};
use crate::student_t::quantile_975;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Streams are compared up to this shift to either side, s.
const LARGEST_SHIFT_S: f64 = 0.1;
/// Shifts are no closer than this, s, unless the samples are further apart.
const CLOSEST_SHIFTS_S: f64 = 0.005;
/// Delays of the controls that are tried, s.
const CONTROL_DELAYS_S: [f64; 2] = [-0.12, 0.12];
/// The controls are looked at no more often than this, s: they move slowly against it.
const CLOSEST_LOOKS_S: f64 = 0.02;
/// Delays that are tried on changes, s, and what a change is over, s.
const NEAR_S: f64 = 0.06;
const CHANGE_S: f64 = 0.02;
/// Fall of the summed log error over the profile below which its minimum means nothing.
const LEAST_DEPTH: f64 = 0.02;

/// Error against delay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelayProfile {
    /// Delay of the controls, s.
    pub delay_s: Vec<f64>,
    /// Error of the fit, as the geometric mean over channels of its rms, relative to the best.
    pub relative_error: Vec<f64>,
}

/// Squared errors by channel, shift and block.
struct Profile {
    shifts: Vec<isize>,
    /// Samples from one shift to the next.
    grid: f64,
    /// `[channel][shift][block]`.
    errors: Vec<Vec<Vec<f64>>>,
}

/// Where a profile has its minimum, in samples.
struct Minimum {
    at: f64,
    interval: [f64; 2],
    depth: f64,
    /// Fall of the objective from no shift to here.
    fall: f64,
}

impl Profile {
    /// Σ over channels of ln Σ over blocks, less one block if asked.
    fn objective(&self, shift: usize, without: Option<usize>, totals: &[Vec<f64>]) -> f64 {
        let of = |channel: usize| totals[channel][shift] - without.map_or(0.0, |block| self.errors[channel][shift][block]);
        (0..self.errors.len()).map(|channel| of(channel).max(f64::MIN_POSITIVE).ln()).sum()
    }

    /// Least objective, refined by the parabola through the lowest point and its neighbours; an end of the range stays.
    fn lowest(&self, without: Option<usize>, totals: &[Vec<f64>]) -> Option<f64> {
        let curve: Vec<f64> = (0..self.shifts.len()).map(|shift| self.objective(shift, without, totals)).collect();
        let lowest = (0..curve.len()).min_by(|a, b| curve[*a].total_cmp(&curve[*b]))?;
        let at = *self.shifts.get(lowest)? as f64;
        if lowest == 0 || lowest + 1 == curve.len() {
            return Some(at);
        }
        let (before, after) = (curve[lowest - 1] - curve[lowest], curve[lowest + 1] - curve[lowest]);
        Some(if before + after > 0.0 { at + self.grid * 0.5 * (before - after) / (before + after) } else { at })
    }

    fn totals(&self) -> Vec<Vec<f64>> {
        self.errors.iter().map(|shifts| shifts.iter().map(|blocks| blocks.iter().sum()).collect()).collect()
    }

    fn minimum(&self) -> Option<Minimum> {
        let totals = self.totals();
        let blocks = self.errors.first()?.first()?.len();
        if blocks < FEW_BLOCKS {
            return None;
        }
        let at = self.lowest(None, &totals)?;
        let left_out: Vec<f64> = (0..blocks).map(|block| self.lowest(Some(block), &totals)).collect::<Option<_>>()?;
        let (count, mean) = (blocks as f64, left_out.iter().sum::<f64>() / blocks as f64);
        let variance = (count - 1.0) / count * left_out.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let half = quantile_975((blocks - 1) as f64) * variance.sqrt();
        let curve: Vec<f64> = (0..self.shifts.len()).map(|shift| self.objective(shift, None, &totals)).collect();
        let unshifted = self.shifts.iter().position(|shift| *shift == 0).map_or(f64::INFINITY, |shift| curve[shift]);
        let curve = curve.into_iter();
        let (low, high) = curve.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        Some(Minimum { at, interval: [at - half, at + half], depth: high - low, fall: unshifted - low })
    }
}

/// A pair of streams: the state of one, and the rate that the other gives it.
struct Pair {
    name: &'static str,
    late: &'static str,
    early: &'static str,
    /// The second stream, as `[late]` of the description calls it.
    second: &'static str,
    applies: fn(&Motion) -> bool,
    relation: Relation,
}

/// What the state of one stream changes by, given a shift of the other.
#[derive(Clone, Copy)]
enum Relation {
    /// State and rate, each of one stream alone.
    Apart(fn(&Instant) -> Vector, fn(&Instant) -> Vector),
    /// An attitude is turned by rates in axes that turn with it.
    Turned,
}

fn shifted(sample: usize, by: isize) -> usize {
    sample.saturating_add_signed(by)
}

fn squared(change: Vector, predicted: Vector) -> f64 {
    (0..3).map(|axis| (change[axis] - predicted[axis]).powi(2)).sum()
}

const PAIRS: [Pair; 4] = [
    Pair {
        name: "velocity_offset",
        late: "velocity and attitude come later than position",
        early: "velocity and attitude come earlier than position",
        second: "velocity",
        applies: |motion| motion.position && motion.heading,
        relation: Relation::Apart(|at| at.position, |at| rotate(&at.rotation, at.velocity)),
    },
    Pair {
        name: "rates_offset",
        late: "the rates come later than the attitude",
        early: "the rates come earlier than the attitude",
        second: "rates",
        applies: |_| true,
        relation: Relation::Turned,
    },
    Pair {
        name: "targets_offset",
        late: "the linear accelerations come later than the velocity",
        early: "the linear accelerations come earlier than the velocity",
        second: "acceleration",
        applies: |motion| motion.recorded,
        relation: Relation::Apart(|at| at.velocity, |at| at.linear_target),
    },
    Pair {
        name: "angular_targets_offset",
        late: "the angular targets come later than the rates",
        early: "the angular targets come earlier than the rates",
        second: "angular_acceleration",
        applies: |motion| motion.recorded,
        relation: Relation::Apart(|at| at.rates, |at| at.angular_target),
    },
];

impl Relation {
    /// Squared error of the change over each piece, by shift: `[shift][piece]`.
    fn errors(self, motion: &Motion, pieces: &[Range<usize>], shifts: &[isize]) -> Vec<Vec<f64>> {
        match self {
            Self::Apart(state, rate) => {
                // Side by side, since each is read once for each shift.
                let rates: Vec<Vector> = motion.instants.iter().map(rate).collect();
                let state = |k: usize| state(&motion.instants[k]);
                by_shift(pieces, shifts, |piece, shift| {
                    let gained = motion.integral(piece, |k| rates[shifted(k, shift)]);
                    squared(difference(state(piece.end), state(piece.start)), gained)
                })
            }
            Self::Turned => {
                let attitudes: Vec<Matrix3> = motion.instants.iter().map(|at| at.rotation).collect();
                let rates: Vec<Vector> = motion.instants.iter().map(|at| at.rates).collect();
                by_shift(pieces, shifts, |piece, shift| {
                    // Without a heading, how the vertical turns.
                    let rows = if motion.heading { 0..3 } else { 2..3 };
                    let of_row = |row: usize| {
                        let turned = motion.integral(piece, |k| cross(attitudes[k][row], rates[shifted(k, shift)]));
                        squared(difference(attitudes[piece.end][row], attitudes[piece.start][row]), turned)
                    };
                    rows.map(of_row).sum()
                })
            }
        }
    }
}

fn by_shift(pieces: &[Range<usize>], shifts: &[isize], error: impl Fn(&Range<usize>, isize) -> f64) -> Vec<Vec<f64>> {
    shifts.iter().map(|&shift| pieces.iter().map(|piece| error(piece, shift)).collect()).collect()
}

fn difference(end: Vector, start: Vector) -> Vector {
    std::array::from_fn(|axis| end[axis] - start[axis])
}

/// Accumulates all profiles over flights.
pub(super) struct Timing {
    step_s: f64,
    /// Samples from one shift to the next.
    grid: usize,
    pairs: Vec<(Pair, Profile)>,
    delays: Vec<isize>,
    /// `[channel][delay]`: ω̇x, ω̇y, ω̇z, v̇z on their own state, their control and 1.
    controls: Vec<Vec<BlockRegression<3>>>,
    /// Delays that are tried on changes.
    near: Vec<isize>,
    /// `[axis][delay]`: changes of ω̇x, ω̇y, ω̇z on those of their own rate and control. What acts slowly, and is held by the controls of a closed
    /// loop, is not in them.
    changes: Vec<Vec<BlockRegression<2>>>,
}

/// When a control acts, and half of its 95 % interval, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Acts {
    pub at_s: f64,
    pub half_s: f64,
}

impl Timing {
    /// For flights of this step.
    pub fn new(step_s: f64) -> Self {
        // Rounding of the quotient must not make the grid a sample finer.
        let grid = ((CLOSEST_SHIFTS_S / step_s * (1.0 + 1e-9)) as usize).max(1);
        let spacing = grid as isize;
        let steps = |time_s: f64| (time_s / (step_s * grid as f64)).round() as isize;
        let largest = steps(LARGEST_SHIFT_S).max(2);
        let shifts: Vec<isize> = (-largest..=largest).map(|shift| shift * spacing).collect();
        let delays = steps(CONTROL_DELAYS_S[0]).min(-1)..=steps(CONTROL_DELAYS_S[1]).max(2);
        let delays: Vec<isize> = delays.map(|delay| delay * spacing).collect();
        let profile = || Profile { errors: vec![vec![Vec::new(); shifts.len()]], shifts: shifts.clone(), grid: grid as f64 };
        let pairs = PAIRS.into_iter().map(|pair| (pair, profile())).collect();
        let controls = vec![vec![BlockRegression::new(); delays.len()]; 4];
        let near: Vec<isize> = delays.iter().copied().filter(|delay| (*delay as f64 * step_s).abs() <= NEAR_S).collect();
        let changes = vec![vec![BlockRegression::new(); near.len()]; 3];
        Self { step_s, grid, pairs, delays, controls, near, changes }
    }

    /// Adds a flight.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        // One per cent is the tolerance to which a step is called constant.
        if (motion.step_s / self.step_s - 1.0).abs() > 0.01 {
            return;
        }
        let margin = self.pairs.first().map_or(0, |(_, profile)| profile.shifts.len() / 2 * self.grid);
        for (pair, profile) in self.pairs.iter_mut().filter(|(pair, _)| (pair.applies)(motion)) {
            let (pieces, of_blocks): (Vec<Range<usize>>, Vec<usize>) = motion.pieces(margin).unzip();
            let errors = pair.relation.errors(motion, &pieces, &profile.shifts);
            for (blocks, errors) in profile.errors[0].iter_mut().zip(errors) {
                let mut open = None;
                for (error, &block) in errors.into_iter().zip(&of_blocks) {
                    if open != Some(block) {
                        open = Some(block);
                        blocks.push(0.0);
                    }
                    blocks.iter_mut().last().into_iter().for_each(|sum| *sum += error);
                }
            }
        }
        self.add_controls(flight, motion);
        self.add_changes(flight, motion);
    }

    /// Adds the blocks of others of the same step, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        for ((_, profile), (_, others)) in self.pairs.iter_mut().zip(&other.pairs) {
            let shifts = profile.errors.iter_mut().flatten().zip(others.errors.iter().flatten());
            shifts.for_each(|(blocks, others)| blocks.extend(others.chunks(together).map(|part| part.iter().sum::<f64>())));
        }
        let controls = self.controls.iter_mut().flatten().zip(other.controls.iter().flatten());
        controls.for_each(|(one, other)| one.absorb(other, together));
        let changes = self.changes.iter_mut().flatten().zip(other.changes.iter().flatten());
        changes.for_each(|(one, other)| one.absorb(other, together));
    }

    /// How many blocks the pairs have of which there are most.
    pub fn blocks(&self) -> usize {
        let pairs = self.pairs.iter().map(|(_, profile)| profile.errors[0][0].len());
        let controls = self.controls.iter().filter_map(|delays| delays.first()).map(BlockRegression::blocks);
        pairs.chain(controls).max().unwrap_or(0)
    }

    /// Of these blocks only.
    pub fn part(&self, range: Range<usize>) -> Self {
        let mut part = Self::new(self.step_s);
        for ((_, profile), (_, own)) in part.pairs.iter_mut().zip(&self.pairs) {
            let shifts = profile.errors.iter_mut().flatten().zip(own.errors.iter().flatten());
            shifts.for_each(|(blocks, own)| blocks.extend(own.iter().take(range.end).skip(range.start)));
        }
        let controls = part.controls.iter_mut().flatten().zip(self.controls.iter().flatten());
        controls.for_each(|(one, own)| *one = own.part(range.clone()));
        let changes = part.changes.iter_mut().flatten().zip(self.changes.iter().flatten());
        changes.for_each(|(one, own)| *one = own.part(range.clone()));
        part
    }

    fn add_controls(&mut self, flight: usize, motion: &Motion) {
        let margin = self.delays.iter().map(|delay| delay.unsigned_abs()).max().unwrap_or(0);
        let end = motion.instants.len().saturating_sub(margin);
        let every = ((CLOSEST_LOOKS_S / motion.step_s).round() as usize).max(1);
        for (sample, now) in motion.instants.iter().enumerate().take(end).skip(margin).step_by(every) {
            let block = (flight, sample / motion.block_samples());
            let heave = now.linear_target[2] + cross(now.rates, now.velocity)[2] - now.gravity[2];
            let [wx, wy, wz] = now.angular_target;
            let channels = [(now.rates[0], wx, 0), (now.rates[1], wy, 1), (now.rates[2], wz, 2), (now.velocity[2], heave, 3)];
            for (index, delay) in self.delays.iter().enumerate() {
                let controls = motion.instants[shifted(sample, -delay)].controls;
                for (channel, (state, target, control)) in channels.into_iter().enumerate() {
                    self.controls[channel][index].add(block, &[state, controls[control], 1.0], target);
                }
            }
        }
    }

    /// What u1, u2 and u3 and their axes do from one sample, or look at a log that is faster, to the next.
    fn add_changes(&mut self, flight: usize, motion: &Motion) {
        let margin = self.near.iter().map(|delay| delay.unsigned_abs()).max().unwrap_or(0);
        let over = ((CHANGE_S / motion.step_s).round() as usize).max(1);
        let end = motion.instants.len().saturating_sub(margin);
        for sample in (margin + over..end).step_by(self.grid) {
            let block = (flight, sample / motion.block_samples());
            let (now, then) = (&motion.instants[sample], &motion.instants[sample - over]);
            for (index, delay) in self.near.iter().enumerate() {
                let [controls, before] = [sample, sample - over].map(|at| motion.instants[shifted(at, -delay)].controls);
                for (axis, changes) in self.changes.iter_mut().enumerate() {
                    let row = [now.rates[axis] - then.rates[axis], controls[axis] - before[axis]];
                    changes[index].add(block, &row, now.angular_target[axis] - then.angular_target[axis]);
                }
            }
        }
    }

    /// Offsets between streams that lower the squared error by this in its logarithm.
    pub fn offsets(&self, least_fall: f64) -> Vec<Finding> {
        let step_s = self.step_s;
        self.pairs
            .iter()
            .filter(|(_, profile)| !profile.errors[0][0].is_empty())
            .map(|(pair, profile)| offset(pair, profile, step_s, least_fall))
            .collect()
    }

    /// How late each stick acts by itself, where its axis is explained by it.
    pub fn sticks(&self) -> Vec<Finding> {
        let of = |(stick, delays): (usize, &Vec<BlockRegression<3>>)| {
            let errors: Vec<Vec<f64>> = delays.iter().map(BlockRegression::errors).collect::<Option<_>>()?;
            let profile = Profile { shifts: self.delays.clone(), errors: vec![errors], grid: self.grid as f64 };
            let minimum = profile.minimum().filter(|minimum| minimum.depth > LEAST_DEPTH)?;
            let nearest = self.delays.iter().position(|delay| *delay as f64 >= minimum.at.round())?;
            delays[nearest].explained().filter(|share| *share > EXPLAINED)?;
            let name = STICKS[stick];
            let at_s = minimum.at * self.step_s;
            Some(Finding {
                name: format!("delay_{name}"),
                subject: Subject::Timing,
                verdict: if minimum.interval[1] < -profile.grid { Severity::Warning } else { Severity::Ok },
                measured: Some(at_s),
                interval: Some(minimum.interval.map(|samples| samples * self.step_s)),
                expected: None,
                unit: "s".into(),
                message: format!("{name} comes late: it is recorded {:.0} ms after it acts", -1e3 * at_s),
                set: Some(format!("[late] {name} = {:.3}", -at_s)),
                flights: Vec::new(),
            })
        };
        self.controls.iter().enumerate().filter_map(of).collect()
    }

    /// When u1, u2 and u3 act on their axes, by what both do from one sample to the next.
    pub fn acts(&self) -> [Option<Acts>; 3] {
        std::array::from_fn(|axis| {
            let errors: Vec<Vec<f64>> = self.changes[axis].iter().map(BlockRegression::errors).collect::<Option<_>>()?;
            let profile = Profile { shifts: self.near.clone(), errors: vec![errors], grid: self.grid as f64 };
            let minimum = profile.minimum().filter(|minimum| minimum.depth > LEAST_DEPTH)?;
            let half_s = 0.5 * (minimum.interval[1] - minimum.interval[0]) * self.step_s;
            Some(Acts { at_s: minimum.at * self.step_s, half_s })
        })
    }

    /// The delay of the controls, common to all, and its profile.
    pub fn control_delay(&self, of_model_s: Option<f64>) -> (Finding, Option<DelayProfile>) {
        let step_s = self.step_s;
        let mut finding = Finding {
            name: "control_delay".into(),
            subject: Subject::Timing,
            verdict: Severity::Undetermined,
            measured: None,
            interval: None,
            expected: of_model_s,
            unit: "s".into(),
            message: "these flights do not tell: the controls explain too little, or stand still".into(),
            set: None,
            flights: Vec::new(),
        };
        // A channel whose control stands still says nothing about its delay.
        let errors: Vec<Vec<Vec<f64>>> =
            self.controls.iter().filter_map(|delays| delays.iter().map(BlockRegression::errors).collect()).collect();
        if errors.is_empty() {
            return (finding, None);
        }
        let profile = Profile { shifts: self.delays.clone(), errors, grid: self.grid as f64 };
        let grid_s = step_s * self.grid as f64;
        let totals = profile.totals();
        let curve: Vec<f64> = (0..profile.shifts.len()).map(|shift| profile.objective(shift, None, &totals)).collect();
        let least = curve.iter().copied().fold(f64::INFINITY, f64::min);
        let channels = profile.errors.len() as f64;
        let shown = DelayProfile {
            delay_s: profile.shifts.iter().map(|shift| *shift as f64 * step_s).collect(),
            relative_error: curve.iter().map(|value| (0.5 * (value - least) / channels).exp()).collect(),
        };
        let Some(minimum) = profile.minimum().filter(|minimum| minimum.depth > LEAST_DEPTH) else { return (finding, Some(shown)) };
        let [low, high] = minimum.interval.map(|samples| samples * step_s);
        let delay_s = minimum.at * step_s;
        (finding.measured, finding.interval, finding.verdict) = (Some(delay_s), Some([low, high]), Severity::Ok);
        let at_end = [profile.shifts.first(), profile.shifts.last()].into_iter().flatten().any(|end| *end as f64 == minimum.at);
        if high < -grid_s {
            finding.verdict = Severity::Warning;
            finding.message =
                "the controls are recorded after they act, or a feedback loop drives them; look at the log's time stamps".into();
        } else {
            finding.message =
                format!("controls act this late{}", if at_end { ", or later: the end of the range tried" } else { "" });
            let written = delay_s.max(0.0);
            finding.set = Some(format!("control_delay_s = {written:.3} under [data] in the model file"));
            if of_model_s.is_some_and(|model_s| model_s < low - grid_s || model_s > high + grid_s) {
                finding.verdict = Severity::Warning;
                finding.message.push_str(", which is not what the model says");
            } else if at_end {
                finding.verdict = Severity::Warning;
            }
        }
        (finding, Some(shown))
    }
}

fn offset(pair: &Pair, profile: &Profile, step_s: f64, least_fall: f64) -> Finding {
    let mut finding = Finding {
        name: pair.name.into(),
        subject: Subject::Timing,
        verdict: Severity::Undetermined,
        measured: None,
        interval: None,
        expected: Some(0.0),
        unit: "s".into(),
        message: "these flights do not tell".into(),
        set: None,
        flights: Vec::new(),
    };
    let Some(minimum) = profile.minimum().filter(|minimum| minimum.depth > LEAST_DEPTH) else { return finding };
    finding.measured = Some(minimum.at * step_s);
    finding.interval = Some(minimum.interval.map(|samples| samples * step_s));
    let [low, high] = minimum.interval;
    // Half a sample (half a shift, where these are further apart) is what sampling itself leaves open.
    if minimum.at.abs() > profile.grid && minimum.fall >= least_fall && (low > 0.5 * profile.grid || high < -0.5 * profile.grid) {
        finding.verdict = Severity::Warning;
        let late = minimum.at > 0.0;
        finding.message = format!("{} by {:.0} ms", if late { pair.late } else { pair.early }, 1e3 * (minimum.at * step_s).abs());
        // Of two streams either may be the wrong one.
        finding.set = Some(format!("[late] {} = {:.3}", pair.second, minimum.at * step_s));
    } else {
        finding.verdict = Severity::Ok;
        finding.message = "in step".into();
    }
    finding
}
