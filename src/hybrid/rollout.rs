//! A hybrid integrated forward: the model's accelerations, and what linear history and network add to them, worked out once a step where the
//! step begins and held over it. The history behind a rollout is measured up to its start and predicted from there on. How a model is
//! integrated is in `physics::rollout`.

use super::Hybrid;
use super::histories::{Histories, Read};
use super::sequence::{Sequence, sequences};
use crate::error::Result;
use crate::flight::{Flight, PerChannel, Window};
use crate::physics::Rollout;
use crate::physics::rollout::{Addition, Each, Further};
use crate::tape::{Session, Threads};

/// Lanes of a batch: their histories stay small, and a session's set-up is little beside them.
const LANES: usize = 64;

/// A hybrid to be integrated forward along some flights.
pub struct HybridRollout<'a> {
    hybrid: &'a Hybrid,
    rollout: Rollout<'a>,
    read: Read,
    sequences: Vec<Sequence>,
}

impl<'a> HybridRollout<'a> {
    /// Makes ready to roll a hybrid out over `horizon` steps.
    ///
    /// # Errors
    /// As [`Rollout::new`] and [`Hybrid::predict`].
    pub fn new(hybrid: &'a Hybrid, flights: &'a [Flight], horizon: usize) -> Result<Self> {
        let description = hybrid.description();
        flights.iter().try_for_each(|flight| description.check_step(flight))?;
        let rollout = Rollout::new(&description.model, flights, horizon)?;
        Ok(Self { hybrid, rollout, read: Read::new(description, flights)?, sequences: sequences(flights, description)? })
    }

    /// As [`Rollout::roll`]. The networks of batches work side by side.
    ///
    /// # Errors
    /// As [`Rollout::roll`]; [`crate::Error::Config`] for a start without a full history.
    pub fn roll<T: Send>(&self, starts: &[Window], each: Each<'_, T>) -> Result<Vec<T>> {
        self.hybrid.check_windows(self.rollout.flights(), starts)?;
        let addition =
            |flight: usize, samples: &[usize]| Ok(Box::new(Added::new(self, flight, samples)?) as Box<dyn Addition + '_>);
        let further = Further { program: &self.read.program, lanes: LANES, addition: &addition };
        self.rollout.roll_with(starts, None, Some(&further), each)
    }
}

/// The histories of some lanes, and the network that reads them.
struct Added<'a> {
    hybrid: &'a Hybrid,
    session: Session<f32>,
    histories: Histories<'a, f32>,
}

impl<'a> Added<'a> {
    fn new(of: &'a HybridRollout<'_>, flight: usize, samples: &[usize]) -> Result<Self> {
        let mut session = Session::infer(of.hybrid.network.graph(), &[of.hybrid.network.output()], Threads(1))?;
        session.load(&of.hybrid.parameters)?;
        let (sequence, signals) = (&of.sequences[flight], of.read.signals.get(flight));
        let histories = Histories::new(of.hybrid.description(), sequence, signals, samples, of.rollout.horizon());
        Ok(Self { hybrid: of.hybrid, session, histories })
    }
}

impl Addition for Added<'_> {
    fn held(
        &mut self,
        step: usize,
        physics: PerChannel<&[f64]>,
        inputs: &dyn Fn(usize) -> Vec<f64>,
        held: &mut PerChannel<Vec<f64>>,
    ) -> Result<()> {
        let description = self.hybrid.description();
        let of_linear = description.linear.as_ref().map_or(0, |linear| linear.config().inputs.len());
        let inputs: Vec<Vec<f64>> = (0..description.inputs.len() + of_linear).map(inputs).collect();
        for (lane, says) in self.histories.take(step, physics, &inputs).into_iter().enumerate() {
            held.iter_mut().zip(says).for_each(|(held, says)| held[lane] = says);
        }
        let Self { hybrid, session, histories } = self;
        let replaces = !description.config.predicts_residual();
        let fill = |lane: usize, slabs: &mut [&mut [f32]]| histories.fill(lane, step, slabs);
        session.predict(histories.lanes(), &fill, &mut |lane, output| {
            for (held, learned) in held.iter_mut().zip(hybrid.learned(output)) {
                held[lane] = if replaces { learned } else { held[lane] + learned };
            }
        })?;
        Ok(())
    }

    fn replaces(&self) -> bool {
        !self.hybrid.description().config.predicts_residual()
    }
}
