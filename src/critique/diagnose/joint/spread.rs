//! How far what each flight has for itself (wind, biases) spreads from flight to flight, chosen beside all other numbers: by the errors of blocks
//! that these numbers have not seen, as the search chooses it for one effect (`candidate`). No other number is changed here.

use super::super::engine::Engine;
use super::super::known::known;
use super::Point;
use crate::physics::{SPREAD, catalogue};

impl Point {
    /// Gives each effect whose numbers belong to flights the spread of its grid under which blocks of other folds are predicted best; the
    /// present one where none is better, or where the flights do not determine the others.
    pub fn choose_spreads(&mut self, engine: &Engine<'_>) {
        for effect in 0..self.model.effects.len() {
            let grid = catalogue::definition(&self.model.effects[effect].kind)
                .and_then(|definition| definition.parameter(SPREAD))
                .map_or(&[][..], |spread| spread.grid);
            let Some(mut best) = self.spread(effect).filter(|_| !grid.is_empty()) else { continue };
            let mut lowest = self.held_out_cost(engine);
            for &value in grid {
                self.set_spread(effect, value);
                let cost = self.held_out_cost(engine);
                if cost < lowest {
                    (best, lowest) = (value, cost);
                }
            }
            self.set_spread(effect, best);
        }
    }

    fn spread(&self, effect: usize) -> Option<f64> {
        let parameters = &self.model.effects[effect].parameters;
        parameters.iter().find(|parameter| parameter.name == SPREAD).map(|spread| spread.value)
    }

    fn set_spread(&mut self, effect: usize, value: f64) {
        let mut parameters = self.model.effects[effect].parameters.iter_mut();
        parameters.find(|parameter| parameter.name == SPREAD).expect("the effect has a spread").value = value;
        for (known_of, free) in self.known.iter_mut().zip(&self.layout.free).filter(|(_, free)| free.effect == effect) {
            *known_of = known(&self.model, *free);
        }
    }

    /// As the cost of a fit, of blocks of other folds; infinite where those do not determine the numbers.
    fn held_out_cost(&self, engine: &Engine<'_>) -> f64 {
        let errors = self.folds(engine, &[]).and_then(|folds| self.held_out(engine, &folds, &[]));
        errors.map_or(f64::INFINITY, |errors| self.likelihood(engine, &errors.map(|errors| errors.iter().sum())).1)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::candidate::with;
    use super::super::super::engine::FOLDS;
    use super::super::super::gram::blocks;
    use super::super::super::gram::tests::{model, noise, whole};
    use super::*;
    use crate::error::Result;
    use crate::flight::Column;

    /// Flights with biases of this size, a quarter of the variance being noise.
    fn chosen(size: f64) -> Result<f64> {
        let mut truth = model();
        truth.effects.iter_mut().flat_map(|effect| &mut effect.coefficients).for_each(|number| number.value = -0.5);
        let bias = catalogue::definition("sensor_bias").expect("in the catalogue").effect(4.58, 0.8);
        let mut biased = with(&truth, &bias);
        let mut flights = noise(31, &[6000; 24]);
        for number in &mut biased.effects.last_mut().expect("it has effects").coefficients {
            let sides = flights.iter().enumerate().map(|(index, flight)| {
                let side = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
                (flight.name.clone(), side * size * if number.unit == "m/s" { 0.2 } else { 0.02 })
            });
            number.by_flight = Some(sides.collect());
        }
        for flight in &mut flights {
            let mut accelerations = biased.predict(flight)?;
            for (values, target) in accelerations.iter_mut().zip(Column::TARGETS) {
                values.iter_mut().zip(flight.column(target)).for_each(|(value, noise)| *value += 0.3 * noise);
            }
            *flight = flight.with_accelerations(&accelerations)?;
        }
        let cut = blocks(&flights, &whole(&flights), 10.0);
        let fold = (0..cut.len()).map(|block| block % FOLDS).collect();
        let engine = Engine { flights: &flights, blocks: cut, fold, correlation: 1.0, held: Vec::new() };
        let mut point = Point::at(&engine, with(&truth, &bias), Vec::new())?;
        point.choose_spreads(&engine);
        Ok(point.spread(point.model.effects.len() - 1).unwrap_or(f64::NAN))
    }

    #[test]
    fn small_biases_have_a_small_spread_and_usual_ones_the_usual() -> Result<()> {
        let [small, usual] = [chosen(0.05)?, chosen(1.0)?];
        assert!(small <= 0.15 && usual >= 0.4, "{small} {usual}");
        Ok(())
    }
}
