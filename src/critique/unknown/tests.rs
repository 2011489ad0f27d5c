//! Known dependences, none at all, and sticks that follow the gusts: is the right thing said, and nothing where there is nothing?

use super::*;
use crate::flight::{Accelerations, Channel, Column, Flight, PerChannel, Span, Targets};
use phyture_kernels::random::Stream;
use proptest::prelude::*;

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
        let gust: Accelerations = PerChannel::from_fn(|channel| {
            gusts(stream(50 + channel.index() as u64), 0.5).into_iter().map(|value| 0.3 * value).collect()
        });
        let of = |purpose: u64, tau_s: f64, scale: f64, mean: f64| -> Vec<f64> {
            smooth(stream(purpose), tau_s).into_iter().map(|value| mean + scale * value).collect()
        };
        // Speeds and rates hold the response to gusts of earlier samples.
        let response = |channel: Channel, damping: f64| -> Vec<f64> {
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
        let follow: PerChannel<Vec<f64>> =
            PerChannel::from_fn(|channel| response(channel, if channel < Channel::WxDot { 0.4 } else { 5.0 }));
        // With feedback the commands are small, so that much of the motion is the response to gusts.
        let command = if feedback > 0.0 { 0.15 } else { 1.0 };
        set(Column::Z, of(1, 5.0, 3.0, 8.0).iter().map(|height| -height).collect());
        let vz = sum(&of(4, 2.0, 1.5 * command, 0.0), &follow[Channel::VzDot], 1.0);
        set(Column::U4, sum(&of(14, 1.0, 0.1, 0.4), &vz, 0.04));
        set(Column::Vx, sum(&of(2, 3.0, 4.0 * command, 3.0), &follow[Channel::VxDot], 1.0));
        set(Column::Vy, sum(&of(3, 2.0, 2.0 * command, 0.0), &follow[Channel::VyDot], 1.0));
        set(Column::Vz, vz);
        for (axis, column) in [Column::Wx, Column::Wy, Column::Wz].into_iter().enumerate() {
            let rate = sum(&of(5 + axis as u64, 0.6, 0.6 * command, 0.0), &follow.values()[3 + axis], 1.0);
            let stick = [Column::U1, Column::U2, Column::U3][axis];
            set(stick, sum(&of(11 + axis as u64, 0.3, 0.2 * command, 0.0), &rate, 0.3));
            set(column, rate);
        }
        set(Column::Roll, of(8, 1.0, 0.2, 0.0));
        set(Column::Pitch, of(9, 1.0, 0.2, 0.0));
        let start = std::f64::consts::TAU * stream(30).uniform(0);
        set(Column::Yaw, of(10, 5.0, 1.0, start));
        made.flights.push(Flight::new(format!("f{flight}"), "m", 0.0, STEP_S, columns, Targets::Recorded)?);
        made.residual.push(gust);
    }
    Ok(made)
}

impl Made {
    /// Adds a term to one channel of the residual.
    fn with(mut self, channel: Channel, formula: &str, scale: f64) -> Result<Self> {
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
const ALIENS: [(Channel, &str, f64, &[&str], &str); 8] = [
    (Channel::VzDot, "sin(2 * height)", 1.0, &["height"], "sin("),
    (Channel::VxDot, "exp(-((vx - 4) / 1.5)^2)", 1.0, &["vx"], "exp("),
    (Channel::WzDot, "max(wz - 0.4, 0)", 2.0, &["wz"], "max("),
    (Channel::VzDot, "u4 * airspeed", 1.0, &["u4", "airspeed"], ""),
    (Channel::VyDot, "sin(yaw)", 0.4, &["yaw"], "sin("),
    (Channel::WxDot, "u1 * abs(u1)", 5.0, &["u1"], "u1"),
    (Channel::WyDot, "t", 0.03, &["t"], "t"),
    (Channel::VxDot, "cos(3 * height)", 0.25, &["height"], "sin("),
];

/// What is found for one of [`ALIENS`]: right channel and variable first, right shape.
fn judge(alien: usize, found: &[Unknown]) -> (bool, bool) {
    let (channel, _, _, variables, shape) = ALIENS[alien];
    let Some(top) = found.first() else { return (false, false) };
    let first = top.depends_on.first().is_some_and(|first| variables.contains(&first.variable.as_str()));
    let shaped = top.suggested_formula.as_ref().is_some_and(|suggested| suggested.formula.contains(shape));
    (top.channel == channel.name() && first, shaped)
}

#[test]
fn hidden_dependences_are_named() -> Result<()> {
    let (mut first, mut shapes) = (0, 0);
    for (alien, (channel, formula, scale, ..)) in ALIENS.into_iter().enumerate() {
        let table = made(100 + alien as u64, 24, 0.0)?.with(channel, formula, scale)?.table()?;
        let found = unknown(&table, &UnknownOptions::default())?;
        let (right, shaped) = judge(alien, &found);
        assert!(found.len() <= 1, "{formula}: only one channel depends: {found:?}");
        for found in &found {
            assert!(found.r2 > found.null_r2_95 && found.r2 <= 1.0 && found.r2 <= found.r2_with_feedback + 0.01);
            assert!(found.depends_on.iter().map(|part| part.share).sum::<f64>() < 1.0 + 1e-9);
            if let Some(suggested) = &found.suggested_formula {
                assert!(crate::formula::Formula::parse(&suggested.formula)?.to_string() == suggested.formula);
            }
        }
        first += usize::from(right);
        shapes += usize::from(shaped);
    }
    assert!(first >= 7 && shapes >= 6, "{first} named and {shapes} drawn of 8");
    Ok(())
}

#[test]
fn the_sine_of_height_comes_back_as_a_term() -> Result<()> {
    let table = made(7, 40, 0.0)?.with(Channel::VzDot, "sin(2 * height)", 1.0)?.table()?;
    let found = unknown(&table, &UnknownOptions::default())?;
    let [found] = found.as_slice() else { panic!("one channel: {found:?}") };
    assert!(found.depends_on[0].variable == "height" && found.depends_on[0].share > 0.85, "{found:?}");
    let suggested = found.suggested_formula.as_ref().map(|term| (term.formula.as_str(), term.coefficient, term.r2));
    assert!(suggested.is_some_and(|(_, coefficient, r2)| (coefficient.abs() - 1.0).abs() < 0.1 && r2 > 0.7), "{found:?}");
    let json = serde_json::to_value(found).map_err(|error| Error::Undetermined(error.to_string()))?;
    assert_eq!((&json["channel"], &json["suggested_formula"]["channel"]), (&"vz_dot".into(), &"vz_dot".into()));
    Ok(())
}

#[test]
fn gusts_alone_are_not_explained() -> Result<()> {
    let mut alarms = 0;
    for seed in 0..20 {
        alarms += usize::from(!unknown(&made(seed, 20, 0.0)?.table()?, &UnknownOptions::default())?.is_empty());
    }
    assert!(alarms <= 1, "{alarms} false alarms in 20");
    Ok(())
}

#[test]
fn sticks_that_follow_gusts_are_not_causes() -> Result<()> {
    for seed in 0..3 {
        let table = made(200 + seed, 30, 1.0)?.table()?;
        let search = CrossFit::new(&table, &UnknownOptions::default());
        let roll = search.dependence(&search.features, &search.starts, &table.residual[Channel::WxDot]);
        assert!(roll.r2_with_feedback > WORTH, "there is something to resist: {}", roll.r2_with_feedback);
        assert_eq!(unknown(&table, &UnknownOptions::default())?, []);
    }
    let table = made(300, 30, 1.0)?.with(Channel::VzDot, "sin(2 * height)", 0.5)?.table()?;
    let found = unknown(&table, &UnknownOptions::default())?;
    let named = found.first().is_some_and(|top| top.channel == "vz_dot" && top.depends_on[0].variable == "height");
    assert!(named, "a cause beside the feedback is still seen: {found:?}");
    Ok(())
}

#[cfg(feature = "rayon")]
#[test]
fn the_number_of_threads_changes_nothing() -> Result<()> {
    let table = made(5, 12, 0.0)?.with(Channel::VxDot, "exp(-((vx - 4) / 1.5)^2)", 1.0)?.table()?;
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| Error::Undetermined(error.to_string()))?;
        pool.install(|| unknown(&table, &UnknownOptions::default()))
    };
    let (one, three) = (on(1)?, on(3)?);
    assert!(!one.is_empty() && one == three);
    Ok(())
}

