//! What a vector that is measured in body axes has too much of, in proportion to another one: y = y₀ + M f + b, with a matrix M of gains that a flight keeps. A
//! velocity that is measured beside the centre of gravity has ω × r of the rates, gyros that feel acceleration some of the specific force, and axes that do
//! not stand as they should some of each other. Causes of single columns are in `causes`.
//!
//! Every relation in which y stands is linear in M. As the state of y' = a it changes by M Δf beside ∫ a dt; in the place of a it adds ∫ M f dt; and as
//! velocity or rates it moves the position by ∫ R M f dt, and the angles by ∫ E M f dt. All relations of a vector are fitted together, each in parts of what
//! changes in it, so an M that mends one and breaks another is none.

use super::causes::{Broken, Cause, Kind, LITTLE};
use super::channels::{Channel, Stream};
use super::increments::{Instant, Motion, Vector};
use crate::flight::Column;
use crate::flight::attitude::{Matrix3, cross, euler_rates};
use nalgebra::{SMatrix, SVector};
use std::ops::Range;

/// Columns of a fit: M by rows, and b.
const COLUMNS: usize = 12;
/// Of the diagonal of the normal equations: where two parts of f go together.
const RIDGE: f64 = 1e-9;
/// A matrix is the cause where it leaves at most this part of what causes of single columns do, or an offset and a gain of each.
const BEYOND_SINGLE: f64 = 0.5;

/// A vector in body axes of which another may hold some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Velocity,
    Rates,
    SpecificForce,
    Gravity,
    AngularAcceleration,
}

/// All that are tried.
const PARTS: [Part; 5] = [Part::Velocity, Part::Rates, Part::SpecificForce, Part::Gravity, Part::AngularAcceleration];

impl Part {
    fn at(self, motion: &Motion, sample: usize) -> Vector {
        let instant = &motion.instants[sample];
        match self {
            Self::Velocity => instant.velocity,
            Self::Rates => instant.rates,
            Self::Gravity => instant.gravity,
            Self::AngularAcceleration => instant.angular_target,
            Self::SpecificForce => {
                let turning = cross(instant.rates, instant.velocity);
                std::array::from_fn(|axis| instant.linear_target[axis] + turning[axis] - instant.gravity[axis])
            }
        }
    }

    /// Its three components, as a message calls them.
    pub const fn names(self) -> [&'static str; 3] {
        match self {
            Self::Velocity => ["vx", "vy", "vz"],
            Self::Rates => ["wx", "wy", "wz"],
            Self::SpecificForce => ["the specific force along x", "the specific force along y", "the specific force along z"],
            Self::Gravity => ["gravity along x", "gravity along y", "gravity along z"],
            Self::AngularAcceleration => ["wx_dot", "wy_dot", "wz_dot"],
        }
    }

    pub const fn unit(self) -> &'static str {
        match self {
            Self::Velocity => "m/s",
            Self::Rates => "rad/s",
            Self::SpecificForce | Self::Gravity => "m/s²",
            Self::AngularAcceleration => "rad/s²",
        }
    }
}

/// A vector that may have too much.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Suspect {
    Velocity,
    Linear,
    Rates,
    Angular,
}

impl Suspect {
    const ALL: [Self; 4] = [Self::Velocity, Self::Linear, Self::Rates, Self::Angular];

    /// The stream of which it is the state, or what says how fast that changes.
    const fn own(self) -> Stream {
        match self {
            Self::Velocity | Self::Linear => Stream::Velocity,
            Self::Rates | Self::Angular => Stream::Rates,
        }
    }

    /// The stream that velocity or rates move.
    const fn moved(self) -> Stream {
        match self {
            Self::Velocity | Self::Linear => Stream::Position,
            Self::Rates | Self::Angular => Stream::Attitude,
        }
    }

    const fn columns(self) -> [Column; 3] {
        match self {
            Self::Velocity => [Column::Vx, Column::Vy, Column::Vz],
            Self::Linear => [Column::VxDot, Column::VyDot, Column::VzDot],
            Self::Rates => [Column::Wx, Column::Wy, Column::Wz],
            Self::Angular => [Column::WxDot, Column::WyDot, Column::WzDot],
        }
    }

