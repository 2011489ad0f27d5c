//! What would mend a broken relation of mechanics where no reading of whole streams does: one column that is late, filtered, scaled or off, that goes
//! with a stick, settles from its start, swings, lost its sign, overflows or is noisy, or rows that do not follow each other; what several columns share is in
//! `jointly`, and what a vector has too much of in `contents`.
//! Each is tried on the channels of one flight, and the one that leaves least is the cause if it leaves little. Which flights stand out from the others is
//! the business of `unexplained`; here each is taken by itself.

use super::channels::{Channel, Stream, difference};
use super::contents::{self, Part};
use super::increments::{Motion, Vector};
use super::jointly;
use super::lost;
use super::repairs::Trial;
use super::robust::median;
use super::stray;
use super::streams::grain;
use crate::flight::Column;

/// A relation is broken where this share of the root mean square of the changes is left.
const LEAST_SHARE: f64 = 0.05;
/// A cause is one where with it this part of the squared errors is left at most.
pub(super) const LITTLE: f64 = 0.2;
/// A channel of a stream is not broken by itself where it is so much less than another of the same stream: angles turn into each other.
const BY_ITSELF: f64 = 0.1;
/// What is wrong with a state is wrong in both of its relations: another one is broken as well from this part of the share on.
pub(super) const AS_WELL: f64 = 0.02;
/// Pieces at least, for a fit.
pub(super) const FEWEST_PIECES: usize = 40;

/// Where so much of the squares lies in this share of the pieces, a column leaps …
const HELD: f64 = 0.8;
/// … and rows do, where so many channels leap.
const IN_PLACES: f64 = 0.1;
pub(super) const LEAPING: usize = 5;
/// A leap is the work of one step where that makes this part of it.
const IN_ONE_STEP: f64 = 0.5;
/// Ends of a range agree with a leap to this part of it.
pub(super) const NEAR: f64 = 0.25;
/// Leaps to and fro are so many at least …
const TO_AND_FRO: usize = 6;
/// … and alike to this part of them.
const ALIKE: f64 = 0.05;

/// Noise is white where squares of pieces are those that steps of independent noise make, to this factor.
const WHITE: f64 = 2.0;
/// Rounding makes errors of the size of its step, to this factor: two of them make up a change, each a step over √12.
const ROUNDING: f64 = 5.0;
/// From a time on, where less than this part of the squares lies before it …
const BEFORE: f64 = 0.01;
/// … and that lies within this part of the flight.
const WITHIN: [f64; 2] = [0.15, 0.85];

/// What is wrong with a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// It comes late, s; early, if negative.
    Late(f64),
    /// It passed a filter of first order with this time constant, s.
    Filtered(f64),
    /// It is a mean over this time about each sample, s.
    Averaged(f64),
    /// It is so many times what it should be.
    Scaled(f64),
    /// It has this too much.
    Off(f64),
    /// It has too much by a number that grows so much each second.
    Drifts(f64),
    /// It goes with a control, in its unit for one of the control.
    Follows(usize, f64),
    /// It starts so far off, and settles with this time constant, s.
    Settles(f64, f64),
    /// It has only one sign.
    SignLost,
    /// It goes on from the other end of this range, or from 0 where there should be a sign.
    Overflows(f64),
    /// It swings on its own at this frequency, Hz, with this damping ratio.
    Swings(f64, f64),
    /// Of a vector, by rows, how much it has too much for one of each component of another.
    Holds(Part, [Vector; 3]),
    /// It is wrong by so much, root mean square, as what it moves and what moves it agree; slowly changing, or not.
    Stray(f64, bool),
    /// It leaps.
    Leaps,
    /// White noise, or vibration: root mean square.
    Noise(f64),
    /// It is rounded to this step.
    Rounded(f64),
    /// Measured so far from the centre of gravity, m.
    OffCentre(Vector),
    /// Rows do not follow each other.
    Rows,
    /// Steps of time are so many times as long as stamped, in the shortest and the longest of them.
    Pace([f64; 2]),
    /// A derivative is so many times as large as it should be, another time at each sample, in the smallest and the largest.
    Factors([f64; 2]),
}

