//! Flights of the simulator with one thing wrong each: what `check` says, and the `dataset.toml` that it suggests, with which nothing is at fault.
#![cfg(all(feature = "files", feature = "sim"))]

mod corrupted;

use corrupted::{Columns, Outcome, flights as some};
use phyture::Error;
use phyture::critique::check::{Severity, check, mend};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::write::data_set_csv;
use phyture::flight::{Column, DataSet, Flight, Targets};
use std::path::Path;

/// All flights changed.
fn flights(change: impl Fn(&mut Columns)) -> Result<Vec<Flight>, Error> {
    some(|_| true, change)
}

fn suggested(folder: &Path) -> Result<(bool, Option<String>), Error> {
    let set = data_set(folder, &ReadOptions::default())?;
    let report = check(&set, None);
    Ok((report.fault, report.suggestion(&set.source).map(|suggestion| suggestion.text)))
}

#[test]
fn two_faults_at_once_are_mended_by_what_is_suggested() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path();
    data_set_csv(
        path,
        &flights(|columns| {
            for velocity in [Column::Vx, Column::Vy, Column::Vz] {
                columns[velocity as usize].iter_mut().for_each(|value| *value /= 0.3048);
            }
            columns.swap(Column::U1 as usize, Column::U2 as usize);
        })?,
    )?;
    // What is behind a first fault shows once that is mended, and is added to what stands in the file.
    let mut rounds = 0;
    let text = loop {
        match suggested(path)? {
            (false, None) => break std::fs::read_to_string(path.join("dataset.toml"))?,
            (true, Some(text)) if rounds < 3 => std::fs::write(path.join("dataset.toml"), text)?,
            other => panic!("after {rounds} rounds: {other:?}"),
        }
        rounds += 1;
    };
    for line in ["velocity = \"ft/s\"", "u1 = \"u2\"", "u2 = \"u1\""] {
        assert!(text.lines().any(|own| own == line), "{line} is not in\n{text}");
    }
    Ok(())
}

#[test]
fn a_round_that_cannot_be_read_leaves_the_suggestion_of_the_one_before() -> Outcome {
    let folder = tempfile::tempdir()?;
    let twice = flights(|columns| {
        columns[Column::Wx as usize].iter_mut().skip(40).step_by(300).for_each(|value| *value += 9.0);
        columns.swap(Column::U1 as usize, Column::U2 as usize);
    })?;
    data_set_csv(folder.path(), &twice)?;
    let set = data_set(folder.path(), &ReadOptions::default())?;
    let report = check(&set, None);
    let read = |text: &str| data_set(folder.path(), &ReadOptions { described: Some(text.into()), ..ReadOptions::default() });
    let whole = mend(&set, &report, None, read).ok_or("nothing mends it")?;
    assert!(whole.is_free() && whole.rounds == 2 && whole.suggestion.text.contains("u1 = \"u2\""), "{whole:?}");
    let mut reads = 0;
    let halved = mend(&set, &report, None, |text| {
        reads += 1;
        if reads == 1 { read(text) } else { Err(Error::Undetermined("not readable".into())) }
    });
    let halved = halved.ok_or("nothing mends it")?;
    assert!(!halved.is_free() && halved.rounds == 1 && !halved.suggestion.text.contains("u1"), "{}", halved.suggestion.text);
    Ok(())
}

/// What is suggested of these flights, with this description beside them, leaves nothing at fault.
fn assert_mended(flights: &[Flight], stated: &str, line: &str) -> Outcome {
    let folder = tempfile::tempdir()?;
    data_set_csv(folder.path(), flights)?;
    let description = folder.path().join("dataset.toml");
    std::fs::write(&description, stated)?;
    let (fault, text) = suggested(folder.path())?;
    let text = text.filter(|_| fault).ok_or("nothing is suggested")?;
    assert!(text.lines().any(|own| own.starts_with(line)), "{text}");
    std::fs::write(&description, text)?;
    assert_eq!(suggested(folder.path())?, (false, None));
    Ok(())
}

#[test]
fn a_wrong_time_step_is_mended() -> Outcome {
    let halved = flights(|columns| {
        for values in columns {
            *values = values.iter().step_by(2).copied().collect();
        }
    })?;
    assert_mended(&halved, "", "t = \"t * 2")
}

