//! The rotors of a vehicle one by one: where each sits, which way it pushes and turns, and how fast; and what they make together, as sums over
//! them. What an effect makes of a sum is the catalogue's business; the main rotor of a helicopter is in its signals (`thrust`, `rotor_roll` …).
//!
//! Of a rotor at r with thrust along the unit vector n, speed Ω and velocity of the hub against the air a = v + ω × r:
//!
//! | sum | of each rotor | with moments r × f |
//! | --- | --- | --- |
//! | thrust | f = Ω² n | yes |
//! | inflow | f = -Ω (a·n) n: less thrust where air comes from above | yes |
//! | drag | f = -Ω (a - (a·n) n): against its motion in its own plane | yes |
//! | torque | -σ Ω² n: the air's, which the body feels | no |
//! | spin | σ Ω n: angular momentum over moment of inertia | no |
//!
//! σ is 1 for a rotor that turns counterclockwise seen from where it pushes to. Forms: Mahony, Kumar & Corke, IEEE Robot. Autom. Mag. 19(3), 2012;
//! drag and inflow with speed and velocity: Förster, System identification of the Crazyflie 2.0 nano quadrocopter, ETH Zürich 2015.

use super::signal::{Stage, signal_named};
use crate::formula::{Formula, Graph, Node};

/// Most rotors of a vehicle.
pub const MOST_ROTORS: usize = 32;

/// Furthest that a rotor may sit from the centre of mass, m.
const FURTHEST_M: f64 = 20.0;

/// Which way a rotor turns, seen from where it pushes to: from above, for one that lifts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Turning {
    /// As the hands of a clock.
    Clockwise,
    /// The other way.
    Counterclockwise,
}

impl Turning {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Clockwise, Self::Counterclockwise];

    /// Name in model files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Clockwise => "clockwise",
            Self::Counterclockwise => "counterclockwise",
        }
    }

    /// Sign of the angular velocity along the thrust.
    const fn sign(self) -> f64 {
        match self {
            Self::Clockwise => -1.0,
            Self::Counterclockwise => 1.0,
        }
    }
}

/// One rotor.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Rotor {
    /// Its speed, rad/s: a formula of columns of the log.
    pub speed: Formula,
    /// Where its hub sits from the centre of mass: forward, to starboard, down; m.
    pub position_m: [f64; 3],
    /// Where it pushes to, in body axes, of any length; `[0, 0, -1]` lifts.
    pub axis: [f64; 3],
    /// Which way it turns.
    pub turns: Turning,
}

impl Rotor {
    /// Key, found and expected of what no rotor can have; `constant` gives the model's own numbers.
    pub(super) fn fault(&self, constant: &dyn Fn(&str) -> Option<f64>) -> Option<(&'static str, String, String)> {
        if let Some(name) =
            self.speed.names().into_iter().find(|name| signal_named(name).is_some_and(|signal| signal.stage >= Stage::Air))
        {
            let expected = "columns of the log and controls, of which speeds follow".into();
            return Some(("speed", format!("`{name}` in it, which the air and the rotors make"), expected));
        }
        let mut graph = Graph::new();
        if let Err(error) = graph.add(&self.speed, &mut |graph, name| Ok(constant(name).map(|value| graph.number(value)))) {
            return Some(("speed", error.to_string(), "a formula of columns of the log, rad/s".into()));
        }
        if !self.position_m.iter().all(|metres| metres.abs() <= FURTHEST_M) {
            let expected = format!("metres from the centre of mass, at most {FURTHEST_M} m: forward, to starboard, down");
            return Some(("position_m", format!("{:?}", self.position_m), expected));
        }
        let length = self.axis.iter().map(|part| part * part).sum::<f64>().sqrt();
        if !(1e-3..=1e3).contains(&length) {
            let expected = "where the rotor pushes to, forward, to starboard, down: `[0, 0, -1]` lifts".into();
            return Some(("axis", format!("{:?}", self.axis), expected));
        }
        None
    }

