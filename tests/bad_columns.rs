//! Flights of the simulator in which one column, or an accelerometer's place, or the order of rows breaks the relations of mechanics: what `check` names as
//! the cause.
#![cfg(feature = "sim")]

mod corrupted;

use corrupted::{Columns, Outcome, assert_named, checked, flights};
use phyture::critique::check::Severity;
use phyture::flight::Column;
use phyture::flight::attitude::cross;

fn of(columns: &Columns, three: [Column; 3], sample: usize) -> [f64; 3] {
    three.map(|column| columns[column as usize][sample])
}

/// A linear congruence (Knuth 1981): numbers of mean 0 and variance 1.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 1_u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        12_f64.sqrt() * (f64::from(state >> 8) / f64::from(1 << 24) - 0.5)
    }
}

#[test]
fn a_late_position_is_a_warning_with_its_delay() -> Outcome {
    let late = |columns: &mut Columns| {
        for column in [Column::X, Column::Y, Column::Z] {
            let values = columns[column as usize].clone();
            let delayed = (0..values.len()).map(|sample| values[sample.saturating_sub(30)]);
            columns[column as usize] = delayed.collect();
        }
    };
    assert_named("late_x", &["position (x, y, z) comes late by about 300 ms"], late)?;
    assert!(!checked(flights(|index| index == 2, late)?).fault);
    Ok(())
}

#[test]
fn a_rate_that_is_late_from_a_time_on_is_named_with_the_time() -> Outcome {
    let found = checked(flights(
        |index| index == 2,
        |columns| {
            let values = columns[Column::Wz as usize].clone();
            let middle = values.len() / 2;
            for sample in middle..values.len() {
                columns[Column::Wz as usize][sample] = values[(sample - 20).max(middle)];
            }
        },
    )?);
    let finding = found.findings.iter().find(|finding| finding.name == "late_wz").ok_or_else(|| found.to_string())?;
    assert!(finding.message.contains("late by about 200 ms") && finding.message.contains("from "), "{}", finding.message);
    Ok(())
}

#[test]
fn a_filtered_velocity_is_named_with_its_time_constant() -> Outcome {
    // A step less than what the share of it suggests: (0.45 − 0.01) s.
    assert_named("filtered_vz", &["time constant of about 0.44 s"], |columns| {
        let values = &mut columns[Column::Vz as usize];
        let mut state = values[0];
        for value in values {
            state += (*value - state) * 0.01 / 0.45;
            *value = state;
        }
    })
}

#[test]
fn a_sign_that_was_lost_and_counts_that_overflow_are_named() -> Outcome {
    assert_named("sign_lost_vy", &["vy", "minus signs"], |columns| {
        columns[Column::Vy as usize].iter_mut().for_each(|value| *value = value.abs());
    })?;
    let report = checked(flights(
        |index| index < 4,
        |columns| {
            for rate in &mut columns[Column::Wx as usize] {
                *rate = (*rate + 1.5).rem_euclid(3.0) - 1.5;
            }
        },
    )?);
    let finding = report.findings.iter().find(|finding| finding.name == "overflow_wx").ok_or_else(|| report.to_string())?;
    assert!(finding.message.contains("leaps by 3.00 rad/s and back"), "{}", finding.message);
    Ok(())
}

#[test]
fn a_heading_that_goes_with_a_stick_and_an_attitude_that_settles_are_named() -> Outcome {
    let report = checked(flights(
        |index| index % 2 == 0,
        |columns| {
            for sample in 0..columns[0].len() {
                columns[Column::Yaw as usize][sample] += 0.3 * columns[Column::U4 as usize][sample];
            }
        },
    )?);
    let finding = report.findings.iter().find(|finding| finding.name == "disturbed_yaw").ok_or_else(|| report.to_string())?;
    assert!(finding.message.contains("yaw goes with u4: 0.3"), "{}", finding.message);
    // A flight that turns faster than its filter settles does not show it.
    let report = checked(flights(
        |index| index == 10,
        |columns| {
            for (sample, roll) in columns[Column::Roll as usize].iter_mut().enumerate() {
                *roll += 0.5 * (-0.01 * sample as f64 / 4.0).exp();
            }
        },
    )?);
    let finding = report.findings.iter().find(|finding| finding.name == "settling_roll").ok_or_else(|| report.to_string())?;
    assert!(finding.message.contains("settles with a time constant of about 4.0 s"), "{}", finding.message);
    Ok(())
}

#[test]
fn gravity_taken_off_twice_and_an_accelerometer_off_the_centre_are_named() -> Outcome {
    let gravity = |columns: &mut Columns| columns[Column::VzDot as usize].iter_mut().for_each(|value| *value -= 9.81);
    let report = checked(flights(|index| index == 1, gravity)?);
    let finding = report.findings.iter().find(|finding| finding.name == "off_vz_dot").ok_or_else(|| report.to_string())?;
    assert!(finding.message.contains("vz_dot has an offset of about -9.8"), "{}", finding.message);
    assert_named("off_centre_vx_dot", &["(0.40, ", ", 0.15) m"], |columns| {
        for sample in 0..columns[0].len() {
            let rates = of(columns, [Column::Wx, Column::Wy, Column::Wz], sample);
            let turning = of(columns, [Column::WxDot, Column::WyDot, Column::WzDot], sample);
            let arm = [0.4, 0.0, 0.15];
            let (along, inwards) = (cross(turning, arm), cross(rates, cross(rates, arm)));
            for (axis, column) in [Column::VxDot, Column::VyDot, Column::VzDot].into_iter().enumerate() {
                columns[column as usize][sample] += along[axis] + inwards[axis];
            }
        }
    })
}

