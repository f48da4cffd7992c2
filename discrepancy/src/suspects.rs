//! Suspects of a file beside a rig file: terms that may be missing, screened and fitted as the effects of the catalogue.
//!
//! ```text
//!   [[suspects]] ──► declared term (plant) ──► data sheet: places, numbers with ranges ──► candidate
//! ```
//! A number without a value is an amplitude: 0 is the rig without the suspect, its `prior`, else half of its range, is a
//! coordinate of 1, and a tenth of that is the smallest that is named. A number with a value is a shape, which starts there.

use plant::effects::declared::{Declared, Number};
use plant::effects::sheet::{EffectKey, Group, Place, PlaceKind, Sheet};
use plant::parameters::{ParameterError, suspects};

/// A suspect with its data sheet.
#[derive(Debug)]
pub struct Suspect {
    pub declared: Declared,
    pub sheet: Sheet,
    pub place: Place,
}

/// Reads a file of suspects. What is read lives as long as the program, as the catalogue does.
///
/// # Errors
/// [`ParameterError`] with file, line and column.
pub fn read(text: &str, file: &str) -> Result<Vec<&'static Suspect>, ParameterError> {
    let all = suspects(text, file)?;
    Ok(all.into_iter().map(|declared| &*Box::leak(Box::new(Suspect::of(declared)))).collect())
}

impl Suspect {
    fn of(declared: Declared) -> Suspect {
        let kept = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
        let target = declared.target();
        let key =
            |number: &Number| key(number, kept(number.name().to_owned()), kept(number.unit().to_owned()));
        let sheet = Sheet {
            name: kept(declared.name().to_owned()),
            group: match target.kind() {
                PlaceKind::Chamber => Group::Chamber,
                PlaceKind::Channel => Group::Sensor,
                _ => Group::Motion,
            },
            place: target.kind(),
            laws: &[],
            law: kept(format!("adds {} to {}", declared.expression(), declared.place())),
            source: "a file of suspects",
            keys: Box::leak(declared.numbers().iter().map(key).collect::<Vec<_>>().into_boxed_slice()),
        };
        let place = declared.at();
        Suspect { declared, sheet, place }
    }
}

fn key(number: &Number, name: &'static str, unit: &'static str) -> EffectKey {
    let [min, max] = number.range();
    let is_amplitude = number.value() == 0.0;
    let usual = number.prior().unwrap_or(0.5 * min.abs().max(max.abs()));
    let drawn = if is_amplitude {
        let sign = if max > 0.0 { 1.0 } else { -1.0 };
        [sign * 0.1 * usual, sign * usual]
    } else {
        let (value, half) = (number.value(), number.prior().unwrap_or(0.5 * (max - min)));
        // A positive shape may be scaled by its logarithm: not down to 0.
        let least = if value > 0.0 { value / 20.0 } else { f64::NEG_INFINITY };
        [(value - half).max(min).max(least), (value + half).min(max)]
    };
    EffectKey {
        name,
        unit: plant::parameters::table::Unit::Written(unit),
        min,
        max,
        drawn,
        signed: min < 0.0 && max > 0.0,
        default: Some(number.value()),
        neutral: is_amplitude.then_some(0.0),
        meaning: "declared by the suspect",
    }
}
