//! The rows on which dependence of the residual is sought: means over short stretches of flight, in blocks.
//!
//! Only what was recorded, simple functions of it, and velocity against the air where the caller knows the wind; no model, no test.

use crate::error::{Error, Result};
use crate::flight::{Accelerations, Column, Flight, PerChannel, Span, derived};
use crate::formula::Formula;
use crate::physics::evaluate;
use std::ops::Range;

/// Length of a row, s: well below the 0.5 s for which a gust lasts and the 1 s of the quickest manoeuvres.
pub const ROW_S: f64 = 0.1;
/// Time before a row at which [`ResidualTable::at_start`] is read, s: smoothed logs already know of a gust that far ahead.
const LEAD_S: f64 = 0.03;
/// Most rows, if the caller has no other wish.
pub const ROWS_MAX: usize = 24_000;

/// Gives a flight's velocity against the air along the body axes, m/s.
pub type AirOf<'a> = &'a dyn Fn(usize) -> Result<[Vec<f64>; 3]>;

/// Residuals and what was measured with them, one row a short stretch.
#[derive(Clone, Debug, Default)]
pub struct ResidualTable {
    /// Features, as formulas (`vx`, where the wind is known `air_vx`, too; `hypot(vx, vy)`, `sin(yaw)`, `lag(u4, 0.1)`); `time_in_flight` is none.
    pub names: Vec<String>,
    /// SI units of the features.
    pub units: Vec<String>,
    /// One column a feature.
    pub features: Vec<Vec<f64>>,
    /// The features shortly before each row, or at its start where a span begins: what was so before the row's own residual could
    /// act on it. May be empty; then
    /// the means stand in for them, and a state that follows a gust within a row is harder to tell from a cause.
    pub at_start: Vec<Vec<f64>>,
    /// Measured − predicted by channel in the order of [`Column::TARGETS`], m/s² and rad/s².
    pub residual: PerChannel<Vec<f64>>,
    /// Block of each row, from 0 without gaps, never falling. A block lies in one span of one flight.
    pub block: Vec<usize>,
    /// Flight of each row, as in the spans.
    pub flight: Vec<usize>,
    /// Time of the middle of each row since the flight's first sample, s.
    pub time_s: Vec<f64>,
}

/// A feature before it is known whether the flights carry it and whether it varies.
struct Candidate {
    name: String,
    unit: &'static str,
    reads: &'static [Column],
}

/// All features in the order of [`ResidualTable::names`], except time; velocities against the air only where they are known.
fn candidates(air: bool) -> Vec<Candidate> {
    use Column::{Pitch, Roll, U1, U2, U3, U4, Vx, Vy, Vz, Wx, Wy, Wz, Yaw, Z};
    const PLAIN: [&[Column]; 12] = [&[Vx], &[Vy], &[Vz], &[Wx], &[Wy], &[Wz], &[U1], &[U2], &[U3], &[U4], &[Roll], &[Pitch]];
    let plain = PLAIN.into_iter().filter_map(|reads| {
        let column = reads.first()?;
        Some(Candidate { name: column.name().into(), unit: column.unit(), reads })
    });
    let made = |name: &str, unit, reads| Candidate { name: name.into(), unit, reads };
    let further = [
        made("height", "m", &[Z][..]),
        made("airspeed", "m/s", &[Vx, Vy, Vz]),
        made("hypot(vx, vy)", "m/s", &[Vx, Vy]),
        made("sin(yaw)", "1", &[Yaw]),
        made("cos(yaw)", "1", &[Yaw]),
    ];
    const STICKS: [&[Column]; 4] = [&[U1], &[U2], &[U3], &[U4]];
    let lagged = STICKS.into_iter().flat_map(|reads| {
        let stick = reads.first().map_or("", |column| column.name());
        ["0.1", "0.4"].map(|tau_s| Candidate { name: format!("lag({stick}, {tau_s})"), unit: "1", reads })
    });
    let of_air = ["air_vx", "air_vy", "air_vz", "hypot(air_vx, air_vy)"].map(|name| made(name, "m/s", &[Vx, Vy, Vz]));
    plain.chain(further).chain(lagged).chain(of_air.into_iter().filter(|_| air)).collect()
}

