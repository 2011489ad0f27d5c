//! The envelope: where in state and control a hybrid was calibrated and trained, and whether a sample lies outside of it.
//!
//! Two questions are asked of a sample. Is each quantity within the smallest and the largest value seen? And is the whole sample near to
//! one that was seen, since a fast climb in a steep bank can be new where speed, climb and bank by themselves are not? It says nothing of how
//! large an error is: that is `interval`.

use crate::error::{Error, Result};
use crate::flight::{Flight, Span};
use serde::{Deserialize, Serialize};

/// Samples that stand for all that were seen. More make the envelope tighter; each costs a distance a prediction.
const CENTRES: usize = 128;

/// Samples that centres are chosen from.
const CANDIDATES: usize = 20_000;

/// The smallest and the largest value of a quantity in the training part, in its unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// A column of the state, or one of the log's own.
    pub name: String,
    /// Smallest.
    pub low: f64,
    /// Largest.
    pub high: f64,
}

/// Where a sample lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Each quantity within its range, and the sample near to one that was seen.
    Inside,
    /// A quantity beyond its range: the one that is farthest out, in units of the width of its range.
    Beyond {
        /// Which of [`Envelope::ranges`].
        quantity: usize,
        /// Its value in its unit.
        value: f64,
    },
    /// Each quantity within its range, but all together farther from everything that was seen than any training sample is.
    Apart {
        /// Distance from what is next, as a share of the largest of a training sample; above 1.
        distance: f64,
    },
}

/// Where a hybrid was calibrated and trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// What physics, linear history and network read: a quantity that none of them reads is not asked.
    ranges: Vec<Range>,
    /// Samples that stand for all, each quantity as a share of its range, 0 to 1; row by row, `[centres, quantities]`.
    centres: Vec<f32>,
    /// No training sample is farther from the nearest centre, in shares of the ranges (Euclidean).
    radius: f64,
}

impl Envelope {
    /// The envelope of `names` over the samples of `spans`. Centres are chosen one after the other, each the sample that is farthest from all
    /// before it (Gonzalez, Theoretical Computer Science 38, 1985), from at most 20,000 evenly spaced ones.
    ///
    /// # Errors
    /// [`Error::Log`] if a flight lacks a quantity; [`Error::Undetermined`] if the spans hold no sample.
    pub(super) fn new(names: &[String], flights: &[Flight], spans: &[Span]) -> Result<Self> {
        let samples: usize = spans.iter().map(|span| span.end - span.start).sum();
        if samples == 0 {
            return Err(Error::Undetermined("no sample to take an envelope from: the training part is empty".into()));
        }
        let columns: Vec<Vec<&[f64]>> =
            spans.iter().map(|span| columns(&flights[span.flight], span, names)).collect::<Result<_>>()?;
        let ranges: Vec<Range> =
            names.iter().enumerate().map(|(index, name)| range(name, columns.iter().map(|span| span[index]))).collect();
        let mut envelope = Self { ranges, centres: Vec::new(), radius: 0.0 };
        let mut row = vec![0.0; names.len()];
        let mut candidates: Vec<f32> = Vec::new();
        let stride = samples.div_ceil(CANDIDATES);
        visit(&columns, stride, &mut row, &mut |row| candidates.extend(envelope.shares(row).map(|share| share as f32)));
        envelope.centres = spread_out(&candidates, names.len());
        let mut farthest = 0.0_f64;
        visit(&columns, 1, &mut row, &mut |row| farthest = farthest.max(envelope.square(row)));
        envelope.radius = farthest.sqrt();
        Ok(envelope)
    }

    /// The quantities that are asked, with the smallest and largest value of each in the training part.
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// Where a sample lies; `values` in the order of [`Envelope::ranges`], in their units. Allocates nothing.
    ///
    /// # Panics
    /// If there are more or fewer values than ranges.
    pub fn place(&self, values: &[f64]) -> Place {
        assert_eq!(values.len(), self.ranges.len(), "one value a quantity");
        let excess = |share: f64| (-share).max(share - 1.0);
        let beyond = self.shares(values).map(excess).enumerate().filter(|(_, excess)| *excess > 0.0);
        if let Some((quantity, _)) = beyond.max_by(|one, other| one.1.total_cmp(&other.1)) {
            return Place::Beyond { quantity, value: values[quantity] };
        }
        let distance = self.square(values).sqrt();
        if distance > self.radius { Place::Apart { distance: distance / self.radius } } else { Place::Inside }
    }

    /// Refuses numbers that cannot be an envelope: a description may come from any file.
    pub(super) fn check(&self) -> std::result::Result<(), String> {
        let Self { ranges, centres, radius } = self;
        if let Some(range) = ranges.iter().find(|range| !(range.low <= range.high && (range.high - range.low).is_finite())) {
            return Err(format!("`{}` from {} to {}", range.name, range.low, range.high));
        }
        if ranges.is_empty()
            || centres.is_empty()
            || !centres.len().is_multiple_of(ranges.len().max(1))
            || centres.iter().any(|share| !share.is_finite())
        {
            return Err(format!("{} numbers for centres of {} quantities", centres.len(), ranges.len()));
        }
        if *radius >= 0.0 && radius.is_finite() { Ok(()) } else { Err(format!("a radius of {radius}")) }
    }

