//! Training as a user meets it: a resumed run is the run that was not interrupted, a killed one loses little and breaks
//! nothing, the hybrid's file and its stream say what its batch prediction says.
#![cfg(all(feature = "files", feature = "sim"))]

use phyture::flight::split::{Protocol, Split};
use phyture::flight::windows::windows;
use phyture::flight::{Channel, DataSet, PerChannel, Window};
use phyture::hybrid::linear::LinearConfig;
use phyture::hybrid::{Description, Hybrid, sequence};
use phyture::nn::PhyTureConfig;
use phyture::nn::safetensors::{Numbers, SafeTensors, Tensor};
use phyture::physics::{Model, calibrate};
use phyture::sim::{Simulation, simulate};
use phyture::tape::Threads;
use phyture::train::{Outcome, RolloutConfig, RunFolder, State, TrainConfig, Trainer};
use phyture::{Error, Result};

/// Any number; it tells one set of training data from another.
const DATA: u64 = 7;

struct Job {
    set: DataSet,
    config: TrainConfig,
    description: Description,
    windows: Vec<Window>,
    validation: Vec<Window>,
}

fn simulated() -> Result<DataSet> {
    simulate(&Simulation { minutes: 2.0, seed: 3, ..Simulation::default() })
}

fn paper() -> Model {
    Model::paper("truth", 4.58, [0.18, 0.34, 0.28], 0.8)
}

/// A Phy-Ture of 16 samples of history that trains in seconds.
fn small(inputs: usize) -> PhyTureConfig {
    PhyTureConfig {
        history: 16,
        d_model: 8,
        heads: 2,
        levels: 2,
        stacks: 1,
        moving_average: 5,
        state_channels: inputs,
        ..PhyTureConfig::default()
    }
}

fn job() -> Result<Job> {
    job_of(simulated()?, &paper(), TrainConfig::default().inputs, LinearConfig { lags: 3, ..LinearConfig::default() })
}

fn job_of(set: DataSet, model: &Model, inputs: Vec<String>, linear: LinearConfig) -> Result<Job> {
    let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
    let (model, _) = calibrate(model, &set.flights, &split.training)?;
    let network = small(inputs.len());
    let config = TrainConfig {
        network: network.into(),
        linear: Some(linear.clone()),
        epochs: 3,
        stride: 40,
        batch: 16,
        seed: 5,
        inputs,
        ..TrainConfig::default()
    };
    let linear = sequence::linear(&set.flights, &split.training, &model, &linear)?;
    let description = Description {
        envelope: None,
        intervals: None,
        scaling: sequence::scaling(&set.flights, &split.training, &model, &config.inputs, Some(&linear), &config.network)?,
        model,
        config: config.network.clone(),
        inputs: config.inputs.clone(),
        linear: Some(linear),
        gate: PerChannel::splat(1.0),
        step_s: 0.01,
    };
    let [windows, validation] = [&split.training, &split.validation].map(|part| windows(part, 16, config.stride));
    Ok(Job { set, config, description, windows, validation })
}

