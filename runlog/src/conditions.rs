//! `conditions.json`: the circumstances of a run that its programs do not know. `scripts/latency`, its counterpart for virtual
//! machines and the soak write it. Keys are in alphabetical order.

use serde::{Deserialize, Serialize};

/// The circumstances of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Conditions {
    /// Command that measured; absent in a soak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Runs of one group are compared with those of the others.
    pub group: Option<String>,
    /// Command line of the load generator, or `none`.
    pub load_generator: Option<String>,
    /// Number of the pair of run and reference.
    pub pair: Option<u64>,
    /// Whether a probe burned the CPUs.
    pub probe: bool,
    /// Command line of the reference.
    pub reference_command: Option<String>,
    /// Why there is no reference.
    pub reference_missing_because: Option<String>,
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Changed files in the source tree; absent in a soak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncommitted_files: Option<u64>,
}
