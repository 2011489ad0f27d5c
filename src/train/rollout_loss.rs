//! The loss of predictions that run ahead, and its gradient: from measured states the hybrid is integrated forward over some steps, and how far
//! it goes astray is pulled back through the integrator, the formulas, the histories and the network to the weights. What is learned from it, and
//! when, is the trainer's.
//!
//! ```text
//! x' = Φ(x, r),   r = linear(h) + net(h; θ),   h = what was measured up to the start, and predicted from there on
//! λ = ∂C/∂x' · ∂Φ/∂x + …,   ∂C/∂θ = Σ ∂C/∂r · ∂net/∂θ        (discrete adjoint, one step after the other, the last one first)
//! ```
//!
//! Derivatives of a step are central differences of the step itself (`physics::rollout::walk`), those of the network the tape's.

use super::adjoint::Flown;
use super::config::{RolloutConfig, TrainConfig};
use crate::error::{Error, Result};
use crate::flight::{Flight, Span, Window};
use crate::hybrid::Description;
use crate::hybrid::histories::Read;
use crate::hybrid::linear::Signals;
use crate::hybrid::sequence::Sequence;
use crate::nn::{LossRule, Network};
use crate::physics::Rollout;
use crate::physics::rollout::{Measure, OnFlight, starts};
use crate::tape::ops::InnerProduct;
use crate::tape::{Session, Threads};
use phyture_kernels::Real;
use phyture_kernels::random::permutation;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Most rollouts that are looked at where all are judged; of more every other, every third … is taken.
const MOST_JUDGED: usize = 256;

/// Rollouts that are judged side by side.
const LANES: usize = 64;

/// Told from the order of the windows, which has the seed itself.
const ORDER: u64 = 0x726f_6c6c_6f75_7473;

/// How rollouts are drawn and weighed.
#[derive(Clone, Debug)]
pub struct RolloutRule {
    /// Horizon, number and weight.
    pub config: RolloutConfig,
    /// Samples between starts.
    pub stride: usize,
    /// Whether one-step errors are in units of the residual's deviation.
    pub standardise: bool,
    /// Seed of the order.
    pub seed: u64,
}

impl RolloutRule {
    /// Of a configuration; none where it has no rollouts.
    pub fn of(config: &TrainConfig) -> Option<Self> {
        let TrainConfig { stride, standardise_loss: standardise, seed, .. } = *config;
        config.rollout.clone().map(|config| Self { config, stride, standardise, seed })
    }
}

/// Rollouts of a hybrid in training, and what they cost.
///
/// The loss is `weight · L · C`: C is the cost of the rollouts, 1 where they err as the physics does with body rates held
/// (`calibrate --output-error` makes the same cost small), L the one-step loss of a network that says nothing. So with a weight of 1 a rollout
/// error as large as that counts as much as all of the residual.
///
/// ```
/// use phyture::flight::{Flight, split::Split};
/// use phyture::physics::Model;
/// use phyture::tape::Threads;
/// use phyture::train::{Job, RolloutConfig, RolloutLoss, RolloutRule, TrainConfig};
/// # fn judge(flights: &[Flight], split: &Split, model: &Model, weights: &[f32]) -> phyture::Result<()> {
/// let config = TrainConfig { rollout: Some(RolloutConfig::default()), ..TrainConfig::in_minutes() };
/// let job = Job::new(flights, split, model, &config)?;
/// let rule = RolloutRule::of(&config).expect("it has rollouts");
/// let mut loss = RolloutLoss::<f32>::new(&job.description, flights, &job.sequences, &split.test, &rule, Threads(0))?;
/// println!("{} rollouts: {:.3}", loss.starts(), loss.judge(weights)?);
/// # Ok(())
/// # }
/// ```
pub struct RolloutLoss<'a, T> {
    ground: Ground<'a>,
    /// Order of the starts in a pass over them.
    order: Option<(u64, Vec<u32>)>,
    says: Session<T>,
    pulls: Session<T>,
}

