//! What the flights contain: how far each state and control moves, for how long, and whether the columns of the baseline can be
//! told apart. A coefficient can be no better than this.

use super::finding::{Finding, Severity, Subject};
use super::flights::of_all;
use crate::blocks::BLOCK_S;
use crate::flight::{Column, Flight};
use nalgebra::{Cholesky, DMatrix, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// Columns of the table: what the baseline is made of.
#[rustfmt::skip]
const SHOWN: [Column; 12] = [
    Column::Roll, Column::Pitch, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz,
    Column::U1, Column::U2, Column::U3, Column::U4,
];

/// Blocks of this many carry enough to be more than one lucky manoeuvre.
const FEW_CARRYING_BLOCKS: usize = 5;
/// Share of the movement that the carrying blocks hold.
const CARRIED_SHARE: f64 = 0.8;
/// Belsley, Kuh & Welsch (1980): 30 and above is strong collinearity.
const LARGE_CONDITION_NUMBER: f64 = 30.0;
/// Marquardt (1970): above 10 a coefficient is poorly determined.
const LARGE_INFLATION: f64 = 10.0;

/// Movement of one column over all flights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Excitation {
    /// Column.
    pub column: String,
    /// Its unit.
    pub unit: String,
    /// Least value.
    pub minimum: f64,
    /// Largest value.
    pub maximum: f64,
    /// Mean.
    pub mean: f64,
    /// Root of the mean square about the mean.
    pub deviation: f64,
    /// Time spent more than one deviation away from the mean, s.
    pub dwell_s: f64,
    /// Blocks of 10 s, the strongest first, that together hold 80 % of the square movement.
    pub carrying_blocks: usize,
}

/// Collinearity of the baseline's columns in one channel (paper eqs. 14–15).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Collinearity {
    /// Channel.
    pub channel: String,
    /// Largest over smallest singular value of the columns scaled to unit length, the constant included (Belsley, Kuh & Welsch 1980).
    pub condition_number: f64,
    /// 1/(1 − R²) of each column regressed on the others (Marquardt 1970).
    pub variance_inflation: Vec<(String, f64)>,
}

/// The table of movements.
pub(super) fn movements(flights: &[Flight]) -> Vec<Excitation> {
    SHOWN
        .into_iter()
        .filter(|column| flights.iter().all(|flight| !flight.absent.contains(column)))
        .map(|column| movement(flights, column))
        .collect()
}

fn movement(flights: &[Flight], column: Column) -> Excitation {
    let values = || of_all(flights, column);
    let duration_s: f64 = flights.iter().map(Flight::duration_s).sum();
    let mean = values().map(|(value, step_s)| value * step_s).sum::<f64>() / duration_s;
    let square: f64 = values().map(|(value, step_s)| (value - mean).powi(2) * step_s).sum();
    let deviation = (square / duration_s).sqrt();
    let blocks = flights.iter().flat_map(|flight| {
        let samples = (BLOCK_S / flight.step_s).round().max(1.0) as usize;
        let square = |block: &[f64]| block.iter().map(|value| (value - mean).powi(2)).sum::<f64>() * flight.step_s;
        let squares: Vec<f64> = flight.column(column).chunks(samples).map(square).collect();
        flight.rest();
        squares
    });
    let mut blocks: Vec<f64> = blocks.collect();
    blocks.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut carried = 0.0;
    let carrying_blocks = blocks.iter().take_while(|block| {
        let open = carried < CARRIED_SHARE * square;
        carried += **block;
        open
    });
    Excitation {
        column: column.name().into(),
        unit: column.unit().into(),
        minimum: values().map(|(value, _)| value).fold(f64::INFINITY, f64::min),
        maximum: values().map(|(value, _)| value).fold(f64::NEG_INFINITY, f64::max),
        mean,
        deviation,
        dwell_s: values().filter(|(value, _)| (value - mean).abs() > deviation).map(|(_, step_s)| step_s).sum(),
        carrying_blocks: carrying_blocks.count(),
    }
}

/// The baseline's columns besides the constant, by channel; v̇x and v̇y have one column each.
const CHANNELS: [(&str, [Column; 2]); 4] = [
    ("vz_dot", [Column::Vz, Column::U4]),
    ("wx_dot", [Column::Wx, Column::U1]),
    ("wy_dot", [Column::Wy, Column::U2]),
    ("wz_dot", [Column::Wz, Column::U3]),
];

