//! Ramp: at one rate from where the row stands to a place; the rate jumps at either end.
//!
//! ```text
//!   s(z) = z
//! ```

use super::law::{BOTH, Kind, Shaped};
use std::sync::Arc;

/// In the list of laws.
pub const KIND: Kind = Kind {
    name: "ramp",
    about: "at one rate to a place",
    serves: BOTH,
    read: |given| {
        let to = given.place("to", "where it ends")?;
        Ok(Arc::new(Shaped { from: given.from, to, duration_s: given.duration_s(0.001)?, shape: at }))
    },
};

/// s(z), s'(z) and s''(z) for z in 0 to 1.
fn at(z: f64) -> [f64; 3] {
    [z, 1.0, 0.0]
}
