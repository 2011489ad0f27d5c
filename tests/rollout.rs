//! Open-loop prediction: hybrids step by step against their own batch, models against yardsticks on simulated flights, published yardsticks on
//! recorded ones, and the command.
#![cfg(feature = "cli")]

mod program;

use phyture::critique::rollout::{Quantity, Rollouts};
use phyture::flight::attitude::quaternion_to_euler;
use phyture::flight::split::{Protocol, Split};
use phyture::flight::{Flight, PerChannel, Window};
use phyture::hybrid::linear::LinearConfig;
use phyture::hybrid::{Description, Hybrid, HybridRollout, sequence};
use phyture::nn::{Architecture, PhyTureConfig};
use phyture::physics::rollout::State;
use phyture::physics::{Model, Rollout, calibrate};
use phyture::sim::{Simulation, simulate};
use phyture::tape::Threads;
use phyture::workflow::Rolling;
use phyture::{Error, Result};
use program::{folder, phyture, refused, succeed};
use serde_json::Value;
use std::path::Path;

const HISTORY: usize = 8;
const HORIZON: usize = 12;

/// A small network behind a linear history on a simulated session, untrained, with inputs that remember.
fn hybrid(model: Model, flights: &[Flight], gate: f64, linear: bool) -> Result<Hybrid> {
    let config = PhyTureConfig {
        history: HISTORY,
        d_model: 8,
        heads: 2,
        levels: 1,
        stacks: 1,
        moving_average: 3,
        state_channels: 9,
        ..PhyTureConfig::default()
    };
    let config = Architecture::from(config);
    let inputs: Vec<String> = ["vx", "vz", "wx", "wy", "u1", "g_x", "rate(wx)", "lag(vy, 0.05)", "roll"].map(str::to_owned).into();
    let spans = Split::new(flights, &[], &Protocol::Segments, 1)?.training;
    let config_of_linear = LinearConfig { lags: 4, inputs: ["wx", "vz", "u2", "rate(vx)"].map(str::to_owned).into() };
    let linear = if linear { Some(sequence::linear(flights, &spans, &model, &config_of_linear)?) } else { None };
    let description = Description {
        envelope: None,
        intervals: None,
        scaling: sequence::scaling(flights, &spans, &model, &inputs, linear.as_ref(), &config)?,
        model,
        config,
        inputs,
        linear,
        gate: PerChannel::splat(gate),
        step_s: flights[0].step_s,
    };
    let parameters = description.network(false)?.initial(11);
    Hybrid::new(description, parameters)
}

/// A flight that is measured up to `start` and then as predicted; velocity is written in body axes again.
fn continued(flight: &Flight, start: usize, path: &[State]) -> Result<Flight> {
    flight.with_columns(|column| {
        let mut values = flight.column(column).to_vec();
        for (state, sample) in path.iter().zip(start..) {
            let angles = quaternion_to_euler(state.attitude);
            let matrix = phyture::flight::attitude::quaternion_to_rotation(state.attitude);
            let body = phyture::flight::attitude::rotate_back(&matrix, state.velocity);
            let index = column as usize;
            values[sample] = match index {
                0..3 => state.position[index],
                3..6 => angles[index - 3],
                6..9 => body[index - 6],
                9..12 => state.rates[index - 9],
                _ => continue,
            };
        }
        Some(values)
    })
}

#[test]
fn a_hybrid_adds_at_each_step_what_its_batch_says_of_the_flight_so_far() -> Result<()> {
    let flights = simulate(&Simulation { minutes: 2.0, seed: 3, ..Simulation::baseline() })?.flights;
    // A model without effects: the rates change by what is added and by nothing else.
    let model = Model { effects: Vec::new(), ..Model::paper("nothing", 4.58, [0.18, 0.34, 0.28], 0.8) };
    for linear in [false, true] {
        let hybrid = hybrid(model.clone(), &flights, 0.3, linear)?;
        let rollout = HybridRollout::new(&hybrid, &flights, HORIZON)?;
        let starts = [Window { flight: 1, last: 40 }, Window { flight: 1, last: 333 }];
        let paths = rollout.roll(&starts, &|rolled| {
            assert_eq!((rolled.flight, rolled.lanes()), (1, 2));
            (0..2).map(|lane| (0..=HORIZON).map(|step| rolled.state(lane, step)).collect::<Vec<_>>()).collect::<Vec<_>>()
        })?;
        for (start, path) in starts.iter().zip(&paths[0]) {
            let so_far = [flights[0].clone(), continued(&flights[1], start.last, path)?];
            for step in 0..HORIZON {
                let at = Window { flight: 1, last: start.last + step };
                let added = hybrid.predict(&so_far, &[at], Threads(1))?[0];
                for axis in 0..3 {
                    let found = (path[step + 1].rates[axis] - path[step].rates[axis]) / flights[1].step_s;
                    let expected = added.values()[3 + axis];
                    // The network works in f32, on inputs that went from quaternion to angles and back.
                    assert!((found - expected).abs() <= 1e-4 * expected.abs().max(1.0), "step {step}: {found} {expected}");
                }
            }
            assert!(path.windows(2).any(|pair| (pair[1].rates[0] - pair[0].rates[0]).abs() > 1e-6), "something is added");
        }
    }
    Ok(())
}

