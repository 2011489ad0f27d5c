//! The hybrid in real time: one sample in, one prediction out, on the calling thread.

use super::Hybrid;
use super::inputs;
use super::linear::Linear;
use crate::error::{Error, Result};
use crate::formula::StreamingFormula;
use crate::physics::{StreamingModel, quantity_at};
use crate::tape::{Session, Threads};

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
}

/// Whether a stream has this quantity.
fn known(name: &str) -> bool {
    quantity_at(&[0.0; 16], 0.0, name).is_some()
}

impl<'a> StreamingHybrid<'a> {
    pub(super) fn new(hybrid: &'a Hybrid) -> Result<Self> {
        let description = hybrid.description();
        let formulas = inputs::parse(&description.inputs)?;
        if let Some(error) = formulas.iter().find_map(|formula| formula.unknown_name(&known)) {
            return Err(error);
        }
        let history = description.config.history();
        let mut session = Session::infer(hybrid.network.graph(), &[hybrid.network.output()], Threads(1))?;
        session.load(&hybrid.parameters)?;
        Ok(Self {
            hybrid,
            model: description.model.stream(description.step_s)?,
            linear: description.linear.as_ref().map(|linear| StreamingLinear::new(linear, description.step_s)).transpose()?,
            inputs: formulas.iter().map(|formula| formula.stream(description.step_s)).collect::<Result<_>>()?,
            session,
            state: vec![0.0; history * description.inputs.len()],
            physics: vec![0.0; history * 6],
            samples: 0,
            values: Vec::new(),
        })
    }

    /// Takes the next sample, in the order of [`crate::flight::Column::STATE`], and predicts its accelerations (m/s², rad/s²); `None` until the history is full.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if a value is not finite; the sample is then not taken.
    pub fn push(&mut self, state: &[f64; 16]) -> Result<Option<[f64; 6]>> {
        if let Some(index) = state.iter().position(|value| !value.is_finite()) {
            let name = crate::flight::Column::STATE[index].name();
            return Err(Error::Undetermined(format!("sample {}: `{name}` is {}, not a finite number", self.samples, state[index])));
        }
        let description = self.hybrid.description();
        let mut baseline = self.model.push(state)?;
        let time_s = description.step_s * self.samples as f64;
        if let (Some(stream), Some(linear)) = (&mut self.linear, &description.linear) {
            let filtered = stream.push(linear, state, time_s)?;
            baseline.iter_mut().zip(filtered).for_each(|(sum, value)| *sum += value);
        }
        let channels = self.inputs.len();
        self.state.copy_within(channels.., 0);
        self.physics.copy_within(6.., 0);
        let rows = description.config.history();
        for (input, (formula, scale)) in self.inputs.iter_mut().zip(&description.scaling.state).enumerate() {
            self.values.clear();
            self.values.extend(formula.inputs().iter().map(|name| quantity_at(state, time_s, name).unwrap_or(f64::NAN)));
            self.state[(rows - 1) * channels + input] = scale.apply(formula.push(&self.values)?) as f32;
        }
        for (channel, scale) in description.scaling.physics.iter().enumerate() {
            self.physics[(rows - 1) * 6 + channel] = scale.apply(baseline[channel]) as f32;
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
        let mut predicted = [f64::NAN; 6];
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
    fn new(linear: &Linear, step_s: f64) -> Result<Self> {
        let formulas = inputs::parse(&linear.config().inputs)?;
        if let Some(error) = formulas.iter().find_map(|formula| formula.unknown_name(&known)) {
            return Err(error);
        }
        let inputs = formulas.iter().map(|formula| formula.stream(step_s)).collect::<Result<_>>()?;
        Ok(Self { inputs, rows: std::collections::VecDeque::new(), lags: linear.config().lags, values: Vec::new() })
    }

    fn push(&mut self, linear: &Linear, state: &[f64; 16], time_s: f64) -> Result<[f64; 6]> {
        let mut row = if self.rows.len() == self.lags { self.rows.pop_back().unwrap_or_default() } else { Vec::new() };
        row.clear();
        for formula in &mut self.inputs {
            self.values.clear();
            self.values.extend(formula.inputs().iter().map(|name| quantity_at(state, time_s, name).unwrap_or(f64::NAN)));
            row.push(formula.push(&self.values)?);
        }
        self.rows.push_front(row);
        let last = self.rows.len() - 1;
        Ok(linear.predict(|lag| &self.rows[lag.min(last)]))
    }
}
