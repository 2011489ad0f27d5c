//! A cause of single flights as a sentence, and as the line of `dataset.toml` that mends it. What causes there are is in `causes`, which flights have them
//! in `blame`.

use super::causes::{Cause, Kind};
use super::contents::{self, Part};
use super::increments::Vector;
use super::robust::median;
use crate::flight::Column;

/// Of what a vector holds, parts from this share of the largest on are told.
const AMONG: f64 = 0.3;

/// Columns of a kind are a stream.
pub(super) const fn stream_of(column: Column) -> &'static str {
    match column {
        Column::X | Column::Y | Column::Z => "position",
        Column::Roll | Column::Pitch | Column::Yaw => "attitude",
        Column::Vx | Column::Vy | Column::Vz => "velocity",
        Column::Wx | Column::Wy | Column::Wz => "rates",
        Column::U1 | Column::U2 | Column::U3 | Column::U4 => "controls",
        Column::VxDot | Column::VyDot | Column::VzDot => "linear accelerations",
        Column::WxDot | Column::WyDot | Column::WzDot => "angular accelerations",
    }
}

/// A number of the kinds, as usual among the flights.
pub(super) fn usual(all: &[&Cause], of: impl Fn(&Kind) -> f64) -> f64 {
    median(all.iter().map(|cause| of(&cause.kind)).collect()).unwrap_or(0.0)
}

const CONTROLS: [&str; 4] = ["u1", "u2", "u3", "u4"];

/// M of [`super::contents`], as usual among the flights.
fn gains(all: &[&Cause]) -> [Vector; 3] {
    let gain =
        |row: usize, column: usize| usual(all, |kind| if let Kind::Holds(_, gains) = kind { gains[row][column] } else { 0.0 });
    std::array::from_fn(|row| std::array::from_fn(|column| gain(row, column)))
}

/// Where a velocity is measured, m from the centre of gravity, if that is what it holds.
fn measured_at(all: &[&Cause], columns: &[Column], part: Part) -> Option<Vector> {
    let is_velocity = columns.first() == Some(&Column::Vx) && part == Part::Rates;
    // ω × r is −r × ω.
    contents::arm(&gains(all)).filter(|_| is_velocity).map(|arm| arm.map(|part| -part))
}

fn holds(all: &[&Cause], columns: &[Column], part: Part) -> String {
    let stream = columns.first().map_or("", |column| stream_of(*column));
    if let Some([x, y, z]) = measured_at(all, columns, part) {
        return format!(
            "the velocity (vx, vy, vz) is that of a point off the centre of gravity by ({x:.2}, {y:.2}, {z:.2}) m, a lever arm as of an antenna: forward, to \
             the right, down"
        );
    }
    let gains = gains(all);
    let itself = columns.iter().zip(part.names()).all(|(column, name)| column.name() == name);
    if let Some([x, y, z]) = contents::arm(&gains).filter(|_| itself) {
        let degrees = [x, y, z].map(f64::to_degrees);
        return format!(
            "{stream} are measured in axes that are turned by ({:.1}, {:.1}, {:.1})° about x, y and z against those of the rest",
            degrees[0], degrees[1], degrees[2]
        );
    }
    let most = gains.iter().flatten().fold(0.0_f64, |most, gain| most.max(gain.abs()));
    let mut told = Vec::new();
    for (row, column) in gains.iter().zip(columns) {
        let such = row.iter().zip(part.names()).filter(|(gain, name)| gain.abs() > AMONG * most && column.name() != *name);
        told.extend(such.map(|(gain, name)| {
            format!("{} has {} {} for each {} of {name}", column.name(), short(*gain), column.unit(), part.unit())
        }));
    }
    let why = match (columns.first(), part) {
        (Some(Column::Wx), Part::SpecificForce) => "gyros that feel acceleration (g-sensitivity): ",
        _ if itself => "axes that do not stand square to each other, or that are mixed: ",
        _ => "",
    };
    let have = if stream.ends_with('s') { "have" } else { "has" };
    format!("{why}{stream} {have} too much that goes with another stream; {}", told.join(", "))
}

