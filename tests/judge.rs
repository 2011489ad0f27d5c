//! The network as judge: stages of a hybrid, what it learned as flights to search, and how its predictions move with the
//! coefficients of its model. The networks are small and untrained: what is tested holds for any weights.
#![cfg(feature = "sim")]

use phyture::critique::ChannelValues;
use phyture::critique::uncertainty::{Effort, Uncertainty, uncertainty};
use phyture::flight::split::{Protocol, Split};
use phyture::flight::windows::windows;
use phyture::flight::{Channel, Column, DataSet, Flight, PerChannel, Span, Window};
use phyture::hybrid::linear::LinearConfig;
use phyture::hybrid::sensitivity::{HALF_WIDTH, half_width};
use phyture::hybrid::{Description, Hybrid, network_target, sequence};
use phyture::nn::{Architecture, PhyTureConfig, Variant};
use phyture::physics::{Correlation, Estimate, Model, calibrate};
use phyture::sim::{Simulation, simulate};
use phyture::tape::Threads;
use phyture::{Error, Result};
use phyture_kernels::Tolerance;

const HISTORY: usize = 16;

struct Case {
    set: DataSet,
    description: Description,
    parameters: Vec<f32>,
    windows: Vec<Window>,
}

impl Case {
    fn new(variant: Variant) -> Result<Self> {
        let set = simulate(&Simulation { minutes: 2.0, seed: 3, ..Simulation::default() })?;
        let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
        let (model, _) = calibrate(&Model::paper("truth", 4.58, [0.18, 0.34, 0.28], 0.8), &set.flights, &split.training)?;
        let config = PhyTureConfig {
            history: HISTORY,
            d_model: 8,
            heads: 2,
            levels: 2,
            stacks: 1,
            moving_average: 5,
            // A rectifier without its kink: differences then converge to the derivative.
            leak: 1.0,
            variant,
            ..PhyTureConfig::default()
        };
        let config = Architecture::from(config);
        let inputs: Vec<String> = Column::STATE.iter().map(|column| column.name().to_owned()).collect();
        let linear = sequence::linear(&set.flights, &split.training, &model, &LinearConfig { lags: 3, ..LinearConfig::default() })?;
        let description = Description {
            envelope: None,
            intervals: None,
            scaling: sequence::scaling(&set.flights, &split.training, &model, &inputs, Some(&linear), &config)?,
            model,
            config,
            inputs,
            linear: Some(linear),
            gate: [1.0, 0.5, 1.0, 0.0, 1.0, 0.75].into(),
            step_s: 0.01,
        };
        let parameters = description.network(false)?.initial(11);
        let windows = windows(&split.test, HISTORY, 40);
        Ok(Self { set, description, parameters, windows })
    }

    fn hybrid(&self, model: &Model) -> Result<Hybrid> {
        Hybrid::new(Description { model: model.clone(), ..self.description.clone() }, self.parameters.clone())
    }

    fn predict(&self, model: &Model) -> Result<Vec<PerChannel<f64>>> {
        self.hybrid(model)?.predict(&self.set.flights, &self.windows, Threads(2))
    }

    /// The model with one coefficient moved.
    fn moved(&self, estimate: &Estimate, by: f64) -> Model {
        let mut model = self.description.model.clone();
        let coefficient = model.effect_mut(&estimate.effect).and_then(|effect| effect.coefficient_mut(&estimate.name));
        coefficient.into_iter().for_each(|coefficient| coefficient.value += by);
        model
    }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |largest, value| largest.max(value.abs()))
}

#[test]
fn stages_end_in_the_prediction_and_a_shut_gate_leaves_the_linear_history() -> Result<()> {
    for variant in Variant::ALL {
        let case = Case::new(variant)?;
        let hybrid = case.hybrid(&case.description.model)?;
        let stages = hybrid.stages(&case.set.flights, &case.windows, Threads(2))?;
        assert!(stages.hybrid == case.predict(&case.description.model)?, "{variant:?}: another prediction");
        assert_eq!(stages.with_linear.is_some(), variant.predicts_residual());
        if let (Some(window), Some(physics)) = (case.windows.last(), stages.physics.last()) {
            let expected = case.description.model.predict(&case.set.flights[window.flight])?;
            assert!(Channel::ALL.into_iter().all(|channel| physics[channel].to_bits() == expected[channel][window.last].to_bits()));
        }
        for (linear, hybrid) in stages.with_linear.iter().flatten().zip(&stages.hybrid) {
            assert!(
                linear[Channel::WxDot].to_bits() == hybrid[Channel::WxDot].to_bits()
                    && linear[Channel::VxDot].to_bits() != hybrid[Channel::VxDot].to_bits()
            );
        }
    }
    Ok(())
}

