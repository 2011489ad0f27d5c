//! Which columns a set of models needs, and how each model is made of them. Equal formulas are one column.

use crate::error::Result;
use crate::formula::Formula;
use crate::physics::{Model, Regressor};
use std::collections::HashMap;

/// Distinct columns of many models, by channel.
#[derive(Clone, Debug, Default)]
pub(super) struct Design {
    /// Every distinct formula.
    pub formulas: Vec<Formula>,
    by_text: HashMap<String, usize>,
    /// For each channel the formulas it multiplies, in order of first use.
    pub channels: [Vec<usize>; 6],
}

/// A coefficient that a fit finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Free {
    /// Index of the effect in the model.
    pub effect: usize,
    /// Index of the coefficient in the effect.
    pub coefficient: usize,
}

/// One channel of a model in terms of the columns of its channel in the [`Design`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ChannelLayout {
    /// For each coefficient that acts here: its index in [`Layout::free`] and the columns, with weights, whose sum it multiplies.
    pub free: Vec<(usize, Vec<(usize, f64)>)>,
    /// Columns with a coefficient of 1.
    pub fixed: Vec<usize>,
}

/// A model in terms of the columns of a [`Design`].
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    pub free: Vec<Free>,
    pub channels: [ChannelLayout; 6],
}

impl Design {
    fn column(&mut self, regressor: &Regressor) -> usize {
        let text = regressor.formula.to_string();
        let formula = *self.by_text.entry(text).or_insert_with(|| {
            self.formulas.push(regressor.formula.clone());
            self.formulas.len() - 1
        });
        let Some(channel) = self.channels.get_mut(regressor.channel) else { return 0 };
        channel.iter().position(|known| *known == formula).unwrap_or_else(|| {
            channel.push(formula);
            channel.len() - 1
        })
    }

    /// Adds what a model needs and says how the model is made of it.
    pub fn add(&mut self, regressors: &[Regressor]) -> Layout {
        let mut layout = Layout::default();
        for regressor in regressors {
            let column = self.column(regressor);
            let free = regressor.coefficient.map(|coefficient| {
                let free = Free { effect: regressor.effect, coefficient };
                layout.free.iter().position(|known| *known == free).unwrap_or_else(|| {
                    layout.free.push(free);
                    layout.free.len() - 1
                })
            });
            let Some(channel) = layout.channels.get_mut(regressor.channel) else { continue };
            match free {
                None => channel.fixed.push(column),
                Some(free) => match channel.free.iter_mut().find(|known| known.0 == free) {
                    Some(known) => known.1.push((column, 1.0)),
                    None => channel.free.push((free, vec![(column, 1.0)])),
                },
            }
        }
        layout
    }
}

/// The regressors of a model that has all effects of `base` and one more at its end: those of `base` are taken over unless the new
/// effect changes signals.
pub(super) fn enlarged(model: &Model, base: &[Regressor]) -> Result<Vec<Regressor>> {
    let last = model.effects.len() - 1;
    if model.effects.last().is_some_and(|effect| effect.swaps.is_empty()) {
        let mut regressors = base.to_vec();
        regressors.extend(model.regressors(|index| index == last)?);
        return Ok(regressors);
    }
    model.regressors(|_| true)
}

#[cfg(test)]
mod tests {
    use super::super::gram::tests::model;
    use super::*;
    use crate::physics::Effect;

    #[test]
    fn equal_formulas_are_one_column_and_one_coefficient_in_two_channels_is_one() -> Result<()> {
        let mut model = model();
        model.effects.push(Effect::formula("again", 0, "vx", 0.0)?);
        let mut design = Design::default();
        let layout = design.add(&model.regressors(|_| true)?);
        assert_eq!(design.formulas.iter().filter(|formula| formula.to_string() == "vx").count(), 1);
        // Two coefficients on one column: the model's own drag and the copy.
        let columns: Vec<_> = layout.channels[0].free.iter().map(|entry| entry.1.clone()).collect();
        assert_eq!(columns.len(), 2);
        assert_eq!(columns[0], columns[1]);
        let free: usize = model.effects.iter().map(|effect| effect.coefficients.len()).sum();
        assert_eq!(layout.free.len(), free);
        Ok(())
    }

    #[test]
    fn adding_a_model_twice_adds_no_column() -> Result<()> {
        let mut design = Design::default();
        let first = design.add(&model().regressors(|_| true)?);
        let formulas = design.formulas.len();
        let second = design.add(&model().regressors(|_| true)?);
        assert_eq!(design.formulas.len(), formulas);
        assert_eq!(first.channels, second.channels);
        assert_eq!(first.free, second.free);
        Ok(())
    }

    #[test]
    fn a_model_enlarged_piece_by_piece_has_the_columns_of_the_whole() -> Result<()> {
        let base = model().regressors(|_| true)?;
        let mut larger = model();
        larger.effects.push(Effect::formula("more", 3, "u4 * wz", 0.0)?);
        let mut design = Design::default();
        let (pieces, whole) = (design.add(&enlarged(&larger, &base)?), design.add(&larger.regressors(|_| true)?));
        assert_eq!(pieces.channels, whole.channels);
        assert_eq!(pieces.free, whole.free);
        Ok(())
    }
}
