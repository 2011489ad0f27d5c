//! A made-up but kinematically exact flight, as a sheet of columns that tests can bend and write. Shared by the flight tests.
#![allow(dead_code, reason = "each test program uses its part")]

use phyture::flight::attitude::{Matrix3, rotate_back, rotation_body_to_inertial};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Column, DataSet, Flight};
use std::fmt::Write;
use std::path::Path;

pub type Outcome = Result<(), Box<dyn std::error::Error>>;

pub const STEP_S: f64 = 0.01;

/// Position in NED, m: a climbing, drifting wave.
fn position(t: f64) -> [f64; 3] {
    [8.0 * (0.5 * t).sin() + t, 5.0 * (0.7 * t).cos(), -10.0 - 2.0 * (0.9 * t).sin()]
}

/// Roll, pitch, yaw, rad.
fn angles(t: f64) -> [f64; 3] {
    [0.5 * (1.3 * t).sin(), 0.3 * (0.8 * t).cos(), 0.4 * t.sin() + 0.3]
}

fn matrix(t: f64) -> Matrix3 {
    let [roll, pitch, yaw] = angles(t);
    rotation_body_to_inertial(roll, pitch, yaw)
}

/// Central difference of order four: with h = 1e-3 exact to some 1e-11 for these waves.
fn slope(function: &dyn Fn(f64) -> [f64; 3], t: f64) -> [f64; 3] {
    let h = 1e-3;
    let at = [function(t - 2.0 * h), function(t - h), function(t + h), function(t + 2.0 * h)];
    std::array::from_fn(|axis| (at[0][axis] - 8.0 * at[1][axis] + 8.0 * at[2][axis] - at[3][axis]) / (12.0 * h))
}

fn velocity(t: f64) -> [f64; 3] {
    rotate_back(&matrix(t), slope(&position, t))
}

/// Body rates, from R' = R [ω]×.
fn rates(t: f64) -> [f64; 3] {
    let now = matrix(t);
    let column = |index: usize| slope(&|t| matrix(t).map(|row| row[index]), t);
    let turned = [column(0), column(1), column(2)].map(|change| rotate_back(&now, change));
    [turned[1][2], turned[2][0], turned[0][1]]
}

/// The velocity's derivative in NED.
pub fn inertial_acceleration(t: f64) -> [f64; 3] {
    slope(&|t| slope(&position, t), t)
}

/// Columns by name.
#[derive(Clone, Debug)]
pub struct Sheet {
    pub names: Vec<String>,
    pub columns: Vec<Vec<f64>>,
}

impl Sheet {
    /// The canonical flight of so many samples.
    pub fn canonical(samples: usize) -> Self {
        let mut names = vec!["t".to_owned()];
        names.extend(Column::ALL.map(|column| column.name().to_owned()));
        let mut columns = vec![Vec::new(); names.len()];
        for sample in 0..samples {
            let t = STEP_S * sample as f64;
            let u = [0.1 * (2.0 * t).sin(), 0.2 * (1.5 * t).cos(), 0.05 * t.cos(), 0.45 + 0.1 * (0.9 * t).sin()];
            let row = position(t).into_iter().chain(angles(t)).chain(velocity(t)).chain(rates(t)).chain(u);
            let row = std::iter::once(t).chain(row).chain(slope(&velocity, t)).chain(slope(&rates, t));
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        }
        Self { names, columns }
    }

    pub fn get(&self, name: &str) -> &[f64] {
        let index = self.names.iter().position(|known| known == name);
        index.map(|index| self.columns[index].as_slice()).unwrap_or_default()
    }

    /// Replaces a column, or adds it.
    pub fn with(mut self, name: &str, values: Vec<f64>) -> Self {
        match self.names.iter().position(|known| known == name) {
            Some(index) => self.columns[index] = values,
            None => {
                self.names.push(name.into());
                self.columns.push(values);
            }
        }
        self
    }

    pub fn map(self, name: &str, function: impl Fn(f64) -> f64) -> Self {
        let values = self.get(name).iter().map(|&value| function(value)).collect();
        self.with(name, values)
    }

