//! What a log in the Stanford layout does not state, decided from its own consistency.
//!
//! Each question has a list of answers; each answer predicts one recorded signal from others, and its error is the root mean square
//! of the difference relative to that of the signal (for the Euler angles: the angle between the two attitudes in rad). The
//! smallest error wins; of answers that fit equally well (as in a flight that only yaws) the first does. If none fits,
//! the file is refused with all errors.
//!
//! | question | signal | predicted from |
//! | --- | --- | --- |
//! | direction of the quaternion, axes of ω | ω | differences of the quaternion |
//! | Euler angles | the attitude | `euler_*` in rad or degrees |
//! | axes of velocity | mean velocity over a second | change of position |
//! | axes of v̇, gravity in it | derivative of velocity | `vdot_*` |
//! | axes of ω̇ | derivative of ω | `wdot_*` |

use super::GRAVITY_M_S2;
use super::attitude::{Matrix3, cross, quaternion_to_rotation, rotate, rotate_back, rotation_body_to_inertial};
use super::differentiate::{DEFAULT_CUTOFF_HZ, Differentiator, HIGHEST_CUTOFF};
use super::table::RawTable;
use crate::error::Result;

/// Largest relative error of an answer that fits: half of the signal's rms. Smoothed derivatives of a right answer leave 0.1 to 0.3, a
/// wrong one gives about 1 and more.
const FITS: f64 = 0.5;
/// Errors within this factor of the smallest are equally good.
const TIE: f64 = 1.1;
/// Time over which position and velocity are compared, s: long enough that the noise of a position is small against the way gone,
/// in a hover too.
const POSITION_S: f64 = 1.0;
/// Largest rms angle between quaternion and Euler angles, rad.
const EULER_FITS_RAD: f64 = 0.1;

/// What `vdot_*` holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Acceleration {
    Inertial,
    InertialForce,
    Body,
    BodyForce,
    BodyComponents,
}

const ACCELERATIONS: [(&str, Acceleration); 5] = [
    ("v' is the derivative of velocity in NED", Acceleration::Inertial),
    ("v' is that without gravity, in NED", Acceleration::InertialForce),
    ("v' is the derivative of velocity in body axes", Acceleration::Body),
    ("v' is that without gravity, in body axes", Acceleration::BodyForce),
    ("v' is the derivative of the body components", Acceleration::BodyComponents),
];

/// The answers.
#[derive(Clone, Debug)]
pub(super) struct Decided {
    inverse: bool,
    rates_in_ned: bool,
    velocity_in_body: bool,
    acceleration: Acceleration,
    angular_in_ned: bool,
    /// The answers with their errors, for the notes.
    pub sentence: String,
}

impl Decided {
    /// R_b^in of the recorded quaternion.
    pub fn rotation(&self, quaternion: [f64; 4]) -> Matrix3 {
        rotation(quaternion, self.inverse)
    }

    /// ω in body axes.
    pub fn rates(&self, matrix: &Matrix3, w: [f64; 3]) -> [f64; 3] {
        if self.rates_in_ned { rotate_back(matrix, w) } else { w }
    }

    /// Inertial velocity in NED.
    pub fn velocity(&self, matrix: &Matrix3, v: [f64; 3]) -> [f64; 3] {
        if self.velocity_in_body { rotate(matrix, v) } else { v }
    }

    /// Derivative of the inertial velocity in NED from `vdot_*`, with ω and v in body axes.
    pub fn acceleration(&self, matrix: &Matrix3, v_dot: [f64; 3], w: [f64; 3], v: [f64; 3]) -> [f64; 3] {
        acceleration(self.acceleration, matrix, v_dot, w, v)
    }

    /// ω̇ in body axes.
    pub fn angular_acceleration(&self, matrix: &Matrix3, w_dot: [f64; 3]) -> [f64; 3] {
        // d/dt of the NED components of ω is R ω̇: ω does not turn in its own field.
        if self.angular_in_ned { rotate_back(matrix, w_dot) } else { w_dot }
    }
}

