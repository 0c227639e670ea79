//! The time of day in the form of RFC 3339, in Coordinated Universal Time.

use std::time::{SystemTime, UNIX_EPOCH};

const DAY_S: u64 = 86_400;

/// Now: `2026-11-26T19:05:12Z`.
pub(super) fn now() -> String {
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let [year, month, day] = date(now_s / DAY_S);
    let s = now_s % DAY_S;
    let (hour, minute, second) = (s / 3600, s / 60 % 60, s % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Days since the date of a time as [`now`] writes it.
pub(super) fn days_since(time: &str) -> Option<f64> {
    let mut parts = time.get(..10)?.split('-').map(|part| part.parse::<u64>().ok());
    let [year, month, day] = [parts.next()??, parts.next()??, parts.next()??];
    let seconds = |k: usize| time.get(k..k + 2)?.parse::<u64>().ok();
    let s = 3600 * seconds(11)? + 60 * seconds(14)? + seconds(17)?;
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).ok()?.as_secs();
    Some((now_s as f64 - (days_to([year, month, day])? * DAY_S + s) as f64) / DAY_S as f64)
}

/// Year, month and day of a day since 1970-01-01, in the Gregorian calendar (Hinnant,
/// "chrono-Compatible Low-Level Date Algorithms").
fn date(days: u64) -> [u64; 3] {
    // Years begin in March, so that the leap day is the last.
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    [year + 400 * era + u64::from(month <= 2), month, day]
}

/// The inverse of [`date`].
fn days_to([year, month, day]: [u64; 3]) -> Option<u64> {
    if !(1970..10_000).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let year = year - u64::from(month <= 2);
    let from_march = if month > 2 { month - 3 } else { month + 9 };
    let (era, of_era) = (year / 400, year % 400);
    let of_year = (153 * from_march + 2) / 5 + day - 1;
    Some(era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_dates() {
        // date -u -d 2026-11-26 +%s, and the like.
        for (days, wanted) in [
            (0, [1970, 1, 1]),
            (11_016, [2000, 2, 29]),
            (20_783, [2026, 11, 26]),
            (47_540, [2100, 2, 28]),
            (47_541, [2100, 3, 1]),
        ] {
            assert_eq!((date(days), days_to(wanted)), (wanted, Some(days)));
        }
        assert!(days_since(&now()).is_some_and(|days| (0.0..0.1).contains(&days)));
        assert!(days_since("2000-01-01T00:00:00Z").is_some_and(|days| days > 9000.0));
        assert_eq!([days_since("yesterday"), days_since("2026-13-01T00:00:00Z")], [None, None]);
    }
}
