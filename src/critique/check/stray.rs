//! Velocity or rates that are wrong by themselves: what they move and what says how fast they change agree with each other and not with them. Why is not said here:
//! no cause that is known mends them.
//!
//! The error of a velocity over a piece is d = −Rᵀ (Δp − ∫ R v dt) / T by the position, and up to a constant the mean of v − ∫ v̇ dt by the accelerations. Where
//! both change alike from piece to piece it is the velocity that errs; so it is with rates between angles and angular accelerations.

use super::causes::{Broken, Cause, FEWEST_PIECES, Kind, LITTLE};
use super::channels::{Channel, Stream};
use super::increments::{Motion, Vector, length_s};
use crate::flight::Column;
use crate::flight::attitude::{body_rates, rotate_back};
use std::ops::Range;

/// An error wanders where it changes from piece to piece by this part of its size at most.
const SLOW: f64 = 0.7;
/// Axes err from this part of the largest error on.
const AMONG: f64 = 0.3;
/// Pieces that are taken together: an error that wanders is seen the better the longer it is looked at, since noise of a position is less of a longer way.
const TOGETHER: [usize; 2] = [1, 5];

/// A stream, and what it moves.
const STREAMS: [(Stream, Stream, [Column; 3]); 2] = [
    (Stream::Velocity, Stream::Position, [Column::Vx, Column::Vy, Column::Vz]),
    (Stream::Rates, Stream::Attitude, [Column::Wx, Column::Wy, Column::Wz]),
];

/// Streams that are wrong, of those in which no cause is `known`.
pub(super) fn of(motion: &Motion, channels: &[Channel], broken: &[Broken<'_>], known: &[Cause]) -> Vec<Cause> {
    let is_broken = |stream: Stream| broken.iter().any(|one| one.channel.stream == stream);
    let is_asked = |(own, moved, columns): &&(Stream, Stream, [Column; 3])| {
        let is_known = known.iter().any(|cause| cause.columns.iter().any(|column| columns.contains(column)));
        let by_attitude = *own == Stream::Velocity && is_broken(Stream::Attitude);
        (is_broken(*own) || is_broken(*moved)) && !by_attitude && !is_known
    };
    let of = |(own, moved, columns): &(Stream, Stream, [Column; 3])| {
        let of_stream = |stream: Stream| -> Option<[&Channel; 3]> {
            channels.iter().filter(|channel| channel.stream == stream).collect::<Vec<_>>().try_into().ok()
        };
        let (rms, wanders) = error(motion, of_stream(*own)?, of_stream(*moved)?)?;
        let most = rms.iter().copied().fold(0.0, f64::max);
        let such = columns.iter().zip(rms).filter(|entry| entry.1 > AMONG * most).map(|entry| *entry.0);
        Some(Cause { kind: Kind::Stray(most, wanders), columns: such.collect(), or: None, from_s: None })
    };
    STREAMS.iter().filter(is_asked).filter_map(of).collect()
}

/// The error of a vector over a piece: by what it moves, and up to a constant by what says how fast it changes.
struct Seen {
    by_moved: Vector,
    by_own: Vector,
}

/// Root mean square of the error along each axis, and whether it is slow; `None` where the two sides do not agree on it.
fn error(motion: &Motion, own: [&Channel; 3], moved: [&Channel; 3]) -> Option<(Vector, bool)> {
    let pieces = &moved[0].pieces;
    let errors = moved.map(Channel::errors);
    let of = |(at, piece): (usize, &Range<usize>)| {
        let middle = &motion.instants[piece.start.midpoint(piece.end)];
        let rate: Vector = std::array::from_fn(|axis| -errors[axis][at] / length_s(motion, piece));
        let by_moved = match own[0].stream {
            Stream::Velocity => rotate_back(&middle.rotation, rate),
            _ => body_rates(middle.angles[0], middle.angles[1], rate),
        };
        let count = (piece.end - piece.start + 1) as f64;
        let by_own = own.map(|channel| (piece.start..=piece.end).map(|k| channel.state[k] - channel.sum[k]).sum::<f64>() / count);
        Seen { by_moved, by_own }
    };
    let seen: Vec<Seen> = pieces.iter().enumerate().map(of).collect();
    if seen.len() < FEWEST_PIECES {
        return None;
    }
    TOGETHER.into_iter().find_map(|together| agreed(&seen, pieces, together))
}

/// The same, with so many pieces taken together.
fn agreed(seen: &[Seen], pieces: &[Range<usize>], together: usize) -> Option<(Vector, bool)> {
    let mean = |part: &[Seen], side: fn(&Seen) -> Vector| -> Vector {
        std::array::from_fn(|axis| part.iter().map(|one| side(one)[axis]).sum::<f64>() / part.len() as f64)
    };
    let (mut sizes, mut of_own, mut left) = ([0.0; 3], 0.0, 0.0);
    let mut count = 0.0;
    for at in (0..(seen.len() + 1).saturating_sub(2 * together)).step_by(together) {
        if pieces[at..at + 2 * together].windows(2).any(|pair| pair[0].end != pair[1].start) {
            continue;
        }
        let [before, after] = [&seen[at..at + together], &seen[at + together..at + 2 * together]];
        let sides: [fn(&Seen) -> Vector; 2] = [|one| one.by_moved, |one| one.by_own];
        let [[moved, moved_after], [own, own_after]] = sides.map(|side| [mean(before, side), mean(after, side)]);
        for axis in 0..3 {
            let [by_moved, by_own] = [moved_after[axis] - moved[axis], own_after[axis] - own[axis]];
            sizes[axis] += moved[axis] * moved[axis];
            of_own += by_own * by_own;
            left += (by_own - by_moved).powi(2);
        }
        count += 1.0;
    }
    // From one piece to the next the noise of a position would be most of it, so the other side is asked.
    let changes = seen.windows(2).flat_map(|pair| (0..3).map(|axis| (pair[1].by_own[axis] - pair[0].by_own[axis]).powi(2)));
    let change = changes.sum::<f64>() / (seen.len() - 1) as f64;
    let sizes = sizes.map(|size| size / count);
    (left < LITTLE * of_own).then(|| (sizes.map(f64::sqrt), change < SLOW * SLOW * sizes.iter().sum::<f64>()))
}
