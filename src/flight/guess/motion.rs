//! What a log's motion decides, each with what was decided before: attitude and rates, velocity and position, which way is down, units of length, what
//! the accelerations are.

use super::consistency::{
    Fit, Rows, derivative, difference, fit, moving, of_components, smooth, specific_force, tilt, turned, turned_back, turning,
};
use super::decide::State;
use crate::flight::attitude::{Matrix3, QuaternionOrder, quaternion_to_rotation, rotation_body_to_inertial};
use crate::flight::units::factor_of;
use std::f64::consts::PI;

/// What two signals of one cause leave at most, relative.
const AGREES: f64 = 0.5;
/// The same for what a tilt gives, where drag and gusts come on top.
const TILTS: f64 = 0.85;
/// The next best answer leaves so much more.
const MARGIN: f64 = 1.25;

/// The unit whose factor is nearest to a number, by its logarithm.
fn nearest(factor: f64, units: &[(&'static str, f64)]) -> (&'static str, f64) {
    let off = |unit: &&(&str, f64)| (unit.1 / factor).ln().abs();
    *units.iter().min_by(|a, b| off(a).total_cmp(&off(b))).expect("there are units")
}

/// Of answers with what each leaves the one that leaves least, and whether it is the only one.
fn best<T>(mut answers: Vec<(f64, T)>) -> Option<(f64, T, bool)> {
    answers.retain(|answer| answer.0.is_finite());
    answers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let alone = answers.get(1).is_none_or(|second| second.0 > MARGIN * answers[0].0 + 0.01);
    answers.into_iter().next().map(|(rest, answer)| (rest, answer, alone))
}

impl State<'_> {
    /// All of it.
    pub fn motion(&mut self) {
        let Some(rates) = self.triple(["wx", "wy", "wz"]) else { return };
        let Some((rotations, rates)) = self.attitude(&rates) else { return };
        let Some(velocity) = self.triple(["vx", "vy", "vz"]) else { return };
        let Some((over_ground, down, factor)) = self.velocity(&rotations, &velocity) else { return };
        let over_ground: Rows = over_ground.iter().map(|row| row.map(|value| value * factor)).collect();
        self.accelerations(&rotations, &rates, &over_ground, down);
    }

    /// Order of the quaternion, units of angles and rates: what turns as the rates say.
    fn attitude(&mut self, rates: &Rows) -> Option<(Vec<Matrix3>, Rows)> {
        let mut attitudes: Vec<(Vec<Matrix3>, &'static str)> = Vec::new();
        let is_quaternion = !self.has("roll");
        if is_quaternion {
            let parts: Vec<&[f64]> = ["q1", "q2", "q3", "q4"].iter().filter_map(|name| self.values(name)).collect();
            let [a, b, c, d] = parts.as_slice() else { return None };
            for (name, order) in QuaternionOrder::NAMES {
                if self.assigned.lettered && order != QuaternionOrder::ScalarLast {
                    continue;
                }
                let turn = |row: usize| quaternion_to_rotation(order.scalar_last([a[row], b[row], c[row], d[row]]));
                attitudes.push(((0..a.len()).map(turn).collect(), name));
            }
        } else {
            let (roll, pitch) = (self.values("roll")?, self.values("pitch")?);
            let none = vec![0.0; roll.len()];
            let yaw = self.values("yaw").unwrap_or(&none);
            let most = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            // In degrees an aircraft whose numbers stay below this would hardly tilt at all.
            let beyond = most(pitch) > 0.5 * PI + 0.01 || most(roll) > PI + 0.01 || most(yaw) > 40.0;
            for (name, factor) in [("rad", 1.0), ("deg", PI / 180.0)] {
                let is_out = self.hint("roll").map_or((name == "rad") == beyond, |hint| hint != name);
                if !is_out {
                    let turn = |row: usize| rotation_body_to_inertial(roll[row] * factor, pitch[row] * factor, yaw[row] * factor);
                    attitudes.push(((0..roll.len()).map(turn).collect(), name));
                }
            }
        }
        // Without a heading only roll and pitch turn, and two of three axes say enough in level flight.
        let mut answers = Vec::new();
        for (number, (rotations, name)) in attitudes.iter().enumerate() {
            for (unit, factor) in [("rad/s", 1.0), ("deg/s", PI / 180.0)] {
                if self.hint("wx").is_some_and(|hint| hint != unit) {
                    continue;
                }
                let scaled: Rows = rates.iter().map(|row| row.map(|value| value * factor)).collect();
                let (implied, recorded) = turning(rotations, &scaled, self.step_s);
                answers.push((difference(&implied, &recorded), (number, *name, unit, scaled)));
            }
        }
        let (rest, (number, name, unit, scaled), alone) = best(answers)?;
        if is_quaternion && name != "xyzw" {
            self.draft.word("quaternion", name, &format!("So it turns as the rates say, but for {:.0} %.", 100.0 * rest));
        }
        if !is_quaternion && name == "deg" {
            self.draft.unit("angles", "deg", format!("So they turn as the rates say, but for {:.0} %.", 100.0 * rest));
        }
        if unit != "rad/s" {
            self.draft.unit("rates", unit, format!("So attitudes turn, but for {:.0} %.", 100.0 * rest));
        }
        let said = if is_quaternion { format!("quaternion {name}") } else { format!("angles in {name}") };
        if rest < AGREES && alone {
            self.sure.push(format!("{said}, rates in {unit}: attitudes turn as the rates say, but for {:.0} %", 100.0 * rest));
        } else {
            self.doubt(
                format!("{said}, rates in {unit}: attitudes turn otherwise than the rates say by {:.0} %", 100.0 * rest),
                "look whether the rates are those about the axes of roll, pitch and yaw, in their order and with their signs",
            );
        }
        Some((attitudes.swap_remove(number).0, scaled))
    }

    /// Frame and unit of velocity, axes, unit of position. The velocity over ground as recorded, which way is down, and the velocity's factor to m/s.
    fn velocity(&mut self, rotations: &[Matrix3], velocity: &Rows) -> Option<(Rows, f64, f64)> {
        let position = self.triple(["x", "y", "z"]);
        let mut answers = Vec::new();
        for (name, inertial) in [("body", false), ("inertial", true)] {
            if self.assigned.over_ground && !inertial {
                continue;
            }
            let over_ground = if inertial { velocity.clone() } else { turned(rotations, velocity) };
            let tilted = derivative(&over_ground, self.step_s).ok().and_then(|rate| tilt(rotations, &rate, self.step_s));
            let moved = position.as_ref().map(|position| {
                let (rate, mean) = moving(position, &over_ground, self.step_s);
                fit(&rate, &mean).filter(|fit| fit.scale > 0.0).unwrap_or(Fit { scale: 1.0, rest: 1.0 })
            });
            let rest = moved.map_or_else(|| tilted.map_or(1.0, |fit| fit.rest), |fit| fit.rest);
            answers.push((rest, (name, over_ground, tilted, moved)));
        }
        let (rest, (frame, over_ground, tilted, moved), alone) = best(answers)?;
        let most = if moved.is_some() { AGREES } else { TILTS };
        let by = if moved.is_some() { "positions move as it says" } else { "it changes as tilt gives" };
        let why = format!("{by}, but for {:.0} %", 100.0 * rest);
        if frame == "inertial" {
            self.draft.word("velocity", frame, &format!("{}{}.", by[..1].to_uppercase(), &why[1..]));
        }
        if self.assigned.over_ground || (alone && rest < most) {
            self.sure.push(format!("velocity in {frame} axes: {why}"));
        } else {
            let how = "in forward flight with sideslip near nought `body` has vx alone; `check` compares both";
            self.doubt(format!("whether velocity is in body or inertial axes ({frame} taken): {why}"), how);
        }
        let down = self.axes(tilted);
        let factor = self.lengths(tilted, moved);
        Some((over_ground, down, factor))
    }

    /// Axes: which way is down by what tilt gives, north and east by names alone.
    fn axes(&mut self, tilted: Option<Fit>) -> f64 {
        let known = tilted.filter(|fit| fit.rest < TILTS);
        let by_tilt = known.map(|fit| fit.scale < 0.0);
        let up = by_tilt.or(self.assigned.up).unwrap_or(false);
        let axes = match (up, self.assigned.compass) {
            (false, _) => "NED/FRD",
            (true, true) => "ENU/FLU",
            (true, false) => "NWU/FLU",
        };
        let way = if up { "up" } else { "down" };
        let figure = known.map_or(String::new(), |fit| format!("tilt changes the velocity so, but for {:.0} %", 100.0 * fit.rest));
        self.draft.word(
            "axes",
            axes,
            &match known {
                Some(_) => format!("z points {way}: {figure}."),
                None => format!("Which way z points is not known from the motion; taken to be {way}."),
            },
        );
        if known.is_none() || self.assigned.up.is_some_and(|named| named != up) {
            let how = "a flight with larger tilts; or look whether z grows or falls in a climb";
            self.doubt(format!("which way z points ({way} taken)"), how);
        } else {
            self.sure.push(format!("z points {way}: {figure}"));
        }
        if up && !self.assigned.compass {
            let how =
                "it matters to headings and winds only: \"ENU/FLU\" if x is east, \"NWU/FLU\" if x is north or ahead at the start";
            self.doubt("whether x points north or east", how);
        }
        if up { -1.0 } else { 1.0 }
    }

    /// Units of velocity by the size of gravity, of position by velocity.
    fn lengths(&mut self, tilted: Option<Fit>, moved: Option<Fit>) -> f64 {
        const SPEEDS: [(&str, f64); 4] = [("m/s", 1.0), ("ft/s", 0.3048), ("cm/s", 0.01), ("mm/s", 0.001)];
        const LENGTHS: [(&str, f64); 5] = [("m", 1.0), ("ft", 0.3048), ("cm", 0.01), ("mm", 0.001), ("km", 1000.0)];
        let hinted = self.hint("vx").and_then(|hint| Some((hint, factor_of("velocity", hint)?)));
        let measured = tilted.filter(|fit| fit.rest < TILTS).map(|fit| nearest(fit.scale.abs().recip(), &SPEEDS));
        let (unit, factor) = hinted.or(measured).unwrap_or(SPEEDS[0]);
        let gravity =
            tilted.map_or(String::new(), |fit| format!("gravity is {:.2} m/s² of the log's velocity", 9.806_65 * fit.scale.abs()));
        if unit != "m/s" {
            self.draft.unit(
                "velocity",
                unit,
                if hinted.is_some() {
                    "As the name says.".into()
                } else {
                    format!("{}{}.", gravity[..1].to_uppercase(), &gravity[1..])
                },
            );
        }
        if hinted.is_some() || measured.is_some() {
            self.sure.push(format!("velocity is in {unit}: {gravity}"));
        } else {
            self.doubt(
                format!("the unit of velocity ({unit} taken)"),
                "a speed known from the flight: what does the log say there?",
            );
        }
        if let Some(moved) = moved.filter(|fit| fit.rest < AGREES) {
            let hinted = self.hint("x").and_then(|hint| Some((hint, factor_of("position", hint)?)));
            let (unit, _) = hinted.unwrap_or(nearest(factor / moved.scale, &LENGTHS));
            if unit != "m" {
                let why = format!("It moves {:.3} times as fast as the velocity's number says.", moved.scale);
                self.draft.unit("position", unit, why);
            }
            self.sure.push(format!("position is in {unit}"));
        }
        factor
    }

    /// What the recorded accelerations are, and their units.
    fn accelerations(&mut self, rotations: &[Matrix3], rates: &Rows, over_ground: &Rows, down: f64) {
        const UNITS: [(&str, f64); 5] =
            [("m/s^2", 1.0), ("g", 9.806_65), ("mg", 9.806_65e-3), ("ft/s^2", 0.3048), ("cm/s^2", 0.01)];
        if let Some(recorded) = self.triple(["vx_dot", "vy_dot", "vz_dot"])
            && let (Ok(recorded), Ok(acceleration)) = (smooth(&recorded, self.step_s), derivative(over_ground, self.step_s))
        {
            let in_body = turned_back(rotations, &acceleration);
            let velocity = turned_back(rotations, over_ground);
            let kinds = [
                ("derivative", of_components(&in_body, rates, &velocity)),
                ("specific_force", specific_force(rotations, &acceleration, down)),
                ("inertial", acceleration.clone()),
                ("body_acceleration", in_body.clone()),
            ];
            let answers = kinds.iter().filter_map(|(name, rows)| fit(&recorded, rows).map(|fit| (fit.rest, (*name, fit))));
            if let Some((rest, (kind, fit), alone)) = best(answers.collect()) {
                let hinted = self.hint("vx_dot").and_then(|hint| Some((hint, factor_of("acceleration", hint)?)));
                let (unit, _) = hinted.unwrap_or(nearest(fit.scale.abs().recip(), &UNITS));
                let why = format!("The velocity changes so, but for {:.0} %", 100.0 * rest);
                if kind != "derivative" {
                    self.draft.word("targets", kind, &format!("{why}."));
                }
                if unit != "m/s^2" {
                    self.draft.unit("acceleration", unit, format!("{why}."));
                }
                if rest < AGREES && alone && fit.scale > 0.0 {
                    self.sure.push(format!(
                        "accelerations are of the kind `{kind}` in {unit}: the velocity changes so, but for {:.0} %",
                        100.0 * rest
                    ));
                } else {
                    let how = "an accelerometer at rest shows 1 g upwards; `missing` leaves the accelerations to be derived from velocity";
                    self.doubt(format!("what the accelerations are (`{kind}` in {unit} taken)"), how);
                }
            }
        }
        if let Some(recorded) = self.triple(["wx_dot", "wy_dot", "wz_dot"])
            && let (Ok(recorded), Ok(rate)) = (smooth(&recorded, self.step_s), derivative(rates, self.step_s))
            && let Some(fit) = fit(&recorded, &rate)
        {
            let (unit, _) = nearest(fit.scale.abs().recip(), &[("rad/s^2", 1.0), ("deg/s^2", PI / 180.0)]);
            if unit != "rad/s^2" {
                self.draft.unit("angular_acceleration", unit, format!("The rates change so, but for {:.0} %.", 100.0 * fit.rest));
            }
            if fit.rest < AGREES && fit.scale > 0.0 {
                self.sure
                    .push(format!("angular accelerations are in {unit}: the rates change so, but for {:.0} %", 100.0 * fit.rest));
            } else {
                let how = "`missing` leaves them to be derived from the rates";
                self.doubt(format!("what wx_dot wy_dot wz_dot are: the rates change otherwise by {:.0} %", 100.0 * fit.rest), how);
            }
        }
    }
}
