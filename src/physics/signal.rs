//! The signals of a model: named physical quantities that several effects read and some effects change. A table and its words;
//! how a model is put together from them is in `compose`.

use super::effect::Effect;
use super::rotors::{Part, Total};
use crate::flight::{Channel, Column};

/// How far along the way from the sticks to the accelerations a signal lies: a formula that changes one may read those of its own stage
/// and of earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// What the sticks have become when they arrive.
    Control,
    /// The true motion.
    Motion,
    /// The motion against the air.
    Air,
    /// What the rotors make.
    Rotor,
    /// The sum of all.
    Outcome,
}

/// What a signal is while no effect changes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plain {
    /// A column of the log or a derived quantity, by name.
    Quantity(&'static str),
    /// Another signal.
    Signal(&'static str),
    /// The length of the velocity against the air, or one of its angles.
    OfAir,
    /// The sum of the terms of these effects in one acceleration, to which the signal adds as a whole.
    Terms(&'static [&'static str], Channel),
    /// 1.
    One,
    /// A component of a sum over the model's rotors.
    OverRotors(Total, Part),
    /// The predicted acceleration of this index, of all effects up to the one that reads it.
    Predicted(Channel),
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    /// Name in formulas.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// What it stands for.
    pub meaning: &'static str,
    /// Where it lies on the way.
    pub stage: Stage,
    /// What it is while no effect changes it.
    pub plain: Plain,
}

const fn signal(name: &'static str, unit: &'static str, stage: Stage, plain: Plain, meaning: &'static str) -> Signal {
    Signal { name, unit, meaning, stage, plain }
}

/// The terms of the baseline that are the rotor's thrust: all that acts along body z, weight and turning axes apart.
const THRUST: &[&str] = &["linear_drag", "collective_thrust", "vertical_bias"];
const MOMENT: &[&str] = &["control_moment"];

