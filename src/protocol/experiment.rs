//! One run: divide, make worse where asked, calibrate, train, judge. No tables, and no order of runs.
//!
//! Nothing of the test part is seen before the judging: calibration, the search of the loop, scales and training all read the training
//! part, and the loop confirms what it finds on the validation part (or, where there is none, on every fifth run of training samples).

use super::method::Predictor;
use super::outcome::{Condition, Outcome, Trace, segments};
use super::plan::{Division, Plan, Run, Treatment};
use crate::critique::diagnose::{Amended, Diagnosis, Options, amend};
use crate::critique::{Row, centred_difference, finite_difference, ridge};
use crate::error::{Error, Result};
use crate::flight::split::{Part, Split};
use crate::flight::windows::windows;
use crate::flight::{Column, Flight, PerChannel, Span, Window};
use crate::hybrid::linear::LinearConfig;
use crate::hybrid::{Hybrid, Scale};
use crate::nn::Init;
use crate::physics::{Model, calibrate};
use crate::tape::Threads;
use crate::train::{Begun, Ended, Event, RunFolder, State, TrainConfig, Training};
use phyture_kernels::random::Stream;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Noise of the robustness rows, as a share of each column's standard deviation on the training part.
pub const NOISE_SHARE: f64 = 0.01;

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
    /// What the loop made of the model in each division: the same for every seed.
    amended: Mutex<BTreeMap<Division, (Model, Vec<String>)>>,
    /// What a person has to be told, in the order in which it came up.
    notes: Mutex<Vec<String>>,
}

/// A trained network, and what it took.
struct Trained {
    hybrid: Hybrid,
    parameters: usize,
    windows: usize,
    steps: u64,
}

/// What the training of a run is told and answers: share of its steps done; `false` stops it.
pub type GoOn<'a> = &'a mut dyn FnMut(f64) -> bool;

impl<'a> Experiment<'a> {
    /// The runs of `plan` on these flights.
    pub const fn new(plan: &'a Plan, flights: &'a [Flight], model: &'a Model, threads: Threads) -> Self {
        Self { plan, flights, model, threads, amended: Mutex::new(BTreeMap::new()), notes: Mutex::new(Vec::new()) }
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
        let judged = windows(&split.test, history, self.plan.settings.test_stride);
        if judged.is_empty() {
            return Err(Error::Undetermined(format!(
                "{run}: no stretch of test samples is as long as the history of {history} samples; shorten `network.history`"
            )));
        }
        let shown = if run.division == Division::Benchmark { self.trace_windows(&split, history) } else { Vec::new() };
        let predictor = run.method()?.predictor;
        let (model, effects) = self.physics(run, predictor, &split, go_on)?;
        let mut outcome = Outcome {
            run: run.clone(),
            parameters: 0,
            training_windows: 0,
            steps: 0,
            effects,
            conditions: BTreeMap::new(),
            trace: None,
        };
        let hybrid = match self.plan.training(run)? {
            Some(config) => {
                let trained = self.train(run, &config, &model, &split, working, go_on)?;
                (outcome.parameters, outcome.training_windows, outcome.steps) =
                    (trained.parameters, trained.windows, trained.steps);
                Some(trained.hybrid)
            }
            None => None,
        };
        let predict = |flights: &[Flight], windows: &[Window]| -> Result<Vec<PerChannel<f64>>> {
            let predicted = match (&hybrid, predictor) {
                (Some(hybrid), _) => hybrid.predict(flights, windows, self.threads)?,
                (None, Predictor::BackwardDifference) => finite_difference(flights, windows)?.predicted,
                (None, Predictor::CentredDifference) => centred_difference(flights, windows)?.predicted,
                (None, Predictor::Ridge) => self.ridge(&split, flights, windows)?.predicted,
                (None, _) => physics_at(&model, flights, windows)?,
            };
            if predicted.iter().flatten().all(|value| value.is_finite()) {
                return Ok(predicted);
            }
            Err(Error::Undetermined(format!("{run}: a prediction is not a finite number; lower `peak_rate`")))
        };
        let mut conditions = vec![Condition::Clean];
        if run.division == Division::Benchmark && run.treatment == Treatment::Plain {
            conditions.extend([Condition::StateNoise, Condition::ControlNoise]);
        }
        for condition in conditions {
            let disturbed = self.disturbed(condition, &split)?;
            let predicted = predict(disturbed.as_deref().unwrap_or(self.flights), &judged)?;
            outcome.conditions.insert(condition, segments(self.flights, &judged, &predicted));
        }
        if let Some(first) = shown.first() {
            outcome.trace = Some(self.trace(first.flight, &shown, &predict(self.flights, &shown)?));
        }
        Ok(outcome)
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
        let split = Split::new(self.flights, held_out, &data.split, settings.split_seed)?;
        Ok(match run.treatment {
            Treatment::TrainingShare(percent) => {
                split.with_less_training(self.flights, f64::from(percent) / 100.0, settings.split_seed)
            }
            _ => split,
        })
    }

