//! Ramp: at one rate from where the row stands to a place; the rate jumps at either end.
//!
//! ```text
//!   s(z) = z
//! ```

use super::law::{BOTH, Kind, ShapedTransition};

pub(super) const KIND: Kind = Kind {
    name: "ramp",
    about: "at one rate to a place",
    serves: BOTH,
    read: |reader| ShapedTransition::read(reader, 0.001, |z| [z, 1.0, 0.0]),
};