/// The table of collinearity. A channel with a column that stands still has an infinite condition number and no inflation.
pub(super) fn collinearity(flights: &[Flight]) -> Vec<Collinearity> {
    CHANNELS.into_iter().map(|(channel, columns)| channel_collinearity(flights, channel, columns)).collect()
}

fn channel_collinearity(flights: &[Flight], channel: &str, columns: [Column; 2]) -> Collinearity {
    let mut gram = DMatrix::<f64>::zeros(3, 3);
    for flight in flights {
        for (first, second) in flight.column(columns[0]).iter().zip(flight.column(columns[1])) {
            let row = [*first, *second, 1.0];
            row.iter().enumerate().for_each(|(i, left)| row.iter().enumerate().for_each(|(j, right)| gram[(i, j)] += left * right));
        }
        flight.rest();
    }
    let count = gram[(2, 2)];
    let scaled = DMatrix::from_fn(3, 3, |i, j| gram[(i, j)] / (gram[(i, i)] * gram[(j, j)]).sqrt());
    let condition_number = if scaled.iter().all(|value| value.is_finite()) {
        let eigenvalues = SymmetricEigen::new(scaled).eigenvalues;
        let (least, largest) = (eigenvalues.min(), eigenvalues.max());
        if least > largest * f64::EPSILON { (largest / least).sqrt() } else { f64::INFINITY }
    } else {
        f64::INFINITY
    };
    let covariance = DMatrix::from_fn(2, 2, |i, j| gram[(i, j)] / count - gram[(i, 2)] * gram[(j, 2)] / count.powi(2));
    let correlation = DMatrix::from_fn(2, 2, |i, j| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt());
    let inflation = correlation
        .iter()
        .all(|value| value.is_finite())
        .then(|| Cholesky::new(correlation))
        .flatten()
        .map(|factor| factor.inverse());
    let variance_inflation = inflation.into_iter().flat_map(|inverse| {
        columns.into_iter().enumerate().map(move |(index, column)| (column.name().to_owned(), inverse[(index, index)]))
    });
    Collinearity { channel: channel.into(), condition_number, variance_inflation: variance_inflation.collect() }
}

/// What of the two tables is worth a warning.
pub(super) fn findings(movements: &[Excitation], collinearity: &[Collinearity]) -> Vec<Finding> {
    let finding = |name: String, verdict, measured, message: String| Finding {
        name,
        subject: Subject::Excitation,
        verdict,
        measured,
        interval: None,
        expected: None,
        unit: "1".into(),
        message,
        set: None,
        flights: Vec::new(),
    };
    let mut findings = Vec::new();
    for movement in movements {
        let name = format!("excitation_{}", movement.column);
        // Rounding of the mean is no movement.
        if movement.deviation <= f64::EPSILON.sqrt() * movement.mean.abs() {
            let message = format!("`{}` stands still: its coefficient cannot be found from these flights", movement.column);
            findings.push(finding(name, Severity::Warning, Some(movement.deviation), message));
        } else if movement.carrying_blocks < FEW_CARRYING_BLOCKS {
            let message = format!(
                "{} blocks of 10 s hold {:.0} % of the movement of `{}`: fly more of it",
                movement.carrying_blocks,
                100.0 * CARRIED_SHARE,
                movement.column
            );
            findings.push(finding(name, Severity::Warning, Some(movement.carrying_blocks as f64), message));
        }
    }
    for row in collinearity {
        let worst = row.variance_inflation.iter().map(|(_, value)| *value).fold(0.0, f64::max);
        let name = format!("collinearity_{}", row.channel);
        if row.condition_number > LARGE_CONDITION_NUMBER || worst > LARGE_INFLATION {
            let message = format!(
                "the columns of {} are hard to tell apart (condition number {:.0}, variance inflation {worst:.1}): its coefficients are uncertain",
                row.channel, row.condition_number
            );
            findings.push(finding(name, Severity::Warning, Some(row.condition_number), message));
        }
    }
    if findings.is_empty() {
        let message = "states and controls move, and the baseline's columns can be told apart".into();
        findings.push(finding("excitation".into(), Severity::Ok, None, message));
    }
    findings
}
