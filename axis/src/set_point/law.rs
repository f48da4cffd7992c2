//! Laws of set-points over time: their interface, the list of those that depend on time alone, and how they are read.
//!
//! A law starts from the end value of the segment before it, and gives value, rate and acceleration at a time since its start.
//! Its unit is the row's, m or N: the same law moves an axis and leads a force, and only its keys differ (`to_m`, `to_n`).
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

/// A law of time that an experiment file can name.
pub struct Kind {
    /// Name in an experiment file, the value of `law`.
    pub name: &'static str,
    /// What it does, in a clause for lists.
    pub about: &'static str,
    /// Quantities whose rows may have it.
    pub serves: &'static [Quantity],
    pub(crate) read: fn(&mut SegmentReader<'_, '_>) -> Result<Arc<dyn Law>, SettingsError>,
}

pub(super) const BOTH: &[Quantity] = &[Quantity::Position, Quantity::Force];

/// A value over time, from the end value of the segment before it.
pub(crate) trait Law: fmt::Debug + Send + Sync {
    /// Value and derivatives `time_s` after the beginning, 0 to the duration.
    fn at(&self, time_s: f64) -> ProfilePoint;
    /// Its duration, end value and range; read when the experiment is loaded, not while it runs.
    fn extent(&self) -> Extent;
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub(super) duration_s: f64,
    /// The value from its end on.
    pub(super) end: f64,
    /// Least and largest value in between.
    pub(super) reach: [f64; 2],
}

impl Extent {
    /// Of a transition from one value to another.
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
pub struct ProfilePoint {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    pub(crate) acceleration: f64,
    pub(crate) moving: bool,
}

impl ProfilePoint {
    pub(crate) const fn at_rest(value: f64) -> Self {
        Self { value, rate: 0.0, acceleration: 0.0, moving: false }
    }
}

/// A transition along a normalised shape s(z) with z = t / T, both 0 to 1.
pub(super) struct ShapedTransition {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) duration_s: f64,
    /// s, s' and s'' at z.
    pub(super) shape: fn(f64) -> [f64; 3],
}

impl ShapedTransition {
    /// Reads a transition to an end value, which takes `least_s` or longer.
    pub(super) fn read(
        reader: &mut SegmentReader<'_, '_>,
        least_s: f64,
        shape: fn(f64) -> [f64; 3],
    ) -> Result<Arc<dyn Law>, SettingsError> {
        let to = reader.value("to", "where it ends")?;
        Ok(Arc::new(Self { from: reader.from, to, duration_s: reader.duration_s(least_s)?, shape }))
    }
}

impl Law for ShapedTransition {
    fn at(&self, time_s: f64) -> ProfilePoint {
        let [s, ds_dz, d2s_dz2] = (self.shape)((time_s / self.duration_s).clamp(0.0, 1.0));
        let span = self.to - self.from;
        ProfilePoint {
            value: self.from + span * s,
            rate: span * ds_dz / self.duration_s,
            acceleration: span * d2s_dz2 / (self.duration_s * self.duration_s),
            moving: span != 0.0,
        }
    }

    fn extent(&self) -> Extent {
        Extent::between(self.from, self.to, self.duration_s)
    }
}

impl fmt::Debug for ShapedTransition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "from {} to {} in {} s", self.from, self.to, self.duration_s)
    }
}

/// Quantity of a row and its limits.
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

/// The table of one segment, the value at which the segment starts, and the scale of its row.
pub(crate) struct SegmentReader<'g, 'a> {
    pub(crate) section: &'g mut Section<'a>,
    pub(crate) from: f64,
    pub(crate) scale: Scale,
}

impl SegmentReader<'_, '_> {
    /// A value of the row's own unit that must be given: `to` reads `to_m` or `to_n`.
    pub(crate) fn value(&mut self, stem: &str, meaning: &'static str) -> Result<f64, SettingsError> {
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