    pub fn without(mut self, name: &str) -> Self {
        if let Some(index) = self.names.iter().position(|known| known == name) {
            self.names.remove(index);
            self.columns.remove(index);
        }
        self
    }

    pub fn without_all(self, names: &[&str]) -> Self {
        names.iter().fold(self, |sheet, name| sheet.without(name))
    }

    pub fn rename(mut self, from: &str, to: &str) -> Self {
        self.names.iter_mut().filter(|name| *name == from).for_each(|name| *name = to.into());
        self
    }

    /// Replaces three columns by a function of them and the row.
    pub fn map_triple(self, names: [&str; 3], function: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Self {
        let old = names.map(|name| self.get(name).to_vec());
        let rows: Vec<[f64; 3]> = (0..old[0].len()).map(|row| function(row, [old[0][row], old[1][row], old[2][row]])).collect();
        (0..3).fold(self, |sheet, axis| sheet.with(names[axis], rows.iter().map(|row| row[axis]).collect()))
    }

    /// One row's cell changed.
    pub fn cell(mut self, name: &str, row: usize, value: f64) -> Self {
        if let Some(index) = self.names.iter().position(|known| known == name) {
            self.columns[index][row] = value;
        }
        self
    }

    pub fn keep_rows(mut self, keep: impl Fn(usize) -> bool) -> Self {
        for values in &mut self.columns {
            *values = (0..values.len()).filter(|&row| keep(row)).map(|row| values[row]).collect();
        }
        self
    }

    pub fn csv(&self) -> String {
        let mut text = self.names.join(",") + "\n";
        for row in 0..self.columns[0].len() {
            let cells: Vec<String> = self.columns.iter().map(|values| format!("{:?}", values[row])).collect();
            let _ = writeln!(text, "{}", cells.join(","));
        }
        text
    }
}

/// A data set of one flight, `hover/a.csv`, with a description if there is one.
pub fn read_one(csv: &str, description: &str) -> phyture::Result<DataSet> {
    read_with(csv, description, &ReadOptions::default())
}

pub fn read_with(csv: &str, description: &str, options: &ReadOptions) -> phyture::Result<DataSet> {
    let folder = tempfile::tempdir().map_err(phyture::Error::io("temporary folder"))?;
    put(folder.path(), "hover/a.csv", csv)?;
    if !description.is_empty() {
        put(folder.path(), "dataset.toml", description)?;
    }
    data_set(folder.path(), options)
}

pub fn put(folder: &Path, name: &str, content: &str) -> phyture::Result<()> {
    let path = folder.join(name);
    if let Some(above) = path.parent() {
        std::fs::create_dir_all(above).map_err(phyture::Error::io(above))?;
    }
    std::fs::write(&path, content).map_err(phyture::Error::io(&path))
}

/// The only flight of a data set.
pub fn only(data: &DataSet) -> &Flight {
    assert_eq!(data.flights.len(), 1, "{:?}", data.notes);
    &data.flights[0]
}

/// Largest difference of a column from a reference, relative to the reference's largest value, at least one.
pub fn difference(found: &[f64], reference: &[f64]) -> f64 {
    assert_eq!(found.len(), reference.len());
    let size = reference.iter().fold(1.0_f64, |size, value| size.max(value.abs()));
    found.iter().zip(reference).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size
}

/// Every canonical column equal to the sheet's within a relative tolerance.
pub fn assert_same(flight: &Flight, sheet: &Sheet, tolerance: f64) {
    for column in Column::ALL {
        let difference = difference(flight.column(column), sheet.get(column.name()));
        assert!(difference <= tolerance, "{} differs by {difference:e}", column.name());
    }
}

/// The message of a refusal.
pub fn refusal<T>(result: phyture::Result<T>) -> String {
    result.err().map_or_else(|| "accepted".to_owned(), |error| error.to_string())
}

/// Every part must be in the message.
pub fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{message:?} should say {part:?}");
    }
}
