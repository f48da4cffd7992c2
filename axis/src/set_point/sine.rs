//! Sine: to either side of where the row stands, at one frequency; starts upwards and ends where it started.
//!
//! ```text
//!   x = x_0 + A w sin(2 pi f t)
//! ```
//!
//! A: amplitude_m or amplitude_n. f: frequency_hz. w: fade, see the module on what sine and chirp share.

use super::law::{BOTH, Kind};
use super::oscillation::Oscillation;
use settings::parameters::Parameter;

/// In the list of laws.
pub const KIND: Kind = Kind {
    name: "sine",
    about: "to either side at one frequency",
    serves: BOTH,
    read: |given| {
        let frequency_hz = given.number(&FREQUENCY)?;
        Oscillation::read(given, [frequency_hz; 2])
    },
};

static FREQUENCY: Parameter =
    Parameter::new(("frequency_hz", "Hz"), [0.001, 200.0], 1.0, "periods in a second");
