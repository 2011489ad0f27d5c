//! What must hold of the corruptions themselves: no name twice, as many of each kind in the first two lists, and each changes the flights that
//! it is applied to. No check is run here, so a list may be looked at so far before it is reported.

use crate::change::{Chance, Change, Corruption, Kind, Log, Part};
use crate::corruptions::DEVELOPMENT;
use crate::run;
use crate::second::SECOND;
use phyture::{Error, Result};

/// Tries all of them on two minutes of a development seed.
pub fn all() -> Result<()> {
    let fault = |what: String| Err(Error::Undetermined(what));
    let every: Vec<_> = run::HALVES.iter().flat_map(|(_, list)| list.iter()).collect();
    for (place, corruption) in every.iter().enumerate() {
        if every.iter().skip(place + 1).any(|other| other.id == corruption.id) {
            return fault(format!("two corruptions are called {}", corruption.id));
        }
    }
    let kinds = |half: &[Corruption]| {
        let mut kinds: Vec<Kind> = half.iter().map(|corruption| corruption.kind).collect();
        kinds.sort_unstable();
        kinds
    };
    if kinds(DEVELOPMENT) != kinds(SECOND) {
        return fault("the halves do not have as many corruptions of each kind".into());
    }
    let set = run::simulated(run::DEVELOPMENT.seeds.start, 2.0, None)?;
    for part in [Part::Half, Part::One] {
        let held = (0..set.flights.len()).filter(|flight| part.holds(*flight, set.flights.len(), 1)).count();
        if held == 0 || held == set.flights.len() {
            return fault(format!("`{}` holds {held} of {} flights", part.name(), set.flights.len()));
        }
    }
    let count = every.len();
    for corruption in every {
        // Copies may be exact ones.
        let Change::Columns(change) = corruption.change else { continue };
        for (index, flight) in set.flights.iter().enumerate() {
            let mut log = Log::of(flight);
            change(&mut log, &mut Chance::new(1, index));
            if log.columns == Log::of(flight).columns {
                return fault(format!("{} leaves {} as it is", corruption.id, flight.name));
            }
            log.into_flight(flight)?;
        }
    }
    eprintln!("{} corruptions, each of which changes the flights that it hits", count);
    Ok(())
}

/// Prints what there is.
pub fn list() {
    println!("| half | about | corruption | what is wrong | flights hit |\n| --- | --- | --- | --- | --- |");
    for (half, corruptions) in run::HALVES {
        for Corruption { id, kind, says, parts, .. } in corruptions {
            let parts = parts.map(Part::name).join(", ");
            println!("| {half} | {} | `{id}` | {says} | {parts} |", format!("{kind:?}").to_lowercase());
        }
    }
}
