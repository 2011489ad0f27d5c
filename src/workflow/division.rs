//! What trains and what tests, as whoever asks for a piece of work says it over what the model file says. The dividing itself is
//! `flight::split`'s.

use crate::error::{Error, Result};
use crate::flight::split::{Part, Protocol, Split};
use crate::flight::{Flight, Span};
use crate::physics::Model;

/// What is locked, and how the rest is divided, beside what a model file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Division {
    /// Manoeuvre classes or flights that nothing is fitted to; these come to those that the model file locks.
    pub lock: Vec<String>,
    /// How flights are divided where none is locked; without it as the model file says.
    pub split: Option<Protocol>,
}

impl Division {
    /// The place that errors about a division name; their field is `lock`, `split` or `model`.
    pub const PLACE: &'static str = "division";

    fn fault(field: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Config { place: Self::PLACE.into(), field: field.into(), found: found.into(), expected: expected.into() }
    }

    /// What is locked beside what the model locks already.
    fn added(&self, model: &Model) -> Vec<String> {
        self.lock.iter().filter(|name| !model.data.locked.contains(name)).cloned().collect()
    }

    /// Notes what is locked in the model's file, so that whoever goes on with it locks the same.
    pub fn note(&self, model: &mut Model) {
        let added = self.added(model);
        model.data.locked.extend(added);
    }

    /// Divides the flights.
    ///
    /// # Errors
    /// As [`Model::check_flights`] and [`Split::new`]; [`Error::Config`] for a protocol beside locked flights.
    pub fn split(&self, flights: &[Flight], model: &Model, seed: u64) -> Result<Split> {
        model.check_flights(flights)?;
        let mut locked = model.data.locked.clone();
        locked.extend(self.added(model));
        let protocol = self.split.clone().unwrap_or_else(|| model.data.split.clone());
        if self.split.is_some() && !locked.is_empty() {
            return Err(Self::fault(
                "split",
                format!("`{protocol}` with locked flights ({})", locked.join(", ")),
                "one or the other: locked flights are the test part and all others train",
            ));
        }
        let is_own = |found: &str| self.lock.iter().any(|name| found.starts_with(&format!("`{name}`")));
        Split::new(flights, &locked, &protocol, seed).map_err(|error| match error {
            Error::Config { found, expected, field, .. } if field == "data.locked" && is_own(&found) => {
                Self::fault("lock", found, expected)
            }
            other => other,
        })
    }

    /// Divides the flights for a search. Where nothing is locked and no split is asked for, every fifth flight confirms and no search
    /// sees it; of fewer than ten flights the last fifth of each.
    ///
    /// # Errors
    /// As [`Division::split`].
    pub fn search_split(&self, flights: &[Flight], model: &Model, seed: u64) -> Result<Split> {
        if model.data.locked.is_empty() && self.lock.is_empty() && self.split.is_none() {
            model.check_flights(flights)?;
            return Ok(Split::for_search(flights, seed));
        }
        self.split(flights, model, seed)
    }

    /// Divides the flights for models to be judged on the test part: as the first of them says, or, with `all`, on every flight. What trains
    /// stays what it is.
    ///
    /// # Errors
    /// As [`Division::split`], but for a division that nothing is judged on; [`Error::Config`] without a model.
    pub fn judged(&self, flights: &[Flight], models: &[&Model], seed: u64, all: bool) -> Result<Split> {
        models.iter().try_for_each(|model| model.check_flights(flights))?;
        let Some(first) = models.first() else {
            return Err(Self::fault("model", "nothing", "a model file or a network"));
        };
        let split = self.split(flights, first, seed);
        if !all {
            return split;
        }
        let whole = |(flight, log): (usize, &Flight)| Span { flight, start: 0, end: log.len() };
        Ok(Split {
            training: split.map(|split| split.training).unwrap_or_default(),
            validation: Vec::new(),
            test: flights.iter().enumerate().map(whole).collect(),
            tested: Part::All,
        })
    }
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    use super::*;
    use crate::sim::{Simulation, simulate};

    #[test]
    fn a_lock_is_noted_once_and_is_refused_beside_a_split_or_where_it_names_nothing() -> Result<()> {
        let flights = simulate(&Simulation { minutes: 1.0, ..Simulation::baseline() })?.flights;
        let mut model = Model::paper("helicopter", 8.1, [0.18, 0.34, 0.28], 0.78);
        let class = flights[0].manoeuvre.clone();
        let division = Division { lock: vec![class.clone()], split: None };
        division.note(&mut model);
        division.note(&mut model);
        assert_eq!(model.data.locked, [class.as_str()]);
        assert_eq!(division.search_split(&flights, &model, 1)?, division.split(&flights, &model, 1)?);
        let both = Division { split: Some(Protocol::Segments), ..division };
        let says = |division: &Division, model: &Model| division.split(&flights, model, 1).map_err(|error| error.to_string());
        assert!(says(&both, &model).is_err_and(|text| text.starts_with("division: `split` is `segments` with locked flights")));
        let nothing = Division { lock: vec!["no_such_class".into()], split: None };
        let open = Model::paper("helicopter", 8.1, [0.18, 0.34, 0.28], 0.78);
        assert!(says(&nothing, &open).is_err_and(|text| text.starts_with("division: `lock` is `no_such_class`")));
        // With every flight judged there is nothing to be divided in vain.
        let all = nothing.judged(&flights, &[&open], 1, true)?;
        assert_eq!((all.test.len(), all.training.len(), all.tested), (flights.len(), 0, Part::All));
        assert!(nothing.judged(&flights, &[], 1, true).is_err());
        Ok(())
    }
}
