//! Some rollouts of a hybrid in training, forward and back: states and what was added are kept, and the derivatives of the cost by the weights
//! are gathered step by step, the last one first. Which rollouts, and how much they count, is `rollout_loss`'s.

use super::rollout_loss::Ground;
use crate::error::Result;
use crate::flight::{Channel, PerChannel};
use crate::hybrid::histories::{Histories, HistorySlopes};
use crate::physics::rollout::{Measure, Motion, NUMBERS, State, Walk, state_slopes};
use crate::tape::Session;
use phyture_kernels::Real;

/// Rollouts that start on one flight.
struct Group<'g, T> {
    /// Indices of the starts.
    starts: Vec<usize>,
    walk: Walk<'g>,
    histories: Histories<'g, T>,
    /// Where the lanes are, by step.
    motions: Vec<Motion>,
    /// What is added, by step.
    held: Vec<PerChannel<Vec<f64>>>,
    /// Whether a lane has been stopped, by step.
    stopped: Vec<Vec<bool>>,
}

impl<T: Real> Group<'_, T> {
    fn lanes(&self) -> usize {
        self.starts.len()
    }

    /// What costs at a step, by its index among the judged ones, of a lane that is at some state.
    fn cost_at(&self, measure: &Measure, lane: usize, judged: usize, state: &State) -> f64 {
        measure.cost_at(self.starts[lane], judged, self.motions[0].state(lane).position, state)
    }
}

/// Rollouts on their way.
pub(super) struct Flown<'g, 'a, T> {
    ground: &'g Ground<'a>,
    groups: Vec<Group<'g, T>>,
    /// Group and lane in it of each rollout.
    places: Vec<(usize, usize)>,
    replaces: bool,
}

