//! A figure of a table: mean and deviation over seeds. Where it stands is `table`'s business, what the paper prints `paper`'s.

use serde::Serialize;

/// Mean over seeds and, with at least two, the standard deviation (divisor n − 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Mean.
    pub mean: f64,
    /// Standard deviation over seeds.
    pub deviation: Option<f64>,
}

impl Cell {
    /// Of one value a seed; `None` of nothing.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        (!values.is_empty()).then(|| Self { mean, deviation: (values.len() > 1).then(|| (squares / (count - 1.0)).sqrt()) })
    }
}
