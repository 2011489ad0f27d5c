//! Flights of the simulator with one thing wrong in all of them, and lines of `dataset.toml` that undo it, so that nothing has to be left out: `mend`, as far
//! as it takes. What is named, and what else is suggested, is tested in `bad_logs`, `bad_columns`, `bad_streams` and `bad_vectors`.
#![cfg(all(feature = "files", feature = "sim"))]

mod corrupted;

use corrupted::{Columns, Outcome, flights as some};
use phyture::Error;
use phyture::critique::check::{check, mend};
use phyture::flight::attitude::euler_to_quaternion;
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::write::data_set_csv;
use phyture::flight::{Column, Flight};

/// All flights changed.
fn flights(change: impl Fn(&mut Columns)) -> Result<Vec<Flight>, Error> {
    some(|_| true, change)
}

/// A text that mends these flights, by as many rounds as that takes.
fn mended(flights: &[Flight]) -> Result<String, Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    data_set_csv(folder.path(), flights)?;
    let set = data_set(folder.path(), &ReadOptions::default())?;
    let read = |text: &str| data_set(folder.path(), &ReadOptions { described: Some(text.into()), ..ReadOptions::default() });
    let made = mend(&set, &check(&set, None), None, read).ok_or("nothing mends it")?;
    assert!(made.is_free(), "{}\n{:?}", made.suggestion.text, made.report.map(|report| report.to_string()));
    Ok(made.suggestion.text)
}

#[test]
fn controls_with_a_clock_of_their_own_are_moved_back_by_a_drift() -> Outcome {
    let slow = flights(|columns| {
        for control in [Column::U1, Column::U2, Column::U3, Column::U4] {
            let values = columns[control as usize].clone();
            let ahead = |row: usize| values[(row + row / 150).min(values.len() - 1)];
            columns[control as usize] = (0..values.len()).map(ahead).collect();
        }
    })?;
    let text = mended(&slow)?;
    let drift = text.lines().find_map(|line| line.strip_prefix("controls = ")).ok_or_else(|| text.clone())?;
    assert!((drift.parse::<f64>()? + 1.0 / 150.0).abs() < 4e-4, "{text}");
    Ok(())
}

#[test]
fn where_a_clock_began_has_a_line_of_its_own() -> Outcome {
    let slow = flights(|columns| {
        for control in [Column::U1, Column::U2, Column::U3, Column::U4] {
            let values = columns[control as usize].clone();
            let ahead = |row: usize| values[(row + row / 150 + 2).min(values.len() - 1)];
            columns[control as usize] = (0..values.len()).map(ahead).collect();
        }
    })?;
    let text = mended(&slow)?;
    let numbers: Vec<f64> = text.lines().filter_map(|line| line.strip_prefix("controls = ")?.parse().ok()).collect();
    let [drift, late] = numbers[..] else { return Err(text.into()) };
    // Two samples ahead, and half of one on the average of those that are joined by their nearest sample.
    assert!(text.contains("[drift]") && text.contains("[late]"), "{text}");
    assert!((drift + 1.0 / 150.0).abs() < 4e-4 && (late + 0.02).abs() < 0.01, "{text}");
    Ok(())
}

#[test]
fn rates_behind_a_filter_are_led_by_their_own_change() -> Outcome {
    let filtered = flights(|columns| {
        for rate in [Column::Wx, Column::Wy, Column::Wz] {
            let mut state = columns[rate as usize][0];
            for value in &mut columns[rate as usize] {
                state += (*value - state) * 0.1;
                *value = state;
            }
        }
    })?;
    let text = mended(&filtered)?;
    assert!(text.contains("wx = \"wx + 0.0"), "{text}");
    Ok(())
}

const ATTITUDE: [Column; 3] = [Column::Roll, Column::Pitch, Column::Yaw];
const RATES: [Column; 3] = [Column::Wx, Column::Wy, Column::Wz];
const ANGULAR: [Column; 3] = [Column::WxDot, Column::WyDot, Column::WzDot];

/// Each of these lines is in the text that mends the flights, and none is left out.
fn assert_undone(flights: &[Flight], lines: &[&str]) -> Outcome {
    let text = mended(flights)?;
    for line in lines {
        assert!(text.lines().any(|own| own.starts_with(line)), "{line} is not in\n{text}");
    }
    assert!(!text.contains("leave_out"), "{text}");
    Ok(())
}

