//! What holds for every entry of the catalogue: it is whole, it can be stored, and it gives numbers on any state.

use super::super::{Model, standard_names};
use super::*;
use crate::flight::{Column, Flight, Targets};
use crate::physics::{Effect, Origin};
use crate::{Error, Result};
use proptest::prelude::*;
use std::collections::BTreeSet;

const STEP_S: f64 = 0.01;

/// The paper's model with numbers of a helicopter's size.
pub(super) fn helicopter() -> Model {
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

#[test]
fn the_table_is_complete() {
    let table = "quad_drag vel_cross inertia_cross ctrl_cross flap_tilt tail_side_force collective_torque heave_torque transl_lift \
        climb_inflow inflow_lag vortex_ring ground_effect rate_cross cyclic_lag ctrl_delay servo_rate_limit tail_lag collective_lag \
        rotor_droop stall_saturation ctrl_nonlin weathercock dihedral_speedstab speed_damping tail_rotor_inflow wind imu_lever \
        cg_offset tilt_misalign sensor_bias sync mass_drift added_mass";
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
        assert!(combinations <= 15, "{kind}: {combinations} columns");
        if !entry.swaps.is_empty() {
            assert!(entry.coefficients.is_empty(), "{kind}: a swap has no free coefficient");
        }
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
        for term in &effect.terms {
            let constants = term.regressor.names().into_iter().filter(|name| model.constant(effect, name).is_some());
            let known: Vec<&str> = standard_names().into_iter().chain(constants).collect();
            term.regressor.check_names(&known)?;
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
            model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients).for_each(|coefficient| coefficient.value = 0.0);
        }
        let flight = flight(&wild)?;
        let predicted = model.predict(&flight)?;
        let mut stream = model.stream(STEP_S)?;
        stream.reset(flight.start_s);
        for (sample, state) in wild.iter().enumerate() {
            let found = stream.push(&std::array::from_fn(|column| flight.column(Column::STATE[column])[sample]))?;
            for (channel, values) in predicted.iter().enumerate() {
                prop_assert!(found[channel].is_finite());
                prop_assert_eq!(found[channel].to_bits(), values[sample].to_bits(), "sample {}: {:?}", sample, state);
            }
        }
    }
}
