//! The residual of one channel over two variables at once: where one of them alone hides what happens.

use super::judge::PartWanted;
use super::{Studio, held};
use crate::blocks::BLOCK_S;
use crate::critique::diagnose::{Met, met};
use crate::critique::residual_views::{Surface, informative_pair, surface};
use crate::critique::unknown::{ROWS_MAX, ResidualTable};
use crate::error::Result;
use crate::flight::{Accelerations, Channel, Column};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is to be shown.
#[derive(Clone, Debug, Deserialize)]
pub struct SurfaceWanted {
    /// Part of the data.
    #[serde(default)]
    pub part: PartWanted,
    /// Index of the acceleration.
    pub channel: Channel,
    /// Both variables; without them the pair that tells most.
    #[serde(default)]
    pub variables: Option<[String; 2]>,
}

/// The residual over two variables.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceText {
    /// The cells; absent where the variables hardly vary.
    pub surface: Option<Surface>,
    /// Units of the two variables.
    pub units: [String; 2],
    /// Variables that may be asked for.
    pub names: Vec<String>,
}

/// Tables of residuals by state and part.
pub(super) type Tables = Vec<((u64, PartWanted), Arc<ResidualTable>)>;

/// States whose tables are kept.
const KEPT: usize = 3;

impl Studio {
    /// The residual of a channel over two variables, as means over tenths of a second or longer.
    ///
    /// # Errors
    /// [`crate::Error::Undetermined`] for a variable that is not recorded or does not vary; as
    /// [`Studio::map`].
    pub fn surface(&self, wanted: &SurfaceWanted) -> Result<SurfaceText> {
        let table = self.table(wanted.part)?;
        // Lagged sticks are for the search; a person reads what was recorded.
        let names: Vec<String> = table.names.iter().filter(|name| !name.starts_with("lag(")).cloned().collect();
        let pair = match &wanted.variables {
            Some(pair) => Some(pair.clone()),
            None => informative_pair(&table, wanted.channel)?,
        };
        let Some([x, y]) = pair else { return Ok(SurfaceText { surface: None, units: Default::default(), names }) };
        let unit = |name: &String| {
            table.names.iter().position(|known| known == name).map_or_else(String::new, |at| table.units[at].clone())
        };
        let units = [unit(&x), unit(&y)];
        Ok(SurfaceText { surface: surface(&table, wanted.channel, [&x, &y])?, units, names })
    }

    /// The residuals of the present state, flights met as `compare` meets them.
    fn table(&self, part: PartWanted) -> Result<Arc<ResidualTable>> {
        let now = self.now();
        let key = (now.id, part);
        if let Some((_, known)) = held(&self.tables).iter().find(|known| known.0 == key) {
            return Ok(Arc::clone(known));
        }
        let flights = &self.set.flights;
        let Met { models, judged, .. } = met(flights, &[&now.model], self.judge.spans(&self.split, part))?;
        let residual = |flight: usize| -> Result<Accelerations> {
            let mut residual = models[0].predict(&flights[flight])?;
            for (values, target) in residual.iter_mut().zip(Column::TARGETS) {
                values.iter_mut().zip(flights[flight].column(target)).for_each(|(value, measured)| *value = measured - *value);
            }
            Ok(residual)
        };
        let table = Arc::new(ResidualTable::new(flights, &judged, &residual, BLOCK_S, ROWS_MAX)?);
        let mut kept = held(&self.tables);
        if kept.len() >= KEPT {
            kept.remove(0);
        }
        kept.push((key, Arc::clone(&table)));
        Ok(table)
    }
}
