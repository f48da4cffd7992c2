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
    /// Only whole numbers.
    pub whole: bool,
    /// It is read once: a change while running would do nothing, and is refused.
    pub at_start_only: bool,
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
            whole: false,
            at_start_only: false,
        }
    }

    /// The same, of whole numbers.
    #[must_use]
    pub const fn whole(mut self) -> Self {
        self.whole = true;
        self
    }

    /// The same, read once, at the start.
    #[must_use]
    pub const fn at_start_only(mut self) -> Self {
        self.at_start_only = true;
        self
    }

    /// Whether `value` lies in the range; NaN lies in none. For the 1 ms path, which makes no texts.
    #[must_use]
    pub fn allows(&self, value: f64) -> bool {
        (self.least..=self.most).contains(&value) && !(self.whole && value.fract() != 0.0)
    }

    /// `value` if it lies in the range; NaN lies in none.
    ///
    /// # Errors
    /// [`OutOfRange`] with name, value and range.
    pub fn check(&self, value: f64) -> Result<f64, OutOfRange> {
        if self.allows(value) {
            return Ok(value);
        }
        let Self { name, unit, least, most, .. } = self;
        let allowed = if self.whole { "a whole number, " } else { "" };
        let with_unit = |text: String| if unit.is_empty() { text } else { format!("{text} {unit}") };
        let (value, range) = (with_unit(value.to_string()), with_unit(format!("{least} to {most}")));
        Err(OutOfRange(format!("{name} = {value}; allowed is {allowed}{range}")))
    }

    /// [`Parameter::check`] for a change while running.
    ///
    /// # Errors
    /// [`OutOfRange`] for a value that is not allowed, and for any of a parameter that is read once.
    pub fn check_change(&self, value: f64) -> Result<f64, OutOfRange> {
        if self.at_start_only {
            let name = &self.name;
            return Err(OutOfRange(format!("{name} = {value}: it is read at the start only; start again")));
        }
        self.check(value)
    }
}

/// A value that its parameter does not allow.
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

    #[test]
    fn a_parameter_without_a_unit_is_told_without_a_space_in_its_place() {
        let share = Parameter::new(("share", ""), [0.0, 2.0], 1.0, "share");
        assert_eq!(share.check(3.0).unwrap_err().to_string(), "share = 3; allowed is 0 to 2");
    }

    #[test]
    fn a_whole_number_is_not_rounded_but_asked_for() {
        let every = Parameter::new(("every_cycles", "cycles"), [1.0, 1000.0], 1.0, "multiple").whole();
        assert_eq!(every.check(2.0), Ok(2.0));
        let message = every.check(2.5).unwrap_err().to_string();
        assert_eq!(message, "every_cycles = 2.5 cycles; allowed is a whole number, 1 to 1000 cycles");
    }

    #[test]
    fn what_is_read_once_may_be_set_but_not_changed() {
        let timeout = Parameter::new(("timeout_s", "s"), [0.1, 600.0], 15.0, "how long").at_start_only();
        assert_eq!(timeout.check(20.0), Ok(20.0));
        let message = timeout.check_change(20.0).unwrap_err().to_string();
        assert!(message.starts_with("timeout_s = 20") && message.contains("at the start only"), "{message}");
    }
}
