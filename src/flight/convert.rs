//! A log's columns in their own names, units, axes and frames, made canonical: SI, radians, NED/FRD, body velocity.
//!
//! Sample by sample and without memory: filters in time, cuts and derivatives are elsewhere. Angles that look like degrees
//! and quaternions that are none are refused here, where the file's line is still known.

use super::attitude::{cross, gravity_body, quaternion_to_euler, rotate_back, rotation_body_to_inertial};
use super::schema::{Frame, Schema, TargetKind};
use super::table::RawTable;
use super::{Axes, Column};
use crate::error::{Error, Result};
use crate::formula::{Formula, Value};
use crate::suggest::did_you_mean;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Columns of one log (or a part of it) in canonical form; `None` where the log has none.
pub(super) struct Columns {
    pub canonical: [Option<Vec<f64>>; Column::COUNT],
    /// Further columns, as recorded.
    pub extra: BTreeMap<String, Vec<f64>>,
    /// What is made of some of them, by formulas of the description.
    pub made: BTreeMap<String, BTreeSet<Column>>,
    /// The attitude came from a quaternion.
    pub quaternion: bool,
}

impl Columns {
    pub fn get(&self, column: Column) -> Option<&[f64]> {
        self.canonical[column as usize].as_deref()
    }

    fn triple(&self, first: Column) -> Option<[&[f64]; 3]> {
        let at = first as usize;
        Some([self.canonical[at].as_deref()?, self.canonical[at + 1].as_deref()?, self.canonical[at + 2].as_deref()?])
    }

    /// Replaces three neighbouring columns by a function of them, row by row; nothing if one of them is missing.
    fn map_triple(&mut self, first: Column, function: impl Fn(usize, [f64; 3]) -> [f64; 3]) {
        let Some([a, b, c]) = self.triple(first) else { return };
        let rows: Vec<[f64; 3]> = (0..a.len()).map(|row| function(row, [a[row], b[row], c[row]])).collect();
        for axis in 0..3 {
            self.canonical[first as usize + axis] = Some(rows.iter().map(|row| row[axis]).collect());
        }
    }
}

/// Refuses cells without a finite number in columns that no repair rule covers.
pub(super) fn check_finite(table: &RawTable, covered: &BTreeSet<&str>) -> Result<()> {
    for (name, values) in table.names.iter().zip(&table.columns).filter(|(name, _)| !covered.contains(name.as_str())) {
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let found = if values[row].is_nan() { "NaN or an empty cell".to_owned() } else { values[row].to_string() };
            let expected = "a finite number; dataset.toml can `ignore` the column or state a [[repair]] rule for it";
            return Err(table.cell(row, name, found, expected));
        }
    }
    Ok(())
}

/// One column by its canonical name, in SI units, with the name it has in the file; `None` if the log has none.
///
/// # Errors
/// What the description promises and the file does not hold: [`Error::Cell`] at the header, [`Error::Formula`].
pub(super) fn source(table: &RawTable, schema: &Schema, step_s: f64, name: &str) -> Result<Option<(Vec<f64>, String)>> {
    let factor = schema.factor(name);
    let scaled = |values: &[f64]| values.iter().map(|value| value * factor).collect::<Vec<f64>>();
    let Some(alternatives) = schema.columns.get(name) else {
        return Ok(table.column(name).map(|values| (scaled(values), name.to_owned())));
    };
    let mut first_error = None;
    for text in alternatives {
        if let Some(values) = table.column(text) {
            return Ok(Some((scaled(values), text.clone())));
        }
        let get = |name: &str| table.column(name).map(Value::from);
        let known: Vec<&str> = table.names.iter().map(String::as_str).collect();
        match Formula::parse(text).and_then(|formula| formula.check_names(&known).map(|()| formula)) {
            Ok(formula) => {
                let place = || format!("{}, `columns.{name}` of dataset.toml", table.path.display());
                let values = formula.evaluate(table.rows(), step_s, &get).map_err(|error| error.standing_in(&place()))?;
                return Ok(Some((scaled(&values), text.clone())));
            }
            Err(error) => first_error = first_error.or(Some((text, error))),
        }
    }
    if let Some(error) = first_error
        .as_ref()
        .and_then(|(text, error)| (matches!(error, Error::Formula { .. }) && text.contains(OPERATORS)).then(|| error.to_string()))
    {
        return Err(table.cell_of_header(name, error, "a formula of the file's columns, see `columns` in dataset.toml"));
    }
    let found =
        format!("no column {} in the header", alternatives.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" or "));
    let hint = alternatives.first().map_or(String::new(), |name| did_you_mean(name, unused(table)));
    Err(table.cell_of_header(name, found, format!("one as `columns` in dataset.toml says{hint}")))
}

