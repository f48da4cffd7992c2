//! Numbers, places and signals as a person reads them. What is no number is a dash, never NaN.

use crate::report::{NamedEffect, Quantity, Where, decimals};
use plant::effects::sheet;
use plant::effects::sheet::PlaceKind;

/// Placeholder of a missing value.
pub(super) const NOTHING: &str = "\u{2013}";

/// A number with three digits that count, plain from 0.001 to 99 999 and with a power of ten beyond.
pub(crate) fn short(value: f64) -> String {
    if !value.is_finite() {
        return NOTHING.to_owned();
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
pub(super) fn round(value: f64) -> String {
    if value.abs() < 1e5 { fixed(value, 0) } else { short(value) }
}

/// A number with this many digits behind the point.
pub(super) fn fixed(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NOTHING.to_owned();
    }
    let text = format!("{value:.digits$}");
    // Rounding may leave a zero its sign.
    if text.chars().all(|letter| matches!(letter, '-' | '0' | '.')) {
        text.replace('-', "")
    } else {
        minus(&text)
    }
}

pub(super) fn percent(share: f64) -> String {
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

/// `2.513 ± 0.041 Nl/min`: rounded to the second digit of the standard error.
pub(super) fn quantity(quantity: &Quantity) -> String {
    let error = quantity.standard_error.filter(|error| error.is_finite() && *error > 0.0);
    let text = match error {
        Some(error) => {
            let digits = decimals(error);
            format!("{} \u{b1} {}", fixed(quantity.value, digits), fixed(error, digits))
        }
        None => short(quantity.value),
    };
    with_unit(&text, &quantity.unit)
}

/// A key without the unit at its end: `leakage` of `leakage_nl_per_min`.
fn key(quantity: &Quantity) -> String {
    let name = quantity.name.as_str();
    let end = KEY_ENDS.iter().filter_map(|end| name.strip_suffix(end)).min_by_key(|rest| rest.len());
    end.filter(|rest| !rest.is_empty()).unwrap_or(name).replace('_', " ")
}

/// The numbers of an effect, each behind its name: `leakage 2.513 ± 0.041 Nl/min`.
pub(super) fn numbers(named: &NamedEffect) -> String {
    let numbers = named.parameters.iter().map(|number| format!("{} {}", key(number), quantity(number)));
    numbers.collect::<Vec<_>>().join(", ")
}

/// What names of effects' keys end with, after their units.
const KEY_ENDS: [&str; 21] = [
    "_nl_per_min",
    "_w_per_m2_k",
    "_n_s_per_m",
    "_n_per_mm_per_s",
    "_n_per_bar",
    "_n_per_m",
    "_mm_per_s",
    "_m3_per_h",
    "_per_s",
    "_percent",
    "_mbar",
    "_bar",
    "_cm3",
    "_mm",
    "_ms",
    "_hz",
    "_kg",
    "_pa",
    "_n",
    "_m",
    "_s",
];

pub(super) fn with_unit(text: &str, unit: &str) -> String {
    if unit.is_empty() { text.to_owned() } else { format!("{text} {}", spelt(unit)) }
}

pub(super) fn spelt(unit: &str) -> String {
    let unit = unit.replace("^2", "\u{b2}").replace("^3", "\u{b3}");
    if unit == "um" { "\u{b5}m".to_owned() } else { unit }
}

/// What a unit of a record is shown in, and the factor: pressures in bar, lengths in mm.
pub(super) fn shown(unit: &str) -> (String, f64) {
    match unit {
        "m" => ("mm".to_owned(), 1e3),
        "m/s" => ("mm/s".to_owned(), 1e3),
        "Pa" => ("bar".to_owned(), 1e-5),
        "Pa/s" => ("bar/s".to_owned(), 1e-5),
        unit => (spelt(unit), 1.0),
    }
}

/// The same for differences and rms values, which are small.
pub(super) fn shown_small(unit: &str) -> (String, f64) {
    match unit {
        "m" => ("\u{b5}m".to_owned(), 1e6),
        "Pa" => ("mbar".to_owned(), 1e-2),
        unit => (spelt(unit), 1.0),
    }
}

/// The unit that a column's name ends with.
pub(super) fn unit_of(signal: &str) -> &str {
    match signal.rsplit_once('_').map(|(_, unit)| unit) {
        Some("m") => "m",
        Some("N" | "n") => "N",
        Some("Pa" | "pa") => "Pa",
        _ => "",
    }
}

/// `drive pressure a` of `drive_pressure_a_Pa`.
pub(super) fn signal(signal: &str) -> String {
    let name = if unit_of(signal).is_empty() {
        signal
    } else {
        signal.rsplit_once('_').map_or(signal, |(name, _)| name)
    };
    name.replace('_', " ")
}

pub(super) fn balance(balance: &str) -> String {
    let Some((axis, what)) = balance.split_once('.') else { return balance.to_owned() };
    match what {
        "flow-a" => format!("{axis}: air of chamber a"),
        "flow-b" => format!("{axis}: air of chamber b"),
        "force" => format!("{axis}: force on the piston"),
        "force-sensor" => format!("{axis}: force sensor"),
        other => format!("{axis}: {}", other.replace('-', " ")),
    }
}

pub(super) fn place(effect: &str, place: &Where) -> String {
    let axis = match place.axis.as_str() {
        axis @ ("drive" | "load") => format!("{axis} axis"),
        axis => axis.to_owned(),
    };
    let is_sensor =
        effect.contains("sensor") || sheet(effect).is_some_and(|sheet| sheet.place == PlaceKind::Channel);
    match place.element.as_deref() {
        None => axis,
        Some(element @ ("a" | "b")) if is_sensor => format!("{axis}, pressure sensor {element}"),
        Some(element @ ("a" | "b")) => format!("{axis}, chamber {element}"),
        Some(element) => format!("{axis}, {element} sensor"),
    }
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
                NOTHING
            ]
        );
        assert_eq!([0.0312, 0.97, 0.9996, 1.0].map(percent), ["3.1 %", "97 %", "100 %", "100 %"]);
        assert_eq!(fixed(-0.001, 1), "0.0");
    }

    #[test]
    fn a_quantity_is_rounded_to_its_error() {
        let of = |value, standard_error| Quantity {
            name: String::new(),
            value,
            unit: "m^3/h".to_owned(),
            standard_error,
            before: None,
        };
        assert_eq!(quantity(&of(2.513_17, Some(0.0412))), "2.513 \u{b1} 0.041 m\u{b3}/h");
        assert_eq!(quantity(&of(2.513_17, None)), "2.51 m\u{b3}/h");
    }

    #[test]
    fn places_and_signals_are_said_in_words() {
        let at =
            |axis: &str, element: Option<&str>| Where { axis: axis.into(), element: element.map(Into::into) };
        assert_eq!(place("rod-leakage", &at("load", Some("b"))), "load axis, chamber b");
        assert_eq!(place("time-skew", &at("drive", Some("a"))), "drive axis, pressure sensor a");
        assert_eq!(place("time-skew", &at("drive", Some("force"))), "drive axis, force sensor");
        assert_eq!(place("supply-droop", &at("supply", None)), "supply");
        assert_eq!((signal("drive_pressure_a_Pa"), signal("odd")), ("drive pressure a".into(), "odd".into()));
        assert_eq!(crate::report::listed(&["a".into(), "b".into(), "c".into()]), "a, b and c");
    }
}
