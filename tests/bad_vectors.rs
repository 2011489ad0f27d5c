//! Flights of the simulator in which a vector has too much of another, points elsewhere or is wrong by itself, and sticks that act only in stretches or on all axes:
//! what `check` names as the cause.
#![cfg(feature = "sim")]

mod corrupted;

use corrupted::{Columns, Outcome, assert_named, checked, flights};
use phyture::critique::check::Severity;
use phyture::flight::attitude::{cross, euler_to_quaternion, gravity_body, quaternion_to_euler};
use phyture::flight::{Column, DataSet, GRAVITY_M_S2};

const ATTITUDE: [Column; 3] = [Column::Roll, Column::Pitch, Column::Yaw];
const VELOCITY: [Column; 3] = [Column::Vx, Column::Vy, Column::Vz];
const RATES: [Column; 3] = [Column::Wx, Column::Wy, Column::Wz];
const LINEAR: [Column; 3] = [Column::VxDot, Column::VyDot, Column::VzDot];
const CONTROLS: [Column; 4] = [Column::U1, Column::U2, Column::U3, Column::U4];

fn of(columns: &Columns, three: [Column; 3], sample: usize) -> [f64; 3] {
    three.map(|column| columns[column as usize][sample])
}

fn set(columns: &mut Columns, three: [Column; 3], sample: usize, values: [f64; 3]) {
    three.into_iter().zip(values).for_each(|(column, value)| columns[column as usize][sample] = value);
}

/// Each sample of three columns becomes what `change` makes of it and of the other columns.
fn each(columns: &mut Columns, three: [Column; 3], change: impl Fn(&Columns, usize) -> [f64; 3]) {
    let before = columns.clone();
    (0..before[0].len()).for_each(|sample| set(columns, three, sample, change(&before, sample)));
}

#[test]
fn a_velocity_beside_the_centre_of_gravity_is_named_with_its_place_and_mended() -> Outcome {
    let moved = |columns: &mut Columns| {
        each(columns, VELOCITY, |columns, sample| {
            let (velocity, turning) = (of(columns, VELOCITY, sample), cross(of(columns, RATES, sample), [0.7, 0.3, 0.0]));
            std::array::from_fn(|axis| velocity[axis] + turning[axis])
        });
    };
    assert_named("holds_other_vx", &["lever arm", "(0.70, 0.30, "], moved)?;
    // The line that is printed undoes it.
    let report = checked(flights(|_| true, moved)?);
    let finding = report.findings.iter().find(|finding| finding.name == "holds_other_vx").ok_or("not named")?;
    let line = finding.set.as_ref().ok_or("no line")?;
    assert!(line.contains("vx = \"vx - (wy * "), "{line}");
    Ok(())
}

#[test]
fn gyros_that_feel_acceleration_and_axes_that_are_mixed_are_named_with_their_gains() -> Outcome {
    assert_named("holds_other_wx", &["g-sensitivity", "wz has", "the specific force along z"], |columns| {
        each(columns, RATES, |columns, sample| {
            let [roll, pitch, _] = of(columns, ATTITUDE, sample);
            let (linear, gravity) = (of(columns, LINEAR, sample), gravity_body(roll, pitch));
            let turning = cross(of(columns, RATES, sample), of(columns, VELOCITY, sample));
            let [wx, wy, wz] = of(columns, RATES, sample);
            [wx, wy, wz + 0.05 * (linear[2] + turning[2] - gravity[2] + GRAVITY_M_S2)]
        });
    })?;
    assert_named("holds_other_wx", &["do not stand square", "wy has", "of wx"], |columns| {
        each(columns, RATES, |columns, sample| {
            let [wx, wy, wz] = of(columns, RATES, sample);
            [wx, wy + 0.3 * wx, wz]
        });
    })
}

#[test]
fn an_attitude_of_a_quaternion_in_the_other_order_is_a_reading() -> Outcome {
    assert_named("attitude_rate", &["x, y, z, w that was read as w, x, y, z"], |columns| {
        each(columns, ATTITUDE, |columns, sample| {
            let [roll, pitch, yaw] = of(columns, ATTITUDE, sample);
            let [x, y, z, w] = euler_to_quaternion(roll, pitch, yaw);
            quaternion_to_euler([y, z, w, x])
        });
    })
}

#[test]
fn a_velocity_of_the_right_size_that_points_elsewhere_is_named() -> Outcome {
    // The course stands in the place of the heading, three times over.
    assert_named("position_rate", &["as fast as the position moves, and points elsewhere"], |columns| {
        each(columns, VELOCITY, |columns, sample| {
            let ([vx, vy, vz], [_, _, yaw]) = (of(columns, VELOCITY, sample), of(columns, ATTITUDE, sample));
            let (sine, cosine) = (3.0 * yaw + 1.0).sin_cos();
            [cosine * vx - sine * vy, sine * vx + cosine * vy, vz]
        });
    })
}

