//! Made-up flights for the tests: smooth random columns with known numbers behind them, from a seed.
#![allow(dead_code, reason = "each test program uses its part")]

use phyture::flight::{Channel, Column, Flight, PerChannel, Targets};
use phyture::{Error, Result};

/// Sampling step of the made-up flights, s.
pub const STEP_S: f64 = 0.01;

/// A small generator of normal deviates (splitmix64 and Box-Muller), so that every run sees the same flights.
pub struct Normal(u64);

impl Normal {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn next(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// An Ornstein-Uhlenbeck path of unit variance.
    pub fn path(&mut self, samples: usize, correlation_s: f64) -> Vec<f64> {
        let keep = (-STEP_S / correlation_s).exp();
        let kick = (1.0 - keep * keep).sqrt();
        let mut value = self.next();
        (0..samples)
            .map(|_| {
                value = keep * value + kick * self.next();
                value
            })
            .collect()
    }
}

/// A flight of random states and controls; the targets are zero.
pub fn random(seed: u64, samples: usize) -> Result<Flight> {
    let mut normal = Normal::new(seed);
    let columns = std::array::from_fn(|index| {
        let (centre, spread) = match index {
            2 => (-10.0, 2.0),
            0..=5 => (0.0, 0.3),
            6..=8 => (1.0, 4.0),
            9..=11 => (0.0, 1.0),
            12..=14 => (0.0, 0.3),
            15 => (0.5, 0.2),
            _ => (0.0, 0.0),
        };
        normal.path(samples, 0.4).into_iter().map(|value| centre + spread * value).collect()
    });
    Flight::new(format!("flight{seed}"), "made_up", 0.0, STEP_S, columns, Targets::Recorded)
}

/// The same flight with other targets.
pub fn with_targets(flight: &Flight, targets: &PerChannel<Vec<f64>>) -> Result<Flight> {
    let columns = Column::ALL.map(|column| match Channel::of_column(column) {
        Some(channel) => targets[channel].clone(),
        None => flight.column(column).to_vec(),
    });
    let mut made =
        Flight::new(flight.name.clone(), flight.manoeuvre.clone(), flight.start_s, flight.step_s, columns, flight.targets)?;
    made.extra = flight.extra.clone();
    made.absent = flight.absent.clone();
    Ok(made)
}

/// The message of an error that must be there.
pub fn message<T>(result: Result<T>) -> Result<String> {
    match result {
        Ok(_) => Err(Error::Undetermined("an error was expected".into())),
        Err(error) => Ok(error.to_string()),
    }
}
