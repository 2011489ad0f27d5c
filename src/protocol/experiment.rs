//! One run: divide, make worse where asked, calibrate, train, judge. No tables, and no order of runs.
//!
//! Nothing of the test part is seen before the judging: calibration, the search of the loop, scales and training all read the training
//! part, and the loop confirms what it finds on the validation part (or, where there is none, on every fifth run of training samples). The best
//! epoch and the learning rate are chosen on the validation part.

use super::method::Predictor;
use super::outcome::{Outcome, Trace, segments};
use super::plan::{Division, Plan, Run, Treatment, noise};
use crate::critique::diagnose::{Amended, Options, amend};
use crate::critique::{Row, centred_difference, explainable_at, finite_difference, ridge};
use crate::disk::write_atomically;
use crate::error::{Error, Result};
use crate::flight::split::{Part, SEGMENT_S, STRETCH_S, Split};
use crate::flight::windows::{counted, windows};
use crate::flight::{Column, Flight, PerChannel, Span, Window};
use crate::hybrid::Hybrid;
use crate::hybrid::linear::LinearConfig;
use crate::nn::Init;
use crate::physics::{Model, calibrate};
use crate::tape::Threads;
use crate::train::{Begun, Ended, Event, RunFolder, State, TrainConfig, Trained, Training, diverges_in};
use phyture_kernels::random::Stream;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Samples between the points of a trace.
const TRACE_STRIDE: usize = 4;

/// Points of a trace at most: ten seconds at 100 Hz.
const TRACE_POINTS: usize = 250;

/// The class whose curves the paper shows (figures 7 and 8).
const TRACE_CLASS: &str = "turn_demos1";

/// Of so many runs of training samples one confirms what the loop found, where there is no validation part.
const CONFIRMING: usize = 5;

/// Seed of the search of the loop.
const SEARCH_SEED: u64 = 1;

/// What every run of a plan reads.
pub struct Experiment<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The flights.
    pub flights: &'a [Flight],
    /// The model as it was given.
    pub model: &'a Model,
    /// Threads of a run.
    pub threads: Threads,
    /// The explainable part of the flights, where it is known: for the floor alone.
    pub explainable: Option<&'a [Flight]>,
    /// Where models that the loop has amended are kept: searched once for all seeds.
    amended: PathBuf,
    /// What a person has to be told, in the order in which it came up.
    notes: Mutex<Vec<String>>,
}

/// Numbers of windows of a run, and the time that its training part takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Windows that train.
    pub training: usize,
    /// Windows that validate.
    pub validation: usize,
    /// Windows that are judged.
    pub test: usize,
    /// Length of the training part, s.
    pub training_s: f64,
}

/// What a training of a run works in.
struct Ground<'g> {
    run: &'g Run,
    flights: &'g [Flight],
    model: &'g Model,
    split: &'g Split,
    working: &'g Path,
}

/// What the training of a run is told and answers: share of its steps done; `false` stops it.
pub type GoOn<'a> = &'a mut dyn FnMut(f64) -> bool;

/// What becomes of a training that diverges.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Divergence {
    /// It goes on to its end: there is nothing else to take.
    Borne,
    /// It stops, and one at a slower rate is taken.
    Stops,
}

/// One training at a rate, in a folder of this name.
type AtRate<'a, T> = dyn FnMut(f64, &str, Divergence) -> Result<Option<T>> + 'a;

/// The training at the chosen one of `rates`, or at the fastest of the slower ones at which it does not diverge, and the rate; at `plain` where none was
/// chosen. The slowest is taken however it goes.
fn at_slower<T>(rates: &[f64], chosen: Option<f64>, plain: f64, at: &mut AtRate<'_, T>) -> Result<(T, f64)> {
    let mut left: Vec<f64> = match chosen {
        Some(chosen) => rates.iter().copied().filter(|rate| *rate <= chosen).collect(),
        None => vec![plain],
    };
    left.sort_by(|one, other| other.total_cmp(one));
    for (index, rate) in left.iter().enumerate() {
        let divergence = if index + 1 < left.len() { Divergence::Stops } else { Divergence::Borne };
        let name = if index == 0 { String::new() } else { format!("slower-{index}") };
        match at(*rate, &name, divergence) {
            Ok(Some(trained)) => return Ok((trained, *rate)),
            Ok(None) => {}
            // Not even numbers come out.
            Err(Error::Undetermined(_)) if divergence == Divergence::Stops => {}
            Err(other) => return Err(other),
        }
    }
    unreachable!("the last training does not stop")
}

