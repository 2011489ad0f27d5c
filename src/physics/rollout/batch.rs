//! The integration of one batch of lanes: Runge and Kutta's method of order four at the log's step, accelerations of formulas and, held over
//! a step, of whoever adds some.

use super::motion::{Motion, Seen, State};
use super::program::{LaneProgram, When};
use crate::error::Result;
use crate::flight::{Channel, Flight, PerChannel};

/// Largest size of the body rates before a lane is stopped, rad/s: above what gyroscopes of small aircraft measure (2000 °/s is 35 rad/s).
pub const MOST_RATE_RAD_S: f64 = 100.0;

/// Largest speed before a lane is stopped, m/s.
pub const MOST_SPEED_M_S: f64 = 200.0;

/// What is added to a model's accelerations: worked out where a step begins and held over it.
pub(crate) trait Addition: Send + Sync {
    /// Fills `held`, one column an acceleration (m/s², rad/s²), one entry a lane, for the step that begins `step` samples after the starts;
    /// `physics` are the model's own accelerations there, `inputs` the values of the further formulas.
    fn held(
        &mut self,
        step: usize,
        physics: PerChannel<&[f64]>,
        inputs: &dyn Fn(usize) -> Vec<f64>,
        held: &mut PerChannel<Vec<f64>>,
    ) -> Result<()>;

    /// Whether it stands for the accelerations, not beside them.
    fn replaces(&self) -> bool;
}

/// The lanes of a batch on their way.
pub(super) struct Batch<'a> {
    pub flight: &'a Flight,
    pub starts: Vec<usize>,
    pub model: LaneProgram<'a>,
    /// Formulas that an addition reads.
    pub further: Option<LaneProgram<'a>>,
    pub addition: Option<Box<dyn Addition + 'a>>,
    /// Whether what is added stands for the accelerations, not beside them; none where nothing is.
    pub replaces: Option<bool>,
    pub angles: bool,
    pub hold_rates: bool,
}

/// Where the lanes of a batch went.
#[derive(Clone, Debug)]
pub struct Rolled {
    /// Index of the flight.
    pub flight: usize,
    /// The sample at which each lane starts.
    pub starts: Vec<usize>,
    /// The first step at which a lane would have been out of bounds, if it ever was: it stays where it was before.
    pub stopped: Vec<Option<usize>>,
    steps: Vec<Motion>,
}

impl Rolled {
    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.starts.len()
    }

    /// Where a lane is so many steps after its start.
    pub fn state(&self, lane: usize, step: usize) -> State {
        self.steps[step].state(lane)
    }
}

impl Batch<'_> {
    /// Rolls all lanes over so many steps.
    pub fn run(mut self, flight: usize, horizon: usize) -> Result<Rolled> {
        let lanes = self.starts.len();
        let mut motion = Motion::recorded(self.flight, &self.starts);
        let mut seen = Seen::new(lanes, self.angles);
        let mut held: PerChannel<Vec<f64>> = PerChannel::from_fn(|_| vec![0.0; lanes]);
        let mut stopped = vec![None; lanes];
        let mut steps = Vec::with_capacity(horizon + 1);
        steps.push(motion.clone());
        let (mut work, mut next) = ([motion.clone(), motion.clone()], motion.clone());
        for step in 0..horizon {
            self.look(step, &motion, &mut seen);
            self.hold_addition(step, &motion, &seen, &mut held)?;
            self.integrate(&motion, &held, &mut seen, &mut work, &mut next);
            for (lane, stopped) in stopped.iter_mut().enumerate() {
                if stopped.is_some() || !next.is_bounded(lane, MOST_SPEED_M_S, MOST_RATE_RAD_S) {
                    stopped.get_or_insert(step + 1);
                    next.keep(lane, &motion);
                }
            }
            std::mem::swap(&mut motion, &mut next);
            steps.push(motion.clone());
        }
        Ok(Rolled { flight, starts: self.starts, stopped, steps })
    }

    /// Evaluates the model where a step begins.
    pub fn look(&mut self, step: usize, motion: &Motion, seen: &mut Seen) {
        self.model.hold(&self.starts, step);
        seen.look(motion);
        self.model.evaluate(When::Sample, motion, seen);
    }

    /// Where a step leads that begins at a motion on which the model has just been evaluated.
    pub fn integrate(
        &mut self,
        motion: &Motion,
        held: &PerChannel<Vec<f64>>,
        seen: &mut Seen,
        [slope, stage]: &mut [Motion; 2],
        next: &mut Motion,
    ) {
        let step_s = self.flight.step_s;
        self.slope(motion, seen, held, slope);
        next.set(motion, step_s / 6.0, slope);
        for (part, weight) in [(0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
            stage.set(motion, part * step_s, slope);
            seen.look(stage);
            self.model.evaluate(When::Ahead(part), stage, seen);
            self.slope(stage, seen, held, slope);
            next.add(weight * step_s / 6.0, slope);
        }
        next.renormalise();
    }

    /// What is added over the step that begins here.
    fn hold_addition(&mut self, step: usize, motion: &Motion, seen: &Seen, held: &mut PerChannel<Vec<f64>>) -> Result<()> {
        let (Some(addition), Some(further)) = (&mut self.addition, &mut self.further) else { return Ok(()) };
        further.hold(&self.starts, step);
        further.evaluate(When::Sample, motion, seen);
        let (lanes, model) = (self.starts.len(), &self.model);
        let physics = PerChannel::from_fn(|channel| &model.root(channel.index())[..lanes]);
        addition.held(step, physics, &|index| further.root(index)[..lanes].to_vec(), held)
    }

    /// The derivative of a motion on which the model has been evaluated.
    fn slope(&self, motion: &Motion, seen: &Seen, held: &PerChannel<Vec<f64>>, slope: &mut Motion) {
        motion.kinematics(seen, slope);
        for (channel, to) in Channel::ALL.into_iter().zip(slope.accelerations_mut()) {
            if self.hold_rates && channel.is_angular() {
                to.fill(0.0);
                continue;
            }
            let (own, held) = (self.model.root(channel.index()), &held[channel]);
            match self.replaces {
                None => to.copy_from_slice(&own[..held.len()]),
                Some(true) => to.copy_from_slice(held),
                Some(false) => to.iter_mut().zip(own).zip(held).for_each(|((to, own), held)| *to = own + held),
            }
        }
    }
}
