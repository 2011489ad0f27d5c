//! A `[[rotor]]` table of a model file, read strictly and written so that it reads back the same. What a rotor is and what none can have is in `rotors`.

use super::model_file::{located, quoted};
use super::rotors::{Rotor, Turning};
use super::toml_section::Section;
use crate::error::Result;
use crate::formula::Formula;
use crate::suggest::did_you_mean;
use std::fmt::Write as _;

/// Where a rotor pushes to that lifts, in body axes.
const UP: [f64; 3] = [0.0, 0.0, -1.0];

/// A rotor; whether some vehicle can have it is the model's check.
pub(super) fn read_rotor(section: &Section<'_>) -> Result<Rotor> {
    section.allow(&["speed", "position_m", "axis", "turns"])?;
    let text = section
        .text("speed")?
        .ok_or_else(|| section.fault("speed", "nothing", "`speed = \"…\"`, rad/s, a formula of columns of the log"))?;
    let speed = Formula::parse(text).map_err(|error| located(section, "speed", "rotor", error))?;
    let turns = section
        .text("turns")?
        .ok_or_else(|| section.fault("turns", "nothing", "`turns = \"clockwise\"` or `\"counterclockwise\"`, seen from above"))?;
    let names = Turning::ALL.map(Turning::name);
    let turns = Turning::ALL.into_iter().find(|turning| turning.name() == turns).ok_or_else(|| {
        let found = format!("`{turns}`{}", did_you_mean(turns, names));
        section.fault("turns", found, format!("one of `{}`, seen from above", names.join("`, `")))
    })?;
    let position_m = section.numbers("position_m")?.ok_or_else(|| {
        section.fault("position_m", "nothing", "`position_m = [forward, starboard, down]` from the centre of mass")
    })?;
    Ok(Rotor { speed, position_m, axis: section.numbers("axis")?.unwrap_or(UP), turns })
}

/// Its table, behind an empty line; an axis that lifts is not written.
pub(super) fn write_rotor(text: &mut String, rotor: &Rotor) {
    let Rotor { speed, position_m, axis, turns } = rotor;
    // Writing to a String does not fail.
    let _ = writeln!(text, "\n[[rotor]]\nspeed = {}\nposition_m = {position_m:?}", quoted(&speed.to_string()));
    if *axis != UP {
        let _ = writeln!(text, "axis = {axis:?}");
    }
    let _ = writeln!(text, "turns = {}", quoted(turns.name()));
}
