//! Open-loop prediction: from measured states, under the measured controls, a model is integrated forward.
//!
//! The state is position (north-east-down), attitude, velocity in body axes and body rates; its derivative is kinematics and the model's six
//! accelerations. Controls and further columns of the log are the measured ones, held over a step. What remembers (`lag`, `delay`, `rate`,
//! `slew`) has seen the measured flight up to the start and goes on from there on what is predicted; within a step it takes one sample, and
//! the later stages of the integration look ahead of it.
//!
//! Formulas are put together once; [`Rollout::roll`] can be asked again and again with other numbers. Starts go side by side as lanes, on
//! the threads of the pool that it is called in, with the same bits on any number. What errors mean, nothing here knows.

mod batch;
mod errors;
mod motion;
mod program;
mod walk;

pub(crate) use batch::Addition;
pub use batch::{MOST_RATE_RAD_S, MOST_SPEED_M_S, Rolled};
pub(crate) use errors::{HUBER, Measure, size};
pub(crate) use motion::{Motion, NUMBERS};
pub use motion::{State, has_position, recorded_states};
pub(crate) use program::Program;
pub(crate) use walk::{OnFlight, Walk, state_slopes};

use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::windows::windows;
use crate::flight::{Column, Flight, Span, Window};
use batch::Batch;
use program::{Prepared, check_lanes};

/// Steps of flights that are rolled out side by side may differ by this share (the tolerance of a log's own step).
const STEP_TOLERANCE: f64 = 0.01;

/// What the state is made of and a log has to have. Where it lacks the position, or the heading, only the change of these is predicted.
const STATE: [Column; 8] = [Column::Roll, Column::Pitch, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];

/// The value of a number of [`Rollout::numbers`], by its index there, in a flight, by its index.
pub type Numbers<'a> = &'a (dyn Fn(usize, usize) -> f64 + Sync);

/// What is done with the lanes of a batch.
pub type Each<'a, T> = &'a (dyn Fn(&Rolled) -> T + Sync);

/// A model to be integrated forward along some flights.
#[derive(Clone)]
pub struct Rollout<'a> {
    flights: &'a [Flight],
    horizon: usize,
    program: Program,
    numbers: Vec<(usize, usize)>,
    /// By number, then by flight.
    own: Vec<Vec<f64>>,
    hold_rates: bool,
}

/// Makes the addition for the lanes that start at some samples of a flight.
type Make<'a> = &'a (dyn Fn(usize, &[usize]) -> Result<Box<dyn Addition + 'a>> + Sync);

/// Formulas beside the model's, and what is made of them and added to its accelerations.
pub(crate) struct Further<'a> {
    /// The formulas.
    pub program: &'a Program,
    /// Most lanes at once.
    pub lanes: usize,
    /// Makes the addition for the lanes that start at these samples of a flight.
    pub addition: Make<'a>,
}

/// Starts on one flight, in order of time.
struct Run<'a> {
    starts: &'a [Window],
    model: Prepared,
    further: Option<Prepared>,
}

impl<'a> Rollout<'a> {
    /// Makes ready to roll a model out over `horizon` steps.
    ///
    /// # Errors
    /// [`Error::Config`] for a horizon of 0 or one longer than every flight, or flights of different steps; [`Error::Log`] where a flight lacks
    /// a part of the state; as [`Model::predict`] on each flight.
    pub fn new(model: &Model, flights: &'a [Flight], horizon: usize) -> Result<Self> {
        check_horizon(flights, horizon)?;
        for flight in flights {
            check_state(flight)?;
            model.predict(flight)?;
        }
        let program = Program::of_model(model)?;
        let numbers: Vec<(usize, usize)> = program.numbers.iter().map(|(free, _)| *free).collect();
        let own = |&(effect, number): &(usize, usize)| {
            let number = model.effects[effect].number(number).expect("a number of the model that was put together");
            flights.iter().map(|flight| number.in_flight(&flight.name)).collect()
        };
        Ok(Self { flights, horizon, own: numbers.iter().map(own).collect(), numbers, program, hold_rates: false })
    }

    /// The same with body rates that stay what they are at the start.
    #[must_use]
    pub fn with_rates_held(mut self) -> Self {
        self.hold_rates = true;
        self
    }