/// Where accelerations are measured, m from the centre of gravity, as usual among the flights.
pub(super) fn usual_arm(all: &[&Cause]) -> Vector {
    std::array::from_fn(|axis| usual(all, |kind| if let Kind::OffCentre(arm) = kind { arm[axis] } else { 0.0 }))
}

fn off_centre(all: &[&Cause]) -> String {
    let [x, y, z] = usual_arm(all);
    format!(
        "the linear accelerations are those of a sensor that is mounted off the centre of gravity by ({x:.2}, {y:.2}, {z:.2}) m, a lever arm: forward, \
         to the right, down"
    )
}

fn uneven_time(all: &[&Cause]) -> String {
    let [short, long] = [0, 1].map(|end| usual(all, |kind| if let Kind::Pace(ends) = kind { ends[end] } else { 1.0 }));
    format!(
        "the time stamps are not those of the rows: all that changes does so {short:.2} to {long:.2} times as fast as they say, by turns; steps of uneven \
         length, or rows that are missing"
    )
}

/// A ratio with the digits that count.
fn short(ratio: f64) -> String {
    if ratio.abs() < 0.1 { format!("{ratio:.3e}") } else { format!("{ratio:.4}") }
}

fn uneven_factors(all: &[&Cause], names: &str) -> String {
    let [small, large] = [0, 1].map(|end| usual(all, |kind| if let Kind::Factors(ends) = kind { ends[end] } else { 1.0 }));
    format!(
        "{names} are {small:.2} to {large:.2} times as large as they should be, a factor of its own at each sample: differences divided by uneven steps of time"
    )
}

fn swings(all: &[&Cause], rings: &str) -> String {
    let [at_hz, damping] =
        [0, 1].map(|of| usual(all, |kind| if let Kind::Swings(at_hz, damping) = *kind { [at_hz, damping][of] } else { 0.0 }));
    format!(
        "{rings} on after each quick change, at {at_hz:.1} Hz with a damping ratio of {damping:.2}: a resonance, as of a sensor on soft mounts"
    )
}

fn stray(all: &[&Cause], is_wrong: &str) -> String {
    let wanders = all.iter().filter(|cause| matches!(cause.kind, Kind::Stray(_, true))).count() * 2 > all.len();
    let how = if wanders { "an error that wanders, slowly" } else { "an error like noise" };
    format!("{is_wrong}, {how}: what such a column moves and what says how fast it changes agree with each other and not with it")
}