    /// The vector as a part.
    const fn itself(self) -> Option<Part> {
        match self {
            Self::Velocity => Some(Part::Velocity),
            Self::Rates => Some(Part::Rates),
            Self::Angular => Some(Part::AngularAcceleration),
            Self::Linear => None,
        }
    }

    /// At each sample, by rows how the state of [`Suspect::moved`] moves by a unit along or about each body axis.
    fn moves(self, motion: &Motion) -> Vec<Matrix3> {
        let of = |instant: &Instant| match self.moved() {
            Stream::Attitude => {
                let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                    .map(|rates| euler_rates(instant.angles[0], instant.angles[1], rates));
                std::array::from_fn(|axis| [x[axis], y[axis], z[axis]])
            }
            _ => instant.rotation,
        };
        motion.instants.iter().map(of).collect()
    }

    /// What a piece says of M and b in a channel; `None` where the vector does not stand in it.
    fn row(
        self,
        part: Part,
        motion: &Motion,
        moves: &[Matrix3],
        channel: &Channel,
        piece: &Range<usize>,
    ) -> Option<[f64; COLUMNS]> {
        let axis = channel.column as usize % 3;
        let is_state = matches!(self, Self::Velocity | Self::Rates);
        if channel.stream == self.own() {
            let mut row = [0.0; COLUMNS];
            if is_state {
                let (start, end) = (part.at(motion, piece.start), part.at(motion, piece.end));
                (0..3).for_each(|of| row[3 * axis + of] = end[of] - start[of]);
            } else {
                let sums = motion.integral(piece, |k| part.at(motion, k));
                (0..3).for_each(|of| row[3 * axis + of] = -sums[of]);
                row[9 + axis] = -motion.step_s * (piece.end - piece.start) as f64;
            }
            return Some(row);
        }
        (is_state && channel.stream == self.moved()).then(|| {
            motion.integral(piece, |k| {
                let (moves, values) = (moves[k][axis], part.at(motion, k));
                std::array::from_fn(|at| if at < 9 { -moves[at / 3] * values[at % 3] } else { -moves[at - 9] })
            })
        })
    }
}

/// A fit: squares that are left, in parts of what changes, and M.
struct Fit {
    left: f64,
    /// With an offset, and of a vector that holds itself a gain, for each of its columns and no more.
    left_by_columns: f64,
    gains: [Vector; 3],
}

/// The channels of both relations of a vector, and what each counts.
struct Related<'a> {
    motion: &'a Motion,
    moves: &'a [Matrix3],
    channels: &'a [&'a Channel],
    weights: &'a [f64],
}

/// Squares of all errors of the two relations, in parts of what changes in each, and what the fit leaves of them.
struct Sums {
    gram: SMatrix<f64, COLUMNS, COLUMNS>,
    moment: SVector<f64, COLUMNS>,
    square: f64,
}

impl Sums {
    fn of(suspect: Suspect, part: Part, of: &Related<'_>) -> Self {
        let Related { motion, moves, channels, weights } = of;
        let mut sums = Self { gram: SMatrix::zeros(), moment: SVector::zeros(), square: 0.0 };
        for (channel, weight) in channels.iter().zip(*weights) {
            for (piece, error) in channel.pieces.iter().zip(channel.errors()) {
                sums.square += weight * error * error;
                if let Some(row) = suspect.row(part, motion, moves, channel, piece) {
                    let row = SVector::from(row);
                    sums.gram += *weight * row * row.transpose();
                    sums.moment += *weight * error * row;
                }
            }
        }
        sums
    }

    /// What is left with these columns alone, and their coefficients.
    fn fit(&self, keeps: impl Fn(usize) -> bool) -> Option<(f64, SVector<f64, COLUMNS>)> {
        let mut gram = self.gram;
        let mut moment = self.moment;
        for at in 0..COLUMNS {
            let diagonal = gram[(at, at)];
            if !keeps(at) || diagonal == 0.0 {
                gram.row_mut(at).fill(0.0);
                gram.column_mut(at).fill(0.0);
                gram[(at, at)] = 1.0;
                moment[at] = 0.0;
            } else {
                gram[(at, at)] = diagonal * (1.0 + RIDGE);
            }
        }
        let solution = gram.cholesky()?.solve(&moment);
        Some((self.square - moment.dot(&solution), solution))
    }
}

