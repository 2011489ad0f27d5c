//! The histories of rollouts: what network and linear history read, measured up to the start of each lane and predicted from there on. What is
//! made of them is elsewhere.

use super::linear::{Linear, Signals};
use super::sequence::Sequence;
use super::{Description, inputs};
use crate::error::Result;
use crate::flight::{Flight, PerChannel};
use crate::physics::rollout::Program;
use phyture_kernels::Real;

/// What is read along some flights, beside the model.
pub(crate) struct Read {
    /// The network's inputs, then those of the linear history.
    pub program: Program,
    /// By flight, where there is a linear history: its inputs as they were recorded.
    pub signals: Vec<Signals>,
}

impl Read {
    /// What a hybrid reads.
    ///
    /// # Errors
    /// As [`inputs::parse`] and [`Signals::new`].
    pub fn new(description: &Description, flights: &[Flight]) -> Result<Self> {
        let linear = description.linear.as_ref().map(|linear| linear.config());
        let mut formulas = inputs::parse(&description.inputs)?;
        formulas.extend(inputs::parse(linear.map_or(&[], |linear| &linear.inputs))?);
        let signals = linear.map(|linear| flights.iter().map(|flight| Signals::new(flight, linear)).collect::<Result<_>>());
        Ok(Self { program: Program::of_formulas(&formulas)?, signals: signals.transpose()?.unwrap_or_default() })
    }
}

/// Rows of some lanes of one flight, with room for a whole rollout.
pub(crate) struct Histories<'a, T> {
    description: &'a Description,
    linear: Option<&'a Linear>,
    history: usize,
    channels: usize,
    lanes: Vec<Lane<T>>,
}

struct Lane<T> {
    /// Scaled rows, the last of the first `history` being that of the start.
    state: Vec<T>,
    physics: Vec<T>,
    /// Rows of the linear history's inputs, the last of the first `lags` being that of the start.
    signals: Vec<f64>,
}

/// Derivatives of a number by what was put into the histories of one lane, step by step.
#[derive(Clone, Debug)]
pub(crate) struct HistorySlopes {
    /// By scaled rows of the network's inputs, `[steps, channels]`.
    state: Vec<f64>,
    /// By scaled rows of the accelerations before the network, `[steps, 6]`.
    physics: Vec<f64>,
    /// By rows of the linear history's inputs, `[steps, inputs]`.
    signals: Vec<f64>,
}