impl Kind {
    /// By how much, where that is one number.
    pub const fn size(&self) -> f64 {
        match *self {
            Self::Late(value)
            | Self::Filtered(value)
            | Self::Averaged(value)
            | Self::Scaled(value)
            | Self::Off(value)
            | Self::Drifts(value)
            | Self::Follows(_, value)
            | Self::Settles(value, _)
            | Self::Overflows(value)
            | Self::Swings(value, _)
            | Self::Stray(value, _)
            | Self::Noise(value)
            | Self::Rounded(value) => value,
            Self::SignLost | Self::Holds(..) | Self::Leaps | Self::OffCentre(_) | Self::Rows | Self::Pace(_) | Self::Factors(_) => {
                0.0
            }
        }
    }

    /// Begin of the finding's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Late(_) => "late",
            Self::Filtered(_) => "filtered",
            Self::Averaged(_) => "averaged",
            Self::Scaled(_) => "scaled",
            Self::Off(_) => "off",
            Self::Drifts(_) => "drifting",
            Self::Follows(..) => "disturbed",
            Self::Settles(..) => "settling",
            Self::SignLost => "sign_lost",
            Self::Overflows(_) => "overflow",
            Self::Swings(..) => "swinging",
            Self::Holds(..) => "holds_other",
            Self::Stray(..) => "stray",
            Self::Leaps => "leaps",
            Self::Noise(_) => "noisy",
            Self::Rounded(_) => "rounded",
            Self::OffCentre(_) => "off_centre",
            Self::Rows => lost::ROWS,
            Self::Pace(_) => "uneven_time",
            Self::Factors(_) => "uneven_factors",
        }
    }
}

/// What is wrong in one flight.
#[derive(Clone, Debug)]
pub(super) struct Cause {
    pub kind: Kind,
    /// The columns that it is wrong with.
    pub columns: Vec<Column>,
    /// Where the accelerations or the position are missing, what it may be in their place.
    pub or: Option<&'static str>,
    /// The first of the few places where it is wrong, or since when it is, s.
    pub from_s: Option<f64>,
}

/// The causes in a flight.
pub(super) fn of(motion: &Motion) -> Vec<Cause> {
    let channels = Channel::all(motion);
    let broken: Vec<Broken<'_>> = channels.iter().filter_map(Broken::of).collect();
    let leaping = broken.iter().filter(|one| one.leaps().is_some()).count();
    if leaping >= LEAPING {
        let from_s = broken.iter().filter_map(|one| Some(one.at_s(*one.leaps()?.first()?))).reduce(f64::min);
        return vec![Cause { kind: Kind::Rows, columns: Vec::new(), or: None, from_s }];
    }
    if let Some(cause) = jointly::uneven_time(&channels, broken.len()) {
        return vec![cause];
    }
    let off_centre = jointly::off_centre(motion, &broken);
    let off_zero = jointly::off_zero(motion, &channels, &broken);
    let holds = if off_centre.is_some() { Vec::new() } else { contents::of(motion, &channels, &broken) };
    let is_told = |one: &&Broken<'_>| {
        let stream = one.channel.stream;
        let is_alone = match stream {
            Stream::Velocity => off_centre.is_none(),
            Stream::Attitude => off_zero.is_none(),
            Stream::Position | Stream::Rates => true,
        };
        is_alone && !holds.iter().any(|cause| contents::explains(cause, stream))
    };
    let of_several = off_centre.iter().chain(&off_zero).chain(&holds).cloned();
    let mut causes: Vec<(Option<Blame>, Cause)> = of_several.map(|cause| (None, cause)).collect();
    for one in broken.iter().filter(is_told) {
        let Some(blame) = one.blamed(&channels, &broken) else { continue };
        let Some((kind, from_s)) = one.cause(blame.is_state, motion) else { continue };
        let is_alike = |(other, cause): &&mut (Option<Blame>, Cause)| {
            let same = |other: Blame| (other.stream, other.is_state) == (blame.stream, blame.is_state);
            other.is_some_and(same) && std::mem::discriminant(&cause.kind) == std::mem::discriminant(&kind)
        };
        match causes.iter_mut().find(is_alike) {
            Some((_, other)) => other.columns.push(blame.column),
            None => {
                let cause = Cause { kind, columns: vec![blame.column], or: blame.or, from_s };
                causes.push((Some(blame), cause));
            }
        }
    }
    let mut causes: Vec<Cause> = causes.into_iter().map(|entry| entry.1).collect();
    causes.extend(jointly::uneven_factors(&channels, &broken, &causes));
    causes.extend(stray::of(motion, &channels, &broken, &causes));
    causes
}

