//! What is flown: twenty manoeuvre classes, each a randomised list of segments. How it is flown is in `pilot.rs`.

use super::random::Random;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The classes, sorted by name, and the seconds each gets in a session like the Stanford set: 140 s to 510 s, 7376 s in all
/// (paper section 4.1).
pub const CLASSES: [(&str, u32); 20] = [
    ("chaos", 510),
    ("control_steps", 420),
    ("descents", 380),
    ("dodging_demos", 350),
    ("figure_eights", 400),
    ("flips", 320),
    ("forward_sideways_flight", 480),
    ("freestyle_aggressive", 450),
    ("freestyle_gentle", 460),
    ("hover", 300),
    ("hover_low", 320),
    ("inverted_flight", 340),
    ("loops", 336),
    ("orientation_sweeps", 390),
    ("pirouettes", 310),
    ("rolls", 310),
    ("stall_turns", 320),
    ("stop_and_go", 360),
    ("turn_demos1", 140),
    ("vertical_sweeps", 480),
];

/// Thrust while the pilot flies rates instead of a path, in g along the mast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Thrust {
    /// Constant part.
    pub(super) constant: f64,
    /// Part times the cosine of the tilt: positive upright, negative inverted.
    pub(super) upright: f64,
}

/// What the pilot is after during a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    /// A path: velocity ahead and to the right of the reference heading (m/s), climb (m/s) or a height to hold (m), and how the
    /// nose and the path turn (rad/s).
    Path { ahead: f64, right: f64, climb: Option<f64>, nose_turn: f64, path_turn: f64, inverted: bool },
    /// Velocities swept sinusoidally, amplitudes in m/s and rad/s, period (s) going from first to last.
    Sweep { ahead: f64, right: f64, climb: f64, turn: f64, periods: [f64; 2], inverted: bool },
    /// Bank and pitch swept sinusoidally, rad.
    Lean { bank: f64, pitch: f64, period: f64 },
    /// Body rates, rad/s, with a thrust.
    Rates { rates: [f64; 3], thrust: Thrust },
    /// An open-loop input added to one control in near-level flight ahead (m/s): signs of successive units of time (s).
    Stick { channel: usize, amplitude: f64, unit_s: f64, pattern: &'static [f64], ahead: f64 },
}

/// A goal, how long for, and at what height (m) if it is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) seconds: f64,
    pub(super) height: f64,
    pub(super) goal: Goal,
}

/// 3-2-1-1 (Klein and Morelli, Aircraft System Identification, section 9.4).
const MULTISTEP: &[f64] = &[1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0];
const DOUBLET: &[f64] = &[1.0, -1.0];
const STEP: &[f64] = &[1.0];

fn path(ahead: f64, right: f64, turn: f64) -> Goal {
    Goal::Path { ahead, right, climb: None, nose_turn: turn, path_turn: turn, inverted: false }
}

fn rates(rates: [f64; 3], constant: f64, upright: f64) -> Goal {
    Goal::Rates { rates, thrust: Thrust { constant, upright } }
}

/// Height at which a class starts, m.
pub(super) fn start_height(class: &str) -> f64 {
    match class {
        "hover_low" => 1.3,
        "control_steps" => 6.0,
        "hover" => 4.0,
        "pirouettes" => 12.0,
        "descents" => 40.0,
        "vertical_sweeps" | "orientation_sweeps" | "turn_demos1" | "dodging_demos" | "stop_and_go" => 20.0,
        _ => 55.0,
    }
}

/// Segments of a class for at least `seconds`.
pub(super) fn script(class: &str, seconds: f64, random: &mut Random) -> Vec<Segment> {
    let mut segments = Vec::new();
    let mut total = 0.0;
    while total < seconds {
        let first = segments.len();
        one(class, random, &mut segments);
        total += segments[first..].iter().map(|segment| segment.seconds).sum::<f64>();
    }
    segments
}

