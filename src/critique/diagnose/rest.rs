//! What is left when the search has ended: does it still depend on something measured, and does that cast doubt on what was named?
//!
//! An effect outside the catalogue is mimicked in part by one inside. The sign of it: in the channel in which the named effect was
//! worth while, the rest depends on a variable that the effect reads, and more of the error depends so than the effect removed.

use super::report::{DependsOn, TriedFormula, UnknownChannel};
use crate::critique::unknown::{ROWS_MAX, ResidualTable, Unknown, UnknownOptions, unknown};
use crate::error::Result;
use crate::flight::{Accelerations, Channel, Column, Flight, PerChannel, Span};
use crate::physics::{Effect, Model};

/// Looks for a dependence of measured minus predicted acceleration. Nothing found is an empty list; too little data too.
pub(super) fn dependences(flights: &[Flight], model: &Model, spans: &[Span], block_s: f64, seed: u64) -> Result<Vec<Unknown>> {
    let residual = |flight: usize| -> Result<Accelerations> {
        let Some(flight) = flights.get(flight) else { return Ok(Accelerations::default()) };
        let mut residual = model.predict(flight)?;
        for (values, target) in residual.iter_mut().zip(Column::TARGETS) {
            values.iter_mut().zip(flight.column(target)).for_each(|(value, measured)| *value = measured - *value);
        }
        Ok(residual)
    };
    let table = if model.feels_wind()? {
        // What blows on the aircraft is the air: in a wind, velocities over ground blur a dependence on it.
        let air = |flight: usize| model.air_velocity(&flights[flight]);
        ResidualTable::against_air(flights, spans, &residual, &air, block_s)?
    } else {
        ResidualTable::new(flights, spans, &residual, block_s, ROWS_MAX)?
    };
    match unknown(&table, &UnknownOptions { seed, ..UnknownOptions::default() }) {
        Err(crate::Error::Undetermined(_)) => Ok(Vec::new()),
        found => Ok(found?.into_iter().filter(|unknown| unknown.r2 >= least(unknown)).collect()),
    }
}

/// R² from which a dependence on a stick or a rate is believed. A pilot who answers gusts makes sticks and rates tell of the gust that
/// still blows, which no effect of the aircraft is: of a gust that lasts 0.2 s, what was known 0.1 s ago tells exp(−1) of its variance.
const LEAST_OF_LOOP: f64 = 0.35;

fn least(unknown: &Unknown) -> f64 {
    let of_loop = ["u1", "u2", "u3", "u4", "wx", "wy", "wz"];
    let first = unknown.depends_on.first().map_or("", |first| first.variable.as_str());
    if of_loop.contains(&first) { LEAST_OF_LOOP } else { 0.0 }
}

/// What is said of an effect that only stands in for something else.
pub(super) const STANDS_IN: &str = "stands in for a stronger dependence that is in no effect of the catalogue";

/// What an effect took from a channel's mean squared error, and what is left there.
#[derive(Clone, Copy, Default)]
pub(super) struct Share {
    /// Taken by all effects that were accepted.
    pub by_all: f64,
    /// Taken by this effect beside them.
    pub by_itself: f64,
    /// Left with all of them.
    pub left: f64,
}

/// Whether an effect may only stand in for a dependence: more of the error depends so than the accepted effects took away. Where the effect reads the
/// very variable, the dependence need be only half as large, or larger than what this effect took by itself: beside strong effects the
/// sum says nothing of a weak one. An effect that is worth while in another channel as well is not one.
pub(super) fn stands_in(effect: &Effect, channels: &[Channel], shares: &PerChannel<Share>, unknown: &[Unknown]) -> bool {
    channels.iter().all(|&channel| {
        unknown.iter().filter(|unknown| unknown.channel == channel.name()).any(|unknown| {
            let variable = unknown.depends_on.first().map_or("", |first| first.variable.as_str());
            let terms = effect.terms.iter().filter(|term| term.channel == channel).map(|term| &term.regressor);
            let mut formulas = terms.chain(effect.swaps.iter().map(|swap| &swap.with));
            let reads = formulas.any(|formula| formula.names().iter().any(|name| related(name, variable)));
            let Share { by_all, by_itself, left } = shares[channel];
            let bar = if reads { by_itself.min(0.5 * by_all) } else { by_all };
            unknown.r2 * left > bar
        })
    })
}

/// Whether two names speak of the same motion: a speed is made of velocities.
fn related(name: &str, variable: &str) -> bool {
    let speeds = |name: &str| ["airspeed", "hypot(vx, vy)", "hypot(air_vx, air_vy)"].contains(&name);
    let [name, variable] = [name, variable].map(|name| name.strip_prefix("air_").unwrap_or(name));
    let velocities = |name: &str| ["vx", "vy", "vz"].contains(&name);
    let gravity = ["g_x", "g_y", "g_z"].contains(&name) && ["roll", "pitch"].contains(&variable);
    name == variable
        || gravity
        || speeds(name) && (velocities(variable) || speeds(variable))
        || velocities(name) && speeds(variable)
}

/// For the report.
///
/// A formula that was tried and did not hold is not suggested.
pub(super) fn channel(unknown: &Unknown, tried: Option<TriedFormula>) -> UnknownChannel {
    let stands = tried.as_ref().filter(|tried| tried.holds());
    UnknownChannel {
        channel: unknown.channel.into(),
        r2: unknown.r2,
        null_r2_95: unknown.null_r2_95,
        depends_on: unknown.depends_on.iter().map(|on| DependsOn { variable: on.variable.clone(), share: on.share }).collect(),
        shape: unknown.skeleton.clone(),
        suggested_formula: stands.map(|tried| tried.formula.clone()),
        suggested_coefficient: stands.map(|tried| tried.coefficient),
        tried,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::unknown::Dependence;
    use crate::physics::catalogue;

    fn stands(kind: &str, variable: &str, share: Share) -> bool {
        let effect = catalogue::definition(kind).expect("in the catalogue").effect(4.58, 0.8);
        let unknown = Unknown {
            channel: "vz_dot",
            r2: 0.5,
            r2_with_feedback: 0.5,
            null_r2_95: 0.1,
            depends_on: vec![Dependence { variable: variable.into(), share: 1.0 }],
            suggested_formula: None,
            skeleton: String::new(),
        };
        stands_in(&effect, &[Channel::VzDot], &PerChannel::splat(share), &[unknown])
    }

    #[test]
    fn a_straight_line_in_the_variable_of_a_curve_stands_in_for_it_whatever_other_effects_removed() {
        let weak = Share { by_all: 20.0, by_itself: 0.4, left: 1.0 };
        assert!(stands("vel_cross", "vy", weak));
        assert!(!stands("vel_cross", "height", weak), "it reads no height");
        assert!(!stands("vel_cross", "vy", Share { by_itself: 0.6, ..weak }), "it does more than is left");
        assert!(stands("vel_cross", "vy", Share { by_all: 0.9, by_itself: 0.6, left: 1.0 }));
        assert!(stands("vel_cross", "height", Share { by_all: 0.4, by_itself: 0.4, left: 1.0 }));
    }
}