#[test]
fn noise_of_a_derivative_and_rows_in_the_wrong_order_are_named_in_the_flights_that_have_them() -> Outcome {
    let noisy = checked(flights(
        |index| index % 2 == 0,
        |columns| {
            let mut noise = noise();
            columns[Column::WxDot as usize].iter_mut().for_each(|value| *value += 2.0 * noise());
        },
    )?);
    let finding = noisy.findings.iter().find(|finding| finding.name == "noise_wx_dot").ok_or_else(|| noisy.to_string())?;
    assert!(finding.message.contains("wx_dot has noise of 1."), "{}", finding.message);
    let joined = checked(flights(
        |index| index % 2 == 0,
        |columns| {
            columns.iter_mut().for_each(|values| {
                let cut = 2 * values.len() / 5;
                values.rotate_left(cut);
            });
        },
    )?);
    let finding = joined.findings.iter().find(|finding| finding.name == "rows").ok_or_else(|| joined.to_string())?;
    assert!(finding.message.contains("rows do not follow each other"), "{}", finding.message);
    Ok(())
}

#[test]
fn velocities_in_level_axes_and_rates_of_the_angles_are_readings_of_their_own() -> Outcome {
    use phyture::flight::attitude::{euler_rates, rotate, rotation_body_to_inertial};
    let angles = [Column::Roll, Column::Pitch, Column::Yaw];
    let put = |columns: &mut Columns, three: [Column; 3], sample: usize, values: [f64; 3]| {
        three.into_iter().zip(values).for_each(|(column, value)| columns[column as usize][sample] = value);
    };
    let level = checked(flights(
        |_| true,
        |columns| {
            for sample in 0..columns[0].len() {
                let [roll, pitch, _] = of(columns, angles, sample);
                let velocities = [Column::Vx, Column::Vy, Column::Vz];
                let velocity = rotate(&rotation_body_to_inertial(roll, pitch, 0.0), of(columns, velocities, sample));
                put(columns, velocities, sample, velocity);
            }
        },
    )?);
    assert!(level.summary.contains("level axes"), "{level}");
    let of_angles = checked(flights(
        |_| true,
        |columns| {
            for sample in 0..columns[0].len() {
                let [roll, pitch, _] = of(columns, angles, sample);
                let rates = [Column::Wx, Column::Wy, Column::Wz];
                // Not where the angles themselves jump.
                let turned = euler_rates(roll, pitch.clamp(-1.4, 1.4), of(columns, rates, sample));
                put(columns, rates, sample, turned);
            }
        },
    )?);
    assert!(of_angles.findings.iter().any(|finding| finding.message.contains("Euler rates")), "{of_angles}");
    Ok(())
}

#[test]
fn lines_copies_repeated_rows_and_sticks_that_drop_out_are_named() -> Outcome {
    assert_named("interpolated_roll", &["roll", "4.000 Hz", "interpolated"], |columns| {
        let values = columns[Column::Roll as usize].clone();
        for (sample, value) in columns[Column::Roll as usize].iter_mut().enumerate() {
            let (before, part) = (sample / 25 * 25, (sample % 25) as f64 / 25.0);
            let after = values[(before + 25).min(values.len() - 1)];
            *value = values[before] + part * (after - values[before]);
        }
    })?;
    assert_named("same_u1_u2", &["u1 and u2 are identical"], |columns| {
        columns[Column::U2 as usize] = columns[Column::U1 as usize].clone();
    })?;
    assert_named("padded", &["the last row is repeated", "10.00 s"], |columns| {
        for values in columns.iter_mut() {
            let end = values.len() - 1000;
            let last = values[end - 1];
            values[end..].fill(last);
        }
    })?;
    assert_named("controls_dropout", &["all controls leap to one value", "for up to 1.50 s"], |columns| {
        for control in [Column::U1, Column::U2, Column::U3, Column::U4] {
            columns[control as usize][800..950].fill(0.0);
        }
    })
}

#[test]
fn sticks_behind_a_mixer_and_a_trim_that_was_moved_are_named_in_the_flights_that_have_them() -> Outcome {
    let turned = checked(flights(
        |index| index % 2 == 0,
        |columns| {
            let (sine, cosine) = 20.0_f64.to_radians().sin_cos();
            for sample in 0..columns[0].len() {
                let [u1, u2] = [Column::U1, Column::U2].map(|column| columns[column as usize][sample]);
                columns[Column::U1 as usize][sample] = cosine * u1 - sine * u2;
                columns[Column::U2 as usize][sample] = sine * u1 + cosine * u2;
            }
        },
    )?);
    let finding = turned.findings.iter().find(|finding| finding.name.starts_with("mixed_u")).ok_or_else(|| turned.to_string())?;
    assert!(finding.verdict == Severity::Fault && finding.message.contains("mixed or turned"), "{}", finding.message);
    let moved = checked(flights(
        |index| index == 3,
        |columns| {
            let at = 3 * columns[0].len() / 5;
            columns[Column::U1 as usize][at..].iter_mut().for_each(|u| *u += 0.15);
        },
    )?);
    let finding = moved.findings.iter().find(|finding| finding.name == "trim_moved_u1").ok_or_else(|| moved.to_string())?;
    assert!(finding.verdict == Severity::Warning && finding.flights.len() == 1, "{}", finding.message);
    assert!(finding.message.contains("u1 stands 0.1") && finding.message.contains("higher"), "{}", finding.message);
    Ok(())
}
