//! The day in a file's name. No clock for anything that is computed: results never depend on the time of day.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Today's date in UTC as `YYYY-MM-DD`.
pub(super) fn today() -> String {
    // A clock before 1970 is not set; the day is then the first that can be written.
    date(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs() / SECONDS_OF_A_DAY)
}

const SECONDS_OF_A_DAY: u64 = 86_400;

/// Days of 400 years in the Gregorian calendar, which then repeats.
const DAYS_OF_400_YEARS: u64 = 146_097;

/// The date that lies `days` after 1970-01-01 in the Gregorian calendar.
///
/// Years are counted from 1 March, so that the leap day is a year's last (Hinnant, chrono-Compatible Low-Level Date Algorithms,
/// `civil_from_days`).
fn date(days: u64) -> String {
    // 0000-03-01 lies 719 468 days before 1970-01-01.
    let days = days + 719_468;
    let (era, day) = (days / DAYS_OF_400_YEARS, days % DAYS_OF_400_YEARS);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    // Months from March on have 31, 30, 31, 30, 31 days, twice, and what is left.
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = 400 * era + year + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_become_dates() {
        // `date -u -d @$((86400 * N)) +%F`
        for (days, expected) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (20_779, "2026-11-22"),
            (47_540, "2100-02-28"),
            (47_541, "2100-03-01"),
        ] {
            assert_eq!(date(days), expected, "{days}");
        }
    }

    #[test]
    fn every_day_follows_the_one_before() {
        let mut last = date(0);
        for days in 1..100_000 {
            let next = date(days);
            assert!(next > last, "{next} after {last}");
            last = next;
        }
    }
}
