//! Numbers, places and signals as a person reads them. What is no number is a dash, never NaN.

use crate::report::{NamedEffect, Quantity, RigPlace, decimals};
pub(super) use pagekit::number::NOT_MEASURED;
pub(super) use pagekit::significant::{fixed, percent, short};
use plant::effects::sheet;
use plant::effects::sheet::PlaceKind;

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

/// Unit in which values of a record's unit are displayed, and the factor: pressures in bar, lengths in mm.
pub(super) fn display_unit(unit: &str) -> (String, f64) {
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

pub(super) fn place(effect: &str, place: &RigPlace) -> String {
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
        let at = |axis: &str, element: Option<&str>| RigPlace {
            axis: axis.into(),
            element: element.map(Into::into),
        };
        assert_eq!(place("rod-leakage", &at("load", Some("b"))), "load axis, chamber b");
        assert_eq!(place("time-skew", &at("drive", Some("a"))), "drive axis, pressure sensor a");
        assert_eq!(place("time-skew", &at("drive", Some("force"))), "drive axis, force sensor");
        assert_eq!(place("supply-droop", &at("supply", None)), "supply");
        assert_eq!((signal("drive_pressure_a_Pa"), signal("odd")), ("drive pressure a".into(), "odd".into()));
        assert_eq!(crate::report::listed(&["a".into(), "b".into(), "c".into()]), "a, b and c");
    }
}
