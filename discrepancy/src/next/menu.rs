//! The menu: experiments that the controller can run and that tell effects apart, as files of `discrepancy/experiments`.
//!
//! Each drives both axes, so that it serves whichever has the effect, takes 13 to 20 s, and stays away from the ends of the
//! stroke. Tests hold every file to that, with the baseline and with the controllers' own reader.

use axis_control::setup::Inputs as Files;
use plant::RigParameters;

/// An experiment of the menu.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Its title, and its file without `.toml`.
    pub name: &'static str,
    /// What it tells apart, as the end of "to tell ... apart".
    pub purpose: &'static str,
    /// Text of its experiment file.
    pub toml: &'static str,
}

impl Entry {
    /// Name of the file in which it is proposed.
    pub(crate) fn file(&self) -> String {
        format!("next-{}.toml", self.name)
    }

    /// How long it is without initial positioning, s, with its file as shipped.
    pub(crate) fn length_s(&self) -> f64 {
        let files = Files::of_texts(&RigParameters::baseline(), (self.name, self.toml), program, &[]);
        files.map_or(f64::INFINITY, |files| files.experiment.duration_s())
    }

    /// Whether its file has the rods linked.
    pub fn is_linked(&self) -> bool {
        self.toml.lines().any(|line| line.trim_end() == "linked = true")
    }
}

macro_rules! menu {
    ($($name:literal: $purpose:literal,)*) => {
        /// All of them; of equals the first is proposed.
        pub const MENU: &[Entry] = &[
            $(Entry { name: $name, purpose: $purpose, toml: include_str!(concat!("../../experiments/", $name, ".toml")) },)*
        ];
    };
}

menu! {
    "shut-and-hold": "leakage, and dead zone, hysteresis and offset of the valve",
    "chirps": "delays and lags",
    "ends": "volume, position offset and what the gas does with its heat",
    "valve-steps": "rate limit, second order and delay of the spool",
    "full-exhaust": "silencer, restrictions and exhaust edges",
    "slow-reversals": "bristles, Stribeck's curve, break-away and what turns with the direction",
    "weights": "inertia, gains of sensors and what of the friction grows with the pressure",
    "load-steps": "gap and stiffness of the linkage, droop of the supply",
}

/// Text of a shipped program that the menu uses.
pub(crate) fn program(name: &str) -> Option<String> {
    let text = match name {
        "position-pid" => include_str!("../../../controller/programs/position-pid.toml"),
        "position-linked" => include_str!("../../../controller/programs/position-linked.toml"),
        "force-pid-map" => include_str!("../../../controller/programs/force-pid-map.toml"),
        _ => return None,
    };
    Some(text.to_owned())
}
