//! From flights that are read wrongly to the `dataset.toml` that `check` suggests, and back: with it nothing is at fault.

use phyture::Error;
use phyture::critique::check::check;
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::write::data_set_csv;
use phyture::flight::{Column, Flight};
use phyture::sim::{Level, Mechanisms, Simulation, simulate};
use std::path::Path;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn flights(change: impl Fn(&mut [Vec<f64>; Column::COUNT])) -> Result<Vec<Flight>, Error> {
    let simulation =
        Simulation { seed: 11, minutes: 10.0, mechanisms: Mechanisms::none(), level: Level::TWO, ..Simulation::default() };
    let changed = |flight: &Flight| {
        let mut columns = Column::ALL.map(|column| flight.column(column).to_vec());
        change(&mut columns);
        Flight::new(flight.name.clone(), flight.manoeuvre.clone(), 0.0, flight.step_s, columns, flight.targets)
    };
    simulate(&simulation)?.flights.iter().map(changed).collect()
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
fn flights_without_a_fault_ask_for_nothing() -> Outcome {
    let folder = tempfile::tempdir()?;
    data_set_csv(folder.path(), &flights(|_| {})?)?;
    assert_eq!(suggested(folder.path())?, (false, None));
    Ok(())
}
