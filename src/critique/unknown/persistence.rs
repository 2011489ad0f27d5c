//! Does a fitted dependence add to what the residual's own past already tells?
//!
//! A gust lasts, moves the aircraft, and through the pilot the sticks, while it still acts. So state and sticks "explain" part of
//! a residual that they did not cause. What tells the two apart is time: the state at an instant was decided by gusts *before*
//! it, so once the residual's own past is known, a consequence of the residual adds nothing, while a cause still does. No trees
//! here, and no statement about significance.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Past rows of the residual that are taken as known.
const PAST: usize = 4;
/// Most repetitions; a few are enough.
const REPETITIONS: usize = 20;

/// Second moments of residual and fit over pairs of lags, about their means.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    rr: DMatrix<f64>,
    /// Row: lag of the residual, column: lag of the fit.
    rf: DMatrix<f64>,
    ff: DMatrix<f64>,
    /// Σ of the instrument at t times residual and fit, by the lag of these.
    zr: DVector<f64>,
    zf: DVector<f64>,
    /// Σ r², Σ r f, Σ f² about the means over all rows, not only those with a whole past.
    plain: [f64; 3],
}

impl Moments {
    /// `residual` and `fit` are those of all rows of the table, `instrument` is the fit at the start of each row; counted are the rows
    /// of `blocks`.
    pub(super) fn new(blocks: &[Range<usize>], residual: &[f64], fit: &[f64], instrument: &[f64]) -> Self {
        let of = |values: &[f64], range: &Range<usize>| values.get(range.clone()).map(<[f64]>::to_vec).unwrap_or_default();
        let count: usize = blocks.iter().map(ExactSizeIterator::len).sum();
        let mean = |values: &[f64]| blocks.iter().flat_map(|range| of(values, range)).sum::<f64>() / count.max(1) as f64;
        let (mean_r, mean_f, mean_z) = (mean(residual), mean(fit), mean(instrument));
        let zero = || DMatrix::zeros(PAST + 1, PAST + 1);
        let none = || DVector::zeros(PAST + 1);
        let mut moments = Self { rr: zero(), rf: zero(), ff: zero(), zr: none(), zf: none(), plain: [0.0; 3] };
        for range in blocks {
            let r: Vec<f64> = of(residual, range).iter().map(|value| value - mean_r).collect();
            let f: Vec<f64> = of(fit, range).iter().map(|value| value - mean_f).collect();
            for (r, f) in r.iter().zip(&f) {
                moments.plain[0] += r * r;
                moments.plain[1] += r * f;
                moments.plain[2] += f * f;
            }
            let z = of(instrument, range);
            for ((r, f), z) in r.windows(PAST + 1).zip(f.windows(PAST + 1)).zip(z.iter().skip(PAST)) {
                for i in 0..=PAST {
                    moments.zr[i] += (z - mean_z) * r[PAST - i];
                    moments.zf[i] += (z - mean_z) * f[PAST - i];
                    for j in 0..=PAST {
                        let (r_i, r_j, f_i, f_j) = (r[PAST - i], r[PAST - j], f[PAST - i], f[PAST - j]);
                        moments.rr[(i, j)] += r_i * r_j;
                        moments.rf[(i, j)] += r_i * f_j;
                        moments.ff[(i, j)] += f_i * f_j;
                    }
                }
            }
        }
        moments
    }

    /// The factor κ of the fit f that remains once the residual's past is known:
    /// κ = Σ z_t (r_t − Σ φᵢ r_{t−i}) / Σ z_t (f_t − Σ φᵢ f_{t−i}), i = 1 … [`PAST`], with z the fit at the start of the row and φ the
    /// autoregression of r − κ f; solved by repetition from κ = 1 and kept within 0 … 1.
    ///
    /// An instrumental variable: what r's past does not predict is independent of all that happened before, so its product with z
    /// vanishes where f is a consequence of r's past. About 1 for a cause. Least squares on whitened series would do the same with less
    /// scatter, but it weighs the jumps of a fit by trees a hundred times as much as what the fit gets right.
    pub(super) fn factor(&self) -> f64 {
        let mut factor = 1.0;
        for _ in 0..REPETITIONS {
            let n = &self.rr - (&self.rf + self.rf.transpose()) * factor + &self.ff * (factor * factor);
            let past = autoregression(&n);
            let whitened = |by_lag: &DVector<f64>| by_lag[0] - (1..=PAST).map(|lag| past[lag - 1] * by_lag[lag]).sum::<f64>();
            let (above, below) = (whitened(&self.zr), whitened(&self.zf));
            let next = if below > 0.0 { (above / below).clamp(0.0, 1.0) } else { 0.0 };
            if (next - factor).abs() < 1e-3 {
                return next;
            }
            factor = next;
        }
        factor
    }