#[test]
fn rows_stay_within_blocks_spans_and_what_was_recorded() -> Result<()> {
    let mut made = made(1, 3, 0.0)?;
    made.flights[1].absent.push(Column::Yaw);
    let spans = [(0, 0, 1003), (0, 1100, 1500), (1, 10, 20), (1, 700, 1500)];
    let spans: Vec<Span> = spans.into_iter().map(|(flight, start, end)| Span { flight, start, end }).collect();
    let residuals = |flight: usize| Ok(made.residual[flight].clone());
    let table = ResidualTable::new(&made.flights, &spans, &residuals, 10.0, ROWS_MAX)?;
    // Five samples a row, 100 rows a block: 200 + 80 + 2 + 160 rows.
    assert_eq!(table.len(), 442);
    assert_eq!(table.blocks().iter().map(ExactSizeIterator::len).collect::<Vec<_>>(), [100, 100, 80, 2, 100, 60]);
    assert!(table.feature("sin(yaw)").is_none() && table.feature("height").is_some() && table.feature("lag(u4, 0.4)").is_some());
    let expected = made.residual[0][Channel::VzDot][5..10].iter().sum::<f64>() / 5.0;
    assert!((table.residual[Channel::VzDot][1] - expected).abs() < 1e-12 && (table.time_s[1] - 0.14).abs() < 1e-12);
    let few = ResidualTable::new(&made.flights, &spans, &residuals, 10.0, 100)?;
    assert!(few.len() <= 100 && few.len() > 50, "{}", few.len());
    let outside = [Span { flight: 0, start: 0, end: 1501 }];
    assert!(matches!(ResidualTable::new(&made.flights, &outside, &residuals, 10.0, 100), Err(Error::Shape { .. })));
    assert!(matches!(ResidualTable::new(&made.flights, &[], &residuals, 10.0, 100), Err(Error::Undetermined(_))));
    assert!(matches!(unknown(&table, &UnknownOptions::default()), Err(Error::Undetermined(text)) if text.contains("6 blocks")));
    let mut uneven = table;
    uneven.residual[Channel::WxDot].pop();
    assert!(matches!(unknown(&uneven, &UnknownOptions::default()), Err(Error::Shape { .. })));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_pairing_moves_every_row_to_another_block(lengths in prop::collection::vec(1..400_usize, 8..20), index in 0..50_u64) {
        let flights = lengths.iter().enumerate().flat_map(|(flight, length)| vec![flight; *length]).collect::<Vec<_>>();
        let rows = flights.len();
        let mut table = ResidualTable { names: vec!["vx".into()], features: vec![vec![0.0; rows]], ..Default::default() };
        table.residual = PerChannel::from_fn(|_| vec![0.0; rows]);
        (table.block, table.flight) = (flights.clone(), flights);
        let paired = CrossFit::new(&table, &UnknownOptions::default()).pairing(index);
        prop_assert_eq!(paired.len(), rows);
        prop_assert!(paired.iter().enumerate().all(|(row, other)| table.block[row] != table.block[*other]));
    }
}