/// Trains in `folder` from `state`, stopping after `stop` steps if it is given.
fn train(job: &Job, folder: &RunFolder, state: Option<State>, threads: usize, stop: Option<u64>) -> Result<(Outcome, State)> {
    let network = job.description.network(false)?;
    let sequences = sequence::sequences(&job.set.flights, &job.description)?;
    let trainer = Trainer::new(&job.config, &network, &sequences, &job.windows, state, Threads(threads))?;
    let mut trainer = trainer.with_validation(&job.validation);
    let outcome = folder.train(&job.config, DATA, &mut trainer, &mut |report| stop != Some(report.step.step))?;
    Ok((outcome, trainer.state().clone()))
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn a_resumed_run_is_the_uninterrupted_one_bit_for_bit_on_any_number_of_threads() -> Result<()> {
    let job = job()?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let whole = RunFolder::create(place.path().join("whole"))?;
    let (outcome, uninterrupted) = train(&job, &whole, None, 1, None)?;
    assert_eq!(outcome, Outcome::Finished);
    let parts = RunFolder::create(place.path().join("parts"))?;
    let mut last = train(&job, &parts, None, 2, Some(3))?;
    assert_eq!(last.0, Outcome::Stopped);
    for stop in [7, 8, u64::MAX] {
        last = train(&job, &parts, Some(parts.resume(&job.config, DATA)?), 2, Some(stop))?;
    }
    assert_eq!(last.0, Outcome::Finished);
    assert_eq!(last.1.step, uninterrupted.step);
    for (one, other) in [
        (&last.1.parameters, &uninterrupted.parameters),
        (&last.1.first_moment, &uninterrupted.first_moment),
        (&last.1.second_moment, &uninterrupted.second_moment),
    ] {
        assert_eq!(bits(one), bits(other));
    }
    // The losses on the validation part are those of the uninterrupted run, too: one at the end of each epoch.
    let (first, second) = (metrics(&place.path().join("whole"))?, metrics(&place.path().join("parts"))?);
    assert_eq!(first, second);
    let epoch = job.windows.len().div_ceil(job.config.batch);
    assert_eq!(first.len(), 3 * epoch);
    for (index, line) in first.iter().enumerate() {
        assert_eq!(line.get("validation_loss").is_some(), (index + 1) % epoch == 0, "{line}");
    }
    // And they change nothing of what is learned.
    let alone = RunFolder::create(place.path().join("alone"))?;
    let (_, alone) = train(&Job { validation: Vec::new(), ..job }, &alone, None, 2, None)?;
    assert_eq!(bits(&alone.parameters), bits(&uninterrupted.parameters));
    Ok(())
}

#[test]
fn the_best_epoch_is_kept_whatever_comes_after_it_and_wherever_the_run_was_stopped() -> Result<()> {
    let mut job = job()?;
    job.config.keep_best = true;
    // So fast that a later epoch may undo what an earlier one learned; with which seed it does is a matter of the last bits.
    (job.config.peak_rate, job.config.epochs) = (0.3, 6);
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let mut ended_badly = None;
    for seed in 1..=20 {
        job.config.seed = seed;
        let (_, whole) = train(&job, &RunFolder::create(place.path().join(format!("whole {seed}")))?, None, 1, None)?;
        if whole.best.as_ref().is_some_and(|best| best.epoch < 5) {
            ended_badly = Some(whole);
            break;
        }
    }
    let whole = ended_badly.expect("one of twenty trainings as fast as this ends worse than it was");
    let parts = RunFolder::create(place.path().join("parts"))?;
    train(&job, &parts, None, 2, Some(whole.step / 2 + 1))?;
    let (_, resumed) = train(&job, &parts, Some(parts.resume(&job.config, DATA)?), 2, None)?;
    assert_eq!(whole, resumed, "losses and best weights, too");
    let losses: Vec<f64> = whole.curve.iter().filter_map(|epoch| epoch.validation).collect();
    let best = whole.best.clone().ok_or(Error::Undetermined("no best epoch".into()))?;
    let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!((losses.len(), losses[best.epoch], best.loss), (6, least, least), "{losses:?}");
    let network = job.description.network(false)?;
    let sequences = sequence::sequences(&job.set.flights, &job.description)?;
    let trainer = Trainer::new(&job.config, &network, &sequences, &job.windows, Some(whole), Threads(2))?;
    let mut trainer = trainer.with_validation(&job.validation);
    trainer.take_best();
    assert_eq!(bits(&trainer.state().parameters), bits(&best.parameters));
    assert_eq!(trainer.validation_loss()?, Some(best.loss));
    Ok(())
}

#[test]
fn rollouts_that_train_fall_on_flights_that_nothing_was_learned_from_and_a_stopped_run_goes_on_bit_for_bit() -> Result<()> {
    let set = simulate(&Simulation { minutes: 4.0, seed: 6, ..Simulation::default() }.hide("dihedral_speedstab", 2.0)?)?;
    let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
    let (model, _) = calibrate(&paper(), &set.flights, &split.training)?;
    let network = PhyTureConfig { dropout: 0.0, ..small(10) };
    let inputs = ["vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4"].map(str::to_owned).into();
    let config = TrainConfig {
        network: network.into(),
        inputs,
        rollout: Some(RolloutConfig { horizon: 20, starts: 6, weight: 3.0 }),
        standardise_loss: true,
        peak_rate: 5e-3,
        epochs: 8,
        stride: 40,
        seed: 5,
        ..TrainConfig::default()
    };
    let job = phyture::train::Job::new(&set.flights, &split, &model, &config)?;
    let network = job.description.network(true)?;
    let run = |folder: &RunFolder, state: Option<State>, threads: usize, stop: Option<u64>| -> Result<(Outcome, State)> {
        let rollouts = job.rollouts(&set.flights, &split, &config, Threads(threads))?.expect("it has some");
        let trainer = Trainer::new(&config, &network, &job.sequences, &job.windows, state, Threads(threads))?;
        let mut trainer = trainer.with_validation(&job.validation).with_rollouts(rollouts);
        let outcome = folder.train(&config, DATA, &mut trainer, &mut |report| stop != Some(report.step.step))?;
        Ok((outcome, trainer.into_state()))
    };
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let (_, whole) = run(&RunFolder::create(place.path().join("whole"))?, None, 1, None)?;
    let parts = RunFolder::create(place.path().join("parts"))?;
    let (stopped, _) = run(&parts, None, 2, Some(whole.step / 2))?;
    assert_eq!(stopped, Outcome::Stopped);
    let (_, resumed) = run(&parts, Some(parts.resume(&config, DATA)?), 2, None)?;
    assert_eq!(bits(&resumed.parameters), bits(&whole.parameters));
    assert_eq!(resumed.curve, whole.curve);
    let mut judge = job
        .rollouts(&set.flights, &split, &config, Threads(2))?
        .and_then(|rollouts| rollouts.validation)
        .expect("a validation part");
    let losses = [judge.judge(&network.initial(config.seed))?, judge.judge(&whole.parameters)?];
    assert!(losses[1] < 0.9 * losses[0], "{losses:?}");
    Ok(())
}

/// The lines of a run's metrics, without the time that each took.
fn metrics(folder: &std::path::Path) -> Result<Vec<serde_json::Value>> {
    let path = folder.join("metrics.jsonl");
    let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
    let line = |line| -> serde_json::Result<serde_json::Value> {
        let mut value: serde_json::Value = serde_json::from_str(line)?;
        value.as_object_mut().and_then(|fields| fields.remove("seconds"));
        Ok(value)
    };
    text.lines().map(line).collect::<serde_json::Result<_>>().map_err(|error| Error::Undetermined(error.to_string()))
}

#[test]
fn the_losses_are_means_over_all_windows_without_dropout() -> Result<()> {
    let job = job()?;
    let network = job.description.network(false)?;
    let sequences = sequence::sequences(&job.set.flights, &job.description)?;
    let trainer = Trainer::new(&job.config, &network, &sequences, &job.windows, None, Threads(2))?;
    let mut trainer = trainer.with_validation(&job.validation);
    let hybrid = Hybrid::new(job.description.clone(), trainer.state().parameters.clone())?;
    let expected = |windows: &[Window]| -> Result<f64> {
        let predicted = hybrid.predict(&job.set.flights, windows, Threads(1))?;
        let squares = windows.iter().zip(predicted).flat_map(|(window, predicted)| {
            let flight = &job.set.flights[window.flight];
            let measured = phyture::flight::Column::TARGETS.map(|column| flight.column(column)[window.last]);
            measured.into_iter().zip(predicted).map(|(measured, predicted)| (measured - predicted).powi(2))
        });
        Ok(squares.sum::<f64>() / windows.len() as f64)
    };
    let close = |found: f64, expected: f64| (found / expected - 1.0).abs() < phyture_kernels::Tolerance::Close.relative_f32();
    assert!(close(trainer.training_loss()?, expected(&job.windows)?));
    assert!(trainer.validation_loss()?.is_some_and(|found| expected(&job.validation).is_ok_and(|loss| close(found, loss))));
    Ok(())
}

/// The network of a job in a file, with its description changed.
fn changed(job: &Job, path: &std::path::Path, change: impl FnOnce(&mut serde_json::Value, &mut SafeTensors)) -> Result<()> {
    let count = job.description.network(false)?.graph().parameter_count();
    Hybrid::new(job.description.clone(), vec![0.01; count])?.write(path)?;
    let mut file = SafeTensors::read(path)?;
    let text = file.metadata.get("phyture_hybrid").cloned().unwrap_or_default();
    let mut description = serde_json::from_str(&text).map_err(|error| Error::Undetermined(error.to_string()))?;
    change(&mut description, &mut file);
    file.metadata.insert("phyture_hybrid".into(), description.to_string());
    file.write(path)
}

#[test]
fn sizes_and_scales_that_a_network_s_file_claims_are_checked_before_anything_is_made_of_them() -> Result<()> {
    type Change = fn(&mut serde_json::Value);
    let job = job()?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let path = place.path().join("network.safetensors");
    let cases: [(Change, &str); 10] = [
        (|description| description["linear"]["config"]["lags"] = (1_u64 << 63).into(), "`linear.lags` is 9223372036854775808"),
        (
            |description| description["linear"]["config"]["lags"] = ((1_u64 << 62) + 1).into(),
            "`linear.lags` is 4611686018427387905",
        ),
        (|description| description["linear"]["config"]["inputs"][0] = "wx_dot".into(), "`wx_dot` cannot be read here"),
        (|description| description["inputs"][2] = "lag(vx_dot, 0.1)".into(), "`vx_dot` cannot be read here"),
        (|description| description["scaling"]["output"][1]["deviation"] = 1e308.into(), "deviation 1e308"),
        (|description| description["scaling"]["state"][1]["mean"] = 1e300.into(), "mean 1e300"),
        (|description| description["step_s"] = 1e-302.into(), "`step_s`"),
        (|description| description["gate"][0] = 2.0.into(), "`gate`"),
        (
            |description| {
                description["config"]["history"] = 65536.into();
                description["config"]["d_model"] = 4096.into();
            },
            "1678098440 parameters, expected at most 268435456",
        ),
        (
            |description| {
                description["config"]["history"] = 65536.into();
                description["config"]["d_model"] = 512.into();
            },
            "tensor `paf.state.weight` is not finite f32 of shape [512, 16], which its description asks for",
        ),
    ];
    for (change, message) in cases {
        changed(&job, &path, |description, _| change(description))?;
        let refused = Hybrid::read(&path).map(|_| ()).map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(refused.contains(message) && refused.contains("network.safetensors"), "{message}: {refused}");
    }
    changed(&job, &path, |_, _| {})?;
    assert!(Hybrid::read(&path).is_ok());
    Ok(())
}

#[test]
fn a_prediction_that_is_no_number_is_an_error_with_its_place() -> Result<()> {
    let job = job()?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let path = place.path().join("network.safetensors");
    changed(&job, &path, |description, file| {
        description["scaling"]["output"][1]["deviation"] = 1e15.into();
        if let Some(Tensor { numbers: Numbers::F32(numbers), .. }) = file.tensors.get_mut("tsdp.output.bias") {
            numbers[1] = f32::MAX;
        }
    })?;
    let hybrid = Hybrid::read(&path)?;
    let flights = &job.set.flights[..1];
    let refused = hybrid.predict(flights, &[Window { flight: 0, last: 40 }], Threads(1));
    let message = refused.map(|_| ()).map_err(|error| error.to_string()).err().unwrap_or_default();
    let expected = format!("flight `{}`, sample 40 (", flights[0].name);
    assert!(message.contains(&expected) && message.contains("predicted `vy_dot` is inf"), "{message}");
    let count = job.description.network(false)?.graph().parameter_count();
    let diverged = Hybrid::new(job.description.clone(), vec![f32::NAN; count]).map(|_| ());
    assert!(diverged.is_err_and(|error| error.to_string().contains("diverged")));
    Ok(())
}

#[test]
fn a_checkpoint_of_other_data_or_another_configuration_is_refused() -> Result<()> {
    let job = job()?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let folder = RunFolder::create(place.path().join("run"))?;
    let message =
        |config: &TrainConfig, data| folder.resume(config, data).map_err(|error| error.to_string()).err().unwrap_or_default();
    assert!(message(&job.config, DATA).contains("no checkpoint to resume from"));
    train(&job, &folder, None, 1, Some(1))?;
    assert!(message(&job.config, DATA + 1).contains("other data"));
    assert!(message(&TrainConfig { epochs: 4, ..job.config.clone() }, DATA).contains("another configuration"));
    assert_eq!(folder.resume(&job.config, DATA)?.step, 1);
    Ok(())
}

#[test]
fn file_and_stream_say_what_the_batch_says() -> Result<()> {
    let job = job()?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let folder = RunFolder::create(place.path().join("run"))?;
    let (_, state) = train(&job, &folder, None, 2, None)?;
    let hybrid = Hybrid::new(job.description.clone(), state.parameters)?;
    hybrid.write(&folder.network())?;
    let read = Hybrid::read(&folder.network())?;
    let flight = &job.set.flights[0];
    let all: Vec<Window> = (15..200).map(|last| Window { flight: 0, last }).collect();
    let flights = std::slice::from_ref(flight);
    let batch = hybrid.predict(flights, &all, Threads(2))?;
    assert!(batch == read.predict(flights, &all, Threads(1))?, "the file changes predictions");
    let mut stream = read.stream()?;
    let mut streamed = Vec::new();
    for sample in 0..200 {
        let state = flight.state(sample);
        streamed.extend(stream.push(&state)?);
    }
    assert!(streamed == batch, "stream and batch differ");
    assert!(stream.push(&[f64::NAN; 16]).is_err());
    // Parts that do not fit each other are refused when they are joined, before anything is predicted.
    let broken: [fn(&mut Description); 6] = [
        |description| description.inputs.truncate(3),
        |description| description.scaling.state.truncate(3),
        |description| description.scaling.physics[Channel::VzDot].deviation = 0.0,
        |description| description.config = PhyTureConfig { outputs: 5, ..PhyTureConfig::default() }.into(),
        |description| description.gate[Channel::VyDot] = f64::NAN,
        |description| description.step_s = 0.0,
    ];
    for breakage in broken {
        let mut description = job.description.clone();
        breakage(&mut description);
        assert!(Hybrid::new(description, vec![]).is_err_and(|error| error.to_string().starts_with("hybrid: ")));
    }
    // A file that is cut anywhere is refused, and so is one of another kind.
    let bytes = std::fs::read(folder.network()).map_err(Error::io("network"))?;
    let cut = place.path().join("cut.safetensors");
    for length in [0, 7, 8, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&cut, &bytes[..length]).map_err(Error::io(&cut))?;
        assert!(Hybrid::read(&cut).is_err(), "cut to {length}");
    }
    Ok(())
}