/// Appends one instance of the class's manoeuvre, with its entry and recovery.
fn one(class: &str, random: &mut Random, segments: &mut Vec<Segment>) {
    let home = start_height(class);
    match class {
        "hover" | "hover_low" | "vertical_sweeps" | "orientation_sweeps" | "pirouettes" | "control_steps" | "descents" => {
            about_hover(class, home, random, segments)
        }
        "forward_sideways_flight" | "stop_and_go" | "turn_demos1" | "figure_eights" | "dodging_demos" => {
            travelling(class, home, random, segments)
        }
        "loops" | "flips" | "rolls" | "stall_turns" | "inverted_flight" | "chaos" => aerobatic(class, home, random, segments),
        _ => freestyle(class, home, random, segments),
    }
}

fn spread(random: &mut Random, value: f64) -> f64 {
    value * random.between(0.75, 1.25)
}

/// Near a place: hover, sweeps, turns on the spot, single sticks, descents.
fn about_hover(class: &str, home: f64, random: &mut Random, segments: &mut Vec<Segment>) {
    let mut fly = |seconds: f64, height: f64, goal: Goal| segments.push(Segment { seconds, height, goal });
    match class {
        // Heights evenly spread in their logarithm, so that the ground is felt in half of them.
        "hover" => fly(random.between(3.0, 6.0), 0.8 * random.between(0.0, 8.0_f64.ln()).exp(), path(0.0, 0.0, 0.0)),
        "hover_low" => {
            let (ahead, right) = (random.between(-1.0, 1.0), random.between(-1.0, 1.0));
            fly(random.between(2.5, 5.0), random.between(0.7, 1.8), path(ahead, right, random.between(-0.4, 0.4)));
        }
        "vertical_sweeps" => {
            let periods = [random.between(5.0, 7.0), random.between(2.0, 3.5)];
            let (height, climb) =
                if random.uniform() < 0.6 { (1.9, random.between(0.4, 0.8)) } else { (home, random.between(2.0, 5.0)) };
            fly(3.0, height, path(0.0, 0.0, 0.0));
            fly(14.0, height, Goal::Sweep { ahead: 0.0, right: 0.0, climb, turn: 0.0, periods, inverted: false });
        }
        "orientation_sweeps" => {
            let (bank, pitch) = ((random.between(0.3, 0.9)) * random.sign(), random.between(0.3, 0.8) * random.sign());
            let (bank, pitch) = [(bank, 0.0), (0.0, pitch), (bank, pitch)][random.below(3)];
            fly(6.0, home, Goal::Lean { bank, pitch, period: random.between(1.6, 2.8) });
            fly(2.0, home, path(0.0, 0.0, random.between(-0.8, 0.8)));
        }
        "pirouettes" => {
            let nose_turn = random.sign() * random.between(1.2, 4.0);
            let (ahead, right) = (random.between(-4.0, 4.0), random.between(-4.0, 4.0));
            let goal = Goal::Path { ahead, right, climb: None, nose_turn, path_turn: 0.0, inverted: false };
            fly(random.between(2.5, 5.0), random.between(9.0, 15.0), goal);
        }
        "control_steps" => {
            let channel = random.below(4);
            let amplitude = random.sign() * [0.14, 0.14, 0.30, 0.16][channel] * random.between(0.7, 1.2);
            let pattern = [MULTISTEP, DOUBLET, STEP][random.below(3)];
            let unit_s = random.between(0.15, 0.3);
            let ahead = [0.0, 0.0, 6.0, 10.0][random.below(4)];
            // Low over the ground only at rest and without collective inputs.
            let height = if ahead == 0.0 && channel != 3 { 2.3 } else { home };
            let seconds = unit_s * pattern.len() as f64;
            fly(seconds, height, Goal::Stick { channel, amplitude, unit_s, pattern, ahead });
            fly(random.between(1.8, 2.6), height, path(ahead, 0.0, 0.0));
        }
        "descents" => {
            // Down, round out, hover low, and back up.
            let (ahead, sink) = (random.between(0.0, 10.0), random.between(2.5, 7.5));
            let climb = |climb, ahead| Goal::Path {
                ahead,
                right: 0.0,
                climb: Some(climb),
                nose_turn: 0.0,
                path_turn: 0.1,
                inverted: false,
            };
            fly(34.0 / sink, home, climb(-sink, ahead));
            fly(5.0, 6.0, path(0.0, 0.0, 0.0));
            fly(random.between(5.0, 8.0), random.between(1.0, 2.2), path(0.0, 0.0, 0.0));
            fly(6.5, home, climb(random.between(4.0, 5.5), ahead));
        }
        _ => unreachable!("{class} is no manoeuvre of this kind"),
    }
}

