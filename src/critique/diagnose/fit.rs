//! Constrained least squares from Gram matrices, and the squared error of each block under coefficients that have not seen it.
//!
//! Channels that share a coefficient are fitted together, weighted by the inverse of their error; a channel by itself is
//! unweighted, as in calibration. A coefficient outside its bounds is put on the bound and the others are fitted again. A property of
//! each flight is shrunk towards zero by its usual spread (ridge), and eliminated flight by flight.

use super::design::Layout;
use super::gram::{Block, BlockGram, Product};
use crate::flight::{Channel, PerChannel};
use nalgebra::{Cholesky, DMatrix, DVector};

/// What is known about each coefficient of a layout.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    pub bounds: [f64; 2],
    /// Spread from flight to flight, for a property of each flight.
    pub by_flight: Option<f64>,
}

impl Prior {
    pub const FREE: Self = Self { bounds: [f64::NEG_INFINITY, f64::INFINITY], by_flight: None };
}

/// The Gram matrices of one channel in terms of its coefficients: `[X | y − fixed]`, one square a block.
#[derive(Clone, Debug)]
pub(super) struct Reduced {
    /// Index into [`Layout::free`] of each column but the last.
    pub free: Vec<usize>,
    pub blocks: Vec<DMatrix<f64>>,
}

impl Reduced {
    pub fn new(layout: &Layout, channel: Channel, grams: &[BlockGram]) -> Self {
        let layout = &layout.channels[channel];
        let free = layout.free.iter().map(|entry| entry.0).collect();
        let Some(first) = grams.first() else { return Self { free, blocks: Vec::new() } };
        let first = &first.channels[channel];
        // The last column: measured minus the fixed terms.
        let target = [(first.size() - 1, 1.0)];
        let rest: Vec<(usize, f64)> = target.into_iter().chain(layout.fixed.iter().map(|&column| (column, -1.0))).collect();
        let parts: Vec<&[(usize, f64)]> = layout.free.iter().map(|(_, columns)| columns.as_slice()).chain([&rest[..]]).collect();
        // All blocks have their products at the same places.
        let mut products: Vec<Vec<(Product, f64)>> = Vec::with_capacity(parts.len() * (parts.len() + 1) / 2);
        for (row, of_row) in parts.iter().enumerate() {
            for of_column in &parts[..=row] {
                let pairs = of_row.iter().flat_map(|&(i, a)| of_column.iter().map(move |&(j, b)| (i, j, a * b)));
                products.push(pairs.map(|(i, j, weight)| (first.place(i, j), weight)).collect());
            }
        }
        let reduce = |gram: &BlockGram| {
            let gram = &gram.channels[channel];
            let mut matrix = DMatrix::zeros(parts.len(), parts.len());
            let mut products = products.iter();
            for row in 0..parts.len() {
                for column in 0..=row {
                    let products = products.next().expect("one list an entry");
                    let value = products.iter().fold(0.0, |sum, (product, weight)| sum + weight * gram.at(*product));
                    matrix[(row, column)] = value;
                    matrix[(column, row)] = value;
                }
            }
            matrix
        };
        Self { free, blocks: grams.iter().map(reduce).collect() }
    }

    fn sum(&self, wanted: impl Fn(usize) -> f64) -> DMatrix<f64> {
        let size = self.free.len() + 1;
        let mut sum = DMatrix::zeros(size, size);
        for (index, block) in self.blocks.iter().enumerate() {
            let weight = wanted(index);
            if weight != 0.0 {
                sum.zip_apply(block, |sum, value| *sum += weight * value);
            }
        }
        sum
    }

    /// Squared error of a block under these values of the layout's coefficients.
    pub fn error(&self, block: usize, values: &dyn Fn(usize) -> f64) -> f64 {
        let matrix = &self.blocks[block];
        let last = self.free.len();
        let at = |index: usize| if index == last { 1.0 } else { -values(self.free[index]) };
        let factors: Vec<f64> = (0..=last).map(at).collect();
        let mut sum = 0.0;
        for (column, b) in factors.iter().enumerate() {
            let inner: f64 = factors.iter().enumerate().map(|(row, a)| a * matrix[(row, column)]).sum();
            sum += b * inner;
        }
        sum.max(0.0)
    }
}