/// The column that is to blame for a channel that does not fit.
#[derive(Clone, Copy)]
struct Blame {
    stream: Stream,
    column: Column,
    /// It is the one that changes, and not what says how fast.
    is_state: bool,
    /// Where no other relation tells the two apart, the other one.
    or: Option<&'static str>,
}

/// A channel that does not fit.
pub(super) struct Broken<'a> {
    pub channel: &'a Channel,
    pub errors: Vec<f64>,
    pub square: f64,
    /// Squared errors over the squares of the changes.
    pub share: f64,
}

impl<'a> Broken<'a> {
    fn of(channel: &'a Channel) -> Option<Self> {
        let errors = channel.errors();
        let square: f64 = errors.iter().map(|error| error * error).sum();
        let share = square / channel.size();
        // A column that stands still is the business of `streams`.
        let moves = channel.state.windows(2).any(|pair| pair[0] != pair[1]);
        (moves && errors.len() >= FEWEST_PIECES && share > LEAST_SHARE * LEAST_SHARE && share.is_finite()).then_some(Self {
            channel,
            errors,
            square,
            share,
        })
    }

    fn at_s(&self, piece: usize) -> f64 {
        self.channel.pieces[piece].start as f64 * self.channel.step_s
    }

    /// Which of the two columns is to blame, by the other relation of the state; `None` where that one tells more.
    fn blamed(&self, channels: &[Channel], broken: &[Self]) -> Option<Blame> {
        let has = |stream: Stream| channels.iter().any(|one| one.stream == stream);
        let largest =
            |stream: Stream| broken.iter().filter(|one| one.channel.stream == stream).map(|one| one.share).fold(0.0, f64::max);
        let is_broken = |stream: Stream| largest(stream) > AS_WELL * largest(self.channel.stream);
        let Channel { stream, column, rate_column, .. } = *self.channel;
        let state = |or| Some(Blame { stream, column, is_state: true, or });
        let rate = |or| rate_column.map(|column| Blame { stream, column, is_state: false, or });
        match stream {
            Stream::Position if is_broken(Stream::Velocity) || is_broken(Stream::Attitude) => None,
            Stream::Attitude if is_broken(Stream::Rates) || self.share < BY_ITSELF * largest(stream) => None,
            Stream::Position => state((!has(Stream::Velocity)).then_some("the velocity")),
            Stream::Attitude => state((!has(Stream::Rates)).then_some("the rates")),
            // A wrong velocity moves no position rightly, and wrong rates turn nothing so.
            Stream::Velocity if is_broken(Stream::Position) => state(None),
            Stream::Rates if is_broken(Stream::Attitude) => state(None),
            Stream::Velocity if !has(Stream::Position) => rate(Some(column.name())),
            Stream::Velocity | Stream::Rates => rate(None),
        }
    }

    /// The least that any cause of a single column leaves of its squares, whichever of the two columns is wrong.
    pub fn least_left(&self, motion: &Motion) -> f64 {
        let trials = [true, false].map(|is_state| Trial { broken: self, from: 0, is_state });
        trials.iter().flat_map(|trial| trial.all(motion)).map(|one| one.0).fold(self.square, f64::min)
    }

    fn usual_error(&self) -> f64 {
        (self.square / self.errors.len() as f64).sqrt()
    }

    /// The pieces that hold most of the squared errors, in order, where they are few and each is the work of one step.
    pub fn leaps(&self) -> Option<Vec<usize>> {
        let mut order: Vec<usize> = (0..self.errors.len()).collect();
        order.sort_unstable_by(|one, other| self.errors[*other].abs().total_cmp(&self.errors[*one].abs()));
        let mut rest = HELD * self.square;
        let last = order.iter().position(|&piece| {
            rest -= self.errors[piece].powi(2);
            rest <= 0.0
        })?;
        order.truncate(last + 1);
        order.sort_unstable();
        let is_leap =
            |piece: &usize| self.step_errors(*piece).any(|(_, step)| step.abs() > IN_ONE_STEP * self.errors[*piece].abs());
        let are_few = order.len() as f64 <= IN_PLACES * self.errors.len() as f64;
        (are_few && order.iter().filter(|piece| is_leap(piece)).count() * 4 >= order.len() * 3).then_some(order)
    }