/// From place to place, upright.
fn travelling(class: &str, home: f64, random: &mut Random, segments: &mut Vec<Segment>) {
    let mut fly = |seconds: f64, height: f64, goal: Goal| segments.push(Segment { seconds, height, goal });
    match class {
        "forward_sideways_flight" => {
            let (ahead, right) = [(14.0, 0.0), (-7.0, 0.0), (0.0, 8.0), (0.0, -8.0), (9.0, 6.0)][random.below(5)];
            let pace = random.between(0.4, 1.15);
            fly(random.between(4.0, 7.0), random.between(15.0, 45.0), path(pace * ahead, pace * right, 0.0));
            fly(1.5, home, path(0.3 * ahead, 0.3 * right, random.sign() * random.between(0.3, 0.9)));
        }
        "stop_and_go" => {
            fly(random.between(2.5, 4.0), home, path(spread(random, 11.0), 0.0, 0.0));
            fly(random.between(1.5, 3.0), home, path(0.0, 0.0, random.between(-0.7, 0.7)));
        }
        "turn_demos1" => fly(spread(random, 5.0), home, path(spread(random, 9.0), 0.0, random.sign() * random.between(0.3, 0.8))),
        "figure_eights" => {
            let (pace, turn) = (spread(random, 9.0), random.between(0.6, 0.85));
            let height = random.between(20.0, 50.0);
            fly(TAU / turn, height, path(pace, 0.0, turn));
            fly(TAU / turn, height, path(pace, 0.0, -turn));
        }
        "dodging_demos" => {
            let side = random.sign() * random.between(5.0, 9.0);
            fly(random.between(0.9, 1.6), home, path(random.between(0.0, 6.0), side, 0.0));
            fly(random.between(0.9, 1.6), home, path(random.between(0.0, 6.0), -side, random.between(-0.5, 0.5)));
        }
        _ => unreachable!("{class} is no manoeuvre of this kind"),
    }
}

/// Far from upright.
fn aerobatic(class: &str, home: f64, random: &mut Random, segments: &mut Vec<Segment>) {
    let mut fly = |seconds: f64, height: f64, goal: Goal| segments.push(Segment { seconds, height, goal });
    match class {
        "loops" => {
            fly(3.0, home, path(12.0, 0.0, random.between(-0.3, 0.3)));
            let rate = random.between(2.2, 3.0) * if random.uniform() < 0.7 { 1.0 } else { -1.0 };
            fly(TAU / rate.abs(), home, rates([0.0, rate, 0.0], 0.3, 1.7));
            fly(2.5, home, path(6.0, 0.0, 0.0));
        }
        "flips" => {
            fly(2.0, home, path(random.between(-3.0, 3.0), 0.0, 0.0));
            let rate = random.sign() * random.between(3.5, 5.0);
            fly(TAU / rate.abs(), home, rates([0.0, rate, 0.0], 0.0, 1.7));
            fly(2.0, home, path(0.0, 0.0, 0.0));
        }
        "rolls" => {
            fly(2.5, home, path(random.between(2.0, 9.0), 0.0, random.between(-0.3, 0.3)));
            let (rate, turns) = (random.sign() * random.between(3.0, 5.5), 1.0 + random.below(2) as f64);
            fly(turns * TAU / rate.abs(), home, rates([rate, 0.0, 0.0], 0.0, 1.8));
            fly(2.0, home, path(4.0, 0.0, 0.0));
        }
        "stall_turns" => {
            // Pull up into a climb, coast, turn about the mast near the top, and dive out.
            fly(3.5, home, path(13.0, 0.0, 0.0));
            fly(1.0, home, rates([0.0, 1.4, 0.0], 1.7, 0.3));
            fly(random.between(0.1, 0.4), home, rates([0.0; 3], 0.15, 0.0));
            let turn = random.sign() * random.between(3.5, 4.5);
            fly(PI / turn.abs(), home, rates([0.0, 0.0, turn], 0.1, 0.0));
            fly(3.5, home, path(9.0, 0.0, 0.0));
        }
        "inverted_flight" => {
            let (ahead, right) = (random.between(-5.0, 7.0), random.between(-3.0, 3.0));
            let turn = random.between(-0.5, 0.5);
            let steady = Goal::Path { ahead, right, climb: None, nose_turn: turn, path_turn: turn, inverted: true };
            let sweep = Goal::Sweep {
                ahead: 0.0,
                right: 0.0,
                climb: 2.5,
                turn: 0.4,
                periods: [random.between(3.0, 5.0); 2],
                inverted: true,
            };
            let half = random.sign() * random.between(3.5, 4.5);
            fly(PI / half.abs(), home, rates([half, 0.0, 0.0], 0.0, 1.6));
            fly(random.between(4.0, 7.0), home, if random.uniform() < 0.6 { steady } else { sweep });
            fly(PI / half.abs(), home, rates([half, 0.0, 0.0], 0.0, 1.6));
            fly(2.5, home, path(0.0, 0.0, 0.0));
        }
        // Tumbling about all axes with the collective following the tilt, and a catch after each.
        "chaos" => {
            for _ in 0..1 + random.below(3) {
                let spin = [random.between(-4.5, 4.5), random.between(-4.5, 4.5), random.between(-3.0, 3.0)];
                fly(random.between(0.5, 1.2), home, rates(spin, 0.0, 1.7));
            }
            fly(random.between(1.5, 2.5), home, path(random.between(-5.0, 5.0), random.between(-5.0, 5.0), 0.0));
        }
        _ => unreachable!("{class} is no manoeuvre of this kind"),
    }
}

