//! Single columns beside what says how fast they change: twelve scalar relations s' = f of mechanics, in pieces. What breaks them is asked in `causes`.

use super::increments::{Motion, Vector};
use crate::flight::Column;
use crate::flight::attitude::{euler_rates, rotate};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// The stream that a state belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stream {
    Position,
    Attitude,
    Velocity,
    Rates,
}

/// Beyond this pitch, rad, the rates of roll and yaw are not to be relied on.
const STEEP: f64 = 1.2;

/// A column s, and f.
pub(super) struct Channel {
    pub stream: Stream,
    pub column: Column,
    /// The recorded derivative, where f is one column; else velocity and attitude, or the rates.
    pub rate_column: Option<Column>,
    pub state: Vec<f64>,
    pub rate: Vec<f64>,
    /// Σ f dt from the start, by the trapezoidal rule.
    pub sum: Vec<f64>,
    /// Pieces in which f can be relied on.
    pub pieces: Vec<Range<usize>>,
    pub step_s: f64,
    is_angle: bool,
}

impl Channel {
    /// Those that the flight has.
    pub fn all(motion: &Motion) -> Vec<Self> {
        let mut all = Vec::new();
        let each = |f: &dyn Fn(usize) -> Vector| -> Vec<Vector> { (0..motion.instants.len()).map(f).collect() };
        let at = |k: usize| &motion.instants[k];
        let mut add = |stream, columns: [Column; 3], rates: Option<[Column; 3]>, states: Vec<Vector>, f: Vec<Vector>| {
            for axis in 0..3 {
                // Without heading only roll and pitch are known.
                if stream != Stream::Attitude || axis < 2 || motion.heading {
                    let of = |vectors: &[Vector]| vectors.iter().map(|vector| vector[axis]).collect();
                    all.push(Self::new(motion, stream, columns[axis], rates.map(|rates| rates[axis]), of(&states), of(&f)));
                }
            }
        };
        if motion.position && motion.heading {
            let moved = each(&|k| rotate(&at(k).rotation, at(k).velocity));
            add(Stream::Position, [Column::X, Column::Y, Column::Z], None, each(&|k| at(k).position), moved);
        }
        let turned = each(&|k| euler_rates(at(k).angles[0], at(k).angles[1], at(k).rates));
        add(Stream::Attitude, [Column::Roll, Column::Pitch, Column::Yaw], None, each(&|k| at(k).angles), turned);
        if motion.recorded {
            let [linear, angular] = [[Column::VxDot, Column::VyDot, Column::VzDot], [Column::WxDot, Column::WyDot, Column::WzDot]];
            let velocities = [Column::Vx, Column::Vy, Column::Vz];
            add(Stream::Velocity, velocities, Some(linear), each(&|k| at(k).velocity), each(&|k| at(k).linear_target));
            let rates = [Column::Wx, Column::Wy, Column::Wz];
            add(Stream::Rates, rates, Some(angular), each(&|k| at(k).rates), each(&|k| at(k).angular_target));
        }
        all
    }

    fn new(motion: &Motion, stream: Stream, column: Column, rate_column: Option<Column>, state: Vec<f64>, rate: Vec<f64>) -> Self {
        let is_angle = stream == Stream::Attitude;
        let is_level = |piece: &Range<usize>| {
            !is_angle || motion.instants[piece.start..=piece.end].iter().all(|instant| instant.angles[1].abs() < STEEP)
        };
        let pieces = motion.pieces(0).map(|entry| entry.0).filter(is_level).collect();
        let sum = summed(&rate, motion.step_s);
        Self { stream, column, rate_column, state, rate, sum, pieces, step_s: motion.step_s, is_angle }
    }

    /// s at the end of a piece less that at its start; of an angle the short way.
    pub fn change(&self, piece: &Range<usize>) -> f64 {
        let change = self.state[piece.end] - self.state[piece.start];
        if self.is_angle { (change + PI).rem_euclid(TAU) - PI } else { change }
    }

    /// What changed in each piece beside what f says.
    pub fn errors(&self) -> Vec<f64> {
        self.pieces.iter().map(|piece| self.change(piece) - difference(&self.sum, piece)).collect()
    }

    /// Σ of the squares of what changes, or of what f says, whichever is larger.
    pub fn size(&self) -> f64 {
        let squares = |of: &dyn Fn(&Range<usize>) -> f64| self.pieces.iter().map(|piece| of(piece).powi(2)).sum::<f64>();
        squares(&|piece| self.change(piece)).max(squares(&|piece| difference(&self.sum, piece)))
    }
}

/// ∫ f dt up to each sample.
pub(super) fn summed(rate: &[f64], step_s: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let steps = rate.windows(2).map(|pair| {
        sum += 0.5 * step_s * (pair[0] + pair[1]);
        sum
    });
    std::iter::once(0.0).chain(steps).collect()
}

/// A series at the end of a piece less that at its start.
pub(super) fn difference(series: &[f64], piece: &Range<usize>) -> f64 {
    series[piece.end] - series[piece.start]
}
