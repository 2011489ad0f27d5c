//! Order statistics that a few faulty flights do not move.

/// From a median absolute deviation to the standard deviation of normal numbers.
pub(super) const NORMAL: f64 = 1.4826;

/// The upper of the two middle values, where they are two.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    nth(&mut values, middle)
}

/// The lower quartile: what is usual where half of the flights may be faulty upwards.
pub(super) fn lower_quartile(mut values: Vec<f64>) -> Option<f64> {
    let quarter = values.len() / 4;
    nth(&mut values, quarter)
}

fn nth(values: &mut [f64], place: usize) -> Option<f64> {
    (place < values.len()).then(|| *values.select_nth_unstable_by(place, f64::total_cmp).1)
}
