//! Repairs of one column that are tried where a relation of mechanics is broken, each with what it leaves: late, filtered, averaged, scaled, off, settling, along
//! with a stick, swinging, without its signs, beyond its range. Which relation is broken, which column is to blame and what else it may be is in `causes`.

use super::causes::{Broken, FEWEST_PIECES, Kind, LITTLE, NEAR};
use super::channels::{difference, summed};
use super::increments::Motion;
use super::robust::median;
use std::ops::Range;

/// Shifts that are tried, s.
const LATEST_S: f64 = 0.6;
/// Time constants of a filter, s.
const FILTERS_S: [f64; 9] = [0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.45, 0.7, 1.0];
/// Lengths of a moving mean, s.
const MEANS_S: [f64; 7] = [0.1, 0.15, 0.2, 0.3, 0.45, 0.7, 1.0];
/// Time constants of what settles, s.
const SETTLING_S: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
/// What settles does so within this part of the flight: a slower decay is a drift.
const SETTLED: f64 = 0.25;

/// A cause of two numbers is one where it leaves this part of what those of one do.
const BETTER: f64 = 0.5;
/// What swings does so at this frequency at least, Hz, …
const SWINGS_HZ: f64 = 0.5;
/// … at this part of the rate of samples at most, since noise goes with its own second difference as what swings at a quarter of it, …
const SWINGS_OF_RATE: f64 = 0.12;
/// … and with less than this damping ratio.
const DAMPED: f64 = 0.5;
/// Leaps of a derivative that overflows are so many times its usual steps at least.
const FAR: f64 = 20.0;

/// Causes that are tried on the pieces of a channel from one on.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a> {
    pub broken: &'a Broken<'a>,
    pub from: usize,
    /// It is the column that changes that may be wrong, not what says how fast.
    pub is_state: bool,
}