#[test]
fn a_stream_takes_columns_of_the_logs_own_where_physics_history_and_network_read_them() -> Result<()> {
    let mut set = simulated()?;
    for (index, flight) in set.flights.iter_mut().enumerate() {
        let own = |speed: f64| (0..flight.len()).map(|sample| (speed * sample as f64 + index as f64).sin()).collect::<Vec<f64>>();
        flight.extra =
            [("front", own(0.11)), ("rear", own(0.07)), ("unread", own(0.05))].map(|(name, own)| (name.into(), own)).into();
    }
    let text = "[model]\nmass_kg = 4.58\ninertia = [0.18, 0.34, 0.28]\nrotor_radius_m = 0.8\nbaseline = \"paper\"\n\
                [[effect]]\nkind = \"formula\"\nname = \"own\"\nchannel = \"wx_dot\"\nformula = \"front * vx\"\n";
    let model = Model::from_toml(text, "model.toml".as_ref())?;
    let inputs: Vec<String> = TrainConfig::default().inputs.into_iter().chain(["front - rear".to_owned()]).collect();
    let linear = LinearConfig { lags: 3, inputs: vec!["vx".into(), "lag(rear, 0.1)".into()] };
    let job = job_of(set, &model, inputs, linear)?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let (_, state) = train(&job, &RunFolder::create(place.path().join("run"))?, None, 2, Some(2))?;
    let hybrid = Hybrid::new(job.description.clone(), state.parameters)?;
    let flight = &job.set.flights[1];
    let all: Vec<Window> = (15..100).map(|last| Window { flight: 0, last }).collect();
    let batch = hybrid.predict(std::slice::from_ref(flight), &all, Threads(2))?;
    let mut stream = hybrid.stream()?;
    assert_eq!(stream.own_columns(), ["front", "rear"]);
    let mut streamed = Vec::new();
    for sample in 0..100 {
        let state = flight.state(sample);
        let own = ["front", "rear"].map(|name| flight.extra[name][sample]);
        let refused = stream.push(&state).map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(refused.contains("0 values for the log's own columns, which are [\"front\", \"rear\"]"), "{refused}");
        assert!(stream.push_with(&state, &[own[0], f64::INFINITY]).is_err());
        // What was refused was not taken.
        streamed.extend(stream.push_with(&state, &own)?);
    }
    assert!(streamed == batch, "stream and batch differ");
    Ok(())
}

