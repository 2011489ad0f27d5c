//! Flights without those that whoever asks for them wants left out. Reading them is `flight::read`'s business, judging them `critique::check`'s.

use crate::critique::check::check;
use crate::error::{Error, Result};
use crate::flight::DataSet;

/// The word for all flights of which [`check`] says that they are read otherwise than the rest.
pub const SUSPECTS: &str = "suspects";

/// Times that what is left is checked again: beside the worst the next may not have shown.
const MOST_CHECKS: usize = 3;

/// The flights without those of these names, and, where [`SUSPECTS`] is among the names, without those that a check suspects.
///
/// # Errors
/// As [`DataSet::leave_out`]; [`Error::Config`], of the field `leave_out` too, where no flight is left.
pub fn without(mut set: DataSet, leave_out: &[String]) -> Result<DataSet> {
    let names: Vec<String> = leave_out.iter().filter(|name| *name != SUSPECTS).cloned().collect();
    set.leave_out(&names, "as --leave-out says")?;
    if leave_out.iter().any(|name| name == SUSPECTS) {
        for _ in 0..MOST_CHECKS {
            let suspects = check(&set, None).suspects();
            if suspects.is_empty() {
                break;
            }
            set.leave_out(&suspects, "as suspects")?;
        }
    }
    if set.flights.is_empty() {
        return Err(Error::Config {
            place: "flights".into(),
            field: "leave_out".into(),
            found: leave_out.join(" "),
            expected: "at least one flight that is left".into(),
        });
    }
    Ok(set)
}
