//! Yardsticks: predictors without physics or learning to speak of, which any model has to beat before its error means anything.
//!
//! Differences of the measured velocity say how much of the acceleration is already written in the history; ridge regression
//! on lagged rows says what a linear filter of the history reaches. Neither sees a target at prediction time. No comparison
//! here: errors and tables are made by whoever gets the [`Row`]s.

use super::Row;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, PerChannel, Window};
use crate::hybrid::linear::{Linear, LinearConfig, Signals};

/// v and ω, whose differences are the targets in the order of [`Column::TARGETS`].
const VELOCITIES: PerChannel<Column> = PerChannel::new([Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz]);

/// Causal backward difference (v_t − v_{t−1})/step of v and ω at the last row of each window: m/s², rad/s².
///
/// Its error is about step/2 times the second derivative, plus √2/step times the noise of one sample.
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight or has no row before its last.
pub fn finite_difference(flights: &[Flight], windows: &[Window]) -> Result<Row> {
    let predicted = windows.iter().map(|&window| {
        let flight = flight_of(flights, window, 2)?;
        Ok(VELOCITIES.map(|column| difference(flight, column, window.last - 1, window.last)))
    });
    Ok(Row { name: "finite difference".into(), predicted: predicted.collect::<Result<_>>()? })
}

/// Centred difference (v_{t+1} − v_{t−1})/(2·step) of v and ω: zero phase, so it looks one row ahead and is no predictor.
///
/// It bounds what any differentiation of the same signals can reach. The first and last row of a flight, which have one
/// neighbour only, get the one-sided difference.
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight or the flight has one sample only.
pub fn centred_difference(flights: &[Flight], windows: &[Window]) -> Result<Row> {
    let predicted = windows.iter().map(|&window| {
        let flight = flight_of(flights, window, 1)?;
        let (from, to) = (window.last.saturating_sub(1), (window.last + 1).min(flight.len() - 1));
        if from == to {
            return Err(Error::Shape {
                operation: "centred difference",
                message: format!("flight `{}` has one sample; a difference needs two", flight.name),
            });
        }
        Ok(VELOCITIES.map(|column| difference(flight, column, from, to)))
    });
    Ok(Row { name: "centred difference (not causal)".into(), predicted: predicted.collect::<Result<_>>()? })
}

fn difference(flight: &Flight, column: Column, from: usize, to: usize) -> f64 {
    let values = flight.column(column);
    (values[to] - values[from]) / (flight.step_s * (to - from) as f64)
}

/// The flight of a window, once it is sure that the window's last `rows` rows lie in it.
fn flight_of(flights: &[Flight], window: Window, rows: usize) -> Result<&Flight> {
    let flight = flights.get(window.flight).ok_or_else(|| Error::Shape {
        operation: "yardstick",
        message: format!("a window of flight {} among {} flights", window.flight, flights.len()),
    })?;
    if window.last >= flight.len() || window.last + 1 < rows {
        return Err(Error::Shape {
            operation: "yardstick",
            message: format!(
                "a history of {rows} rows that ends at row {} does not lie in flight `{}` of {} rows; \
                 leave out windows with `last` < {} or ask for fewer lags",
                window.last,
                flight.name,
                flight.len(),
                rows - 1
            ),
        });
    }
    Ok(flight)
}

/// Ridge regression of the accelerations on the last rows of the log, fitted on the training windows: what a linear filter of the
/// history reaches without any physics. The row's name says how many lags.
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight or has fewer rows than lags; otherwise as [`Linear::fit`].
pub fn ridge(flights: &[Flight], training: &[Window], windows: &[Window], config: &LinearConfig) -> Result<Row> {
    let targets = training.iter().map(|&window| {
        let flight = flight_of(flights, window, config.lags)?;
        Ok(PerChannel::from_fn(|channel| flight.column(channel.column())[window.last]))
    });
    let linear = Linear::fit(flights, training, &targets.collect::<Result<Vec<_>>>()?, config)?;
    let signals: Vec<Signals> = flights.iter().map(|flight| Signals::new(flight, config)).collect::<Result<_>>()?;
    let predicted = windows.iter().map(|&window| {
        flight_of(flights, window, config.lags)?;
        Ok(linear.at(&signals[window.flight], window.last))
    });
    Ok(Row { name: format!("ridge regression, {} lags", config.lags), predicted: predicted.collect::<Result<_>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Channel;
    use crate::flight::Targets;
    use phyture_kernels::Tolerance;

    fn windows(flight: usize, rows: std::ops::Range<usize>) -> Vec<Window> {
        rows.map(|last| Window { flight, last }).collect()
    }

    fn still(samples: usize) -> [Vec<f64>; Column::COUNT] {
        std::array::from_fn(|_| vec![0.0; samples])
    }

    fn close(found: &[PerChannel<f64>], expected: impl Fn(usize, Channel) -> f64, bound: f64) -> bool {
        (0..found.len())
            .all(|row| Channel::ALL.into_iter().all(|channel| (found[row][channel] - expected(row, channel)).abs() <= bound))
    }

    #[test]
    fn differences_of_a_parabola_are_what_they_should_be() {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; 50]);
        columns[Column::Wz as usize] = (0..50).map(|k| (0.01 * f64::from(k)).powi(2)).collect();
        let flights = [Flight::new("a", "a", 0.0, 0.01, columns, Targets::Recorded).unwrap()];
        let test = windows(0, 1..49);
        let slope = |channel: Channel, time_s: f64| if channel == Channel::WzDot { 2.0 * time_s } else { 0.0 };
        let causal = finite_difference(&flights, &test).unwrap();
        let bound = Tolerance::Close.relative_f64();
        assert!(close(&causal.predicted, |row, channel| slope(channel, 0.01 * (row as f64 + 0.5)), bound));
        let centred = centred_difference(&flights, &test).unwrap();
        assert!(close(&centred.predicted, |row, channel| slope(channel, 0.01 * (row as f64 + 1.0)), bound));
    }

    #[test]
    fn windows_without_a_full_history_are_refused_with_the_reason() {
        let flights = [Flight::new("a", "a", 0.0, 0.01, still(3000), Targets::Recorded).unwrap()];
        let config = LinearConfig::default();
        let refused = |training: &[Window]| {
            ridge(&flights, training, &[], &config).map_err(|error| error.to_string()).err().unwrap_or_default()
        };
        assert!(refused(&windows(0, 9..3000)).contains("history of 11 rows that ends at row 9"));
        assert!(refused(&windows(1, 10..20)).contains("flight 1 among 1"));
        assert!(finite_difference(&flights, &windows(0, 0..1)).is_err());
    }
}