impl<'a> Experiment<'a> {
    /// The runs of `plan` on these flights; models that the loop amends are kept in the folder `amended`, which exists.
    pub fn new(plan: &'a Plan, flights: &'a [Flight], model: &'a Model, threads: Threads, amended: impl Into<PathBuf>) -> Self {
        Self { plan, flights, model, threads, explainable: None, amended: amended.into(), notes: Mutex::new(Vec::new()) }
    }

    /// What has come up in the runs since this was asked for last, for a person: each once.
    pub fn take_notes(&self) -> Vec<String> {
        std::mem::take(&mut *self.notes.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Makes one run. Its checkpoints are in `working`, from which an interrupted run goes on; the caller removes it afterwards.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `go_on` said no; [`Error::Undetermined`] if the data hold too little for a division, training diverged
    /// or a prediction is not finite; otherwise what the parts give.
    pub fn run(&self, run: &Run, working: &Path, go_on: GoOn<'_>) -> Result<Outcome> {
        let split = self.split(run)?;
        let history = self.plan.settings.phyture()?.history;
        let judged = self.judged(&split)?;
        if judged.is_empty() {
            return Err(Error::Undetermined(format!(
                "{run}: no stretch of test samples is as long as the history of {history} samples; shorten `network.history`"
            )));
        }
        let is_shown = run.division == Division::Benchmark && run.treatment == Treatment::Plain;
        let shown = if is_shown { self.trace_windows(&split, history) } else { Vec::new() };
        let predictor = run.method()?.predictor;
        let flights = self.treated(run.treatment)?;
        let (model, effects) = self.physics(run, predictor, &flights, &split, go_on)?;
        let mut outcome = Outcome {
            run: run.clone(),
            parameters: 0,
            training_windows: 0,
            steps: 0,
            effects,
            peak_rate: None,
            curve: Vec::new(),
            epoch: 0,
            segments: Vec::new(),
            trace: None,
        };
        let ground = Ground { run, flights: &flights, model: &model, split: &split, working };
        let hybrid = match self.plan.training(run)? {
            Some(config) => Some(self.train(&ground, config, &mut outcome, go_on)?),
            None => None,
        };
        let predict = |windows: &[Window]| -> Result<Vec<PerChannel<f64>>> {
            let predicted = match (&hybrid, predictor) {
                (Some(hybrid), _) => hybrid.predict(&flights, windows, self.threads)?,
                (None, Predictor::BackwardDifference) => finite_difference(&flights, windows)?.predicted,
                (None, Predictor::CentredDifference) => centred_difference(&flights, windows)?.predicted,
                (None, Predictor::Ridge { windows: networks }) => self.ridge(&flights, &split, windows, networks)?.predicted,
                (None, Predictor::Floor) => self.floor(windows)?.predicted,
                (None, _) => physics_at(&model, &flights, windows)?,
            };
            if predicted.iter().flatten().all(|value| value.is_finite()) {
                return Ok(predicted);
            }
            Err(Error::Undetermined(format!("{run}: a prediction is not a finite number; lower `peak_rate`")))
        };
        outcome.segments = segments(&flights, &judged, &predict(&judged)?);
        if let Some(first) = shown.first() {
            outcome.trace = Some(self.trace(first.flight, &shown, &predict(&shown)?));
        }
        Ok(outcome)
    }

    /// How much there is for a run to do.
    ///
    /// # Errors
    /// As [`Split::new`].
    pub fn extent(&self, run: &Run) -> Result<Extent> {
        let split = self.split(run)?;
        let (history, stride) = (self.plan.settings.phyture()?.history, self.plan.settings.training.stride);
        Ok(Extent {
            training: counted(self.flights, windows(&split.training, history, stride)).len(),
            validation: counted(self.flights, windows(&split.validation, history, stride)).len(),
            test: self.judged(&split)?.len(),
            training_s: split.training.iter().map(|span| (span.end - span.start) as f64 * self.plan.step_s).sum(),
        })
    }

    /// Windows that are judged: where the division gives every stretch a lead, the same samples whatever the history.
    fn judged(&self, split: &Split) -> Result<Vec<Window>> {
        let lead = (self.model.data.split.lead_s() / self.plan.step_s).round() as usize;
        let history = self.plan.settings.phyture()?.history;
        Ok(counted(self.flights, windows(&split.test, history.max(lead), self.plan.settings.test_stride)))
    }

    /// The division of a run, with less to train on where the treatment says so.
    fn split(&self, run: &Run) -> Result<Split> {
        let settings = &self.plan.settings;
        let data = &self.model.data;
        let held_out = match run.division {
            Division::Benchmark => &data.locked,
            Division::Fold(fold) => self.plan.folds.get(fold).ok_or_else(|| Error::Config {
                place: "plan".into(),
                field: "fold".into(),
                found: (fold + 1).to_string(),
                expected: format!("1 to {}", self.plan.folds.len()),
            })?,
        };
        let mut split = Split::new(self.flights, held_out, &data.split, settings.split_seed)?;
        if split.validation.is_empty() && settings.chooses_on_validation() {
            let length_s = if data.split.lead_s() > 0.0 { STRETCH_S } else { SEGMENT_S };
            split = split.with_validation(self.flights, length_s, settings.split_seed);
        }
        Ok(match run.treatment {
            Treatment::TrainingShare(percent) => {
                split.with_less_training(self.flights, f64::from(percent) / 100.0, settings.split_seed)
            }
            _ => split,
        })
    }

    /// The physics of a run: calibrated on the training part, after the loop where it comes first; and what the loop added.
    fn physics(
        &self,
        run: &Run,
        predictor: Predictor,
        flights: &[Flight],
        split: &Split,
        go_on: GoOn<'_>,
    ) -> Result<(Model, Vec<String>)> {
        let model = if predictor.amended() { self.amended(run, flights, split, go_on)? } else { self.model.clone() };
        let is_new = |name: &String| self.model.effect(name).is_none();
        let effects = model.effects.iter().map(|effect| effect.name.clone()).filter(is_new).collect();
        let mut model = calibrate(&model, flights, &split.training)?.0;
        if let Treatment::CoefficientsOff(percent) = run.treatment {
            let factor = 1.0 + f64::from(percent) / 100.0;
            for coefficient in model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients) {
                coefficient.value *= factor;
            }
        }
        Ok((model, effects))
    }

    /// The model with what the loop finds in the training part of a division: from its file, or searched and written there.
    fn amended(&self, run: &Run, flights: &[Flight], split: &Split, go_on: GoOn<'_>) -> Result<Model> {
        let path = self.amended.join(format!("{}.toml", self.plan.amended_key(run)?));
        if path.exists() {
            return Model::read(&path);
        }
        let options = Options { seed: SEARCH_SEED, ..Options::default() };
        let Amended { model, .. } = amend(flights, self.model, &confirming(split), &options, &mut |_, _| {
            if go_on(0.0) { Ok(()) } else { Err(Error::Interrupted { saved: format!("the run `{run}` starts anew") }) }
        })?;
        let text = model.to_toml()?;
        write_atomically(&path, |file| file.write_all(text.as_bytes()))?;
        // What was written is what every later run reads.
        Model::read(&path)
    }

    /// Trains the network of a run, at the learning rate of the plan or at the best of several.
    fn train(&self, ground: &Ground<'_>, config: TrainConfig, outcome: &mut Outcome, go_on: GoOn<'_>) -> Result<Hybrid> {
        let (rates, epochs) = self.plan.settings.rate_budget();
        let whole = (rates.len() * epochs + config.epochs) as f64;
        let mut best: Option<(f64, f64)> = None;
        for (index, &peak_rate) in rates.iter().enumerate() {
            let tried = TrainConfig { peak_rate, epochs, keep_best: true, ..config.clone() };
            let part = |share: f64| (index as f64 + share) * epochs as f64 / whole;
            let name = format!("rate-{index}");
            match self.trained(ground, &tried, &name, Divergence::Borne, &mut |share| go_on(part(share))) {
                Ok(None) => {}
                Ok(Some(trained)) => {
                    let loss = trained.curve.iter().filter_map(|epoch| epoch.validation).fold(f64::INFINITY, f64::min);
                    best = best.filter(|(_, least)| *least <= loss).or(Some((peak_rate, loss)));
                }
                // Too fast a rate may diverge: then it is not the best.
                Err(Error::Undetermined(_)) => {}
                Err(other) => return Err(other),
            }
        }
        let before = (rates.len() * epochs) as f64;
        let part = |share: f64| (before + share * config.epochs as f64) / whole;
        let mut at = |peak_rate: f64, name: &str, divergence: Divergence| {
            let config = TrainConfig { peak_rate, ..config.clone() };
            self.trained(ground, &config, name, divergence, &mut |share| go_on(part(share)))
        };
        let (trained, rate) = at_slower(rates, best.map(|(rate, _)| rate), config.peak_rate, &mut at)?;
        outcome.peak_rate = best.map(|_| rate);
        let Trained { hybrid, begun, curve, epoch, .. } = trained;
        let Begun { parameters, windows, steps, .. } = begun;
        (outcome.parameters, outcome.training_windows, outcome.steps) = (parameters, windows, steps);
        (outcome.curve, outcome.epoch) = (curve, epoch + 1);
        Ok(hybrid)
    }

    /// One training, in a folder of its own below the run's. One that has come to its end is not done again. None if it diverged, where it is to stop then.
    fn trained(
        &self,
        ground: &Ground<'_>,
        config: &TrainConfig,
        name: &str,
        divergence: Divergence,
        go_on: GoOn<'_>,
    ) -> Result<Option<Trained>> {
        let Ground { run, flights, model, split, working } = *ground;
        let working = if name.is_empty() { working.to_path_buf() } else { working.join(name) };
        let folder = RunFolder::create(&working)?;
        // The key has everything in it that the data of a run depend on.
        let data = u64::from_str_radix(&self.plan.key(run)?, 16).expect("a key is sixteen hexadecimal digits");
        // What is damaged is kept beside the run's folder, whichever of its trainings it is of.
        let state = self.resumed(run, config, data, &folder, ground.working)?;
        let training = Training { flights, split, model, config, data, folder: &folder, with_losses: false, threads: self.threads };
        let mut steps = 1;
        let mut losses: Vec<f64> = state.iter().flat_map(|state| &state.curve).map(|epoch| epoch.training).collect();
        let stops = |losses: &[f64]| divergence == Divergence::Stops && diverges_in(losses.iter().copied()).is_some();
        if stops(&losses) {
            return Ok(None);
        }
        let ended = training.run(state, &mut |event| {
            Ok(match event {
                Event::Begins(begun) => {
                    steps = begun.steps.max(1);
                    true
                }
                Event::Step(report) => {
                    losses.extend(report.epoch_ended.iter().map(|epoch| epoch.training));
                    !stops(&losses) && go_on(report.step.step as f64 / steps as f64)
                }
            })
        })?;
        match ended {
            Ended::Trained(_) if stops(&losses) => Ok(None),
            Ended::Trained(trained) => Ok(Some(*trained)),
            Ended::Stopped { .. } if stops(&losses) => Ok(None),
            Ended::Stopped { done, steps } => {
                Err(Error::Interrupted { saved: format!("the run `{run}` goes on from step {done} of {steps}") })
            }
        }
    }

    /// The state in which an interrupted run was left, if there is one. A checkpoint that cannot be gone on with is kept beside the run's
    /// folder, which goes when the run is at its end, and noted: the run begins anew.
    fn resumed(&self, run: &Run, config: &TrainConfig, data: u64, folder: &RunFolder, working: &Path) -> Result<Option<State>> {
        let path = folder.checkpoint();
        if !path.exists() {
            return Ok(None);
        }
        let message = match folder.resume(config, data) {
            Ok(state) => return Ok(Some(state)),
            Err(Error::File { message, .. }) => message,
            Err(other) => return Err(other),
        };
        let name = working.file_name().unwrap_or_default().to_string_lossy();
        let numbered = (1_u32..).map(|number| working.with_file_name(format!("{name}.damaged-checkpoint-{number}")));
        let kept = numbered.into_iter().find(|path| !path.exists()).expect("a folder has fewer files than there are numbers");
        std::fs::rename(&path, &kept).map_err(Error::io(&path))?;
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(format!(
            "note: {} {message}; it is kept as {}, and the run `{run}` begins anew",
            path.display(),
            kept.display()
        ));
        Ok(None)
    }

    fn ridge(&self, flights: &[Flight], split: &Split, judged: &[Window], networks: bool) -> Result<Row> {
        let settings = &self.plan.settings;
        if !networks {
            let config = LinearConfig::default();
            return ridge(flights, &counted(flights, windows(&split.training, config.lags, 1)), judged, &config);
        }
        let inputs = settings.training.inputs.clone();
        let training = counted(flights, windows(&split.training, settings.phyture()?.history, settings.training.stride));
        // Of few windows no more rows than they determine.
        let most = training.len().saturating_sub(1) / inputs.len().max(1);
        let config = LinearConfig { lags: LinearConfig::default().lags.min(most).max(1), inputs };
        ridge(flights, &training, judged, &config)
    }

    fn floor(&self, judged: &[Window]) -> Result<Row> {
        let missing = || Error::Undetermined("there is a floor only where the explainable part of the flights is known".into());
        explainable_at(self.flights, judged, self.explainable.ok_or_else(missing)?)
    }

    /// The flights with noise on their inputs, where the treatment is that; the targets stay.
    fn treated(&self, treatment: Treatment) -> Result<Cow<'_, [Flight]>> {
        let control = |column: Column| matches!(column, Column::U1 | Column::U2 | Column::U3 | Column::U4);
        let of_controls = match treatment {
            Treatment::StateNoise => false,
            Treatment::ControlNoise => true,
            _ => return Ok(Cow::Borrowed(self.flights)),
        };
        let noisy = |(index, flight): (usize, &Flight)| {
            flight.with_columns(|column| {
                let is_one = Column::STATE.contains(&column) && control(column) == of_controls && !flight.absent.contains(&column);
                let deviation = Some(noise(column)).filter(|deviation| is_one && *deviation > 0.0)?;
                let mut values = vec![0.0; flight.len()];
                let stream = Stream::new(self.plan.settings.split_seed, index as u64, column as u64, 0);
                Init::Normal { deviation }.fill::<f64>(stream, &[], &mut values);
                values.iter_mut().zip(flight.column(column)).for_each(|(noise, recorded)| *noise += recorded);
                Some(values)
            })
        };
        self.flights.iter().enumerate().map(noisy).collect::<Result<Vec<_>>>().map(Cow::Owned)
    }

