//! Streams that hold less than the log they stand in: a value frozen for seconds, one held from each sample of a slower stream to the next, one
//! rounded coarsely, one with more noise in some flights than in the others. All are seen in a column by itself, without physics.

use super::finding::{Finding, Severity, finding};
use super::flights::{CONTROLS, MOST, in_flights, of_all};
use super::lines;
use super::on_change;
use super::robust::{NORMAL, lower_quartile, median};
use super::slew;
use super::told::derived_anew;
use crate::flight::{Column, Flight, Targets};
use std::collections::BTreeMap;
use std::ops::Range;

/// A column that rests this long, s …
const FROZEN_S: f64 = 2.0;
/// … and so many times as long as it usually does, is frozen if the others move.
const UNUSUAL: usize = 20;
/// A stream is held if this share of its rests is a multiple of the usual one.
const REGULAR: f64 = 0.9;
/// Held this long, s, a stream that the physics reads is late by as much as the lags of an aircraft.
const LONG_S: f64 = 0.05;
/// Values that the grain of a flight's column is taken from, at most.
const LOOKED_AT: usize = 4_000;
/// So many samples to each value that occurs, where a column is rounded.
const PER_VALUE: usize = 10;
/// Rounding by this share of the variance of a column is worth a word …
const NOTICED: f64 = 3e-4;
/// … and by this share makes effects of its own.
const COARSE: f64 = 3e-3;
/// Noise is another in some flights if it is so many times that of the others …
const NOISIER: f64 = 5.0;
/// … and this share of what the column does.
const LEAST_NOISE: f64 = 0.03;

/// How findings of held streams begin.
pub(super) const HELD: &str = "held_";
/// How findings of accelerations that are mostly noise begin.
pub(super) const SWAMPED_BY_NOISE: &str = "swamped_";
pub(super) const LINEAR: [Column; 3] = [Column::VxDot, Column::VyDot, Column::VzDot];
pub(super) const ANGULAR: [Column; 3] = [Column::WxDot, Column::WyDot, Column::WzDot];

/// Position matters for the height above ground alone.
pub(super) const POSITION: [Column; 3] = [Column::X, Column::Y, Column::Z];
/// Columns whose rests mean something: a stick may rest.
fn measured() -> impl Iterator<Item = Column> {
    Column::ALL.into_iter().filter(|column| !CONTROLS.contains(column))
}

/// What the physics is driven by.
fn driving() -> impl Iterator<Item = Column> {
    Column::ALL.into_iter().filter(|column| !POSITION.contains(column) && !Column::TARGETS.contains(column))
}

/// Where noise is looked for: the heading jumps by a turn.
const NOISY: [Column; 8] = [Column::Roll, Column::Pitch, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];
/// White noise that is this share of a stick's root mean square is worth a word …
const ROUGH: f64 = 0.2;
/// … and that is this share makes lags of its own.
const SWAMPED: f64 = 0.5;

