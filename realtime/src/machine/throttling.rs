//! RT throttling. A thread that never sleeps is stopped for the rest of each period.
//!
//! # Source
//! `Documentation/scheduler/sched-rt-group` in the kernel's tree.

use super::files::Root;
use super::text::stored_as_text;
use serde::{Deserialize, Serialize};
use std::fmt;

/// RT throttling: settings and effect.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Throttling {
    /// What real-time threads may have of each period, us; -1: all; null: unknown.
    pub runtime_us: Option<i64>,
    /// The period, us.
    pub period_us: Option<i64>,
    /// Effect of both.
    pub about: ThrottlingState,
}

impl Throttling {
    pub(super) fn read(root: &Root) -> Self {
        let runtime_us = root.number("proc/sys/kernel/sched_rt_runtime_us");
        let period_us = root.number("proc/sys/kernel/sched_rt_period_us");
        let about = match (runtime_us, period_us) {
            (Some(-1), _) => ThrottlingState::Off,
            (Some(runtime_us), Some(period_us)) if runtime_us < period_us => {
                ThrottlingState::On { runtime_us, period_us }
            }
            (Some(_), Some(_)) => ThrottlingState::WithoutEffect,
            _ => ThrottlingState::Unreadable,
        };
        Self { runtime_us, period_us, about }
    }
}

/// Whether real-time threads are stopped. Its text is the line in `run.json`, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum ThrottlingState {
    /// They are never stopped.
    Off,
    /// They may have a part of each period.
    On {
        /// That part, us.
        runtime_us: i64,
        /// The period, us.
        period_us: i64,
    },
    /// They may have all of each period.
    WithoutEffect,
    /// The kernel's settings could not be read.
    Unreadable,
    /// A line that this version does not write: it is not known whether they are stopped. Empty where nothing was recorded.
    Other(String),
}

impl fmt::Display for ThrottlingState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("off"),
            Self::On { runtime_us, period_us } => write!(f, "on: {runtime_us} us of each {period_us} us"),
            Self::WithoutEffect => f.write_str("without effect: all of each period"),
            Self::Unreadable => f.write_str("unknown: /proc/sys/kernel/sched_rt_runtime_us cannot be read"),
            Self::Other(line) => f.write_str(line),
        }
    }
}

impl From<&str> for ThrottlingState {
    fn from(line: &str) -> Self {
        let on = || {
            let (runtime, period) =
                line.strip_prefix("on: ")?.strip_suffix(" us")?.split_once(" us of each ")?;
            Some(Self::On { runtime_us: runtime.parse().ok()?, period_us: period.parse().ok()? })
        };
        let known = [Self::Off, Self::WithoutEffect, Self::Unreadable].into_iter().chain(on());
        // A number may be written in more than one way; its line is kept as it stands then.
        known
            .into_iter()
            .find(|state| state.to_string() == line)
            .unwrap_or_else(|| Self::Other(line.to_owned()))
    }
}

stored_as_text!(ThrottlingState);