#[test]
fn a_shut_gate_leaves_the_model() -> Result<()> {
    let flights = simulate(&Simulation { minutes: 2.0, seed: 4, ..Simulation::baseline() })?.flights;
    let spans = Split::new(&flights, &[], &Protocol::Segments, 1)?.training;
    let (model, _) = calibrate(&Model::paper("truth", 4.58, [0.18, 0.34, 0.28], 0.8), &flights, &spans)?;
    let starts = Rollout::new(&model, &flights, HORIZON)?.starts(97);
    let starts: Vec<Window> = starts.into_iter().filter(|start| start.last + 1 >= HISTORY).collect();
    let ends = |rolled: &phyture::physics::rollout::Rolled| {
        (0..rolled.lanes()).map(|lane| rolled.state(lane, HORIZON)).collect::<Vec<_>>()
    };
    let alone = Rollout::new(&model, &flights, HORIZON)?.roll(&starts, None, &ends)?;
    let hybrid = hybrid(model, &flights, 0.0, false)?;
    let with_network = HybridRollout::new(&hybrid, &flights, HORIZON)?.roll(&starts, &ends)?;
    assert_eq!(alone.concat(), with_network.concat());
    let description = Description { step_s: 0.02, ..hybrid.description().clone() };
    let parameters = description.network(false)?.initial(11);
    let slow =
        HybridRollout::new(&Hybrid::new(description, parameters)?, &flights, HORIZON).map(drop).map_err(|error| error.to_string());
    assert!(slow.is_err_and(|text| text.contains("`step` is 0.01 s, expected the 0.02 s the network was trained at")));
    let early = HybridRollout::new(&hybrid, &flights, HORIZON)?.roll(&[Window { flight: 0, last: HISTORY - 2 }], &ends);
    assert!(early.is_err_and(|error| error.to_string().contains("a full history of 8 samples")));
    Ok(())
}

#[test]
fn on_simulated_flights_the_calibrated_model_beats_held_rates_and_these_a_held_state() -> Result<()> {
    let set = simulate(&Simulation { minutes: 4.0, seed: 5, ..Simulation::baseline() })?;
    let split = Split::new(&set.flights, &[], &Protocol::First(0.7), 1)?;
    let (model, _) = calibrate(&Model::paper("truth", 4.58, [0.18, 0.34, 0.28], 0.8), &set.flights, &split.training)?;
    let models = [("truth".to_owned(), model)];
    let rolling = Rolling { models: &models, networks: &[], horizon: 50, stride: 10 };
    let found = rolling.run(&set, &split)?;
    let [state_held, rates_held, model] = &found.rows[..] else { panic!("three rows: {found}") };
    assert_eq!((&*state_held.name, &*rates_held.name, &*model.name), ("state held", "truth, rates held", "truth"));
    for quantity in Quantity::ALL {
        let below = |interval: Option<[f64; 2]>| interval.is_some_and(|[_, high]| high < 0.0);
        assert!(below(*model.whole.difference_percent_ci95.of(quantity)), "{found}");
        assert_eq!(*rates_held.whole.difference_percent.of(quantity), Some(0.0));
        let sum: f64 = model.error.of(quantity).iter().sum();
        assert!((sum - model.whole.sum.of(quantity)).abs() <= 1e-9 * sum, "a sum of means is the mean of sums");
        let of_classes: f64 = model.by_manoeuvre.values().map(|part| part.n as f64 * part.sum.of(quantity)).sum();
        assert!((of_classes / model.whole.n as f64 - sum).abs() <= 1e-9 * sum, "classes add up");
        assert!(model.whole.theil.of(quantity).is_some_and(|u| u > 0.0 && u < rates_held.whole.theil.of(quantity).unwrap_or(1.0)));
    }
    let [held, still] = [rates_held, state_held].map(|row| row.whole.sum.rates);
    assert!((held - still).abs() <= 1e-9 * still, "rates that stay are the same in both");
    assert!(state_held.whole.sum.position > rates_held.whole.sum.position);
    assert_eq!(found.rows.iter().map(|row| row.whole.diverged).sum::<usize>(), 0);
    Ok(())
}

fn document(path: &Path) -> Result<Value> {
    let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
    serde_json::from_str(&text).map_err(|error| Error::File { path: path.into(), message: error.to_string() })
}

/// Refuses numbers that are not there under a key: one that is not finite would be written as null. (Intervals need two blocks.)
fn without_null(row: &Value) {
    for key in ["error", "sum", "theil", "difference_percent"] {
        let text = row[key].to_string();
        assert!(text.contains("rates") && !text.contains("null"), "{key}: {text}");
    }
}

