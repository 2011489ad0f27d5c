//! Numbers behind the pictures of a residual: where in two variables it lies, which regions hold the error, how long it lasts, and
//! whether sticks follow it.
//!
//! Descriptions with intervals from blocks; no figures are drawn and no effect is named here. All read a
//! [`ResidualTable`].

pub mod regions;
pub mod surface;
pub mod time;

pub use regions::{Region, Split, Where, regions};
pub use surface::{Surface, SurfaceCell, informative_pair, surface};
pub use time::{Autocorrelation, Spectrum, StickCorrelation, autocorrelation, spectrum, stick_correlations};

use super::unknown::ResidualTable;
use crate::error::{Error, Result};
use crate::flight::Channel;

/// The residual of a channel and the channel's name.
fn channel(table: &ResidualTable, channel: Channel) -> Result<(&[f64], &'static str)> {
    let residual = &table.residual[channel];
    if residual.len() != table.len() {
        let message = format!("{} residuals of {channel} for {} rows", residual.len(), table.len());
        return Err(Error::Shape { operation: "residual view", message });
    }
    Ok((residual, channel.name()))
}

/// A feature by name.
fn feature<'a>(table: &'a ResidualTable, name: &str) -> Result<&'a [f64]> {
    let known = table.feature(name).filter(|values| values.len() == table.len());
    known.ok_or_else(|| Error::Undetermined(format!("`{name}` was not recorded or does not vary in these flights")))
}

/// Features that a person reads off a flight: no lagged sticks.
fn plain_features(table: &ResidualTable) -> impl Iterator<Item = (&str, &[f64])> {
    let named = table.names.iter().zip(&table.features).filter(|(_, values)| values.len() == table.len());
    named.map(|(name, values)| (name.as_str(), values.as_slice())).filter(|(name, _)| !name.starts_with("lag("))
}

/// Number of blocks.
fn blocks(table: &ResidualTable) -> usize {
    table.block.iter().max().map_or(0, |last| last + 1)
}

#[cfg(test)]
pub(in crate::critique::residual_views) mod testing {
    use super::*;
    use crate::flight::PerChannel;
    use phyture_kernels::random::Stream;

    /// Blocks of 200 rows of 0.1 s, two blocks a flight, with features `vx` (noise of 1 s), `height` (of 3 s) and `u1` (of 0.3 s), and
    /// unit noise of 0.5 s in every channel.
    pub fn table(seed: u64, flights: usize) -> ResidualTable {
        let mut table = ResidualTable::default();
        let noise = |purpose: u64, tau_s: f64| -> Vec<f64> {
            let (stream, keep) = (Stream::new(seed, purpose, 0, 0), (-0.1 / tau_s).exp());
            let mut value = 0.0;
            (0..400 * flights as u64)
                .map(|row| {
                    value = keep * value + (1.0 - keep * keep).sqrt() * 12_f64.sqrt() * (stream.uniform(row) - 0.5);
                    value
                })
                .collect()
        };
        table.names = ["vx", "height", "u1"].map(str::to_owned).into();
        table.units = ["m/s", "m", "1"].map(str::to_owned).into();
        table.features = vec![noise(10, 1.0), noise(11, 3.0), noise(12, 0.3)];
        table.residual = PerChannel::from_fn(|channel| noise(channel.index() as u64, 0.5));
        table.block = (0..400 * flights).map(|row| row / 200).collect();
        table.flight = (0..400 * flights).map(|row| row / 400).collect();
        table.time_s = (0..400 * flights).map(|row| 0.1 * (row % 400) as f64 + 0.05).collect();
        table
    }
}
