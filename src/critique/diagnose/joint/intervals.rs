//! How sure the numbers of a joint fit are: intervals and correlations from fits without each tenth of the blocks, and numbers that hang on one
//! flight, from fits without each flight. The sums behind them are made in `normal`.

use super::{Folds, Point};
use crate::critique::diagnose::engine::Engine;
use crate::critique::diagnose::influence::{Influences, decisive};
use crate::physics::Correlation;
use crate::student_t::quantile_975;

impl Point {
    /// Notes 95 % intervals in the model: from what the numbers would be without each tenth of the blocks (the delete-a-group jackknife, Kott 2001,
    /// Journal of Official Statistics 17:521), given those of each flight.
    pub fn note_intervals(&mut self, folds: &Folds) {
        let (start, open) = self.start(&[]);
        // A number on its bound has none, whatever an earlier fit said.
        for (number, free) in self.layout.free.iter().enumerate().filter(|(number, _)| open.binary_search(number).is_err()) {
            if let Some((_, ci95)) =
                self.model.effects[free.effect].number_mut(free.coefficient).filter(|_| !self.known[number].is_local)
            {
                *ci95 = None;
            }
        }
        let without: Option<Vec<Vec<f64>>> = folds.normals.iter().map(|normal| self.solve(normal, &open, &start, 0.0)).collect();
        let Some(without) = without else { return };
        let count = without.len() as f64;
        let mean = |number: usize| without.iter().map(|values| values[number]).sum::<f64>() / count;
        let deviations: Vec<Vec<f64>> = {
            let means: Vec<f64> = open.iter().map(|&number| mean(number)).collect();
            let of = |values: &Vec<f64>| open.iter().zip(&means).map(|(&number, mean)| values[number] - mean).collect();
            without.iter().map(of).collect()
        };
        let label = |&number: &usize| {
            let effect = &self.model.effects[self.layout.free[number].effect];
            let found = effect.number(self.layout.free[number].coefficient).expect("a number of the model");
            Correlation::label(effect, &found.name)
        };
        let labels = open.iter().map(label).collect();
        self.model.correlations = Correlation::of_deviations(labels, &deviations).into_iter().collect();
        for (place, number) in open.into_iter().enumerate() {
            let variance = deviations.iter().map(|values| values[place].powi(2)).sum::<f64>() * (count - 1.0) / count;
            let half = quantile_975(count - 1.0) * variance.sqrt();
            let free = self.layout.free[number];
            if let Some((value, ci95)) = self.model.effects[free.effect].number_mut(free.coefficient) {
                *ci95 = Some([*value - half, *value + half]);
            }
        }
    }

    /// Numbers that hang on one flight, where they have intervals ([`Point::note_intervals`]).
    pub fn influences(&self, engine: &Engine<'_>) -> Option<Influences> {
        let (start, open) = self.start(&[]);
        let normals = self.without_each_flight(engine, &self.locals(&[]))?;
        let without: Vec<(usize, Option<Vec<f64>>)> =
            normals.iter().map(|(flight, normal)| (*flight, self.solve(normal, &open, &start, 0.0))).collect();
        let of = |&number: &usize| {
            let free = self.layout.free[number];
            let interval = self.model.effects[free.effect].number(free.coefficient)?.ci95?;
            let of_flight = without.iter().map(|(flight, values)| (*flight, values.as_ref().map(|values| values[number])));
            Some(((free.effect, free.coefficient), decisive(interval, of_flight, engine.flights)?))
        };
        Some(open.iter().filter_map(of).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::gram::tests::{model, noise};
    use super::super::super::resample::tests::pulled_by;
    use super::super::tests::engine;
    use super::*;
    use crate::error::{Error, Result};
    use crate::flight::Flight;

    #[test]
    fn a_number_that_hangs_on_one_flight_names_it() -> Result<()> {
        let mut flights = noise(8, &[3000; 12]);
        let found = |flights: &[Flight]| {
            let engine = engine(flights);
            let mut point = Point::at(&engine, Point::fitted(&engine, model(), 10)?, Vec::new())?;
            point.note_intervals(&point.folds(&engine, &[]).expect("determined"));
            Ok::<_, Error>(point.influences(&engine).expect("determined"))
        };
        assert!(found(&flights)?.is_empty());
        pulled_by(&mut flights[11])?;
        let influences = found(&flights)?;
        let named: Vec<&str> = influences.values().map(|influence| influence.flight.as_str()).collect();
        assert_eq!(named, ["f11"], "{influences:?}");
        Ok(())
    }
}
