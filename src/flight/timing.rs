//! The time column of a log: strictly increasing, one constant step; where it jumps, the parts between.
//!
//! Only times are judged here; what to do with the parts (refuse, split) is decided by the caller's switch.

use super::table::RawTable;
use crate::error::Result;
use std::ops::Range;

/// Largest deviation of one step from the flight's, relative.
const STEP_TOLERANCE: f64 = 0.01;
/// The same where the log is resampled: stamps may jitter, samples may not be lost.
const JITTER_TOLERANCE: f64 = 0.5;

/// A part of a log without jumps: rows, time of the first, s, and mean step, s.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    pub rows: Range<usize>,
    pub start_s: f64,
    pub step_s: f64,
    /// Length of the jump before it, s; 0 for the first part.
    pub gap_before_s: f64,
}

/// Checks the times `time_s` of a file and cuts them at jumps.
///
/// # Errors
/// [`Error::Cell`](crate::Error::Cell) where time steps back, repeats, or is shorter than the step; where it jumps unless `split`.
pub(super) fn parts(table: &RawTable, column: &str, time_s: &[f64], resampled: bool, split: bool) -> Result<Vec<Part>> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if let Some(at) = steps.iter().position(|&step| step.is_nan() || step <= 0.0) {
        let (before, after) = (time_s[at], time_s[at + 1]);
        let what = if after == before { "repeats" } else { "steps back" };
        let found = format!("time that {what}: {after} s after {before} s");
        return Err(table.cell(at + 1, column, found, "time that increases from row to row"));
    }
    if steps.is_empty() {
        return Err(table.fault("a single row", "at least two rows, so that there is a time step"));
    }
    let middle = steps.len() / 2;
    let (_, &mut step_s, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    let relative = if resampled { JITTER_TOLERANCE } else { STEP_TOLERANCE };
    let largest = time_s.iter().fold(0.0_f64, |largest, time| largest.max(time.abs()));
    // Large stamps (Unix seconds) carry a rounding error of their own.
    let tolerance = relative * step_s + 4.0 * f64::EPSILON * largest;

    let mut parts = Vec::new();
    let (mut start, mut gap_before_s) = (0, 0.0);
    for (row, pair) in (1..).zip(time_s.windows(2)) {
        let deviation = pair[1] - pair[0] - step_s;
        if deviation.abs() <= tolerance {
            continue;
        }
        let percent = relative * 100.0;
        if deviation < 0.0 {
            let found = format!("a step of {} s where the flight's is {step_s} s", pair[1] - pair[0]);
            let hint = if resampled { "" } else { ", or `resample_hz` in dataset.toml for stamps that jitter" };
            return Err(table.cell(row, column, found, format!("one constant step within {percent} %{hint}")));
        }
        if !split {
            let found = format!("a jump of {:.6} s after {} s, where the flight's step is {step_s} s", pair[1] - pair[0], pair[0]);
            let expected = format!("one constant step within {percent} %; --split-at-gaps makes a flight of each part");
            return Err(table.cell(row, column, found, expected));
        }
        parts.push(part(time_s, start..row, step_s, gap_before_s));
        (start, gap_before_s) = (row, pair[1] - pair[0]);
    }
    parts.push(part(time_s, start..time_s.len(), step_s, gap_before_s));
    Ok(parts)
}

fn part(time_s: &[f64], rows: Range<usize>, median_s: f64, gap_before_s: f64) -> Part {
    let (first, last, intervals) = (time_s[rows.start], time_s[rows.end - 1], rows.len() - 1);
    let step_s = if intervals == 0 { median_s } else { (last - first) / intervals as f64 };
    // Stamps are rounded decimals: a step with up to nine digits that explains them as well is the one that was meant.
    let round: f64 = format!("{step_s:.8e}").parse().unwrap_or(step_s);
    let rounding_s = 4.0 * f64::EPSILON * first.abs().max(last.abs());
    let step_s = if (round - step_s).abs() * intervals as f64 <= rounding_s { round } else { step_s };
    Part { rows, start_s: first, step_s, gap_before_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: usize) -> RawTable {
        RawTable { path: "a.csv".into(), lines: (2..rows + 2).collect(), ..RawTable::default() }
    }

    fn message(times: &[f64], resampled: bool) -> String {
        parts(&table(times.len()), "t", times, resampled, false).map_or_else(|error| error.to_string(), |_| "accepted".into())
    }

    #[test]
    fn a_decimal_step_is_found_exactly_whatever_the_start() -> Result<()> {
        for start in [0.0, 17.23, 1_218_000_000.5] {
            let times: Vec<f64> = (0..5000).map(|k| start + 0.01 * f64::from(k)).collect();
            let parts = parts(&table(5000), "t", &times, false, false)?;
            assert_eq!((parts.len(), parts[0].step_s.to_bits()), (1, 0.01_f64.to_bits()), "from {start}");
        }
        Ok(())
    }

    #[test]
    fn faults_are_placed() {
        assert!(
            message(&[0.0, 0.01, 0.01, 0.02], false).contains("line 4, column `t`: found time that repeats: 0.01 s after 0.01 s")
        );
        assert!(message(&[0.0, 0.01, 0.02, 0.005], false).contains("line 5, column `t`: found time that steps back"));
        let jump = message(&[0.0, 0.01, 0.02, 0.52, 0.53], false);
        assert!(jump.contains("line 5") && jump.contains("a jump of 0.500000 s after 0.02 s") && jump.contains("--split-at-gaps"));
        let jitter = [0.0, 0.01, 0.021, 0.03, 0.04];
        assert!(message(&jitter, false).contains("a jump of 0.011"));
        assert_eq!(message(&jitter, true), "accepted");
        assert!(message(&[0.0], false).contains("a single row"));
        assert!(message(&[0.0, f64::NAN], false).contains("steps back"));
    }

    #[test]
    fn parts_between_jumps_are_whole() -> Result<()> {
        let parts = parts(&table(5), "t", &[0.0, 0.01, 0.02, 0.52, 0.53], false, true)?;
        assert_eq!(parts.iter().map(|part| part.rows.clone()).collect::<Vec<_>>(), [0..3, 3..5]);
        assert!((parts[1].gap_before_s - 0.5).abs() <= phyture_kernels::Tolerance::Close.relative_f64());
        Ok(())
    }
}