const OPERATORS: [char; 9] = ['+', '*', '/', '^', '(', '<', '>', '-', '\''];

/// All columns of a table made canonical.
///
/// # Errors
/// [`Error::Cell`] for a missing column, a quaternion that is none, angles in degrees; [`Error::Config`] for an inertial velocity
/// without heading.
pub(super) fn convert(table: &RawTable, schema: &Schema, step_s: f64) -> Result<Columns> {
    let mut used: BTreeSet<String> = schema.columns.get("t").map_or(vec!["t".into()], Clone::clone).into_iter().collect();
    let mut columns = Columns { canonical: Default::default(), extra: BTreeMap::new(), made: BTreeMap::new(), quaternion: false };
    for column in Column::ALL {
        if let Some((values, name)) = source(table, schema, step_s, column.name())? {
            columns.canonical[column as usize] = Some(values);
            if table.column(&name).is_none()
                && let Ok(formula) = Formula::parse(&name)
            {
                formula.names().into_iter().for_each(|read| {
                    columns.made.entry(read.to_owned()).or_default().insert(column);
                });
            }
            used.insert(name);
        }
    }
    attitude_from_quaternion(table, schema, step_s, &mut columns, &mut used)?;
    check_present(table, schema, &columns)?;
    if !columns.quaternion {
        refuse_degrees(table, schema, &columns, step_s)?;
    }
    to_ned(schema, &mut columns);
    if schema.velocity == Frame::Inertial && columns.get(Column::Yaw).is_none() {
        return Err(Error::Config {
            place: table.path.display().to_string(),
            field: "velocity".into(),
            found: "inertial in a log without `yaw`".into(),
            expected: "a heading: name a column or formula for `yaw`; without one the velocity cannot be turned into body axes"
                .into(),
        });
    }
    to_body(schema, &mut columns);
    let canonical = |name: &str| super::units::column_names().any(|known| known == name);
    for (name, values) in table.names.iter().zip(&table.columns) {
        if !used.contains(name) && !canonical(name) {
            columns.extra.insert(name.clone(), values.clone());
        }
    }
    Ok(columns)
}

/// Fills roll, pitch, yaw from q1…q4 where the log has these in their place.
fn attitude_from_quaternion(
    table: &RawTable,
    schema: &Schema,
    step_s: f64,
    columns: &mut Columns,
    used: &mut BTreeSet<String>,
) -> Result<()> {
    let angles = [Column::Roll, Column::Pitch, Column::Yaw];
    if angles.iter().any(|&angle| columns.get(angle).is_some()) {
        return Ok(());
    }
    let mut parts = Vec::new();
    for name in ["q1", "q2", "q3", "q4"] {
        match source(table, schema, step_s, name)? {
            Some((values, name)) => {
                used.insert(name);
                parts.push(values);
            }
            None if parts.is_empty() => return Ok(()),
            None => {
                return Err(missing(table, name, "the quaternion q1 q2 q3 q4 whole, scalar last unless `quaternion = \"wxyz\"`"));
            }
        }
    }
    let [a, b, c, d] = parts.as_slice() else { return Ok(()) };
    let mut euler = [Vec::new(), Vec::new(), Vec::new()];
    for (row, (((&a, &b), &c), &d)) in a.iter().zip(b).zip(c).zip(d).enumerate() {
        let norm = (a * a + b * b + c * c + d * d).sqrt();
        if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
            let expected = format!("a unit quaternion q1 q2 q3 q4, norm 1 within {QUATERNION_TOLERANCE}");
            return Err(table.cell(row, "q1", format!("a quaternion of norm {norm:.6}"), expected));
        }
        for (values, angle) in euler.iter_mut().zip(quaternion_to_euler(schema.quaternion.scalar_last([a, b, c, d]))) {
            values.push(angle);
        }
    }
    for (column, values) in angles.into_iter().zip(euler) {
        columns.canonical[column as usize] = Some(values);
    }
    columns.quaternion = true;
    Ok(())
}

/// Printed with three decimals, a unit quaternion keeps its norm within 0.001.
const QUATERNION_TOLERANCE: f64 = 0.01;