#[test]
fn an_offset_is_mended_in_the_units_of_the_file() -> Outcome {
    let of_wx = |change: fn(f64) -> f64| {
        flights(|columns| {
            for rate in [Column::Wx, Column::Wy, Column::Wz] {
                let offset = if rate == Column::Wx { 0.2 } else { 0.0 };
                columns[rate as usize].iter_mut().for_each(|value| *value = change(*value + offset));
            }
        })
    };
    assert_mended(&of_wx(|value| value)?, "", "wx = \"wx - 0.2")?;
    assert_mended(&of_wx(f64::to_degrees)?, "[units]\nrates = \"deg/s\"\n", "wx = ")
}

/// Rows in which nothing was received, in runs of 0.1 s.
fn lost(row: usize) -> bool {
    row % 200 >= 100 && row % 200 < 110
}

#[test]
fn a_pose_that_falls_to_zero_or_freezes_is_bridged() -> Outcome {
    let pose = [Column::X, Column::Y, Column::Z, Column::Roll, Column::Pitch, Column::Yaw];
    let filled = |with: fn(&[f64], usize) -> f64| {
        flights(|columns| {
            for column in pose {
                let values = &mut columns[column as usize];
                (1..values.len()).filter(|row| lost(*row)).for_each(|row| values[row] = with(values, row));
            }
        })
    };
    assert_mended(&filled(|_, _| 0.0)?, "", "zero = true")?;
    assert_mended(&filled(|values, row| values[row - 1])?, "", "held = true")
}

#[test]
fn rates_that_stick_out_are_bridged_in_the_units_of_the_file() -> Outcome {
    let spiked = |factor: f64| {
        flights(|columns| {
            for (place, rate) in [Column::Wx, Column::Wy, Column::Wz].into_iter().enumerate() {
                let values = &mut columns[rate as usize];
                values.iter_mut().for_each(|value| *value *= factor);
                values.iter_mut().skip(40 + 70 * place).step_by(300).for_each(|value| *value += 9.0 * factor);
            }
        })
    };
    assert_mended(&spiked(1.0)?, "", "spike = 6.")?;
    assert_mended(&spiked(1.0_f64.to_degrees())?, "[units]\nrates = \"deg/s\"\n", "spike = 3")
}

#[test]
fn a_position_of_east_north_up_and_rates_of_a_tilted_sensor_are_mended() -> Outcome {
    let position = flights(|columns| {
        columns.swap(Column::X as usize, Column::Y as usize);
        columns[Column::Z as usize].iter_mut().for_each(|value| *value = -*value);
    })?;
    assert_mended(&position, "", "x = \"y\"")?;
    let (sin, cos) = 0.17_f64.sin_cos();
    let tilted = flights(|columns| {
        for (x, z) in [(Column::Wx, Column::Wz), (Column::WxDot, Column::WzDot)] {
            for row in 0..columns[0].len() {
                let [wx, wz] = [x, z].map(|column| columns[column as usize][row]);
                columns[x as usize][row] = cos * wx - sin * wz;
                columns[z as usize][row] = sin * wx + cos * wz;
            }
        }
    })?;
    assert_mended(&tilted, "", "wz_dot = ")
}

#[test]
fn units_of_velocity_and_position_are_mended_together() -> Outcome {
    let scaled = flights(|columns| {
        for column in [Column::X, Column::Y, Column::Z, Column::Vx, Column::Vy, Column::Vz] {
            columns[column as usize].iter_mut().for_each(|value| *value *= 1000.0);
        }
    })?;
    assert_mended(&scaled, "", "position = \"mm\"")
}

#[test]
fn flights_without_a_fault_ask_for_nothing() -> Outcome {
    let folder = tempfile::tempdir()?;
    data_set_csv(folder.path(), &flights(|_| {})?)?;
    assert_eq!(suggested(folder.path())?, (false, None));
    Ok(())
}

/// What is said of all flights changed, and of every other one: the name of the fault, and words of its message.
fn assert_named(name: &str, says: &str, change: impl Fn(&mut [Vec<f64>; Column::COUNT])) -> Outcome {
    for every in [1, 2] {
        let flights = some(|index| index % every == 0, &change)?;
        let count = flights.len().div_ceil(every);
        let report = check(&DataSet { flights, ..DataSet::default() }, None);
        let finding = report.findings.iter().find(|finding| finding.name == name && finding.verdict == Severity::Fault);
        let finding = finding.unwrap_or_else(|| panic!("no {name} in\n{report}"));
        assert!(finding.message.contains(says), "{report}");
        assert!(every == 1 || finding.flights.len() * 2 > count, "{report}");
    }
    Ok(())
}