#[test]
fn a_nan_never_reaches_the_network() -> Result<()> {
    let mut job = job()?;
    // Not a number on every sample: the logarithm of a negative one.
    job.description.inputs[3] = "log(-1 - vx^2)".into();
    let refused =
        sequence::sequences(&job.set.flights, &job.description).map_err(|error| error.to_string()).err().unwrap_or_default();
    assert!(refused.contains("log(-1 - vx^2)") && refused.contains("not a finite number"), "{refused}");
    Ok(())
}

/// The program itself, killed without warning at 20 moments of its run: what is on disk always loads, and the run goes on.
#[cfg(feature = "cli")]
#[test]
fn a_killed_run_never_leaves_a_file_that_does_not_load() -> Result<()> {
    use std::process::{Command, Stdio};
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let path = |name: &str| place.path().join(name);
    let program = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_phyture"));
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    };
    let run = |arguments: &[&str]| -> Result<()> {
        let output = program().args(arguments).current_dir(place.path()).output().map_err(Error::io("phyture"))?;
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        Ok(())
    };
    run(&["simulate", "data", "--minutes", "2"])?;
    run(&["calibrate", "data", "-m", "data/model.toml", "-o", "model.toml"])?;
    let config = "epochs = 40\nstride = 20\ncheckpoint_s = 0.02\n[network]\nhistory = 16\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\nmoving_average = 5\n";
    std::fs::write(path("train.toml"), config).map_err(Error::io("train.toml"))?;
    let train = ["train", "data", "-m", "model.toml", "-o", "run", "--config", "train.toml"];
    let checkpoint = path("run/checkpoint.phyture");
    let mut done = 0;
    for moment in 0..20_u64 {
        let resume = checkpoint.exists().then_some("--resume");
        let mut child = program().args(train).args(resume).current_dir(place.path()).spawn().map_err(Error::io("phyture"))?;
        std::thread::sleep(std::time::Duration::from_millis(40 + 37 * (moment * 7 % 20)));
        // It may be at its end already; that is as good.
        let _ = child.kill();
        child.wait().map_err(Error::io("phyture"))?;
        if checkpoint.exists() {
            let step = steps_of(&checkpoint)?;
            assert!(step >= done, "went back from step {done} to {step}");
            done = step;
        }
        let network = path("run/network.safetensors");
        assert!(!network.exists() || Hybrid::read(&network).is_ok());
    }
    let resume: &[&str] = if checkpoint.exists() { &["--resume"] } else { &[] };
    run(&[&train[..], resume].concat())?;
    let interrupted = std::fs::read(path("run/network.safetensors")).map_err(Error::io("network"))?;
    run(&["train", "data", "-m", "model.toml", "-o", "whole", "--config", "train.toml"])?;
    let whole = std::fs::read(path("whole/network.safetensors")).map_err(Error::io("network"))?;
    assert!(interrupted == whole, "the killed and resumed run ends in other bits than the one that was left alone");
    Ok(())
}

/// Steps in a checkpoint; an error if it does not load.
#[cfg(feature = "cli")]
fn steps_of(path: &std::path::Path) -> Result<u64> {
    let (_, _, state): (String, u64, State) = phyture::train::container::read(path)?;
    Ok(state.step)
}