    /// The axis, of length 1.
    fn direction(&self) -> [f64; 3] {
        let length = self.axis.iter().map(|part| part * part).sum::<f64>().sqrt();
        self.axis.map(|part| part / length)
    }
}

/// What is summed over the rotors; see the table of this file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Total {
    /// Speed squared along the thrust.
    Thrust,
    /// What air along the axis takes from that.
    Inflow,
    /// What air across it drags.
    Drag,
    /// Torque of the air.
    Torque,
    /// Angular momentum.
    Spin,
}

/// A component of a sum in body axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Of the force, or of a sum that has no moment of its own: 0 forward, 1 to starboard, 2 down.
    Along(usize),
    /// Of the moment about such an axis.
    About(usize),
}

/// Rotors in motion.
pub(super) struct Rotors<'a> {
    pub rotors: &'a [Rotor],
    /// Speed of each, rad/s.
    pub speeds: &'a [Node],
    /// Velocity of the centre of mass against the air, m/s.
    pub air: [Node; 3],
    /// Angular velocity, rad/s.
    pub rates: [Node; 3],
}

impl Rotors<'_> {
    /// A component of a sum.
    pub fn total(&self, graph: &mut Graph, total: Total, part: Part) -> Node {
        let mut sum = graph.number(0.0);
        for (rotor, speed) in self.rotors.iter().zip(self.speeds) {
            let of_one = match part {
                Part::Along(axis) => self.force(graph, (rotor, *speed), total, axis),
                Part::About(axis) => {
                    // (r × f) about an axis is r of the next f of the one after it, less the other way round.
                    let [next, after] = [(axis + 1) % 3, (axis + 2) % 3];
                    let [near, far] = [after, next].map(|axis| self.force(graph, (rotor, *speed), total, axis));
                    linear(graph, &[(rotor.position_m[next], near), (-rotor.position_m[after], far)])
                }
            };
            sum = graph.sum(sum, of_one);
        }
        sum
    }

    fn force(&self, graph: &mut Graph, (rotor, speed): (&Rotor, Node), total: Total, axis: usize) -> Node {
        let (along, sign) = (rotor.direction()[axis], rotor.turns.sign());
        let square = graph.product(speed, speed);
        match total {
            Total::Thrust => linear(graph, &[(along, square)]),
            Total::Torque => linear(graph, &[(-sign * along, square)]),
            Total::Spin => linear(graph, &[(sign * along, speed)]),
            Total::Inflow => {
                let axial = self.axial(graph, rotor);
                let flow = graph.product(speed, axial);
                linear(graph, &[(-along, flow)])
            }
            Total::Drag => {
                let (hub, axial) = (self.hub(graph, rotor, axis), self.axial(graph, rotor));
                let across = linear(graph, &[(1.0, hub), (-along, axial)]);
                let flow = graph.product(speed, across);
                linear(graph, &[(-1.0, flow)])
            }
        }
    }

    /// Velocity of a hub against the air along a body axis.
    fn hub(&self, graph: &mut Graph, rotor: &Rotor, axis: usize) -> Node {
        let [next, after] = [(axis + 1) % 3, (axis + 2) % 3];
        let arm = rotor.position_m;
        linear(graph, &[(1.0, self.air[axis]), (arm[after], self.rates[next]), (-arm[next], self.rates[after])])
    }

    /// Velocity of a hub along its rotor's thrust.
    fn axial(&self, graph: &mut Graph, rotor: &Rotor) -> Node {
        let along = rotor.direction();
        let hub = [0, 1, 2].map(|axis| self.hub(graph, rotor, axis));
        linear(graph, &[(along[0], hub[0]), (along[1], hub[1]), (along[2], hub[2])])
    }
}

