//! Control algorithms of an axis. A new one is a file beside these and a line in [`SHIPPED`].
//!
//! | file | holds |
//! |---|---|
//! | [`algorithm`] | what an algorithm gets, what it returns, how it is listed |
//! | [`guard`] | supervises an algorithm: its result must be finite and come within its time limit |
//! | [`linearisation`] | from a velocity to a valve opening |
//! | [`rest_zone`] | when a rod is left alone |
//! | `laws` | what every algorithm must keep; in tests alone |
//! | the others | one algorithm each |

#![warn(missing_docs)] // an interface of other crates

pub mod algorithm;
mod force_manual;
mod force_p;
mod force_pid_map;
pub mod guard;
pub mod linearisation;
mod position_cascade;
mod position_p;
mod position_pid;
pub mod rest_zone;

#[cfg(test)]
mod laws;

use crate::algorithm::Kind;

/// The algorithms that a program file can name.
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
