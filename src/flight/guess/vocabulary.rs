//! What columns of logs are called, and which canonical column each then is. Names alone are looked at, no numbers.

/// What a name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// A canonical column, or `t`, or a part of the quaternion.
    Canonical(&'static str),
    /// A part of the quaternion whose letter says which: x, y, z, w.
    Quaternion(usize),
    /// Of position: north, east, down, up.
    Position(Compass),
    /// Of velocity.
    Velocity(Compass),
}

/// A direction over ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compass {
    North,
    East,
    Down,
    Up,
}

use Compass::{Down, East, North, Up};
use Place::{Canonical, Position, Quaternion, Velocity};

/// Names in lower case without anything but letters and digits, better ones first.
const NAMES: &[(Place, &[&str])] = &[
    (Canonical("t"), &["t", "time", "timestamp", "ts", "clock", "timesinceboot", "stamp"]),
    (Canonical("x"), &["x", "posx", "px", "positionx", "xpos"]),
    (Canonical("y"), &["y", "posy", "py", "positiony", "ypos"]),
    (Canonical("z"), &["z", "posz", "pz", "positionz", "zpos"]),
    (Position(North), &["north", "posn", "pn", "posnorth", "positionnorth", "n"]),
    (Position(East), &["east", "pose", "pe", "poseast", "positioneast", "e"]),
    (Position(Down), &["down", "posd", "pd", "posdown", "positiondown", "d"]),
    (Position(Up), &["up", "posu", "posup", "positionup"]),
    (Canonical("roll"), &["roll", "phi", "rollangle", "eulerroll", "attroll", "bank"]),
    (Canonical("pitch"), &["pitch", "theta", "pitchangle", "eulerpitch", "attpitch"]),
    (Canonical("yaw"), &["yaw", "psi", "heading", "hdg", "yawangle", "euleryaw", "attyaw", "psiderived"]),
    (Quaternion(0), &["qx", "quatx", "quaternionx", "orientationx", "qi"]),
    (Quaternion(1), &["qy", "quaty", "quaterniony", "orientationy", "qj"]),
    (Quaternion(2), &["qz", "quatz", "quaternionz", "orientationz", "qk"]),
    (Quaternion(3), &["qw", "quatw", "quaternionw", "orientationw", "qs"]),
    (Canonical("vx"), &["vx", "velx", "velocityx", "vbx", "u", "ub", "xvel", "xdot", "vnose"]),
    (Canonical("vy"), &["vy", "vely", "velocityy", "vby", "v", "vb", "yvel", "ydot"]),
    (Canonical("vz"), &["vz", "velz", "velocityz", "vbz", "w", "wb", "zvel", "zdot"]),
    (Velocity(North), &["vn", "vnorth", "veln", "velnorth", "velocitynorth"]),
    (Velocity(East), &["ve", "veast", "vele", "veleast", "velocityeast"]),
    (Velocity(Down), &["vd", "vdown", "veld", "veldown", "velocitydown"]),
    (Velocity(Up), &["vup", "velu", "velup", "velocityup"]),
    (Canonical("wx"), &["wx", "p", "rollrate", "gyrox", "gyrx", "omegax", "ratex", "angularvelocityx", "rollspeed"]),
    (Canonical("wy"), &["wy", "q", "pitchrate", "gyroy", "gyry", "omegay", "ratey", "angularvelocityy", "pitchspeed"]),
    (Canonical("wz"), &["wz", "r", "yawrate", "gyroz", "gyrz", "omegaz", "ratez", "angularvelocityz", "yawspeed"]),
    (
        Canonical("u1"),
        &["u1", "lateralcyclic", "dlat", "lateral", "aileron", "ail", "dail", "rollcmd", "rollstick", "stickroll", "da", "latcyc"],
    ),
    (
        Canonical("u2"),
        &[
            "u2",
            "longitudinalcyclic",
            "dlon",
            "longitudinal",
            "elevator",
            "ele",
            "elev",
            "dele",
            "pitchcmd",
            "pitchstick",
            "stickpitch",
            "de",
            "loncyc",
        ],
    ),
    (Canonical("u3"), &["u3", "tail", "dped", "pedal", "pedals", "rudder", "rud", "drud", "yawcmd", "yawstick", "stickyaw", "dr"]),
    (
        Canonical("u4"),
        &[
            "u4",
            "collective",
            "dcol",
            "col",
            "throttle",
            "thr",
            "thrust",
            "heave",
            "thrustcmd",
            "throttlestick",
            "stickthrottle",
            "dt",
        ],
    ),
    (Canonical("vx_dot"), &["vxdot", "ax", "accx", "accelx", "accelerationx", "udot", "imuaccx"]),
    (Canonical("vy_dot"), &["vydot", "ay", "accy", "accely", "accelerationy", "vdot", "imuaccy"]),
    (Canonical("vz_dot"), &["vzdot", "az", "accz", "accelz", "accelerationz", "wdot", "imuaccz"]),
    (Canonical("wx_dot"), &["wxdot", "pdot", "omegaxdot", "angularaccelerationx"]),
    (Canonical("wy_dot"), &["wydot", "qdot", "omegaydot", "angularaccelerationy"]),
    (Canonical("wz_dot"), &["wzdot", "rdot", "omegazdot", "angularaccelerationz"]),
    (Canonical("q1"), &["q1"]),
    (Canonical("q2"), &["q2"]),
    (Canonical("q3"), &["q3"]),
    (Canonical("q4"), &["q4"]),
];