/// Frozen, held, rounded and noisy columns.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let present = |column: &Column| flights.iter().all(|flight| !flight.absent.contains(column));
    let grains: Vec<(Column, Grains)> = driving().filter(present).map(|column| (column, Grains::of(flights, column))).collect();
    let is_rounded = |column: Column| grains.iter().any(|entry| entry.0 == column && entry.1.steps.iter().any(Option::is_some));
    let mut findings = Vec::new();
    let mut held: Vec<(Hold, Vec<Column>)> = Vec::new();
    let rests: Vec<(Column, Rests)> = measured().filter(present).map(|column| (column, Rests::of(flights, column))).collect();
    let resting = rests.iter().filter(|entry| !is_rounded(entry.0)).map(|(column, rests)| (*column, rests.resting()));
    let sent = on_change::findings(flights, resting);
    for (column, rests) in rests {
        // One that is sent on change rests as long as nothing changes.
        if !sent.iter().any(|entry| entry.1.contains(&column)) {
            findings.extend(rests.frozen(flights, column));
        }
        let Some(hold) = rests.held(flights).filter(|_| !is_rounded(column)) else { continue };
        match held.iter_mut().find(|(other, _)| *other == hold) {
            Some((_, columns)) => columns.push(column),
            None => held.push((hold, vec![column])),
        }
    }
    // A stick that rests does so for any time; one that comes from a slower stream for whole periods of that.
    for column in CONTROLS.into_iter().filter(present).filter(|column| !is_rounded(*column)) {
        let Some(hold) = Rests::of(flights, column).held(flights).filter(|hold| hold.seconds > LONG_S) else { continue };
        match held.iter_mut().find(|(other, _)| *other == hold) {
            Some((_, columns)) => columns.push(column),
            None => held.push((hold, vec![column])),
        }
    }
    findings.extend(held.into_iter().filter_map(|(hold, columns)| of_hold(flights, &hold, &columns)));
    findings.extend(sent.into_iter().map(|entry| entry.0));
    findings.extend(slew::findings(flights, &|column| is_rounded(column)));
    findings.extend(lines::findings(flights, &|column| is_rounded(column)));
    let rounded: Vec<(Column, Finding)> =
        grains.into_iter().filter_map(|(column, grains)| Some((column, grains.finding(flights, column)?))).collect();
    // Steps of rounding look like noise.
    let is_smooth = |column: &Column| !rounded.iter().any(|(other, finding)| other == column && finding.verdict == Severity::Fault);
    let recorded = flights.iter().all(|flight| flight.targets == Targets::Recorded);
    let looked_at = NOISY.into_iter().chain(CONTROLS).chain(Column::TARGETS.into_iter().filter(|_| recorded));
    let noisy = looked_at.filter(present).filter(is_smooth).filter_map(|column| noise(flights, column));
    let noisy: Vec<Finding> =
        noisy.chain(CONTROLS.into_iter().filter(is_smooth).filter_map(|column| rough(flights, column))).collect();
    findings.extend(rounded.into_iter().map(|(_, finding)| finding));
    findings.extend(noisy);
    if recorded {
        findings.extend([LINEAR, ANGULAR].into_iter().filter_map(|targets| swamped(flights, targets)));
    }
    findings
}

/// How long a column keeps a value in each flight: how often for each number of samples, and the longest time.
struct Rests {
    counts: Vec<BTreeMap<usize, usize>>,
    longest: Vec<Range<usize>>,
}

/// A stream that is held for so long in these flights; in all of them if there are none.
#[derive(PartialEq)]
struct Hold {
    seconds: f64,
    flights: Vec<usize>,
}

impl Rests {
    fn of(flights: &[Flight], column: Column) -> Self {
        let of_flight = |flight: &Flight| {
            let mut counts = BTreeMap::new();
            let (mut longest, mut start) = (0..0, 0);
            for rest in flight.column(column).chunk_by(|one, next| one == next) {
                *counts.entry(rest.len()).or_insert(0) += 1;
                if rest.len() > longest.len() {
                    longest = start..start + rest.len();
                }
                start += rest.len();
            }
            flight.rest();
            (counts, longest)
        };
        let (counts, longest) = flights.iter().map(of_flight).unzip();
        Self { counts, longest }
    }

    /// Flights in which most samples are those before them.
    fn resting(&self) -> Vec<usize> {
        let rests = |counts: &BTreeMap<usize, usize>| {
            let samples: usize = counts.iter().map(|(length, count)| length * count).sum();
            2 * counts.values().sum::<usize>() < samples
        };
        self.counts.iter().enumerate().filter(|entry| rests(entry.1)).map(|entry| entry.0).collect()
    }

    /// The rest to which half of all samples belong at most.
    fn usual(&self) -> usize {
        let mut all: BTreeMap<usize, usize> = BTreeMap::new();
        self.counts.iter().flatten().for_each(|(length, count)| *all.entry(*length).or_default() += length * count);
        let samples: usize = all.values().sum();
        let mut sum = 0;
        let reached = all.iter().find(|(_, samples_of)| {
            sum += **samples_of;
            2 * sum >= samples
        });
        reached.map_or(1, |(length, _)| *length)
    }

