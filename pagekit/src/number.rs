//! Numbers, lengths of time and dates as a person reads them. What is no number is a dash, never NaN.

use humantime::format_rfc3339_seconds;
use std::time::{Duration, UNIX_EPOCH};

/// What stands where nothing was measured.
pub const NOT_MEASURED: &str = "–";
/// Narrow space between thousands, where no line may break.
const THOUSANDS: char = '\u{202f}';

/// Digits before the point, in threes.
fn grouped_digits(digits: &str) -> String {
    let length = digits.len();
    let mut grouped = String::with_capacity(length + length / 3);
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (length - place).is_multiple_of(3) {
            grouped.push(THOUSANDS);
        }
        grouped.push(digit);
    }
    grouped
}

/// Whole number with its thousands set apart.
#[must_use]
pub fn count(count: u64) -> String {
    grouped_digits(&count.to_string())
}

/// A number with this many digits behind the point; a dash when it is none.
#[must_use]
pub fn decimal(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NOT_MEASURED.into();
    }
    let text = format!("{:.digits$}", value.abs());
    let (whole, fraction) = text.split_once('.').map_or((text.as_str(), ""), |(whole, rest)| (whole, rest));
    let is_zero = text.chars().all(|letter| letter == '0' || letter == '.');
    let sign = if value < 0.0 && !is_zero { "−" } else { "" };
    let point = if fraction.is_empty() { "" } else { "." };
    format!("{sign}{}{point}{fraction}", grouped_digits(whole))
}

/// A number of any size and unit on a page: whole with its thousands apart, or with four digits that count.
#[must_use]
pub fn compact(value: f64) -> String {
    match value {
        value if value.is_finite() && value.fract() != 0.0 => short(value),
        value => decimal(value, 0),
    }
}

/// A figure's name for people: words instead of underscores, no unit.
#[must_use]
pub fn without_unit(name: &str) -> String {
    settings::without_unit(name).replace('_', " ")
}

/// A value in the unit that people use for it.
#[must_use]
pub fn in_use(value: f64, unit: &str) -> String {
    match unit {
        "m" => format!("{} mm", short(value * 1e3)),
        "s" => format!("{} ms", short(value * 1e3)),
        "1" => short(value),
        unit => format!("{} {unit}", short(value)),
    }
}

/// Four digits that count; very small and very large numbers with an exponent.
#[must_use]
pub fn short(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || value.fract() == 0.0 && size < 1e6 {
        return format!("{value}");
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 7) as usize;
    format!("{value:.digits$}")
}

/// A change in per cent with its sign.
#[must_use]
pub fn change(percent: f64) -> String {
    let text = decimal(percent, 1);
    let sign = if percent.is_finite() && !text.starts_with('−') { "+" } else { "" };
    format!("{sign}{text} %")
}

/// A length of time in us, without its unit: for columns that say it. Below 1 us a second digit counts.
#[must_use]
pub fn in_us(ns: u64) -> String {
    decimal(ns as f64 * 1e-3, if ns < 1000 { 2 } else { 1 })
}

/// The same where nothing may have been measured.
#[must_use]
pub fn us_or_not_measured(ns: Option<u64>) -> String {
    ns.map_or_else(|| NOT_MEASURED.into(), in_us)
}

/// A length of time with the unit that suits it.
#[must_use]
pub fn length(ns: u64) -> String {
    match ns {
        0..1000 => format!("{ns} ns"),
        1000..1_000_000 => format!("{} µs", decimal(ns as f64 * 1e-3, 1)),
        1_000_000..1_000_000_000 => format!("{} ms", decimal(ns as f64 * 1e-6, 2)),
        _ => format!("{} s", decimal(ns as f64 * 1e-9, 2)),
    }
}

/// A round number of ns on an axis.
#[must_use]
pub fn tick_ns(ns: f64) -> String {
    let (value, unit) = match ns {
        ns if ns < 1e3 => (ns, "ns"),
        ns if ns < 1e6 => (ns * 1e-3, "µs"),
        ns if ns < 1e9 => (ns * 1e-6, "ms"),
        ns => (ns * 1e-9, "s"),
    };
    format!("{} {unit}", value.round())
}

/// Date and time of day, UTC, from seconds since 1970.
#[must_use]
pub fn instant(unix_s: f64) -> String {
    // Beyond the year 9999, or before 1970, it is no instant of a run.
    if !(0.0..253_402_300_800.0).contains(&unix_s) {
        return "at an unknown time".into();
    }
    let stamp = format_rfc3339_seconds(UNIX_EPOCH + Duration::from_secs(unix_s as u64)).to_string();
    stamp.replace('T', " ").replace('Z', " UTC")
}

/// A word of a count: one event, two events.
#[must_use]
pub fn counted(number: u64, one: &str, many: &str) -> String {
    format!("{} {}", count(number), if number == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_never_nan() {
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(999), "999");
        assert_eq!(decimal(-1234.56, 1), "−1\u{202f}234.6");
        assert_eq!(decimal(-0.01, 1), "0.0");
        assert_eq!([59_000.0, 48.3, f64::NAN].map(compact), ["59\u{202f}000", "48.30", NOT_MEASURED]);
        assert_eq!(
            (decimal(f64::NAN, 1), decimal(f64::INFINITY, 0)),
            (NOT_MEASURED.into(), NOT_MEASURED.into())
        );
        assert_eq!(
            (change(0.04), change(-3.0), change(f64::NAN)),
            ("+0.0 %".into(), "−3.0 %".into(), "– %".into())
        );
    }

    #[test]
    fn lengths_of_time_have_the_unit_that_suits_them() {
        assert_eq!(
            (in_us(52), in_us(13_149), us_or_not_measured(None)),
            ("0.05".into(), "13.1".into(), NOT_MEASURED.into())
        );
        let reported = [7, 13_149, 3_500_000, 2_000_000_000].map(length);
        assert_eq!(reported, ["7 ns", "13.1 µs", "3.50 ms", "2.00 s"]);
        assert_eq!([1e2, 1e4, 1e7, 1e10].map(tick_ns), ["100 ns", "10 µs", "10 ms", "10 s"]);
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(instant(0.0), "1970-01-01 00:00:00 UTC");
        assert_eq!(instant(951_782_400.0), "2000-02-29 00:00:00 UTC");
        assert_eq!(instant(1_795_170_592.5), "2026-11-20 10:29:52 UTC");
        assert_eq!(instant(f64::NAN), "at an unknown time");
    }

    #[test]
    fn figures_are_printed_in_customary_units() {
        for (value, unit, expected) in [
            (0.002_147_3, "m", "2.147 mm"),
            (0.0871, "s", "87.10 ms"),
            (-203.456, "N", "-203.5 N"),
            (2.0, "1", "2"),
            (0.0, "m", "0 mm"),
            (1.2e-9, "1", "1.200e-9"),
        ] {
            assert_eq!(in_use(value, unit), expected);
        }
        assert_eq!(without_unit("stop_speed_m_per_s"), "stop speed");
        assert_eq!(without_unit("supply_pressure_Pa"), "supply pressure");
        assert_eq!(without_unit("force_aperiodic"), "force aperiodic");
    }
}