/// All signals, in the order of the stages. Recorded quantities that are not listed may be changed, too; they are of the stage of the motion.
#[rustfmt::skip]
pub const SIGNALS: [Signal; 59] = [
    signal("stick_1", "1", Stage::Control, Plain::Quantity("u1"), "lateral cyclic as recorded"),
    signal("stick_2", "1", Stage::Control, Plain::Quantity("u2"), "longitudinal cyclic as recorded"),
    signal("stick_3", "1", Stage::Control, Plain::Quantity("u3"), "tail as recorded"),
    signal("stick_4", "1", Stage::Control, Plain::Quantity("u4"), "collective as recorded"),
    signal("u1", "1", Stage::Control, Plain::Quantity("u1"), "lateral cyclic as it arrives, behind delays, servos and flapping"),
    signal("u2", "1", Stage::Control, Plain::Quantity("u2"), "longitudinal cyclic as it arrives"),
    signal("u3", "1", Stage::Control, Plain::Quantity("u3"), "tail as it arrives"),
    signal("u4", "1", Stage::Control, Plain::Quantity("u4"), "collective as it arrives"),
    signal("vx", "m/s", Stage::Motion, Plain::Quantity("vx"), "true velocity over ground along the nose, errors of the measurement taken off"),
    signal("vy", "m/s", Stage::Motion, Plain::Quantity("vy"), "true velocity over ground to starboard"),
    signal("vz", "m/s", Stage::Motion, Plain::Quantity("vz"), "true velocity over ground along body down"),
    signal("wx", "rad/s", Stage::Motion, Plain::Quantity("wx"), "true roll rate"),
    signal("wy", "rad/s", Stage::Motion, Plain::Quantity("wy"), "true pitch rate"),
    signal("wz", "rad/s", Stage::Motion, Plain::Quantity("wz"), "true yaw rate"),
    signal("g_x", "m/s²", Stage::Motion, Plain::Quantity("g_x"), "true gravity along the nose"),
    signal("g_y", "m/s²", Stage::Motion, Plain::Quantity("g_y"), "true gravity to starboard"),
    signal("g_z", "m/s²", Stage::Motion, Plain::Quantity("g_z"), "true gravity along body down"),
    signal("air_vx", "m/s", Stage::Air, Plain::Signal("vx"), "velocity against the air along the nose"),
    signal("air_vy", "m/s", Stage::Air, Plain::Signal("vy"), "velocity against the air to starboard"),
    signal("air_vz", "m/s", Stage::Air, Plain::Signal("vz"), "velocity against the air along body down"),
    signal("airspeed", "m/s", Stage::Air, Plain::OfAir, "length of the velocity against the air"),
    signal("alpha", "rad", Stage::Air, Plain::OfAir, "angle of attack"),
    signal("beta", "rad", Stage::Air, Plain::OfAir, "sideslip"),
    signal("thrust", "m/s²", Stage::Rotor, Plain::Terms(THRUST, Channel::VzDot), "specific force of the main rotor along body z, up negative"),
    signal("rotor_roll", "rad/s²", Stage::Rotor, Plain::Terms(MOMENT, Channel::WxDot), "roll that the tilted disc makes"),
    signal("rotor_pitch", "rad/s²", Stage::Rotor, Plain::Terms(MOMENT, Channel::WyDot), "pitch that the tilted disc makes"),
    signal("tail_thrust", "rad/s²", Stage::Rotor, Plain::Terms(MOMENT, Channel::WzDot), "thrust of the tail rotor, as the yaw that it makes"),
    signal("rotor_speed", "1", Stage::Rotor, Plain::One, "speed of the main rotor over its nominal one"),
    signal("rotors_thrust_x", "rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Thrust, Part::Along(0)), "rotors' thrust over its factor, Ω² n, summed: along the nose"),
    signal("rotors_thrust_y", "rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Thrust, Part::Along(1)), "rotors' thrust over its factor, Ω² n, summed: to starboard"),
    signal("rotors_thrust_z", "rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Thrust, Part::Along(2)), "rotors' thrust over its factor, Ω² n, summed: along body down"),
    signal("rotors_thrust_mx", "m rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Thrust, Part::About(0)), "its moment in roll, r × f"),
    signal("rotors_thrust_my", "m rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Thrust, Part::About(1)), "its moment in pitch, r × f"),
    signal("rotors_thrust_mz", "m rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Thrust, Part::About(2)), "its moment in yaw, r × f"),
    signal("rotors_inflow_x", "m rad/s²", Stage::Rotor, Plain::OverRotors(Total::Inflow, Part::Along(0)), "rotors' thrust lost to air along the axis, −Ω (a·n) n: along the nose"),
    signal("rotors_inflow_y", "m rad/s²", Stage::Rotor, Plain::OverRotors(Total::Inflow, Part::Along(1)), "rotors' thrust lost to air along the axis, −Ω (a·n) n: to starboard"),
    signal("rotors_inflow_z", "m rad/s²", Stage::Rotor, Plain::OverRotors(Total::Inflow, Part::Along(2)), "rotors' thrust lost to air along the axis, −Ω (a·n) n: along body down"),
    signal("rotors_inflow_mx", "m² rad/s²", Stage::Rotor, Plain::OverRotors(Total::Inflow, Part::About(0)), "its moment in roll, r × f"),
    signal("rotors_inflow_my", "m² rad/s²", Stage::Rotor, Plain::OverRotors(Total::Inflow, Part::About(1)), "its moment in pitch, r × f"),
    signal("rotors_inflow_mz", "m² rad/s²", Stage::Rotor, Plain::OverRotors(Total::Inflow, Part::About(2)), "its moment in yaw, r × f"),
    signal("rotors_drag_x", "m rad/s²", Stage::Rotor, Plain::OverRotors(Total::Drag, Part::Along(0)), "rotors' drag in their planes, −Ω (a − (a·n) n): along the nose"),
    signal("rotors_drag_y", "m rad/s²", Stage::Rotor, Plain::OverRotors(Total::Drag, Part::Along(1)), "rotors' drag in their planes, −Ω (a − (a·n) n): to starboard"),
    signal("rotors_drag_z", "m rad/s²", Stage::Rotor, Plain::OverRotors(Total::Drag, Part::Along(2)), "rotors' drag in their planes, −Ω (a − (a·n) n): along body down"),
    signal("rotors_drag_mx", "m² rad/s²", Stage::Rotor, Plain::OverRotors(Total::Drag, Part::About(0)), "its moment in roll, r × f"),
    signal("rotors_drag_my", "m² rad/s²", Stage::Rotor, Plain::OverRotors(Total::Drag, Part::About(1)), "its moment in pitch, r × f"),
    signal("rotors_drag_mz", "m² rad/s²", Stage::Rotor, Plain::OverRotors(Total::Drag, Part::About(2)), "its moment in yaw, r × f"),
    signal("rotors_torque_x", "rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Torque, Part::Along(0)), "the air's torque on the rotors, ∓Ω² n: along the nose"),
    signal("rotors_torque_y", "rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Torque, Part::Along(1)), "the air's torque on the rotors, ∓Ω² n: to starboard"),
    signal("rotors_torque_z", "rad²/s²", Stage::Rotor, Plain::OverRotors(Total::Torque, Part::Along(2)), "the air's torque on the rotors, ∓Ω² n: along body down"),
    signal("rotors_spin_x", "rad/s", Stage::Rotor, Plain::OverRotors(Total::Spin, Part::Along(0)), "rotors' angular momentum over inertia, ±Ω n: along the nose"),
    signal("rotors_spin_y", "rad/s", Stage::Rotor, Plain::OverRotors(Total::Spin, Part::Along(1)), "rotors' angular momentum over inertia, ±Ω n: to starboard"),
    signal("rotors_spin_z", "rad/s", Stage::Rotor, Plain::OverRotors(Total::Spin, Part::Along(2)), "rotors' angular momentum over inertia, ±Ω n: along body down"),
    signal("predicted_vx", "m/s²", Stage::Outcome, Plain::Predicted(Channel::VxDot), "predicted acceleration along the nose"),
    signal("predicted_vy", "m/s²", Stage::Outcome, Plain::Predicted(Channel::VyDot), "predicted acceleration to starboard"),
    signal("predicted_vz", "m/s²", Stage::Outcome, Plain::Predicted(Channel::VzDot), "predicted acceleration along body down"),
    signal("predicted_wx", "rad/s²", Stage::Outcome, Plain::Predicted(Channel::WxDot), "predicted roll acceleration"),
    signal("predicted_wy", "rad/s²", Stage::Outcome, Plain::Predicted(Channel::WyDot), "predicted pitch acceleration"),
    signal("predicted_wz", "rad/s²", Stage::Outcome, Plain::Predicted(Channel::WzDot), "predicted yaw acceleration"),
    signal("height", "m", Stage::Motion, Plain::Quantity("height"), "height above ground"),
];

/// A signal of the table by name.
pub fn signal_named(name: &str) -> Option<&'static Signal> {
    SIGNALS.iter().find(|signal| signal.name == name)
}

/// Where a name lies on the way; recorded quantities that are in no row are of the motion.
pub(super) fn stage_of(name: &str) -> Stage {
    signal_named(name).map_or(Stage::Motion, |signal| signal.stage)
}

/// Whether an effect may change what goes by this name: a quantity or a signal, but neither a stick as recorded nor what follows from
/// other signals.
pub(super) fn changeable(name: &str) -> bool {
    match signal_named(name) {
        Some(signal) => {
            !name.starts_with("stick_") && !matches!(signal.plain, Plain::OfAir | Plain::OverRotors(..) | Plain::Predicted(_))
        }
        None => Column::from_name(name).is_none_or(|column| !Column::TARGETS.contains(&column)),
    }
}

impl Effect {
    /// The signals that its formulas read, in the order of [`SIGNALS`].
    pub fn reads(&self) -> Vec<&'static Signal> {
        let names: Vec<&str> = self.formulas().flat_map(|formula| formula.names()).collect();
        SIGNALS.iter().filter(|signal| names.contains(&signal.name)).collect()
    }

    /// Whether it reads a sum over the model's rotors, which are then to be listed.
    pub fn reads_rotors(&self) -> bool {
        self.reads().iter().any(|signal| matches!(signal.plain, Plain::OverRotors(..)))
    }

    /// The signals that it changes, in the order of [`SIGNALS`].
    pub fn changes(&self) -> Vec<&'static Signal> {
        SIGNALS.iter().filter(|signal| self.swaps.iter().any(|swap| swap.name == signal.name)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::{catalogue, standard_names};

    #[test]
    fn every_row_stands_once_and_on_what_is_there() {
        for (index, signal) in SIGNALS.iter().enumerate() {
            assert!(SIGNALS.iter().skip(index + 1).all(|other| other.name != signal.name), "{}", signal.name);
            match signal.plain {
                Plain::Quantity(name) => assert!(standard_names().contains(&name), "{name}"),
                Plain::Signal(name) => assert!(stage_of(name) < signal.stage, "{name}"),
                Plain::Terms(effects, _) => {
                    assert!(effects.iter().all(|kind| catalogue::definition(kind).is_some()))
                }
                Plain::OfAir | Plain::One | Plain::OverRotors(..) | Plain::Predicted(_) => {}
            }
        }
    }

    #[test]
    fn what_is_recorded_or_follows_from_others_is_not_changed() {
        for name in ["stick_1", "airspeed", "predicted_wz", "vz_dot"] {
            assert!(!changeable(name), "{name}");
        }
        for name in ["u4", "vx", "air_vz", "thrust", "rotor_speed", "roll", "flag"] {
            assert!(changeable(name), "{name}");
        }
    }
}