#[test]
fn a_stick_that_is_cut_off_is_told_from_one_at_its_end() -> Outcome {
    assert_named("cut_off_u1", "u1 is cut off at 0.15", |columns| {
        columns[Column::U1 as usize].iter_mut().for_each(|value| *value = value.clamp(-0.15, 0.15));
    })
}

#[test]
fn vibration_is_a_warning_with_its_frequency() -> Outcome {
    let flights = flights(|columns| {
        let values = &mut columns[Column::VzDot as usize];
        values.iter_mut().enumerate().for_each(|(row, value)| *value += 4.0 * (std::f64::consts::TAU * 0.23 * row as f64).sin());
    })?;
    let report = check(&DataSet { flights, ..DataSet::default() }, None);
    let found = report.findings.iter().find(|finding| finding.name == "vibration_vz_dot").ok_or("no vibration")?;
    assert!(found.verdict == Severity::Warning && found.message.contains("at 22.7 Hz"), "{}", found.message);
    Ok(())
}

#[test]
fn rows_that_repeat_a_packet_are_told_from_rates_that_stand_still_by_rounding() -> Outcome {
    let rates = [Column::Wx, Column::Wy, Column::Wz];
    let told = |change: &dyn Fn(usize, &mut Vec<f64>)| -> Result<Option<String>, Error> {
        let flights = flights(|columns| rates.into_iter().for_each(|rate| change(rate as usize, &mut columns[rate as usize])))?;
        let report = check(&DataSet { flights, ..DataSet::default() }, None);
        let found = report.findings.into_iter().find(|finding| finding.name == "repeated_rows");
        assert!(found.as_ref().is_none_or(|finding| finding.verdict == Severity::Warning));
        Ok(found.map(|finding| finding.message))
    };
    let lost = told(&|_, values| (7..values.len()).step_by(10).for_each(|row| values[row] = values[row - 1]))?;
    assert!(
        lost.as_ref().is_some_and(|message| message.contains("up to 10 % of the rows") && message.contains("held = true")),
        "{lost:?}"
    );
    assert_eq!(told(&|_, values| values.iter_mut().for_each(|value| *value = (*value / 0.2).round() * 0.2))?, None);
    assert_eq!(told(&|_, _| ())?, None);
    Ok(())
}

#[test]
fn dropped_samples_that_were_filled_are_counted() -> Outcome {
    assert_named("dropouts", "for up to 0.5", |columns| {
        for column in Column::ALL.into_iter().filter(|column| !column.name().starts_with('u')) {
            let values = &mut columns[column as usize];
            for start in (300..values.len()).step_by(600) {
                let last = (start + 51).min(values.len());
                let held = values[start];
                values[start..last].fill(held);
            }
        }
    })
}

#[test]
fn noise_on_a_stick_is_named() -> Outcome {
    assert_named("noise_u3", "u3 has noise of 0.", |columns| {
        let mut state = 1_u32;
        for value in &mut columns[Column::U3 as usize] {
            // A linear congruence (Knuth 1981) is noise enough; uniform numbers of rms 0.1.
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *value += 0.1 * 12_f64.sqrt() * (f64::from(state >> 8) / f64::from(1 << 24) - 0.5);
        }
    })
}

/// What `check` says of flights of which some are changed: a fault of this name, in flights of which each is one of these.
fn assert_flights(name: &str, which: impl Fn(usize) -> bool, change: impl Fn(&mut [Vec<f64>; Column::COUNT])) -> Outcome {
    let flights = some(&which, change)?;
    let changed: Vec<String> = (0..flights.len()).filter(|&index| which(index)).map(|index| flights[index].name.clone()).collect();
    let report = check(&DataSet { flights, ..DataSet::default() }, None);
    let found = report.findings.iter().find(|finding| finding.name == name && finding.verdict == Severity::Fault);
    let found = found.unwrap_or_else(|| panic!("no {name} in\n{report}"));
    assert!(2 * found.flights.len() >= changed.len() && found.flights.iter().all(|flight| changed.contains(flight)), "{report}");
    Ok(())
}

#[test]
fn controls_of_another_time_are_named_with_their_flights() -> Outcome {
    assert_flights(
        "foreign_controls",
        |index| index == 1,
        |columns| {
            for stick in [Column::U1, Column::U2, Column::U3, Column::U4] {
                columns[stick as usize].rotate_right(800);
            }
        },
    )
}

