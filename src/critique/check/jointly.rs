//! What would mend several channels of a flight at once: steps of time that are not as long as stamped, rates with offsets of their own, accelerometers beside the
//! centre of gravity. Causes of single columns are in `causes`.

use super::causes::{AS_WELL, Broken, Cause, Kind, LEAPING, LITTLE};
use super::channels::{Channel, Stream, difference};
use super::increments::Motion;
use crate::flight::Column;
use crate::flight::attitude::{cross, euler_rates};
use nalgebra::{DMatrix, DVector};

/// An offset drifts where its growth leaves this part of what a constant one leaves at most.
const GROWS: f64 = 0.5;
/// A column is one of those that are off from this part of the largest on.
const AMONG: f64 = 0.3;
/// Factors differ where the largest is so many times the smallest.
const UNEVEN: f64 = 1.3;
/// Of the paces of a flight this share is shorter than the first that is told, and longer than the last.
const ENDS: f64 = 0.05;

/// Whether all that changes does so some times as fast as stamped, by a pace that is another from piece to piece and the same for all channels. A row that is
/// missing, or a clock that stops, does so.
pub(super) fn uneven_time(channels: &[Channel], broken: usize) -> Option<Cause> {
    if broken < LEAPING {
        return None;
    }
    let first = channels.iter().min_by_key(|channel| channel.pieces.len())?;
    let sizes: Vec<f64> = channels.iter().map(Channel::size).collect();
    let (mut before, mut left, mut paces) = (0.0, 0.0, Vec::new());
    for piece in &first.pieces {
        let pairs = || {
            let of = |(channel, size): (&Channel, &f64)| {
                [channel.change(piece) / size.sqrt(), difference(&channel.sum, piece) / size.sqrt()]
            };
            channels.iter().zip(&sizes).filter(|entry| *entry.1 > 0.0).map(of)
        };
        let (along, square) = pairs().fold((0.0, 0.0), |sum, [change, says]| (sum.0 + change * says, sum.1 + says * says));
        if square > 0.0 {
            let pace = along / square;
            before += pairs().map(|[change, says]| (change - says).powi(2)).sum::<f64>();
            left += pairs().map(|[change, says]| (change - pace * says).powi(2)).sum::<f64>();
            paces.push(pace);
        }
    }
    if left > LITTLE * before || paces.is_empty() {
        return None;
    }
    Some(Cause { kind: Kind::Pace(ends(paces)?), columns: Vec::new(), or: None, from_s: None })
}

