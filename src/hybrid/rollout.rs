//! A hybrid integrated forward: the model's accelerations, and what linear history and network add to them, worked out once a step where the
//! step begins and held over it. The history behind a rollout is measured up to its start and predicted from there on. How a model is
//! integrated is in `physics::rollout`.

use super::linear::{Linear, Signals};
use super::sequence::{Sequence, sequences};
use super::{Hybrid, inputs};
use crate::error::Result;
use crate::flight::{Flight, PerChannel, Window};
use crate::physics::Rollout;
use crate::physics::rollout::{Addition, Each, Further, Program};
use crate::tape::{Session, Threads};

/// Lanes of a batch: their histories stay small, and a session's set-up is little beside them.
const LANES: usize = 64;

/// A hybrid to be integrated forward along some flights.
pub struct HybridRollout<'a> {
    hybrid: &'a Hybrid,
    rollout: Rollout<'a>,
    /// The network's inputs, then those of the linear history.
    program: Program,
    sequences: Vec<Sequence>,
    /// By flight, where there is a linear history.
    signals: Vec<Signals>,
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
        let linear = description.linear.as_ref().map(|linear| linear.config());
        let mut formulas = inputs::parse(&description.inputs)?;
        formulas.extend(inputs::parse(linear.map_or(&[], |linear| &linear.inputs))?);
        let signals = linear.map(|linear| flights.iter().map(|flight| Signals::new(flight, linear)).collect::<Result<_>>());
        Ok(Self {
            hybrid,
            rollout,
            program: Program::of_formulas(&formulas)?,
            sequences: sequences(flights, description)?,
            signals: signals.transpose()?.unwrap_or_default(),
        })
    }

    /// As [`Rollout::roll`]. The networks of batches work side by side.
    ///
    /// # Errors
    /// As [`Rollout::roll`]; [`crate::Error::Config`] for a start without a full history.
    pub fn roll<T: Send>(&self, starts: &[Window], each: Each<'_, T>) -> Result<Vec<T>> {
        self.hybrid.check_windows(self.rollout.flights(), starts)?;
        let addition =
            |flight: usize, samples: &[usize]| Ok(Box::new(Added::new(self, flight, samples)?) as Box<dyn Addition + '_>);
        let further = Further { program: &self.program, lanes: LANES, addition: &addition };
        self.rollout.roll_with(starts, None, Some(&further), each)
    }
}

/// The histories of some lanes, with room for all that is predicted, and the network that reads them.
struct Added<'a> {
    hybrid: &'a Hybrid,
    linear: Option<&'a Linear>,
    session: Session<f32>,
    history: usize,
    /// By lane: scaled rows, the last of the first `history` being that of the start.
    state: Vec<Vec<f32>>,
    physics: Vec<Vec<f32>>,
    /// By lane: rows of the linear history's inputs, the last of the first `lags` being that of the start.
    signals: Vec<Vec<f64>>,
}

impl<'a> Added<'a> {
    fn new(of: &'a HybridRollout<'_>, flight: usize, samples: &[usize]) -> Result<Self> {
        let description = of.hybrid.description();
        let (history, channels) = (description.config.history(), description.inputs.len());
        let mut session = Session::infer(of.hybrid.network.graph(), &[of.hybrid.network.output()], Threads(1))?;
        session.load(&of.hybrid.parameters)?;
        let rows = history + of.rollout.horizon();
        let measured = |&sample: &usize| {
            let (mut state, mut physics) = (vec![0.0; rows * channels], vec![0.0; rows * 6]);
            of.sequences[flight].history(sample, &mut state[..history * channels], &mut physics[..history * 6]);
            (state, physics)
        };
        let (state, physics) = samples.iter().map(measured).unzip();
        let linear = description.linear.as_ref();
        let signals = |linear: &Linear| {
            let (lags, signals) = (linear.config().lags, &of.signals[flight]);
            let before = |sample: usize| (0..lags).rev().flat_map(move |lag| signals.row(sample, lag).iter().copied());
            samples.iter().map(|&sample| before(sample).collect()).collect()
        };
        Ok(Self { hybrid: of.hybrid, linear, session, history, state, physics, signals: linear.map(signals).unwrap_or_default() })
    }

    /// What the linear history says, six numbers a lane; its inputs come after the network's.
    fn filtered(&mut self, step: usize, inputs: &[Vec<f64>]) -> Option<Vec<PerChannel<f64>>> {
        let linear = self.linear?;
        let (count, lags) = (inputs.len(), linear.config().lags);
        let mut features = vec![0.0; linear.config().features()];
        let one = |(lane, rows): (usize, &mut Vec<f64>)| {
            // The row of the start is there already, as it was measured.
            rows.truncate((lags - 1 + step) * count);
            rows.extend(inputs.iter().map(|input| input[lane]));
            let last = lags - 1 + step;
            linear.predict(|lag| &rows[(last - lag) * count..][..count], &mut features)
        };
        Some(self.signals.iter_mut().enumerate().map(one).collect())
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
        let channels = description.inputs.len();
        let of_linear = self.linear.map_or(0, |linear| linear.config().inputs.len());
        let inputs: Vec<Vec<f64>> = (0..channels + of_linear).map(inputs).collect();
        let filtered = self.filtered(step, &inputs[channels..]);
        let row = self.history - 1 + step;
        for (lane, (state, of_physics)) in self.state.iter_mut().zip(&mut self.physics).enumerate() {
            for (channel, scale) in description.scaling.state.iter().enumerate() {
                state[row * channels + channel] = scale.apply(inputs[channel][lane]) as f32;
            }
            for (channel, scale) in description.scaling.physics.pairs() {
                let linear = filtered.as_ref().map_or(0.0, |filtered| filtered[lane][channel]);
                of_physics[row * 6 + channel.index()] = scale.apply(physics[channel][lane] + linear) as f32;
                held[channel][lane] = linear;
            }
        }
        let first = row + 1 - self.history;
        let (state, of_physics) = (&self.state, &self.physics);
        let fill = |lane: usize, slabs: &mut [&mut [f32]]| {
            if let [state_slab, physics_slab, ..] = slabs {
                state_slab.copy_from_slice(&state[lane][first * channels..(row + 1) * channels]);
                physics_slab.copy_from_slice(&of_physics[lane][first * 6..(row + 1) * 6]);
            }
        };
        let (hybrid, replaces) = (self.hybrid, self.replaces());
        self.session.predict(state.len(), &fill, &mut |lane, output| {
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