impl<'g, 'a, T: Real> Flown<'g, 'a, T> {
    /// Some starts, by their indices, in order.
    pub fn new(ground: &'g Ground<'a>, chosen: &[usize]) -> Result<Self> {
        let of = |index: usize| ground.starts()[index];
        let replaces = !ground.description.config.predicts_residual();
        let horizon = ground.rule.config.horizon;
        let group = |indices: &[usize]| {
            let flight = of(indices[0]).flight;
            let samples: Vec<usize> = indices.iter().map(|&index| of(index).last).collect();
            let (sequence, signals) = (&ground.sequences[flight], ground.signals.get(flight));
            let histories = Histories::new(ground.description, sequence, signals, &samples, horizon);
            let walk = ground.rollout.walk(flight, &ground.on[&flight], samples, replaces)?;
            let motions = vec![walk.motion().clone()];
            let stopped = vec![vec![false; walk.lanes()]];
            Ok(Group { starts: indices.to_vec(), walk, histories, motions, held: Vec::new(), stopped })
        };
        let by_flight = chosen.chunk_by(|left, right| of(*left).flight == of(*right).flight);
        let groups: Vec<Group<'g, T>> = by_flight.map(group).collect::<Result<_>>()?;
        let lanes = |(index, group): (usize, &Group<'g, T>)| (0..group.lanes()).map(move |lane| (index, lane)).collect::<Vec<_>>();
        let places = groups.iter().enumerate().flat_map(lanes).collect();
        Ok(Self { ground, groups, places, replaces })
    }

    /// Integrates forward.
    pub fn forward(&mut self, says: &mut Session<T>) -> Result<()> {
        let Self { ground, groups, places, replaces } = self;
        for step in 0..ground.rule.config.horizon {
            each(groups, &|group| {
                let seen = group.walk.observe(step);
                let physics = PerChannel::from_fn(|channel| seen.physics[channel].as_slice());
                let linear = group.histories.take(step, physics, &seen.inputs);
                let added = |channel: Channel| linear.iter().map(|says| if *replaces { 0.0 } else { says[channel] }).collect();
                group.held.push(PerChannel::from_fn(added));
            });
            let mut learned = Vec::with_capacity(places.len());
            let fill = |at: usize, slabs: &mut [&mut [T]]| {
                let (group, lane) = places[at];
                groups[group].histories.fill(lane, step, slabs);
            };
            says.predict(places.len(), &fill, &mut |_, output| learned.push(last_row(output)))?;
            for (&(group, lane), learned) in places.iter().zip(learned) {
                groups[group].held[step].iter_mut().zip(learned).for_each(|(held, learned)| held[lane] += learned);
            }
            each(groups, &|group| {
                let mut stopped = group.stopped[step].clone();
                group.walk.advance(&group.held[step], &mut stopped);
                group.motions.push(group.walk.motion().clone());
                group.stopped.push(stopped);
            });
        }
        Ok(())
    }

    /// The part that these rollouts have in the cost of all.
    pub fn cost(&self) -> f64 {
        let measure = &self.ground.measure;
        let of_lane = |&(group, lane): &(usize, usize)| {
            let group = &self.groups[group];
            let at = |(judged, step): (usize, &usize)| group.cost_at(measure, lane, judged, &group.motions[*step].state(lane));
            measure.steps().iter().enumerate().map(at).sum::<f64>()
        };
        self.places.iter().map(of_lane).sum()
    }

    /// Adds the derivatives of `share` times the cost by the weights.
    pub fn backward(&mut self, pulls: &mut Session<T>, parameters: &[T], share: f64, gradient: &mut [T]) -> Result<()> {
        let Self { ground, groups, places, replaces } = self;
        let horizon = ground.rule.config.horizon;
        // By rollout: derivatives by the state after the step, and by the rows of its history.
        let mut after = vec![[0.0; NUMBERS]; places.len()];
        let mut rows: Vec<HistorySlopes> = places.iter().map(|&(group, _)| groups[group].histories.no_slopes(horizon)).collect();
        for step in (0..horizon).rev() {
            if let Ok(judged) = ground.measure.steps().binary_search(&(step + 1)) {
                for (&(group, lane), after) in places.iter().zip(&mut after) {
                    let group = &groups[group];
                    let own =
                        state_slopes(&group.motions[step + 1], lane, &|state| group.cost_at(&ground.measure, lane, judged, state));
                    after.iter_mut().zip(own).for_each(|(after, own)| *after += share * own);
                }
            }
            let slopes = each(groups, &|group| group.walk.slopes(step, &group.motions[step], &group.held[step]));
            // A lane that was stopped stays where it was, whatever is added.
            let stopped = |group: usize, lane: usize| groups[group].stopped[step + 1][lane];
            let by_added: Vec<PerChannel<f64>> = places
                .iter()
                .zip(&after)
                .map(|(&(group, lane), after)| match stopped(group, lane) {
                    true => PerChannel::splat(0.0),
                    false => slopes[group].to_added(lane, after),
                })
                .collect();
            let fill = |at: usize, slabs: &mut [&mut [T]]| {
                let (group, lane) = places[at];
                if let [inputs @ .., by] = slabs {
                    groups[group].histories.fill(lane, step, inputs);
                    by.fill(T::ZERO);
                    let last = by.len() - Channel::COUNT;
                    by[last..].iter_mut().zip(by_added[at].iter()).for_each(|(to, by)| *to = T::of(*by));
                }
            };
            pulls.step(parameters, places.len(), None, &fill)?;
            // The session's gradients are those of the mean.
            let count = T::of(places.len() as f64);
            gradient.iter_mut().zip(pulls.gradients()).for_each(|(sum, own)| *sum += count * *own);
            for (at, (&(group, lane), after)) in places.iter().zip(&mut after).enumerate() {
                let read = [pulls.input_gradient(0, at)?, pulls.input_gradient(1, at)?];
                let histories = &groups[group].histories;
                histories.pull_network(step, read, places.len() as f64, &mut rows[at]);
                let says = if *replaces { PerChannel::splat(0.0) } else { by_added[at] };
                let (physics, inputs) = histories.pull(step, says, &mut rows[at]);
                let next = std::mem::replace(after, [0.0; NUMBERS]);
                let through = if stopped(group, lane) { &[0.0; NUMBERS] } else { &next };
                *after = slopes[group].to_state(lane, through, &physics, &inputs);
                if stopped(group, lane) {
                    after.iter_mut().zip(next).for_each(|(after, next)| *after += next);
                }
            }
        }
        Ok(())
    }
}

/// The last row of what a network says.
fn last_row<T: Real>(output: &[T]) -> PerChannel<f64> {
    let last = &output[output.len() - Channel::COUNT..];
    PerChannel::from_fn(|channel| last[channel.index()].f64())
}

/// Something of each group, in order, on the threads there are.
fn each<G: Send, R: Send>(groups: &mut [G], of: &(dyn Fn(&mut G) -> R + Sync)) -> Vec<R> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        groups.par_iter_mut().with_max_len(1).map(of).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        groups.iter_mut().map(of).collect()
    }
}
