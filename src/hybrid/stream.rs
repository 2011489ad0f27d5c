//! The hybrid in real time: one sample in, one prediction out, on the calling thread.

use super::Hybrid;
use super::inputs;
use super::linear::Linear;
use crate::error::{Error, Result};
use crate::flight::PerChannel;
use crate::formula::{Formula, StreamingFormula};
use crate::physics::{StreamingModel, quantity_at};
use crate::tape::{Session, Threads};
use std::collections::BTreeSet;

/// A hybrid that takes samples in order, one step apart; it gives what [`Hybrid::predict`] gives on the same flight.
pub struct StreamingHybrid<'a> {
    hybrid: &'a Hybrid,
    model: StreamingModel,
    linear: Option<StreamingLinear>,
    inputs: Vec<StreamingFormula>,
    session: Session<f32>,
    /// The last H rows, scaled, oldest first.
    state: Vec<f32>,
    physics: Vec<f32>,
    samples: usize,
    values: Vec<f64>,
    /// Columns of the log's own that physics, linear history or network read.
    own: Vec<String>,
    /// Where those of the physics are among them.
    of_model: Vec<usize>,
    model_values: Vec<f64>,
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
        values.extend(formula.inputs().iter().map(|name| {
            let own = || self.names.iter().position(|own| own == name).map(|place| self.own[place]);
            // All names that formulas read were gathered when the stream was made.
            quantity_at(self.state, self.time_s, name)
                .or_else(own)
                .expect("a quantity of the state, or one of the log's own columns")
        }));
    }
}

/// Names in a formula that no state gives.
fn own_names(formula: &Formula) -> Vec<String> {
    let is_own = |name: &&str| quantity_at(&[0.0; 16], 0.0, name).is_none();
    formula.names().into_iter().filter(is_own).map(str::to_owned).collect()
}

impl<'a> StreamingHybrid<'a> {
    pub(super) fn new(hybrid: &'a Hybrid) -> Result<Self> {
        let description = hybrid.description();
        let formulas = inputs::parse(&description.inputs)?;
        let of_linear = description.linear.as_ref().map_or(Ok(Vec::new()), |linear| inputs::parse(&linear.config().inputs))?;
        let model = description.model.stream(description.step_s)?;
        let read = formulas.iter().chain(&of_linear).flat_map(own_names).chain(model.extra_inputs().iter().cloned());
        let own: Vec<String> = read.collect::<BTreeSet<String>>().into_iter().collect();
        let of_model = model.extra_inputs().iter().filter_map(|name| own.binary_search(name).ok()).collect();
        let linear = description.linear.as_ref().map(|linear| StreamingLinear::new(&of_linear, linear, description.step_s));
        let history = description.config.history();
        let mut session = Session::infer(hybrid.network.graph(), &[hybrid.network.output()], Threads(1))?;
        session.load(&hybrid.parameters)?;
        Ok(Self {
            hybrid,
            model,
            linear: linear.transpose()?,
            inputs: formulas.iter().map(|formula| formula.stream(description.step_s)).collect::<Result<_>>()?,
            session,
            state: vec![0.0; history * description.inputs.len()],
            physics: vec![0.0; history * 6],
            samples: 0,
            values: Vec::new(),
            own,
            of_model,
            model_values: Vec::new(),
        })
    }

    /// Names of the log's own columns (motor commands, rotor speeds) that the hybrid reads besides state and controls;
    /// [`StreamingHybrid::push_with`] takes them in this order, in the units of the log. Empty for most hybrids.
    pub fn own_columns(&self) -> &[String] {
        &self.own
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
        if own.len() != self.own.len() {
            let message = format!("{} values for the log's own columns, which are {:?}", own.len(), self.own);
            return Err(Error::Shape { operation: "streaming hybrid", message });
        }
        if let Some(place) = own.iter().position(|value| !value.is_finite()) {
            let (name, value) = (&self.own[place], own[place]);
            return Err(Error::Undetermined(format!("sample {}: `{name}` is {value}, not a finite number", self.samples)));
        }
        if let Some(index) = state.iter().position(|value| !value.is_finite()) {
            let name = crate::flight::Column::STATE[index].name();
            return Err(Error::Undetermined(format!("sample {}: `{name}` is {}, not a finite number", self.samples, state[index])));
        }
        let description = self.hybrid.description();
        self.model_values.clear();
        self.model_values.extend(self.of_model.iter().map(|place| own[*place]));
        let mut baseline = self.model.push_with(state, &self.model_values)?;
        let sample = Sample { state, time_s: description.step_s * self.samples as f64, names: &self.own, own };
        if let (Some(stream), Some(linear)) = (&mut self.linear, &description.linear) {
            let filtered = stream.push(linear, &sample)?;
            baseline.iter_mut().zip(filtered).for_each(|(sum, value)| *sum += value);
        }
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
        self.samples += 1;
        if self.samples < rows {
            return Ok(None);
        }
        let (state, physics) = (&self.state, &self.physics);
        let fill = |_: usize, slabs: &mut [&mut [f32]]| {
            if let [state_slab, physics_slab, ..] = slabs {
                state_slab.copy_from_slice(state);
                physics_slab.copy_from_slice(physics);
            }
        };
        let mut predicted = PerChannel::splat(f64::NAN);
        self.session.predict(1, &fill, &mut |_, output| predicted = self.hybrid.complete(baseline, output))?;
        if predicted.iter().any(|value| !value.is_finite()) {
            return Err(Error::Undetermined(format!("sample {}: the prediction is not finite", self.samples - 1)));
        }
        Ok(Some(predicted))
    }
}

/// The linear history's inputs and its last rows, newest first.
struct StreamingLinear {
    inputs: Vec<StreamingFormula>,
    rows: std::collections::VecDeque<Vec<f64>>,
    lags: usize,
    values: Vec<f64>,
}

impl StreamingLinear {
    fn new(formulas: &[Formula], linear: &Linear, step_s: f64) -> Result<Self> {
        let inputs = formulas.iter().map(|formula| formula.stream(step_s)).collect::<Result<_>>()?;
        Ok(Self { inputs, rows: std::collections::VecDeque::new(), lags: linear.config().lags, values: Vec::new() })
    }

    fn push(&mut self, linear: &Linear, sample: &Sample) -> Result<PerChannel<f64>> {
        let mut row = if self.rows.len() == self.lags { self.rows.pop_back().unwrap_or_default() } else { Vec::new() };
        row.clear();
        for formula in &mut self.inputs {
            sample.read(formula, &mut self.values);
            row.push(formula.push(&self.values)?);
        }
        self.rows.push_front(row);
        let last = self.rows.len() - 1;
        Ok(linear.predict(|lag| &self.rows[lag.min(last)]))
    }
}