#[test]
fn reverse_mode_is_the_central_difference_of_the_prediction() -> Result<()> {
    for variant in Variant::ALL {
        let case = Case::new(variant)?;
        let hybrid = case.hybrid(&case.description.model)?;
        let estimates = hybrid.estimates();
        assert_eq!(estimates.len(), 14);
        let found = hybrid.movements(&case.set.flights, &case.windows, &estimates, Threads(2))?;
        let mut through_network = 0.0_f64;
        for (estimate, found) in estimates.iter().zip(&found) {
            // A tenth of the half-width: there truncation (as its square) and rounding of f32 (as its inverse) are about equal.
            let step = 0.1;
            let at = |sign: f64| case.predict(&case.moved(estimate, sign * step * half_width(estimate)));
            let (up, down) = (at(1.0)?, at(-1.0)?);
            let differences: Vec<PerChannel<f64>> =
                up.iter().zip(&down).map(|(up, down)| PerChannel::from_fn(|c| (up[c] - down[c]) / (2.0 * step))).collect();
            let error = largest(
                differences
                    .iter()
                    .zip(found)
                    .flat_map(|(expected, found)| Channel::ALL.into_iter().map(move |c| expected[c] - found.hybrid[c])),
            );
            let scale = largest(differences.iter().flatten().copied());
            assert!(
                error <= Tolerance::Approximate.relative_f32() * scale.max(1.0),
                "{variant:?}, {}.{}: {error:e} of {scale:e}",
                estimate.effect,
                estimate.name
            );
            let learned =
                found.iter().flat_map(|movement| Channel::ALL.into_iter().map(|c| movement.hybrid[c] - movement.physics[c]));
            through_network = through_network.max(largest(learned) / scale.max(f64::MIN_POSITIVE));
        }
        // Where the network reads physics, a good part of the movement goes through it: the test tests something.
        let expected = variant.reads_physics() || !variant.predicts_residual();
        assert_eq!(through_network > 0.01, expected, "{variant:?}: {through_network}");
    }
    Ok(())
}

#[test]
fn drawing_coefficients_anew_agrees_with_reverse_mode_where_the_network_is_nearly_linear() -> Result<()> {
    const DRAWS: usize = 200;
    let case = Case::new(Variant::PhyTure)?;
    let hybrid = case.hybrid(&case.description.model)?;
    let estimates = hybrid.estimates();
    let (flights, windows) = (&case.set.flights, &case.windows);
    let movements = hybrid.movements(flights, windows, &estimates, Threads(2))?;
    let correlations = hybrid.correlations(&estimates);
    let resampled = hybrid.resampled(flights, windows, &estimates, DRAWS, 5, Threads(2))?;
    for channel in Channel::ALL {
        let count = windows.len() as f64;
        let square = |window: usize| {
            let moved = |one: usize| movements[one][window].hybrid[channel];
            let pairs = (0..estimates.len()).flat_map(|i| (0..estimates.len()).map(move |j| (i, j)));
            pairs.map(|(i, j)| moved(i) * correlations[(i, j)] * moved(j)).sum::<f64>()
        };
        let by_reverse = ((0..windows.len()).map(square).sum::<f64>() / count).sqrt() / HALF_WIDTH;
        let by_draws = (resampled.iter().map(|sd| sd[channel].powi(2)).sum::<f64>() / count).sqrt();
        // Four standard errors of a standard deviation from so many draws.
        let chance = 4.0 / (2.0 * (DRAWS - 1) as f64).sqrt();
        assert!((by_draws / by_reverse - 1.0).abs() <= chance, "channel {channel}: {by_draws} and {by_reverse}");
    }
    let again = hybrid.resampled(flights, windows, &estimates, 3, 5, Threads(1))?;
    assert_eq!(again, hybrid.resampled(flights, windows, &estimates, 3, 5, Threads(2))?);
    assert_ne!(again, hybrid.resampled(flights, windows, &estimates, 3, 6, Threads(2))?);
    Ok(())
}

