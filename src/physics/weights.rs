//! What a row weighs in a calibration, by the flight that it is of. The fits themselves are in `calibrate`.

use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel};
use serde::{Deserialize, Serialize};

/// What counts alike in a calibration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Weights {
    /// Every row: least squares as it is. Flights that move most then decide.
    #[default]
    Rows,
    /// The rows of every flight relative to how much it accelerates: each weighs 1/σ², σ being the standard deviation of the measured acceleration
    /// over the rows of its flight, by channel. For sets in which what no model explains grows with the movement, so that a few wild
    /// flights would outvote all calm ones.
    Flights,
}

impl Weights {
    /// Both, by the names that people write.
    pub const NAMES: [(&'static str, Self); 2] = [("rows", Self::Rows), ("flights", Self::Flights)];

    /// By its name.
    ///
    /// # Errors
    /// [`Error::Config`] for another name.
    pub fn named(name: &str) -> Result<Self> {
        let known = Self::NAMES.iter().find(|(known, _)| *known == name);
        known.map(|(_, weights)| *weights).ok_or_else(|| Error::Config {
            place: "calibrate".into(),
            field: "weights".into(),
            found: format!("`{name}`"),
            expected: Self::NAMES.map(|(name, _)| format!("`{name}`")).join(" or "),
        })
    }

    /// By flight and channel what its columns are multiplied by, the square root of the weight; their mean square over the rows is 1. A channel that does not vary
    /// in a flight weighs there what it weighs on average.
    pub(super) fn of(self, flights: &[Flight], ranges: &[Vec<(usize, usize)>]) -> Vec<PerChannel<f64>> {
        let plain = vec![PerChannel::splat(1.0); flights.len()];
        if self == Self::Rows {
            return plain;
        }
        let rows: Vec<f64> =
            ranges.iter().map(|ranges| ranges.iter().map(|range| range.1 - range.0).sum::<usize>() as f64).collect();
        let mut factors = plain;
        for channel in Channel::ALL {
            let precisions: Vec<Option<f64>> =
                flights.iter().zip(ranges).map(|(flight, ranges)| precision(flight, ranges, channel)).collect();
            let (mut sum, mut count) = (0.0, 0.0);
            for (precision, rows) in precisions.iter().zip(&rows) {
                sum += precision.unwrap_or(0.0) * rows;
                count += if precision.is_some() { *rows } else { 0.0 };
            }
            for (factors, precision) in factors.iter_mut().zip(precisions) {
                factors[channel] = precision.map_or(1.0, |precision| (precision * count / sum).sqrt());
            }
        }
        factors
    }
}

/// 1/σ² of a measured acceleration; `None` where it does not vary, or there is no row.
fn precision(flight: &Flight, ranges: &[(usize, usize)], channel: Channel) -> Option<f64> {
    let values = || ranges.iter().flat_map(|&(start, end)| &flight.column(channel.column())[start..end]);
    let count = values().count() as f64;
    let mean = values().sum::<f64>() / count;
    let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    let precision = 1.0 / variance;
    (variance > (f64::EPSILON * mean).powi(2) && precision.is_finite()).then_some(precision)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Column, Targets};
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    /// A flight whose d(wx)/dt goes up and down by so much, the other accelerations standing still.
    fn swinging(name: &str, size: f64, samples: usize) -> Result<Flight> {
        let column = |column: Column| -> Vec<f64> {
            let swings = column == Channel::WxDot.column();
            (0..samples).map(|row| if swings { 3.0 + if row % 2 == 0 { size } else { -size } } else { 1.5 }).collect()
        };
        Flight::new(name, "swing", 0.0, 0.01, Column::ALL.map(column), Targets::Recorded)
    }

    proptest! {
        #[test]
        fn flights_weigh_the_inverse_of_their_deviation_and_one_on_average(
            sizes in proptest::collection::vec(0.01f64..100.0, 1..5), half in 2usize..50
        ) {
            let flights: Vec<Flight> =
                sizes.iter().enumerate().filter_map(|(index, size)| swinging(&index.to_string(), *size, 2 * half).ok()).collect();
            let ranges = vec![vec![(0, 2 * half)]; flights.len()];
            let found = Weights::Flights.of(&flights, &ranges);
            let near = |found: f64, expected: f64| (found - expected).abs() <= Tolerance::Close.relative_f64() * expected.abs();
            for (factors, size) in found.iter().zip(&sizes) {
                prop_assert!(near(factors[Channel::WxDot] * size, found[0][Channel::WxDot] * sizes[0]));
                prop_assert_eq!(factors[Channel::VxDot], 1.0, "it does not vary");
            }
            let mean = found.iter().map(|factors| factors[Channel::WxDot].powi(2)).sum::<f64>() / found.len() as f64;
            prop_assert!(near(mean, 1.0));
            prop_assert!(Weights::named("flights").is_ok_and(|weights| weights == Weights::Flights));
            prop_assert!(Weights::named("blocks").is_err_and(|error| error.to_string().contains("expected `rows` or `flights`")));
            prop_assert!(Weights::Rows.of(&flights, &ranges).iter().all(|factors| *factors == PerChannel::splat(1.0)));
        }
    }
}
