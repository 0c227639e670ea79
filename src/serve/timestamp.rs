//! Formats the current Coordinated Universal Time as RFC 3339 text.

use std::time::{SystemTime, UNIX_EPOCH};

const DAY_S: u64 = 86_400;

/// Returns the current time, such as `2026-11-26T19:05:12Z`.
pub(crate) fn now() -> String {
    rfc3339(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()))
}

/// Returns a time, given in seconds since the beginning of 1970, as text in RFC 3339, such as
/// `2026-11-30T18:00:00Z`.
fn rfc3339(since_1970_s: u64) -> String {
    let [year, month, day] = date(since_1970_s / DAY_S);
    let s = since_1970_s % DAY_S;
    // An hour has 3600 s, and a minute 60 s.
    let (hour, minute, second) = (s / 3600, s / 60 % 60, s % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Returns year, month and day for a number of days since 1970-01-01, in the Gregorian calendar
/// (Hinnant, "chrono-Compatible Low-Level Date Algorithms").
fn date(days_since_1970: u64) -> [u64; 3] {
    // Years are counted from March, so that the leap day is the last day of its year. An era has
    // 400 years or 146,097 days. Year 0 begins 719,468 days before 1970.
    let days = days_since_1970 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    // A century has 36,524 days. A 4-year and a 400-year cycle have 1460 and 146,096 days,
    // respectively, before their final leap day.
    let leap_days = day_of_era / 1460 - day_of_era / 36_524 + day_of_era / 146_096;
    let year = (day_of_era - leap_days) / 365;
    // Every fourth year has a leap day, except for every hundredth year of the era.
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    // From March on, every five months have 153 days.
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    [year + 400 * era + u64::from(month <= 2), month, day]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_dates() {
        // The expected values are those of `date -u -d 2026-11-26 +%s` and similar commands.
        for (days, wanted) in [
            (0, "1970-01-01T00:00:00Z"),
            (11_016, "2000-02-29T00:00:00Z"),
            (20_783, "2026-11-26T00:00:00Z"),
            (47_540, "2100-02-28T00:00:00Z"),
            (47_541, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(rfc3339(days * DAY_S), wanted);
        }
        assert_eq!(rfc3339(DAY_S - 1), "1970-01-01T23:59:59Z");
    }
}
