//! Axes as numbers: where a value lies between the ends of an axis, and at which round values ticks stand. No drawing.

/// One axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value at the lower end; above zero on a logarithmic axis.
    pub low: f64,
    /// Value at the upper end, above `low`.
    pub high: f64,
    /// Whether equal ratios are equally far apart, not equal differences.
    pub log: bool,
}

/// A tick: the value, and how it is written.
pub type Tick = (f64, String);

impl Scale {
    /// An axis from one value to another. Ends that are equal or not finite are moved apart, so that something can be drawn.
    pub fn linear(low: f64, high: f64) -> Self {
        let (low, high) = if low.is_finite() && high.is_finite() { (low.min(high), low.max(high)) } else { (0.0, 1.0) };
        if high - low > f64::EPSILON * low.abs().max(high.abs()) {
            return Self { low, high, log: false };
        }
        let room = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
        Self { low: low - room, high: high + room, log: false }
    }

    /// An axis that holds all finite values with a little room beyond.
    pub fn around(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = ends(values);
        let room = 0.04 * (high - low);
        Self::linear(low - room, high + room)
    }

    /// A logarithmic axis that holds all positive finite values, over six decades at most: what is lower lies at the lower end.
    pub fn decades(values: impl Iterator<Item = f64>) -> Self {
        const DECADES: f64 = 1e6;
        let (low, high) = ends(values.filter(|value| *value > 0.0));
        if !(low > 0.0 && high.is_finite()) {
            return Self { low: 0.1, high: 10.0, log: true };
        }
        Self { low: low.max(high / DECADES) / 1.3, high: high * 1.3, log: true }
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper, beyond them outside.
    pub fn place(&self, value: f64) -> f64 {
        if self.log {
            return (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln();
        }
        (value - self.low) / (self.high - self.low)
    }

    /// About `count` ticks at 1, 2 or 5 times a power of ten; on a logarithmic axis at powers of ten, where there are two.
    pub fn ticks(&self, count: usize) -> Vec<Tick> {
        let powers = if self.log { self.powers(count) } else { Vec::new() };
        if powers.len() > 1 {
            return powers;
        }
        let step = round_step((self.high - self.low) / count.max(1) as f64);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let (first, last) = ((self.low / step - 1e-9).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        let written = |value: f64| {
            // No minus before nothing.
            let value = if value.abs() < 0.5 * step { 0.0 } else { value };
            let size = self.low.abs().max(self.high.abs());
            if !(1e-3..1e5).contains(&size) { format!("{value:.1e}") } else { format!("{value:.decimals$}").replace('-', "−") }
        };
        (first..=last).map(|number| number as f64 * step).map(|value| (value, written(value))).collect()
    }

    fn powers(&self, count: usize) -> Vec<Tick> {
        let (first, last) = (self.low.log10().ceil() as i32, self.high.log10().floor() as i32);
        let every = ((last - first + 1).max(1) as usize).div_ceil(count.max(1));
        let written = |power: i32| {
            if (-3..4).contains(&power) { format!("{}", 10_f64.powi(power)) } else { format!("1e{power}").replace('-', "−") }
        };
        (first..=last).step_by(every).map(|power| (10_f64.powi(power), written(power))).collect()
    }
}

/// The smallest and the largest finite value; not finite where there is none.
pub fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let finite = values.filter(|value| value.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// The smallest of 1, 2, 5 times a power of ten that is no less than `wanted`.
fn round_step(wanted: f64) -> f64 {
    let power = 10_f64.powf(wanted.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| *step >= wanted * (1.0 - 1e-9)).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ticks_are_round_and_written_short() {
        let written = |scale: Scale, count: usize| scale.ticks(count).into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(written(Scale::linear(-0.31, 0.52), 5), ["−0.2", "0.0", "0.2", "0.4"].map(str::to_owned));
        assert_eq!(written(Scale::linear(0.0, 20.0), 4), ["0", "5", "10", "15", "20"].map(str::to_owned));
        let decades = Scale { low: 2e-5, high: 30.0, log: true };
        assert_eq!(written(decades, 9), ["1e−4", "0.001", "0.01", "0.1", "1", "10"].map(str::to_owned));
        // Within a decade there are ticks all the same.
        assert_eq!(written(Scale { low: 17.0, high: 42.0, log: true }, 4), ["20", "30", "40"].map(str::to_owned));
        assert!((decades.place(30.0) - 1.0).abs() < 1e-12 && decades.place(2e-5).abs() < 1e-12);
    }

    #[test]
    fn an_axis_of_nothing_or_of_one_value_still_has_a_length() {
        for scale in [Scale::around([].into_iter()), Scale::around([3.0].into_iter()), Scale::around([0.0, f64::NAN].into_iter())] {
            assert!(scale.high > scale.low && scale.ticks(4).len() > 1, "{scale:?}");
        }
    }

    proptest! {
        #[test]
        fn ticks_lie_on_the_axis_and_are_few(low in -1e4..1e4_f64, length in 1e-3..1e4_f64, count in 3..8_usize) {
            let scale = Scale::linear(low, low + length);
            let ticks = scale.ticks(count);
            prop_assert!(!ticks.is_empty() && ticks.len() <= count + 1, "{ticks:?}");
            prop_assert!(ticks.iter().all(|(value, _)| (-1e-6..=1.0 + 1e-6).contains(&scale.place(*value))));
        }
    }
}
