//! Rows that are set aside: nothing is fitted to their accelerations and nothing judged by them, so it does not matter what stands there. And the other
//! half of a flight: what tells a flight's own numbers does not judge them.
#![cfg(feature = "sim")]

use phyture::Result;
use phyture::critique::diagnose::{Diagnosis, Options, diagnose};
use phyture::flight::split::{Part, Protocol, Split};
use phyture::flight::windows::{counted, windows};
use phyture::flight::{Channel, DataSet, Flight, Span};
use phyture::hybrid::linear::LinearConfig;
use phyture::hybrid::sequence;
use phyture::physics::{Effect, Model, Weights, calibrate, calibrate_weighed};
use phyture::sim::{INERTIA_KG_M2, Level, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::tape::Threads;
use phyture::workflow::Contest;
use phyture_kernels::random::Stream;
use std::collections::BTreeMap;

/// Flights with a weathercock moment that the model lacks; of each, runs of one to four rows are set aside, two fifths in all.
fn flights(minutes: f64) -> Result<DataSet> {
    let simulation = Simulation { minutes, seed: 17, level: Level::TWO, ..Simulation::baseline() };
    let mut set = simulate(&simulation.hide("weathercock", 2.0)?)?;
    for (number, flight) in set.flights.iter_mut().enumerate() {
        let stream = Stream::new(5, number as u64, 0, 0);
        let lengths =
            (0..).map(|at| (1 + (6.0 * stream.uniform(2 * at)) as usize, 1 + (4.0 * stream.uniform(2 * at + 1)) as usize));
        let mut next = 0;
        for (kept, aside) in lengths {
            if next + kept + aside > flight.len() {
                break;
            }
            flight.set_aside.push(next + kept..next + kept + aside);
            next += kept + aside;
        }
    }
    Ok(set)
}

/// The same flights with nonsense for accelerations in the rows that are set aside.
fn with_nonsense(flights: &[Flight]) -> Result<Vec<Flight>> {
    let spoilt = |flight: &Flight| {
        let mut accelerations = flight.accelerations();
        for (channel, values) in accelerations.pairs_mut() {
            for row in flight.set_aside.iter().cloned().flatten() {
                values[row] = 1e3 * (1.0 + channel.index() as f64 + (row % 7) as f64);
            }
        }
        flight.with_accelerations(&accelerations)
    };
    flights.iter().map(spoilt).collect()
}

fn model() -> Model {
    Model::paper("helicopter", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)
}

#[test]
fn what_stands_in_rows_that_are_set_aside_does_not_matter() -> Result<()> {
    let set = flights(8.0)?;
    let spoilt = DataSet { flights: with_nonsense(&set.flights)?, ..set.clone() };
    let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
    for weights in [Weights::Rows, Weights::Flights] {
        let clean = calibrate_weighed(&model(), &set.flights, &split.training, weights)?;
        assert_eq!(clean, calibrate_weighed(&model(), &spoilt.flights, &split.training, weights)?);
        assert_eq!(clean.0.rmse(&set.flights, &split.test)?, clean.0.rmse(&spoilt.flights, &split.test)?);
        let rows = |span: &Span| set.flights[span.flight].count(span.start..span.end);
        assert_eq!(clean.1.rows, split.training.iter().map(rows).sum::<usize>());
    }
    let (calibrated, _) = calibrate(&model(), &set.flights, &split.training)?;

    let search = |set: &DataSet| -> Result<Diagnosis> {
        let found = diagnose(&set.flights, &calibrated, &split.training, &split.test, "test", &Options::default())?;
        Ok(Diagnosis { seconds: 0.0, ..found.diagnosis })
    };
    let found = search(&set)?;
    assert_eq!(found, search(&spoilt)?);
    assert!(found.accepted.iter().any(|effect| effect == "weathercock"), "{:?}", found.accepted);

    let models = [("model".to_owned(), calibrated.clone())];
    let contest = Contest {
        models: &models,
        networks: &[],
        ridge: Some(3),
        history: 4,
        stride: 1,
        uncertainty: false,
        seed: 1,
        threads: Threads(1),
    };
    let (clean, nonsense) = (contest.run(&set, &split)?, contest.run(&spoilt, &split)?);
    assert_eq!(clean.comparison, nonsense.comparison);
    assert!(clean.windows.iter().all(|window| set.flights[window.flight].count(window.last..window.last + 1) == 1));
    let every = windows(&split.test, 4, 1);
    assert_eq!(clean.windows, counted(&set.flights, every.clone()));
    assert!(2 * clean.windows.len() > every.len() && 10 * clean.windows.len() < 8 * every.len());

    let config = LinearConfig { lags: 3, ..LinearConfig::default() };
    let linear = |flights: &[Flight]| sequence::linear(flights, &split.training, &calibrated, &config);
    assert_eq!(linear(&set.flights)?, linear(&spoilt.flights)?);
    Ok(())
}

#[test]
fn each_half_of_a_flight_is_judged_with_what_its_other_half_says_of_it() -> Result<()> {
    let mut set = simulate(&Simulation { minutes: 6.0, seed: 18, ..Simulation::baseline() })?;
    let test: Vec<Span> = set.flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
    let (mut with, _) = calibrate(&model(), &set.flights, &test)?;
    // Every flight has a trim of its own, and another one in its second half.
    let trims = |number: usize| [1.0 + 0.1 * number as f64, -0.6 - 0.05 * number as f64];
    for (number, flight) in set.flights.iter_mut().enumerate() {
        let mut accelerations = flight.accelerations();
        let half = flight.len() / 2;
        let [first, second] = trims(number);
        accelerations[Channel::WyDot]
            .iter_mut()
            .enumerate()
            .for_each(|(row, value)| *value += if row < half { first } else { second });
        *flight = flight.with_accelerations(&accelerations)?;
    }
    let mut own = Effect::formula("trim", Channel::WyDot, "1", 0.0)?;
    own.coefficients.iter_mut().for_each(|coefficient| coefficient.by_flight = Some(BTreeMap::new()));
    with.effects.push(own);
    let split = Split { training: Vec::new(), validation: Vec::new(), test, tested: Part::All };
    let models = [("with".to_owned(), with)];
    let contest = Contest {
        models: &models,
        networks: &[],
        ridge: None,
        history: 2,
        stride: 1,
        uncertainty: false,
        seed: 1,
        threads: Threads(1),
    };
    let judged = contest.run(&set, &split)?;
    assert!(judged.comparison.own_from_other_half);
    assert_eq!(
        judged.windows.len(),
        set.flights.iter().map(|flight| flight.len() - 2).sum::<usize>(),
        "all but the first row of each half"
    );
    assert!(judged.windows.is_sorted());
    // What the flight is said to have for itself is that of the other half, somewhat less for what holds such numbers near zero.
    let row = &judged.rows[1];
    let mean = |wanted: &dyn Fn(usize, usize) -> bool, value: &dyn Fn(usize) -> f64| {
        let of = (0..judged.windows.len()).filter(|&at| wanted(judged.windows[at].flight, judged.windows[at].last));
        let values: Vec<f64> = of.map(value).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    for (number, flight) in set.flights.iter().enumerate() {
        let half = flight.len() / 2;
        let halves: [&dyn Fn(usize, usize) -> bool; 2] =
            [&|of, last| of == number && last < half, &|of, last| of == number && last >= half];
        let said = halves.map(|half| mean(half, &|at| row.predicted[at][Channel::WyDot]));
        let measured = halves.map(|half| mean(half, &|at| flight.column(Channel::WyDot.column())[judged.windows[at].last]));
        for (said, own, other) in [(said[0], measured[0], measured[1]), (said[1], measured[1], measured[0])] {
            let near = 0.25 * (other - own).abs();
            assert!((said - other).abs() < near, "flight {number}: {said} of a half that has {own}, {other} in the other");
        }
    }
    Ok(())
}