fn fitted(suspect: Suspect, part: Part, of: &Related<'_>) -> Option<(Fit, f64)> {
    let sums = Sums::of(suspect, part, of);
    let (left, solution) = sums.fit(|_| true)?;
    let by_itself = suspect.itself() == Some(part);
    let (left_by_columns, _) = sums.fit(|at| at >= 9 || by_itself && at % 4 == 0)?;
    let gains = std::array::from_fn(|row| std::array::from_fn(|column| solution[3 * row + column]));
    Some((Fit { left, left_by_columns, gains }, sums.square))
}

/// What a vector has too much of, where that mends the relations in which it stands, and single columns do not.
pub(super) fn of(motion: &Motion, channels: &[Channel], broken: &[Broken<'_>]) -> Vec<Cause> {
    [Stream::Velocity, Stream::Rates].into_iter().filter_map(|own| of_stream(own, motion, channels, broken)).collect()
}

/// Whether a cause that is found in a stream explains errors of this one as well.
pub(super) fn explains(cause: &Cause, stream: Stream) -> bool {
    let suspect = Suspect::ALL.into_iter().find(|suspect| cause.columns == suspect.columns());
    matches!(cause.kind, Kind::Holds(..)) && suspect.is_some_and(|suspect| [suspect.own(), suspect.moved()].contains(&stream))
}

fn of_stream(own: Stream, motion: &Motion, channels: &[Channel], broken: &[Broken<'_>]) -> Option<Cause> {
    let suspects: Vec<Suspect> = Suspect::ALL.into_iter().filter(|suspect| suspect.own() == own).collect();
    let is_of = |stream: Stream| suspects.iter().any(|suspect| [suspect.own(), suspect.moved()].contains(&stream));
    let such: Vec<&Broken<'_>> = broken.iter().filter(|one| is_of(one.channel.stream)).collect();
    // A wrong attitude moves the position wrongly, whatever the velocity is.
    let by_attitude = own == Stream::Velocity && broken.iter().any(|one| one.channel.stream == Stream::Attitude);
    // What leaps now and then goes with whatever was flown at that moment.
    let leaps = such.iter().any(|one| one.leaps().is_some());
    if such.is_empty() || by_attitude || leaps {
        return None;
    }
    let used: Vec<&Channel> = channels.iter().filter(|channel| is_of(channel.stream)).collect();
    let size = |stream: Stream| used.iter().filter(|one| one.stream == stream).map(|one| one.size()).fold(0.0, f64::max);
    let weights: Vec<f64> = used.iter().map(|channel| 1.0 / size(channel.stream)).collect();
    if weights.iter().any(|weight| !weight.is_finite()) {
        return None;
    }
    let moves = suspects[0].moves(motion);
    let related = Related { motion, moves: &moves, channels: &used, weights: &weights };
    let tried = suspects.iter().flat_map(|suspect| PARTS.map(|part| (*suspect, part)));
    let fits = tried.filter_map(|(suspect, part)| {
        let (fit, square) = fitted(suspect, part, &related)?;
        Some((suspect, part, fit, square))
    });
    let (suspect, part, fit, square) = fits.min_by(|one, other| one.2.left.total_cmp(&other.2.left))?;
    // What single columns leave takes longest, and is asked last.
    let single = || such.iter().map(|one| one.least_left(motion) / size(one.channel.stream)).sum::<f64>();
    let is_beyond = |least: f64| fit.left < BEYOND_SINGLE * least;
    let is_cause = fit.left < LITTLE * square && is_beyond(fit.left_by_columns) && is_beyond(single());
    is_cause.then(|| Cause { kind: Kind::Holds(part, fit.gains), columns: suspect.columns().to_vec(), or: None, from_s: None })
}

/// The vector r of M = [r]×, M f = r × f, where M is one but for this part of it.
pub(super) fn arm(gains: &[Vector; 3]) -> Option<Vector> {
    const SYMMETRIC: f64 = 0.3;
    let half = |row: usize, column: usize| 0.5 * (gains[row][column] - gains[column][row]);
    let arm = [half(2, 1), half(0, 2), half(1, 0)];
    let turning: f64 = 2.0 * arm.iter().map(|value| value * value).sum::<f64>();
    let all: f64 = gains.iter().flatten().map(|value| value * value).sum();
    (all - turning < SYMMETRIC * SYMMETRIC * all).then_some(arm)
}