    /// Each value as a share of its range. What never changed is 0 where it still is what it was, and outside anywhere else.
    fn shares(&self, values: &[f64]) -> impl Iterator<Item = f64> {
        let share = |(range, value): (&Range, &f64)| match range.high - range.low {
            width if width > 0.0 => (value - range.low) / width,
            _ if *value == range.low => 0.0,
            _ => f64::INFINITY,
        };
        self.ranges.iter().zip(values).map(share)
    }

    /// Square of the distance from the nearest centre.
    fn square(&self, values: &[f64]) -> f64 {
        let of = |centre: &[f32]| {
            centre.iter().zip(self.shares(values)).map(|(at, share)| (share - f64::from(*at)).powi(2)).sum::<f64>()
        };
        self.centres.chunks_exact(self.ranges.len()).map(of).fold(f64::INFINITY, f64::min)
    }
}

/// The values of `names` over a span.
fn columns<'f>(flight: &'f Flight, span: &Span, names: &[String]) -> Result<Vec<&'f [f64]>> {
    let of = |name: &String| {
        let column = flight.named(name).ok_or_else(|| Error::Log {
            path: (&flight.name).into(),
            found: format!("no column `{name}`"),
            expected: "it, because the hybrid reads it".into(),
        })?;
        Ok(&column[span.start..span.end])
    };
    names.iter().map(of).collect()
}

fn range<'c>(name: &str, columns: impl Iterator<Item = &'c [f64]>) -> Range {
    let (low, high) =
        columns.flatten().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    Range { name: name.to_owned(), low, high }
}

/// Hands over every `stride`-th sample of all spans.
fn visit(columns: &[Vec<&[f64]>], stride: usize, row: &mut [f64], take: &mut dyn FnMut(&[f64])) {
    let mut skipped = 0;
    for span in columns {
        let length = span.first().map_or(0, |column| column.len());
        let mut sample = skipped;
        while sample < length {
            row.iter_mut().zip(span).for_each(|(value, column)| *value = column[sample]);
            take(row);
            sample += stride;
        }
        skipped = sample - length;
    }
}

/// Up to [`CENTRES`] rows, each the farthest from all chosen before; the first is the first row.
fn spread_out(rows: &[f32], width: usize) -> Vec<f32> {
    let row = |index: usize| &rows[index * width..][..width];
    let square = |one: &[f32], other: &[f32]| one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum::<f32>();
    let mut nearest = vec![f32::INFINITY; rows.len() / width.max(1)];
    let (mut centres, mut next) = (Vec::with_capacity(CENTRES * width), 0);
    for _ in 0..CENTRES.min(nearest.len()) {
        let centre = row(next);
        centres.extend_from_slice(centre);
        nearest.iter_mut().enumerate().for_each(|(index, nearest)| *nearest = nearest.min(square(row(index), centre)));
        let farthest = nearest.iter().enumerate().max_by(|one, other| one.1.total_cmp(other.1));
        match farthest {
            Some((index, distance)) if *distance > 0.0 => next = index,
            _ => break,
        }
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Column, Targets};
    use proptest::prelude::*;

    /// A flight whose roll and pitch rates are given, everything else zero.
    fn flight(wx: &[f64], wy: &[f64]) -> Flight {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; wx.len()]);
        columns[Column::Wx as usize] = wx.to_vec();
        columns[Column::Wy as usize] = wy.to_vec();
        Flight::new("one", "one", 0.0, 0.01, columns, Targets::Recorded).expect("columns of one length")
    }

    fn envelope(wx: &[f64], wy: &[f64]) -> Envelope {
        let span = Span { flight: 0, start: 0, end: wx.len() };
        Envelope::new(&["wx".into(), "wy".into()], &[flight(wx, wy)], &[span]).expect("both are columns")
    }

    proptest! {
        #[test]
        fn no_sample_that_was_seen_is_outside(rows in prop::collection::vec((-5f64..5.0, -1f64..1.0), 1..400)) {
            let (wx, wy): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
            let envelope = envelope(&wx, &wy);
            for (wx, wy) in rows {
                prop_assert_eq!(envelope.place(&[wx, wy]), Place::Inside);
            }
            prop_assert_eq!(envelope.check(), Ok(()));
        }

        #[test]
        fn a_value_beyond_its_range_is_named_the_farthest_first(x in 1.001f64..9.0, y in 1.001f64..9.0) {
            let grid: Vec<f64> = (0..=20).map(|index| f64::from(index) / 20.0).collect();
            let envelope = envelope(&grid, &grid);
            let quantity = usize::from(y > x);
            prop_assume!((x - y).abs() > 1e-9);
            prop_assert_eq!(envelope.place(&[x, y]), Place::Beyond { quantity, value: x.max(y) });
        }
    }

    #[test]
    fn two_values_that_were_never_seen_together_are_apart() {
        // Both rates move over the same range, but only ever together.
        let line: Vec<f64> = (0..=1000).map(|index| f64::from(index) / 1000.0).collect();
        let envelope = envelope(&line, &line);
        assert_eq!(envelope.place(&[0.3003, 0.3004]), Place::Inside);
        assert!(matches!(envelope.place(&[0.1, 0.9]), Place::Apart { distance } if distance > 10.0));
    }

    #[test]
    fn what_never_changed_is_outside_as_soon_as_it_does() {
        let envelope = envelope(&[2.0; 10], &[0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
        assert_eq!(envelope.place(&[2.0, 1.0]), Place::Inside);
        assert_eq!(envelope.place(&[2.1, 1.0]), Place::Beyond { quantity: 0, value: 2.1 });
    }
}
