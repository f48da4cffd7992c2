//! Parameters of a controller: each a variable with name, unit, range, default and meaning, in tables.
//!
//! A part of the axis program declares its parameters once, by [`crate::parameters!`]: that makes the table, which files,
//! listings, checks and XCP read, and a struct with a field for each. Values stand in a slice in the table's order, which may
//! change between two cycles, so no part keeps a copy; the struct is read from it in each step. What enters a slice was checked
//! against its table before.

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
    /// Default value.
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
        Self::declared(name, declare(unit, range, default, meaning))
    }

    /// The parameter called `name` that is declared so.
    #[must_use]
    pub const fn declared(name: &'static str, declaration: Declaration) -> Self {
        let Declaration { unit, range: [least, most], default, meaning, whole, at_start_only } = declaration;
        Self {
            name: Cow::Borrowed(name),
            unit: Cow::Borrowed(unit),
            least,
            most,
            default,
            meaning: Cow::Borrowed(meaning),
            whole,
            at_start_only,
        }
    }

    /// The same, of whole numbers.
    #[must_use]
    pub const fn whole(mut self) -> Self {
        self.whole = true;
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

/// A parameter without its name, which is that of the field it is declared for.
#[derive(Clone, Copy, Debug)]
pub struct Declaration {
    unit: &'static str,
    range: [f64; 2],
    /// Default value.
    pub default: f64,
    meaning: &'static str,
    whole: bool,
    at_start_only: bool,
}

/// Declares a parameter.
#[must_use]
pub const fn declare(
    unit: &'static str,
    range: [f64; 2],
    default: f64,
    meaning: &'static str,
) -> Declaration {
    Declaration { unit, range, default, meaning, whole: false, at_start_only: false }
}

impl Declaration {
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
}

/// Parameters that [`crate::parameters!`] declared.
pub trait ParameterSet: Sized {
    /// Their table.
    const TABLE: &'static [Parameter];

    /// Their values from a slice in the order of the table.
    ///
    /// # Panics
    /// When it is not as long as the table.
    fn of(values: &[f64]) -> Self;
}

/// Declares parameters: a struct with a field for each, its table and its defaults.
///
/// ```
/// use settings::parameters::declare;
///
/// settings::parameters! {
///     /// Parameters of a position control.
///     pub struct Position {
///         gain_per_s: declare("1/s", [0.0, 200.0], 20.0, "velocity for each error"),
///         integral_time_s: declare("s", [0.0, 100.0], 1.0, "time in which the integral part doubles a standing error"),
///     }
/// }
///
/// let p = Position::of(&[30.0, 2.0]);
/// assert_eq!((p.gain_per_s, p.integral_time_s), (30.0, 2.0));
/// assert_eq!(Position::TABLE[1].name, "integral_time_s");
/// assert_eq!(Position::default().gain_per_s, 20.0);
/// ```
///
/// A name that is no name of a field stands behind it. The place of a parameter in the table has its field's name:
///
/// ```
/// use settings::parameters::declare;
///
/// settings::parameters! {
///     struct Controls {
///         length as "trace.length_samples": declare("", [1.0, 4096.0], 1000.0, "samples in all").whole(),
///     }
/// }
///
/// assert_eq!((&*Controls::TABLE[0].name, Controls::default().length), ("trace.length_samples", 1000.0));
/// assert_eq!(Controls::length, 0);
/// ```
///
/// The parameter of another algorithm does not compile, as a field or as a whole:
///
/// ```compile_fail,E0609
/// # use settings::parameters::declare;
/// # settings::parameters! { struct Position { gain_per_s: declare("1/s", [0.0, 200.0], 20.0, "velocity for each error"), } }
/// # settings::parameters! { struct Force { gain_m_per_n_s: declare("m/(N s)", [0.0, 0.05], 0.01, "velocity for each error"), } }
/// let velocity_m_per_s = 0.01 * Position::default().gain_m_per_n_s;
/// ```
///
/// ```compile_fail,E0308
/// # use settings::parameters::declare;
/// # settings::parameters! { struct Position { gain_per_s: declare("1/s", [0.0, 200.0], 20.0, "velocity for each error"), } }
/// # settings::parameters! { struct Force { gain_m_per_n_s: declare("m/(N s)", [0.0, 0.05], 0.01, "velocity for each error"), } }
/// fn position_control(error_m: f64, parameters: &Position) -> f64 {
///     parameters.gain_per_s * error_m
/// }
/// let velocity_m_per_s = position_control(0.01, &Force::default());
/// ```
///
/// Nor does a place in place of a name:
///
/// ```compile_fail,E0608
/// # use settings::parameters::declare;
/// # settings::parameters! { struct Position { gain_per_s: declare("1/s", [0.0, 200.0], 20.0, "velocity for each error"), } }
/// let velocity_m_per_s = 0.01 * Position::default()[0];
/// ```
#[macro_export]
macro_rules! parameters {
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $key:literal) => { $key };
    ($(#[$about:meta])* $visibility:vis struct $name:ident {
        $($field:ident $(as $key:literal)?: $declaration:expr,)+
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(missing_docs)] // what a field means stands in the table
        $visibility struct $name { $($visibility $field: f64,)+ }

        impl $name {
            /// Name, unit, range, default and meaning of each.
            $visibility const TABLE: &'static [$crate::parameters::Parameter] =
                &[$($crate::parameters::Parameter::declared($crate::parameters!(@name $field $($key)?), $declaration)),+];

            /// The values of a slice in the order of the table.
            ///
            /// # Panics
            /// When it is not as long as the table.
            #[must_use]
            #[inline]
            $visibility fn of(values: &[f64]) -> Self {
                let &[$($field),+] = values else {
                    panic!("{} values for {} parameters", values.len(), Self::TABLE.len())
                };
                Self { $($field),+ }
            }
        }

        const _: () = {
            #[allow(non_camel_case_types)]
            enum Place { $($field),+ }

            #[allow(dead_code, non_upper_case_globals)] // few tables are read by place
            impl $name {
                $(/// Its place in the table.
                $visibility const $field: usize = Place::$field as usize;)+
            }
        };

        impl $crate::parameters::ParameterSet for $name {
            const TABLE: &'static [$crate::parameters::Parameter] = Self::TABLE;

            #[inline]
            fn of(values: &[f64]) -> Self {
                Self::of(values)
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: const { $declaration }.default),+ }
            }
        }
    };
}

/// A value that its parameter does not allow.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct OutOfRange(String);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_out_of_range_is_refused_with_name_value_unit_and_range() {
        let gain = Parameter::new(("gain_per_s", "1/s"), [0.0, 200.0], 25.0, "velocity for each error");
        assert_eq!(gain.check(200.0), Ok(200.0));
        for bad in [-0.1, 200.1, f64::NAN, f64::INFINITY] {
            let message = gain.check(bad).unwrap_err().to_string();
            assert!(message.starts_with("gain_per_s = ") && message.contains("0 to 200 1/s"), "{message}");
        }
    }

    #[test]
    fn a_parameter_without_a_unit_is_printed_without_a_space_in_its_place() {
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
        let declaration = declare("s", [0.1, 600.0], 15.0, "how long").at_start_only();
        let timeout = Parameter::declared("timeout_s", declaration);
        assert_eq!(timeout.check(20.0), Ok(20.0));
        let message = timeout.check_change(20.0).unwrap_err().to_string();
        assert!(message.starts_with("timeout_s = 20") && message.contains("at the start only"), "{message}");
    }
}