    fn frozen(&self, flights: &[Flight], column: Column) -> Option<Finding> {
        let usual = self.usual();
        let is_frozen = |(index, rest): &(usize, &Range<usize>)| {
            let flight = &flights[*index];
            let is_unusual = rest.len() >= UNUSUAL * usual || rest.len() == flight.len();
            let frozen = rest.len() as f64 * flight.step_s >= FROZEN_S && is_unusual && others_move(flight, column, rest);
            flight.rest();
            frozen
        };
        let such: Vec<usize> = self.longest.iter().enumerate().filter(is_frozen).map(|entry| entry.0).collect();
        let longest = such.iter().map(|&index| self.longest[index].len() as f64 * flights[index].step_s).fold(0.0, f64::max);
        let name = column.name();
        let message = format!(
            "{name} is frozen: it keeps one value for up to {longest:.1} s while the rest moves, as where it was not recorded"
        );
        let is_set = such.len() as f64 > MOST * flights.len() as f64;
        let missing = format!("ignore = [{name:?}], missing = [{name:?}]");
        let set = (POSITION.contains(&column) || column == Column::Yaw).then_some(missing.as_str());
        match such.as_slice() {
            [] => None,
            _ if is_set => Some(finding(&format!("frozen_{name}"), Severity::Fault, message, set)),
            some => Some(in_flights(&format!("frozen_{name}"), some, &message, flights)),
        }
    }

    /// Time for which each value is held, if the column comes from a slower stream.
    fn held(&self, flights: &[Flight]) -> Option<Hold> {
        let of_flight = |counts: &BTreeMap<usize, usize>| {
            let (&hold, _) = counts.iter().max_by_key(|(_, count)| **count)?;
            let rests: usize = counts.values().sum();
            let regular: usize = counts.iter().filter(|(length, _)| **length % hold == 0).map(|entry| entry.1).sum();
            // One that never changes is frozen, or not there.
            (hold >= 2 && rests > 2 && regular as f64 >= REGULAR * rests as f64).then_some(hold)
        };
        let each: Vec<(usize, usize)> =
            self.counts.iter().enumerate().filter_map(|(index, counts)| Some((index, of_flight(counts)?))).collect();
        let hold = median(each.iter().map(|entry| entry.1 as f64).collect())?;
        let such: Vec<usize> = each.iter().filter(|entry| entry.1 as f64 == hold).map(|entry| entry.0).collect();
        let seconds = hold * flights[*such.first()?].step_s;
        let is_set = such.len() as f64 > MOST * flights.len() as f64;
        Some(Hold { seconds, flights: if is_set { Vec::new() } else { such } })
    }
}

/// Whether most other measured columns change within these samples.
fn others_move(flight: &Flight, column: Column, samples: &Range<usize>) -> bool {
    let others = measured().filter(|other| *other != column && !flight.absent.contains(other));
    let moves = |other: Column| {
        let values = &flight.column(other)[samples.clone()];
        values.windows(2).filter(|pair| pair[0] != pair[1]).count() * 4 > values.len()
    };
    let (moving, resting): (Vec<Column>, Vec<Column>) = others.partition(|&other| moves(other));
    moving.len() > resting.len()
}

fn of_hold(flights: &[Flight], hold: &Hold, columns: &[Column]) -> Option<Finding> {
    let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
    let matters = columns.iter().any(|column| !POSITION.contains(column)) && hold.seconds > LONG_S;
    let (name, rate_hz) = (format!("{HELD}{}", names[0]), 1.0 / hold.seconds);
    let message = format!(
        "{} come at {rate_hz:.3} Hz and are held in between: half of {:.0} ms late on the average",
        names.join(", "),
        1e3 * hold.seconds
    );
    match hold.flights.as_slice() {
        [] => {
            let verdict = if matters { Severity::Fault } else { Severity::Warning };
            let set = resampled(flights, columns, rate_hz).or_else(|| bridged(columns, hold.seconds));
            Some(finding(&name, verdict, message, set.as_deref()))
        }
        some => matters.then(|| in_flights(&name, some, &message, flights)),
    }
}

/// The line that brings a log to the rate of its slow streams; `None` where another stream that drives the physics is faster, which would be lost with that: in all
/// flights some such column changes in most rows.
pub(super) fn resampled(flights: &[Flight], slow: &[Column], rate_hz: f64) -> Option<String> {
    let is_faster = |column: Column| {
        let moves = |flight: &Flight| {
            let values = flight.column(column);
            let is_so = 2 * values.windows(2).filter(|pair| pair[0] != pair[1]).count() > values.len();
            flight.rest();
            is_so
        };
        flights.iter().all(moves)
    };
    let is_lost = driving().filter(|column| !slow.contains(column)).any(is_faster);
    (!is_lost).then(|| format!("resample_hz = {rate_hz:.3}"))
}