    /// 1 − Σ (r − κ f)² / Σ r² about the means; 0 for a residual that does not vary.
    pub(super) fn r2(&self, factor: f64) -> f64 {
        let [rr, rf, ff] = self.plain;
        if rr > 0.0 { (2.0 * factor * rf - factor * factor * ff) / rr } else { 0.0 }
    }
}

/// Factors φ of the least-squares prediction of a series from its [`PAST`] last values, from its second moments by lag.
fn autoregression(moments: &DMatrix<f64>) -> DVector<f64> {
    let past = moments.view((1, 1), (PAST, PAST)).into_owned();
    let cross = DVector::from_iterator(PAST, (1..=PAST).map(|lag| moments[(lag, 0)]));
    let ridge = 1e-9 * past.trace() / PAST as f64 + f64::MIN_POSITIVE;
    let past = past + DMatrix::identity(PAST, PAST) * ridge;
    past.cholesky().map_or_else(|| DVector::zeros(PAST), |factor| factor.solve(&cross))
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::random::Stream;

    /// First-order noise with correlation 0.8 from row to row, and a slow cause.
    fn noise(seed: u64, rows: usize, keep: f64) -> Vec<f64> {
        let stream = Stream::new(seed, 0, 0, 0);
        let mut value = 0.0;
        (0..rows as u64)
            .map(|row| {
                value = keep * value + (1.0 - keep * keep).sqrt() * 3.46 * (stream.uniform(row) - 0.5);
                value
            })
            .collect()
    }

    fn blocks(rows: usize) -> Vec<Range<usize>> {
        (0..rows / 200).map(|block| block * 200..(block + 1) * 200).collect()
    }

    #[test]
    fn a_cause_keeps_its_factor() {
        for seed in 0..5 {
            let (gust, cause) = (noise(seed, 8000, 0.8), noise(seed + 100, 8000, 0.97));
            let residual: Vec<f64> = gust.iter().zip(&cause).map(|(gust, cause)| gust + 0.5 * cause).collect();
            let fit: Vec<f64> = cause.iter().map(|cause| 0.5 * cause).collect();
            let moments = Moments::new(&blocks(8000), &residual, &fit, &fit);
            let factor = moments.factor();
            assert!((0.8..1.2).contains(&factor), "{factor}");
            assert!((moments.r2(1.0) - 0.2).abs() < 0.08, "{}", moments.r2(1.0));
        }
    }

    #[test]
    fn a_consequence_loses_it() {
        for seed in 0..5 {
            // A speed that integrates the residual of earlier rows, with a damping.
            let gust = noise(seed, 8000, 0.8);
            let mut speed = 0.0;
            let speeds: Vec<f64> = gust
                .iter()
                .map(|gust| {
                    let before = speed;
                    speed = 0.9 * speed + 0.1 * gust;
                    before
                })
                .collect();
            let fit: Vec<f64> = speeds.iter().map(|speed| 0.9 * speed).collect();
            let moments = Moments::new(&blocks(8000), &gust, &fit, &fit);
            assert!(moments.r2(1.0) > 0.2, "the dependence is there: {}", moments.r2(1.0));
            assert!(moments.factor() < 0.35, "{}", moments.factor());
        }
    }

    #[test]
    fn nothing_is_nothing() {
        let moments = Moments::new(&blocks(400), &[0.0; 400], &[0.0; 400], &[0.0; 400]);
        assert!(moments.factor() == 0.0 && moments.r2(1.0) == 0.0);
        assert!(Moments::new(&[], &[], &[], &[]).r2(1.0) == 0.0);
    }
}
