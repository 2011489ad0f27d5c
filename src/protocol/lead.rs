//! By how much one method's error lies below another's, with an interval: both are judged on the same segments of flight, so segments are drawn for both
//! at once, and seeds for each. Arithmetic on outcomes; what stands in which table is `table`'s.

use super::outcome::{Outcome, Segment};
use crate::flight::{Channel, PerChannel};
use phyture_kernels::random::Stream;
use serde::Serialize;

/// Draws of segments and seeds.
const DRAWS: usize = 2000;

/// Where draws come from.
const SEED: u64 = 1;

/// One method held against another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lead {
    /// Identifier of the method in front.
    pub of: String,
    /// Identifier of the other.
    pub over: String,
    /// Its name.
    pub over_name: String,
    /// 100·(1 − E/E'), E being the RMSE's mean over the channels and over seeds; negative where the other is better.
    pub percent: f64,
    /// 95 % interval by bootstrap over segments, the same for both, and over the seeds of each; none of fewer than two segments.
    pub percent_ci95: Option<[f64; 2]>,
}

/// What a lead over the best peer network has to be for the paper's claim (48 % there) to be reproduced, and the lower end of its interval, %.
pub const CLAIM: [f64; 2] = [40.0, 25.0];

impl Lead {
    /// Whether the lead reproduces the paper's claim, and in what words it does or does not.
    pub fn claim(&self) -> &'static str {
        match (self.percent, self.percent_ci95) {
            (percent, Some([low, _])) if percent >= CLAIM[0] && low > CLAIM[1] => "which reproduces the paper's claim",
            (_, Some([low, high])) if low <= 0.0 && high >= 0.0 => "which may be none: the paper's claim is not reproduced",
            (percent, _) if percent < 0.0 => "which is behind: the paper's claim is not reproduced",
            (_, None) => "of too little flight for an interval",
            _ => "which is a lead, and not that of the paper",
        }
    }
}

/// The lead of one method over another, one outcome a seed; `None` if either has none or they were not judged on the same segments.
pub(super) fn lead(of: &[&Outcome], over: &[&Outcome]) -> Option<(f64, Option<[f64; 2]>)> {
    let first = &of.first()?.segments;
    let is_paired = |outcome: &&Outcome| {
        let same = |(one, other): (&Segment, &Segment)| {
            (&one.flight, one.start_s, one.windows) == (&other.flight, other.start_s, other.windows)
        };
        outcome.segments.len() == first.len() && outcome.segments.iter().zip(first).all(same)
    };
    if over.is_empty() || !of.iter().chain(over).all(is_paired) {
        return None;
    }
    let percent = |counts: &[f64], seeds: [&[usize]; 2]| {
        let error = |outcomes: &[&Outcome], seeds: &[usize]| {
            seeds.iter().map(|&seed| mean_rmse(&outcomes[seed].segments, counts)).sum::<f64>() / seeds.len() as f64
        };
        100.0 * (1.0 - error(of, seeds[0]) / error(over, seeds[1]))
    };
    let every = |outcomes: &[&Outcome]| (0..outcomes.len()).collect::<Vec<usize>>();
    let point = percent(&vec![1.0; first.len()], [&every(of), &every(over)]);
    let mut drawn: Vec<f64> = (0..DRAWS)
        .map(|draw| {
            let mut counts = vec![0.0; first.len()];
            for segment in indices(draw, 0, first.len(), first.len()) {
                counts[segment] += 1.0;
            }
            let seeds = [indices(draw, 1, of.len(), of.len()), indices(draw, 2, over.len(), over.len())];
            percent(&counts, [&seeds[0], &seeds[1]])
        })
        .collect();
    drawn.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| drawn[(share * (DRAWS - 1) as f64).round() as usize];
    Some((point, (first.len() > 1).then(|| [at(0.025), at(0.975)])))
}

/// `count` draws of 0 … `below` − 1 with replacement.
fn indices(draw: usize, site: u64, below: usize, count: usize) -> Vec<usize> {
    let stream = Stream::new(SEED, draw as u64, site, 0);
    (0..count as u64).map(|index| ((stream.uniform(index) * below as f64) as usize).min(below - 1)).collect()
}

