//! Frequency policies: who sets the clock of which CPUs.
//!
//! # Source
//! `Documentation/admin-guide/pm/cpufreq` in the kernel's tree.

use super::text::stored_as_text;
use serde::{Deserialize, Serialize};
use std::fmt;

const NO_CPUFREQ: &str = "no cpufreq";
const GOVERNOR: &str = ": governor ";

/// Rule by which the kernel sets the frequency of CPUs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Governor {
    /// The highest frequency that the policy allows, at all times.
    Performance,
    /// Any other governor by its name, or `unknown`: the frequency may change.
    Other(String),
}

impl fmt::Display for Governor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Performance => "performance",
            Self::Other(name) => name,
        })
    }
}

impl From<&str> for Governor {
    fn from(name: &str) -> Self {
        if name == "performance" { Self::Performance } else { Self::Other(name.to_owned()) }
    }
}

/// Frequency control of a group of CPUs. Its text is the line in `run.json`, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum FrequencyPolicy {
    /// This kernel has no frequency control.
    NoCpufreq {
        /// Text after `no cpufreq`, its colon included.
        explanation: String,
    },
    /// The CPUs of a policy and their governor.
    Policy {
        /// The CPUs, such as `CPUs 0,1`.
        cpus: String,
        /// Their governor.
        governor: Governor,
        /// Text after the governor, its comma included: driver, lowest and highest frequency.
        range: String,
    },
    /// A line that this version does not write: the governor is not known.
    Other(String),
}

impl FrequencyPolicy {
    /// The line of a kernel without frequency control.
    pub(super) fn no_cpufreq() -> Self {
        Self::NoCpufreq { explanation: ": whoever sets the frequency is not in this kernel".to_owned() }
    }
}

impl fmt::Display for FrequencyPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCpufreq { explanation } => write!(f, "{NO_CPUFREQ}{explanation}"),
            Self::Policy { cpus, governor, range } => write!(f, "{cpus}{GOVERNOR}{governor}{range}"),
            Self::Other(line) => f.write_str(line),
        }
    }
}

impl From<&str> for FrequencyPolicy {
    fn from(line: &str) -> Self {
        if let Some(explanation) = line.strip_prefix(NO_CPUFREQ) {
            return Self::NoCpufreq { explanation: explanation.to_owned() };
        }
        let Some((cpus, rest)) = line.split_once(GOVERNOR) else { return Self::Other(line.to_owned()) };
        let (governor, range) = rest.split_at(rest.find(',').unwrap_or(rest.len()));
        Self::Policy { cpus: cpus.to_owned(), governor: governor.into(), range: range.to_owned() }
    }
}

stored_as_text!(FrequencyPolicy);