#[test]
fn the_uncertainty_of_a_network_is_a_table_with_totals() -> Result<()> {
    let case = Case::new(Variant::PhyTure)?;
    let mut model = case.description.model.clone();
    for coefficient in model.effect_mut("moment_bias").into_iter().flat_map(|effect| &mut effect.coefficients) {
        coefficient.ci95 = None;
    }
    // What is known of each by itself.
    model.correlations.clear();
    let hybrid = case.hybrid(&model)?;
    let effort = Effort { windows: 10, draws: 4, seed: 1 };
    let found = uncertainty("run", &hybrid, &case.set.flights, &case.windows, effort, Threads(2))?;
    assert_eq!((found.windows, found.draws, found.coefficients.len()), (10.min(case.windows.len()), 4, 11));
    assert_eq!(found.without_interval, ["moment_bias.d_x", "moment_bias.d_y", "moment_bias.d_z"]);
    for channel in Channel::ALL {
        let squares = found.coefficients.iter().filter_map(|one| one.movement.channels()[channel]).map(|value| value * value);
        let total = squares.sum::<f64>().sqrt() / HALF_WIDTH;
        let close = |value: f64| (value - total).abs() <= Tolerance::Close.relative_f64() * total;
        assert!(found.sd.channels()[channel].is_some_and(close));
        assert!(found.share_of_rmse.channels()[channel].is_some_and(|share| share > 0.0));
    }
    let text = found.to_string();
    assert!(text.contains("linear_drag.a_x") && text.contains("rad/s²") && text.contains("from 4 draws"), "{text}");
    assert!(text.contains("Taken as known") && text.contains("independent"), "{text}");
    let json = serde_json::to_string(&found).map_err(|error| Error::Undetermined(error.to_string()))?;
    let back: Uncertainty = serde_json::from_str(&json).map_err(|error| Error::Undetermined(error.to_string()))?;
    assert_eq!(back, found);
    let none = case.hybrid(&Model::paper("bare", 4.58, [0.18, 0.34, 0.28], 0.8))?;
    let refused = uncertainty("run", &none, &case.set.flights, &case.windows, effort, Threads(2));
    assert!(refused.is_err_and(|error| error.to_string().contains("calibrate")));
    Ok(())
}

/// Thrust and its bias, all else being known: that they err together or against each other makes what the parallelogram of their movements says.
#[test]
fn totals_are_of_coefficients_that_vary_together() -> Result<()> {
    let case = Case::new(Variant::PhyTure)?;
    let calibrated = &case.description.model;
    assert!(calibrated.correlations.iter().any(|group| group.numbers.contains(&"vertical_bias.d_z".to_owned())));
    let of = |correlation: Option<f64>| {
        let mut model = calibrated.clone();
        for effect in &mut model.effects {
            let keeps = ["collective_thrust", "vertical_bias"].contains(&effect.name.as_str());
            effect.coefficients.iter_mut().filter(|_| !keeps).for_each(|coefficient| coefficient.ci95 = None);
        }
        let numbers = ["collective_thrust.c_z", "vertical_bias.d_z"].map(str::to_owned).to_vec();
        model.correlations = correlation.map(|value| Correlation { numbers, below: vec![value] }).into_iter().collect();
        let effort = Effort { windows: 30, draws: 60, seed: 1 };
        uncertainty("run", &case.hybrid(&model)?, &case.set.flights, &case.windows, effort, Threads(2))
    };
    let [against, apart, along] = [of(Some(-1.0))?, of(None)?, of(Some(1.0))?];
    assert!(against.note().contains("together") && apart.note().contains("independent"));
    let value = |of: ChannelValues| of.vz_dot.unwrap_or(f64::NAN);
    for pick in [|found: &Uncertainty| found.sd, |found: &Uncertainty| found.sd_of_physics] {
        let [against, apart, along] = [&against, &apart, &along].map(|found| value(pick(found)));
        let halves = (against.powi(2) + along.powi(2)) / 2.0;
        assert!(
            (halves - apart.powi(2)).abs() < Tolerance::Close.relative_f64() * halves && along > 1.5 * against,
            "{against} {apart} {along}"
        );
    }
    // Draws vary together, too: 60 of them are right to 9 %.
    for found in [&against, &apart, &along] {
        let [drawn, sd] = [value(found.sd_resampled), value(found.sd)];
        assert!((drawn - sd).abs() < 0.35 * sd, "{drawn} {sd}");
    }
    Ok(())
}

