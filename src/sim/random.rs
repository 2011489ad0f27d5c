//! Random numbers of the simulator: one small generator, seeded by purpose. No physics here.
//!
//! Each flight and, within it, each purpose (pilot, gusts, sensors, …) has a stream of its own, so that switching a mechanism on
//! changes no dice of the others, and the flights may be flown in any order on any number of threads.

/// xoshiro256++ of Blackman and Vigna (2021), seeded by splitmix64 of Steele, Lea and Flood (2014).
#[derive(Clone, Debug)]
pub(super) struct Random {
    state: [u64; 4],
}

/// One step of splitmix64: a bijective scrambler of 64 bits.
fn splitmix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The stream `purpose` of flight `flight` in the session `seed`.
    pub(super) fn new(seed: u64, flight: u64, purpose: u64) -> Self {
        let mut word = splitmix(splitmix(splitmix(seed) ^ flight) ^ purpose);
        let state = std::array::from_fn(|_| {
            word = splitmix(word);
            word
        });
        Self { state }
    }

    fn next(&mut self) -> u64 {
        let [a, b, c, d] = self.state;
        let result = a.wrapping_add(d).rotate_left(23).wrapping_add(a);
        let (c, d) = (c ^ a, d ^ b);
        self.state = [a ^ d, b ^ c, c ^ (b << 17), d.rotate_left(45)];
        result
    }

    /// Uniform in [0, 1), 53 bits.
    pub(super) fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// -1 or 1.
    pub(super) fn sign(&mut self) -> f64 {
        if self.next() >> 63 == 0 { 1.0 } else { -1.0 }
    }

    /// An index below `count`; 0 if there is none.
    pub(super) fn below(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Standard normal (Box and Muller).
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Three independent standard normals.
    pub(super) fn normal3(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.normal())
    }
}

/// A first-order Gauss-Markov (Ornstein-Uhlenbeck) process sampled exactly at one step; white for a correlation time of 0.
#[derive(Clone, Debug)]
pub(super) struct GaussMarkov {
    value: f64,
    decay: f64,
    kick: f64,
}

impl GaussMarkov {
    /// A stationary process of the given rms and correlation time (s), to be read every `step_s`.
    pub(super) fn new(rms: f64, time_s: f64, step_s: f64, random: &mut Random) -> Self {
        let decay = if time_s > 0.0 { (-step_s / time_s).exp() } else { 0.0 };
        Self { value: rms * random.normal(), decay, kick: rms * (1.0 - decay * decay).sqrt() }
    }

    /// The next sample.
    pub(super) fn next(&mut self, random: &mut Random) -> f64 {
        self.value = self.decay * self.value + self.kick * random.normal();
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_and_repeat() {
        let draw = |flight, purpose| Random::new(7, flight, purpose).next();
        assert_eq!(draw(3, 1), draw(3, 1));
        assert_ne!(draw(3, 1), draw(1, 3));
        assert_ne!(draw(3, 1), draw(3, 2));
    }

    #[test]
    fn moments_and_correlation_time_are_those_asked_for() {
        let random = &mut Random::new(1, 0, 0);
        let process = &mut GaussMarkov::new(0.3, 0.2, 0.01, random);
        let samples: Vec<f64> = (0..400_000).map(|_| process.next(random)).collect();
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let variance = samples.iter().map(|x| x * x).sum::<f64>() / n;
        let lagged = samples.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / n;
        // 4000 s at a correlation time of 0.2 s are some 10 000 independent values: 5 standard errors of each moment.
        assert!(mean.abs() < 5.0 * 0.3 / 100.0, "mean {mean}");
        assert!((variance.sqrt() / 0.3 - 1.0).abs() < 5.0 / (2.0_f64 * 10_000.0).sqrt(), "rms {}", variance.sqrt());
        assert!((lagged / variance - (-0.05_f64).exp()).abs() < 0.005, "lag-1 correlation {}", lagged / variance);
    }
}