fn missing(table: &RawTable, name: &str, expected: &str) -> Error {
    const SHOWN: usize = 5;
    let mut hint = did_you_mean(name, unused(table));
    let others: Vec<String> = unused(table).take(SHOWN).map(|name| format!("`{name}`")).collect();
    if hint.is_empty() && !others.is_empty() {
        hint = format!("; the header has {} besides", others.join(", "));
    }
    table.cell_of_header(name, "no such column in the header", format!("{expected}{hint}"))
}

/// Names of the header that no canonical column has: one of them may be what is missing.
fn unused(table: &RawTable) -> impl Iterator<Item = &str> {
    table.names.iter().map(String::as_str).filter(|name| Column::from_name(name).is_none() && *name != "t")
}

/// Refuses a log without a column that it must have.
fn check_present(table: &RawTable, schema: &Schema, columns: &Columns) -> Result<()> {
    let absent = |column: &Column| columns.get(*column).is_none();
    let no_targets = Column::TARGETS.iter().all(absent);
    let stated = |column: &Column| schema.missing.contains(column);
    for group in Column::TARGETS.chunks(3) {
        if group.iter().any(absent) && !group.iter().all(absent) {
            let name = group.iter().find(|column| absent(column)).map_or("", |column| column.name());
            return Err(missing(table, name, "either all three accelerations of a kind or none"));
        }
    }
    let required = |column: &&Column| absent(column) && !stated(column) && !(no_targets && Column::TARGETS.contains(column));
    let lacking: Vec<&Column> = Column::ALL.iter().filter(required).collect();
    let Some(first) = lacking.first() else { return Ok(()) };
    let others: Vec<String> = lacking[1..].iter().map(|column| format!("`{}`", column.name())).collect();
    let mut expected = match first {
        Column::Roll | Column::Pitch => "`roll pitch yaw`, or `q1 q2 q3 q4` in their place".to_owned(),
        Column::X | Column::Y | Column::Z | Column::Yaw => "it, or its name in `missing` of dataset.toml".to_owned(),
        column if Column::TARGETS.contains(column) => {
            "all six accelerations, or none (they are then derived), or `missing` in dataset.toml".to_owned()
        }
        _ => "it, or under `columns` in dataset.toml what gives it".to_owned(),
    };
    if !others.is_empty() {
        expected = format!("{expected}; also missing: {}", others.join(", "));
    }
    Err(missing(table, first.name(), &expected))
}

/// Largest angles that are taken as rad. Roll: one whole turn, should it be counted from 0 to 2π. Pitch: a right angle, and by how much a sensor may be off
/// level, which `check` names.
const ANGLE_LIMITS: [(Column, f64); 2] = [(Column::Pitch, FRAC_PI_2 + 0.3), (Column::Roll, TAU)];
/// Allowance for rounded angles, rad.
const ANGLE_ROUNDING_RAD: f64 = 0.01;