/// What is wrong, as a sentence.
pub(super) fn told(all: &[&Cause], columns: &[Column]) -> String {
    let names = columns.iter().map(|column| column.name()).collect::<Vec<_>>().join(", ");
    let (stream, unit) = columns.first().map_or(("", ""), |column| (stream_of(*column), column.unit()));
    let names = if columns.len() == 3 { format!("{stream} ({names})") } else { names };
    let or = all[0].or.map(|or| format!(", or {or} the other way")).unwrap_or_default();
    let first_s = all.iter().filter_map(|cause| cause.from_s).reduce(f64::min);
    let since = first_s.map(|from_s| format!(", from {from_s:.0} s on in the first of them")).unwrap_or_default();
    let places = first_s.map(|from_s| format!(", first at {from_s:.0} s")).unwrap_or_default();
    let number = |of: fn(&Kind) -> f64| usual(all, of);
    let value = number(Kind::size);
    // "the velocity (vx, vy, vz) comes", "the rates (wx, wy, wz) come", "vx, vy come".
    let are_several = columns.len() > 1 && (columns.len() < 3 || stream.ends_with('s'));
    let does = |one: &'static str, more: &'static str| if are_several { more } else { one };
    match all[0].kind {
        Kind::Late(_) => {
            let how = if value < 0.0 { "early" } else { "late" };
            format!("{names} {} {how} by about {:.0} ms{or}{since}", does("comes", "come"), 1e3 * value.abs())
        }
        Kind::Filtered(_) => format!(
            "{names} {} as behind a filter with a time constant of about {value:.2} s: smoothed, slow and late{or}{since}",
            does("comes", "come")
        ),
        Kind::Averaged(_) => format!(
            "{names} {} a mean over about {value:.2} s (averaged, smoothed in both directions of time): what is quick is gone{or}{since}",
            does("is", "are")
        ),
        Kind::Scaled(_) => format!(
            "{names} {} about {} times as large as {} should be: other units or a wrong scale{or}{since}",
            does("is", "are"),
            short(value),
            does("it", "they")
        ),
        Kind::Off(_) => format!("{names} {} an offset of about {value:.3} {unit}{or}{since}", does("has", "have")),
        Kind::Drifts(_) => {
            format!("{names} {}: an offset that grows by about {value:.4} {unit} each second{or}{since}", does("drifts", "drift"))
        }
        Kind::Follows(control, _) => format!(
            "{names} {} with {}: {value:.3} {unit} for one of it that no motion explains, a disturbance by what the control drives, such as a \
             magnetic one{since}",
            does("goes", "go"),
            CONTROLS[control]
        ),
        Kind::Settles(..) => {
            let time_s = number(|kind| if let Kind::Settles(_, time_s) = kind { *time_s } else { 0.0 });
            format!(
                "{names} {} about {value:.3} {unit} off and settles with a time constant of about {time_s:.1} s: a filter that converges from a wrong start",
                does("starts", "start")
            )
        }
        Kind::SignLost => format!(
            "{names} {} never on both sides of 0 and would fit with both signs: the minus signs were lost",
            does("is", "are")
        ),
        Kind::Overflows(_) => format!(
            "{names} {} by {value:.2} {unit} and back: counts that overflow and wrap round, or that are read without their sign{places}",
            does("leaps", "leap")
        ),
        Kind::Leaps => format!(
            "{names} {}, and what says how fast it changes does not: errors in few places, as of an estimator that corrects itself or a sensor that \
             slips{places}",
            does("leaps", "leap")
        ),
        Kind::Rounded(_) => format!("{names} {} rounded to steps of {value:.3} {unit}", does("is", "are")),
        Kind::Noise(_) => format!(
            "{names} {} noise or vibration of about {value:.3} {unit} (rms) that nothing it belongs to has{or}",
            does("has", "have")
        ),
        Kind::Rows => format!(
            "rows do not follow each other: most columns leap at once; a gap, rows repeated or in the wrong order, or parts joined so{places}"
        ),
        Kind::Pace(_) => uneven_time(all),
        Kind::OffCentre(_) => off_centre(all),
        Kind::Holds(part, _) => holds(all, columns, part),
        Kind::Swings(..) => format!("{names} {}{or}{since}", swings(all, does("rings", "ring"))),
        Kind::Factors(_) => uneven_factors(all, &names),
        Kind::Stray(..) => stray(all, &format!("{names} {} wrong by {value:.2} {unit} (rms)", does("is", "are"))),
    }
}

/// A number as it is added in a formula: `+ 0.50`, `- 0.50`.
pub(super) fn plus(number: f64, digits: usize) -> String {
    let sign = if number < 0.0 { '-' } else { '+' };
    format!("{sign} {:.digits$}", number.abs())
}

/// The line that leaves accelerations of the file out, so that they are made of velocity and rates. Angular ones then lack what is quick, which the sticks have,
/// and a rotor that does not follow them would seem to lag.
pub(super) fn derived_anew(names: &[&str]) -> String {
    let smooth = if names.contains(&Column::WxDot.name()) { ", smooth_controls = true" } else { "" };
    format!("ignore = {names:?}, missing = {names:?}{smooth}")
}

/// A linear acceleration without what the arm r of its sensor gives it, v̇ − (ω̇ × r + ω × (ω × r)), as a line of `[columns]`.
fn centred(arm: Vector, axis: usize) -> String {
    let [i, j, k] = [0, 1, 2].map(|step| ["x", "y", "z"][(axis + step) % 3]);
    let [r, s, t] = [0, 1, 2].map(|step| arm[(axis + step) % 3]);
    let terms = [
        (-t, format!("w{j}_dot")),
        (s, format!("w{k}_dot")),
        (-s, format!("w{i} * w{j}")),
        (r, format!("w{j} * w{j}")),
        (r, format!("w{k} * w{k}")),
        (-t, format!("w{i} * w{k}")),
    ];
    // To a millimetre.
    let of_arm = terms.iter().filter(|(by, _)| by.abs() >= 5e-4).map(|(by, rates)| format!(" {} * {rates}", plus(*by, 3)));
    format!("v{i}_dot = \"v{i}_dot{}\"", of_arm.collect::<String>())
}

