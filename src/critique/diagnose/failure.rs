//! Where the error lies that is left, whatever was found: channels made comparable by their variance. No cause is sought here.

use super::report::{Failure, FailureChannel, Locked};
use crate::critique::unknown::Unknown;
use crate::flight::{Column, Flight, PerChannel, Span};

/// The channels named hold at least this share of the error of all.
const MOST_OF_IT: f64 = 0.6;
/// More channels than this are no place; the worst alone is named then.
const MOST_CHANNELS: usize = 3;
/// So many variables are named for a channel.
const VARIABLES: usize = 1;

/// Mean squared errors of the channels and where they were measured.
pub(super) struct Measured<'a> {
    /// `locked`, `test` or `searched`.
    pub on: &'a str,
    /// The spans that they are of.
    pub spans: &'a [Span],
    /// By channel.
    pub mse: PerChannel<f64>,
}

impl<'a> Measured<'a> {
    /// After all accepted effects, on the part that no search has seen.
    pub fn of_locked(locked: &'a Locked, spans: &'a [Span]) -> Self {
        let mse = locked.rmse_after.channels().map(|rmse| rmse.unwrap_or(f64::NAN).powi(2));
        Self { on: &locked.part, spans, mse }
    }
}

/// The channels that fail most. `None` where no channel varies.
pub(super) fn failure(flights: &[Flight], measured: &Measured<'_>, unknown: &[Unknown]) -> Option<Failure> {
    let unexplained: Vec<(Column, f64)> = Column::TARGETS
        .into_iter()
        .zip(measured.mse)
        .filter_map(|(column, mse)| Some((column, mse / variance(flights, measured.spans, column)?)))
        .filter(|(_, share)| share.is_finite() && *share > 0.0)
        .collect();
    let total: f64 = unexplained.iter().map(|(_, share)| share).sum();
    let mut order = unexplained;
    order.sort_by(|left, right| right.1.total_cmp(&left.1));
    let mut sum = 0.0;
    let needed = 1 + order
        .iter()
        .take_while(|(_, share)| {
            sum += share;
            sum < MOST_OF_IT * total
        })
        .count();
    // A channel that is nearly as bad as the last one named belongs to it.
    let last = order.get(needed.saturating_sub(1)).map_or(0.0, |(_, share)| *share);
    let taken = order.iter().take_while(|(_, share)| *share >= 0.8 * last).count();
    order.truncate(if taken > MOST_CHANNELS { 1 } else { taken });
    let channels: Vec<FailureChannel> = order
        .into_iter()
        .map(|(column, unexplained)| FailureChannel {
            channel: column.name().into(),
            share: unexplained / total,
            unexplained,
            depends_on: unknown
                .iter()
                .filter(|unknown| unknown.channel == column.name())
                .flat_map(|unknown| unknown.depends_on.iter().take(VARIABLES).map(|on| on.variable.clone()))
                .collect(),
        })
        .collect();
    (!channels.is_empty()).then(|| Failure { on: measured.on.into(), channels })
}

/// Variance of a measured column over what counts of spans; `None` where it does not vary.
pub(super) fn variance(flights: &[Flight], spans: &[Span], column: Column) -> Option<f64> {
    let values = || {
        spans.iter().flat_map(|span| {
            let flight = flights.get(span.flight);
            flight.into_iter().flat_map(|flight| flight.counted(span.start..span.end).flat_map(|rows| &flight.column(column)[rows]))
        })
    };
    let count = values().count() as f64;
    let mean = values().sum::<f64>() / count;
    let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    flights.iter().for_each(Flight::rest);
    (variance > 0.0 && variance.is_finite()).then_some(variance)
}

#[cfg(test)]
mod tests {
    use super::super::gram::tests::{noise, whole};
    use super::*;

    fn of(shares: PerChannel<f64>) -> Vec<String> {
        let flights = noise(1, &[2000]);
        let spans = whole(&flights);
        let variances = |column| variance(&flights, &spans, column).unwrap_or(f64::NAN);
        let mse = PerChannel::from_fn(|channel| shares[channel] * variances(channel.column()));
        let found = failure(&flights, &Measured { on: "locked", spans: &spans, mse }, &[]);
        found.map_or_else(Vec::new, |found| found.channels.into_iter().map(|channel| channel.channel).collect())
    }

    #[test]
    fn the_fewest_channels_that_hold_most_of_the_error_are_named_worst_first() {
        assert_eq!(of([0.02, 0.03, 0.02, 0.8, 0.9, 0.05].into()), ["wy_dot", "wx_dot"]);
        assert_eq!(of([0.02, 0.03, 0.02, 0.0, 0.9, 0.05].into()), ["wy_dot"]);
        assert_eq!(of([0.5, 0.5, 0.5, 0.5, 0.51, 0.5].into()), ["wy_dot"], "spread over all channels, the worst alone");
        assert_eq!(of(PerChannel::splat(0.0)), [""; 0]);
        assert_eq!(of([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.4].into()), ["wz_dot"]);
    }
}
