//! Predictions for whole flights, of a hybrid or of a model alone, and the table that they make. How one is predicted is `hybrid`'s and
//! `physics`'s business, how a table is written `flight::write`'s.

use crate::critique::coverage::outside;
use crate::error::{Error, Result};
use crate::flight::windows::windows;
use crate::flight::write::Values;
use crate::flight::{Channel, DataSet, Flight, PerChannel, Span, Window};
use crate::hybrid::{Hybrid, check_finite};
use crate::physics::Model;
use crate::tape::Threads;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A network by its run folder or by its file.
///
/// # Errors
/// As [`Hybrid::read`].
pub fn read_network(path: &Path) -> Result<Hybrid> {
    Hybrid::read(&if path.is_dir() { path.join("network.safetensors") } else { path.into() })
}

/// What predicts.
pub enum Predictor<'a> {
    /// Physics and network.
    Hybrid(&'a Hybrid),
    /// Physics alone.
    Physics(&'a Model),
}

impl<'a> Predictor<'a> {
    /// Of a model, a network, or both: the network's own model then, which `place` names where it is another.
    ///
    /// # Errors
    /// [`Error::Config`] for neither, and for a model that the network was not trained on.
    pub fn new(model: Option<&'a Model>, network: Option<&'a Hybrid>, place: &str) -> Result<Self> {
        match (model, network) {
            (None, None) => Err(Error::Config {
                place: place.into(),
                field: "model".into(),
                found: "nothing, and neither is there a network".into(),
                expected: "a model, a network, or both".into(),
            }),
            (Some(model), None) => Ok(Self::Physics(model)),
            (Some(model), Some(hybrid)) if model.effects != hybrid.description().model.effects => Err(Error::Config {
                place: place.into(),
                field: "effect".into(),
                found: "effects or coefficients other than those the network was trained on".into(),
                expected: "the model of the run (a residual belongs to its baseline); train again, or leave out -m".into(),
            }),
            (_, Some(hybrid)) => Ok(Self::Hybrid(hybrid)),
        }
    }

    /// `hybrid` or `physics`.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Hybrid(_) => "hybrid",
            Self::Physics(_) => "physics",
        }
    }

    /// The physical model.
    pub const fn model(&self) -> &'a Model {
        match self {
            Self::Hybrid(hybrid) => &hybrid.description().model,
            Self::Physics(model) => model,
        }
    }

    /// Samples that a prediction needs.
    pub fn history(&self) -> usize {
        match self {
            Self::Hybrid(hybrid) => hybrid.description().config.history(),
            Self::Physics(_) => 1,
        }
    }

    /// Predicts every `stride`-th sample that has a full history. `told` hears after each flight how many predictions there are, of how many, and
    /// may say `false` to end the work.
    ///
    /// # Errors
    /// As [`Model::check_flights`], [`Hybrid::predict`] and [`Model::predict`]; [`Error::Undetermined`] for a prediction that is not finite;
    /// [`Error::Interrupted`] where `told` ends it.
    pub fn predict(
        &self,
        set: &DataSet,
        stride: usize,
        threads: Threads,
        told: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<Predictions> {
        self.model().check_flights(&set.flights)?;
        let history = self.history();
        let whole = |flight: usize| Span { flight, start: 0, end: set.flights[flight].len() };
        let all = windows(&(0..set.flights.len()).map(whole).collect::<Vec<_>>(), history, stride);
        let mut predicted = Vec::with_capacity(all.len());
        for flight in &set.flights {
            if !told(predicted.len(), all.len()) {
                return Err(Error::Interrupted { saved: "no prediction was kept".into() });
            }
            // One flight at a time, so that there is something to show.
            let of_flight = windows(&[Span { flight: 0, start: 0, end: flight.len() }], history, stride);
            predicted.extend(self.of_flight(flight, &of_flight, threads)?);
        }
        told(predicted.len(), all.len());
        let (half_width, outside) = self.limits(set, &all);
        Ok(Predictions { of: self.name(), windows: all, predicted, half_width, outside })
    }

    /// What a hybrid says of its own limits at each window.
    fn limits(&self, set: &DataSet, windows: &[Window]) -> (Option<Vec<PerChannel<f64>>>, Option<Vec<String>>) {
        let Self::Hybrid(hybrid) = self else { return (None, None) };
        let description = hybrid.description();
        let half_width = description.intervals.as_ref().map(|intervals| {
            let of = |window: &Window| intervals.half_width(&set.flights[window.flight].state(window.last));
            windows.iter().map(of).collect()
        });
        let outside = description.envelope.as_ref().map(|envelope| {
            let of = |window: &Window| outside(envelope, &set.flights[window.flight], window.last).unwrap_or_default().to_owned();
            windows.iter().map(of).collect()
        });
        (half_width, outside)
    }

    /// At the windows of one flight, all of them finite.
    fn of_flight(&self, flight: &Flight, windows: &[Window], threads: Threads) -> Result<Vec<PerChannel<f64>>> {
        match self {
            Self::Hybrid(hybrid) => hybrid.predict(std::slice::from_ref(flight), windows, threads),
            Self::Physics(model) => {
                let columns = model.predict(flight)?;
                let at = |window: &Window| {
                    let values = PerChannel::from_fn(|channel| columns[channel][window.last]);
                    check_finite(flight, window.last, &values).map(|()| values)
                };
                windows.iter().map(at).collect()
            }
        }
    }
}

