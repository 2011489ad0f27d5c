//! What holds for every entry of the catalogue: it is whole, it can be stored, and it gives numbers on any state.

use super::super::{Model, SIGNALS, standard_names};
use super::*;
use crate::flight::{Channel, Column, Flight, PerChannel, Targets};
use crate::physics::rotors::tests::four;
use crate::physics::{Columns, Effect, Origin, Wanted};
use crate::{Error, Result};
use proptest::prelude::*;
use std::collections::BTreeSet;

const STEP_S: f64 = 0.01;

/// The paper's model with numbers of a helicopter's size.
pub(in super::super) fn helicopter() -> Model {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    let values = [-0.05, -0.06, -1.42, -20.0, -0.51, -9.0, -8.0, -5.5, 70.0, 60.0, 50.0, -1.23, -0.21, 0.14];
    let coefficients = model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
    coefficients.zip(values).for_each(|(coefficient, value)| coefficient.value = value);
    model
}

/// An effect for that helicopter with its coefficients set, in order.
pub(super) fn effect(kind: &str, values: &[f64]) -> Result<Effect> {
    let definition = definition(kind).ok_or_else(|| Error::Undetermined(format!("no `{kind}`")))?;
    let mut effect = definition.effect(4.58, 0.8);
    effect.coefficients.iter_mut().zip(values).for_each(|(coefficient, value)| coefficient.value = *value);
    Ok(effect)
}

/// The helicopter with every effect of the catalogue at some size.
fn with_everything() -> Model {
    let mut model = helicopter();
    model.rotors = four().expect("speeds parse");
    for (index, definition) in definitions().enumerate() {
        let mut effect = definition.effect(model.mass_kg, model.rotor_radius_m);
        for (place, coefficient) in effect.coefficients.iter_mut().enumerate() {
            coefficient.value = 0.01 * (1 + index + place) as f64;
            if let Some(values) = &mut coefficient.by_flight {
                values.insert("a \"b\"".into(), 0.5 + place as f64);
            }
        }
        model.effects.push(effect);
    }
    model
}

fn blanked(model: &mut Model) {
    for coefficient in model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients) {
        coefficient.value = 0.0;
        coefficient.by_flight = coefficient.by_flight.take().map(|_| std::collections::BTreeMap::new());
    }
}

#[test]
fn the_table_is_complete() {
    let table = "quad_drag vel_cross inertia_cross ctrl_cross flap_tilt tail_side_force collective_torque heave_torque transl_lift \
        climb_inflow inflow_lag vortex_ring ground_effect rate_cross cyclic_lag ctrl_delay servo_rate_limit tail_lag collective_lag \
        rotor_droop rotor_acceleration rotor_inflow rotor_drag rotor_gyro stall_saturation ctrl_nonlin weathercock dihedral_speedstab \
        blowback_climb blowback_thrust speed_damping tail_rotor_inflow wind imu_lever cg_offset trim_shift tilt_misalign sensor_bias sync mass_drift added_mass";
    let expected: BTreeSet<&str> = table.split_whitespace().collect();
    assert_eq!(definitions().map(|definition| definition.kind).collect::<BTreeSet<_>>(), expected);
    assert_eq!(definitions().filter(|entry| entry.notes.is_some_and(|notes| !notes.searched)).count(), 1);
    assert_eq!(kinds().collect::<BTreeSet<_>>().len(), kinds().count(), "kinds are unique");
}

#[test]
fn every_entry_is_whole() -> Result<()> {
    for entry in definitions() {
        let kind = entry.kind;
        entry.effect(4.58, 0.8).check(kind)?;
        assert!(!entry.meaning.is_empty() && !entry.terms.is_empty() | !entry.swaps.is_empty(), "{kind}");
        let Some(notes) = entry.notes else { panic!("{kind} has no notes") };
        assert!([notes.excitation, notes.would_tell_apart, notes.source].iter().all(|text| text.len() > 10), "{kind}");
        assert!(!notes.vehicles.is_empty(), "{kind}");
        for other in notes.confusable_with {
            let back = definition(other).and_then(|other| other.notes);
            assert!(
                back.is_some_and(|notes| notes.confusable_with.contains(&kind)),
                "{kind} is like {other}, and not the other way"
            );
        }
        for coefficient in entry.coefficients {
            let [low, high] = coefficient.bounds;
            let name = coefficient.name;
            assert!(low.is_finite() && high.is_finite() && low < high, "{kind}.{name}");
            assert!(!coefficient.unit.is_empty() && !coefficient.meaning.is_empty(), "{kind}.{name}");
            let Some([least, most]) = coefficient.expected else { panic!("{kind}.{name} has no expected range") };
            assert!(low <= least && least < most && most <= high, "{kind}.{name}");
            assert!(coefficient.by_flight.is_none_or(|deviation| 0.0 < deviation && deviation < high), "{kind}.{name}");
            assert!(low <= 0.0 && 0.0 <= high, "{kind}.{name}: no effect at all must be allowed");
        }
        let mut combinations = 1;
        for parameter in entry.parameters {
            let ([low, high], name) = (parameter.bounds, parameter.name);
            assert!(low.is_finite() && high.is_finite() && low < high && !parameter.unit.is_empty(), "{kind}.{name}");
            assert!(!parameter.meaning.is_empty() && parameter.grid.is_sorted(), "{kind}.{name}");
            assert!(parameter.grid.iter().all(|value| (low..=high).contains(value)), "{kind}.{name}");
            match parameter.origin {
                Origin::Number(number) => assert!((low..=high).contains(&number), "{kind}.{name}"),
                Origin::RotorRadius | Origin::HoverInduced => assert!(parameter.grid.is_empty(), "{kind}.{name}"),
            }
            assert!(parameter.tied_to.is_none_or(|other| entry.parameter(other).is_some()), "{kind}.{name}");
            if parameter.tied_to.is_none() {
                combinations *= parameter.grid.len().max(1);
            }
            assert!(!standard_names().contains(&name) && !Model::CONSTANTS.contains(&name), "{kind}.{name}");
        }
        // A budget of time: each is tried in every step of a search.
        assert!(combinations <= 20, "{kind}: {combinations} columns");
        for within in entry.swaps.iter().flat_map(|swap| swap.within) {
            assert!(definition(within).is_some(), "{kind} swaps within {within}");
        }
    }
    Ok(())
}

