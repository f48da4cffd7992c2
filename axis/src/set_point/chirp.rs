//! Chirp: to either side of where the row stands, with a frequency that sweeps linearly over time.
//!
//! ```text
//!   x = x_0 + A w sin(2 pi (f_0 t + (f_1 - f_0) t^2 / (2 T)))
//! ```
//!
//! A: amplitude_m or amplitude_n. f_0, f_1: from_hz, to_hz. T: duration_s. w: fade, see the module on what sine and chirp share.

use super::law::{BOTH, Kind};
use super::oscillation::Oscillation;
use settings::parameters::Parameter;

/// In the list of laws.
pub const KIND: Kind = Kind {
    name: "chirp",
    about: "to either side at a frequency that sweeps",
    serves: BOTH,
    read: |given| {
        let frequencies_hz = [given.number(&FROM)?, given.number(&TO)?];
        Oscillation::read(given, frequencies_hz)
    },
};

static FROM: Parameter = Parameter::new(("from_hz", "Hz"), [0.001, 200.0], 0.1, "frequency at the start");
static TO: Parameter = Parameter::new(("to_hz", "Hz"), [0.001, 200.0], 10.0, "frequency at the end");