/// The line that joins samples of a slower stream, beside faster ones. A stick may well have rested.
fn bridged(slow: &[Column], held_s: f64) -> Option<String> {
    let names: Vec<&str> = slow.iter().map(|column| column.name()).collect();
    let is_stick = slow.iter().any(|column| CONTROLS.contains(column));
    let longest_s = 1.5 * held_s;
    (!is_stick).then(|| {
        format!(
            "[[repair]] columns = {names:?}, held = true, max_gap_s = {longest_s:.3}, between = \"cubic\", with the file's names"
        )
    })
}

/// The step to which a column is rounded, in each flight where it is, and the flights that tell.
struct Grains {
    steps: Vec<Option<f64>>,
    telling: usize,
}

impl Grains {
    fn of(flights: &[Flight], column: Column) -> Self {
        let of_flight = |flight: &Flight| {
            let every = flight.len().div_ceil(LOOKED_AT).max(1);
            let values = flight.column(column).iter().copied().step_by(every).collect();
            flight.rest();
            grain(values)
        };
        let found: Vec<(bool, Option<f64>)> = flights.iter().map(of_flight).collect();
        Self { telling: found.iter().filter(|entry| entry.0).count(), steps: found.into_iter().map(|entry| entry.1).collect() }
    }

    fn finding(&self, flights: &[Flight], column: Column) -> Option<Finding> {
        // In the quieter flights it matters first.
        let each = (0..flights.len()).map(|index| variance(&flights[index..=index], column));
        let variance = lower_quartile(each.filter(|variance| *variance > 0.0).collect())?;
        // An error that is as likely anywhere within a step has a twelfth of its square as variance.
        let share = |step: f64| step * step / 12.0 / variance;
        let noticed = |(index, step): (usize, &Option<f64>)| step.filter(|step| share(*step) > NOTICED).map(|step| (index, step));
        let such: Vec<(usize, f64)> = self.steps.iter().enumerate().filter_map(noticed).collect();
        let step = median(such.iter().map(|entry| entry.1).collect())?;
        let name = column.name();
        let message = format!(
            "{name} is rounded to {step:.3}, {:.1} % of its variance: what it moves comes out too small by about that, and the rounding can look \
             like an effect of that size",
            100.0 * share(step)
        );
        let is_coarse = share(step) > COARSE && share(step).is_finite();
        if such.len() as f64 > MOST * self.telling as f64 {
            let verdict = if is_coarse { Severity::Fault } else { Severity::Warning };
            return Some(finding(&format!("rounding_{name}"), verdict, message, None));
        }
        let indices: Vec<usize> = such.into_iter().map(|entry| entry.0).collect();
        is_coarse.then(|| in_flights(&format!("rounding_{name}"), &indices, &message, flights))
    }
}

/// Whether there are values enough to tell, and the step that all are whole multiples apart by, if they are.
pub(super) fn grain(mut values: Vec<f64>) -> (bool, Option<f64>) {
    let looked_at = values.len();
    values.sort_unstable_by(f64::total_cmp);
    let range = values.last().zip(values.first()).map_or(0.0, |(last, first)| last - first);
    // Conversion of units leaves the last digits open.
    values.dedup_by(|next, before| *next - *before <= 1e-9 * range);
    if values.len() < 3 {
        return (false, None);
    }
    if values.len() * PER_VALUE > looked_at {
        return (true, None);
    }
    let gaps = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let grain = gaps().fold(f64::INFINITY, f64::min);
    let is_whole = |gap: f64| (gap / grain - (gap / grain).round()).abs() < 0.02;
    (true, gaps().all(is_whole).then_some(grain))
}

fn variance(flights: &[Flight], column: Column) -> f64 {
    let (count, sum, square) = of_all(flights, column)
        .fold((0.0, 0.0, 0.0), |(count, sum, square), (value, _)| (count + 1.0, sum + value, square + value * value));
    square / count - (sum / count) * (sum / count)
}

/// Flights in which a column has much more white noise than in the others.
fn noise(flights: &[Flight], column: Column) -> Option<Finding> {
    let each: Vec<f64> = flights.iter().map(|flight| noise_of(flight, column)).collect();
    let usual = lower_quartile(each.clone())?;
    let least = (NOISIER * usual).max(LEAST_NOISE * variance(flights, column).sqrt());
    // In other units the noise is another, too, but no other share.
    let share = |index: usize| each[index] / variance(&flights[index..=index], column).sqrt();
    let usual_share = lower_quartile((0..each.len()).map(share).collect())?;
    let is_one = |&index: &usize| each[index] > least && share(index) > 0.5 * NOISIER * usual_share;
    let such: Vec<usize> =
        (0..each.len()).filter(is_one).filter(|&index| noise_without_leaps(&flights[index], column) > least).collect();
    let size = median(such.iter().map(|&index| each[index]).collect())?;
    let name = column.name();
    let message = format!(
        "{name} has noise of {size:.3} {} (rms), where the others have {usual:.3}: what it moves comes out too small",
        column.unit()
    );
    (such.len() as f64 <= MOST * flights.len() as f64).then(|| in_flights(&format!("noise_{name}"), &such, &message, flights))
}