    /// Windows of the longest stretch of test samples, of the class whose curves the paper shows if it is there.
    fn trace_windows(&self, split: &Split, history: usize) -> Vec<Window> {
        let of_class = |span: &&Span| self.flights[span.flight].manoeuvre == TRACE_CLASS;
        let length = |span: &&Span| (span.end - span.start, std::cmp::Reverse(**span));
        let longest = split.test.iter().filter(of_class).max_by_key(length);
        let longest = longest.filter(|span| span.end - span.start >= 2 * history).or_else(|| split.test.iter().max_by_key(length));
        let mut all = longest.map_or_else(Vec::new, |span| windows(std::slice::from_ref(span), history, TRACE_STRIDE));
        all.truncate(TRACE_POINTS);
        all
    }

    fn trace(&self, flight: usize, shown: &[Window], predicted: &[PerChannel<f64>]) -> Trace {
        let log = &self.flights[flight];
        Trace {
            flight: log.name.clone(),
            time_s: shown.iter().map(|window| log.time_s(window.last)).collect(),
            measured: PerChannel::from_fn(|channel| shown.iter().map(|window| log.column(channel.column())[window.last]).collect()),
            predicted: PerChannel::from_fn(|channel| predicted.iter().map(|values| values[channel]).collect()),
        }
    }
}

