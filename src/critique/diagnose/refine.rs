//! The open parameters of a chosen effect, between the points of its grid.

use super::candidate::with;
use super::engine::Trial;
use super::gains::{gains, paired};
use super::scored::Scored;
use super::search::Search;
use crate::error::Result;
use crate::physics::{Effect, Model};
use std::collections::BTreeMap;

impl Search<'_> {
    /// Open parameters between the points of the grid: each in turn, three times on an ever finer grid around its best value.
    /// Also the values of each parameter whose gain is within two standard errors of the best.
    pub(super) fn refine(&self, base: &Trial, chosen: &Scored<'_>) -> Result<(Trial, BTreeMap<String, [f64; 2]>)> {
        let Some(definition) = chosen.candidate.definition else { return Ok((chosen.best.clone(), BTreeMap::new())) };
        let mut tried: Vec<(usize, f64, Vec<f64>)> = Vec::new();
        let open: Vec<usize> =
            (0..definition.parameters.len()).filter(|&index| !definition.parameters[index].grid.is_empty()).collect();
        let mut best = chosen.best.clone();
        let mut gain = chosen.gain;
        let spacing = |index: usize, value: f64| {
            let grid = definition.parameters[index].grid;
            let near = grid.windows(2).filter(|pair| pair[0] <= value && value <= pair[1]).map(|pair| pair[1] - pair[0]);
            near.fold(f64::NAN, f64::max).max(if grid.len() < 2 {
                0.1
            } else {
                (grid[grid.len() - 1] - grid[0]) / grid.len() as f64 * 0.25
            })
        };
        let number = |trial: &Trial, index: usize| {
            trial.model.effects.last().and_then(|effect| effect.parameters.get(index)).map_or(0.0, |parameter| parameter.value)
        };
        let mut steps: Vec<f64> = open.iter().map(|&index| spacing(index, number(&best, index))).collect();
        for _ in 0..3 {
            for (&index, step) in open.iter().zip(&mut steps) {
                let centre = number(&best, index);
                let [low, high] = definition.parameters[index].bounds;
                let values =
                    [-0.8, -0.55, -0.3, -0.12, 0.12, 0.3, 0.55, 0.8].map(|share| (centre + share * *step).clamp(low, high));
                let effect = best.model.effects.last().cloned();
                let Some(effect) = effect else { continue };
                let models: Vec<Model> = values
                    .iter()
                    .map(|&value| {
                        let mut variant = switched_off(&effect);
                        if let Some(parameter) = variant.parameters.get_mut(index) {
                            parameter.value = value;
                        }
                        with(&base.model, &variant)
                    })
                    .collect();
                let pass = self.engine.pass(&base.model, &models)?;
                for trial in pass.trials.into_iter().flatten() {
                    let gains = gains(base, &trial);
                    let found: f64 = gains.iter().sum();
                    tried.push((index, number(&trial, index), gains));
                    if found > gain {
                        (best, gain) = (trial, found);
                    }
                }
                *step *= 0.35;
            }
        }
        let at_best = gains(base, &best);
        let mut profiles = BTreeMap::new();
        for &index in &open {
            let centre = number(&best, index);
            let near = tried.iter().filter(|tried| {
                let (difference, error) = paired(&at_best, &tried.2);
                tried.0 == index && difference <= 2.0 * error
            });
            let profile = near.fold([centre, centre], |[low, high], tried| [low.min(tried.1), high.max(tried.1)]);
            profiles.insert(definition.parameters[index].name.to_owned(), profile);
        }
        Ok((best, profiles))
    }
}

/// The effect with its coefficients at zero, where its columns stand beside those of the model as they are; one without coefficients
/// changes them whatever it is.
fn switched_off(effect: &Effect) -> Effect {
    let mut effect = effect.clone();
    for coefficient in &mut effect.coefficients {
        coefficient.value = 0.0;
        coefficient.by_flight = coefficient.by_flight.take().map(|_| BTreeMap::new());
    }
    effect
}