#[test]
fn a_stick_at_half_its_size_is_named_with_its_flights() -> Outcome {
    let halved = |columns: &mut [Vec<f64>; Column::COUNT]| columns[Column::U4 as usize].iter_mut().for_each(|value| *value *= 0.5);
    assert_flights("gain_u4", |index| index % 2 == 1, halved)
}

#[test]
fn one_column_in_other_units_is_told_from_all_three() -> Outcome {
    assert_named("position_rate_x", "vx: the gain of this axis is that of velocity in feet a second", |columns| {
        columns[Column::Vx as usize].iter_mut().for_each(|value| *value /= 0.3048);
    })?;
    assert_named("attitude_rate_y", "wy: the gain of this axis is that of rates in degrees a second", |columns| {
        columns[Column::Wy as usize].iter_mut().for_each(|value| *value = value.to_degrees());
    })
}

#[test]
fn a_turned_heading_is_named_with_its_angle() -> Outcome {
    assert_named("heading", "turned by 30° to the right", |columns| {
        columns[Column::Yaw as usize].iter_mut().for_each(|value| *value += 30_f64.to_radians());
    })
}

#[test]
fn an_offset_of_a_rate_is_named_with_its_size() -> Outcome {
    assert_named("offset_wx", "wx has an offset of 0.20 rad/s", |columns| {
        columns[Column::Wx as usize].iter_mut().for_each(|value| *value += 0.2);
    })
}

#[test]
fn a_log_at_half_the_rate_it_is_stamped_with_is_named() -> Outcome {
    assert_named("time_step", "the time step is 2.0", |columns| {
        for values in columns.iter_mut().filter(|values| !values.is_empty()) {
            *values = values.iter().step_by(2).copied().collect();
        }
    })
}

#[test]
fn two_columns_in_each_others_place_are_named() -> Outcome {
    assert_named("attitude_rate", "wx and wy are exchanged", |columns| columns.swap(Column::Wx as usize, Column::Wy as usize))?;
    assert_named("position_rate", "vx and vy are exchanged", |columns| columns.swap(Column::Vx as usize, Column::Vy as usize))
}

#[test]
fn an_attitude_that_is_off_is_told_from_a_gyro_that_is_turned() -> Outcome {
    let angle = 6_f64.to_radians();
    assert_named("mounts", "roll is off by 6.0°", |columns| {
        columns[Column::Roll as usize].iter_mut().for_each(|value| *value += angle);
    })?;
    assert_named("mounts", "the axes of the rates are turned by 6.0° about y", |columns| {
        for sample in 0..columns[0].len() {
            let [wx, wz] = [Column::Wx, Column::Wz].map(|column| columns[column as usize][sample]);
            columns[Column::Wx as usize][sample] = angle.cos() * wx - angle.sin() * wz;
            columns[Column::Wz as usize][sample] = angle.sin() * wx + angle.cos() * wz;
        }
    })
}

#[test]
fn a_clock_of_its_own_is_named_with_its_rate() -> Outcome {
    assert_named("clock_controls", "a clock of its own, 0.", |columns| {
        for stick in [Column::U1, Column::U2, Column::U3, Column::U4] {
            let values = &mut columns[stick as usize];
            let last = values.len() - 1;
            *values = (0..values.len()).map(|sample| values[last.min((1.005 * sample as f64).round() as usize)]).collect();
        }
    })
}

#[test]
fn knots_and_a_heading_alone_in_degrees_are_mended() -> Outcome {
    let in_knots = flights(|columns| {
        for velocity in [Column::Vx, Column::Vy, Column::Vz] {
            columns[velocity as usize].iter_mut().for_each(|value| *value *= 3600.0 / 1852.0);
        }
    })?;
    assert_mended(&in_knots, "", "velocity = \"kt\"")?;
    let turned = flights(|columns| {
        columns[Column::Yaw as usize].iter_mut().for_each(|yaw| *yaw = yaw.to_degrees().rem_euclid(360.0));
    })?;
    assert_mended(&turned, "", "yaw = \"yaw * 0.01745")
}

/// Messages of the faults that are claimed.
fn faults(flights: Vec<Flight>) -> Vec<String> {
    let set = DataSet { flights, ..DataSet::default() };
    let is_fault = |finding: &phyture::critique::check::Finding| finding.verdict == Severity::Fault;
    check(&set, None).findings.into_iter().filter(is_fault).map(|finding| finding.message).collect()
}

