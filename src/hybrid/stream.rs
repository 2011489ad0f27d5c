//! The hybrid in real time: one sample in, one prediction out, on the calling thread. Once a stream is made, taking samples allocates
//! nothing; only an error does, for its text.

use super::Hybrid;
use super::envelope::{Envelope, Place};
use super::inputs;
use super::linear::Linear;
use crate::error::{Error, Result};
use crate::flight::PerChannel;
use crate::formula::{Formula, StreamingFormula};
use crate::physics::{StreamingModel, quantity_at};
use crate::tape::{Session, Threads};
use std::borrow::Borrow;
use std::collections::{BTreeSet, VecDeque};
use std::num::NonZeroUsize;

/// A prediction part by part, m/s² and rad/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Streamed {
    /// The calibrated model alone, a^p: there from the first sample.
    pub physics: PerChannel<f64>,
    /// What the linear history says on top; zero where there is none.
    pub linear: PerChannel<f64>,
    /// What the network says, behind its gate; `None` until the history is full.
    pub network: Option<PerChannel<f64>>,
    /// The prediction: the sum of the three, or for a network that does not learn a residual what it says alone; `None` until the
    /// history is full.
    pub acceleration: Option<PerChannel<f64>>,
    /// Half of the interval around the prediction; `None` without a prediction, and where the hybrid has no [`PredictionIntervals`].
    ///
    /// [`PredictionIntervals`]: super::intervals::PredictionIntervals
    pub half_width: Option<PerChannel<f64>>,
    /// Where the sample lies beside what was seen in training; `None` where the hybrid has no [`Envelope`](super::Envelope). Outside of it
    /// neither prediction nor interval is backed by data.
    pub place: Option<Place>,
}

/// A hybrid that takes samples in order, one step apart; it gives what [`Hybrid::predict`] gives on the same flight. `H` is what holds the
/// hybrid: a reference, or an `Arc` for a stream that goes where it likes.
pub struct StreamingHybrid<H: Borrow<Hybrid>> {
    hybrid: H,
    model: StreamingModel,
    linear: Option<StreamingLinear>,
    inputs: Vec<StreamingFormula>,
    session: Session<f32>,
    /// The last H rows, scaled, oldest first.
    state: Vec<f32>,
    physics: Vec<f32>,
    start_s: f64,
    samples: usize,
    values: Vec<f64>,
    /// Columns of the log's own that physics, linear history or network read.
    own: Vec<String>,
    /// Where those of the physics are among them.
    of_model: Vec<usize>,
    model_values: Vec<f64>,
    /// One number for each range of the envelope.
    of_envelope: Vec<f64>,
    /// Samples from one pass of the network to the next.
    network_every: usize,
    /// What the network said last.
    held: PerChannel<f64>,
}

/// One sample: state and controls, and the log's own columns.
#[derive(Clone, Copy)]
struct Sample<'s> {
    state: &'s [f64; 16],
    time_s: f64,
    names: &'s [String],
    own: &'s [f64],
}

impl Sample<'_> {
    /// What a formula reads, in the order of its inputs.
    fn read(&self, formula: &StreamingFormula, values: &mut Vec<f64>) {
        values.clear();
        values.extend(formula.inputs().iter().map(|name| self.quantity(name)));
    }

    /// A quantity of the state, or one of the log's own columns.
    fn quantity(&self, name: &str) -> f64 {
        let own = || self.names.iter().position(|own| own == name).map(|place| self.own[place]);
        // All names that are read were gathered when the stream was made.
        quantity_at(self.state, self.time_s, name).or_else(own).expect("a quantity of the state, or one of the log's own columns")
    }
}

/// Names in a formula that no state gives.
fn own_names(formula: &Formula) -> Vec<String> {
    let is_own = |name: &&str| quantity_at(&[0.0; 16], 0.0, name).is_none();
    formula.names().into_iter().filter(is_own).map(str::to_owned).collect()
}

