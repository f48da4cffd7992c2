//! Times of a calendar in a column, ISO 8601 as RFC 3339 has it: `2026-11-27T14:05:03.250+01:00`, with a space for the T too.
//!
//! Days since 1970 by the proleptic Gregorian calendar [Hinnant, chrono-compatible low-level date algorithms, days_from_civil].
//! The crate humantime refuses years before 1970, to which the unset clock of a logger falls, and reads no zone but Z.

use toml::value::Datetime;

const NANOSECONDS: i128 = 1_000_000_000;

/// A time of a calendar, to the nanosecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CalendarTime {
    /// Since 1970 in its own zone, or in that of its record where it names none.
    nanoseconds: i128,
    /// It names its zone: it cannot be compared with one that does not.
    has_zone: bool,
}

impl CalendarTime {
    /// Reads one; `None` for any other text. A comma may stand for the point of the seconds.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let time: Datetime = text.trim().replacen(',', ".", 1).parse().ok()?;
        let (date, of_day) = (time.date?, time.time?);
        let (year, month) = (i64::from(date.year), i64::from(date.month));
        // A year that begins in March ends with the day that leap years add.
        let years = year - i64::from(month <= 2);
        let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + i64::from(date.day) - 1;
        let days =
            365 * years + years.div_euclid(4) - years.div_euclid(100) + years.div_euclid(400) + day_of_year
                - 719_468;
        let minutes = match time.offset {
            Some(toml::value::Offset::Custom { minutes }) => i64::from(minutes),
            _ => 0,
        };
        let second = i64::from(of_day.second.unwrap_or(0));
        let seconds = days * 86_400
            + i64::from(of_day.hour) * 3600
            + (i64::from(of_day.minute) - minutes) * 60
            + second;
        let nanoseconds = i128::from(seconds) * NANOSECONDS + i128::from(of_day.nanosecond.unwrap_or(0));
        Some(Self { nanoseconds, has_zone: time.offset.is_some() })
    }

    /// Seconds since another; `None` where one of them alone names its zone.
    #[must_use]
    pub fn since_s(self, first: Self) -> Option<f64> {
        let nanoseconds = self.nanoseconds - first.nanoseconds;
        (self.has_zone == first.has_zone).then_some(nanoseconds as f64 / NANOSECONDS as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn since(one: &str, first: &str) -> Option<f64> {
        CalendarTime::parse(one)?.since_s(CalendarTime::parse(first)?)
    }

    #[test]
    fn times_are_seconds_over_days_leap_days_and_zones() {
        for (first, one, seconds) in [
            ("2026-11-27T14:05:03.250", "2026-11-27 14:05:04,5", 1.25),
            ("2023-12-31T23:59:59Z", "2024-01-01T00:00:00Z", 1.0),
            ("2024-02-28T00:00:00", "2024-03-01T00:00:00", 2.0 * 86_400.0),
            ("2026-02-28T00:00:00", "2026-03-01T00:00:00", 86_400.0),
            ("1970-01-01T00:00:00Z", "2000-01-01T00:00:00Z", 946_684_800.0),
            ("2026-11-27T14:00:00+01:00", "2026-11-27T13:00:00.001Z", 0.001),
        ] {
            let found = since(one, first).unwrap_or_else(|| panic!("{one}"));
            assert!((found - seconds).abs() < 1e-9, "{one} {found}");
        }
        assert_eq!(since("2026-11-27T14:00:00Z", "2026-11-27T14:00:00"), None);
        for other in ["", "12", "2026-13-01T00:00:00", "2026-11-27", "14:05:03", "27.11.2026 14:05:03"] {
            assert_eq!(CalendarTime::parse(other), None, "{other}");
        }
    }
}