/// Channels that are fitted together, with their coefficients.
pub(super) fn components(layout: &Layout) -> Vec<(Vec<Channel>, Vec<usize>)> {
    let of_channel = |channel: Channel| layout.channels[channel].free.iter().map(|entry| entry.0);
    let mut group = PerChannel::new(Channel::ALL);
    for left in Channel::ALL {
        for right in Channel::ALL.into_iter().skip(left.index() + 1) {
            if of_channel(left).any(|free| of_channel(right).any(|other| other == free)) {
                let (from, to) = (group[right], group[left]);
                group.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
            }
        }
    }
    Channel::ALL
        .into_iter()
        .filter(|root| group.values().contains(root))
        .map(|root| {
            let channels: Vec<Channel> = Channel::ALL.into_iter().filter(|&channel| group[channel] == root).collect();
            let mut members: Vec<usize> = channels.iter().flat_map(|&channel| of_channel(channel)).collect();
            members.sort_unstable();
            members.dedup();
            (channels, members)
        })
        .collect()
}

/// Values of the coefficients of one component.
#[derive(Clone, Debug, Default)]
pub(super) struct Solution {
    /// By position in the component's members; those of a property of each flight are zero here.
    pub values: Vec<f64>,
    /// Whether a bound holds.
    pub bound: Vec<bool>,
    /// By flight: the values of the properties of each flight, by position among those.
    pub by_flight: Vec<(usize, Vec<f64>)>,
}

/// One component ready to be fitted on any choice of blocks.
pub(super) struct Component<'a> {
    /// Channel, weight, reduced matrices.
    pub channels: Vec<(Channel, f64, &'a Reduced)>,
    /// Indices into [`Layout::free`].
    pub members: Vec<usize>,
    pub priors: Vec<Prior>,
    pub blocks: &'a [Block],
    /// Samples over which residuals are correlated: a mean over n samples knows as much as n over this many independent ones.
    pub correlation: f64,
}