impl<H: Borrow<Hybrid>> StreamingHybrid<H> {
    pub(super) fn new(holder: H) -> Result<Self> {
        let hybrid = holder.borrow();
        let description = hybrid.description();
        let formulas = inputs::parse(&description.inputs)?;
        let of_linear = description.linear.as_ref().map_or(Ok(Vec::new()), |linear| inputs::parse(&linear.config().inputs))?;
        let model = description.model.stream(description.step_s)?;
        let read = formulas.iter().chain(&of_linear).flat_map(own_names).chain(model.extra_inputs().iter().cloned());
        let own: Vec<String> = read.collect::<BTreeSet<String>>().into_iter().collect();
        let of_model: Vec<usize> = model.extra_inputs().iter().filter_map(|name| own.binary_search(name).ok()).collect();
        let linear = description.linear.as_ref().map(|linear| StreamingLinear::new(&of_linear, linear, description.step_s));
        let history = description.config.history();
        let mut session = Session::infer(hybrid.network.graph(), &[hybrid.network.output()], Threads(1))?;
        session.load(&hybrid.parameters)?;
        // A session asks for the memory of its results when it first predicts; here, not in flight.
        session.predict(1, &|_, slabs| slabs.iter_mut().for_each(|slab| slab.fill(0.0)), &mut |_, _| ())?;
        let most_names = formulas.iter().chain(&of_linear).map(|formula| formula.names().len()).max().unwrap_or(0);
        Ok(Self {
            model,
            linear: linear.transpose()?,
            inputs: StreamingFormula::of_each(&formulas, description.step_s)?,
            session,
            state: vec![0.0; history * description.inputs.len()],
            physics: vec![0.0; history * 6],
            start_s: 0.0,
            samples: 0,
            values: Vec::with_capacity(most_names),
            model_values: Vec::with_capacity(of_model.len()),
            of_envelope: Vec::with_capacity(description.envelope.as_ref().map_or(0, |envelope| envelope.ranges().len())),
            network_every: 1,
            held: PerChannel::splat(f64::NAN),
            own,
            of_model,
            hybrid: holder,
        })
    }

    /// Starts anew: the next sample is the first one, at time `start_s`, and the history is empty.
    pub fn reset(&mut self, start_s: f64) {
        self.model.reset(start_s);
        self.linear.iter_mut().for_each(StreamingLinear::reset);
        self.inputs.iter_mut().for_each(StreamingFormula::reset);
        (self.start_s, self.samples) = (start_s, 0);
    }

    /// Lets the network look at every so many-th sample only, and holds what it said in between: physics and linear history are of each sample
    /// all the same. For a processor that cannot do the network at the rate of the log. The first prediction has a network of its own.
    pub fn set_network_every(&mut self, samples: NonZeroUsize) {
        self.network_every = samples.get();
    }

    /// Names of the log's own columns (motor commands, rotor speeds) that the hybrid reads besides state and controls;
    /// [`StreamingHybrid::push_with`] takes them in this order, in the units of the log. Empty for most hybrids.
    pub fn own_columns(&self) -> &[String] {
        &self.own
    }

    /// What the envelope asks of each sample, where the hybrid has one: [`Place::Beyond`] names a quantity by its index there.
    pub fn envelope(&self) -> Option<&Envelope> {
        self.hybrid.borrow().description().envelope.as_ref()
    }

    /// Samples until the history is full and there is a prediction.
    pub fn history(&self) -> usize {
        self.hybrid.borrow().description().config.history()
    }

    /// Takes the next sample, in the order of [`crate::flight::Column::STATE`], and predicts its accelerations (m/s², rad/s²); `None` until the history is full.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if a value is not finite; [`Error::Shape`] if the hybrid reads columns of the log's own. The sample is then not taken.
    pub fn push(&mut self, state: &[f64; 16]) -> Result<Option<PerChannel<f64>>> {
        self.push_with(state, &[])
    }

    /// As [`StreamingHybrid::push`], with one number for each of [`StreamingHybrid::own_columns`].
    ///
    /// # Errors
    /// As [`StreamingHybrid::push`]; [`Error::Shape`] if their count differs.
    pub fn push_with(&mut self, state: &[f64; 16], own: &[f64]) -> Result<Option<PerChannel<f64>>> {
        Ok(self.push_parts(state, own)?.acceleration)
    }

