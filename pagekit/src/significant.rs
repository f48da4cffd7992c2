//! Numbers with the digits that count: three of them, or as many as an error asks for. What is no number is a dash, never NaN.

use crate::number::NOT_MEASURED;

/// A number with three digits that count, plain from 0.001 to 99 999 and with a power of ten beyond.
#[must_use]
pub fn short(value: f64) -> String {
    if !value.is_finite() {
        return NOT_MEASURED.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !(-3.0..5.0).contains(&magnitude) {
        let mantissa = value / 10f64.powf(magnitude);
        return minus(&format!("{mantissa:.2}\u{b7}10")) + &raised(magnitude as i64);
    }
    fixed(value, (2.0 - magnitude).max(0.0) as usize)
}

/// A whole number; with a power of ten from a hundred thousand on.
#[must_use]
pub fn round(value: f64) -> String {
    if value.abs() < 1e5 { fixed(value, 0) } else { short(value) }
}

/// A number with this many digits behind the point.
#[must_use]
pub fn fixed(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NOT_MEASURED.to_owned();
    }
    let text = format!("{value:.digits$}");
    // Rounding may leave a zero its sign.
    if text.chars().all(|letter| matches!(letter, '-' | '0' | '.')) {
        text.replace('-', "")
    } else {
        minus(&text)
    }
}

/// A share in per cent; with a decimal below 10 and next to 100.
#[must_use]
pub fn percent(share: f64) -> String {
    let value = share * 100.0;
    let digits = if value.abs() < 99.95 && value.abs() > 99.0 || value.abs() < 9.95 { 1 } else { 0 };
    format!("{} %", fixed(value, digits))
}

fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

fn raised(power: i64) -> String {
    let letters = [
        '\u{2070}', '\u{b9}', '\u{b2}', '\u{b3}', '\u{2074}', '\u{2075}', '\u{2076}', '\u{2077}', '\u{2078}',
        '\u{2079}',
    ];
    let raised = |letter: char| letter.to_digit(10).map_or('\u{207b}', |digit| letters[digit as usize]);
    power.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_count() {
        let shown = [0.0, 1234.5, 0.01234, -2.5, 1.5e-6, 3e6, f64::NAN].map(short);
        assert_eq!(
            shown,
            [
                "0",
                "1234",
                "0.0123",
                "\u{2212}2.50",
                "1.50\u{b7}10\u{207b}\u{2076}",
                "3.00\u{b7}10\u{2076}",
                NOT_MEASURED
            ]
        );
        assert_eq!([0.0312, 0.97, 0.9996, 1.0].map(percent), ["3.1 %", "97 %", "100 %", "100 %"]);
        assert_eq!(fixed(-0.001, 1), "0.0");
    }
}