#[test]
fn rows_in_falling_time_are_named_and_nothing_that_follows_from_them_in_their_place() -> Outcome {
    let reversed = |columns: &mut [Vec<f64>; Column::COUNT]| columns.iter_mut().for_each(|values| values.reverse());
    for some in [some(|index| index == 1, reversed)?, some(|index| index % 2 == 0, reversed)?] {
        let said = faults(some);
        assert!(said.iter().any(|message| message.contains("order of falling time")), "{said:#?}");
        assert!(!said.iter().any(|message| message.contains("does not hold")), "{said:#?}");
    }
    Ok(())
}

#[test]
fn a_value_for_what_was_not_received_is_named_however_much_there_is_of_it() -> Outcome {
    let lost = |columns: &mut [Vec<f64>; Column::COUNT]| {
        for start in [500, 1200, 2100] {
            columns[Column::U2 as usize][start..start + 40].fill(-999.0);
        }
    };
    for some in [some(|index| index == 1, lost)?, some(|index| index % 2 == 0, lost)?] {
        let said = faults(some);
        assert!(said.iter().any(|message| message.contains("cells of u2")), "{said:#?}");
    }
    Ok(())
}

#[test]
fn sticks_of_a_slower_stream_are_named() -> Outcome {
    let held = |columns: &mut [Vec<f64>; Column::COUNT]| {
        for stick in [Column::U1, Column::U2, Column::U3, Column::U4] {
            let values = &mut columns[stick as usize];
            for sample in 0..values.len() {
                values[sample] = values[sample / 10 * 10];
            }
        }
    };
    let said = faults(flights(held)?);
    assert!(said.iter().any(|message| message.contains("u1, u2, u3, u4 come at 10.000 Hz")), "{said:#?}");
    Ok(())
}

#[test]
fn a_stick_that_stops_within_the_flight_is_named_with_its_flights() -> Outcome {
    assert_flights(
        "still_u2",
        |index| index % 2 == 0,
        |columns| {
            let stick = &mut columns[Column::U2 as usize];
            let middle = stick.len() / 2;
            let value = stick[middle];
            stick[middle..].fill(value);
        },
    )
}

#[test]
fn a_flight_that_breaks_with_mechanics_is_named_though_no_reading_mends_it() -> Outcome {
    // The attitude of a slow drift that is in no list of readings, on top of the true one.
    assert_flights(
        "unexplained_attitude",
        |index| index == 3,
        |columns| {
            for (sample, roll) in columns[Column::Roll as usize].iter_mut().enumerate() {
                *roll += 0.4 * (0.05 * sample as f64).sin();
            }
        },
    )
}

#[test]
fn leaps_of_the_attitude_are_placed() -> Outcome {
    let flights = some(
        |index| index == 3,
        |columns| {
            for first in [1100, 2100] {
                columns[Column::Roll as usize][first..first + 30].iter_mut().for_each(|roll| *roll += 1.5);
            }
        },
    )?;
    let name = flights[3].name.clone();
    let set = DataSet { flights, ..DataSet::default() };
    let report = check(&set, None);
    let finding = report.findings.iter().find(|finding| finding.name == "leaps_roll").ok_or("no finding")?;
    assert_eq!((finding.verdict, finding.flights.as_slice()), (Severity::Fault, [name].as_slice()));
    assert!(finding.message.contains("leaps") && finding.message.contains("11 s"), "{}", finding.message);
    Ok(())
}

#[test]
fn a_trim_of_a_stick_is_told_with_its_size_and_is_a_fault_where_many_flights_share_it() -> Outcome {
    for (every, verdict) in [(2, Severity::Fault), (12, Severity::Warning)] {
        let flights = some(|index| index % every == 1, |columns| columns[Column::U1 as usize].iter_mut().for_each(|u| *u -= 0.2))?;
        let report = check(&DataSet { flights, ..DataSet::default() }, None);
        let finding = report.findings.iter().find(|finding| finding.name == "trim_u1").ok_or("no finding")?;
        assert_eq!(finding.verdict, verdict, "{}", finding.message);
        assert!(finding.message.contains("u1 stands 0.2"), "{}", finding.message);
        assert_eq!(report.fault, verdict == Severity::Fault, "{}", report.summary);
    }
    Ok(())
}

