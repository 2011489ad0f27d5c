//! The residual of one channel over two variables: means by cell with intervals from blocks.
//!
//! A picture of a dependence; whether there is one is asked in `unknown`.

use super::{blocks, channel, feature, plain_features};
use crate::blocks::{BlockMean, BlockSum, FEW_BLOCKS};
use crate::critique::unknown::ResidualTable;
use crate::error::Result;
use crate::flight::Channel;
use serde::Serialize;

/// Cells along each variable.
pub const SIDE: usize = 12;

/// The residual in one cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SurfaceCell {
    /// Place along the first variable, from 0.
    pub column: usize,
    /// Place along the second variable, from 0.
    pub row: usize,
    /// Mean of measured − predicted, m/s² or rad/s².
    pub mean: f64,
    /// Its 95 % interval from the scatter between blocks.
    pub ci95: Option<[f64; 2]>,
    /// Rows in the cell.
    pub n: usize,
    /// Blocks in the cell.
    pub blocks: usize,
    /// Whether fewer than [`FEW_BLOCKS`] blocks carry it; figures hatch it.
    pub thin: bool,
}

/// The residual of one channel over two variables.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Surface {
    /// Channel by name.
    pub channel: &'static str,
    /// First and second variable.
    pub variables: [String; 2],
    /// Edges of the cells along each variable, one more than cells; values beyond go into the outer cells.
    pub edges: [Vec<f64>; 2],
    /// Cells that hold rows.
    pub cells: Vec<SurfaceCell>,
    /// Correlation ratio η²: the share of the residual's variance that the cell means account for, 0 to 1, what so many means take
    /// from noise included.
    pub share: f64,
}

/// Equal steps between the 0.5 % and 99.5 % quantiles; `None` if these coincide.
fn edges(values: &[f64], side: usize) -> Option<Vec<f64>> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let quantile = |share: f64| sorted.get((sorted.len().saturating_sub(1) as f64 * share).round() as usize).copied();
    let (low, high) = (quantile(0.005)?, quantile(0.995)?);
    (high > low).then(|| (0..=side).map(|edge| low + (high - low) * edge as f64 / side as f64).collect())
}

/// The cell of a value.
fn place(edges: &[f64], value: f64) -> usize {
    edges.partition_point(|edge| *edge <= value).clamp(1, edges.len().saturating_sub(1).max(1)) - 1
}

/// The residual of channel `of` over the features `x` and `y`; `None` if one of them hardly varies.
///
/// # Errors
/// [`crate::Error::Shape`] without such a channel, [`crate::Error::Undetermined`] if a feature is not in the table.
pub fn surface(table: &ResidualTable, of: Channel, [x, y]: [&str; 2]) -> Result<Option<Surface>> {
    let (residual, name) = channel(table, of)?;
    let (across, along) = (feature(table, x)?, feature(table, y)?);
    let Some((x_edges, y_edges)) = edges(across, SIDE).zip(edges(along, SIDE)) else { return Ok(None) };
    let blocks = blocks(table);
    let mut sums = vec![BlockSum::default(); SIDE * SIDE * blocks];
    for (((x, y), value), block) in across.iter().zip(along).zip(residual).zip(&table.block) {
        let cell = place(&y_edges, *y) * SIDE + place(&x_edges, *x);
        if let Some(sum) = sums.get_mut(cell * blocks + block) {
            sum.samples += 1.0;
            sum.sum += value;
        }
    }
    let cell = |(index, sums): (usize, &[BlockSum])| {
        let mean = BlockMean::new(sums.iter().copied())?;
        let n = sums.iter().map(|sum| sum.samples).sum::<f64>() as usize;
        let (blocks, thin) = (mean.blocks, mean.blocks < FEW_BLOCKS);
        Some(SurfaceCell { column: index % SIDE, row: index / SIDE, mean: mean.mean, ci95: mean.interval(), n, blocks, thin })
    };
    let cells: Vec<SurfaceCell> = sums.chunks_exact(blocks.max(1)).enumerate().filter_map(cell).collect();
    let share = eta(cells.iter().map(|cell| (cell.n as f64, cell.mean)), residual);
    Ok(Some(Surface { channel: name, variables: [x.into(), y.into()], edges: [x_edges, y_edges], cells, share }))
}

