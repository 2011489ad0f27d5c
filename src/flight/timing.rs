//! The time column of a log: strictly increasing, one constant step; where it jumps, the parts between.
//!
//! Only times are judged here; what to do with the parts (refuse, split) is decided by the caller's switch.

use super::bounds::RATES_HZ;
use super::table::RawTable;
use crate::error::{Error, Result};
use std::ops::{Range, RangeInclusive};

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

/// Share of uneven steps from which a log jitters; fewer are gaps.
const JITTERS: f64 = 0.01;

/// What the description and the options say about time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock<'a> {
    /// Time's unit, if the description states one.
    pub unit: Option<&'a str>,
    /// The log is resampled, so its stamps may jitter.
    pub resampled: bool,
    /// Each part between jumps becomes a flight.
    pub split: bool,
}

/// Checks the times `time_s` of a file and cuts them at jumps.
///
/// # Errors
/// [`Error::Cell`](crate::Error::Cell) where time steps back, repeats, or is shorter than the step; where it jumps unless they are to be split
/// there; where its step is none that an aircraft's log has.
pub(super) fn parts(table: &RawTable, column: &str, time_s: &[f64], clock: Clock) -> Result<Vec<Part>> {
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
    check_rate(table, column, step_s, clock.unit)?;
    let relative = if clock.resampled { JITTER_TOLERANCE } else { STEP_TOLERANCE };
    let largest = time_s.iter().fold(0.0_f64, |largest, time| largest.max(time.abs()));
    // Large stamps (Unix seconds) carry a rounding error of their own.
    let rounding_s = 4.0 * f64::EPSILON * largest;
    let tolerance = relative * step_s + rounding_s;
    let uneven = steps.iter().filter(|&&step| (step - step_s).abs() > tolerance).count();
    let jitters = uneven as f64 > JITTERS * steps.len() as f64;
    let (sum_s, count) = steps
        .iter()
        .filter(|&&step| step <= (1.0 + JITTER_TOLERANCE) * step_s)
        .fold((0.0, 0.0), |(sum, count), step| (sum + step, count + 1.0));
    let mean_s = sum_s / count;

    let mut parts = Vec::new();
    let (mut start, mut gap_before_s) = (0, 0.0);
    for (row, pair) in (1..).zip(time_s.windows(2)) {
        let deviation = pair[1] - pair[0] - step_s;
        if deviation.abs() <= tolerance {
            continue;
        }
        let late = deviation > JITTER_TOLERANCE * step_s + rounding_s;
        if deviation < 0.0 || !clock.split || (jitters && !late) {
            return Err(Uneven { step_s, mean_s, uneven, of: steps.len(), jitters, late, resampled: clock.resampled }
                .fault(table, column, row, pair));
        }
        parts.push(part(time_s, start..row, step_s, gap_before_s));
        (start, gap_before_s) = (row, pair[1] - pair[0]);
    }
    parts.push(part(time_s, start..time_s.len(), step_s, gap_before_s));
    Ok(parts)
}

/// Cuts parts further, before the rows at these times (to half a step); where it is cut already, nothing is done.
///
/// # Errors
/// A time before which there is no row, or none behind.
pub(super) fn cut(parts: Vec<Part>, time_s: &[f64], at_s: &[f64]) -> std::result::Result<Vec<Part>, f64> {
    let mut pieces = parts;
    for &at_s in at_s {
        let row_of = |part: &Part| time_s.partition_point(|&time| time < at_s - 0.5 * part.step_s);
        let place = pieces.iter().position(|piece| piece.rows.contains(&row_of(piece))).ok_or(at_s)?;
        let row = row_of(&pieces[place]);
        if row == 0 {
            return Err(at_s);
        }
        let Part { rows, step_s, gap_before_s, .. } = pieces[place].clone();
        if row > rows.start {
            pieces[place] = part(time_s, rows.start..row, step_s, gap_before_s);
            pieces.insert(place + 1, part(time_s, row..rows.end, step_s, 0.0));
        }
    }
    Ok(pieces)
}

/// Refuses a step that no log of an aircraft has; mostly its time is in another unit.
fn check_rate(table: &RawTable, column: &str, step_s: f64, unit: Option<&str>) -> Result<()> {
    if RATES_HZ.contains(&step_s.recip()) {
        return Ok(());
    }
    let usual = |factor: f64| USUAL_RATES_HZ.contains(&(step_s * factor).recip());
    let advice = match (unit, [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)].into_iter().find(|&(_, factor)| usual(factor))) {
        (Some(unit), _) => format!("; `[units] t = \"{unit}\"` in dataset.toml does not fit"),
        (None, Some((unit, factor))) => {
            let hz = (step_s * factor).recip();
            format!("; if time is in {unit}, which would be {hz:.0} Hz, say [units] t = \"{unit}\" in dataset.toml")
        }
        (None, None) => "; if time is in another unit, say so under [units] in dataset.toml".to_owned(),
    };
    let expected = format!("{} to {} samples a second{advice}", RATES_HZ.start(), RATES_HZ.end());
    Err(table.cell(1, column, format!("a step of {step_s} s"), expected))
}

/// Rates that logs usually have, Hz, to tell units of time apart.
const USUAL_RATES_HZ: RangeInclusive<f64> = 10.0..=1e4;

/// A step that is not the flight's.
struct Uneven {
    step_s: f64,
    /// Mean of the steps without gaps, s.
    mean_s: f64,
    /// How many there are, of how many steps.
    uneven: usize,
    of: usize,
    jitters: bool,
    /// So much later than due that samples are missing.
    late: bool,
    resampled: bool,
}