#[test]
fn a_velocity_that_wanders_is_to_blame_and_no_other_stream() -> Outcome {
    assert_named("stray_vx", &["velocity (vx, vy, vz) is wrong by", "wanders"], |columns| {
        let mut state = [0.4, -0.3, 0.2];
        let stream = phyture_kernels::random::Stream::new(3, 0, 0, 0);
        for sample in 0..columns[0].len() {
            let mut next = 3 * sample as u64;
            state = state.map(|off| {
                next += 1;
                0.992 * off + 0.15 * (stream.uniform(next) - 0.5)
            });
            let velocity = of(columns, VELOCITY, sample);
            set(columns, VELOCITY, sample, std::array::from_fn(|axis| velocity[axis] + state[axis]));
        }
    })
}

#[test]
fn gyros_on_soft_mounts_are_named_with_their_frequency() -> Outcome {
    assert_named("swinging_wx", &["ring on", "at 3.", "a resonance"], |columns| {
        for column in RATES {
            let rates = &mut columns[column as usize];
            let (frequency, step_s) = (std::f64::consts::TAU * 3.2, 0.01);
            let (mut shown, mut change) = (rates[0], 0.0);
            for rate in rates {
                change += step_s * frequency * (frequency * (*rate - shown) - 0.2 * change);
                shown += step_s * change;
                *rate = shown;
            }
        }
    })
}

#[test]
fn servos_in_the_place_of_sticks_are_named_in_all_flights_as_in_half() -> Outcome {
    let servos = |columns: &mut Columns| {
        for sample in 0..columns[0].len() {
            let [u1, u2, u4] = [Column::U1, Column::U2, Column::U4].map(|column| columns[column as usize][sample]);
            set(columns, [Column::U1, Column::U2, Column::U4], sample, [u4 + u1, u4 + u2, u4 - 0.5 * (u1 + u2)]);
        }
    };
    for every in [1, 2] {
        let report = checked(flights(|index| index % every == 0, servos)?);
        let is_such = |message: &str| message.contains("u4") && message.contains("mixed");
        let found = report.findings.iter().find(|found| found.verdict == Severity::Fault && is_such(&found.message));
        assert!(found.is_some(), "{report}");
    }
    Ok(())
}

#[test]
fn sticks_of_another_moment_in_stretches_are_named() -> Outcome {
    assert_named("deaf_stretches", &["in some stretches", "another pilot"], |columns| {
        for column in CONTROLS {
            let values = &mut columns[column as usize];
            let last = values.len() - 1;
            let before = values.clone();
            (0..values.len()).filter(|sample| sample % 900 < 300).for_each(|sample| values[sample] = before[last - sample]);
        }
    })
}

#[test]
fn mirrored_flights_sticks_behind_a_slew_limit_and_angles_sent_on_change_are_named() -> Outcome {
    let mut all = flights(|_| false, |_| ())?;
    let mirrored = flights(
        |_| true,
        |columns| {
            for column in [Column::Roll, Column::Yaw, Column::Y, Column::Vy, Column::Wx, Column::Wz, Column::U1, Column::U3] {
                columns[column as usize].iter_mut().for_each(|value| *value = -*value);
            }
        },
    )?;
    let named =
        mirrored.iter().take(3).enumerate().filter_map(|(at, flight)| flight.slice(0..flight.len(), format!("mirrored_{at}")));
    all.extend(named);
    let report = phyture::critique::check::check(&DataSet { flights: all, ..DataSet::default() }, None);
    let found = report.findings.iter().find(|finding| finding.name == "mirrored").ok_or_else(|| report.to_string())?;
    assert_eq!((found.verdict, found.flights.len()), (Severity::Fault, 3));

    assert_named("slew_u1", &["never moves faster than 0.50 a second"], |columns| {
        let values = &mut columns[Column::U1 as usize];
        let mut shown = values[0];
        for value in values {
            shown = value.clamp(shown - 0.005, shown + 0.005);
            *value = shown;
        }
    })?;
    assert_named("on_change_pitch", &["pitch is held until the next change of 0.05", "sent on change"], |columns| {
        let values = &mut columns[Column::Pitch as usize];
        let mut sent = values[0];
        for value in values {
            if (*value - sent).abs() >= 0.05 {
                sent = *value;
            }
            *value = sent;
        }
    })
}