fn rotation(quaternion: [f64; 4], inverse: bool) -> Matrix3 {
    let [x, y, z, w] = quaternion;
    quaternion_to_rotation(if inverse { [-x, -y, -z, w] } else { quaternion })
}

fn acceleration(kind: Acceleration, matrix: &Matrix3, v_dot: [f64; 3], w: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    let [north, east, down] = match kind {
        Acceleration::Inertial | Acceleration::InertialForce => v_dot,
        Acceleration::Body | Acceleration::BodyForce => rotate(matrix, v_dot),
        Acceleration::BodyComponents => {
            let transport = cross(w, v);
            rotate(matrix, std::array::from_fn(|axis| v_dot[axis] + transport[axis]))
        }
    };
    let without_gravity = matches!(kind, Acceleration::InertialForce | Acceleration::BodyForce);
    [north, east, if without_gravity { down + GRAVITY_M_S2 } else { down }]
}

/// A stretch of `smoother.txt` in flight.
pub(super) struct Smoother<'a> {
    table: &'a RawTable,
    step_s: f64,
}

impl<'a> Smoother<'a> {
    pub fn new(table: &'a RawTable, step_s: f64) -> Self {
        Self { table, step_s }
    }

    fn rows(&self, names: [&str; 3]) -> Vec<[f64; 3]> {
        let columns = names.map(|name| self.table.column(name).unwrap_or_default());
        (0..self.table.rows()).map(|row| columns.map(|values| values[row])).collect()
    }

    fn rotations(&self, inverse: bool) -> Vec<Matrix3> {
        let columns = ["q_x", "q_y", "q_z", "q_w"].map(|name| self.table.column(name).unwrap_or_default());
        (0..self.table.rows()).map(|row| rotation(columns.map(|values| values[row]), inverse)).collect()
    }

    fn derivative(&self, rows: &[[f64; 3]]) -> Result<Vec<[f64; 3]>> {
        let differentiator = Differentiator::new(self.step_s, DEFAULT_CUTOFF_HZ.min(HIGHEST_CUTOFF / self.step_s))?;
        let mut derivative = vec![[0.0; 3]; rows.len()];
        for axis in 0..3 {
            let values: Vec<f64> = rows.iter().map(|row| row[axis]).collect();
            derivative.iter_mut().zip(differentiator.derivative(&values)?).for_each(|(row, value)| row[axis] = value);
        }
        Ok(derivative)
    }
}