/// The first samples of each flight, the second too short for one history.
fn short(case: &Case) -> Result<Vec<Flight>> {
    let lengths = [300, HISTORY - 1, 200];
    let cut = |(flight, length): (&Flight, usize)| flight.slice(0..length, flight.name.clone());
    let flights: Vec<Flight> = case.set.flights.iter().zip(lengths).filter_map(cut).collect();
    if flights.len() == 3 { Ok(flights) } else { Err(Error::Undetermined("three flights were wanted".into())) }
}

#[test]
fn what_the_network_learned_is_left_over_by_the_model() -> Result<()> {
    for variant in [Variant::PhyTure, Variant::DirectConcatenation] {
        let case = Case::new(variant)?;
        let hybrid = case.hybrid(&case.description.model)?;
        let flights = short(&case)?;
        let spans = [(0, 0, 300), (1, 0, 15), (2, 50, 120), (2, 150, 200)];
        let spans = spans.map(|(flight, start, end)| Span { flight, start, end });
        for stride in [1, 3] {
            let target = network_target(&hybrid, &flights, &spans, stride, Threads(2))?;
            let names: Vec<&str> = target.set.flights.iter().map(|flight| flight.name.as_str()).collect();
            assert_eq!(names, [&flights[0].name, &flights[2].name]);
            assert!(target.set.notes.iter().any(|note| note.contains(&flights[1].name) && note.contains("left out")));
            for (made, index) in target.set.flights.iter().zip([0, 2]) {
                let original = &flights[index];
                let lasts: Vec<usize> = (HISTORY - 1..original.len()).step_by(stride).collect();
                assert_eq!((made.len(), made.manoeuvre.as_str()), (lasts.len(), original.manoeuvre.as_str()));
                assert!((made.step_s - original.step_s * stride as f64).abs() <= Tolerance::Close.relative_f64());
                assert_eq!(made.start_s.to_bits(), original.time_s(HISTORY - 1).to_bits());
                let all: Vec<Window> = lasts.iter().map(|&last| Window { flight: index, last }).collect();
                let (said, physics) = (hybrid.predict(&flights, &all, Threads(1))?, case.description.model.predict(original)?);
                let model = case.description.model.predict(made)?;
                for (row, &last) in lasts.iter().enumerate() {
                    assert_eq!(made.column(Column::U2)[row].to_bits(), original.column(Column::U2)[last].to_bits());
                    for channel in Channel::ALL {
                        let left = made.column(channel.column())[row] - model[channel][row];
                        let learned = said[row][channel] - physics[channel][last];
                        assert!((left - learned).abs() <= Tolerance::Close.relative_f64() * (1.0 + learned.abs()), "{channel}");
                    }
                }
            }
            // Spans keep what lies in them: sample 15 + k of the original is sample k / stride here.
            let here = target.spans(&spans);
            let start = |sample: usize| (sample - 15_usize).div_ceil(stride);
            assert_eq!(
                here.iter().map(|span| (span.flight, span.start)).collect::<Vec<_>>(),
                [(0, 0), (1, start(50)), (1, start(150))]
            );
            assert_eq!((here[0].end, here[1].end, here[2].end), (start(300), start(120), start(200)));
        }
        let refused = |spans: &[Span], stride| {
            network_target(&hybrid, &flights, spans, stride, Threads(1))
                .map_err(|error| error.to_string())
                .err()
                .unwrap_or_default()
        };
        assert!(refused(&spans[1..2], 1).contains("longer flights"));
        assert!(refused(&spans, 0).contains("stride"));
    }
    Ok(())
}