impl ResidualTable {
    /// Makes the table from the spans of some flights.
    ///
    /// `residuals` gives measured − predicted of a whole flight, sample by sample. A row is the mean of what counts ([`Flight::set_aside`]) over [`ROW_S`] (at least one
    /// sample), or over longer where that would give more than `rows_max` rows; blocks are `block_s` long. Neither crosses a
    /// flight or a span; what remains of a span after the last whole row is left out. Features of a column that one of the
    /// flights lacks are left out, and so are features that do not vary.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if there is no row or a residual is not finite, [`Error::Shape`] for a span outside its flight or
    /// residuals that are not one a sample, and whatever `residuals` gives.
    pub fn new(
        flights: &[Flight],
        spans: &[Span],
        residuals: &dyn Fn(usize) -> Result<Accelerations>,
        block_s: f64,
        rows_max: usize,
    ) -> Result<Self> {
        Self::with_rows(flights, spans, residuals, block_s, rows_max, ROW_S)
    }

    /// As [`ResidualTable::new`], with velocities against the air beside those over ground; `airspeed` is theirs, as in formulas of a model with
    /// wind.
    ///
    /// # Errors
    /// As [`ResidualTable::new`], and whatever `air` gives.
    pub fn against_air(
        flights: &[Flight],
        spans: &[Span],
        residuals: &dyn Fn(usize) -> Result<Accelerations>,
        air: AirOf<'_>,
        block_s: f64,
    ) -> Result<Self> {
        Self::build(flights, spans, residuals, Some(air), (block_s, ROW_S, ROWS_MAX))
    }

    /// As [`ResidualTable::new`] with rows of `row_s` instead of [`ROW_S`]: short ones for spectra.
    ///
    /// # Errors
    /// As [`ResidualTable::new`].
    pub fn with_rows(
        flights: &[Flight],
        spans: &[Span],
        residuals: &dyn Fn(usize) -> Result<Accelerations>,
        block_s: f64,
        rows_max: usize,
        row_s: f64,
    ) -> Result<Self> {
        Self::build(flights, spans, residuals, None, (block_s, row_s, rows_max))
    }

    /// The table; sizes are the length of a block and of a row, s, and the most rows.
    fn build(
        flights: &[Flight],
        spans: &[Span],
        residuals: &dyn Fn(usize) -> Result<Accelerations>,
        air: Option<AirOf<'_>>,
        (block_s, row_s, rows_max): (f64, f64, usize),
    ) -> Result<Self> {
        let shape = |message: String| Error::Shape { operation: "residual table", message };
        let seconds = seconds(flights, spans).map_err(shape)?;
        let row_s = row_s.max(seconds / rows_max.max(1) as f64);
        let used = |flight: &usize| spans.iter().any(|span| span.flight == *flight);
        let of_spans: Vec<usize> = (0..flights.len()).filter(used).collect();
        let absent = |column: &Column| of_spans.iter().any(|flight| flights[*flight].absent.contains(column));
        let mut candidates = candidates(air.is_some());
        candidates.retain(|candidate| !candidate.reads.iter().any(absent));
        let mut table = Self::default();
        table.features.resize(candidates.len() + 1, Vec::new());
        table.at_start.resize(candidates.len() + 1, Vec::new());
        let mut blocks = 0;
        for index in of_spans {
            let flight = &flights[index];
            let residual = residuals(index)?;
            if let Some(bad) = residual.iter().find(|column| column.len() != flight.len()) {
                return Err(shape(format!("{} residuals for {} samples of `{}`", bad.len(), flight.len(), flight.name)));
            }
            let known = air.map(|air| air(index)).transpose()?;
            let columns: Vec<Vec<f64>> =
                candidates.iter().map(|candidate| column(flight, &candidate.name, known.as_ref())).collect::<Result<_>>()?;
            let samples = (row_s / flight.step_s - 1e-9).ceil().max(1.0) as usize;
            let rows_of_block = (block_s / (samples as f64 * flight.step_s)).round().max(1.0) as usize;
            for span in spans.iter().filter(|span| span.flight == index) {
                let mut last = None;
                for (row, start) in (span.start..).step_by(samples).take((span.end - span.start) / samples).enumerate() {
                    let parts: Vec<Range<usize>> = flight.counted(start..start + samples).collect();
                    let count: usize = parts.iter().map(ExactSizeIterator::len).sum();
                    if count == 0 {
                        continue;
                    }
                    let mean = |values: &[f64]| parts.iter().flat_map(|part| &values[part.clone()]).sum::<f64>() / count as f64;
                    let of_block = row / rows_of_block;
                    blocks += usize::from(last.is_some_and(|last| last != of_block));
                    last = Some(of_block);
                    let middle_s = (start as f64 + 0.5 * (samples - 1) as f64) * flight.step_s;
                    for (out, values) in table.features.iter_mut().zip(&columns) {
                        out.push(mean(values));
                    }
                    let before = start.saturating_sub((LEAD_S / flight.step_s).round() as usize).max(span.start);
                    for (out, values) in table.at_start.iter_mut().zip(&columns) {
                        out.push(values[before]);
                    }
                    table.features[candidates.len()].push(middle_s);
                    table.at_start[candidates.len()].push(before as f64 * flight.step_s);
                    for (out, values) in table.residual.iter_mut().zip(&residual) {
                        let value = mean(values);
                        if !value.is_finite() {
                            return Err(Error::Undetermined(format!("a residual of `{}` is {value}", flight.name)));
                        }
                        out.push(value);
                    }
                    table.block.push(blocks);
                    table.flight.push(index);
                    table.time_s.push(middle_s);
                }
                blocks += usize::from(last.is_some());
            }
            flight.rest();
        }
        if table.block.is_empty() {
            return Err(Error::Undetermined("no rows to look at: the spans are empty; give at least one flight".into()));
        }
        // Only a log that starts at zero has `t` for the time in flight.
        let starts_at_zero = flights.iter().all(|flight| flight.start_s == 0.0);
        let time = if starts_at_zero { "t" } else { "time_in_flight" };
        let named = candidates.into_iter().map(|candidate| (candidate.name, candidate.unit));
        let named = named.chain([(time.to_owned(), "s")]).zip(std::mem::take(&mut table.features));
        for (((name, unit), values), at_start) in named.zip(std::mem::take(&mut table.at_start)) {
            let (low, high) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
            if high - low > 1e-9 * high.abs().max(low.abs()) && high.is_finite() && low.is_finite() {
                table.names.push(name);
                table.units.push(unit.into());
                table.features.push(values);
                table.at_start.push(at_start);
            }
        }
        Ok(table)
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.block.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.block.is_empty()
    }