/// The rollouts of a training run.
pub struct Rollouts<'a> {
    /// Those that it learns from, beside the windows.
    pub training: RolloutLoss<'a, f32>,
    /// Others to judge it by; none where the split has no validation part.
    pub validation: Option<RolloutLoss<'a, f32>>,
}

/// What no weight changes.
pub(super) struct Ground<'a> {
    pub description: &'a Description,
    pub sequences: &'a [Sequence],
    pub signals: Vec<Signals>,
    pub rollout: Rollout<'a>,
    /// By flight, where rollouts start on it.
    pub on: BTreeMap<usize, OnFlight>,
    pub measure: Measure,
    pub rule: RolloutRule,
    /// From the cost of all rollouts to the loss.
    factor: f64,
}

impl<'a, T: Real> RolloutLoss<'a, T> {
    /// Rollouts that start in `spans`, with a whole history before them there.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where no rollout fits; [`Error::Config`] where model or inputs remember states; as [`Rollout::new`].
    pub fn new(
        description: &'a Description,
        flights: &'a [Flight],
        sequences: &'a [Sequence],
        spans: &[Span],
        rule: &RolloutRule,
        threads: Threads,
    ) -> Result<Self> {
        let ground = Ground::new(description, flights, sequences, spans, rule)?;
        let rule = LossRule { scale: 1.0, standardise: false, input_gradients: true };
        let network = Network::<T>::record(&description.config, &description.output_scale(), rule)?;
        let mut graph = network.graph().clone();
        let product = graph.apply(InnerProduct, &[network.output(), network.target()])?;
        Ok(Self {
            ground,
            order: None,
            says: Session::infer(&graph, &[network.output()], threads)?,
            pulls: Session::train(&graph, product, &[], threads)?,
        })
    }

    /// Number of rollouts that there are.
    pub fn starts(&self) -> usize {
        self.ground.starts().len()
    }

    /// The loss of the rollouts of step `step` of a run, in the expectation that of all, and its gradient by the weights, which is added to
    /// `gradient`.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn step(&mut self, parameters: &[T], step: u64, gradient: &mut [T]) -> Result<f64> {
        let chosen = self.chosen(step);
        let share = self.ground.factor * self.starts() as f64 / chosen.len() as f64;
        let Self { ground, says, pulls, .. } = self;
        says.load(parameters)?;
        let mut flown = Flown::new(ground, &chosen)?;
        flown.forward(says)?;
        flown.backward(pulls, parameters, share, gradient)?;
        Ok(share * flown.cost())
    }

    /// The loss of all rollouts, or of a part of them where there are many.
    ///
    /// # Errors
    /// As [`Session::predict`].
    pub fn judge(&mut self, parameters: &[T]) -> Result<f64> {
        let Self { ground, says, .. } = self;
        says.load(parameters)?;
        let count = ground.starts().len();
        let judged: Vec<usize> = (0..count).step_by(count.div_ceil(MOST_JUDGED)).collect();
        let mut cost = 0.0;
        for some in judged.chunks(LANES) {
            let mut flown = Flown::new(ground, some)?;
            flown.forward(says)?;
            cost += flown.cost();
        }
        Ok(ground.factor * cost * count as f64 / judged.len() as f64)
    }

    /// Starts of a step of a run, in order: all come once before one comes again.
    fn chosen(&mut self, step: u64) -> Vec<usize> {
        let count = self.starts();
        let many = self.ground.rule.config.starts.min(count) as u64;
        let seed = self.ground.rule.seed ^ ORDER;
        let mut one = |place: u64| {
            let (pass, place) = (place / count as u64, (place % count as u64) as usize);
            match &self.order {
                Some((of, order)) if *of == pass => order[place] as usize,
                _ => self.order.insert((pass, permutation(count, seed, pass))).1[place] as usize,
            }
        };
        let mut chosen: Vec<usize> = (step * many..(step + 1) * many).map(&mut one).collect();
        chosen.sort_unstable();
        // The end of one pass and the beginning of the next may hold the same one.
        chosen.dedup();
        chosen
    }
}

