//! The figures: lines over time, binned residuals, bars by channel, training curves. Each is data in, [`Figure`] out.
//!
//! All figures are small panels under one legend, at most six, so that channels stand side by side at one scale of time. Text
//! is plain text. How a figure gets into a page is `page.rs`.

mod bars;
mod grid;
mod lines;
mod residuals;

pub use bars::{shares, steps};
pub use lines::{LineData, lines, log_lines, training};
pub use residuals::{BinnedPanel, binned, surfaces};

use plotly::{Layout, Traces};

/// Points of one line that a figure draws at most; more are thinned with [`thin`].
pub const POINTS: usize = 1000;

/// Panels of one figure at most.
pub const PANELS: usize = 6;

/// An interactive figure, ready for a page.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Title.
    pub title: String,
    /// What to see in it, in a sentence.
    pub caption: String,
    /// Height on the page, pixels.
    pub height_px: usize,
    json: String,
}

impl Figure {
    /// `{"data": …, "layout": …}` as the figure library takes it.
    pub fn json(&self) -> &str {
        &self.json
    }
}

/// Thins a line to about [`POINTS`] points: of each of equal stretches the lowest and the highest value stay, so that peaks do.
pub fn thin(x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let pairs: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().copied()).collect();
    if pairs.len() <= POINTS {
        return pairs.into_iter().unzip();
    }
    let stretch = pairs.len().div_ceil(POINTS / 2);
    let ends = |stretch: &[(f64, f64)]| {
        let by = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
        let lowest = stretch.iter().enumerate().min_by(by).map_or(0, |(index, _)| index);
        let highest = stretch.iter().enumerate().max_by(by).map_or(0, |(index, _)| index);
        let mut kept = vec![lowest.min(highest), lowest.max(highest)];
        kept.dedup();
        kept.into_iter().filter_map(|index| stretch.get(index).copied()).collect::<Vec<_>>()
    };
    pairs.chunks(stretch).flat_map(ends).unzip()
}

/// `vx, m/s`; the name alone for a quantity without a unit.
pub(super) fn with_unit(name: &str, unit: &str) -> String {
    if unit == "1" { name.to_owned() } else { format!("{name}, {unit}") }
}

/// Five significant digits: more than a screen shows, and half the size of the page.
fn round(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10.0_f64.powi(4 - value.abs().log10().floor() as i32);
    let rounded = (value * scale).round() / scale;
    if rounded.is_finite() { rounded } else { value }
}

fn rounded(values: &[f64]) -> Vec<f64> {
    values.iter().map(|value| round(*value)).collect()
}

fn figure(title: &str, caption: &str, traces: Traces, layout: Layout, height_px: usize) -> Figure {
    let json = format!("{{\"data\":{},\"layout\":{}}}", traces.to_json(), layout.height(height_px).to_json());
    Figure { title: title.to_owned(), caption: caption.to_owned(), height_px, json }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(super) fn json(figure: &Figure) -> serde_json::Value {
        serde_json::from_str(figure.json()).unwrap_or_default()
    }

    pub(super) fn panels(count: usize) -> Vec<(String, String)> {
        (0..count).map(|panel| (format!("panel {panel}"), "m/s²".to_owned())).collect()
    }

    proptest! {
        #[test]
        fn thinning_keeps_order_and_extremes(y in prop::collection::vec(-1.0..1.0_f64, 1..5000)) {
            let x: Vec<f64> = (0..y.len()).map(|index| index as f64).collect();
            let (thin_x, thin_y) = thin(&x, &y);
            prop_assert!(thin_x.len() == thin_y.len() && thin_x.len() <= POINTS);
            prop_assert!(thin_x.windows(2).all(|pair| pair[0] < pair[1]));
            let ends = |values: &[f64]| values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
            prop_assert_eq!(ends(&y), ends(&thin_y));
        }
    }
}