/// What the loop may see: the training part searches; the validation part confirms, or every fifth run of training samples.
fn confirming(split: &Split) -> Split {
    let (test, training) = if split.validation.is_empty() {
        let numbered = || split.training.iter().copied().enumerate();
        let confirms = |index: usize| index % CONFIRMING == CONFIRMING - 1;
        (
            numbered().filter(|(index, _)| confirms(*index)).map(|(_, span)| span).collect(),
            numbered().filter(|(index, _)| !confirms(*index)).map(|(_, span)| span).collect(),
        )
    } else {
        (split.validation.clone(), split.training.clone())
    };
    Split { training, validation: Vec::new(), test, tested: Part::Test }
}

fn physics_at(model: &Model, flights: &[Flight], windows: &[Window]) -> Result<Vec<PerChannel<f64>>> {
    let columns = flights.iter().map(|flight| model.predict(flight)).collect::<Result<Vec<_>>>()?;
    let at = |window: &Window| PerChannel::from_fn(|channel| columns[window.flight][channel][window.last]);
    Ok(windows.iter().map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_it_diverges_the_next_slower_rate_is_taken_and_the_slowest_however_it_goes() -> Result<()> {
        type Seen = Vec<(f64, String, bool)>;
        let tried = |chosen: Option<f64>, fastest_that_holds: f64| -> Result<(f64, Seen)> {
            let mut seen = Vec::new();
            let mut at = |rate: f64, name: &str, divergence: Divergence| {
                seen.push((rate, name.to_owned(), divergence == Divergence::Stops));
                let holds = rate <= fastest_that_holds || divergence == Divergence::Borne;
                Ok(holds.then_some(()))
            };
            let ((), rate) = at_slower(&[3e-4, 3e-3, 1e-3], chosen, 5e-3, &mut at)?;
            Ok((rate, seen))
        };
        let (rate, seen) = tried(Some(3e-3), 3e-3)?;
        assert!(rate == 3e-3 && seen == [(3e-3, String::new(), true)], "{seen:?}");
        let (rate, seen) = tried(Some(3e-3), 1e-3)?;
        assert!(rate == 1e-3 && seen.len() == 2 && seen[1].1 == "slower-1", "{seen:?}");
        let (rate, seen) = tried(Some(3e-3), 0.0)?;
        assert!(rate == 3e-4 && !seen[2].2, "{seen:?}");
        let (rate, seen) = tried(Some(1e-3), 1.0)?;
        assert!(rate == 1e-3 && seen.len() == 1, "{seen:?}");
        let (rate, seen) = tried(None, 0.0)?;
        assert!(rate == 5e-3 && seen == [(5e-3, String::new(), false)], "{seen:?}");
        // An error that says that numbers ran away counts; others end the run.
        let mut failing = |rate: f64, _: &str, _: Divergence| {
            if rate > 1e-3 { Err(Error::Undetermined("not finite".into())) } else { Ok(Some(())) }
        };
        assert_eq!(at_slower(&[1e-3, 3e-3], Some(3e-3), 0.0, &mut failing)?.1, 1e-3);
        let mut stopped = |_: f64, _: &str, _: Divergence| Err::<Option<()>, _>(Error::Interrupted { saved: "it".into() });
        assert!(matches!(at_slower(&[1e-3, 3e-3], Some(3e-3), 0.0, &mut stopped), Err(Error::Interrupted { .. })));
        Ok(())
    }
}