/// η² of cells of a number of rows and a mean.
fn eta(cells: impl Iterator<Item = (f64, f64)>, residual: &[f64]) -> f64 {
    let mean = residual.iter().sum::<f64>() / residual.len().max(1) as f64;
    let total: f64 = residual.iter().map(|value| (value - mean).powi(2)).sum();
    let between: f64 = cells.map(|(count, value)| count * (value - mean).powi(2)).sum();
    if total > 0.0 { (between / total).clamp(0.0, 1.0) } else { 0.0 }
}

/// The two features over which a channel's residual varies most: the first by its own η², the second by the η² of both.
///
/// A choice of axes, not a finding: in noise it is the two that vary with the noise by chance. `None` with fewer than two features.
///
/// # Errors
/// [`crate::Error::Shape`] without such a channel.
pub fn informative_pair(table: &ResidualTable, of: Channel) -> Result<Option<[String; 2]>> {
    let (residual, _) = channel(table, of)?;
    let placed = |(name, values): (&str, &[f64])| {
        let edges = edges(values, SIDE)?;
        Some((name.to_owned(), values.iter().map(|value| place(&edges, *value)).collect::<Vec<usize>>()))
    };
    let features: Vec<(String, Vec<usize>)> = plain_features(table).filter_map(placed).collect();
    let share = |places: &dyn Fn(usize) -> usize| {
        let mut cells = vec![(0.0, 0.0); SIDE * SIDE];
        for (row, value) in residual.iter().enumerate() {
            if let Some((count, sum)) = cells.get_mut(places(row)) {
                *count += 1.0;
                *sum += value;
            }
        }
        eta(cells.into_iter().filter(|(count, _)| *count > 0.0).map(|(count, sum)| (count, sum / count)), residual)
    };
    let alone = |index: &usize| features.get(*index).map_or(0.0, |(_, places)| share(&|row| places[row]));
    let Some(first) = (0..features.len()).max_by(|a, b| alone(a).total_cmp(&alone(b))) else { return Ok(None) };
    let both = |other: &usize| share(&|row| features[first].1[row] * SIDE + features[*other].1[row]);
    let second = (0..features.len()).filter(|other| *other != first).max_by(|a, b| both(a).total_cmp(&both(b)));
    Ok(second.map(|second| [features[first].0.clone(), features[second].0.clone()]))
}

#[cfg(test)]
mod tests {
    use super::super::testing::table;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_product_is_seen_over_its_two_variables() -> Result<()> {
        let mut table = table(1, 40);
        let product: Vec<f64> = table.features[0].iter().zip(&table.features[1]).map(|(x, y)| 1.5 * x * y + 0.5 * x).collect();
        table.residual[Channel::VzDot].iter_mut().zip(product).for_each(|(residual, value)| *residual = 0.3 * *residual + value);
        let pair = informative_pair(&table, Channel::VzDot)?.unwrap_or_default();
        assert_eq!(pair, ["vx".to_owned(), "height".to_owned()]);
        let found = surface(&table, Channel::VzDot, ["vx", "height"])?;
        let Some(found) = found else { panic!("both vary") };
        assert_eq!(found.cells.iter().map(|cell| cell.n).sum::<usize>(), table.len());
        assert!(found.share > 0.7, "{}", found.share);
        let corner = found.cells.iter().filter(|cell| cell.column > 8 && cell.row > 8 && !cell.thin);
        let corner: Vec<&SurfaceCell> = corner.collect();
        assert!(!corner.is_empty() && corner.iter().all(|cell| cell.mean > 0.0));
        Ok(())
    }

    #[test]
    fn noise_has_no_share_and_misfits_are_refused() -> Result<()> {
        let table = table(2, 200);
        let share = surface(&table, Channel::VxDot, ["vx", "u1"])?.map_or(1.0, |found| found.share);
        assert!(share < 0.05, "{share}");
        assert!(surface(&table, Channel::VxDot, ["vx", "u9"]).is_err());
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn cells_pool_to_the_mean(seed: u64) {
            let table = table(seed, 4);
            let found = surface(&table, Channel::VyDot, ["height", "u1"])?;
            let pooled = found.map_or(f64::NAN, |found| found.cells.iter().map(|cell| cell.n as f64 * cell.mean).sum::<f64>());
            prop_assert!((pooled - table.residual[Channel::VyDot].iter().sum::<f64>()).abs() < 1e-6);
        }
    }
}
