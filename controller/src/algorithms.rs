//! The algorithms that can be asked for by name. A new one is a file beside these and a line in [`SHIPPED`].

pub mod force_manual;
pub mod force_p;
pub mod force_pid_map;
pub mod position_cascade;
pub mod position_p;
pub mod position_pid;

#[cfg(test)]
mod laws;

use crate::algorithm::Kind;

/// All of them.
pub const SHIPPED: &[Kind] = &[
    position_p::KIND,
    position_cascade::KIND,
    position_pid::KIND,
    force_p::KIND,
    force_pid_map::KIND,
    force_manual::KIND,
];

/// The algorithm called `name`.
#[must_use]
pub fn by_name(name: &str) -> Option<&'static Kind> {
    SHIPPED.iter().find(|kind| kind.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_its_own_and_every_default_is_allowed() {
        for (place, kind) in SHIPPED.iter().enumerate() {
            assert!(SHIPPED[..place].iter().all(|other| other.name != kind.name), "{}", kind.name);
            kind.parameters.iter().for_each(|parameter| {
                parameter.check(parameter.default).unwrap_or_else(|error| panic!("{}: {error}", kind.name));
            });
        }
    }
}