    /// The model's numbers: index of the effect, and of the number in it, coefficients before parameters.
    pub fn numbers(&self) -> &[(usize, usize)] {
        &self.numbers
    }

    /// The value of a number, by its index in [`Rollout::numbers`], that the model itself has in a flight.
    pub fn own(&self, number: usize, flight: usize) -> f64 {
        self.own[number][flight]
    }

    /// Steps of a rollout.
    pub const fn horizon(&self) -> usize {
        self.horizon
    }

    /// The flights.
    pub const fn flights(&self) -> &'a [Flight] {
        self.flights
    }

    /// Every `stride`-th possible start of all flights.
    pub fn starts(&self, stride: usize) -> Vec<Window> {
        let whole = |(flight, log): (usize, &Flight)| Span { flight, start: 0, end: log.len() };
        starts(&self.flights.iter().enumerate().map(whole).collect::<Vec<_>>(), 1, self.horizon, stride)
    }

    /// Rolls out from each start, the `last` sample of a window; `numbers` gives the values of the model's numbers, where they are not its own. What `each`
    /// makes of each batch of lanes comes back in the order of the starts. A batch holds consecutive starts of one flight.
    ///
    /// # Errors
    /// [`Error::Shape`] for a start without room for the horizon; [`Error::Config`] for a number that its operator cannot have.
    pub fn roll<T: Send>(&self, starts: &[Window], numbers: Option<Numbers<'_>>, each: Each<'_, T>) -> Result<Vec<T>> {
        self.roll_with(starts, numbers, None, each)
    }

    /// As [`Rollout::roll`], with what is added to the model's accelerations.
    pub(crate) fn roll_with<T: Send>(
        &self,
        starts: &[Window],
        numbers: Option<Numbers<'_>>,
        further: Option<&Further<'_>>,
        each: Each<'_, T>,
    ) -> Result<Vec<T>> {
        starts.iter().try_for_each(|start| self.check_start(start))?;
        let own: Numbers<'_> = &|number, flight| self.own[number][flight];
        let numbers = numbers.unwrap_or(own);
        let in_order: Vec<&[Window]> =
            starts.chunk_by(|left, right| left.flight == right.flight && left.last <= right.last).collect();
        let lanes = further.map_or(LANES, |further| further.lanes.min(LANES));
        let runs = map(in_order.len(), &|run| self.prepare(in_order[run], numbers, further, lanes));
        let runs: Vec<Run<'_>> = runs.into_iter().collect::<Result<_>>()?;
        let batches: Vec<(usize, usize, &[Window])> = runs
            .iter()
            .enumerate()
            .flat_map(|(run, of)| of.starts.chunks(lanes).enumerate().map(move |(batch, starts)| (run, batch, starts)))
            .collect();
        let rolled = map(batches.len(), &|index| {
            let (run, batch, starts) = batches[index];
            self.batch(&runs[run], batch, starts, further).map(|rolled| each(&rolled))
        });
        rolled.into_iter().collect()
    }

    /// Where each start leads: the states at the start and after each step, and the step at which it was stopped, if it was.
    ///
    /// # Errors
    /// As [`Rollout::roll`].
    pub fn trajectories(&self, starts: &[Window], numbers: Option<Numbers<'_>>) -> Result<Vec<(Vec<State>, Option<usize>)>> {
        let lane = |rolled: &Rolled, lane: usize| {
            ((0..=self.horizon).map(|step| rolled.state(lane, step)).collect::<Vec<_>>(), rolled.stopped[lane])
        };
        let batches = self.roll(starts, numbers, &|rolled| (0..rolled.lanes()).map(|at| lane(rolled, at)).collect::<Vec<_>>())?;
        Ok(batches.into_iter().flatten().collect())
    }

    fn check_start(&self, start: &Window) -> Result<()> {
        let room = self.flights.get(start.flight).is_some_and(|flight| start.last + self.horizon < flight.len());
        if room {
            return Ok(());
        }
        let message = format!("sample {} of flight {} has no {} samples after it", start.last, start.flight, self.horizon);
        Err(Error::Shape { operation: "rollout", message })
    }

    fn prepare<'s>(
        &self,
        starts: &'s [Window],
        numbers: Numbers<'_>,
        further: Option<&Further<'_>>,
        lanes: usize,
    ) -> Result<Run<'s>> {
        let index = starts[0].flight;
        let flight = &self.flights[index];
        let end = starts[starts.len() - 1].last + self.horizon;
        let cuts: Vec<usize> = starts.chunks(lanes).map(|batch| batch[0].last).collect();
        let place = |symbol| self.program.numbers.iter().position(|(_, own)| *own == symbol);
        let model = self.program.on(flight, end, &cuts, &|symbol| Some(numbers(place(symbol)?, index)))?;
        check_lanes(&model, lanes)?;
        let further = further.map(|further| further.program.on(flight, end, &cuts, &|_| None)).transpose()?;
        further.as_ref().map_or(Ok(()), |further| check_lanes(further, lanes))?;
        Ok(Run { starts, model, further })
    }

    fn batch(&self, run: &Run<'_>, batch: usize, starts: &[Window], further: Option<&Further<'_>>) -> Result<Rolled> {
        let index = starts[0].flight;
        let flight = &self.flights[index];
        let samples: Vec<usize> = starts.iter().map(|start| start.last).collect();
        let angles = self.program.reads_angles() || further.is_some_and(|further| further.program.reads_angles());
        let addition = further.map(|further| (further.addition)(index, &samples)).transpose()?;
        let batch = Batch {
            flight,
            model: run.model.lanes(flight, batch, &samples)?,
            further: run.further.as_ref().map(|further| further.lanes(flight, batch, &samples)).transpose()?,
            replaces: addition.as_ref().map(|addition| addition.replaces()),
            addition,
            starts: samples,
            angles,
            hold_rates: self.hold_rates,
        };
        batch.run(index, self.horizon)
    }
}

