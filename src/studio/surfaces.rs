//! The residual of one channel over two variables at once: where one of them alone hides what happens.

use super::Studio;
use super::judge::PartWanted;
use crate::critique::residual_views::{Surface, informative_pair, surface};
use crate::error::Result;
use crate::flight::Channel;
use serde::{Deserialize, Serialize};

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
}