    /// The physics of a run: calibrated on the training part, after the loop where it comes first; and what the loop added.
    fn physics(&self, run: &Run, predictor: Predictor, split: &Split, go_on: GoOn<'_>) -> Result<(Model, Vec<String>)> {
        let (model, effects) =
            if predictor.amended() { self.amended(run, split, go_on)? } else { (self.model.clone(), Vec::new()) };
        let mut model = calibrate(&model, self.flights, &split.training)?.0;
        if let Treatment::CoefficientsOff(percent) = run.treatment {
            let factor = 1.0 + f64::from(percent) / 100.0;
            for coefficient in model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients) {
                coefficient.value *= factor;
            }
        }
        Ok((model, effects))
    }

    /// The model with what the loop finds in the training part of a division, and the names of that.
    fn amended(&self, run: &Run, split: &Split, go_on: GoOn<'_>) -> Result<(Model, Vec<String>)> {
        // A poisoned lock holds what was complete before.
        let mut known = self.amended.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(amended) = known.get(&run.division) {
            return Ok(amended.clone());
        }
        let options = Options { seed: SEARCH_SEED, ..Options::default() };
        let Amended { rounds, model, .. } = amend(self.flights, self.model, &confirming(split), &options, &mut |_, _| {
            if go_on(0.0) { Ok(()) } else { Err(Error::Interrupted { saved: format!("the run `{run}` starts anew") }) }
        })?;
        let confirmed = rounds.into_iter().filter(Diagnosis::is_confirmed);
        let amended = (model, confirmed.flat_map(|round| round.accepted).collect());
        known.insert(run.division, amended.clone());
        Ok(amended)
    }

    fn train(
        &self,
        run: &Run,
        config: &TrainConfig,
        model: &Model,
        split: &Split,
        working: &Path,
        go_on: GoOn<'_>,
    ) -> Result<Trained> {
        let folder = RunFolder::create(working)?;
        // The key has everything in it that the data of a run depend on.
        let data = u64::from_str_radix(&self.plan.key(run)?, 16).expect("a key is sixteen hexadecimal digits");
        let state = self.resumed(run, config, data, &folder, working)?;
        let training = Training {
            flights: self.flights,
            split,
            model,
            config,
            data,
            folder: &folder,
            with_losses: false,
            threads: self.threads,
        };
        let mut steps = 1;
        let ended = training.run(state, &mut |event| {
            Ok(match event {
                Event::Begins(begun) => {
                    steps = begun.steps.max(1);
                    true
                }
                Event::Step(report) => go_on(report.step.step as f64 / steps as f64),
            })
        })?;
        match ended {
            Ended::Trained(trained) => {
                let Begun { parameters, windows, steps, .. } = trained.begun;
                Ok(Trained { hybrid: trained.hybrid, parameters, windows, steps })
            }
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

    fn ridge(&self, split: &Split, flights: &[Flight], judged: &[Window]) -> Result<Row> {
        let config = LinearConfig::default();
        let training = windows(&split.training, config.lags, 1);
        if std::ptr::eq(flights, self.flights) {
            return ridge(flights, &training, judged, &config);
        }
        // Fitted on what was recorded, judged on what is disturbed: both stand in one list.
        let both: Vec<Flight> = self.flights.iter().chain(flights).cloned().collect();
        let moved: Vec<Window> =
            judged.iter().map(|window| Window { flight: window.flight + self.flights.len(), ..*window }).collect();
        ridge(&both, &training, &moved, &config)
    }

    /// The flights with noise on their inputs; the targets stay. `None` where nothing is disturbed.
    fn disturbed(&self, condition: Condition, split: &Split) -> Result<Option<Vec<Flight>>> {
        let control = |column: &Column| matches!(column, Column::U1 | Column::U2 | Column::U3 | Column::U4);
        let wanted = match condition {
            Condition::Clean => return Ok(None),
            Condition::StateNoise => false,
            Condition::ControlNoise => true,
        };
        let deviation = |column: Column| {
            let recorded: Vec<&[f64]> = self.flights.iter().map(|flight| flight.column(column)).collect();
            NOISE_SHARE * Scale::of(&recorded, &split.training).deviation
        };
        let inputs = Column::STATE.iter().copied().filter(|column| control(column) == wanted);
        let deviations: Vec<(Column, f64)> = inputs.map(|column| (column, deviation(column))).collect();
        let noisy = |(index, flight): (usize, &Flight)| {
            flight.with_columns(|column| {
                let (_, deviation) = *deviations.iter().find(|(known, _)| *known == column && !flight.absent.contains(&column))?;
                let mut values = vec![0.0; flight.len()];
                let stream = Stream::new(self.plan.settings.split_seed, index as u64, column as u64, 0);
                Init::Normal { deviation }.fill::<f64>(stream, &[], &mut values);
                values.iter_mut().zip(flight.column(column)).for_each(|(noise, recorded)| *noise += recorded);
                Some(values)
            })
        };
        self.flights.iter().enumerate().map(noisy).collect::<Result<Vec<_>>>().map(Some)
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