#[test]
fn the_command_tells_writes_and_overwrites_nothing() -> Result<()> {
    let place = folder()?;
    succeed(place.path(), &["simulate", "flights", "--minutes", "4", "--seed", "6", "--baseline", "-q"])?;
    succeed(place.path(), &["calibrate", "flights", "-o", "fitted.toml", "-q"])?;
    let text = std::fs::read_to_string(place.path().join("fitted.toml")).map_err(Error::io("fitted.toml"))?;
    // A body that turns the faster the faster it turns runs away.
    let wild =
        text + "\n[[effect]]\nkind = \"formula\"\nname = \"wild\"\nchannel = \"wx_dot\"\nformula = \"wx\"\ncoefficient = 300.0\n";
    std::fs::write(place.path().join("wild.toml"), wild).map_err(Error::io("wild.toml"))?;
    let line = ["rollout", "flights", "-m", "fitted.toml", "-m", "wild.toml", "--report", "page", "--json", "found.json"];
    let said = succeed(place.path(), &line)?;
    assert!(said.lines().all(|line| line.chars().count() <= 120), "{said}");
    for words in ["every 10th sample", "h = 1", "h = 10", "h = 50", "fitted, rates held", "Position error", "rad/s", "diverged"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let found = document(&place.path().join("found.json"))?;
    let rows = found["rows"].as_array().cloned().unwrap_or_default();
    assert_eq!(rows.len(), 4);
    for row in &rows {
        without_null(row);
        let classes = row["by_manoeuvre"].as_object().cloned().unwrap_or_default();
        assert!(!classes.is_empty());
        classes.values().for_each(|part| assert!(!part["sum"].to_string().contains("null"), "{part}"));
    }
    let wild = &found["rows"][3];
    assert_eq!((&found["schema"], &wild["name"]), (&1.into(), &"wild".into()));
    assert!(wild["diverged"].as_u64().is_some_and(|count| count > 0 && Some(count) <= wild["n"].as_u64()), "{wild}");
    assert_eq!(wild["error"]["position"].as_array().map(Vec::len), Some(50));
    let page = std::fs::read_to_string(place.path().join("page/rollout.html")).map_err(Error::io("rollout.html"))?;
    assert!(page.contains("Error over the horizon") && page.contains("diverged; their states stay"));
    let again = refused(place.path(), &line)?;
    assert!(again.contains("is there already"), "{again}");
    // The same bits on one thread.
    let one = ["rollout", "flights", "-m", "fitted.toml", "-m", "wild.toml", "--threads", "1", "--json", "one.json"];
    succeed(place.path(), &one)?;
    assert_eq!(document(&place.path().join("one.json"))?, found);
    let long = refused(place.path(), &["rollout", "flights", "-m", "fitted.toml", "--horizon", "90000"])?;
    assert!(long.contains("`horizon` is 90000 steps") && long.contains("the longest flight"), "{long}");
    let none = refused(place.path(), &["rollout", "flights", "-m", "fitted.toml", "--horizon", "1500"])?;
    assert!(none.contains("no run of test samples holds the 1500 samples"), "{none}");
    Ok(())
}

/// Sums over 1 … 50 steps of position (m), velocity (m/s), attitude (rad) and rates (rad/s): of a state that is held, and of the published
/// thrust with rates held.
const PUBLISHED: [(&str, [f64; 4], [f64; 4]); 4] = [
    ("multisine", [10.3, 21.6, 4.37, 17.9], [1.93, 7.75, 3.12, 17.9]),
    ("random1", [12.2, 25.1, 6.08, 22.4], [2.47, 9.28, 3.90, 22.4]),
    ("random2", [12.5, 26.5, 6.49, 24.0], [2.49, 9.38, 4.15, 24.0]),
    ("square", [8.29, 39.7, 18.6, 121.0], [4.14, 31.0, 20.6, 121.0]),
];

#[test]
fn published_yardsticks_come_out_on_recorded_flights() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = root.join("../shared/data/crazyflie");
    if !data.is_dir() {
        eprintln!("skipped: the Crazyflie flights are not at {}", data.display());
        return Ok(());
    }
    let fixtures = root.join("fixtures/crazyflie");
    let [data, dataset, model] =
        [data, fixtures.join("dataset.toml"), fixtures.join("published.toml")].map(|path| path.display().to_string());
    let place = folder()?;
    let line = ["rollout", &data, "--dataset", &dataset, "-m", &model, "--all", "--stride", "1", "--json", "found.json", "-q"];
    let output = phyture(place.path(), &line)?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(place.path().join("found.json")).map_err(Error::io("found.json"))?;
    let found: Rollouts = serde_json::from_str(&text).map_err(|error| Error::Undetermined(error.to_string()))?;
    for (class, state_held, rates_held) in PUBLISHED {
        for (row, published) in found.rows.iter().zip([state_held, rates_held]) {
            for (quantity, published) in Quantity::ALL.into_iter().zip(published) {
                let sum = *row.by_manoeuvre[class].sum.of(quantity);
                let far = (sum / published - 1.0).abs();
                assert!(far <= 0.03, "{class}, {}, {}: {sum} instead of {published}", row.name, quantity.name());
            }
        }
    }
    Ok(())
}