impl Trial<'_> {
    fn pieces(&self) -> &[Range<usize>] {
        &self.broken.channel.pieces[self.from..]
    }

    fn errors(&self) -> &[f64] {
        &self.broken.errors[self.from..]
    }

    /// The cause that leaves least, if that is little.
    pub fn best(&self, motion: &Motion) -> Option<Kind> {
        let square: f64 = self.errors().iter().map(|error| error * error).sum();
        if self.pieces().len() < FEWEST_PIECES {
            return None;
        }
        let (left, kind) = self.all(motion).into_iter().min_by(|one, other| one.0.total_cmp(&other.0))?;
        (left < LITTLE * square).then_some(kind)
    }

    /// What each cause leaves.
    pub fn all(&self, motion: &Motion) -> Vec<(f64, Kind)> {
        let mut all = vec![self.late(), self.filtered(), self.averaged(), self.scaled(), self.off(), self.settles()];
        all.extend((0..4).map(|control| self.follows(motion, control)));
        all.extend(self.sign_lost());
        let simplest = all.iter().map(|one| one.0).fold(f64::INFINITY, f64::min);
        all.extend(self.swings().filter(|one| one.0 < BETTER * simplest));
        all.extend(self.wraps());
        all
    }

    /// The errors on two features of a piece: what is left, and the coefficients.
    fn on_two(&self, features: impl Fn(&Range<usize>) -> [f64; 2]) -> Option<(f64, [f64; 2])> {
        let (mut gram, mut moment, mut square) = (nalgebra::Matrix2::<f64>::zeros(), nalgebra::Vector2::<f64>::zeros(), 0.0);
        for (piece, error) in self.pieces().iter().zip(self.errors()) {
            let row = nalgebra::Vector2::from(features(piece));
            gram += row * row.transpose();
            moment += *error * row;
            square += error * error;
        }
        let solution = gram.cholesky()?.solve(&moment);
        Some((square - moment.dot(&solution), solution.into()))
    }

    /// A sensor on springs: s″ + 2 ζ ω s′ + ω² s = ω² s₀ for what it shows, s, of what there is, s₀.
    fn swings(&self) -> Option<(f64, Kind)> {
        let (channel, step_s) = (self.broken.channel, self.broken.channel.step_s);
        let column = if self.is_state { &channel.state } else { &channel.rate };
        let last = column.len().checked_sub(2)?;
        let at = |k: usize| k.clamp(1, last);
        let first = |k: usize| (column[at(k) + 1] - column[at(k) - 1]) / (2.0 * step_s);
        let second = |k: usize| (column[at(k) + 1] - 2.0 * column[at(k)] + column[at(k) - 1]) / (step_s * step_s);
        // A state: e = Δs − ∫ f = −(Δs″ / ω² + 2 ζ Δs′ / ω). A derivative f: e = (Δf′ / ω² + 2 ζ Δf / ω).
        let (left, [of_second, of_first]) = if self.is_state {
            self.on_two(|piece| [second(piece.start) - second(piece.end), first(piece.start) - first(piece.end)])?
        } else {
            self.on_two(|piece| [first(piece.end) - first(piece.start), column[piece.end] - column[piece.start]])?
        };
        if of_second <= 0.0 {
            return None;
        }
        let frequency = of_second.powf(-0.5);
        let (frequency_hz, damping) = (frequency / std::f64::consts::TAU, 0.5 * of_first * frequency);
        let is_one = (SWINGS_HZ..SWINGS_OF_RATE / step_s).contains(&frequency_hz) && (0.0..DAMPED).contains(&damping);
        is_one.then_some((left, Kind::Swings(frequency_hz, damping)))
    }

    /// A column that leaps to and fro by the same amount, as counts do that are read without their sign or beyond their range.
    fn wraps(&self) -> Option<(f64, Kind)> {
        let channel = self.broken.channel;
        let column = if self.is_state { &channel.state } else { &channel.rate };
        let steps = || column.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let largest = steps().fold(0.0, f64::max);
        let is_leap = |step: &f64| *step > (1.0 - NEAR) * largest;
        let usual = steps().sum::<f64>() / column.len() as f64;
        let before = steps().filter(|step| !is_leap(step)).fold(0.0, f64::max);
        let range = median(steps().filter(is_leap).collect())?;
        if steps().filter(is_leap).count() < 2 || range < FAR * usual || before > 0.5 * range {
            return None;
        }
        // Each leap undone, from a first value that may be beyond already.
        let undone = |beyond: f64| {
            let mut turns = beyond;
            let of = |k: usize| {
                if k > 0 {
                    turns -= ((column[k] - column[k - 1]) / range).round();
                }
                column[k] + range * turns
            };
            let undone: Vec<f64> = (0..column.len()).map(of).collect();
            if self.is_state {
                let of_piece = |piece: &Range<usize>| (difference(&undone, piece) - difference(&channel.sum, piece)).powi(2);
                return self.pieces().iter().map(of_piece).sum();
            }
            let sum = summed(&undone, channel.step_s);
            self.left(|piece| difference(&sum, piece))
        };
        let left = [-1.0, 0.0, 1.0].map(undone).into_iter().fold(f64::INFINITY, f64::min);
        Some((left, Kind::Overflows(range)))
    }

    /// Squares that are left where f summed is this.
    fn left(&self, summed: impl Fn(&Range<usize>) -> f64) -> f64 {
        self.pieces().iter().map(|piece| (self.broken.channel.change(piece) - summed(piece)).powi(2)).sum()
    }

    /// The errors on one feature of a piece: what is left, and the coefficient.
    fn on(&self, feature: impl Fn(&Range<usize>) -> f64) -> (f64, f64) {
        let (mut moment, mut square, mut error_square) = (0.0, 0.0, 0.0);
        for (piece, error) in self.pieces().iter().zip(self.errors()) {
            let feature = feature(piece);
            moment += feature * error;
            square += feature * feature;
            error_square += error * error;
        }
        if square > 0.0 { (error_square - moment * moment / square, moment / square) } else { (error_square, 0.0) }
    }

    fn late(&self) -> (f64, Kind) {
        let channel = self.broken.channel;
        let (last, most) = (channel.sum.len() as isize - 1, (LATEST_S / channel.step_s).round() as isize);
        let at = |sample: usize, shift: isize| channel.sum[(sample as isize - shift).clamp(0, last) as usize];
        let of = |shift: isize| (self.left(|piece| at(piece.end, shift) - at(piece.start, shift)), shift);
        let (left, shift) = (-most..=most).map(of).min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, 0));
        // By less than a sample: s is late by as much as it lacks of f's change.
        let (left_by_part, part_s) = self.on(|piece| difference(&channel.rate, piece));
        let (left, late_s) = if left_by_part < left && part_s.abs() < channel.step_s {
            (left_by_part, -part_s)
        } else {
            (left, shift as f64 * channel.step_s)
        };
        (left, Kind::Late(if self.is_state { late_s } else { -late_s }))
    }

    fn filtered(&self) -> (f64, Kind) {
        let channel = self.broken.channel;
        let of = |time_s: f64| {
            let left = if self.is_state {
                let sum = summed(&lagged(&channel.rate, time_s, channel.step_s), channel.step_s);
                self.left(|piece| difference(&sum, piece))
            } else {
                let state = lagged(&channel.state, time_s, channel.step_s);
                let of_piece = |piece: &Range<usize>| (difference(&state, piece) - difference(&channel.sum, piece)).powi(2);
                self.pieces().iter().map(of_piece).sum()
            };
            (left, Kind::Filtered(time_s))
        };
        let nearest = FILTERS_S.map(of).into_iter().min_by(|one, other| one.0.total_cmp(&other.0));
        let Some((left, Kind::Filtered(time_s))) = nearest else { return (f64::INFINITY, Kind::Leaps) };
        (left, Kind::Filtered(self.time_constant_s(time_s)))
    }

    /// The time constant of the filter, s, which is near this one. A state s behind it: s + T s′ = s₀, so e = −T Δs′. A derivative f: f + T f′ = f₀, so
    /// e = T Δf.
    fn time_constant_s(&self, near_s: f64) -> f64 {
        let channel = self.broken.channel;
        let found_s = if self.is_state {
            let rate = lagged(&channel.rate, near_s, channel.step_s);
            -self.on(|piece| difference(&rate, piece)).1
        } else {
            self.on(|piece| difference(&channel.rate, piece)).1
        };
        // The next ones of those that are tried are not farther.
        if (0.5..2.0).contains(&(found_s / near_s)) { found_s } else { near_s }
    }

    fn averaged(&self) -> (f64, Kind) {
        let channel = self.broken.channel;
        let of = |time_s: f64| {
            let reach = (0.5 * time_s / channel.step_s).round() as usize;
            let left = if self.is_state {
                let sum = averaged(&channel.sum, reach);
                self.left(|piece| difference(&sum, piece))
            } else {
                let state = averaged(&channel.state, reach);
                let of_piece = |piece: &Range<usize>| (difference(&state, piece) - difference(&channel.sum, piece)).powi(2);
                self.pieces().iter().map(of_piece).sum()
            };
            (left, Kind::Averaged(time_s))
        };
        MEANS_S.map(of).into_iter().min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, Kind::Leaps))
    }

    fn scaled(&self) -> (f64, Kind) {
        let (left, beyond) = self.on(|piece| difference(&self.broken.channel.sum, piece));
        let times = 1.0 + beyond;
        (left, Kind::Scaled(if self.is_state { times } else { 1.0 / times }))
    }

    fn off(&self) -> (f64, Kind) {
        let step_s = self.broken.channel.step_s;
        // An offset of a state changes nothing.
        if self.is_state {
            return (f64::INFINITY, Kind::Off(0.0));
        }
        let (left, by) = self.on(|piece| step_s * (piece.end - piece.start) as f64);
        (left, Kind::Off(-by))
    }

    fn settles(&self) -> (f64, Kind) {
        let step_s = self.broken.channel.step_s;
        // What starts farther off than the column ever goes was fitted to a time when it had long settled.
        let state = &self.broken.channel.state;
        let [low, high] = [f64::min, f64::max].map(|of| state.iter().copied().reduce(of).unwrap_or(0.0));
        let of = |time_s: f64| {
            let at = |sample: usize| (-step_s * sample as f64 / time_s).exp();
            let (left, by) = self.on(|piece| at(piece.end) - at(piece.start));
            (if by.abs() <= 2.0 * (high - low) { left } else { f64::INFINITY }, Kind::Settles(by, time_s))
        };
        let longest_s = SETTLED * step_s * self.broken.channel.state.len() as f64;
        let trials = SETTLING_S.into_iter().filter(|time_s| self.is_state && *time_s < longest_s);
        trials.map(of).min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, Kind::Leaps))
    }

    fn follows(&self, motion: &Motion, control: usize) -> (f64, Kind) {
        let u = |sample: usize| motion.instants[sample].controls[control];
        let (left, by) = if self.is_state {
            self.on(|piece| u(piece.end) - u(piece.start))
        } else {
            let mean = (0..motion.instants.len()).map(u).sum::<f64>() / motion.instants.len() as f64;
            let (left, by) = self.on(|piece| motion.integral(piece, |k| [u(k) - mean])[0]);
            (left, -by)
        };
        (left, Kind::Follows(control, by))
    }

    fn sign_lost(&self) -> Option<(f64, Kind)> {
        let channel = self.broken.channel;
        let column = if self.is_state { &channel.state } else { &channel.rate };
        let has_one_sign = column.iter().all(|value| *value >= 0.0) || column.iter().all(|value| *value <= 0.0);
        let of_piece = |piece: &Range<usize>| {
            let (change, sum) = (channel.change(piece), difference(&channel.sum, piece));
            (change - sum).abs().min((change + sum).abs()).powi(2)
        };
        has_one_sign.then(|| (self.pieces().iter().map(of_piece).sum(), Kind::SignLost))
    }
}

/// A series behind a filter of first order that starts at rest.
pub(super) fn lagged(series: &[f64], time_s: f64, step_s: f64) -> Vec<f64> {
    let kept = (-step_s / time_s).exp();
    let mut state = series.first().copied().unwrap_or(0.0);
    let follow = |value: &f64| {
        state = kept * state + (1.0 - kept) * value;
        state
    };
    series.iter().map(follow).collect()
}

/// The mean over so many samples on either side, fewer at the ends.
fn averaged(series: &[f64], reach: usize) -> Vec<f64> {
    let mut sum = 0.0;
    let running = series.iter().map(|value| {
        sum += value;
        sum
    });
    let sums: Vec<f64> = std::iter::once(0.0).chain(running).collect();
    let mean = |k: usize| {
        let (first, end) = (k.saturating_sub(reach), (k + reach + 1).min(series.len()));
        (sums[end] - sums[first]) / (end - first) as f64
    };
    (0..series.len()).map(mean).collect()
}
