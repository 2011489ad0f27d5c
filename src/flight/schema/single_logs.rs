//! `[[late_in]]` and `[[cut]]` of a description: what holds for some of its logs alone. Which log is which is `flight::read`'s.

use crate::error::Result;
use crate::flight::Column;
use crate::flight::keys::Keys;
use std::collections::BTreeMap;

/// Streams that come late in some flights.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LateIn {
    /// Names of flights, as a person writes them.
    pub flights: Vec<String>,
    /// On top of what holds for all, s.
    pub late: BTreeMap<Column, f64>,
}

/// Where some flights are cut.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cut {
    /// Names of flights, as a person writes them.
    pub flights: Vec<String>,
    /// A piece begins with the row at this time of the log or the next one, s.
    pub at_s: Vec<f64>,
}

/// What is said of a log alone.
#[derive(Clone, Debug, Default)]
pub(crate) struct OfLog<'a> {
    pub late: Vec<&'a LateIn>,
    /// Where it is cut, s.
    pub cut_at_s: Vec<f64>,
}

/// Both kinds of rules.
pub(super) fn of_single_logs(keys: &mut Keys) -> Result<(Vec<LateIn>, Vec<Cut>)> {
    let (mut all_late, mut cuts) = (Vec::new(), Vec::new());
    for mut rule in keys.sections("late_in")? {
        let flights = rule.texts("flights")?.unwrap_or_default();
        let late = rule.times()?;
        rule.finish()?;
        if flights.is_empty() || late.is_empty() {
            let expected = "`flights` and at least one stream, as `controls = 0.01`";
            return Err(keys.fault("late_in", "an incomplete rule".into(), expected.into()));
        }
        all_late.push(LateIn { flights, late });
    }
    for mut rule in keys.sections("cut")? {
        let flights = rule.texts("flights")?.unwrap_or_default();
        let at_s = rule.numbers("at")?.unwrap_or_default();
        rule.finish()?;
        if flights.is_empty() || at_s.is_empty() {
            return Err(keys.fault("cut", "an incomplete rule".into(), "`flights` and `at`, as `at = [12.5]`".into()));
        }
        cuts.push(Cut { flights, at_s });
    }
    Ok((all_late, cuts))
}
