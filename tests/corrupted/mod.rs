//! Flights of the simulator with something wrong in some of them, and what `check` has to say of them.
#![allow(dead_code, reason = "each test program uses its part")]

use phyture::critique::check::{CheckReport, Severity, check};
use phyture::flight::{Column, DataSet, Flight};
use phyture::sim::{Level, Mechanisms, Simulation, simulate};

pub type Outcome = Result<(), Box<dyn std::error::Error>>;
pub type Columns = [Vec<f64>; Column::COUNT];

/// Flights of ten minutes, some of them changed.
pub fn flights(which: impl Fn(usize) -> bool, change: impl Fn(&mut Columns)) -> phyture::Result<Vec<Flight>> {
    let simulation =
        Simulation { seed: 11, minutes: 10.0, mechanisms: Mechanisms::none(), level: Level::TWO, ..Simulation::default() };
    let changed = |(index, flight): (usize, &Flight)| {
        let mut columns = Column::ALL.map(|column| flight.column(column).to_vec());
        if which(index) {
            change(&mut columns);
        }
        Flight::new(flight.name.clone(), flight.manoeuvre.clone(), 0.0, flight.step_s, columns, flight.targets)
    };
    simulate(&simulation)?.flights.iter().enumerate().map(changed).collect()
}

pub fn checked(flights: Vec<Flight>) -> CheckReport {
    check(&DataSet { flights, ..DataSet::default() }, None)
}

/// What is said with every other flight changed, and with all.
pub fn assert_named(name: &str, says: &[&str], change: impl Fn(&mut Columns)) -> Outcome {
    for every in [2, 1] {
        let flights = flights(|index| index % every == 0, &change)?;
        let hit: Vec<String> = flights.iter().step_by(every).map(|flight| flight.name.clone()).collect();
        let report = checked(flights);
        let finding = report.findings.iter().find(|finding| finding.name == name && finding.verdict >= Severity::Warning);
        let finding = finding.unwrap_or_else(|| panic!("no {name} with each {every} changed in\n{report}"));
        for part in says {
            assert!(finding.message.contains(part), "{part}: {}", finding.message);
        }
        if every == 2 {
            assert!(finding.flights.iter().all(|flight| hit.contains(flight)), "{}", finding.message);
            assert!(finding.flights.len() * 2 > hit.len(), "{}", finding.message);
        }
    }
    Ok(())
}