impl Component<'_> {
    fn place(&self, free: usize) -> usize {
        self.members.binary_search(&free).unwrap_or_default()
    }

    fn is_local(&self, member: usize) -> bool {
        self.priors[member].by_flight.is_some()
    }

    /// Adds `weight` times the sum of a channel's blocks to the normal equations `(matrix, right-hand side)`.
    fn add(&self, sum: &DMatrix<f64>, reduced: &Reduced, weight: f64, matrix: &mut DMatrix<f64>, side: &mut DVector<f64>) {
        let last = reduced.free.len();
        let places: Vec<usize> = reduced.free.iter().map(|&free| self.place(free)).collect();
        for (column, &to) in places.iter().enumerate() {
            for (row, &from) in places.iter().enumerate() {
                matrix[(from, to)] += weight * sum[(row, column)];
            }
            side[to] += weight * sum[(column, last)];
        }
    }

    /// Least squares on the blocks with a weight. `None` if they do not determine the coefficients.
    pub fn solve(&self, weight: &dyn Fn(usize) -> f64) -> Option<Solution> {
        let size = self.members.len();
        let (mut matrix, mut side) = (DMatrix::zeros(size, size), DVector::zeros(size));
        if !(0..size).any(|member| self.is_local(member)) {
            for (_, channel_weight, reduced) in &self.channels {
                self.add(&reduced.sum(weight), reduced, *channel_weight, &mut matrix, &mut side);
            }
            let (values, bound) = self.bounded(&matrix, &side)?;
            return Some(Solution { values, bound, by_flight: Vec::new() });
        }
        let local = self.local();
        let mut eliminated = Vec::new();
        for flight in self.flights() {
            let part = self.eliminated(flight, &local, weight)?;
            matrix += &part.matrix;
            side += &part.side;
            eliminated.push((flight, part.to_global, part.to_side));
        }
        pin(&local, &mut matrix, &mut side);
        let (values, bound) = self.bounded(&matrix, &side)?;
        let global = DVector::from_column_slice(&values);
        let by_flight = eliminated
            .into_iter()
            .map(|(flight, to_global, to_side)| (flight, (to_side - to_global * &global).iter().copied().collect()))
            .collect();
        Some(Solution { values, bound, by_flight })
    }

    /// The common coefficients on the blocks of all flights but one, for each flight; nothing where the others do not determine them.
    pub fn without_each_flight(&self) -> Vec<(usize, Option<Vec<f64>>)> {
        if self.flights().len() < 2 {
            return Vec::new();
        }
        let local = self.local();
        let part = |flight| Some((flight, self.eliminated(flight, &local, &|_| 1.0)?));
        let Some(parts) = self.flights().into_iter().map(part).collect::<Option<Vec<_>>>() else { return Vec::new() };
        let size = self.members.len();
        let (mut matrix, mut side) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for (_, part) in &parts {
            matrix += &part.matrix;
            side += &part.side;
        }
        let without = |(flight, part): (usize, Eliminated)| {
            let (mut matrix, mut side) = (&matrix - part.matrix, &side - part.side);
            pin(&local, &mut matrix, &mut side);
            (flight, self.bounded(&matrix, &side).map(|(values, _)| values))
        };
        parts.into_iter().map(without).collect()
    }

    /// Members that each flight has for itself.
    fn local(&self) -> Vec<usize> {
        (0..self.members.len()).filter(|&member| self.is_local(member)).collect()
    }

    /// Normal equations of one flight without its own coefficients, and what those are made of.
    fn eliminated(&self, flight: usize, local: &[usize], weight: &dyn Fn(usize) -> f64) -> Option<Eliminated> {
        let (own, own_side) = self.of_flight(flight, weight);
        // Shrinks W_f: [A_ll + P] W = b_l − A_lg θ.
        let (a_ll, a_lg, b_l) = self.split(&own, &own_side, local);
        let inverse = Cholesky::new(a_ll)?;
        let (to_global, to_side) = (inverse.solve(&a_lg), inverse.solve(&b_l));
        let matrix = own - a_lg.transpose() * &to_global;
        let side = own_side - a_lg.transpose() * &to_side;
        Some(Eliminated { matrix, side, to_global, to_side })
    }

    fn flights(&self) -> Vec<usize> {
        let mut flights: Vec<usize> = self.blocks.iter().map(|block| block.flight).collect();
        flights.dedup();
        flights
    }

    /// Normal equations of one flight.
    fn of_flight(&self, flight: usize, weight: &dyn Fn(usize) -> f64) -> (DMatrix<f64>, DVector<f64>) {
        let size = self.members.len();
        let (mut matrix, mut side) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let first = self.blocks.partition_point(|block| block.flight < flight);
        for (index, _) in self.blocks.iter().enumerate().skip(first).take_while(|(_, block)| block.flight == flight) {
            let factor = weight(index);
            if factor != 0.0 {
                for (_, channel_weight, reduced) in &self.channels {
                    self.add(&reduced.blocks[index], reduced, channel_weight * factor, &mut matrix, &mut side);
                }
            }
        }
        (matrix, side)
    }

    /// `(A_ll + prior, A_lg with the local columns zero, b_l)`.
    fn split(&self, matrix: &DMatrix<f64>, side: &DVector<f64>, local: &[usize]) -> (DMatrix<f64>, DMatrix<f64>, DVector<f64>) {
        let mut a_ll = DMatrix::from_fn(local.len(), local.len(), |row, column| matrix[(local[row], local[column])]);
        for (index, &member) in local.iter().enumerate() {
            let spread = self.priors[member].by_flight.unwrap_or(1.0);
            // Weights of the channels are inverse variances of one sample; the prior counts as one independent observation.
            a_ll[(index, index)] += self.correlation / (spread * spread);
        }
        let mut a_lg = DMatrix::from_fn(local.len(), matrix.ncols(), |row, column| matrix[(local[row], column)]);
        for &member in local {
            a_lg.column_mut(member).fill(0.0);
        }
        (a_ll, a_lg, DVector::from_fn(local.len(), |row, _| side[local[row]]))
    }

    /// Solves `matrix θ = side` within the bounds: the worst offender is put on its bound until none is left.
    fn bounded(&self, matrix: &DMatrix<f64>, side: &DVector<f64>) -> Option<(Vec<f64>, Vec<bool>)> {
        let size = self.members.len();
        let mut values = vec![0.0; size];
        let mut bound = vec![false; size];
        for _ in 0..=size {
            let open: Vec<usize> = (0..size).filter(|&member| !bound[member]).collect();
            if open.is_empty() {
                break;
            }
            let pinned = |row: usize| -> f64 {
                (0..size).filter(|&member| bound[member]).map(|member| matrix[(row, member)] * values[member]).sum()
            };
            let scale: Vec<f64> = open.iter().map(|&member| matrix[(member, member)].sqrt()).collect();
            if scale.iter().any(|scale| !(scale.is_finite() && *scale > 0.0)) {
                return None;
            }
            let scaled = DMatrix::from_fn(open.len(), open.len(), |i, j| matrix[(open[i], open[j])] / (scale[i] * scale[j]));
            // Correlations of more than about 1 − 1e-8 cannot be resolved by these flights.
            let factor = Cholesky::new(scaled).filter(|factor| factor.l_dirty().diagonal().min() > SMALLEST_PIVOT)?;
            let right = DVector::from_fn(open.len(), |i, _| (side[open[i]] - pinned(open[i])) / scale[i]);
            let found = factor.solve(&right);
            let mut worst: Option<(usize, f64, f64)> = None;
            for (i, &member) in open.iter().enumerate() {
                let value = found[i] / scale[i];
                values[member] = value;
                let [low, high] = self.priors[member].bounds;
                let nearest = value.clamp(low, high);
                let excess = (value - nearest).abs() * scale[i];
                if excess > 0.0 && worst.is_none_or(|worst| excess > worst.1) {
                    worst = Some((member, excess, nearest));
                }
            }
            let Some((member, _, nearest)) = worst else { break };
            (values[member], bound[member]) = (nearest, true);
        }
        Some((values, bound))
    }

    /// Squared errors of each channel's blocks, each under coefficients from the other folds. `fold` gives the fold of a block; a
    /// property of a flight is found from the flight's blocks of other folds.
    pub fn held_out(&self, folds: usize, fold: &dyn Fn(usize) -> usize) -> Option<Vec<(Channel, Vec<f64>)>> {
        let mut errors: Vec<(Channel, Vec<f64>)> =
            self.channels.iter().map(|(channel, ..)| (*channel, vec![0.0; self.blocks.len()])).collect();
        for held in 0..folds {
            let weight = |block: usize| if fold(block) == held { 0.0 } else { 1.0 };
            let solution = self.solve(&weight)?;
            for index in (0..self.blocks.len()).filter(|&index| fold(index) == held) {
                self.block_errors(&solution, index, &mut errors);
            }
        }
        Some(errors)
    }

    fn block_errors(&self, solution: &Solution, index: usize, errors: &mut [(Channel, Vec<f64>)]) {
        let flight = self.blocks[index].flight;
        let own = solution.by_flight.iter().find(|entry| entry.0 == flight).map(|entry| entry.1.as_slice());
        let locals: Vec<usize> = (0..self.members.len()).filter(|&member| self.is_local(member)).collect();
        let value = |free: usize| {
            let member = self.place(free);
            match locals.iter().position(|&local| local == member) {
                Some(position) => own.and_then(|own| own.get(position)).copied().unwrap_or_default(),
                None => solution.values[member],
            }
        };
        for ((_, _, reduced), (_, errors)) in self.channels.iter().zip(errors) {
            errors[index] = reduced.error(index, &value);
        }
    }
}

