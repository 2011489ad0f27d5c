//! `[[repair]]` of a description: which cells of a log are bad and what bridges them. Finding and bridging them is `flight::repair`'s.

use super::formulas;
use crate::error::Result;
use crate::flight::keys::Keys;
use crate::formula::Formula;

/// A rule for known-bad cells of some columns of the file.
#[derive(Clone, Debug)]
pub(crate) struct Repair {
    pub columns: Vec<String>,
    /// All must be true of `value`, else the cell is bad. NaN is bad always.
    pub valid: Vec<Formula>,
    /// Whether a row that repeats the row before in all these columns is bad: the recorder held it where a packet was lost.
    pub held: bool,
    /// Whether a row in which all these columns hold 0 is bad: that is written where nothing was received.
    pub zero: bool,
    /// A cell that lies farther than this beyond both its neighbours, on the same side, is bad; in the unit of the file.
    pub spike: Option<f64>,
    /// Longest run of bad cells that is bridged, s.
    pub max_gap_s: f64,
    /// What a run is bridged by.
    pub between: Between,
    /// What is done with a longer one.
    pub longer: Longer,
    /// Rows this near a bridged cell are neither fitted nor judged, s.
    pub set_aside_s: Option<f64>,
}

/// What bridges a run of bad cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Between {
    /// A straight line between the good cells at its ends.
    #[default]
    Line,
    /// A cubic through them, with the slopes that the next good cells beyond give: for streams that are slow beside what they tell of.
    Cubic,
}

impl Between {
    const NAMES: [(&'static str, Self); 2] = [("line", Self::Line), ("cubic", Self::Cubic)];
}

/// What is done with a run of bad cells that is too long to be bridged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Longer {
    /// It is an error in a row that is used.
    #[default]
    Error,
    /// Its rows are left out: what lies before and behind become flights of their own.
    Cut,
}

impl Longer {
    const NAMES: [(&'static str, Self); 2] = [("error", Self::Error), ("cut", Self::Cut)];
}

/// The rules of a description; `place` is named in errors.
pub(super) fn repairs(keys: &mut Keys, place: &str) -> Result<Vec<Repair>> {
    let mut repairs = Vec::new();
    for mut rule in keys.sections("repair")? {
        let columns = rule.texts("columns")?.unwrap_or_default();
        let valid = formulas(&rule.texts("valid")?.unwrap_or_default(), &format!("{place}, `repair.valid`"), &["value"])?;
        let held = rule.flag("held")?.unwrap_or(false);
        let zero = rule.flag("zero")?.unwrap_or(false);
        let spike = rule.number("spike", f64::MIN_POSITIVE)?;
        let max_gap_s = rule.number("max_gap_s", f64::MIN_POSITIVE)?;
        let (false, Some(max_gap_s)) = (columns.is_empty(), max_gap_s) else {
            let expected =
                "`columns` and `max_gap_s`; `valid`, `held`, `zero` or `spike` if NaN is not the only sign of a bad cell";
            return Err(keys.fault("repair", "an incomplete rule".into(), expected.into()));
        };
        let between = rule.choice("between", &Between::NAMES)?.unwrap_or_default();
        let longer = rule.choice("longer", &Longer::NAMES)?.unwrap_or_default();
        let set_aside_s = rule.number("set_aside_s", 0.0)?;
        rule.finish()?;
        repairs.push(Repair { columns, valid, held, zero, spike, max_gap_s, between, longer, set_aside_s });
    }
    Ok(repairs)
}
