//! Lanes of one flight that go a step at a time, with whatever is added over a step given from outside, and the derivatives of a step: by
//! the state where it begins and by what is added. Central differences of the integration itself, in f64, so that they hold for every formula.
//! What remembers a state has derivatives over many steps, which are not here ([`OnFlight::remembers`]). What the derivatives are for, nothing here
//! knows.

use super::Rollout;
use super::batch::{Batch, MOST_RATE_RAD_S, MOST_SPEED_M_S};
use super::motion::{Motion, NUMBERS, Seen};
use super::program::{Prepared, When, check_lanes};
use crate::error::Result;
use crate::flight::{Channel, PerChannel};

/// Half the width of the central differences, in m, m/s, rad/s, parts of a unit quaternion, m/s² and rad/s²: truncation and rounding are both
/// near 1e-10 of numbers of order one.
const HALF_STEP: f64 = 1e-5;

/// Directions that a step has derivatives along: the numbers of the state, and what is added to each acceleration.
const DIRECTIONS: usize = NUMBERS + Channel::COUNT;

/// A model, and formulas beside it, on one flight, for any starts there.
pub(crate) struct OnFlight {
    model: Prepared,
    further: Prepared,
}

impl OnFlight {
    /// Whether the model, and whether the formulas beside it, remember states, so that a step alone does not have their derivatives.
    pub fn remembers(&self) -> [bool; 2] {
        [self.model.remembers(), self.further.remembers()]
    }
}

impl<'a> Rollout<'a> {
    /// Makes ready for walks on a flight, by its index, with the model's own numbers; `further` are formulas beside the model's.
    ///
    /// # Errors
    /// As [`Rollout::roll`].
    pub(crate) fn on_flight(&self, index: usize, further: &super::Program) -> Result<OnFlight> {
        let flight = &self.flights[index];
        let place = |symbol| self.program.numbers.iter().position(|(_, own)| *own == symbol);
        let model = self.program.on(flight, flight.len(), &[], &|symbol| Some(self.own(place(symbol)?, index)))?;
        let further = further.on(flight, flight.len(), &[], &|_| None)?;
        Ok(OnFlight { model, further })
    }

    /// Lanes that start at some samples of a flight, in order. `replaces` says whether what is added stands for the accelerations.
    ///
    /// # Errors
    /// [`Error::Shape`] for more lanes than a machine takes.
    pub(crate) fn walk<'w>(&'w self, index: usize, on: &'w OnFlight, samples: Vec<usize>, replaces: bool) -> Result<Walk<'w>> {
        let flight = &self.flights[index];
        let most = on.model.block().min(on.further.block());
        check_lanes(&on.model, samples.len())?;
        check_lanes(&on.further, samples.len())?;
        let lanes = samples.len();
        let copies = (most / lanes.max(1)).clamp(1, 2 * DIRECTIONS);
        let batch = |starts: Vec<usize>| -> Result<Batch<'w>> {
            Ok(Batch {
                flight,
                model: on.model.lanes(flight, 0, &starts)?,
                further: Some(on.further.lanes(flight, 0, &starts)?),
                addition: None,
                replaces: Some(replaces),
                starts,
                angles: true,
                hold_rates: false,
            })
        };
        let motion = Motion::recorded(flight, &samples);
        Ok(Walk {
            narrow: At { batch: batch(samples.clone())?, seen: Seen::new(lanes, true), work: [motion.clone(), motion.clone()] },
            wide: At {
                batch: batch(samples.repeat(copies))?,
                seen: Seen::new(lanes * copies, true),
                work: [motion.repeated(copies), motion.repeated(copies)],
            },
            motion,
            copies,
        })
    }
}

/// Lanes, and room to integrate them.
struct At<'a> {
    batch: Batch<'a>,
    seen: Seen,
    work: [Motion; 2],
}

/// What is seen where a step begins, by lane.
#[derive(Clone, Debug)]
pub(crate) struct Observed {
    /// The model's own accelerations.
    pub physics: PerChannel<Vec<f64>>,
    /// The formulas beside the model's.
    pub inputs: Vec<Vec<f64>>,
}

impl At<'_> {
    fn observe(&mut self, step: usize, motion: &Motion) -> Observed {
        self.batch.look(step, motion, &mut self.seen);
        let lanes = motion.lanes();
        let Batch { starts, model, further, .. } = &mut self.batch;
        let further = further.as_mut().expect("a walk has formulas beside the model's");
        further.hold(starts, step);
        further.evaluate(When::Sample, motion, &self.seen);
        Observed {
            physics: PerChannel::from_fn(|channel| model.root(channel.index())[..lanes].to_vec()),
            inputs: (0..further.roots()).map(|root| further.root(root)[..lanes].to_vec()).collect(),
        }
    }

    fn advance(&mut self, motion: &Motion, held: &PerChannel<Vec<f64>>) -> Motion {
        let mut next = motion.clone();
        self.batch.integrate(motion, held, &mut self.seen, &mut self.work, &mut next);
        next
    }
}

/// Lanes on their way.
pub(crate) struct Walk<'a> {
    narrow: At<'a>,
    /// Copies of all lanes, for the derivatives.
    wide: At<'a>,
    copies: usize,
    /// Where the lanes are.
    motion: Motion,
}

/// Derivatives of a step, by lane.
pub(crate) struct Slopes {
    /// Of the state after the step, by direction, then by number of it.
    next: Vec<[Vec<f64>; NUMBERS]>,
    /// Of what is seen where the step begins, by number of the state.
    seen: Vec<Observed>,
}