    /// A feature by name.
    pub fn feature(&self, name: &str) -> Option<&[f64]> {
        self.names.iter().position(|known| known == name).and_then(|index| self.features.get(index)).map(Vec::as_slice)
    }

    /// The rows of each block.
    pub fn blocks(&self) -> Vec<std::ops::Range<usize>> {
        super::runs(&self.block)
    }
}

/// Length of all spans, s; the first that lies outside its flight, in words.
fn seconds(flights: &[Flight], spans: &[Span]) -> std::result::Result<f64, String> {
    let length_s = |span: &Span| {
        let flight = flights.get(span.flight).filter(|flight| span.start <= span.end && span.end <= flight.len());
        let outside = || format!("span {span:?} lies outside the {} flights", flights.len());
        flight.map(|flight| (span.end - span.start) as f64 * flight.step_s).ok_or_else(outside)
    };
    spans.iter().map(length_s).sum()
}

/// A feature of a whole flight, whose velocity against the air may be known.
fn column(flight: &Flight, name: &str, air: Option<&[Vec<f64>; 3]>) -> Result<Vec<f64>> {
    if let Some([x, y, z]) = air {
        match name {
            "air_vx" => return Ok(x.clone()),
            "air_vy" => return Ok(y.clone()),
            "air_vz" => return Ok(z.clone()),
            "hypot(air_vx, air_vy)" => return Ok(x.iter().zip(y).map(|(x, y)| x.hypot(*y)).collect()),
            "airspeed" => return Ok(x.iter().zip(y).zip(z).map(|((x, y), z)| x.hypot(*y).hypot(*z)).collect()),
            _ => {}
        }
    }
    match derived::of_flight(flight, name) {
        Some(values) => Ok(values),
        None => evaluate(&Formula::parse(name)?, flight),
    }
}

/// What a person calls the variable of a feature: `yaw` of `sin(yaw)`, `u4` of `lag(u4, 0.1)`.
pub(super) fn variable(feature: &str) -> &str {
    match feature {
        "sin(yaw)" | "cos(yaw)" => "yaw",
        _ => feature.strip_prefix("lag(").and_then(|rest| rest.split_once(',')).map_or(feature, |(stick, _)| stick),
    }
}
