//! Known dependences, none at all, and sticks that follow the gusts: is the right thing said, and nothing where there is nothing?

use super::*;
use crate::flight::{Accelerations, Flight, Span, Targets};
use phyture_kernels::random::Stream;

const STEP_S: f64 = 0.02;
const SAMPLES: usize = 1500;
const BLOCK_S: f64 = 15.0;

/// Near enough to a unit normal: the sum of four uniforms.
fn normal(stream: Stream, index: u64) -> f64 {
    3_f64.sqrt() * ((0..4).map(|part| stream.uniform(4 * index + part)).sum::<f64>() - 2.0)
}

/// A stationary first-order process of unit variance with correlation time `tau_s`.
fn gusts(stream: Stream, tau_s: f64) -> Vec<f64> {
    let keep = (-STEP_S / tau_s).exp();
    let mut value = normal(stream.sub(99), 0);
    (0..SAMPLES as u64)
        .map(|sample| {
            value = keep * value + (1.0 - keep * keep).sqrt() * normal(stream, sample);
            value
        })
        .collect()
}

/// A smooth process of about unit variance.
fn smooth(stream: Stream, tau_s: f64) -> Vec<f64> {
    let mut slow = 0.0;
    let rough = gusts(stream, tau_s);
    let keep = (-STEP_S / tau_s).exp();
    slow += rough[0];
    rough
        .iter()
        .map(|value| {
            slow = keep * slow + (1.0 - keep) * value;
            1.41 * slow
        })
        .collect()
}

/// Flights and the gusts that act on the six channels.
struct Made {
    flights: Vec<Flight>,
    residual: Vec<Accelerations>,
}

/// Smooth random flights with gusts of 0.3 rms, 0.5 s; `feedback` lets speeds, rates and sticks follow past gusts.
fn made(seed: u64, count: usize, feedback: f64) -> Result<Made> {
    let mut made = Made { flights: Vec::new(), residual: Vec::new() };
    for flight in 0..count as u64 {
        let stream = |purpose: u64| Stream::new(seed, flight, purpose, 7);
        let gust: Accelerations =
            std::array::from_fn(|channel| gusts(stream(50 + channel as u64), 0.5).into_iter().map(|value| 0.3 * value).collect());
        let of = |purpose: u64, tau_s: f64, scale: f64, mean: f64| -> Vec<f64> {
            smooth(stream(purpose), tau_s).into_iter().map(|value| mean + scale * value).collect()
        };
        // Speeds and rates hold the response to gusts of earlier samples.
        let response = |channel: usize, damping: f64| -> Vec<f64> {
            let mut value = 0.0;
            (0..SAMPLES)
                .map(|sample| {
                    let late = sample.checked_sub(5).map_or(0.0, |past| gust[channel][past]);
                    value += STEP_S * (late - damping * value);
                    feedback * value
                })
                .collect()
        };
        let sum = |a: &[f64], b: &[f64], by: f64| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + by * b).collect() };
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; SAMPLES]);
        let mut set = |column: Column, values: Vec<f64>| columns[column as usize] = values;
        let follow: [Vec<f64>; 6] = std::array::from_fn(|channel| response(channel, if channel < 3 { 0.4 } else { 5.0 }));
        // With feedback the commands are small, so that much of the motion is the response to gusts.
        let command = if feedback > 0.0 { 0.15 } else { 1.0 };
        set(Column::Z, of(1, 5.0, 3.0, 8.0).iter().map(|height| -height).collect());
        let vz = sum(&of(4, 2.0, 1.5 * command, 0.0), &follow[2], 1.0);
        set(Column::U4, sum(&of(14, 1.0, 0.1, 0.4), &vz, 0.04));
        set(Column::Vx, sum(&of(2, 3.0, 4.0 * command, 3.0), &follow[0], 1.0));
        set(Column::Vy, sum(&of(3, 2.0, 2.0 * command, 0.0), &follow[1], 1.0));
        set(Column::Vz, vz);
        for (axis, column) in [Column::Wx, Column::Wy, Column::Wz].into_iter().enumerate() {
            let rate = sum(&of(5 + axis as u64, 0.6, 0.6 * command, 0.0), &follow[3 + axis], 1.0);
            let stick = [Column::U1, Column::U2, Column::U3][axis];
            set(stick, sum(&of(11 + axis as u64, 0.3, 0.2 * command, 0.0), &rate, 0.3));
            set(column, rate);
        }
        set(Column::Roll, of(8, 1.0, 0.2, 0.0));
        set(Column::Pitch, of(9, 1.0, 0.2, 0.0));
        let start = 6.28 * stream(30).uniform(0);
        set(Column::Yaw, of(10, 5.0, 1.0, start));
        made.flights.push(Flight::new(format!("f{flight}"), "m", 0.0, STEP_S, columns, Targets::Recorded)?);
        made.residual.push(gust);
    }
    Ok(made)
}

