//! What a law is, the list of those that depend on time alone, and how they are read.
//!
//! A law knows where its row stands when it begins, and tells value, rate and acceleration at a time since then. Its unit is the
//! row's, m or N: the same law moves an axis and leads a force, and only its keys differ (`to_m`, `to_n`).
//! A new law is a file beside this one and a line in [`KINDS`].

use super::{bestehorn, modified_sine, oscillation, pseudo_random_steps, ramp, step, table, trapezoidal};
use algorithms::algorithm::Quantity;
use settings::parameters::Parameter;
use settings::{Section, SettingsError};
use std::fmt;
use std::sync::Arc;

/// Laws that depend on time alone; [`KINDS` of forces](super::force::KINDS) are those that depend on the axis.
pub const KINDS: &[Kind] = &[
    bestehorn::KIND,
    modified_sine::KIND,
    trapezoidal::KIND,
    step::KIND,
    ramp::KIND,
    step::REST,
    step::CONSTANT,
    oscillation::SINE,
    oscillation::CHIRP,
    pseudo_random_steps::KIND,
    table::KIND,
];

pub struct Kind {
    pub name: &'static str,
    pub about: &'static str,
    pub serves: &'static [Quantity],
    pub(crate) read: fn(&mut Given<'_, '_>) -> Result<Arc<dyn Law>, SettingsError>,
}

pub(super) const BOTH: &[Quantity] = &[Quantity::Position, Quantity::Force];

/// A value over time, from where the row stands.
pub trait Law: fmt::Debug + Send + Sync {
    /// Value and derivatives `time_s` after the beginning, 0 to the duration.
    fn at(&self, time_s: f64) -> Moment;
    /// What it takes and where it goes; asked when it is read, not while it runs.
    fn extent(&self) -> Extent;
}

#[derive(Clone, Copy, Debug)]
pub struct Extent {
    pub(super) duration_s: f64,
    /// The value from its end on.
    pub(super) end: f64,
    /// Least and largest value on the way.
    pub(super) reach: [f64; 2],
}

impl Extent {
    /// Of a way from one value to another.
    pub(super) fn between(from: f64, to: f64, duration_s: f64) -> Self {
        Self { duration_s, end: to, reach: [from.min(to), from.max(to)] }
    }

    /// Of deviations to either side that end in the middle, also when they are over before they have been to both.
    pub(super) fn around(middle: f64, amplitude: f64, duration_s: f64) -> Self {
        Self { duration_s, end: middle, reach: [middle - amplitude, middle + amplitude] }
    }
}

/// Value and derivatives at a time, in the unit of the row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    pub(crate) acceleration: f64,
    pub(crate) moving: bool,
}

impl Moment {
    pub(crate) const fn at_rest(value: f64) -> Self {
        Self { value, rate: 0.0, acceleration: 0.0, moving: false }
    }
}

/// A way along a shape s(z) with z = t / T, both 0 to 1.
pub(super) struct Shaped {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) duration_s: f64,
    /// s, s' and s'' at z.
    pub(super) shape: fn(f64) -> [f64; 3],
}

impl Shaped {
    /// Reads the way to a place, which takes `least_s` or longer.
    pub(super) fn read(
        given: &mut Given<'_, '_>,
        least_s: f64,
        shape: fn(f64) -> [f64; 3],
    ) -> Result<Arc<dyn Law>, SettingsError> {
        let to = given.place("to", "where it ends")?;
        Ok(Arc::new(Self { from: given.from, to, duration_s: given.duration_s(least_s)?, shape }))
    }
}

impl Law for Shaped {
    fn at(&self, time_s: f64) -> Moment {
        let [s, ds_dz, d2s_dz2] = (self.shape)((time_s / self.duration_s).clamp(0.0, 1.0));
        let way = self.to - self.from;
        Moment {
            value: self.from + way * s,
            rate: way * ds_dz / self.duration_s,
            acceleration: way * d2s_dz2 / (self.duration_s * self.duration_s),
            moving: way != 0.0,
        }
    }

    fn extent(&self) -> Extent {
        Extent::between(self.from, self.to, self.duration_s)
    }
}

impl fmt::Debug for Shaped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "from {} to {} in {} s", self.from, self.to, self.duration_s)
    }
}

/// What a row is of and how far it may go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    pub(crate) quantity: Quantity,
    pub(crate) stroke_m: f64,
    pub(crate) force_limit_n: f64,
}

impl Scale {
    /// Largest value of the row; the least is 0.
    pub(crate) fn most(&self) -> f64 {
        match self.quantity {
            Quantity::Position => self.stroke_m,
            Quantity::Force => self.force_limit_n,
        }
    }

    pub(crate) fn unit(&self) -> &'static str {
        match self.quantity {
            Quantity::Position => "m",
            Quantity::Force => "N",
        }
    }
}

const LONGEST_S: f64 = 86_400.0;

/// The table of one segment, and where its row stands.
pub(crate) struct Given<'g, 'a> {
    pub(crate) section: &'g mut Section<'a>,
    pub(crate) from: f64,
    pub(crate) scale: Scale,
}

impl Given<'_, '_> {
    /// A value of the row's own unit that must be given: `to` reads `to_m` or `to_n`.
    pub(crate) fn place(&mut self, stem: &str, meaning: &'static str) -> Result<f64, SettingsError> {
        let parameter = self.in_unit(stem, self.scale.most(), meaning);
        self.section.needed_number(&parameter)
    }

    /// A deviation to both sides that must be given.
    pub(crate) fn amplitude(&mut self) -> Result<f64, SettingsError> {
        let parameter = self.in_unit("amplitude", 0.5 * self.scale.most(), "deviation to either side");
        self.section.needed_number(&parameter)
    }

    /// A number of the row's unit, named `stem` with the unit behind it, from 0 to `most`.
    fn in_unit(&self, stem: &str, most: f64, meaning: &'static str) -> Parameter {
        let name = format!("{stem}_{}", self.scale.unit().to_lowercase());
        let parameter = Parameter::new(("", self.scale.unit()), [0.0, most], 0.0, meaning);
        Parameter { name: name.into(), ..parameter }
    }

    pub(crate) fn duration_s(&mut self, least_s: f64) -> Result<f64, SettingsError> {
        self.number(&Parameter::new(("duration_s", "s"), [least_s, LONGEST_S], 1.0, "how long it takes"))
    }

    pub(crate) fn number(&mut self, parameter: &Parameter) -> Result<f64, SettingsError> {
        self.section.needed_number(parameter)
    }
}