/// Numbers times values, summed; those times 0 are not there.
fn linear(graph: &mut Graph, terms: &[(f64, Node)]) -> Node {
    let mut sum = graph.number(0.0);
    for &(factor, node) in terms.iter().filter(|term| term.0 != 0.0) {
        let factor = graph.number(factor);
        let product = graph.product(factor, node);
        sum = graph.sum(sum, product);
    }
    sum
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::Result;
    use crate::flight::{Channel, Column, Flight, Targets};
    use crate::physics::{Effect, Model};
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    /// Four rotors in a cross whose speeds follow the controls, one of them tilted, none in the plane of the centre of mass.
    pub(in super::super) fn four() -> Result<Vec<Rotor>> {
        let corners = [(0.1, 0.12), (-0.1, 0.11), (-0.12, -0.1), (0.1, -0.1)];
        let speeds = ["600 + 90*u4 - 20*u1", "610 + 80*u4 + 15*u2", "590 + 90*u4 + 20*u1", "600 + 70*u4 + 10*u3"];
        let mut rotors = Vec::new();
        for (index, ((x, y), speed)) in corners.into_iter().zip(speeds).enumerate() {
            rotors.push(Rotor {
                speed: Formula::parse(speed)?,
                position_m: [x, y, -0.02],
                axis: [0.0, if index == 2 { 0.2 } else { 0.0 }, -1.0],
                turns: Turning::ALL[index % 2],
            });
        }
        Ok(rotors)
    }

    /// The sums of the table of this file by plain vectors: forces and their moments.
    fn by_hand(rotors: &[Rotor], speeds: &[f64], air: [f64; 3], rates: [f64; 3], total: Total) -> [f64; 6] {
        let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let mut sums = [0.0; 6];
        for (rotor, speed) in rotors.iter().zip(speeds) {
            let n = rotor.direction();
            let turning = cross(rates, rotor.position_m);
            let hub: [f64; 3] = std::array::from_fn(|axis| air[axis] + turning[axis]);
            let axial: f64 = (0..3).map(|axis| hub[axis] * n[axis]).sum();
            let sign = if rotor.turns == Turning::Counterclockwise { 1.0 } else { -1.0 };
            let force: [f64; 3] = std::array::from_fn(|axis| match total {
                Total::Thrust => speed * speed * n[axis],
                Total::Inflow => -speed * axial * n[axis],
                Total::Drag => -speed * (hub[axis] - axial * n[axis]),
                Total::Torque => -sign * speed * speed * n[axis],
                Total::Spin => sign * speed * n[axis],
            });
            let moment = cross(rotor.position_m, force);
            for axis in 0..3 {
                sums[axis] += force[axis];
                sums[3 + axis] += moment[axis];
            }
        }
        sums
    }

    proptest! {
        #[test]
        fn sums_are_those_of_vectors(state in prop::array::uniform16(-3.0..3.0f64)) {
            let mut model = Model::paper("four", 1.0, [0.01, 0.011, 0.02], 0.1);
            model.rotors = four()?;
            let columns = std::array::from_fn(|column| vec![state.get(column).copied().unwrap_or(0.0); 2]);
            let flight = Flight::new("a", "made_up", 0.0, 0.01, columns, Targets::Recorded)?;
            let value = |column: Column| state[column as usize];
            let (air, rates) = ([Column::Vx, Column::Vy, Column::Vz].map(value), [Column::Wx, Column::Wy, Column::Wz].map(value));
            let mut speeds = Vec::new();
            for rotor in &model.rotors {
                speeds.push(crate::physics::evaluate(&rotor.speed, &flight)?[0]);
            }
            for signal in crate::physics::SIGNALS.iter() {
                let crate::physics::Plain::OverRotors(total, part) = signal.plain else { continue };
                let mut reading = model.clone();
                reading.effects = vec![Effect::formula("sum", Channel::VxDot, signal.name, 1.0)?];
                let found = reading.predict(&flight)?[Channel::VxDot][1];
                let expected = by_hand(&model.rotors, &speeds, air, rates, total)[match part {
                    Part::Along(axis) => axis,
                    Part::About(axis) => 3 + axis,
                }];
                let scale = 700.0 * 700.0;
                prop_assert!((found - expected).abs() <= Tolerance::Close.relative_f64() * scale, "{}: {found} and {expected}", signal.name);
            }
        }
    }

    #[test]
    fn a_quadrotor_loses_thrust_in_a_climb_is_damped_in_roll_and_turned_by_its_spin() -> Result<()> {
        let mut model = Model::paper("four", 0.5, [0.001, 0.001, 0.002], 0.1);
        model.effects.clear();
        model.rotors = four()?;
        model.rotors.iter_mut().for_each(|rotor| rotor.axis = [0.0, 0.0, -1.0]);
        // All turn the same way, so that spin is left.
        model.rotors.iter_mut().for_each(|rotor| rotor.turns = Turning::Clockwise);
        let sample = |column: Column, value: f64| {
            let columns = std::array::from_fn(|index| vec![if index == column as usize { value } else { 0.0 }; 2]);
            Flight::new("a", "made_up", 0.0, 0.01, columns, Targets::Recorded)
        };
        let with = |kind: &str, number: f64| -> Result<Model> {
            let mut model = model.clone();
            let mut effect = crate::physics::catalogue::definition(kind).expect("of the catalogue").effect(0.5, 0.1);
            effect.coefficients.iter_mut().for_each(|coefficient| coefficient.value = number);
            model.effects.push(effect);
            Ok(model)
        };
        let inflow = with("rotor_inflow", 1e-3)?;
        assert!(inflow.predict(&sample(Column::Vz, -2.0)?)?[Channel::VzDot][0] > 0.0, "a climb loses thrust: down is positive");
        assert!(inflow.predict(&sample(Column::Wx, 1.0)?)?[Channel::WxDot][0] < 0.0, "rolling is damped");
        let drag = with("rotor_drag", 1e-3)?.predict(&sample(Column::Vx, 1.0)?)?;
        assert!(
            drag[Channel::VxDot][0] < 0.0 && drag[Channel::WyDot][0] > 0.0,
            "held back, and pitched up from above the centre of mass"
        );
        // Clockwise from above is along body down, so h = J Ω (0, 0, 1) four times, and the moment is -ω × h.
        let speed_sum = 600.0 + 610.0 + 590.0 + 600.0;
        let gyro = with("rotor_gyro", 1e-6)?.predict(&sample(Column::Wy, 2.0)?)?;
        let expected = -2.0 * 1e-6 * speed_sum / 0.001;
        let found = gyro[Channel::WxDot][0];
        assert!((found - expected).abs() <= Tolerance::Close.relative_f64() * expected.abs(), "{found} and {expected}");
        Ok(())
    }

    #[test]
    fn what_no_rotor_has_is_refused_with_a_reason() -> Result<()> {
        let [rotor, ..] = four()?.try_into().map(|rotors: [Rotor; 4]| rotors).expect("four");
        let none = |_: &str| None;
        assert!(rotor.fault(&none).is_none());
        let far = Rotor { position_m: [120.0, 0.0, 0.0], ..rotor.clone() };
        assert!(
            far.fault(&none)
                .is_some_and(|(key, found, expected)| key == "position_m" && found.contains("120") && expected.contains("20 m"))
        );
        let flat = Rotor { axis: [0.0; 3], ..rotor.clone() };
        assert!(flat.fault(&none).is_some_and(|(key, ..)| key == "axis"));
        assert!(Rotor { axis: [f64::NAN; 3], ..rotor.clone() }.fault(&none).is_some());
        for (speed, found) in [("300 + thrust", "`thrust`"), ("slew(u1, u2)", "slew")] {
            let speed = Formula::parse(speed)?;
            let fault = Rotor { speed, ..rotor.clone() }.fault(&none);
            assert!(fault.as_ref().is_some_and(|fault| fault.0 == "speed" && fault.1.contains(found)), "{fault:?}");
        }
        Ok(())
    }
}