    /// What changes from sample to sample beside what f says, with the sample after the step.
    fn step_errors(&self, piece: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let channel = self.channel;
        let piece = channel.pieces[piece].clone();
        (piece.start + 1..=piece.end).map(move |k| (k, channel.change(&(k - 1..k)) - difference(&channel.sum, &(k - 1..k))))
    }

    /// What mends it, and from when on it is needed.
    fn cause(&self, is_state: bool, motion: &Motion) -> Option<(Kind, Option<f64>)> {
        let column = if is_state { &self.channel.state } else { &self.channel.rate };
        // Steps that are as large as the errors are make them.
        let step = grain(column.clone()).1.filter(|step| is_state && (step / self.usual_error()).ln().abs() < ROUNDING.ln());
        if let Some(step) = step {
            return Some((Kind::Rounded(step), None));
        }
        if let Some(leaps) = self.leaps() {
            let from_s = Some(self.at_s(leaps[0]));
            return is_state.then(|| (self.overflow(&leaps).map_or(Kind::Leaps, Kind::Overflows), from_s));
        }
        let whole = Trial { broken: self, from: 0, is_state };
        if let Some(kind) = whole.best(motion) {
            return Some((kind, None));
        }
        let from = self.begin().map(|from| Trial { from, ..whole });
        let later = from.and_then(|trial| Some((trial.best(motion)?, Some(self.at_s(trial.from)))));
        later.or_else(|| Some((self.noise(is_state)?, None)))
    }

    /// The range, where leaps go from one of its ends to the other, or to and fro by as much each time.
    fn overflow(&self, leaps: &[usize]) -> Option<f64> {
        let state = &self.channel.state;
        let step = |piece: &usize| self.step_errors(*piece).max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()));
        let steps: Vec<(usize, f64)> = leaps.iter().filter_map(step).collect();
        let limit = 0.5 * median(steps.iter().map(|step| step.1.abs()).collect())?;
        let is_near = |value: f64, end: f64| (value - end).abs() < NEAR * limit;
        let goes_round = |&&(k, step): &&(usize, f64)| {
            let end = limit * step.signum();
            is_near(state[k], end) && is_near(state[k - 1], -end)
        };
        let is_alike = |step: &&(usize, f64)| (0.5 * step.1.abs() - limit).abs() < ALIKE * limit;
        let is_most = |count: usize| count * 4 >= steps.len() * 3;
        let goes_both_ways = steps.iter().any(|step| step.1 > 0.0) && steps.iter().any(|step| step.1 < 0.0);
        let is_to_and_fro = steps.len() >= TO_AND_FRO && goes_both_ways && is_most(steps.iter().filter(is_alike).count());
        (is_most(steps.iter().filter(goes_round).count()) || is_to_and_fro).then_some(2.0 * limit)
    }

    /// The piece from which on errors are, if there are none before and there is much of the flight on both sides.
    fn begin(&self) -> Option<usize> {
        let mut before = 0.0;
        let begin = self.errors.iter().position(|error| {
            before += error * error;
            before > BEFORE * self.square
        })?;
        let place = begin as f64 / self.errors.len() as f64;
        (WITHIN[0]..WITHIN[1]).contains(&place).then_some(begin)
    }

    /// White noise of the column: steps of a noisy state undo each other, those of a noisy derivative add up, and pieces tell.
    fn noise(&self, is_state: bool) -> Option<Kind> {
        let (mut square, mut count) = (0.0, 0.0);
        for (_, step) in (0..self.errors.len()).flat_map(|piece| self.step_errors(piece)) {
            square += step * step;
            count += 1.0;
        }
        let of_step = square / count;
        let of_piece = self.square / self.errors.len() as f64;
        let steps = count / self.errors.len() as f64;
        let (white, rms) = if is_state {
            (of_step, (0.5 * of_step).sqrt())
        } else {
            // A step is the mean of two samples times its length; over a piece the samples add up.
            (2.0 * steps * of_step, (2.0 * of_step).sqrt() / self.channel.step_s)
        };
        (1.0 / WHITE..WHITE).contains(&(of_piece / white)).then_some(Kind::Noise(rms))
    }
}
