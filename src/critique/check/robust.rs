//! Order statistics that a few faulty flights do not move.

/// From a median absolute deviation to the standard deviation of normal numbers.
pub(super) const NORMAL: f64 = 1.4826;

/// The upper of the two middle values, where they are two.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The lower quartile: what is usual where half of the flights may be faulty upwards.
pub(super) fn lower_quartile(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 4).copied()
}