impl<'a> Ground<'a> {
    fn new(
        description: &'a Description,
        flights: &'a [Flight],
        sequences: &'a [Sequence],
        spans: &[Span],
        rule: &RolloutRule,
    ) -> Result<Self> {
        let (horizon, history) = (rule.config.horizon, description.config.history());
        let rollout = Rollout::new(&description.model, flights, horizon)?;
        let starts = starts(spans, history, horizon, rule.stride);
        if starts.is_empty() {
            return Err(Error::Undetermined(format!(
                "no run of samples of this part holds a history of {history} and a rollout of {horizon} steps; take a shorter `rollout.horizon` \
                 or longer flights"
            )));
        }
        let Read { program, signals } = Read::new(description, flights)?;
        let mut on = BTreeMap::new();
        for flight in starts.iter().map(|start| start.flight) {
            if let Entry::Vacant(place) = on.entry(flight) {
                place.insert(without_memory(rollout.on_flight(flight, &program)?)?);
            }
        }
        Ok(Self {
            measure: Measure::new(&description.model, flights, starts, horizon)?,
            factor: rule.config.weight * nothing_said(description, rule.standardise) / Measure::USUAL,
            signals,
            rule: rule.clone(),
            description,
            sequences,
            rollout,
            on,
        })
    }

    pub fn starts(&self) -> &[Window] {
        self.measure.starts()
    }
}

/// Refuses what has no derivative in a single step.
fn without_memory(on: OnFlight) -> Result<OnFlight> {
    let what = match on.remembers() {
        [false, false] => return Ok(on),
        [true, _] => "the model",
        [false, true] => "an input of network or linear history",
    };
    Err(Error::Config {
        place: "training configuration".into(),
        field: "rollout".into(),
        found: format!("rollouts of a hybrid of which {what} remembers states (`lag`, `delay`, `rate` or `slew` of one)"),
        expected:
            "formulas of the states of the moment, and of whatever controls did before: a loss of rollouts has no derivative \
                   through what remembers a state"
                .into(),
    })
}