/// The line of `dataset.toml` that mends all flights, where one can.
pub(super) fn mend(all: &[&Cause], columns: &[Column]) -> Option<String> {
    if all.iter().any(|cause| cause.or.is_some() || cause.from_s.is_some()) {
        return None;
    }
    let lines = |line: &dyn Fn(&str) -> String| columns.iter().map(|column| line(column.name())).collect::<Vec<_>>().join(", ");
    match all[0].kind {
        Kind::Late(_) => {
            let late_s = usual(all, |kind| if let Kind::Late(late_s) = kind { *late_s } else { 0.0 });
            Some(format!("[late] {}", lines(&|name| format!("{name} = {late_s:.3}"))))
        }
        Kind::Scaled(_) => {
            let times = usual(all, |kind| if let Kind::Scaled(times) = kind { *times } else { 1.0 });
            Some(format!("[columns] {}, with the file's name", lines(&|name| format!("{name} = \"{name} / {}\"", short(times)))))
        }
        Kind::Off(_) => {
            let by = usual(all, |kind| if let Kind::Off(by) = kind { *by } else { 0.0 });
            Some(format!("[columns] {}, with the file's name", lines(&|name| format!("{name} = \"{name} {}\"", plus(-by, 4)))))
        }
        // An angle leaps where it goes round, and so would its rate.
        Kind::Filtered(_) if columns.iter().all(|column| ["rates", "velocity"].contains(&stream_of(*column))) => {
            let time_s = usual(all, |kind| if let Kind::Filtered(time_s) = kind { *time_s } else { 0.0 });
            Some(format!(
                "[columns] {}, with the file's names",
                lines(&|name| format!("{name} = \"{name} + {time_s:.4} * rate({name})\""))
            ))
        }
        // What a filter took is noise by now; what the derivative is of has it still.
        Kind::Filtered(_) | Kind::Averaged(_) => {
            let stream = columns.first().map(|column| stream_of(*column))?;
            let names: Vec<&str> =
                Column::TARGETS.iter().filter(|column| stream_of(**column) == stream).map(|column| column.name()).collect();
            (!names.is_empty()).then(|| derived_anew(&names))
        }
        Kind::OffCentre(_) => {
            let arm = usual_arm(all);
            Some(format!("[columns] {}, with the file's names", [0, 1, 2].map(|axis| centred(arm, axis)).join(", ")))
        }
        Kind::Holds(part, _) => {
            let [x, y, z] = measured_at(all, columns, part)?;
            Some(format!(
                "[columns] vx = \"vx - (wy * {z:.3}) + (wz * {y:.3})\", vy = \"vy - (wz * {x:.3}) + (wx * {z:.3})\", vz = \"vz - (wx * {y:.3}) + (wy * \
                 {x:.3})\", with the file's names"
            ))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::attitude::cross;
    use crate::formula::{Formula, Value};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_arm_is_taken_off_as_mechanics_has_it(
            arm in prop::array::uniform3(-1.0..1.0_f64),
            rates in prop::array::uniform3(-5.0..5.0_f64),
            angular in prop::array::uniform3(-20.0..20.0_f64),
        ) {
            let arm = arm.map(|part| (1e3 * part).round() / 1e3);
            let (along, inwards) = (cross(angular, arm), cross(rates, cross(rates, arm)));
            let names = ["vx_dot", "vy_dot", "vz_dot", "wx", "wy", "wz", "wx_dot", "wy_dot", "wz_dot"];
            for axis in 0..3 {
                let line = centred(arm, axis);
                let text = line.split('"').nth(1).expect("a formula in quotes");
                let measured: Vector = std::array::from_fn(|of| along[of] + inwards[of]);
                let values: Vec<f64> = measured.into_iter().chain(rates).chain(angular).collect();
                let of = |name: &str| names.iter().position(|known| *known == name).map(|at| Value::from(&values[at..=at]));
                let left = Formula::parse(text)?.evaluate(1, 0.01, &of)?;
                prop_assert!(left[0].abs() < 1e-9, "{text}: {}", left[0]);
            }
        }
    }
}
