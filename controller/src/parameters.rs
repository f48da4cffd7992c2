//! Parameters of a controller: each a variable with name, unit, range, default and meaning, in tables.
//!
//! A part of the axis program has a table and reads its values from a slice in the table's order; the slice may change between
//! two cycles, so no part keeps a copy. What enters a slice was checked against its table before.

use std::borrow::Cow;

/// One parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name as it stands in files, ending in its unit.
    pub name: Cow<'static, str>,
    /// Unit for people.
    pub unit: Cow<'static, str>,
    /// Smallest allowed value.
    pub least: f64,
    /// Largest allowed value.
    pub most: f64,
    /// Value when nothing is said.
    pub default: f64,
    /// What it does.
    pub meaning: Cow<'static, str>,
}

impl Parameter {
    /// A parameter with its `range`, default and meaning.
    #[must_use]
    pub const fn new(
        (name, unit): (&'static str, &'static str),
        range: [f64; 2],
        default: f64,
        meaning: &'static str,
    ) -> Self {
        let [least, most] = range;
        Self {
            name: Cow::Borrowed(name),
            unit: Cow::Borrowed(unit),
            least,
            most,
            default,
            meaning: Cow::Borrowed(meaning),
        }
    }

    /// `value` if it lies in the range; NaN lies in none.
    ///
    /// # Errors
    /// [`OutOfRange`] with name, value and range.
    pub fn check(&self, value: f64) -> Result<f64, OutOfRange> {
        if (self.least..=self.most).contains(&value) {
            return Ok(value);
        }
        let Self { name, unit, least, most, .. } = self;
        Err(OutOfRange(format!("{name} = {value} {unit}; allowed is {least} to {most} {unit}")))
    }
}

/// A value outside its parameter's range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct OutOfRange(String);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_out_of_range_is_told_with_name_value_unit_and_range() {
        let gain = Parameter::new(("gain_per_s", "1/s"), [0.0, 200.0], 25.0, "velocity for each error");
        assert_eq!(gain.check(200.0), Ok(200.0));
        for bad in [-0.1, 200.1, f64::NAN, f64::INFINITY] {
            let message = gain.check(bad).unwrap_err().to_string();
            assert!(message.starts_with("gain_per_s = ") && message.contains("0 to 200 1/s"), "{message}");
        }
    }
}
