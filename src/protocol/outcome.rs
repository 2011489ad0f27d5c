//! What a run ends in: sums of errors by ten-second segment of the test part. Every measure of every table is made of these sums, and
//! they add: over segments, manoeuvres and folds. No time of day and no duration is in it, so that a run done twice is the same file.

use super::plan::Run;
use crate::blocks::{BLOCK_S, Blocks};
use crate::critique::ChannelValues;
use crate::flight::{Channel, Flight, PerChannel, Window};
use crate::train::EpochLoss;
use serde::{Deserialize, Serialize};

/// One ten-second segment of a test flight. Channels are in the order of [`Channel::ALL`](crate::flight::Channel::ALL), m/s² and rad/s².
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Flight.
    pub flight: String,
    /// Its manoeuvre class.
    pub manoeuvre: String,
    /// Start of the segment in the flight, s.
    pub start_s: f64,
    /// Windows judged in it.
    pub windows: usize,
    /// Σ e².
    pub squares: PerChannel<f64>,
    /// Σ |e|.
    pub absolutes: PerChannel<f64>,
    /// max |e|.
    pub largest: PerChannel<f64>,
}

/// Measured and predicted over one stretch of flight, for a figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// Flight.
    pub flight: String,
    /// Time of the log, s.
    pub time_s: Vec<f64>,
    /// By channel, m/s² and rad/s².
    pub measured: PerChannel<Vec<f64>>,
    /// By channel, m/s² and rad/s².
    pub predicted: PerChannel<Vec<f64>>,
}

/// The end of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What was run.
    pub run: Run,
    /// Trained parameters; 0 for a method that trains nothing.
    pub parameters: usize,
    /// Windows that trained the network.
    pub training_windows: usize,
    /// Steps of the optimiser.
    pub steps: u64,
    /// Effects that the loop added to the physics, where it came first.
    pub effects: Vec<String>,
    /// The learning rate that the validation part chose, where there was a choice.
    pub peak_rate: Option<f64>,
    /// Losses of each epoch of the network, the first one first, and the epoch that was kept, from 1.
    pub curve: Vec<EpochLoss>,
    /// 0 for a method that trains nothing.
    pub epoch: usize,
    /// Errors by segment.
    pub segments: Vec<Segment>,
    /// A stretch of the test part.
    pub trace: Option<Trace>,
}

/// Errors of `predicted`, which are finite, by segment, in the order of flight and time.
pub(super) fn segments(flights: &[Flight], windows: &[Window], predicted: &[PerChannel<f64>]) -> Vec<Segment> {
    let blocks = Blocks::new(flights, windows);
    let empty = |&(flight, block): &(usize, usize)| Segment {
        flight: flights[flight].name.clone(),
        manoeuvre: flights[flight].manoeuvre.clone(),
        start_s: block as f64 * BLOCK_S,
        windows: 0,
        squares: PerChannel::splat(0.0),
        absolutes: PerChannel::splat(0.0),
        largest: PerChannel::splat(0.0),
    };
    let mut segments: Vec<Segment> = blocks.keys.iter().map(empty).collect();
    for ((window, predicted), block) in windows.iter().zip(predicted).zip(&blocks.of_window) {
        let segment = &mut segments[*block];
        segment.windows += 1;
        for channel in Channel::ALL {
            let error = (flights[window.flight].column(channel.column())[window.last] - predicted[channel]).abs();
            segment.squares[channel] += error * error;
            segment.absolutes[channel] += error;
            segment.largest[channel] = segment.largest[channel].max(error);
        }
    }
    segments
}

/// Sums over any segments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    windows: usize,
    squares: PerChannel<f64>,
    absolutes: PerChannel<f64>,
    largest: PerChannel<f64>,
}

impl Sums {
    /// Over these segments.
    pub fn of<'a>(segments: impl IntoIterator<Item = &'a Segment>) -> Self {
        segments.into_iter().fold(Self::default(), |mut sums, segment| {
            sums.windows += segment.windows;
            for channel in Channel::ALL {
                sums.squares[channel] += segment.squares[channel];
                sums.absolutes[channel] += segment.absolutes[channel];
                sums.largest[channel] = sums.largest[channel].max(segment.largest[channel]);
            }
            sums
        })
    }

    /// Windows.
    pub const fn windows(&self) -> usize {
        self.windows
    }

    /// Root mean square error.
    pub fn rmse(&self) -> ChannelValues {
        self.means(|sums, channel| sums.squares[channel], f64::sqrt)
    }

    /// Mean absolute error.
    pub fn mae(&self) -> ChannelValues {
        self.means(|sums, channel| sums.absolutes[channel], |mean| mean)
    }

    /// Largest absolute error.
    pub fn max_abs(&self) -> ChannelValues {
        ChannelValues::new(self.largest.map(|value| (self.windows > 0).then_some(value)))
    }

    fn means(&self, sum: impl Fn(&Self, Channel) -> f64, finish: fn(f64) -> f64) -> ChannelValues {
        let one = |channel: Channel| (self.windows > 0).then(|| finish(sum(self, channel) / self.windows as f64));
        ChannelValues::new(PerChannel::from_fn(one))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::{Row, compare};
    use crate::error::Result;
    use crate::flight::split::Part;
    use crate::flight::{Column, Targets};
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    fn flight(name: &str, values: &[f64]) -> Result<Flight> {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; values.len()]);
        for (channel, column) in Column::TARGETS.into_iter().enumerate() {
            columns[column as usize] = values.iter().map(|value| value * (channel + 1) as f64).collect();
        }
        Flight::new(name, format!("class {name}"), 0.0, 0.5, columns, Targets::Recorded)
    }

    proptest! {
        #[test]
        fn sums_over_segments_are_the_measures_of_the_whole(values in prop::collection::vec(-5.0..5.0_f64, 2..200), stride in 1_usize..7) {
            let flights = [flight("a", &values)?, flight("b", &values[..values.len() / 2 + 1])?];
            let all: Vec<Window> = (0..2).flat_map(|flight| (0..flights[flight].len()).step_by(stride).map(move |last| Window { flight, last })).collect();
            let predicted = vec![PerChannel::splat(0.25); all.len()];
            let found = segments(&flights, &all, &predicted);
            let sums = Sums::of(&found);
            let expected = compare(&flights, &all, &[Row { name: "m".into(), predicted }], Part::All)?;
            let model = &expected.models[0];
            for (found, expected) in [(sums.rmse(), model.rmse), (sums.mae(), model.mae), (sums.max_abs(), model.max_abs)] {
                for (found, expected) in found.channels().into_iter().zip(expected.channels()) {
                    let (found, expected) = (found.unwrap_or(f64::NAN), expected.unwrap_or(f64::NAN));
                    prop_assert!((found - expected).abs() <= Tolerance::Close.relative_f64() * expected);
                }
            }
            prop_assert_eq!(sums.windows(), all.len());
            prop_assert!(found.iter().all(|segment| segment.windows > 0 && segment.windows <= 20));
            for (flight, name) in ["a", "b"].into_iter().enumerate() {
                let part = Sums::of(found.iter().filter(|segment| segment.manoeuvre == format!("class {name}")));
                prop_assert_eq!(part.windows(), flights[flight].len().div_ceil(stride));
            }
        }
    }

    #[test]
    fn nothing_has_no_error() {
        assert_eq!(Sums::of(&[]).rmse(), ChannelValues::default());
        assert_eq!(Sums::of(&[]).max_abs(), ChannelValues::default());
    }
}