/// A stick that trembles in most flights: as noise of the log it makes lags of its own; as the command of a controller it is what it is.
fn rough(flights: &[Flight], column: Column) -> Option<Finding> {
    let size = median(flights.iter().map(|flight| noise_of(flight, column)).collect())?;
    let deviation = variance(flights, column).sqrt();
    let share = (size / deviation).powi(2);
    let name = column.name();
    let message = format!(
        "{name} has noise of {size:.3} (rms), {:.0} % of its variance: unless that reaches the servo too, what it moves comes out too small, and late \
         as behind a lag",
        100.0 * share
    );
    let verdict = if size > SWAMPED * deviation { Severity::Fault } else { Severity::Warning };
    (size > ROUGH * deviation).then(|| finding(&format!("noise_{name}"), verdict, message, None))
}

/// Accelerations that are mostly noise, as differences of a noisy velocity are: better derived anew, with what is faster than the aircraft left out.
fn swamped(flights: &[Flight], targets: [Column; 3]) -> Option<Finding> {
    let each = targets.map(|column| {
        Some((median(flights.iter().map(|flight| noise_of(flight, column)).collect())?, variance(flights, column).sqrt()))
    });
    let [x, y, z] = each;
    let each = [x?, y?, z?];
    let share = each.iter().map(|(size, deviation)| (size / deviation).powi(2)).fold(0.0, f64::max);
    let names = targets.map(Column::name);
    let message = format!(
        "{} have noise of up to {:.2} {} (rms), up to {:.0} % of their variance, as differences of neighbouring samples have: what is small in them is not \
         seen; derived anew, with a low-pass, they have less",
        names.join(", "),
        each.iter().map(|(size, _)| *size).fold(0.0, f64::max),
        targets[0].unit(),
        100.0 * share
    );
    let set = derived_anew(&names);
    (share > SWAMPED.powi(2)).then(|| finding(&format!("{SWAMPED_BY_NOISE}{}", names[0]), Severity::Warning, message, Some(&set)))
}

/// Third differences; of white noise their squares are 20 times its own: coefficients 1, 3, 3, 1.
fn third_differences(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    values.windows(4).map(|w| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0])
}

/// Root mean square of white noise, from third differences in the quietest tenth of the seconds: what a vehicle does is smooth there.
fn noise_of(flight: &Flight, column: Column) -> f64 {
    let square = |values: &[f64]| third_differences(values).map(|difference| difference * difference).sum::<f64>();
    quietest(flight, column, |values| (square(values) / (values.len() - 3) as f64 / 20.0).sqrt())
}

/// Leaps make third differences of which the usual one is this part of the root mean square, or less.
const LEAPS: f64 = 0.2;

/// The same, but of a column that leaps now and then by its usual third difference: leaps are no noise.
fn noise_without_leaps(flight: &Flight, column: Column) -> f64 {
    quietest(flight, column, |values| {
        let third: Vec<f64> = third_differences(values).map(f64::abs).collect();
        let square = third.iter().map(|difference| difference * difference).sum::<f64>() / third.len() as f64;
        let usual = NORMAL * median(third).unwrap_or(0.0);
        if usual > 0.0 && usual < LEAPS * square.sqrt() { usual / 20.0_f64.sqrt() } else { (square / 20.0).sqrt() }
    })
}

/// A number of each second of a column, in the quietest tenth of them.
fn quietest(flight: &Flight, column: Column, of_second: impl Fn(&[f64]) -> f64) -> f64 {
    let second = (1.0 / flight.step_s).round().max(8.0) as usize;
    let mut sizes: Vec<f64> = flight.column(column).chunks_exact(second).map(of_second).collect();
    flight.rest();
    sizes.sort_unstable_by(f64::total_cmp);
    sizes.get(sizes.len() / 10).copied().unwrap_or(0.0)
}
