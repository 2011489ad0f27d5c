//! Models tried on the same blocks: one pass for the columns of all of them, then for each its held-out error block by block.

use super::design::{Design, Free, Layout};
use super::fit::{Component, Prior, Reduced, Solution, components};
use super::gram::{Block, BlockGram, grams};
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel, Span};
use crate::physics::{Model, Regressor, Wanted, calibrate, catalogue};
use phyture_kernels::random::permutation;
use std::ops::Range;

/// Folds over the blocks.
pub(super) const FOLDS: usize = 10;

/// The fold of each of so many blocks, at random.
pub(super) fn permuted_folds(blocks: usize, seed: u64) -> Vec<usize> {
    let mut fold = vec![0; blocks];
    permutation(blocks, seed, 0).iter().enumerate().for_each(|(position, &block)| fold[block as usize] = position % FOLDS);
    fold
}

/// Flights, and what they are cut into.
pub(super) struct Engine<'a> {
    pub flights: &'a [Flight],
    pub blocks: Vec<Block>,
    /// Fold of each block.
    pub fold: Vec<usize>,
    /// Samples over which a residual is correlated.
    pub correlation: f64,
    /// Coefficients held on the side of zero that physics gives them, by kind of effect and name: they were found on the other one.
    pub held: Vec<(String, String)>,
}

/// Squared errors by channel and block.
pub(super) type Errors = PerChannel<Vec<f64>>;

/// A model on the blocks.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    /// With coefficients fitted on all blocks.
    pub model: Model,
    pub layout: Layout,
    /// For each channel the squared error of each block under coefficients of other folds.
    pub errors: Errors,
    /// Channels that the model changes against the one it is compared with.
    pub changed: PerChannel<bool>,
    /// Whether a coefficient of the last effect is on a bound.
    pub at_bound: bool,
}

impl Trial {
    /// Value in a flight of a number by its position in `layout.free`.
    pub fn value_in(&self, free: usize, flight: &str) -> f64 {
        let Some(&Free { effect, coefficient }) = self.layout.free.get(free) else { return 0.0 };
        let number = self.model.effects.get(effect).and_then(|effect| effect.coefficients.get(coefficient));
        number.map_or(0.0, |number| number.in_flight(flight))
    }
}

/// What one pass brought: a model, others that change it, and the Gram matrices behind them.
pub(super) struct Pass {
    pub base: Trial,
    /// `None` where the blocks do not determine the coefficients.
    pub trials: Vec<Option<Trial>>,
    pub grams: Vec<BlockGram>,
}

/// What is presumed about each free coefficient.
pub(super) fn priors(model: &Model, layout: &Layout, held: &[(String, String)]) -> Vec<Prior> {
    layout
        .free
        .iter()
        .map(|free| {
            let Some(effect) = model.effects.get(free.effect) else { return Prior::FREE };
            let definition = catalogue::definition(&effect.kind).filter(|definition| definition.notes.is_some());
            let known = effect.coefficients.get(free.coefficient).zip(definition);
            match known.and_then(|(coefficient, definition)| definition.coefficient(&coefficient.name)) {
                Some(known) => {
                    let is_held = held.iter().any(|(kind, name)| *kind == effect.kind && name == known.name);
                    let sign = known.physical_sign().filter(|_| is_held);
                    let bounds = sign.map_or(known.bounds, |(sign, _)| sign.bounds(known.bounds));
                    Prior { bounds, by_flight: known.deviation_in(effect) }
                }
                None => Prior::FREE,
            }
        })
        .collect()
}

