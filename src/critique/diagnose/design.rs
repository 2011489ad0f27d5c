//! Which columns a set of models needs, and how each model is made of them. Equal columns are one.

use crate::error::Result;
use crate::flight::PerChannel;
use crate::formula::Node;
use crate::physics::{Columns, Model, Regressor, Wanted};
use std::collections::HashMap;

/// Distinct columns of many models, by channel.
#[derive(Clone, Debug, Default)]
pub(super) struct Design {
    /// What the columns are made of.
    pub columns: Columns,
    /// Every distinct column.
    pub nodes: Vec<Node>,
    /// What the first model that has a column calls it.
    pub labels: Vec<String>,
    known: HashMap<Node, usize>,
    /// For each channel the columns in it, in order of first use.
    pub channels: PerChannel<Vec<usize>>,
    /// For each of these the only model that has it, by the order in which models were added; `None` where several do, or the first.
    pub owners: PerChannel<Vec<Option<usize>>>,
    models: usize,
}

/// A coefficient that a fit finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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
    pub channels: PerChannel<ChannelLayout>,
}

impl Design {
    /// The place of a column in its channel.
    pub fn column(&mut self, model: &Model, regressor: &Regressor) -> usize {
        let column = *self.known.entry(regressor.node).or_insert_with(|| {
            self.nodes.push(regressor.node);
            self.labels.push(model.label(regressor));
            self.nodes.len() - 1
        });
        let (channel, owners) = (&mut self.channels[regressor.channel], &mut self.owners[regressor.channel]);
        match channel.iter().position(|known| *known == column) {
            Some(place) => {
                if owners[place] != Some(self.models) {
                    owners[place] = None;
                }
                place
            }
            None => {
                channel.push(column);
                // The first model is what the others are held against: its columns meet all.
                owners.push((self.models > 1).then_some(self.models));
                channel.len() - 1
            }
        }
    }

    /// Lets every column meet every other, for whoever mixes those of several models.
    pub fn mix(&mut self) {
        self.owners.iter_mut().flatten().for_each(|owner| *owner = None);
    }

    /// Adds what a model needs at its present numbers and says how the model is made of it.
    ///
    /// # Errors
    /// As [`Columns::regressors`].
    pub fn model(&mut self, model: &Model) -> Result<Layout> {
        let regressors = self.columns.regressors(model, Wanted::default())?;
        Ok(self.add(model, &regressors))
    }

    /// Adds regressors of a model and says how it is made of them.
    pub fn add(&mut self, model: &Model, regressors: &[Regressor]) -> Layout {
        let mut layout = Layout::default();
        for regressor in regressors {
            let Some(coefficient) = regressor.number else { continue };
            let free = Free { effect: regressor.effect, coefficient };
            if !layout.free.contains(&free) {
                layout.free.push(free);
            }
        }
        self.models += 1;
        // In the order of the model: those of an effect at its end come last.
        layout.free.sort_unstable();
        for regressor in regressors {
            let column = self.column(model, regressor);
            let channel = &mut layout.channels[regressor.channel];
            let Some(coefficient) = regressor.number else {
                channel.fixed.push(column);
                continue;
            };
            let wanted = Free { effect: regressor.effect, coefficient };
            let free = layout.free.binary_search(&wanted).expect("listed above");
            match channel.free.iter_mut().find(|known| known.0 == free) {
                Some(known) => known.1.push((column, 1.0)),
                None => channel.free.push((free, vec![(column, 1.0)])),
            }
        }
        layout
    }

    /// The regressors of a model that has all effects of `base` and one more at its end: those of `base` are taken over where the new effect
    /// is still off, its coefficients zero.
    ///
    /// # Errors
    /// As [`Columns::regressors`].
    pub fn enlarged(&mut self, model: &Model, base: &[Regressor]) -> Result<Vec<Regressor>> {
        let last = model.effects.len() - 1;
        let is_off = model.effects.last().is_some_and(|effect| {
            let zero = |value: &f64| *value == 0.0;
            !effect.coefficients.is_empty()
                && effect.coefficients.iter().all(|c| zero(&c.value) && c.by_flight.iter().flatten().all(|(_, value)| zero(value)))
        });
        if !is_off {
            return self.columns.regressors(model, Wanted::default());
        }
        let mut regressors = base.to_vec();
        regressors.extend(self.columns.regressors(model, Wanted { effect: Some(last), ..Wanted::default() })?);
        Ok(regressors)
    }
}

#[cfg(test)]
mod tests {
    use super::super::gram::tests::model;
    use super::*;
    use crate::flight::Channel;
    use crate::physics::{Effect, catalogue};

    #[test]
    fn equal_formulas_are_one_column_and_one_coefficient_in_two_channels_is_one() -> Result<()> {
        let mut model = model();
        model.effects.push(Effect::formula("again", Channel::VxDot, "vx", 0.0)?);
        let mut design = Design::default();
        let layout = design.model(&model)?;
        // Two coefficients on one column: the model's own drag and the copy.
        let columns: Vec<_> = layout.channels[Channel::VxDot].free.iter().map(|entry| entry.1.clone()).collect();
        assert_eq!(columns.len(), 2);
        assert_eq!(columns[0], columns[1]);
        let free: usize = model.effects.iter().map(|effect| effect.coefficients.len()).sum();
        assert_eq!(layout.free.len(), free);
        Ok(())
    }

    #[test]
    fn adding_a_model_twice_adds_no_column() -> Result<()> {
        let mut design = Design::default();
        let first = design.model(&model())?;
        let columns = design.nodes.len();
        let second = design.model(&model())?;
        assert_eq!(design.nodes.len(), columns);
        assert_eq!(first.channels, second.channels);
        assert_eq!(first.free, second.free);
        Ok(())
    }

    #[test]
    fn a_model_enlarged_piece_by_piece_has_the_columns_of_the_whole() -> Result<()> {
        let mut design = Design::default();
        let base = design.columns.regressors(&model(), Wanted::default())?;
        for kind in ["", "ground_effect", "wind", "imu_lever", "rotor_droop", "ctrl_nonlin"] {
            let mut larger = model();
            larger.effects.push(match catalogue::definition(kind) {
                Some(definition) => definition.effect(4.58, 0.8),
                None => Effect::formula("more", Channel::WxDot, "u4 * wz", 0.0)?,
            });
            let pieces = design.enlarged(&larger, &base)?;
            let (pieces, whole) = (design.add(&larger, &pieces), design.model(&larger)?);
            assert_eq!(pieces.free, whole.free, "{kind}");
            for (pieces, mut whole) in pieces.channels.into_iter().zip(whole.channels) {
                whole.free.sort_by_key(|entry| pieces.free.iter().position(|known| known.0 == entry.0));
                assert_eq!(pieces.fixed, whole.fixed, "{kind}");
                assert_eq!(pieces.free, whole.free, "{kind}");
            }
        }
        Ok(())
    }
}