    /// As [`StreamingHybrid::push_with`], part by part; the physics is there from the first sample.
    ///
    /// # Errors
    /// As [`StreamingHybrid::push_with`].
    pub fn push_parts(&mut self, state: &[f64; 16], own: &[f64]) -> Result<Streamed> {
        self.check(state, own)?;
        let hybrid: &Hybrid = self.hybrid.borrow();
        let description = hybrid.description();
        self.model_values.clear();
        self.model_values.extend(self.of_model.iter().map(|place| own[*place]));
        let physics = self.model.push_with(state, &self.model_values)?;
        let time_s = self.start_s + description.step_s * self.samples as f64;
        let sample = Sample { state, time_s, names: &self.own, own };
        let linear = match (&mut self.linear, &description.linear) {
            (Some(stream), Some(linear)) => stream.push(linear, &sample, &mut self.values)?,
            _ => PerChannel::splat(0.0),
        };
        let baseline = PerChannel::from_fn(|channel| physics[channel] + linear[channel]);
        let channels = self.inputs.len();
        self.state.copy_within(channels.., 0);
        self.physics.copy_within(6.., 0);
        let rows = description.config.history();
        for (input, (formula, scale)) in self.inputs.iter_mut().zip(&description.scaling.state).enumerate() {
            sample.read(formula, &mut self.values);
            self.state[(rows - 1) * channels + input] = scale.apply(formula.push(&self.values)?) as f32;
        }
        for (channel, scale) in description.scaling.physics.pairs() {
            self.physics[(rows - 1) * 6 + channel.index()] = scale.apply(baseline[channel]) as f32;
        }
        let place = description.envelope.as_ref().map(|envelope| {
            self.of_envelope.clear();
            self.of_envelope.extend(envelope.ranges().iter().map(|range| sample.quantity(&range.name)));
            envelope.place(&self.of_envelope)
        });
        self.samples += 1;
        if self.samples < rows {
            return Ok(Streamed { physics, linear, network: None, acceleration: None, half_width: None, place });
        }
        if (self.samples - rows).is_multiple_of(self.network_every) {
            self.look()?;
        }
        let hybrid: &Hybrid = self.hybrid.borrow();
        let acceleration = hybrid.complete(baseline, self.held);
        if acceleration.iter().any(|value| !value.is_finite()) {
            return Err(Error::Undetermined(format!("sample {}: the prediction is not finite", self.samples - 1)));
        }
        let half_width = hybrid.description().intervals.as_ref().map(|intervals| intervals.half_width(state));
        Ok(Streamed { physics, linear, network: Some(self.held), acceleration: Some(acceleration), half_width, place })
    }

    /// Lets the network look at the history.
    fn look(&mut self) -> Result<()> {
        let Self { hybrid, session, state, physics, held, .. } = self;
        let hybrid: &Hybrid = (*hybrid).borrow();
        let fill = |_: usize, slabs: &mut [&mut [f32]]| {
            if let [state_slab, physics_slab, ..] = slabs {
                state_slab.copy_from_slice(state);
                physics_slab.copy_from_slice(physics);
            }
        };
        session.predict(1, &fill, &mut |_, output| *held = hybrid.learned(output))?;
        Ok(())
    }

    /// Refuses what is no finite number, before anything is taken.
    fn check(&self, state: &[f64; 16], own: &[f64]) -> Result<()> {
        if own.len() != self.own.len() {
            let message = format!("{} values for the log's own columns, which are {:?}", own.len(), self.own);
            return Err(Error::Shape { operation: "streaming hybrid", message });
        }
        let refused = |name: &str, value: f64| {
            Err(Error::Undetermined(format!("sample {}: `{name}` is {value}, not a finite number", self.samples)))
        };
        if let Some(place) = own.iter().position(|value| !value.is_finite()) {
            return refused(&self.own[place], own[place]);
        }
        match state.iter().position(|value| !value.is_finite()) {
            Some(index) => refused(crate::flight::Column::STATE[index].name(), state[index]),
            None => Ok(()),
        }
    }
}

/// The linear history's inputs and its last rows, newest first.
struct StreamingLinear {
    inputs: Vec<StreamingFormula>,
    /// As many as there are lags; those that are not filled yet are the last.
    rows: VecDeque<Vec<f64>>,
    filled: usize,
    /// Numbers that the prediction is a sum over.
    features: Vec<f64>,
}

impl StreamingLinear {
    fn new(formulas: &[Formula], linear: &Linear, step_s: f64) -> Result<Self> {
        let inputs = StreamingFormula::of_each(formulas, step_s)?;
        let rows = (0..linear.config().lags).map(|_| Vec::with_capacity(inputs.len())).collect();
        Ok(Self { inputs, rows, filled: 0, features: vec![0.0; linear.config().features()] })
    }

    fn reset(&mut self) {
        self.inputs.iter_mut().for_each(StreamingFormula::reset);
        self.filled = 0;
    }

    fn push(&mut self, linear: &Linear, sample: &Sample, values: &mut Vec<f64>) -> Result<PerChannel<f64>> {
        let mut row = self.rows.pop_back().expect("a linear history has a lag at least");
        row.clear();
        for formula in &mut self.inputs {
            sample.read(formula, values);
            row.push(formula.push(values)?);
        }
        self.rows.push_front(row);
        self.filled = (self.filled + 1).min(self.rows.len());
        let Self { rows, filled, features, .. } = self;
        Ok(linear.predict(|lag| &rows[lag.min(*filled - 1)], features))
    }
}
