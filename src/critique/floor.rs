//! The floor: what no model can remove of the error, where the explainable part of the flights is known, as it is of simulated ones.

use super::Row;
use super::channels::ChannelValues;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, PerChannel, Span, Window};

/// Root mean square of what was recorded less what is explainable, at the last row of each window: m/s², rad/s².
///
/// `explainable` holds a flight of the same name, start, step and length for each of `flights` that has a window; its accelerations are those without
/// gusts, turbulence and noise.
///
/// # Errors
/// [`Error::Log`] naming a flight whose explainable part is missing or of another length.
pub fn floor(flights: &[Flight], windows: &[Window], explainable: &[Flight]) -> Result<ChannelValues> {
    let partners = partners(flights, windows, explainable)?;
    let mut squares = PerChannel::splat(0.0);
    for window in windows {
        let (log, calm) = (&flights[window.flight], partners[window.flight]);
        for (sum, column) in squares.iter_mut().zip(Column::TARGETS) {
            // A flight with a window has a partner.
            *sum += calm.map_or(f64::NAN, |calm| log.column(column)[window.last] - calm.column(column)[window.last]).powi(2);
        }
    }
    Ok(ChannelValues::new(squares.map(|sum| (!windows.is_empty()).then(|| (sum / windows.len() as f64).sqrt()))))
}

/// The explainable accelerations at the last row of each window, as a row to hold beside others.
///
/// # Errors
/// As [`floor()`].
pub fn explainable_at(flights: &[Flight], windows: &[Window], explainable: &[Flight]) -> Result<Row> {
    let partners = partners(flights, windows, explainable)?;
    let at = |window: &Window| {
        let calm = partners[window.flight].expect("a flight with a window has a partner");
        PerChannel::from_fn(|channel| calm.column(channel.column())[window.last])
    };
    Ok(Row { name: "floor".into(), predicted: windows.iter().map(at).collect() })
}

/// The same over every sample of the spans.
///
/// # Errors
/// As [`floor()`].
pub fn floor_of_spans(flights: &[Flight], spans: &[Span], explainable: &[Flight]) -> Result<ChannelValues> {
    let length = |span: &Span| flights.get(span.flight).map_or(0, Flight::len);
    let samples = |span: &Span| {
        let flight = span.flight;
        (span.start..span.end.min(length(span))).map(move |last| Window { flight, last })
    };
    floor(flights, &spans.iter().flat_map(samples).collect::<Vec<_>>(), explainable)
}

/// For each flight that has a window, its explainable part.
fn partners<'a>(flights: &[Flight], windows: &[Window], explainable: &'a [Flight]) -> Result<Vec<Option<&'a Flight>>> {
    let mut judged = vec![false; flights.len()];
    for window in windows {
        if let Some(judged) = judged.get_mut(window.flight) {
            *judged = true;
        }
    }
    let partner = |(index, log): (usize, &Flight)| {
        if !judged[index] {
            return Ok(None);
        }
        let fault = |found: String| Error::Log {
            path: (&log.name).into(),
            found,
            expected: "the explainable part that was simulated together with these flights".into(),
        };
        let Some(calm) = explainable.iter().find(|calm| calm.name == log.name) else {
            return Err(fault("no explainable part of this name".into()));
        };
        let differs = (calm.len(), calm.start_s, calm.step_s) != (log.len(), log.start_s, log.step_s);
        if differs {
            let found = format!(
                "an explainable part of {} samples from {} s for {} from {} s",
                calm.len(),
                calm.start_s,
                log.len(),
                log.start_s
            );
            return Err(fault(found));
        }
        Ok(Some(calm))
    };
    flights.iter().enumerate().map(partner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Targets;
    use phyture_kernels::Tolerance;

    fn flight(name: &str, samples: usize, acceleration: f64) -> Result<Flight> {
        let columns = Column::ALL.map(|column| vec![if Column::TARGETS.contains(&column) { acceleration } else { 0.0 }; samples]);
        Flight::new(name, "hover", 0.0, 0.01, columns, Targets::Recorded)
    }

    #[test]
    fn the_floor_is_the_difference_at_the_windows_by_name() -> Result<()> {
        let flights = [flight("a", 10, 3.0)?, flight("b", 10, 5.0)?, flight("never judged", 10, 0.0)?];
        let calm = [flight("b", 10, 4.0)?, flight("a", 10, 1.0)?];
        let windows: Vec<Window> = (0..2).flat_map(|flight| (0..10).map(move |last| Window { flight, last })).collect();
        let found = floor(&flights, &windows, &calm)?.mean.unwrap_or(f64::NAN);
        let spans = [Span { flight: 0, start: 0, end: 10 }, Span { flight: 1, start: 0, end: 99 }];
        assert_eq!(floor_of_spans(&flights, &spans, &calm)?.mean, Some(found));
        assert_eq!(floor_of_spans(&flights, &spans[1..], &calm)?.vx_dot, Some(1.0));
        assert!((found - 2.5_f64.sqrt()).abs() < Tolerance::Close.relative_f64(), "{found}");
        let missing = floor(&flights, &windows, &calm[..1]).map_err(|error| error.to_string());
        assert!(matches!(&missing, Err(text) if text.contains("a: found no explainable part")), "{missing:?}");
        assert!(floor(&flights, &windows, &[flight("a", 9, 0.0)?, flight("b", 10, 0.0)?]).is_err());
        Ok(())
    }
}