/// The accelerations that were predicted, and where.
pub struct Predictions {
    /// `hybrid` or `physics`.
    pub of: &'static str,
    /// The samples.
    pub windows: Vec<Window>,
    /// One prediction each, m/s² and rad/s².
    pub predicted: Vec<PerChannel<f64>>,
    /// Half of the interval around each, where the hybrid has intervals.
    pub half_width: Option<Vec<PerChannel<f64>>>,
    /// What each sample is outside of, as [`outside`] says it and empty inside; where the hybrid has an envelope.
    pub outside: Option<Vec<String>>,
}

/// Predictions as columns of one length: class and name of the flight, what the sample is outside of, time in s, then each acceleration as it was
/// measured and as it is predicted, m/s² and rad/s², and half of the intervals.
pub struct PredictionTable {
    /// Columns of text by name.
    pub text: Vec<(String, Vec<String>)>,
    /// Columns of numbers by name.
    pub numbers: Vec<(String, Vec<f64>)>,
}

impl PredictionTable {
    /// All columns in order, to be written.
    pub fn columns(&self) -> Vec<(&str, Values<'_>)> {
        let text = self.text.iter().map(|(name, values)| (name.as_str(), Values::Text(values)));
        text.chain(self.numbers.iter().map(|(name, values)| (name.as_str(), Values::Numbers(values)))).collect()
    }
}

/// What was predicted, in short, as data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PredictionSummary {
    /// The file with the table, if it was written.
    pub predictions: Option<PathBuf>,
    /// `hybrid` or `physics`.
    pub of: &'static str,
    /// Predictions.
    pub rows: usize,
    /// Flights.
    pub flights: usize,
}

impl Predictions {
    /// The table, beside what was measured on `set`.
    pub fn table(&self, set: &DataSet) -> PredictionTable {
        let windows = &self.windows;
        let flight_of = |row: usize| &set.flights[windows[row].flight];
        let numbers = |value: &dyn Fn(usize) -> f64| (0..windows.len()).map(value).collect::<Vec<f64>>();
        let text = |value: &dyn Fn(usize) -> String| (0..windows.len()).map(value).collect::<Vec<String>>();
        let mut columns = vec![("t".to_owned(), numbers(&|row| flight_of(row).time_s(windows[row].last)))];
        for channel in Channel::ALL {
            let column = channel.column();
            columns.push((column.name().to_owned(), numbers(&|row| flight_of(row).column(column)[windows[row].last])));
            columns.push((format!("{}_predicted", column.name()), numbers(&|row| self.predicted[row][channel])));
        }
        if let Some(half) = &self.half_width {
            columns
                .extend(Channel::ALL.map(|channel| (format!("{}_half_width", channel.name()), numbers(&|row| half[row][channel]))));
        }
        let mut named = vec![
            ("manoeuvre".to_owned(), text(&|row| flight_of(row).manoeuvre.clone())),
            ("flight".to_owned(), text(&|row| flight_of(row).name.clone())),
        ];
        named.extend(self.outside.as_ref().map(|outside| ("outside".to_owned(), outside.clone())));
        PredictionTable { text: named, numbers: columns }
    }

    /// In short; `file` is where the table was written.
    pub fn summary(&self, set: &DataSet, file: Option<PathBuf>) -> PredictionSummary {
        PredictionSummary { predictions: file, of: self.of, rows: self.windows.len(), flights: set.flights.len() }
    }
}
