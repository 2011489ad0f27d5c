//! What a log's numbers say of how it is written: whether attitudes turn as the rates say, positions move as velocities say, velocities change as gravity
//! and the recorded accelerations say. Each answer is a scale between two signals and how much is left; no names, no text.
//!
//! Axes are the log's own: position and inertial velocity in one inertial frame, with R from its body axes to these. Which way is down is asked.

use crate::error::Result;
use crate::flight::GRAVITY_M_S2;
use crate::flight::attitude::{Matrix3, cross, rotate, rotate_back};
use crate::flight::differentiate::{Differentiator, HIGHEST_CUTOFF};

pub(super) type Rows = Vec<[f64; 3]>;

/// −3 dB of the derivatives, Hz: the motion of the airframe is below, vibration above.
const CUTOFF_HZ: f64 = 3.0;
/// Span over which an attitude turns, s.
const TURN_S: f64 = 0.1;
/// Span over which a position moves, s.
const MOVE_S: f64 = 1.0;
/// Parts over which means are removed, s: what stays, as drag in steady flight, says nothing.
const PART_S: f64 = 4.0;

/// Two signals, one a number times the other: that number, and the rest relative to the first one, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    pub scale: f64,
    pub rest: f64,
}

/// `a` as a multiple of `b`, if there is any of both.
pub(super) fn fit(a: &[[f64; 3]], b: &[[f64; 3]]) -> Option<Fit> {
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        for axis in 0..3 {
            aa += a[axis] * a[axis];
            ab += a[axis] * b[axis];
            bb += b[axis] * b[axis];
        }
    }
    let is_some = aa > 0.0 && bb > 0.0 && (aa + bb).is_finite();
    is_some.then(|| Fit { scale: ab.signum() * (aa / bb).sqrt(), rest: (1.0 - ab * ab / (aa * bb)).max(0.0).sqrt() })
}

/// Relative difference of `a` from `b`, without a scale.
pub(super) fn difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let square = |row: &[f64; 3]| row.iter().map(|part| part * part).sum::<f64>();
    let off: f64 = a.iter().zip(b).map(|(a, b)| square(&std::array::from_fn(|axis| a[axis] - b[axis]))).sum();
    let size: f64 = b.iter().map(square).sum();
    if size > 0.0 { (off / size).sqrt() } else { f64::INFINITY }
}

fn span(samples: usize, step_s: f64, wanted_s: f64) -> usize {
    ((wanted_s / step_s).round() as usize).clamp(1, samples.saturating_sub(1).max(1))
}

/// Sums before each row.
fn sums(rows: &[[f64; 3]]) -> Rows {
    let mut sums = vec![[0.0; 3]];
    for row in rows {
        let last = sums[sums.len() - 1];
        sums.push(std::array::from_fn(|axis| last[axis] + row[axis]));
    }
    sums
}

/// Mean over `count` steps from each row on, by the trapezoidal rule.
fn means(rows: &[[f64; 3]], count: usize) -> Rows {
    let sums = sums(rows);
    let mean = |at: usize| {
        std::array::from_fn(|axis| {
            let inner = sums[at + count][axis] - sums[at][axis];
            (inner + 0.5 * (rows[at + count][axis] - rows[at][axis])) / count as f64
        })
    };
    (0..rows.len().saturating_sub(count)).map(mean).collect()
}

/// Rates that attitudes turn with, and the mean of the recorded ones over the same spans.
pub(super) fn turning(rotations: &[Matrix3], rates: &[[f64; 3]], step_s: f64) -> (Rows, Rows) {
    let count = span(rotations.len(), step_s, TURN_S);
    let turned = |(from, to): (&Matrix3, &Matrix3)| {
        let relative = |row: usize, column: usize| (0..3).map(|k| from[k][row] * to[k][column]).sum::<f64>();
        let twice = [relative(2, 1) - relative(1, 2), relative(0, 2) - relative(2, 0), relative(1, 0) - relative(0, 1)];
        twice.map(|part| part / (2.0 * count as f64 * step_s))
    };
    let implied = rotations.iter().zip(rotations.iter().skip(count)).map(turned).collect();
    (implied, means(rates, count))
}

