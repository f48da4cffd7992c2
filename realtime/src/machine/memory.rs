//! Memory and what may be taken from it, limits of the process, load.

use super::files::{Root, field};
use serde::{Deserialize, Serialize};

/// Memory, swap, huge pages.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Memory {
    /// All of it, KiB; null: unknown.
    pub total_kib: Option<u64>,
    /// What could be had without swapping, KiB.
    pub available_kib: Option<u64>,
    /// Swap space, KiB.
    pub swap_total_kib: Option<u64>,
    /// Swap space in use, KiB.
    pub swap_used_kib: Option<u64>,
    /// `vm.swappiness`, 0 to 200.
    pub swappiness: String,
    /// Transparent huge pages, as in `enabled`: the word in brackets is in force.
    pub transparent_huge_pages: String,
}

impl Memory {
    pub(super) fn read(root: &Root) -> Self {
        let text = root.text("proc/meminfo").unwrap_or_default();
        let kib = |name: &str| field(&text, name)?.trim_end_matches("kB").trim().parse::<u64>().ok();
        let swap_total_kib = kib("SwapTotal");
        let used = |total: u64| Some(total.saturating_sub(kib("SwapFree")?));
        Self {
            total_kib: kib("MemTotal"),
            available_kib: kib("MemAvailable"),
            swap_total_kib,
            swap_used_kib: swap_total_kib.and_then(used),
            swappiness: root.fact("proc/sys/vm/swappiness"),
            transparent_huge_pages: root.fact("sys/kernel/mm/transparent_hugepage/enabled"),
        }
    }
}

/// What this process may ask of the system; a right such as CAP_SYS_NICE, which root has, goes beyond.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Limits {
    /// Highest FIFO priority, 0: none.
    pub rtprio: String,
    /// Memory that may be locked, bytes.
    pub memlock: String,
    /// Open files.
    pub nofile: String,
}

impl Limits {
    pub(super) fn read(root: &Root) -> Self {
        let text = root.text("proc/self/limits").unwrap_or_default();
        // "Max locked memory         8388608              8388608              bytes": name, soft limit, hard limit.
        let soft = |name: &str| {
            let rest = text.lines().find_map(|line| line.strip_prefix(name));
            let soft = rest.and_then(|rest| rest.split_whitespace().next());
            soft.map_or_else(|| format!("unknown: no '{name}' in /proc/self/limits"), str::to_owned)
        };
        Self {
            rtprio: soft("Max realtime priority"),
            memlock: soft("Max locked memory"),
            nofile: soft("Max open files"),
        }
    }
}

pub(super) fn load_average(root: &Root) -> String {
    let text = root.fact("proc/loadavg");
    if text.starts_with("unknown") {
        return text;
    }
    text.split_whitespace().take(3).collect::<Vec<_>>().join(" ")
}