/// Whether recorded derivatives are off by a factor that is another at each sample and the same for all axes: differences that were divided by other steps of
/// time than those of the rows. Of streams in which no cause is `known`.
pub(super) fn uneven_factors(channels: &[Channel], broken: &[Broken<'_>], known: &[Cause]) -> Vec<Cause> {
    let of = |stream: Stream| {
        let such: Vec<&Channel> = channels.iter().filter(|one| one.stream == stream).collect();
        let columns: Vec<Column> = such.iter().filter_map(|one| one.rate_column).collect();
        let is_broken = |stream: Stream| broken.iter().any(|one| one.channel.stream == stream);
        // A state that is wrong moves nothing rightly.
        let is_asked = is_broken(stream)
            && !is_broken(if stream == Stream::Velocity { Stream::Position } else { Stream::Attitude })
            && such.len() == columns.len()
            && !known.iter().any(|cause| cause.columns.iter().any(|column| columns.contains(column)));
        if !is_asked {
            return None;
        }
        let (mut before, mut left, mut factors) = (0.0, 0.0, Vec::new());
        for k in 1..such[0].state.len() {
            let pairs =
                such.iter().map(|one| [one.state[k] - one.state[k - 1], 0.5 * one.step_s * (one.rate[k] + one.rate[k - 1])]);
            let sums = pairs
                .fold([0.0; 3], |sum, [change, says]| [sum[0] + change * change, sum[1] + change * says, sum[2] + says * says]);
            let [changes, along, says] = sums;
            if changes > 0.0 {
                before += changes - 2.0 * along + says;
                left += says - along * along / changes;
                factors.push(along / changes);
            }
        }
        let ends = ends(factors)?;
        (left < LITTLE * before && ends[1] > UNEVEN * ends[0]).then_some(Cause {
            kind: Kind::Factors(ends),
            columns,
            or: None,
            from_s: None,
        })
    };
    [Stream::Velocity, Stream::Rates].into_iter().filter_map(of).collect()
}

/// The values within which nearly all lie.
fn ends(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| values.get((values.len().checked_sub(1)? as f64 * share).round() as usize).copied();
    Some([at(ENDS)?, at(1.0 - ENDS)?])
}

/// Whether rates have offsets, constant or growing from the start of the flight, which turn the attitude otherwise than it turned: e = −∫ E (b₀ + b₁ t) dt on
/// all angles, with E from rates to rates of the angles.
pub(super) fn off_zero(motion: &Motion, channels: &[Channel], broken: &[Broken<'_>]) -> Option<Cause> {
    let angles: Vec<&Channel> = channels.iter().filter(|channel| channel.stream == Stream::Attitude).collect();
    let size = angles.iter().map(|channel| channel.size()).fold(0.0, f64::max);
    // Rates that their accelerations contradict are asked about by themselves.
    if angles.is_empty() || broken.iter().any(|one| one.channel.stream == Stream::Rates) {
        return None;
    }
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for channel in &angles {
        let axis = channel.column as usize - Column::Roll as usize;
        for (piece, error) in channel.pieces.iter().zip(channel.errors()) {
            let row: [f64; 6] = motion.integral(piece, |k| {
                let instant = &motion.instants[k];
                let time_s = motion.step_s * k as f64;
                let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                    .map(|rates| -euler_rates(instant.angles[0], instant.angles[1], rates)[axis]);
                [x, y, z, x * time_s, y * time_s, z * time_s]
            });
            rows.extend(row);
            errors.push(error);
        }
    }
    let square: f64 = errors.iter().map(|error| error * error).sum();
    if errors.len() < 12 || square < AS_WELL * AS_WELL * size {
        return None;
    }
    let features = DMatrix::from_row_slice(errors.len(), 6, &rows);
    let errors = DVector::from_vec(errors);
    let fit = |columns: usize| {
        let part = features.columns(0, columns).into_owned();
        let solution = (part.transpose() * &part).cholesky()?.solve(&(part.transpose() * &errors));
        let left = (&errors - &part * &solution).norm_squared();
        Some((left, solution))
    };
    let ((constant_left, constant), (left, growing)) = (fit(3)?, fit(6)?);
    let drifts = left < GROWS * constant_left;
    let (left, by) = if drifts { (left, growing.rows(3, 3).into_owned()) } else { (constant_left, constant) };
    if left > LITTLE * square {
        return None;
    }
    let most = by.amax();
    let such = [Column::Wx, Column::Wy, Column::Wz].into_iter().zip(by.iter()).filter(|entry| entry.1.abs() > AMONG * most);
    let columns: Vec<Column> = such.map(|entry| entry.0).collect();
    let largest = by.iter().copied().find(|value| value.abs() == most)?;
    let kind = if drifts { Kind::Drifts(largest) } else { Kind::Off(largest) };
    Some(Cause { kind, columns, or: None, from_s: None })
}

/// Whether linear accelerations are those of a point beside the centre of gravity: a = a₀ + ω' × r + ω × (ω × r), with r fitted on all three axes.
pub(super) fn off_centre(motion: &Motion, broken: &[Broken<'_>]) -> Option<Cause> {
    let such: Vec<&Broken<'_>> = broken.iter().filter(|one| one.channel.stream == Stream::Velocity).collect();
    if such.len() < 2 || broken.iter().any(|one| one.channel.stream == Stream::Position) {
        return None;
    }
    let (mut gram, mut moment, mut square) = (nalgebra::Matrix3::<f64>::zeros(), nalgebra::Vector3::<f64>::zeros(), 0.0);
    for one in &such {
        let axis = one.channel.column as usize - Column::Vx as usize;
        for (piece, error) in one.channel.pieces.iter().zip(&one.errors) {
            // The change says less than the derivative by what the arm adds to that.
            let feature = nalgebra::Vector3::from(motion.integral(piece, |k| {
                let instant = &motion.instants[k];
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|arm| {
                    let (along, inwards) = (cross(instant.angular_target, arm), cross(instant.rates, cross(instant.rates, arm)));
                    -(along[axis] + inwards[axis])
                })
            }));
            gram += feature * feature.transpose();
            moment += feature * *error;
            square += error * error;
        }
    }
    let arm = gram.cholesky()?.solve(&moment);
    let left = square - moment.dot(&arm);
    let columns = vec![Column::VxDot, Column::VyDot, Column::VzDot];
    (left < LITTLE * square).then(|| Cause { kind: Kind::OffCentre(arm.into()), columns, or: None, from_s: None })
}