/// Rates that a position moves with, and the mean velocity over the same spans.
pub(super) fn moving(position: &[[f64; 3]], velocity: &[[f64; 3]], step_s: f64) -> (Rows, Rows) {
    let count = span(position.len(), step_s, MOVE_S);
    let pairs = position.iter().zip(position.iter().skip(count));
    let rate = |(from, to): (&[f64; 3], &[f64; 3])| std::array::from_fn(|axis| (to[axis] - from[axis]) / (count as f64 * step_s));
    (pairs.map(rate).collect(), means(velocity, count))
}

/// Derivatives, row by row.
///
/// # Errors
/// [`crate::Error::Undetermined`] for a log that is too short.
pub(super) fn derivative(rows: &[[f64; 3]], step_s: f64) -> Result<Rows> {
    let differentiator = Differentiator::new(step_s, CUTOFF_HZ.min(HIGHEST_CUTOFF / step_s))?;
    let mut found = vec![[0.0; 3]; rows.len()];
    for axis in 0..3 {
        let values: Vec<f64> = rows.iter().map(|row| row[axis]).collect();
        found.iter_mut().zip(differentiator.derivative(&values)?).for_each(|(row, value)| row[axis] = value);
    }
    Ok(found)
}

/// The same without what is faster than derivatives are.
///
/// # Errors
/// As [`derivative`].
pub(super) fn smooth(rows: &[[f64; 3]], step_s: f64) -> Result<Rows> {
    let mut sum = [0.0; 3];
    let integral: Rows = rows
        .iter()
        .map(|row| {
            sum = std::array::from_fn(|axis| sum[axis] + row[axis] * step_s);
            sum
        })
        .collect();
    derivative(&integral, step_s)
}

pub(super) fn turned(rotations: &[Matrix3], rows: &[[f64; 3]]) -> Rows {
    rotations.iter().zip(rows).map(|(matrix, row)| rotate(matrix, *row)).collect()
}

pub(super) fn turned_back(rotations: &[Matrix3], rows: &[[f64; 3]]) -> Rows {
    rotations.iter().zip(rows).map(|(matrix, row)| rotate_back(matrix, *row)).collect()
}

/// What an accelerometer shows where inertial axes have z down (`down` = 1) or up (−1), m/s².
pub(super) fn specific_force(rotations: &[Matrix3], acceleration: &[[f64; 3]], down: f64) -> Rows {
    let force = |(matrix, row): (&Matrix3, &[f64; 3])| rotate_back(matrix, [row[0], row[1], row[2] - down * GRAVITY_M_S2]);
    rotations.iter().zip(acceleration).map(force).collect()
}

/// Derivative of the body components of velocity: a − ω × v in body axes.
pub(super) fn of_components(acceleration: &[[f64; 3]], rates: &[[f64; 3]], velocity: &[[f64; 3]]) -> Rows {
    let rows = acceleration.iter().zip(rates).zip(velocity);
    rows.map(|((a, w), v)| {
        let transport = cross(*w, *v);
        std::array::from_fn(|axis| a[axis] - transport[axis])
    })
    .collect()
}

fn without_means(rows: &mut Rows, step_s: f64) {
    let count = span(rows.len(), step_s, PART_S).max(2);
    for part in rows.chunks_mut(count) {
        let mean: [f64; 3] = std::array::from_fn(|axis| part.iter().map(|row| row[axis]).sum::<f64>() / part.len() as f64);
        part.iter_mut().for_each(|row| *row = std::array::from_fn(|axis| row[axis] - mean[axis]));
    }
}

/// Across its rotor an aircraft that hangs on one has little force but gravity: the inertial acceleration as a multiple of what tilt gives. The sign of the
/// scale is positive where z is down; its size is that of gravity in the log's units.
pub(super) fn tilt(rotations: &[Matrix3], acceleration: &[[f64; 3]], step_s: f64) -> Option<Fit> {
    let across = |row: [f64; 3]| [row[0], row[1], 0.0];
    let mut felt: Rows = turned_back(rotations, acceleration).into_iter().map(across).collect();
    let mut gravity: Rows = rotations.iter().map(|matrix| across(rotate_back(matrix, [0.0, 0.0, GRAVITY_M_S2]))).collect();
    without_means(&mut felt, step_s);
    without_means(&mut gravity, step_s);
    fit(&felt, &gravity)
}