/// Lanes of a batch: what every machine takes at once.
const LANES: usize = 64;

/// Every `stride`-th start in some spans: with `history` rows up to it, itself included, one more than itself at least, and `horizon` rows after it,
/// all inside one span.
pub fn starts(spans: &[Span], history: usize, horizon: usize, stride: usize) -> Vec<Window> {
    let short = |span: &Span| Span { end: span.end.saturating_sub(horizon).max(span.start), ..*span };
    windows(&spans.iter().map(short).collect::<Vec<_>>(), history.max(2), stride)
}

/// Refuses flights that lack a part of the state.
fn check_state(flight: &Flight) -> Result<()> {
    let Some(column) = STATE.iter().find(|column| flight.absent.contains(column)) else { return Ok(()) };
    Err(Error::Log {
        path: (&flight.name).into(),
        found: format!("no column `{}`", column.name()),
        expected: "attitude, velocity and rates, from which a rollout starts and which it is judged by".into(),
    })
}

/// Refuses a horizon that no flight has, and flights of different steps.
pub(crate) fn check_horizon(flights: &[Flight], horizon: usize) -> Result<()> {
    let fault = |place: String, field: &str, found: String, expected: String| {
        Err(Error::Config { place, field: field.into(), found, expected })
    };
    if horizon == 0 {
        return fault("rollout".into(), "horizon", "0".into(), "at least 1 step".into());
    }
    let Some(longest) = flights.iter().max_by_key(|flight| flight.len()) else {
        return fault("rollout".into(), "flights", "none".into(), "at least one flight".into());
    };
    if longest.len() < horizon + 2 {
        let most = longest.len().saturating_sub(2);
        let expected = format!("at most {most}: the longest flight, `{}`, has {} samples", longest.name, longest.len());
        return fault("rollout".into(), "horizon", format!("{horizon} steps"), expected);
    }
    let step_s = flights[0].step_s;
    match flights.iter().find(|flight| (flight.step_s / step_s - 1.0).abs() > STEP_TOLERANCE) {
        None => Ok(()),
        Some(other) => fault(
            format!("flight `{}`", other.name),
            "step",
            format!("{} s", other.step_s),
            format!(
                "the {step_s} s of flight `{}`, as errors are told by step; set `resample_hz` in dataset.toml",
                flights[0].name
            ),
        ),
    }
}

/// `of` for 0 … `count` − 1, in order, on the threads there are.
fn map<T: Send>(count: usize, of: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().with_max_len(1).map(of).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        (0..count).map(of).collect()
    }
}

#[cfg(test)]
mod tests;