/// Angles in degrees are found by their size, or by how much faster they change than the body rates say.
fn refuse_degrees(table: &RawTable, schema: &Schema, columns: &Columns, step_s: f64) -> Result<()> {
    const EXPECTED: &str = "radians; if the log is in degrees, say [units] angles = \"deg\" in dataset.toml";
    let file_name = |column: Column| {
        schema.columns.get(column.name()).and_then(|names| names.first()).map_or(column.name(), String::as_str).to_owned()
    };
    for (column, limit) in ANGLE_LIMITS {
        let values = columns.get(column).unwrap_or_default();
        if let Some(row) = values.iter().position(|angle| angle.abs() > limit + ANGLE_ROUNDING_RAD) {
            let found = format!("{}, which looks like degrees", values[row]);
            return Err(table.cell(row, &file_name(column), found, EXPECTED));
        }
    }
    // A piece may be too short, or too steep, to tell how fast; where it is cut is known of a log that was read whole.
    if !schema.cut_at_s.is_empty() {
        return Ok(());
    }
    for (angle, rate) in [(Column::Roll, Column::Wx), (Column::Pitch, Column::Wy)] {
        let (Some(angles), Some(rates)) = (columns.get(angle), columns.get(rate)) else { continue };
        // Regression of the angle's increments on the rate's and their correlation, at small tilt, where both agree.
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (pair, rates) in angles.windows(2).zip(rates.windows(2)) {
            let (x, y) = (0.5 * step_s * (rates[0] + rates[1]), pair[1] - pair[0]);
            if y.abs() < PI {
                (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
            }
        }
        let slope = xy.abs() / xx;
        let in_degrees = 180.0 / PI;
        // Half to twice the factor, with the two moving as one.
        if slope > 0.5 * in_degrees && slope < 2.0 * in_degrees && xy * xy > 0.8 * xx * yy {
            let largest = (0..angles.len()).max_by(|&a, &b| angles[a].abs().total_cmp(&angles[b].abs())).unwrap_or(0);
            let found = format!(
                "{}, and changes {slope:.0} times as fast as {} says, so it looks like degrees",
                angles[largest],
                rate.name()
            );
            return Err(table.cell(largest, &file_name(angle), found, EXPECTED));
        }
    }
    Ok(())
}

/// Position, attitude, rates and body vectors to NED and FRD. Velocity and accelerations in the file's frame.
fn to_ned(schema: &Schema, columns: &mut Columns) {
    let axes = schema.axes;
    if axes == Axes::NedFrd {
        return;
    }
    // A lone position column turns alone; what is missing stays missing under its new name.
    let north_east_down = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|unit| axes.inertial_to_ned(unit));
    let position: [Option<Vec<f64>>; 3] = std::array::from_fn(|axis| columns.canonical[Column::X as usize + axis].take());
    for (values, image) in position.into_iter().zip(north_east_down) {
        let (Some(values), Some(axis)) = (values, image.iter().position(|part| *part != 0.0)) else { continue };
        columns.canonical[Column::X as usize + axis] = Some(values.into_iter().map(|value| value * image[axis]).collect());
    }
    let no_yaw = columns.get(Column::Yaw).is_none();
    if no_yaw && let Some(roll) = columns.get(Column::Roll) {
        columns.canonical[Column::Yaw as usize] = Some(vec![0.0; roll.len()]);
    }
    let wrapped = columns.get(Column::Yaw).unwrap_or_default().iter().all(|yaw| yaw.abs() <= PI + ANGLE_ROUNDING_RAD);
    columns.map_triple(Column::Roll, |_, angles| {
        let [roll, pitch, yaw] = axes.euler_to_ned(angles);
        [roll, pitch, if wrapped { wrap(yaw) } else { yaw }]
    });
    if no_yaw {
        columns.canonical[Column::Yaw as usize] = None;
    }
    columns.map_triple(Column::Wx, |_, rates| axes.body_to_frd(rates));
    columns.map_triple(Column::WxDot, |_, rates| axes.body_to_frd(rates));
    let of_frame = |inertial: bool, v| if inertial { axes.inertial_to_ned(v) } else { axes.body_to_frd(v) };
    columns.map_triple(Column::Vx, |_, v| of_frame(schema.velocity == Frame::Inertial, v));
    columns.map_triple(Column::VxDot, |_, v| of_frame(schema.targets == TargetKind::Inertial, v));
}

fn wrap(angle: f64) -> f64 {
    if angle.abs() <= PI { angle } else { angle - TAU * (angle / TAU).round() }
}

/// Velocity to body components, then accelerations to the derivative of these: v̇ = f + R_in^b g − ω × v.
fn to_body(schema: &Schema, columns: &mut Columns) {
    let Some([roll, pitch]) = columns.get(Column::Roll).zip(columns.get(Column::Pitch)).map(|(a, b)| [a.to_vec(), b.to_vec()])
    else {
        return;
    };
    let yaw = columns.get(Column::Yaw).map_or_else(|| vec![0.0; roll.len()], <[f64]>::to_vec);
    let to_body = |row: usize, v| rotate_back(&rotation_body_to_inertial(roll[row], pitch[row], yaw[row]), v);
    if schema.velocity == Frame::Inertial {
        columns.map_triple(Column::Vx, to_body);
    }
    if schema.targets == TargetKind::Derivative {
        return;
    }
    let (Some(v), Some(w)) = (columns.triple(Column::Vx), columns.triple(Column::Wx)) else { return };
    let transport: Vec<[f64; 3]> =
        (0..roll.len()).map(|row| cross([w[0][row], w[1][row], w[2][row]], [v[0][row], v[1][row], v[2][row]])).collect();
    columns.map_triple(Column::VxDot, |row, a| {
        let acceleration = match schema.targets {
            TargetKind::Inertial => to_body(row, a),
            TargetKind::SpecificForce => add(a, gravity_body(roll[row], pitch[row])),
            TargetKind::BodyAcceleration | TargetKind::Derivative => a,
        };
        std::array::from_fn(|axis| acceleration[axis] - transport[row][axis])
    });
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}