#[test]
fn every_name_in_a_formula_is_known() -> Result<()> {
    let model = with_everything();
    for effect in &model.effects {
        for formula in effect.formulas() {
            let numbers = formula.names().into_iter().filter(|name| model.gives(effect, name));
            let known: Vec<&str> =
                standard_names().into_iter().chain(numbers).chain(SIGNALS.iter().map(|signal| signal.name)).collect();
            formula.check_names(&known)?;
        }
    }
    Ok(())
}

#[cfg(feature = "files")]
#[test]
fn the_whole_catalogue_reads_back_as_written() -> Result<()> {
    let model = with_everything();
    assert_eq!(Model::from_toml(&model.to_toml()?, std::path::Path::new("n9"))?, model);
    Ok(())
}

fn flight(samples: &[[f64; 16]]) -> Result<Flight> {
    let columns = std::array::from_fn(|column| samples.iter().map(|state| state.get(column).copied().unwrap_or(0.0)).collect());
    Flight::new("wild", "made_up", 3.0, STEP_S, columns, Targets::Recorded)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_state_gives_numbers_and_a_stream_the_same_bits(
        wild in prop::collection::vec(prop::array::uniform16(prop_oneof![Just(0.0), -1.0..1.0f64, -300.0..300.0f64]), 1..40),
        blank in any::<bool>(),
    ) {
        let mut model = with_everything();
        if blank {
            // Uncalibrated: every thrust and moment in the formulas is zero.
            blanked(&mut model);
        }
        let flight = flight(&wild)?;
        let predicted = model.predict(&flight)?;
        let mut stream = model.stream(STEP_S)?;
        stream.reset(flight.start_s);
        for (sample, state) in wild.iter().enumerate() {
            let found = stream.push(&flight.state(sample))?;
            for (channel, values) in predicted.pairs() {
                prop_assert!(found[channel].is_finite());
                prop_assert_eq!(found[channel].to_bits(), values[sample].to_bits(), "sample {}: {:?}", sample, state);
            }
        }
    }
}

/// A flight of smooth random motion of a helicopter's size, well away from the ground.
pub(in super::super) fn motion(seed: u64, samples: usize) -> Result<Flight> {
    let size = [30.0, 30.0, 5.0, 0.8, 0.5, 3.0, 9.0, 6.0, 4.0, 3.0, 3.0, 3.0, 0.8, 0.8, 0.8, 0.5];
    let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; samples]);
    for (index, (column, size)) in columns.iter_mut().zip(size).enumerate() {
        let stream = phyture_kernels::random::Stream::new(seed, index as u64, 0, 0);
        let waves: Vec<[f64; 2]> = (0..3)
            .map(|wave| [1.0 + 9.0 * stream.uniform(2 * wave), std::f64::consts::TAU * stream.uniform(2 * wave + 1)])
            .collect();
        for (sample, value) in column.iter_mut().enumerate() {
            let time_s = STEP_S * sample as f64;
            *value = size / 3.0 * waves.iter().map(|[rate, phase]| (rate * time_s + phase).sin()).sum::<f64>();
        }
    }
    columns[Column::Z as usize].iter_mut().for_each(|z| *z -= 20.0);
    columns[Column::U4 as usize].iter_mut().for_each(|u4| *u4 += 0.45);
    Flight::new("a", "made_up", 0.0, STEP_S, columns, Targets::Recorded)
}