/// Five flights of an agile aircraft, white gusts and sticks that are moved quickly, in some of which the controls are recorded a sample late.
fn agile(late: impl Fn(usize) -> bool) -> Result<Vec<Flight>, Error> {
    const STEP_S: f64 = 0.01;
    let noise = |seed: usize, sample: usize| {
        let mut bits = (seed as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (sample as u64).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 30)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((bits ^ (bits >> 31)) % 10_007) as f64 / 10_007.0 - 0.5
    };
    let flight = |index: usize| {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| Vec::new());
        let (mut rates, mut sticks) = ([0.0; 3], [0.0; 3]);
        for sample in 0..6000 {
            for axis in 0..3 {
                sticks[axis] = 0.7 * sticks[axis] + noise(10 * index + axis, sample);
                let acts = 40.0 * sticks[axis] - 4.0 * rates[axis] + 4.0 * noise(10 * index + axis + 5, sample);
                columns[Column::U1 as usize + axis].push(sticks[axis]);
                columns[Column::Wx as usize + axis].push(rates[axis]);
                columns[Column::WxDot as usize + axis].push(acts);
                rates[axis] += STEP_S * acts;
            }
        }
        columns.iter_mut().for_each(|column| column.resize(6000, 0.0));
        if late(index) {
            for stick in [Column::U1, Column::U2, Column::U3] {
                columns[stick as usize].rotate_right(1);
            }
        }
        Flight::new(format!("flight_{index}"), "agile", 0.0, STEP_S, columns, Targets::Recorded)
    };
    (0..5).map(flight).collect()
}

#[test]
fn controls_that_were_joined_a_sample_late_in_some_logs_are_moved_back_there() -> Outcome {
    let stamps = |flights: Vec<Flight>| {
        let report = check(&DataSet { flights, ..DataSet::default() }, None);
        let own = report.findings.into_iter().filter(|finding| finding.name == "control_stamps");
        own.map(|finding| (finding.verdict, finding.flights, finding.set.unwrap_or_default())).collect::<Vec<_>>()
    };
    assert_eq!(stamps(agile(|_| false)?), []);
    assert_eq!(stamps(agile(|_| true)?), []);
    let names = ["flight_1".to_owned(), "flight_3".to_owned()];
    let line = "[[late_in]] flights = [\"flight_1\", \"flight_3\"], controls = 0.01";
    assert_eq!(stamps(agile(|index| index % 2 == 1)?), [(Severity::Warning, names.to_vec(), line.to_owned())]);

    let folder = tempfile::tempdir()?;
    let path = folder.path();
    data_set_csv(path, &agile(|index| index % 2 == 1)?)?;
    let (_, text) = suggested(path)?;
    std::fs::write(path.join("dataset.toml"), text.ok_or("nothing is suggested")?)?;
    let mended = data_set(path, &ReadOptions::default())?;
    assert_eq!(stamps(mended.flights), []);
    Ok(())
}

#[test]
fn a_pose_that_was_frozen_for_long_is_cut_out() -> Outcome {
    let frozen = flights(|columns| {
        for column in [Column::X, Column::Y, Column::Z, Column::Roll, Column::Pitch, Column::Yaw] {
            for start in (700..columns[column as usize].len().saturating_sub(200)).step_by(900) {
                let last = columns[column as usize][start];
                columns[column as usize][start..start + 130].fill(last);
            }
        }
    })?;
    assert_mended(&frozen, "", "longer = \"cut\"")
}

#[test]
fn accelerations_that_are_mostly_noise_are_derived_anew() -> Outcome {
    let noisy = flights(|columns| {
        for (place, target) in [Column::WxDot, Column::WyDot, Column::WzDot].into_iter().enumerate() {
            // Differences of a white sequence, as of the numbers of a congruential generator.
            let mut state = 1 + place as u64;
            let mut white = || {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
            };
            let mut before = white();
            for value in &mut columns[target as usize] {
                let next = white();
                *value += 12.0 * (next - before);
                before = next;
            }
        }
    })?;
    let folder = tempfile::tempdir()?;
    data_set_csv(folder.path(), &noisy)?;
    let (fault, text) = suggested(folder.path())?;
    let text = text.filter(|_| !fault).ok_or("nothing is suggested")?;
    std::fs::write(folder.path().join("dataset.toml"), text)?;
    assert_eq!(suggested(folder.path())?, (false, None));
    let set = data_set(folder.path(), &ReadOptions::default())?;
    assert!(set.flights.iter().all(|flight| flight.targets == Targets::Derived));
    Ok(())
}