/// What a flight adds to the normal equations of the common coefficients, and what its own are made of.
struct Eliminated {
    matrix: DMatrix<f64>,
    side: DVector<f64>,
    to_global: DMatrix<f64>,
    to_side: DVector<f64>,
}

/// Makes the rows of local coefficients in the common system those of numbers fixed at zero.
fn pin(local: &[usize], matrix: &mut DMatrix<f64>, side: &mut DVector<f64>) {
    for &member in local {
        matrix.row_mut(member).fill(0.0);
        matrix.column_mut(member).fill(0.0);
        matrix[(member, member)] = 1.0;
        side[member] = 0.0;
    }
}

/// Smallest diagonal element of the Cholesky factor of a correlation matrix.
const SMALLEST_PIVOT: f64 = 1e-4;

#[cfg(test)]
mod tests {
    use super::super::design::Design;
    use super::super::engine::Engine;
    use super::super::gram::tests::{model, near, noise, whole};
    use super::super::gram::{blocks, grams};
    use super::*;
    use crate::error::Result;
    use crate::physics::{Effect, calibrate};
    use proptest::prelude::*;

    fn squared(flights: &[crate::flight::Flight], model: &crate::physics::Model, block: &Block) -> Result<PerChannel<f64>> {
        let flight = &flights[block.flight];
        let predicted = model.predict(flight)?;
        Ok(PerChannel::from_fn(|channel| {
            let measured = &flight.column(channel.column())[block.start..block.end];
            measured.iter().zip(&predicted[channel][block.start..block.end]).map(|(y, f)| (y - f).powi(2)).sum()
        }))
    }

