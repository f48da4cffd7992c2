//! Interrupts and sibling CPUs, with which a loop shares its CPU and its core.
//!
//! # Source
//! `Documentation/core-api/irq/irq-affinity` and `ABI/testing/sysfs-devices-system-cpu` in the kernel's tree.

use super::text::stored_as_text;
use serde::{Deserialize, Serialize};
use std::fmt;

const MAY_COME: &str = "may come: ";
const DO_COME: &str = "; do come: ";
const NONE: &str = "none";

/// Interrupts of a CPU. Its text is the line in `run.json`, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum InterruptRoute {
    /// What the affinities of all interrupts say of the CPU.
    Known {
        /// Numbers of the interrupts that are allowed on the CPU, in the kernel's form; `None`: no interrupt is.
        allowed: Option<String>,
        /// Numbers and names of the interrupts that the kernel sends to the CPU; `None`: no interrupt.
        routed: Option<String>,
    },
    /// A line that this version does not write: it is not known which interrupts come.
    Other(String),
}

impl fmt::Display for InterruptRoute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known { allowed, routed } => {
                let [allowed, routed] = [allowed, routed].map(|list| list.as_deref().unwrap_or(NONE));
                write!(f, "{MAY_COME}{allowed}{DO_COME}{routed}")
            }
            Self::Other(line) => f.write_str(line),
        }
    }
}

impl From<&str> for InterruptRoute {
    fn from(line: &str) -> Self {
        let list = |list: &str| (list != NONE).then(|| list.to_owned());
        match line.strip_prefix(MAY_COME).and_then(|lists| lists.split_once(DO_COME)) {
            Some((allowed, routed)) => Self::Known { allowed: list(allowed), routed: list(routed) },
            None => Self::Other(line.to_owned()),
        }
    }
}

const NO_SHARED_CORE: &str = "no CPUs share a core";
const SHARED_CORES: &str = "CPUs that share a core: ";
const BETWEEN_CORES: &str = "; ";
const CONTROL: &str = " (control: ";

/// Simultaneous multithreading: CPUs that share a core. Its text is the line in `run.json`, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum SharedCores {
    /// Each CPU has a core of its own.
    NoneShared {
        /// Content of the kernel's file `smt/control`.
        control: Option<String>,
    },
    /// Cores with more than one CPU.
    Shared {
        /// The CPUs of each such core, in the kernel's form: `0,2` or `0-1`.
        cores: Vec<String>,
        /// Content of the kernel's file `smt/control`.
        control: Option<String>,
    },
    /// A line that this version does not write: it is not known which CPUs share a core. Empty where nothing was recorded.
    Other(String),
}

impl fmt::Display for SharedCores {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let control = match self {
            Self::NoneShared { control } => {
                f.write_str(NO_SHARED_CORE)?;
                control
            }
            Self::Shared { cores, control } => {
                write!(f, "{SHARED_CORES}{}", cores.join(BETWEEN_CORES))?;
                control
            }
            Self::Other(line) => return f.write_str(line),
        };
        control.as_ref().map_or(Ok(()), |control| write!(f, "{CONTROL}{control})"))
    }
}

impl From<&str> for SharedCores {
    fn from(line: &str) -> Self {
        let (cores, control) = match line.split_once(CONTROL) {
            Some((cores, rest)) => match rest.strip_suffix(')') {
                Some(control) => (cores, Some(control.to_owned())),
                None => return Self::Other(line.to_owned()),
            },
            None => (line, None),
        };
        if cores == NO_SHARED_CORE {
            return Self::NoneShared { control };
        }
        match cores.strip_prefix(SHARED_CORES) {
            Some(cores) => {
                Self::Shared { cores: cores.split(BETWEEN_CORES).map(str::to_owned).collect(), control }
            }
            None => Self::Other(line.to_owned()),
        }
    }
}

stored_as_text!(InterruptRoute, SharedCores);