#[test]
fn rates_of_another_sensitivity_are_scaled_alone() -> Outcome {
    let scaled = flights(|columns| {
        for column in RATES {
            columns[column as usize].iter_mut().for_each(|value| *value *= 1.14);
        }
    })?;
    assert_undone(&scaled, &["wx = \"0.877", "wy = \"0.877", "wz = \"0.877"])
}

#[test]
fn an_attitude_that_is_held_beside_faster_streams_is_joined_by_cubics() -> Outcome {
    let held = flights(|columns| {
        for angle in ATTITUDE {
            for chunk in columns[angle as usize].chunks_mut(10) {
                let first = chunk[0];
                chunk.fill(first);
            }
        }
    })?;
    assert_undone(&held, &["columns = [\"roll\", \"pitch\", \"yaw\"]", "held = true", "between = \"cubic\""])
}

#[test]
fn accelerations_behind_a_filter_are_derived_anew() -> Outcome {
    let smoothed = flights(|columns| {
        for target in ANGULAR {
            let mut state = columns[target as usize][0];
            for value in &mut columns[target as usize] {
                state += (*value - state) * 0.12;
                *value = state;
            }
        }
    })?;
    assert_undone(&smoothed, &["missing = [\"wx_dot\", \"wy_dot\", \"wz_dot\"]"])
}

#[test]
fn rates_of_another_range_are_scaled_with_what_was_made_of_them() -> Outcome {
    let halved = flights(|columns| {
        for column in RATES.into_iter().chain(ANGULAR) {
            columns[column as usize].iter_mut().for_each(|value| *value *= 0.5);
        }
    })?;
    assert_undone(&halved, &["wx = \"2", "wy = \"2", "wz = \"2", "wx_dot = \"", "wy_dot = \"", "wz_dot = \""])
}

#[test]
fn accelerations_made_with_another_time_step_are_scaled_all_six() -> Outcome {
    let halved = flights(|columns| {
        for column in Column::TARGETS {
            columns[column as usize].iter_mut().for_each(|value| *value *= 0.5);
        }
    })?;
    assert_undone(&halved, &["vx_dot = \"", "vy_dot = \"", "vz_dot = \"", "wx_dot = \"", "wy_dot = \"", "wz_dot = \""])
}

#[test]
fn controls_that_are_later_than_is_tried_are_moved_once_more() -> Outcome {
    let late = flights(|columns| {
        for control in [Column::U1, Column::U2, Column::U3, Column::U4] {
            let values = columns[control as usize].clone();
            columns[control as usize] = (0..values.len()).map(|row| values[row.saturating_sub(15)]).collect();
        }
    })?;
    let text = mended(&late)?;
    let moved = text.lines().find_map(|line| line.strip_prefix("controls = ")).ok_or_else(|| text.clone())?;
    assert!((moved.parse::<f64>()? - 0.15).abs() < 0.005, "{text}");
    Ok(())
}

#[test]
fn angles_in_another_order_and_parts_of_a_quaternion_are_read_as_an_attitude() -> Outcome {
    let exchanged = flights(|columns| columns.swap(Column::Roll as usize, Column::Yaw as usize))?;
    assert_undone(&exchanged, &["roll = \"yaw\"", "yaw = \"roll\""])?;
    let parts = flights(|columns| {
        three(columns, ATTITUDE, |[roll, pitch, yaw]| {
            let [x, y, z, w] = euler_to_quaternion(roll, pitch, yaw);
            [x, y, z].map(|part| part * w.signum())
        });
    })?;
    let text = mended(&parts)?;
    assert!(text.contains("\nroll = \"atan2(2 * (sqrt(max(0, 1 - roll^2"), "{text}");
    Ok(())
}

/// Three columns at once become three others.
fn three(columns: &mut Columns, of: [Column; 3], change: impl Fn([f64; 3]) -> [f64; 3]) {
    for row in 0..columns[0].len() {
        let changed = change(of.map(|column| columns[column as usize][row]));
        of.into_iter().zip(changed).for_each(|(column, value)| columns[column as usize][row] = value);
    }
}