impl Made {
    /// Adds a term to one channel of the residual.
    fn with(mut self, channel: usize, formula: &str, scale: f64) -> Result<Self> {
        let formula = crate::formula::Formula::parse(formula)?;
        for (flight, residual) in self.flights.iter().zip(&mut self.residual) {
            let values = crate::physics::evaluate(&formula, flight)?;
            residual[channel].iter_mut().zip(values).for_each(|(residual, value)| *residual += scale * value);
        }
        Ok(self)
    }

    fn table(&self) -> Result<ResidualTable> {
        let spans: Vec<Span> = (0..self.flights.len()).map(|flight| Span { flight, start: 0, end: SAMPLES }).collect();
        ResidualTable::new(&self.flights, &spans, &|flight| Ok(self.residual[flight].clone()), BLOCK_S, ROWS_MAX)
    }
}

/// Channel, formula, size, variable that has to come first, what the suggestion has to contain.
#[rustfmt::skip]
const ALIENS: [(usize, &str, f64, &[&str], &str); 8] = [
    (2, "sin(2 * height)", 1.0, &["height"], "sin("),
    (0, "exp(-((vx - 4) / 1.5)^2)", 1.0, &["vx"], "exp("),
    (5, "max(wz - 0.4, 0)", 2.0, &["wz"], "max("),
    (2, "u4 * airspeed", 1.0, &["u4", "airspeed"], ""),
    (1, "sin(yaw)", 0.4, &["yaw"], "sin("),
    (3, "u1 * abs(u1)", 5.0, &["u1"], "u1"),
    (4, "t", 0.03, &["t"], "t"),
    (0, "cos(3 * height)", 0.25, &["height"], "sin("),
];

#[test]
fn hidden_dependences_are_named() -> Result<()> {
    let (mut first, mut shapes, mut runs) = (0, 0, 0);
    for (channel, formula, scale, variables, shape) in ALIENS {
        for seed in 0..2 {
            let table = made(100 + seed, 40, 0.0)?.with(channel, formula, scale)?.table()?;
            let found = unknown(&table, &UnknownOptions::default())?;
            println!("{formula}: {:?}", found);
            let search = Search::new(&table, &UnknownOptions::default());
            let all = search.dependence(&search.features, &table.residual[channel]);
            println!("   {:.3} {:.3} {:.2}", all.r2_with_feedback, all.r2, all.persists);
            runs += 1;
            let Some(top) = found.first() else { continue };
            assert_eq!(found.len(), 1, "{formula}: only one channel depends: {found:?}");
            first += usize::from(
                top.channel == Column::TARGETS[channel].name()
                    && top.depends_on.first().is_some_and(|first| variables.contains(&first.variable.as_str())),
            );
            shapes += usize::from(top.suggested_formula.as_ref().is_some_and(|suggested| suggested.formula.contains(shape)));
        }
    }
    println!("first {first}/{runs}, shapes {shapes}");
    assert!(10 * first >= 9 * runs && 10 * shapes >= 8 * runs, "{first} and {shapes} of {runs}");
    Ok(())
}

#[test]
fn gusts_alone_are_not_explained() -> Result<()> {
    let mut alarms = 0;
    for seed in 0..20 {
        alarms += usize::from(!unknown(&made(seed, 30, 0.0)?.table()?, &UnknownOptions::default())?.is_empty());
    }
    assert!(alarms <= 1, "{alarms} false alarms in 20");
    Ok(())
}

#[test]
fn sticks_that_follow_gusts_are_not_causes() -> Result<()> {
    let mut alarms = 0;
    for seed in 0..6 {
        let table = made(200 + seed, 30, 1.0)?.table()?;
        let search = Search::new(&table, &UnknownOptions::default());
        for channel in 0..6 {
            let found = search.dependence(&search.features, &table.residual[channel]);
            println!("{channel}: {:.3} {:.3} {:.2}", found.r2_with_feedback, found.r2, found.persists);
        }
        let found = unknown(&table, &UnknownOptions::default())?;
        println!("{found:?}");
        alarms += usize::from(!found.is_empty());
    }
    assert_eq!(alarms, 0);
    // A cause beside the feedback is still seen.
    let table = made(300, 40, 1.0)?.with(2, "sin(2 * height)", 0.5)?.table()?;
    let found = unknown(&table, &UnknownOptions::default())?;
    println!("{found:?}");
    assert!(found.first().is_some_and(|top| top.channel == "vz_dot" && top.depends_on[0].variable == "height"), "{found:?}");
    Ok(())
}

/// How long it takes on a full table; run by hand: `cargo test --release --lib critique::unknown -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement, not a check"]
fn time_of_a_full_table() -> Result<()> {
    for (words, formula) in [("nothing", "0 * t"), ("one dependence", "sin(2 * height)")] {
        let table = made(1, 80, 0.0)?.with(2, formula, 1.0)?.table()?;
        let start = std::time::Instant::now();
        let found = unknown(&table, &UnknownOptions::default())?;
        let seconds = start.elapsed().as_secs_f64();
        println!("{words}: {} rows, {} features, {} found, {seconds:.2} s", table.len(), table.names.len(), found.len());
    }
    Ok(())
}