impl<'a, T: Real> Histories<'a, T> {
    /// What was measured before some samples of a flight, themselves included.
    pub fn new(
        description: &'a Description,
        sequence: &Sequence,
        signals: Option<&Signals>,
        samples: &[usize],
        horizon: usize,
    ) -> Self {
        let (history, channels) = (description.config.history(), description.inputs.len());
        let linear = description.linear.as_ref();
        let rows = history + horizon;
        let lane = |&sample: &usize| {
            let [mut state, mut physics] = [channels, 6].map(|width| vec![0.0_f32; history * width]);
            sequence.history(sample, &mut state, &mut physics);
            let with_room = |rows_now: Vec<f32>, width: usize| {
                let mut all: Vec<T> = rows_now.into_iter().map(|value| T::of(f64::from(value))).collect();
                all.resize(rows * width, T::ZERO);
                all
            };
            let lags = linear.map_or(0, |linear| linear.config().lags);
            let before = signals
                .map(|signals| (0..lags).rev().flat_map(|lag| signals.row(sample, lag).iter().copied()).collect())
                .unwrap_or_default();
            Lane { state: with_room(state, channels), physics: with_room(physics, 6), signals: before }
        };
        Self { description, linear, history, channels, lanes: samples.iter().map(lane).collect() }
    }

    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.lanes.len()
    }

    /// Puts in what is seen so many steps after the starts, the model's accelerations and the values of the inputs, those of the linear history
    /// behind those of the network, and gives back what the linear history says, by lane, 0 where there is none.
    pub fn take(&mut self, step: usize, physics: PerChannel<&[f64]>, inputs: &[Vec<f64>]) -> Vec<PerChannel<f64>> {
        let Self { description, linear, history, channels, lanes } = self;
        let (row, scaling) = (*history - 1 + step, &description.scaling);
        let mut features = vec![0.0; linear.map_or(0, |linear| linear.config().features())];
        let one = |(index, lane): (usize, &mut Lane<T>)| {
            let says = linear.map_or(PerChannel::splat(0.0), |linear| {
                let (count, last) = (linear.config().inputs.len(), linear.config().lags - 1 + step);
                // The row of the start is there already, as it was measured.
                lane.signals.truncate(last * count);
                lane.signals.extend(inputs[*channels..].iter().map(|input| input[index]));
                linear.predict(|lag| &lane.signals[(last - lag) * count..][..count], &mut features)
            });
            for (channel, (scale, input)) in scaling.state.iter().zip(inputs).enumerate() {
                lane.state[row * *channels + channel] = T::of(scale.apply(input[index]));
            }
            for (channel, scale) in scaling.physics.pairs() {
                lane.physics[row * 6 + channel.index()] = T::of(scale.apply(physics[channel][index] + says[channel]));
            }
            says
        };
        lanes.iter_mut().enumerate().map(one).collect()
    }

    /// The network's inputs of a lane so many steps after its start.
    pub fn fill(&self, lane: usize, step: usize, slabs: &mut [&mut [T]]) {
        if let [state, physics, ..] = slabs {
            let rows = step..step + self.history;
            let lane = &self.lanes[lane];
            state.copy_from_slice(&lane.state[rows.start * self.channels..rows.end * self.channels]);
            physics.copy_from_slice(&lane.physics[rows.start * 6..rows.end * 6]);
        }
    }

    /// No derivative yet, for so many steps.
    pub fn no_slopes(&self, steps: usize) -> HistorySlopes {
        let of_linear = self.linear.map_or(0, |linear| linear.config().inputs.len());
        let [state, physics, signals] = [self.channels, 6, of_linear].map(|width| vec![0.0; steps * width]);
        HistorySlopes { state, physics, signals }
    }

    /// Adds to the slopes `factor` times those by what the network has read so many steps after the start; rows that were measured have none.
    pub fn pull_network(&self, step: usize, [state, physics]: [&[T]; 2], factor: f64, slopes: &mut HistorySlopes) {
        for (read, width, slopes) in [(state, self.channels, &mut slopes.state), (physics, 6, &mut slopes.physics)] {
            // Row `history - 1 - step` of what was read is that of the start.
            let (skipped, first) = match (self.history - 1).checked_sub(step) {
                Some(measured) => (measured, 0),
                None => (0, step + 1 - self.history),
            };
            let read = read.iter().skip(skipped * width);
            slopes.iter_mut().skip(first * width).zip(read).for_each(|(slope, read)| *slope += factor * read.f64());
        }
    }

    /// The slopes of what is seen so many steps after the start, by the model's accelerations and by the inputs, once all that reads them has been
    /// pulled back. `says` are those by what the linear history says there, but for its way through the network.
    pub fn pull(&self, step: usize, says: PerChannel<f64>, slopes: &mut HistorySlopes) -> (PerChannel<f64>, Vec<f64>) {
        let scaling = &self.description.scaling;
        let by_row = &slopes.physics[step * 6..][..6];
        let physics = PerChannel::from_fn(|channel| by_row[channel.index()] / scaling.physics[channel].deviation);
        let of_state = slopes.state[step * self.channels..][..self.channels].iter();
        let mut inputs: Vec<f64> = of_state.zip(&scaling.state).map(|(slope, scale)| slope / scale.deviation).collect();
        if let Some(linear) = self.linear {
            let through = PerChannel::from_fn(|channel| says[channel] + physics[channel]);
            let count = linear.config().inputs.len();
            linear.pull(&through, &mut |lag, input, slope| {
                // What was measured has none.
                if let Some(row) = step.checked_sub(lag) {
                    slopes.signals[row * count + input] += slope;
                }
            });
            inputs.extend(&slopes.signals[step * count..][..count]);
        }
        (physics, inputs)
    }
}