#[test]
fn servos_of_a_swash_plate_are_the_sticks_again() -> Outcome {
    let servos = flights(|columns| {
        three(columns, [Column::U1, Column::U2, Column::U4], |[lateral, longitudinal, collective]| {
            let ahead = collective + 0.5 * longitudinal;
            [ahead + 0.866 * lateral, ahead - 0.866 * lateral, collective - longitudinal]
        });
    })?;
    let lines = ["u1 = \"u1 - 1.0000 * u2\"", "u2 = \"u2 + 1.0000 * u1 - 2.0000 * u4\"", "u4 = \"u4 + 1.0000 * u1 + 1.0000 * u2\""];
    assert_undone(&servos, &lines)
}

#[test]
fn flights_are_cut_where_rows_are_lost() -> Outcome {
    let lost = flights(|columns| {
        let is_lost = |row: usize| [700, 1500].iter().any(|first| (*first..first + 45).contains(&row));
        for values in columns.iter_mut() {
            *values = values.iter().enumerate().filter(|entry| !is_lost(entry.0)).map(|entry| *entry.1).collect();
        }
    })?;
    assert_undone(&lost, &["[[cut]]", "at = [7.0, 14.55]"])
}

#[test]
fn a_rotor_that_shakes_all_sensors_is_filtered() -> Outcome {
    let shaken = flights(|columns| {
        let linear = [Column::VxDot, Column::VyDot, Column::VzDot];
        for (three, size) in [(RATES, 0.4), (linear, 4.0), (ANGULAR, 10.0)] {
            for (axis, column) in three.into_iter().enumerate() {
                let turn = |row: usize| 23.0 * 0.01 * row as f64 + 0.3 * axis as f64;
                let wave = |row: usize| size * (std::f64::consts::TAU * turn(row)).sin();
                columns[column as usize].iter_mut().enumerate().for_each(|(row, value)| *value += wave(row));
            }
        }
    })?;
    let text = mended(&shaken)?;
    for line in ["wx = \"(wx + 1.9", "* delay(wx, 0.02) + delay(wx, 0.04)) / 3.9", "missing = [", "\nwx = 0.02\n"] {
        assert!(text.contains(line), "{line}: {text}");
    }
    Ok(())
}

#[test]
fn an_accelerometer_off_the_centre_is_moved_there() -> Outcome {
    let off = flights(|columns| {
        let arm = [-0.7, 0.0, -0.1];
        for row in 0..columns[0].len() {
            let [rates, angular] = [RATES, ANGULAR].map(|three| three.map(|column| columns[column as usize][row]));
            let cross = phyture::flight::attitude::cross;
            let (along, inwards) = (cross(angular, arm), cross(rates, cross(rates, arm)));
            for (axis, target) in [Column::VxDot, Column::VyDot, Column::VzDot].into_iter().enumerate() {
                columns[target as usize][row] += along[axis] + inwards[axis];
            }
        }
    })?;
    assert_undone(&off, &["vx_dot = \"vx_dot + 0.1", "vy_dot = \"vy_dot + 0.7", "vz_dot = \"vz_dot - 0.7"])
}

#[test]
fn an_attitude_that_is_not_level_is_levelled() -> Outcome {
    let tilted = flights(|columns| {
        // Some are beyond the vertical then.
        columns[Column::Pitch as usize].iter_mut().for_each(|value| *value += 0.09);
        columns[Column::Roll as usize].iter_mut().for_each(|value| *value -= 0.07);
    })?;
    let text = mended(&tilted)?;
    assert!(text.contains("pitch = \"clamp(pitch - 0.0") && text.contains("roll = \"roll + 0.0"), "{text}");
    // All that is taken off pitch, in one round or two.
    let pitch = text.lines().find_map(|line| line.strip_prefix("pitch = ")).unwrap_or_default();
    let angle = |part: &str| part.split([',', '"', ')']).next().unwrap_or_default().parse::<f64>();
    let taken: f64 = pitch.split(" - ").skip(1).map(angle).sum::<Result<f64, _>>()?;
    assert!((taken - 0.09).abs() < 0.004, "{text}");
    Ok(())
}