/// The helicopter with some effects of the catalogue at about their usual sizes.
fn with_some(chosen: &[bool], size: f64) -> Model {
    let mut model = helicopter();
    model.rotors = four().expect("speeds parse");
    for (definition, _) in definitions().zip(chosen).filter(|(_, chosen)| **chosen) {
        let mut effect = definition.effect(model.mass_kg, model.rotor_radius_m);
        for (coefficient, known) in effect.coefficients.iter_mut().zip(definition.coefficients) {
            let [low, high] = known.expected.unwrap_or([-1.0, 1.0]);
            coefficient.value = 0.5 * (low + high) + size * 0.4 * (high - low);
        }
        // A delay of whole samples lies on a corner of the straight line between them.
        effect.parameters.iter_mut().filter(|parameter| !parameter.fixed).for_each(|parameter| parameter.value *= 1.07);
        model.effects.push(effect);
    }
    model
}

/// Of every number of a model the largest difference between its columns and a central difference of the prediction, over the
/// largest value of the column.
fn deviation_of_columns(model: &Model, flight: &Flight) -> Result<Vec<(String, f64)>> {
    let mut columns = Columns::default();
    let regressors = columns.regressors(model, Wanted { parameters: true, ..Wanted::default() })?;
    let nodes: Vec<_> = regressors.iter().map(|regressor| regressor.node).collect();
    let mut numbers: Vec<(usize, usize)> = regressors.iter().filter_map(|r| Some((r.effect, r.number?))).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let mut found = Vec::new();
    for place in numbers {
        let mut slope = PerChannel::splat(vec![0.0; flight.len()]);
        columns.evaluate(&nodes, flight, flight.len(), &mut |range, block| {
            for (index, regressor) in
                regressors.iter().enumerate().filter(|(_, r)| (r.effect, r.number) == (place.0, Some(place.1)))
            {
                slope[regressor.channel][range.clone()].iter_mut().zip(block.column(index)).for_each(|(sum, value)| *sum += value);
            }
            Ok(())
        })?;
        let number = model.effects[place.0].number(place.1).map_or(0.0, |number| number.value);
        // Where a servo's limit begins within the step, a difference sees both sides, and a lag carries it on: then a short step tells.
        let typical = [1e-4, 1e-6].map(|share| difference(model, flight, place, &slope, share * number.abs().max(1e-2)));
        let [long, short] = typical;
        let typical = long?.min(short?);
        found.push((format!("{}.{place:?}", model.effects[place.0].name), typical));
    }
    Ok(found)
}

/// The difference of a slope to that of the prediction over steps of a number, exceeded at 2 % of the samples, over the largest slope.
fn difference(model: &Model, flight: &Flight, place: (usize, usize), slope: &PerChannel<Vec<f64>>, step: f64) -> Result<f64> {
    let moved = |by: f64| {
        let mut moved = model.clone();
        if let Some((value, _)) = moved.effects[place.0].number_mut(place.1) {
            *value += by;
        }
        moved.predict(flight)
    };
    let [far_up, up, down, far_down] = [moved(2.0 * step)?, moved(step)?, moved(-step)?, moved(-2.0 * step)?];
    // A servo that is fast enough has no slope; differences then are rounding.
    let largest = slope.iter().flatten().fold(0.1_f64, |largest, value| largest.max(value.abs()));
    let mut differences: Vec<f64> = Vec::new();
    for channel in Channel::ALL {
        for sample in 0..flight.len() {
            let four =
                far_down[channel][sample] - 8.0 * down[channel][sample] + 8.0 * up[channel][sample] - far_up[channel][sample];
            differences.push((slope[channel][sample] - four / (12.0 * step)).abs() / largest);
        }
    }
    differences.sort_by(f64::total_cmp);
    Ok(differences[differences.len() * 98 / 100])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn columns_are_derivatives_by_every_number_of_every_effect(
        seed in any::<u64>(),
        chosen in prop::collection::vec(any::<bool>(), definitions().count()),
        size in -1.0..1.0f64,
    ) {
        for (number, deviation) in deviation_of_columns(&with_some(&chosen, size), &motion(seed, 120)?)? {
            prop_assert!(deviation < 1e-6, "{number}: {deviation:.1e}");
        }
    }
}

#[test]
fn with_everything_off_the_model_is_the_baseline_to_the_bit() -> Result<()> {
    let flight = motion(5, 300)?;
    let mut model = with_everything();
    let names: Vec<String> = helicopter().effects.iter().map(|effect| effect.name.clone()).collect();
    model.effects.iter_mut().for_each(|effect| effect.enabled = names.contains(&effect.name));
    let (found, expected) = (model.predict(&flight)?, helicopter().predict(&flight)?);
    assert_eq!(found, expected);
    // The sums of the paper's equations, term after term.
    let of = |column: Column| flight.column(column);
    for (sample, expected) in expected[Channel::VzDot].iter().enumerate() {
        let at = |column: Column| of(column)[sample];
        let gravity = crate::flight::attitude::gravity_body(at(Column::Roll), at(Column::Pitch))[2];
        let turning = at(Column::Vx) * at(Column::Wy) - at(Column::Vy) * at(Column::Wx);
        let sum = gravity + turning + -1.42 * at(Column::Vz) + -20.0 * at(Column::U4) + -0.51;
        assert_eq!(expected.to_bits(), sum.to_bits());
    }
    Ok(())
}