/// Decides the questions in the order of the table above, each with the answers before it.
///
/// # Errors
/// [`crate::Error::Log`] with every answer's error, if none fits.
pub(super) fn decide(smoother: &Smoother) -> Result<Decided> {
    let refuse_norm = smoother.table.rows();
    for row in 0..refuse_norm {
        let norm = ["q_x", "q_y", "q_z", "q_w"].map(|name| smoother.table.column(name).unwrap_or_default()[row].powi(2));
        let norm = norm.iter().sum::<f64>().sqrt();
        if (norm - 1.0).abs() > 0.01 {
            let found = format!("a quaternion of norm {norm:.6}");
            return Err(smoother.table.cell(row, "q_x", found, "a unit quaternion, norm 1 within 0.01"));
        }
    }
    let recorded_w = smoother.rows(["w_n", "w_e", "w_d"]);
    let mut answers = Vec::new();
    for (name, inverse, in_ned) in [
        ("the quaternion turns body to NED, w in body axes", false, false),
        ("the quaternion turns body to NED, w in NED", false, true),
        ("the quaternion turns NED to body, w in body axes", true, false),
        ("the quaternion turns NED to body, w in NED", true, true),
    ] {
        let rotations = smoother.rotations(inverse);
        let body: Vec<[f64; 3]> =
            recorded_w.iter().zip(&rotations).map(|(&w, matrix)| if in_ned { rotate_back(matrix, w) } else { w }).collect();
        answers.push((name, turning_error(&rotations, &body, smoother.step_s), (inverse, in_ned)));
    }
    let mut sentence = String::new();
    let (inverse, rates_in_ned) = choose(smoother.table, answers, FITS, &mut sentence)?;
    let matrices = smoother.rotations(inverse);
    let w: Vec<[f64; 3]> =
        matrices.iter().zip(&recorded_w).map(|(matrix, &w)| if rates_in_ned { rotate_back(matrix, w) } else { w }).collect();

    let euler = smoother.rows(["euler_roll", "euler_pitch", "euler_yaw"]);
    let angle = |scale: f64, transposed: bool| {
        let of = |(matrix, euler): (&Matrix3, &[f64; 3])| {
            let [roll, pitch, yaw] = euler.map(|angle| angle * scale);
            let other = rotation_body_to_inertial(roll, pitch, yaw);
            let trace: f64 = (0..3)
                .map(|a| (0..3).map(|b| matrix[a][b] * if transposed { other[b][a] } else { other[a][b] }).sum::<f64>())
                .sum();
            ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().powi(2)
        };
        (matrices.iter().zip(&euler).map(of).sum::<f64>() / matrices.len() as f64).sqrt()
    };
    let degree = std::f64::consts::PI / 180.0;
    let answers = vec![
        ("Euler angles of body to NED in rad", angle(1.0, false), ()),
        ("Euler angles of body to NED in degrees", angle(degree, false), ()),
        ("Euler angles of NED to body in rad", angle(1.0, true), ()),
    ];
    choose(smoother.table, answers, EULER_FITS_RAD, &mut sentence)?;

    let recorded_v = smoother.rows(["vel_n", "vel_e", "vel_d"]);
    let moving = mean_rates(&smoother.rows(["pos_n", "pos_e", "pos_d"]), smoother.step_s);
    let turned: Vec<[f64; 3]> = matrices.iter().zip(&recorded_v).map(|(matrix, &v)| rotate(matrix, v)).collect();
    let answers = vec![
        ("velocity in NED", relative_error(&moving, &means(&recorded_v, smoother.step_s)), false),
        ("velocity in body axes", relative_error(&moving, &means(&turned, smoother.step_s)), true),
    ];
    let velocity_in_body = choose(smoother.table, answers, FITS, &mut sentence)?;
    let v_inertial = if velocity_in_body { turned } else { recorded_v };

    let (v_dot, changing) = (smoother.rows(["vdot_n", "vdot_e", "vdot_d"]), smoother.derivative(&v_inertial)?);
    let answers = ACCELERATIONS.iter().map(|&(name, kind)| {
        let rows = matrices.iter().zip(&v_dot).zip(w.iter().zip(&v_inertial));
        let predicted: Vec<[f64; 3]> =
            rows.map(|((matrix, &v_dot), (&w, &v))| acceleration(kind, matrix, v_dot, w, rotate_back(matrix, v))).collect();
        (name, relative_error(&predicted, &changing), kind)
    });
    let acceleration = choose(smoother.table, answers.collect(), FITS, &mut sentence)?;

    let (w_dot, turning) = (smoother.rows(["wdot_n", "wdot_e", "wdot_d"]), smoother.derivative(&w)?);
    let turned: Vec<[f64; 3]> = matrices.iter().zip(&w_dot).map(|(matrix, &w)| rotate_back(matrix, w)).collect();
    let answers =
        vec![("w' in body axes", relative_error(&w_dot, &turning), false), ("w' in NED", relative_error(&turned, &turning), true)];
    let angular_in_ned = choose(smoother.table, answers, FITS, &mut sentence)?;
    Ok(Decided { inverse, rates_in_ned, velocity_in_body, acceleration, angular_in_ned, sentence })
}

fn choose<T: Copy>(table: &RawTable, answers: Vec<(&str, f64, T)>, fits: f64, sentence: &mut String) -> Result<T> {
    let smallest = answers.iter().map(|answer| answer.1).fold(f64::INFINITY, f64::min);
    match answers.iter().find(|answer| answer.1 <= fits && answer.1 <= smallest * TIE + f64::EPSILON) {
        Some(&(name, _, answer)) => {
            if !sentence.is_empty() {
                sentence.push_str(", ");
            }
            sentence.push_str(name);
            Ok(answer)
        }
        None => {
            let errors: Vec<String> = answers.iter().map(|(name, error, _)| format!("{name}: {error:.3}")).collect();
            let found = format!("a log that fits none of the hypotheses (relative errors: {})", errors.join("; "));
            Err(table.fault(found, format!("one of them with an error of at most {fits}; the columns may be in another order")))
        }
    }
}