/// Words at the end of a name that are units, as names have them.
const UNITS: &[(&str, &str)] = &[
    ("m/s^2", "m/s^2"),
    ("m/s2", "m/s^2"),
    ("mps2", "m/s^2"),
    ("rad/s", "rad/s"),
    ("deg/s", "deg/s"),
    ("dps", "deg/s"),
    ("rps", "rad/s"),
    ("m/s", "m/s"),
    ("mps", "m/s"),
    ("cm/s", "cm/s"),
    ("ft/s", "ft/s"),
    ("fps", "ft/s"),
    ("km/h", "km/h"),
    ("kmh", "km/h"),
    ("kt", "kt"),
    ("kts", "kt"),
    ("knots", "kt"),
    ("deg", "deg"),
    ("rad", "rad"),
    ("ms", "ms"),
    ("us", "us"),
    ("µs", "us"),
    ("ns", "ns"),
    ("s", "s"),
    ("sec", "s"),
    ("ft", "ft"),
    ("cm", "cm"),
    ("mm", "mm"),
    ("m", "m"),
    ("mg", "mg"),
    ("g", "g"),
    ("%", "%"),
    ("pct", "%"),
];

/// A name as it is looked up, and the unit that it ends in.
fn parts(name: &str) -> Vec<(String, Option<&'static str>)> {
    let lower = name.trim().to_lowercase();
    let plain = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
    // The whole first: `q_s`, `v_m` may be names.
    let mut found = vec![(plain(&lower), None)];
    let bracket =
        lower.find(['[', '(']).map(|at| (lower[..at].to_owned(), lower[at + 1..].trim_end_matches([']', ')']).to_owned()));
    let unit = |text: &str| UNITS.iter().find(|unit| unit.0 == text).map(|unit| unit.1);
    if let Some((head, inside)) = bracket
        && let Some(unit) = unit(inside.trim())
    {
        found.push((plain(&head), Some(unit)));
    }
    let tokens: Vec<&str> = lower.split(['_', ' ', '.']).collect();
    for behind in [2, 1] {
        let Some(at) = tokens.len().checked_sub(behind).filter(|at| *at > 0) else { continue };
        if let Some(unit) = unit(&tokens[at..].join("/")) {
            found.push((plain(&tokens[..at].join("_")), Some(unit)));
        }
    }
    found
}

/// What a column is by its name, how good the name is (0 the best), and the unit that it names.
pub(super) fn meaning(name: &str) -> Option<(Place, usize, Option<&'static str>)> {
    parts(name).into_iter().find_map(|(plain, unit)| {
        let of = |(place, names): &(Place, &[&str])| Some((*place, names.iter().position(|known| *known == plain)?, unit));
        NAMES.iter().find_map(of)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_and_without_units_are_known() {
        let of = |name: &str| meaning(name).map(|(place, _, unit)| (place, unit));
        assert_eq!(of("roll"), Some((Canonical("roll"), None)));
        assert_eq!(of("Roll [deg]"), Some((Canonical("roll"), Some("deg"))));
        assert_eq!(of("gyro_x_deg_s"), Some((Canonical("wx"), Some("deg/s"))));
        assert_eq!(of("v_north"), Some((Velocity(North), None)));
        assert_eq!(of("vel_n_ft_s"), Some((Velocity(North), Some("ft/s"))));
        assert_eq!(of("time_us"), Some((Canonical("t"), Some("us"))));
        assert_eq!(of("d_lat"), Some((Canonical("u1"), None)));
        assert_eq!(of("q"), Some((Canonical("wy"), None)));
        assert_eq!((of("Vbat"), of("m1_erpm"), of("p_att")), (None, None, None));
    }

    #[test]
    fn no_name_stands_for_two_columns() {
        let mut all: Vec<&str> = NAMES.iter().flat_map(|entry| entry.1.iter().copied()).collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}
