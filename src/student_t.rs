//! The quantiles of Student's t that intervals need: the one place for them. No other statistics.

/// The 97.5 % quantile of Student's t with `degrees` degrees of freedom, which need not be whole; between 0 and 1 they
/// count as 1, and without any the quantile is infinite.
///
/// Newton's steps on the distribution function, 1/2 + sign(t) (1 - I_x(ν/2, 1/2)) / 2 with x = ν/(ν + t²), and bisection where they leave the bracket.
pub fn quantile_975(degrees: f64) -> f64 {
    upper_quantile(0.025, degrees)
}

/// The value that Student's t exceeds with probability `tail`, above 0 and at most one half; degrees as of [`quantile_975`].
pub fn upper_quantile(tail: f64, degrees: f64) -> f64 {
    if degrees <= 0.0 {
        return f64::INFINITY;
    }
    let degrees = if degrees >= 1.0 { degrees.min(1e7) } else { 1.0 };
    let upper_tail = |t: f64| 0.5 * incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
    // 12.706… is the value for one degree of freedom and 2.5 %.
    let (mut low, mut high) = (0.0, 13.0);
    while upper_tail(high) > tail {
        (low, high) = (high, 2.0 * high);
    }
    // Γ((ν + 1)/2) / (√(νπ) Γ(ν/2)) · (1 + t²/ν)^(-(ν + 1)/2)
    let half = 0.5 * (degrees + 1.0);
    let front = log_gamma(half) - log_gamma(0.5 * degrees) - 0.5 * (std::f64::consts::PI * degrees).ln();
    let density = |t: f64| (front - half * (t * t / degrees).ln_1p()).exp();
    let mut t = 0.5 * (low + high);
    for _ in 0..100 {
        let excess = upper_tail(t) - tail;
        if excess > 0.0 {
            low = t
        } else {
            high = t
        }
        let newton = t + excess / density(t);
        let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
        if (next - t).abs() <= 64.0 * f64::EPSILON * t {
            return next;
        }
        t = next;
    }
    t
}

/// Regularised incomplete beta function I_x(a, b), by its continued fraction (Abramowitz & Stegun 26.5.8, modified Lentz).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let log_front = log_gamma(a + b) - log_gamma(a) - log_gamma(b) + a * x.ln() + b * (-x).ln_1p();
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - log_front.exp() * continued_fraction(b, a, 1.0 - x) / b;
    }
    log_front.exp() * continued_fraction(a, b, x) / a
}

fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let away = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / away(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..=500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        for coefficient in [even, odd] {
            d = 1.0 / away(1.0 + coefficient * d);
            c = away(1.0 + coefficient / c);
            fraction *= c * d;
        }
        if (c * d - 1.0).abs() < 4.0 * f64::EPSILON {
            break;
        }
    }
    fraction
}

/// ln Γ(x) for x > 0: shift above 10, then Stirling's series (Abramowitz & Stegun 6.1.41).
fn log_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift += x.ln();
        x += 1.0;
    }
    let inverse = 1.0 / (x * x);
    let series =
        (1.0 / 12.0 - inverse * (1.0 / 360.0 - inverse * (1.0 / 1260.0 - inverse * (1.0 / 1680.0 - inverse / 1188.0)))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - shift
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    #[test]
    fn quantiles_have_their_closed_forms() {
        let probability = 0.975_f64;
        // One degree: Cauchy, tan(pi (p - 1/2)). Two: (2p - 1) sqrt(2 / (1 - (2p - 1)^2)). Many: the normal quantile.
        let centred: f64 = 2.0 * probability - 1.0;
        let two = centred * (2.0 / (1.0 - centred * centred)).sqrt();
        for (degrees, expected) in [(1.0, (std::f64::consts::PI * (probability - 0.5)).tan()), (2.0, two)] {
            let found = quantile_975(degrees);
            assert!((found - expected).abs() < Tolerance::Approximate.relative_f64() * expected, "{degrees}: {found} {expected}");
        }
        assert!((quantile_975(1e7) - 1.959_963_984_540_054).abs() < 10.0 * Tolerance::Approximate.relative_f64());
    }

    #[test]
    fn what_exceeds_a_quantile_is_the_tail() {
        for degrees in [1.0_f64, 1.3, 2.0, 3.7, 8.0, 50.0, 1e4] {
            for tail in [1e-12, 1e-6, 0.001, 0.025, 0.2, 0.4, 0.5] {
                let t = upper_quantile(tail, degrees);
                let found = 0.5 * incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
                assert!((found - tail).abs() < Tolerance::Approximate.relative_f64() * tail, "{degrees} {tail}: {t} {found}");
            }
        }
    }

    #[test]
    fn quantiles_fall_with_the_degrees_of_freedom() {
        let values: Vec<f64> = [1.0, 1.5, 2.0, 5.0, 9.3, 19.0, 40.0, 1000.0].into_iter().map(quantile_975).collect();
        assert!(values.windows(2).all(|pair| pair[0] > pair[1]), "{values:?}");
    }

    #[test]
    fn quantiles_fall_to_the_normal_one() {
        // Published values: t(0.975; 11) = 2.201, (30) = 2.042, (120) = 1.980; three decimals are printed.
        for (degrees, published) in [(11, 2.201), (30, 2.042), (120, 1.980)] {
            assert_eq!(format!("{:.3}", quantile_975(degrees as f64)), format!("{published:.3}"));
        }
        assert!((1..200).all(|degrees| quantile_975(degrees as f64) > quantile_975((degrees + 1) as f64)));
    }
}