impl Engine<'_> {
    pub fn rows(&self) -> usize {
        self.blocks.iter().map(|block| block.count(self.flights)).sum()
    }

    pub fn spans(&self) -> impl Iterator<Item = Span> {
        self.blocks.iter().map(|block| Span { flight: block.flight, start: block.start, end: block.end })
    }

    /// The blocks of each flight, as ranges.
    pub fn runs(&self) -> impl Iterator<Item = Range<usize>> {
        let mut next = 0;
        self.blocks.chunk_by(|left, right| left.flight == right.flight).map(move |run| {
            let start = next;
            next += run.len();
            start..next
        })
    }

    /// Mean squared error of each channel.
    pub fn mse(&self, trial: &Trial) -> PerChannel<f64> {
        let rows = self.rows().max(1) as f64;
        PerChannel::from_fn(|channel| trial.errors[channel].iter().sum::<f64>() / rows)
    }

    /// Tries a model and others that have its effects and one more, or one less, or other numbers inside.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if the blocks, or those of nine of the ten folds, do not determine the coefficients of `base`.
    pub fn pass(&self, base: &Model, models: &[Model]) -> Result<Pass> {
        let mut design = Design::default();
        let regressors = design.columns.regressors(base, Wanted::default())?;
        let layout = design.add(base, &regressors);
        let mut layouts = Vec::with_capacity(models.len());
        for model in models {
            let own = regressors_of(&mut design, model, (base, &regressors))?;
            layouts.push(design.add(model, &own));
        }
        let grams = grams(self.flights, &self.blocks, &design)?;
        let base = self.base(base, &layout, &grams)?;
        let one = |(model, layout): (&Model, &Layout)| self.trial(model, layout, &base, &grams);
        #[cfg(feature = "rayon")]
        let trials = {
            use rayon::prelude::*;
            models.par_iter().zip(layouts.par_iter()).map(one).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let trials = models.iter().zip(&layouts).map(one).collect();
        Ok(Pass { base, trials, grams })
    }

    /// A model by itself.
    fn base(&self, model: &Model, layout: &Layout, grams: &[BlockGram]) -> Result<Trial> {
        let nothing = Trial {
            model: model.clone(),
            layout: Layout::default(),
            errors: PerChannel::from_fn(|_| vec![f64::NAN; self.blocks.len()]),
            changed: PerChannel::splat(true),
            at_bound: false,
        };
        // Twice: channels that share coefficients are weighted by an error that is known only then.
        let Some(first) = self.fit(model, layout, &nothing, &PerChannel::splat(1.0), grams) else {
            return Err(self.undetermined(model));
        };
        let weights = self.weights(&first);
        Ok(self.fit(model, layout, &nothing, &weights, grams).unwrap_or(first))
    }

    /// Why the blocks do not determine a model, in the words of a calibration on all of them or on those of all folds but one.
    fn undetermined(&self, model: &Model) -> Error {
        let failure = |held: Option<usize>| {
            let kept = self.blocks.iter().zip(&self.fold).filter(|(_, fold)| Some(**fold) != held);
            let spans: Vec<Span> =
                kept.map(|(block, _)| Span { flight: block.flight, start: block.start, end: block.end }).collect();
            calibrate(model, self.flights, &spans).err()
        };
        if let Some(error) = failure(None) {
            return error;
        }
        match (0..FOLDS).find_map(|held| failure(Some(held))) {
            Some(Error::Undetermined(message)) => {
                Error::Undetermined(format!("a search needs more than one part of the flights to judge by: without one tenth of the blocks, {message}"))
            }
            Some(error) => error,
            None => Error::Undetermined(
                "the flights hardly determine the coefficients of the model: some of its regressors are nearly linearly dependent; \
                 give flights that move them apart, or set `enabled = false` on one of the effects"
                    .into(),
            ),
        }
    }

    /// Weight of each channel: the inverse of its mean squared error.
    pub fn weights(&self, trial: &Trial) -> PerChannel<f64> {
        self.mse(trial).map(|mse| 1.0 / mse.max(f64::MIN_POSITIVE))
    }

    fn trial(&self, model: &Model, layout: &Layout, base: &Trial, grams: &[BlockGram]) -> Option<Trial> {
        self.fit(model, layout, base, &self.weights(base), grams)
    }

    /// Fits the channels in which a layout differs from that of `base`, and those that share coefficients with them.
    fn fit(&self, model: &Model, layout: &Layout, base: &Trial, weights: &PerChannel<f64>, grams: &[BlockGram]) -> Option<Trial> {
        let named = |layout: &Layout, channel: Channel| {
            let columns = &layout.channels[channel];
            let free: Vec<_> = columns.free.iter().map(|(free, columns)| (layout.free[*free], columns.clone())).collect();
            (free, columns.fixed.clone())
        };
        let differs: PerChannel<bool> = PerChannel::from_fn(|channel| {
            base.errors[channel].iter().any(|error| error.is_nan()) || named(layout, channel) != named(&base.layout, channel)
        });
        let mut trial = Trial {
            model: model.clone(),
            layout: layout.clone(),
            errors: base.errors.clone(),
            changed: PerChannel::splat(false),
            at_bound: false,
        };
        let priors = priors(model, layout, &self.held);
        for (channels, members) in components(layout) {
            if !channels.iter().any(|&channel| differs[channel]) {
                continue;
            }
            let reduced: Vec<Reduced> = channels.iter().map(|&channel| Reduced::new(layout, channel, grams)).collect();
            let component = self.component(&channels, &members, &reduced, weights, &priors);
            let solution = component.solve(&|_| 1.0)?;
            for (channel, errors) in component.held_out(FOLDS, &|block| self.fold[block])? {
                trial.errors[channel] = errors;
                trial.changed[channel] = true;
            }
            self.store(&component, &solution, &mut trial);
        }
        Some(trial)
    }

    pub fn component<'b>(
        &'b self,
        channels: &[Channel],
        members: &[usize],
        reduced: &'b [Reduced],
        weights: &PerChannel<f64>,
        priors: &[Prior],
    ) -> Component<'b> {
        let single = channels.len() == 1;
        Component {
            channels: channels
                .iter()
                .zip(reduced)
                .map(|(&channel, reduced)| (channel, if single { 1.0 } else { weights[channel] }, reduced))
                .collect(),
            members: members.to_vec(),
            priors: members.iter().map(|&member| priors[member]).collect(),
            blocks: &self.blocks,
            correlation: self.correlation,
        }
    }

    /// Writes what was found into the trial's model.
    fn store(&self, component: &Component<'_>, solution: &Solution, trial: &mut Trial) {
        let last = trial.model.effects.len().saturating_sub(1);
        let locals: Vec<usize> =
            (0..component.members.len()).filter(|&member| component.priors[member].by_flight.is_some()).collect();
        for (position, &member) in component.members.iter().enumerate() {
            let free = trial.layout.free[member];
            let Some(coefficient) =
                trial.model.effects.get_mut(free.effect).and_then(|effect| effect.coefficients.get_mut(free.coefficient))
            else {
                continue;
            };
            match locals.iter().position(|&local| local == position) {
                None => coefficient.value = solution.values[position],
                Some(local) => {
                    let name = |flight: usize| self.flights.get(flight).map_or_else(String::new, |flight| flight.name.clone());
                    let values: std::collections::BTreeMap<String, f64> =
                        solution.by_flight.iter().map(|(flight, values)| (name(*flight), values[local])).collect();
                    coefficient.value = values.values().sum::<f64>() / values.len().max(1) as f64;
                    coefficient.by_flight = Some(values);
                }
            }
            trial.at_bound |= free.effect == last && solution.bound[position];
        }
    }
}

/// The regressors of a model, those of `base` taken over where it only has an effect more.
fn regressors_of(design: &mut Design, model: &Model, (base, known): (&Model, &[Regressor])) -> Result<Vec<Regressor>> {
    let common = base.effects.len();
    if model.effects.len() == common + 1 && model.effects.iter().zip(&base.effects).all(|(left, right)| left == right) {
        return design.enlarged(model, known);
    }
    design.columns.regressors(model, Wanted::default())
}
