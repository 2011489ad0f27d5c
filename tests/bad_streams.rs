//! Flights of the simulator in which several columns are wrong together, or in part of the flight alone, and sticks that are not what moves the axes: what `check` names as
//! the cause.
#![cfg(feature = "sim")]

mod corrupted;

use corrupted::{Columns, Outcome, assert_named, checked, flights};
use phyture::critique::check::{Finding, Severity};
use phyture::flight::attitude::{gravity_body, rotation_body_to_inertial};
use phyture::flight::{Column, GRAVITY_M_S2};

const RATES: [Column; 3] = [Column::Wx, Column::Wy, Column::Wz];
const LINEAR: [Column; 3] = [Column::VxDot, Column::VyDot, Column::VzDot];
const ANGULAR: [Column; 3] = [Column::WxDot, Column::WyDot, Column::WzDot];

fn angles(columns: &Columns, sample: usize) -> [f64; 3] {
    [Column::Roll, Column::Pitch, Column::Yaw].map(|column| columns[column as usize][sample])
}

#[test]
fn accelerations_in_each_others_columns_and_gravity_taken_off_as_if_level_are_readings() -> Outcome {
    assert_named("velocity_targets", &["linear and angular", "exchanged"], |columns| {
        LINEAR.into_iter().zip(ANGULAR).for_each(|(linear, angular)| columns.swap(linear as usize, angular as usize));
    })?;
    assert_named("velocity_targets", &["gravity was taken off", "as though the aircraft were level"], |columns| {
        for sample in 0..columns[0].len() {
            let [roll, pitch, _] = angles(columns, sample);
            let gravity = gravity_body(roll, pitch);
            for (axis, column) in LINEAR.into_iter().enumerate() {
                columns[column as usize][sample] += if axis == 2 { GRAVITY_M_S2 } else { 0.0 } - gravity[axis];
            }
        }
    })
}

#[test]
fn angles_of_another_sequence_are_told_by_it() -> Outcome {
    assert_named("attitude_rate", &["sequence x, y, z"], |columns| {
        for sample in 0..columns[0].len() {
            let [roll, pitch, yaw] = angles(columns, sample);
            let [[r11, r12, r13], [_, _, r23], [_, _, r33]] = rotation_body_to_inertial(roll, pitch, yaw);
            let other = [(-r23).atan2(r33), r13.asin(), (-r12).atan2(r11)];
            for (column, angle) in [Column::Roll, Column::Pitch, Column::Yaw].into_iter().zip(other) {
                columns[column as usize][sample] = angle;
            }
        }
    })
}

#[test]
fn rates_of_two_gyros_and_averaged_ones_are_named_with_the_time() -> Outcome {
    assert_named("by_turns_wx", &["wx, wy, wz", "every other sample is about", "older"], |columns| {
        for rate in RATES {
            let old = columns[rate as usize].clone();
            columns[rate as usize]
                .iter_mut()
                .enumerate()
                .skip(5)
                .filter(|(k, _)| k % 2 == 1)
                .for_each(|(k, value)| *value = old[k - 4]);
        }
    })?;
    assert_named("averaged_wx", &["rates (wx, wy, wz) are a mean over about 0.30 s"], |columns| {
        for rate in RATES {
            let old = columns[rate as usize].clone();
            let mean = |k: usize| {
                let about = &old[k.saturating_sub(15)..(k + 16).min(old.len())];
                about.iter().sum::<f64>() / about.len() as f64
            };
            columns[rate as usize] = (0..old.len()).map(mean).collect();
        }
    })
}

#[test]
fn an_accelerometer_at_the_end_of_its_range_is_named_with_the_end() -> Outcome {
    assert_named("saturated_vz_dot", &["saturated", "vz_dot at 3.000 m/s²"], |columns| {
        columns[Column::VzDot as usize].iter_mut().for_each(|value| *value = value.clamp(-3.0, 3.0));
    })
}

#[test]
fn a_stick_that_is_the_demand_of_a_rate_controller_is_no_stick() -> Outcome {
    assert_named("demand_u3", &["u3 is the yaw rate of 80 ms later", "demand of a rate controller"], |columns| {
        let rate = columns[Column::Wz as usize].clone();
        let ahead = |k: usize| 0.2 * rate[(k + 8).min(rate.len() - 1)];
        columns[Column::U3 as usize] = (0..rate.len()).map(ahead).collect();
    })
}

#[test]
fn a_gyro_that_drifts_and_a_logger_that_slows_down_are_named_in_the_flights_that_have_them() -> Outcome {
    let drift = checked(flights(
        |index| index % 4 == 0,
        |columns| columns[Column::Wy as usize].iter_mut().enumerate().for_each(|(k, rate)| *rate += 1e-4 * k as f64),
    )?);
    let found = drift.findings.iter().find(|finding| finding.name == "drifting_wy").ok_or_else(|| drift.to_string())?;
    assert!(found.verdict == Severity::Fault && found.message.contains("grows by about 0.01"), "{}", found.message);
    let slow = checked(flights(
        |index| index % 4 == 0,
        |columns| {
            let kept = |k: &usize| k % 500 < 300 || k.is_multiple_of(2);
            for values in columns.iter_mut() {
                *values = (0..values.len()).filter(kept).map(|k| values[k]).collect();
            }
        },
    )?);
    let found = slow.findings.iter().find(|finding| finding.name == "uneven_time").ok_or_else(|| slow.to_string())?;
    assert!(found.verdict == Severity::Fault && found.message.contains("time stamps"), "{}", found.message);
    Ok(())
}

#[test]
fn an_attitude_in_degrees_from_a_time_on_and_a_range_that_was_switched_are_named_with_the_time() -> Outcome {
    let degrees = checked(flights(
        |index| index == 2,
        |columns| {
            let middle = columns[0].len() / 2;
            for angle in [Column::Roll, Column::Pitch, Column::Yaw] {
                columns[angle as usize].iter_mut().skip(middle).for_each(|value| *value = value.to_degrees());
            }
        },
    )?);
    let says = |finding: &&Finding| ["from 16 s on", "the angles are in degrees"].iter().all(|part| finding.message.contains(part));
    let found = degrees.findings.iter().find(says).ok_or_else(|| degrees.to_string())?;
    assert!(found.verdict == Severity::Fault && found.flights.len() == 1, "{}", found.message);
    let switched = checked(flights(
        |index| index % 3 == 0,
        |columns| {
            let middle = columns[0].len() / 2;
            for stick in [Column::U1, Column::U2] {
                columns[stick as usize].iter_mut().skip(middle).for_each(|u| *u *= 0.6);
            }
        },
    )?);
    let found = switched.findings.iter().find(|finding| finding.name == "range_u1").ok_or_else(|| switched.to_string())?;
    assert!(found.verdict == Severity::Fault && found.message.contains("u1, u2 have 1."), "{}", found.message);
    Ok(())
}

#[test]
fn a_stick_whose_end_point_was_not_taught_in_is_uneven_in_the_flights_that_have_it() -> Outcome {
    let uneven = checked(flights(
        |index| index % 2 == 0,
        |columns| columns[Column::U2 as usize].iter_mut().filter(|u| **u < 0.0).for_each(|u| *u *= 0.5),
    )?);
    let found = uneven.findings.iter().find(|finding| finding.name == "uneven_u2").ok_or_else(|| uneven.to_string())?;
    assert!(found.verdict == Severity::Fault && found.message.contains("one side"), "{}", found.message);
    Ok(())
}