impl Walk<'_> {
    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.motion.lanes()
    }

    /// Where the lanes are.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// What is seen there, so many steps after the starts.
    pub fn observe(&mut self, step: usize) -> Observed {
        self.narrow.observe(step, &self.motion)
    }

    /// Goes a step on from where it has just observed, but with a lane that would be out of bounds, or has `stopped` before; these stay, and are
    /// noted.
    pub fn advance(&mut self, held: &PerChannel<Vec<f64>>, stopped: &mut [bool]) {
        let mut next = self.narrow.advance(&self.motion, held);
        for (lane, stopped) in stopped.iter_mut().enumerate() {
            if *stopped || !next.is_bounded(lane, MOST_SPEED_M_S, MOST_RATE_RAD_S) {
                *stopped = true;
                next.keep(lane, &self.motion);
            }
        }
        self.motion = next;
    }

    /// The derivatives of the step that begins at `motion`, so many steps after the starts.
    pub fn slopes(&mut self, step: usize, motion: &Motion, held: &PerChannel<Vec<f64>>) -> Slopes {
        let (lanes, copies) = (motion.lanes(), self.copies);
        let mut slopes = Slopes { next: Vec::with_capacity(DIRECTIONS), seen: Vec::with_capacity(NUMBERS) };
        let sides: Vec<(usize, f64)> =
            (0..DIRECTIONS).flat_map(|direction| [(direction, HALF_STEP), (direction, -HALF_STEP)]).collect();
        let mut found: Vec<(Motion, Observed)> = Vec::with_capacity(sides.len());
        for some in sides.chunks(copies) {
            let mut moved = motion.repeated(copies);
            let mut added = PerChannel::from_fn(|channel| held[channel].repeat(copies));
            for (copy, &(direction, by)) in some.iter().enumerate() {
                let column = match direction.checked_sub(NUMBERS).and_then(Channel::from_index) {
                    None => moved.number_mut(direction),
                    Some(channel) => &mut added[channel],
                };
                column[copy * lanes..][..lanes].iter_mut().for_each(|number| *number += by);
            }
            let seen = self.wide.observe(step, &moved);
            let next = self.wide.advance(&moved, &added);
            let part = |column: &[f64], copy: usize| column[copy * lanes..][..lanes].to_vec();
            found.extend((0..some.len()).map(|copy| {
                let seen = Observed {
                    physics: PerChannel::from_fn(|channel| part(&seen.physics[channel], copy)),
                    inputs: seen.inputs.iter().map(|input| part(input, copy)).collect(),
                };
                (next.part(copy * lanes..(copy + 1) * lanes), seen)
            }));
        }
        let half = |up: &[f64], down: &[f64]| -> Vec<f64> {
            up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * HALF_STEP)).collect()
        };
        for (direction, sides) in found.chunks(2).enumerate() {
            let [(up, seen_up), (down, seen_down)] = sides else { unreachable!("both sides of each direction") };
            slopes.next.push(std::array::from_fn(|number| half(up.number(number), down.number(number))));
            if direction < NUMBERS {
                let inputs = seen_up.inputs.iter().zip(&seen_down.inputs);
                slopes.seen.push(Observed {
                    physics: PerChannel::from_fn(|channel| half(&seen_up.physics[channel], &seen_down.physics[channel])),
                    inputs: inputs.map(|(up, down)| half(up, down)).collect(),
                });
            }
        }
        slopes
    }
}

impl Slopes {
    /// Of a number with these derivatives by the state after the step, those by what is added over it.
    pub fn to_added(&self, lane: usize, after: &[f64; NUMBERS]) -> PerChannel<f64> {
        PerChannel::from_fn(|channel| along(&self.next[NUMBERS + channel.index()], lane, after))
    }

    /// Of a number with these derivatives by the state after the step, and by accelerations and inputs that are seen where it begins, those by
    /// the state there.
    pub fn to_state(&self, lane: usize, after: &[f64; NUMBERS], physics: &PerChannel<f64>, inputs: &[f64]) -> [f64; NUMBERS] {
        std::array::from_fn(|number| {
            let seen = &self.seen[number];
            let of_physics: f64 = seen.physics.iter().zip(physics).map(|(slope, by)| slope[lane] * by).sum();
            let of_inputs: f64 = seen.inputs.iter().zip(inputs).map(|(slope, by)| slope[lane] * by).sum();
            along(&self.next[number], lane, after) + of_physics + of_inputs
        })
    }
}

fn along(slope: &[Vec<f64>; NUMBERS], lane: usize, by: &[f64; NUMBERS]) -> f64 {
    slope.iter().zip(by).map(|(slope, by)| slope[lane] * by).sum()
}

/// The derivatives of `of` by the numbers of the state of one lane.
pub(crate) fn state_slopes(motion: &Motion, lane: usize, of: &dyn Fn(&super::State) -> f64) -> [f64; NUMBERS] {
    let mut one = motion.part(lane..lane + 1);
    std::array::from_fn(|number| {
        let own = one.number(number)[0];
        let mut at = |value: f64| {
            one.number_mut(number)[0] = value;
            of(&one.state(0))
        };
        let slope = (at(own + HALF_STEP) - at(own - HALF_STEP)) / (2.0 * HALF_STEP);
        one.number_mut(number)[0] = own;
        slope
    })
}