/// The one-step loss of a network that says nothing, from the scales of what it learns.
fn nothing_said(description: &Description, standardise: bool) -> f64 {
    let of = |scale: &crate::hybrid::Scale| {
        let square = scale.mean * scale.mean + scale.deviation * scale.deviation;
        if standardise { square / (scale.deviation * scale.deviation) } else { square }
    };
    description.scaling.output.iter().map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::split::{Part, Split};
    use crate::flight::{Channel, Column, Targets};
    use crate::hybrid::linear::LinearConfig;
    use crate::hybrid::{Hybrid, HybridRollout};
    use crate::nn::{PhyTureConfig, Variant};
    use crate::physics::{Effect, Model};
    use crate::train::Job;
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.02;
    const SAMPLES: usize = 120;
    const APPROXIMATE: f64 = Tolerance::Approximate.relative_f64();

    /// A model that has a formula of most states.
    fn model() -> Model {
        let mut model = Model::paper("small", 0.05, [1.7e-5, 1.9e-5, 2.9e-5], 0.03);
        let numbers: [(&str, &[f64]); 5] = [
            ("linear_drag", &[-0.35, -0.3, -0.45]),
            ("collective_thrust", &[-20.0]),
            ("rate_damping", &[-4.0, -4.5, -3.0]),
            ("control_moment", &[30.0, 25.0, 8.0]),
            ("moment_bias", &[0.2, -0.1, 0.05]),
        ];
        for (kind, values) in numbers {
            let effect = model.effects.iter_mut().find(|effect| effect.kind == kind).expect("an effect of the baseline");
            effect.coefficients.iter_mut().zip(values).for_each(|(coefficient, value)| coefficient.value = *value);
        }
        model
    }

    /// A log of smooth sines, which obeys no model.
    fn flight(seed: u64, name: &str) -> Result<Flight> {
        let draws = Stream::new(seed, 1, 2, 3);
        let of = |column: Column, sample: usize| {
            let pace = 1.0 + 5.0 * draws.uniform(column as u64);
            let wave = (pace * STEP_S * sample as f64 + 6.0 * draws.uniform(100 + column as u64)).sin();
            match column {
                Column::U4 => 0.5 + 0.05 * wave,
                Column::U1 | Column::U2 | Column::U3 => 0.03 * wave,
                _ => 0.5 * wave,
            }
        };
        let columns = Column::ALL.map(|column| (0..SAMPLES).map(|sample| of(column, sample)).collect());
        Flight::new(name, "waves", 0.0, STEP_S, columns, Targets::Recorded)
    }

    fn config(variant: Variant, linear: bool, starts: usize) -> TrainConfig {
        let network = PhyTureConfig {
            history: 8,
            d_model: 8,
            heads: 2,
            levels: 1,
            moving_average: 3,
            variant,
            state_channels: 9,
            ..PhyTureConfig::default()
        };
        let inputs = ["vx", "vy * wz", "vz", "wx", "roll", "airspeed", "g_x", "u1", "lag(u2, 0.05)"].map(str::to_owned).into();
        let lags = LinearConfig { lags: 3, inputs: ["vx", "wy * vz", "g_z", "u3"].map(str::to_owned).into() };
        TrainConfig {
            network: network.into(),
            inputs,
            linear: linear.then_some(lags),
            stride: 3,
            rollout: Some(RolloutConfig { horizon: 12, starts, weight: 0.7 }),
            ..TrainConfig::default()
        }
    }

    /// What the tests look at: two flights, and a job on them.
    fn prepared(config: &TrainConfig, model: &Model) -> Result<([Flight; 2], Job, Split)> {
        let flights = [flight(3, "a")?, flight(4, "b")?];
        let training = (0..2).map(|flight| Span { flight, start: 0, end: SAMPLES }).collect();
        let split = Split { training, validation: Vec::new(), test: Vec::new(), tested: Part::Test };
        let job = Job::new(&flights, &split, model, config)?;
        Ok((flights, job, split))
    }

    fn loss<'a, T: Real>(
        config: &TrainConfig,
        flights: &'a [Flight],
        job: &'a Job,
        threads: Threads,
    ) -> Result<RolloutLoss<'a, T>> {
        let rule = RolloutRule::of(config).expect("a configuration with rollouts");
        RolloutLoss::new(&job.description, flights, &job.sequences, &job.rollout_spans, &rule, threads)
    }

    /// Weights away from where the last layer begins: it says nothing there, and nothing before it would matter.
    fn weights(config: &TrainConfig, job: &Job, seed: u64) -> Result<Vec<f64>> {
        let rule = LossRule { scale: 1.0, standardise: false, input_gradients: false };
        let begun = Network::<f64>::record(&config.network, &job.description.output_scale(), rule)?.initial(5);
        let draws = Stream::new(seed, 0, 0, 0);
        Ok(begun.iter().enumerate().map(|(index, value)| value + 0.1 * (draws.uniform(index as u64) - 0.5)).collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_gradient_is_that_of_differences_of_the_loss(
            seed in any::<u64>(), linear in any::<bool>(), step in 0_u64..40,
            variant in prop::sample::select(vec![Variant::PhyTure, Variant::WithoutPaf, Variant::DirectConcatenation]),
        ) {
            let config = config(variant, linear, 5);
            let (flights, job, _) = prepared(&config, &model())?;
            let mut loss = loss::<f64>(&config, &flights, &job, Threads(1))?;
            let at = weights(&config, &job, seed)?;
            let draws = Stream::new(seed, 1, 0, 0);
            let way: Vec<f64> = (0..at.len()).map(|index| draws.uniform(index as u64) - 0.5).collect();
            let mut gradient = vec![0.0; at.len()];
            loss.step(&at, step, &mut gradient)?;
            let mut there = |by: f64| {
                let moved: Vec<f64> = at.iter().zip(&way).map(|(at, way)| at + by * way).collect();
                loss.step(&moved, step, &mut vec![0.0; at.len()])
            };
            let mut difference = |by: f64| -> Result<f64> { Ok((there(by)? - there(-by)?) / (2.0 * by)) };
            let (expected, closer) = (difference(1e-6)?, difference(3e-7)?);
            let found: f64 = gradient.iter().zip(&way).map(|(gradient, way)| gradient * way).sum();
            let size = gradient.iter().map(|part| part * part).sum::<f64>().sqrt();
            prop_assert!(size > 1e-3, "nothing to check");
            // Where two steps disagree one of the many rectifiers has its kink between the points, and another point is drawn.
            prop_assume!((expected - closer).abs() < APPROXIMATE * size);
            prop_assert!((found - expected).abs() < APPROXIMATE * size, "{} for {}, of {}", found, expected, size);
        }
    }

    #[test]
    fn what_it_costs_is_what_rollouts_of_the_hybrid_cost_on_any_number_of_threads() -> Result<()> {
        for (variant, linear) in [(Variant::PhyTure, true), (Variant::PhyTure, false), (Variant::StateControlOnly, true)] {
            let config = config(variant, linear, 5);
            let (flights, job, _) = prepared(&config, &model())?;
            let at: Vec<f32> = weights(&config, &job, 7)?.into_iter().map(|weight| weight as f32).collect();
            let mut one = loss::<f32>(&config, &flights, &job, Threads(1))?;
            let found = one.judge(&at)?;
            let mut two = loss::<f32>(&config, &flights, &job, Threads(2))?;
            assert_eq!(two.judge(&at)?.to_bits(), found.to_bits());
            let mut gradients = [vec![0.0; at.len()], vec![0.0; at.len()]];
            let losses = [one.step(&at, 3, &mut gradients[0])?, two.step(&at, 3, &mut gradients[1])?];
            assert_eq!((losses[0].to_bits(), &gradients[0]), (losses[1].to_bits(), &gradients[1]));
            let hybrid = Hybrid::new(job.description.clone(), at)?;
            let rollout = HybridRollout::new(&hybrid, &flights, 12)?;
            let Ground { measure, factor, .. } = &one.ground;
            let batches = rollout.roll(measure.starts(), &|rolled| measure.of_batch(rolled))?;
            let mut errors: Vec<f64> = batches.into_iter().flatten().collect();
            measure.scale(&mut errors);
            let expected = factor * measure.cost(&errors);
            assert!((found - expected).abs() < Tolerance::Close.relative_f32() * expected, "{found} for {expected}");
        }
        Ok(())
    }

    #[test]
    fn all_rollouts_come_once_before_one_comes_again() -> Result<()> {
        let config = config(Variant::PhyTure, false, 5);
        let (flights, job, _) = prepared(&config, &model())?;
        let mut loss = loss::<f32>(&config, &flights, &job, Threads(1))?;
        let count = loss.starts();
        let steps = count / 5;
        let mut seen: Vec<usize> = (0..steps as u64).flat_map(|step| loss.chosen(step)).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 5 * steps, "of {count}");
        let again: Vec<usize> = (0..steps as u64).flat_map(|step| loss.chosen(steps as u64 + 1 + step)).collect();
        assert_ne!(seen, again);
        Ok(())
    }

    #[test]
    fn what_remembers_a_state_and_what_does_not_fit_is_refused() -> Result<()> {
        let message = |config: &TrainConfig, model: &Model| -> Result<String> {
            let (flights, job, _) = prepared(config, model)?;
            Ok(loss::<f32>(config, &flights, &job, Threads(1)).err().map(|error| error.to_string()).unwrap_or_default())
        };
        let mut of_input = config(Variant::PhyTure, false, 5);
        of_input.inputs[1] = "rate(vy)".into();
        assert!(message(&of_input, &model())?.contains("an input of network or linear history remembers states"));
        let mut of_model = model();
        of_model.effects.push(Effect::formula("slow_wake", Channel::WyDot, "lag(vx, 0.1)", 0.1)?);
        assert!(message(&config(Variant::PhyTure, false, 5), &of_model)?.contains("the model remembers states"));
        let mut too_long = config(Variant::PhyTure, false, 5);
        too_long.rollout = Some(RolloutConfig { horizon: SAMPLES - 6, ..RolloutConfig::default() });
        assert!(message(&too_long, &model())?.contains("rollout.horizon"));
        Ok(())
    }
}