    /// With a shared coefficient over two channels, if wanted.
    fn compare(seed: u64, lengths: &[usize], shared: bool) -> Result<bool> {
        let flights = noise(seed, lengths);
        let mut model = model();
        if shared {
            let mut effect = Effect::formula("shared", Channel::VxDot, "vy * wz", 0.0)?;
            effect.terms.push(crate::physics::Term { channel: Channel::VyDot, ..effect.terms[0].clone() });
            model.effects.push(effect);
        }
        let cut = blocks(&flights, &whole(&flights), 2.0);
        let fold: Vec<usize> = (0..cut.len()).map(|block| block % 5).collect();
        let engine = Engine { flights: &flights, blocks: cut, fold, correlation: 100.0, held: Vec::new() };
        let found = engine.pass(&model, &[])?.base;
        if !shared {
            let (calibrated, _) = calibrate(&model, &flights, &whole(&flights))?;
            let values = |model: &crate::physics::Model| -> Vec<f64> {
                model.effects.iter().flat_map(|effect| &effect.coefficients).map(|coefficient| coefficient.value).collect()
            };
            if !near(&values(&found.model), &values(&calibrated)) {
                return Ok(false);
            }
        }
        // Each block of a fold under what the other folds say.
        for held in 0..5 {
            let mut design = Design::default();
            let layout = design.model(&model)?;
            let all = grams(&flights, &engine.blocks, &design)?;
            let mut fitted = model.clone();
            for (channels, members) in components(&layout) {
                let reduced: Vec<Reduced> = channels.iter().map(|&channel| Reduced::new(&layout, channel, &all)).collect();
                let priors = vec![Prior::FREE; layout.free.len()];
                let weights = if shared { engine.weights(&engine.pass(&model, &[])?.base) } else { PerChannel::splat(1.0) };
                let component = engine.component(&channels, &members, &reduced, &weights, &priors);
                let weight = |block: usize| if engine.fold[block] == held { 0.0 } else { 1.0 };
                let Some(solution) = component.solve(&weight) else { return Ok(false) };
                for (&member, value) in members.iter().zip(&solution.values) {
                    let free = layout.free[member];
                    fitted.effects[free.effect].coefficients[free.coefficient].value = *value;
                }
                let Some(errors) = component.held_out(5, &|block| engine.fold[block]) else { return Ok(false) };
                for (index, block) in engine.blocks.iter().enumerate().filter(|(index, _)| engine.fold[*index] == held) {
                    let direct = squared(&flights, &fitted, block)?;
                    if !errors.iter().all(|(channel, errors)| near(&[errors[index]], &[direct[*channel]])) {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]
        #[test]
        fn gram_fit_is_calibration_and_held_out_errors_are_those_of_predicting(seed: u64, lengths in prop::collection::vec(700usize..1500, 2..4), shared: bool) {
            let agrees = compare(seed, &lengths, shared).map_err(|error| TestCaseError::fail(error.to_string()))?;
            prop_assert!(agrees);
        }

        #[test]
        fn bounds_hold_and_the_rest_is_fitted_to_them(
            entries in prop::collection::vec(-1.0..1.0_f64, 40), side in prop::collection::vec(-3.0..3.0_f64, 4),
            low in -0.5..0.0_f64, high in 0.0..0.5_f64,
        ) {
            let x = DMatrix::from_row_slice(10, 4, &entries);
            let matrix = x.transpose() * &x + DMatrix::identity(4, 4) * 0.1;
            let side = DVector::from_column_slice(&side);
            let priors = vec![Prior::FREE, Prior { bounds: [low, high], by_flight: None }, Prior { bounds: [0.0, 9.0], by_flight: None }, Prior::FREE];
            let component = Component { channels: Vec::new(), members: (0..4).collect(), priors, blocks: &[], correlation: 1.0 };
            let Some((values, bound)) = component.bounded(&matrix, &side) else { return Err(TestCaseError::fail("singular")) };
            for ((value, prior), bound) in values.iter().zip(&component.priors).zip(&bound) {
                prop_assert!((prior.bounds[0]..=prior.bounds[1]).contains(value), "{values:?}");
                prop_assert!(!bound || prior.bounds.contains(value), "{values:?}");
            }
            let gradient = &matrix * DVector::from_column_slice(&values) - &side;
            let open: Vec<f64> = (0..4).filter(|&member| !bound[member]).map(|member| gradient[member]).collect();
            prop_assert!(near(&open, &vec![0.0; open.len()]), "{open:?}");
        }
    }

    /// With and without numbers of each flight.
    #[test]
    fn what_is_found_without_a_flight_is_what_the_others_give() -> Result<()> {
        let flights = noise(31, &[900, 1100, 800]);
        let cut = blocks(&flights, &whole(&flights), 2.0);
        let plain = model();
        let bias = crate::physics::catalogue::definition("sensor_bias").expect("in the catalogue").effect(4.58, 0.8);
        for model in [plain.clone(), super::super::candidate::with(&plain, &bias)] {
            let mut design = Design::default();
            let layout = design.model(&model)?;
            let all = grams(&flights, &cut, &design)?;
            let fold = vec![0; cut.len()];
            let engine = Engine { flights: &flights, blocks: cut.clone(), fold, correlation: 100.0, held: Vec::new() };
            let priors = super::super::engine::priors(&model, &layout, &[]);
            for (channels, members) in components(&layout) {
                let reduced: Vec<Reduced> = channels.iter().map(|&channel| Reduced::new(&layout, channel, &all)).collect();
                let component = engine.component(&channels, &members, &reduced, &PerChannel::splat(1.0), &priors);
                let found = component.without_each_flight();
                assert_eq!(found.iter().map(|entry| entry.0).collect::<Vec<_>>(), [0, 1, 2]);
                for (flight, values) in found {
                    let others = component.solve(&|block| f64::from(u8::from(cut[block].flight != flight)));
                    let (values, others) = (values.expect("determined"), others.expect("determined").values);
                    assert!(near(&values, &others), "{values:?} {others:?}");
                }
            }
        }
        Ok(())
    }

    #[test]
    fn a_coefficient_that_no_row_moves_is_not_determined() {
        let component =
            Component { channels: Vec::new(), members: vec![0, 1], priors: vec![Prior::FREE; 2], blocks: &[], correlation: 1.0 };
        let side = DVector::from_element(2, 1.0);
        assert!(component.bounded(&DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]), &side).is_none());
        assert!(component.bounded(&DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]), &side).is_none());
    }
}