impl Uneven {
    fn fault(&self, table: &RawTable, column: &str, row: usize, pair: &[f64]) -> Error {
        // Stamps are rounded; the digits behind a microsecond are of the subtraction.
        let (step_s, now_s) = ((self.step_s * 1e6).round() / 1e6, pair[1] - pair[0]);
        let step_s = if step_s > 0.0 { step_s } else { self.step_s };
        let constant = |relative: f64| format!("one constant step within {} %", relative * 100.0);
        let found = match self.late {
            true => format!("a jump of {now_s:.6} s after {} s, where the flight's step is {step_s} s", pair[0]),
            false => format!("a step of {now_s:.6} s where the flight's is {step_s} s"),
        };
        if self.resampled {
            let expected = format!("{}; --split-at-gaps makes a flight of each part", constant(JITTER_TOLERANCE));
            return table.cell(row, column, found, if self.late { expected } else { constant(JITTER_TOLERANCE) });
        }
        let resample = format!("`resample_hz = {}` in dataset.toml reads stamps that jitter", round_rate(self.mean_s));
        let gaps = "--split-at-gaps makes a flight of each part between gaps";
        let advice = match (self.jitters, self.late) {
            (true, true) => format!("{resample}; {gaps}"),
            (_, false) => resample,
            (false, true) => gaps.to_owned(),
        };
        let found = if self.jitters { format!("{found} ({} of {} steps are uneven)", self.uneven, self.of) } else { found };
        table.cell(row, column, found, format!("{}; {advice}", constant(STEP_TOLERANCE)))
    }
}

/// The rate of a step with two digits.
fn round_rate(step_s: f64) -> f64 {
    format!("{:.1e}", step_s.recip()).parse().unwrap_or_else(|_| step_s.recip())
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
        let clock = Clock { resampled, ..Clock::default() };
        parts(&table(times.len()), "t", times, clock).map_or_else(|error| error.to_string(), |_| "accepted".into())
    }

    #[test]
    fn a_decimal_step_is_found_exactly_whatever_the_start() -> Result<()> {
        for start in [0.0, 17.23, 1_218_000_000.5] {
            let times: Vec<f64> = (0..5000).map(|k| start + 0.01 * f64::from(k)).collect();
            let parts = parts(&table(5000), "t", &times, Clock::default())?;
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
        let text = message(&jitter, false);
        let parts = ["a step of 0.011000 s where the flight's is 0.01", "within 1 %; `resample_hz = 100` in dataset.toml"];
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        assert_eq!(message(&jitter, true), "accepted");
        assert!(message(&[0.0], false).contains("a single row"));
        assert!(message(&[0.0, f64::NAN], false).contains("steps back"));
    }

    #[test]
    fn time_in_another_unit_is_named() {
        let stamps = |step: f64| (0..50).map(|k| 3.0 + step * f64::from(k)).collect::<Vec<f64>>();
        for (step, unit, rate) in [(10.0, "ms", 100), (1.0, "ms", 1000), (1e4, "us", 100), (2500.0, "us", 400), (1e7, "ns", 100)] {
            let text = message(&stamps(step), false);
            let expected = format!("if time is in {unit}, which would be {rate} Hz, say [units] t = \"{unit}\"");
            assert!(text.contains(&expected) && text.contains("line 3, column `t`"), "{text}");
        }
        // The unit that is stated is what is wrong, not one to be stated.
        let stated = Clock { unit: Some("ns"), ..Clock::default() };
        let text = parts(&table(50), "t", &stamps(1e-11), stated).map_or_else(|error| error.to_string(), |_| "accepted".into());
        assert!(text.contains("`[units] t = \"ns\"` in dataset.toml does not fit"), "{text}");
        assert!(message(&stamps(1e-302), false).contains("repeats"), "rounding swallows it");
        assert!(message(&[0.0, 1e-302, 2e-302], false).contains("2 to 100000 samples a second"));
    }

    #[test]
    fn jitter_is_not_cut_into_pieces() {
        let jitter: Vec<f64> = (0..200).map(|k| 0.01 * (f64::from(k) + 0.1 * f64::from(k).sin())).collect();
        let split = Clock { split: true, ..Clock::default() };
        let text = parts(&table(200), "t", &jitter, split).map_or_else(|error| error.to_string(), |_| "accepted".into());
        assert!(text.contains("steps are uneven") && text.contains("`resample_hz = 100`"), "{text}");
    }

    #[test]
    fn a_part_is_cut_where_it_is_said() -> Result<()> {
        let times: Vec<f64> = (0..10).map(|k| 5.0 + 0.01 * f64::from(k)).collect();
        let whole = parts(&table(10), "t", &times, Clock::default())?;
        let rows = |at_s: &[f64]| cut(whole.clone(), &times, at_s).map(|parts| parts.into_iter().map(|part| part.rows).collect());
        assert_eq!(rows(&[5.07, 5.034, 5.07]), Ok(vec![0..3, 3..7, 7..10]));
        for outside in [4.0, 5.0, 5.2] {
            assert_eq!(rows(&[outside]), Err(outside));
        }
        Ok(())
    }

    #[test]
    fn parts_between_jumps_are_whole() -> Result<()> {
        let parts = parts(&table(5), "t", &[0.0, 0.01, 0.02, 0.52, 0.53], Clock { split: true, ..Clock::default() })?;
        assert_eq!(parts.iter().map(|part| part.rows.clone()).collect::<Vec<_>>(), [0..3, 3..5]);
        assert!((parts[1].gap_before_s - 0.5).abs() <= phyture_kernels::Tolerance::Close.relative_f64());
        Ok(())
    }
}