/// Mean over the channels of the RMSE over segments, each of them taken so many times.
fn mean_rmse(segments: &[Segment], counts: &[f64]) -> f64 {
    let windows: f64 = segments.iter().zip(counts).map(|(segment, count)| segment.windows as f64 * count).sum();
    let mse: PerChannel<f64> = PerChannel::from_fn(|channel| {
        segments.iter().zip(counts).map(|(segment, count)| segment.squares[channel] * count).sum::<f64>() / windows
    });
    mse.values().iter().map(|mse| mse.sqrt()).sum::<f64>() / Channel::COUNT as f64
}

#[cfg(test)]
mod tests {
    use super::super::plan::{Division, Run, Treatment};
    use super::*;

    /// An outcome whose RMSE in segment s is `scale` · (1 + s/10).
    fn outcome(scale: f64, seed: u64, segments: usize) -> Outcome {
        let segment = |index: usize| {
            let error = scale * (1.0 + index as f64 / 10.0);
            Segment {
                flight: "a".into(),
                manoeuvre: "a".into(),
                start_s: 10.0 * index as f64,
                windows: 5,
                squares: PerChannel::splat(5.0 * error * error),
                absolutes: PerChannel::splat(5.0 * error),
                largest: PerChannel::splat(error),
            }
        };
        Outcome {
            run: Run { method: "ridge".into(), division: Division::Benchmark, treatment: Treatment::Plain, seed },
            parameters: 0,
            training_windows: 0,
            steps: 0,
            effects: Vec::new(),
            peak_rate: None,
            curve: Vec::new(),
            epoch: 0,
            segments: (0..segments).map(segment).collect(),
            trace: None,
        }
    }

    #[test]
    fn what_is_proportional_segment_by_segment_has_a_lead_without_doubt() {
        let (half, whole) = (outcome(0.5, 1, 20), outcome(1.0, 1, 20));
        let (percent, interval) = lead(&[&half], &[&whole]).expect("both are judged on the same segments");
        let [low, high] = interval.expect("twenty segments");
        assert!((percent - 50.0).abs() < 1e-9 && (low - 50.0).abs() < 1e-9 && (high - 50.0).abs() < 1e-9);
        assert!(lead(&[&whole], &[&half]).is_some_and(|(percent, _)| (percent + 100.0).abs() < 1e-9));
    }

    #[test]
    fn a_claim_is_judged_by_the_lead_and_by_its_interval() {
        let claim = |percent: f64, low: f64, high: f64| {
            let of = |name: &str| name.to_owned();
            Lead { of: of("a"), over: of("b"), over_name: of("B"), percent, percent_ci95: Some([low, high]) }.claim()
        };
        assert!(claim(45.0, 30.0, 55.0).contains("reproduces the paper's claim"));
        assert!(
            claim(45.0, 20.0, 60.0).contains("not that of the paper") && claim(10.0, 4.0, 16.0).contains("not that of the paper")
        );
        assert!(claim(9.0, -2.0, 20.0).contains("may be none") && claim(-9.0, -20.0, -2.0).contains("behind"));
    }

    #[test]
    fn seeds_that_differ_widen_the_interval_and_other_segments_give_none() {
        let (one, other, whole) = (outcome(0.4, 1, 20), outcome(0.6, 2, 20), outcome(1.0, 1, 20));
        let (percent, interval) = lead(&[&one, &other], &[&whole]).expect("paired");
        let [low, high] = interval.expect("twenty segments");
        assert!((percent - 50.0).abs() < 1e-9 && low <= 40.0 + 1e-9 && high >= 60.0 - 1e-9, "[{low}, {high}]");
        assert!(lead(&[&one], &[&outcome(1.0, 1, 19)]).is_none() && lead(&[&one], &[]).is_none());
        assert!(lead(&[&outcome(1.0, 1, 1)], &[&outcome(2.0, 1, 1)]).is_some_and(|(_, interval)| interval.is_none()));
    }
}