/// Difference of the body rates that successive attitudes imply from ω between them.
fn turning_error(rotations: &[Matrix3], w: &[[f64; 3]], step_s: f64) -> f64 {
    let pairs = rotations.windows(2).zip(w.windows(2));
    let (implied, between): (Vec<_>, Vec<_>) = pairs
        .map(|(matrices, w)| {
            let relative = |row: usize, column: usize| (0..3).map(|k| matrices[0][k][row] * matrices[1][k][column]).sum::<f64>();
            let twice = [relative(2, 1) - relative(1, 2), relative(0, 2) - relative(2, 0), relative(1, 0) - relative(0, 1)];
            let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (w[0][axis] + w[1][axis]));
            (twice.map(|part| part / (2.0 * step_s)), middle)
        })
        .unzip();
    relative_error(&implied, &between)
}

/// Samples in [`POSITION_S`], at most what there is.
fn span(samples: usize, step_s: f64) -> usize {
    ((POSITION_S / step_s).round() as usize).clamp(1, samples.saturating_sub(1).max(1))
}

/// Change of a position over [`POSITION_S`] from each sample on, per second.
fn mean_rates(rows: &[[f64; 3]], step_s: f64) -> Vec<[f64; 3]> {
    let count = span(rows.len(), step_s);
    let pairs = rows.iter().zip(rows.iter().skip(count));
    pairs.map(|(from, to)| std::array::from_fn(|axis| (to[axis] - from[axis]) / (count as f64 * step_s))).collect()
}

/// Mean of a velocity over the same spans, by the trapezoidal rule.
fn means(rows: &[[f64; 3]], step_s: f64) -> Vec<[f64; 3]> {
    let count = span(rows.len(), step_s);
    let of = |rows: &[[f64; 3]]| {
        let (first, last) = (rows[0], rows[count]);
        std::array::from_fn(|axis| {
            let inner: f64 = rows[1..count].iter().map(|row| row[axis]).sum();
            (inner + 0.5 * (first[axis] + last[axis])) / count as f64
        })
    };
    rows.windows(count + 1).map(of).collect()
}

/// rms |a − b| / rms |b|.
fn relative_error(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let square = |row: [f64; 3]| row.iter().map(|part| part * part).sum::<f64>();
    let difference: f64 = a.iter().zip(b).map(|(a, b)| square(std::array::from_fn(|axis| a[axis] - b[axis]))).sum();
    let size: f64 = b.iter().map(|&row| square(row)).sum();
    if size > 0.0 { (difference / size).sqrt() } else { f64::INFINITY }
}

/// A scale of the four controls: its name and the map to about [-1, 1].
pub(super) type ControlScale = (&'static str, fn(f64) -> f64);

/// The first scale whose range holds all four controls.
///
/// # Errors
/// [`crate::Error::Log`] if none does.
pub(super) fn control_scale(controls: &RawTable) -> Result<ControlScale> {
    const SCALES: [(f64, f64, ControlScale); 3] = [
        (-1.5, 1.5, ("normalised to [-1, 1]", |u| u)),
        (-150.0, 150.0, ("percent", |u| u / 100.0)),
        (700.0, 2300.0, ("servo pulses in us", |u| (u - 1500.0) / 500.0)),
    ];
    let values = || {
        let columns = ["aileron", "elevator", "rudder", "collective"].map(|name| controls.column(name).unwrap_or_default());
        columns.into_iter().flatten().copied()
    };
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(u), high.max(u)));
    let fitting = SCALES.into_iter().find(|&(least, most, _)| low >= least && high <= most).map(|scale| scale.2);
    fitting.ok_or_else(|| {
        let expected = "controls normalised to about [-1, 1], in percent, or as servo pulses of 700 to 2300 us";
        controls.fault(format!("controls from {low} to {high}"), expected)
    })
}