/// A mixture, and the ingredients of it at their height.
fn freestyle(class: &str, home: f64, random: &mut Random, segments: &mut Vec<Segment>) {
    let mut fly = |seconds: f64, height: f64, goal: Goal| segments.push(Segment { seconds, height, goal });
    match class {
        "freestyle_gentle" => match random.below(4) {
            0 => one("figure_eights", random, segments),
            1 => one("pirouettes_high", random, segments),
            2 => {
                let (ahead, right, climb) = (random.between(2.0, 8.0), random.between(1.0, 5.0), random.between(1.0, 3.0));
                let periods = [random.between(4.0, 6.0), random.between(2.5, 4.0)];
                fly(9.0, home, Goal::Sweep { ahead, right, climb, turn: random.between(0.2, 0.9), periods, inverted: false });
            }
            _ => {
                fly(random.between(3.0, 5.0), random.between(25.0, 55.0), path(spread(random, 8.0), 0.0, random.between(-0.6, 0.6)))
            }
        },
        "freestyle_aggressive" => {
            let kinds = ["loops", "flips", "rolls", "stall_turns", "inverted_flight", "dodging_high", "pirouettes_high"];
            one(kinds[random.below(kinds.len())], random, segments);
        }
        // Ingredients of the freestyle classes at their height.
        "pirouettes_high" => {
            let nose_turn = random.sign() * random.between(1.0, 3.0);
            let goal =
                Goal::Path { ahead: random.between(2.0, 7.0), right: 0.0, climb: None, nose_turn, path_turn: 0.2, inverted: false };
            fly(TAU / nose_turn.abs(), home, goal);
        }
        _ => {
            let side = random.sign() * random.between(6.0, 10.0);
            fly(1.3, home, path(4.0, side, 0.0));
            fly(1.3, home, path(4.0, -side, random.sign() * FRAC_PI_2 * 0.5));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_sorted_classes_between_140_and_510_s_make_7376_s() {
        assert_eq!(CLASSES.iter().map(|(_, seconds)| seconds).sum::<u32>(), 7376);
        assert!(CLASSES.iter().all(|(_, seconds)| (140..=510).contains(seconds)));
        assert!(CLASSES.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn every_class_has_a_script_of_its_own() {
        let scripts: Vec<_> = CLASSES.iter().map(|(class, _)| script(class, 60.0, &mut Random::new(1, 0, 0))).collect();
        for (index, script) in scripts.iter().enumerate() {
            let seconds: f64 = script.iter().map(|segment| segment.seconds).sum();
            assert!((60.0..90.0).contains(&seconds), "{}: {seconds} s", CLASSES[index].0);
            assert!(script.iter().all(|segment| segment.seconds > 0.1 && segment.height > 0.5));
            assert!(scripts[..index].iter().all(|other| other != script), "{}", CLASSES[index].0);
        }
    }
}
