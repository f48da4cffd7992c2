//! Facts of the machine without which a latency figure means nothing: kernel, processors, interrupts, memory, limits, build.
//!
//! Two figures can be compared when the machines under them are known; a reader who doubts a figure asks first for the
//! preemption model, the governor, the hypervisor and the throttle. So all of it is read once, at the start of a run, and
//! stands in its record. What cannot be read says so, with the reason: absence must not look like a good answer.
//!
//! | file | holds |
//! |---|---|
//! | `files` | reading below a root, so that tests bring their own `/proc` and `/sys` |
//! | `kernel` | preemption model |
//! | `hypervisor` | signs of a hypervisor, QEMU's emulation of the processor |
//! | `throttling` | RT throttling |
//! | `processors` | model, SMT, frequency, idle states, which CPU takes which interrupt |
//! | `frequency` | frequency policy and governor of CPUs |
//! | `sharing` | interrupts of a CPU, CPUs that share a core |
//! | `memory` | memory, swap, huge pages, limits of the process, load |
//! | `build` | what this program was built with and from |
//! | `text` | facts that stand as a text in the files of a run, and are decided on as a type |
//!
//! # Source
//! In the kernel's `Documentation`: `admin-guide/{kernel-parameters,sysctl/kernel}`, `admin-guide/pm/{cpufreq,cpuidle}`,
//! `core-api/irq/irq-affinity`, `ABI/testing/sysfs-devices-system-cpu`; `man 5 proc`.

mod build;
mod files;
mod frequency;
mod hypervisor;
mod kernel;
mod memory;
mod processors;
mod sharing;
pub(crate) mod text;
mod throttling;

pub use build::{Build, BuildProfile};
pub use frequency::{FrequencyPolicy, Governor};
pub use hypervisor::{Hypervisor, HypervisorSign};
pub use kernel::Preemption;
pub use memory::{Limits, Memory};
pub use sharing::{InterruptRoute, SharedCores};
pub use throttling::{Throttling, ThrottlingState};

use files::Root;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The machine as a run found it. Lists of CPUs and interrupts are in the kernel's form: `0-3,8`.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Machine {
    /// The kernel: release, build, compiler.
    pub kernel: String,
    /// Release of the kernel, as `uname -r` prints it.
    pub kernel_release: String,
    /// How the kernel lets an urgent thread take the CPU.
    pub preemption: Preemption,
    /// What the kernel was started with.
    pub kernel_command_line: String,
    /// Model of the processor.
    pub processor: String,
    /// Number of CPUs that run.
    pub processors: usize,
    /// CPUs that run.
    pub processors_online: String,
    /// CPUs that this process may use.
    pub processors_allowed: String,
    /// Simultaneous multithreading: whether, and which CPUs share a core.
    pub smt: SharedCores,
    /// Frequency of each group of CPUs: driver, governor, range; or that this kernel has no frequency control.
    pub frequency_governors: Vec<FrequencyPolicy>,
    /// Driver and governor of the idle states.
    pub idle_driver: String,
    /// Idle states of the first CPU, with the time to leave each.
    pub idle_states: Vec<String>,
    /// Clock source in use.
    pub clock_source: String,
    /// Clock sources that there are.
    pub clock_sources_available: String,
    /// Signs of a hypervisor below this kernel, or `none`. It can stop all CPUs, and no counter of the guest shows it.
    pub hypervisor: Hypervisor,
    /// How much of each period real-time threads may have.
    pub rt_throttling: Throttling,
    /// Isolated CPUs (`isolcpus`).
    pub isolated: String,
    /// CPUs without a periodic tick.
    pub nohz_full: String,
    /// Default interrupt affinity (`default_smp_affinity`).
    pub interrupts_default: String,
    /// Which interrupts may and do go where, by CPU.
    pub interrupts: BTreeMap<String, InterruptRoute>,
    /// Memory, swap, huge pages.
    pub memory: Memory,
    /// What this process may ask of the system.
    pub limits: Limits,
    /// Load averages of 1, 5 and 15 minutes when the machine was read.
    pub load_average: String,
    /// What this program was built with and from.
    pub build: Build,
}

impl Machine {
    /// Reads the machine that this process runs on, a program that was built from `commit`.
    #[must_use]
    pub fn read(commit: &'static str) -> Self {
        Self::below(Path::new("/"), commit)
    }

    /// Reads a machine whose `proc`, `sys` and `boot` lie in `root`.
    #[must_use]
    pub fn below(root: &Path, commit: &'static str) -> Self {
        let root = Root::new(root);
        Self {
            kernel: root.fact("proc/version"),
            kernel_release: root.fact("proc/sys/kernel/osrelease"),
            preemption: Preemption::read(&root),
            kernel_command_line: root.fact("proc/cmdline"),
            processor: processors::model(&root),
            processors: processors::count(&root),
            processors_online: root.fact("sys/devices/system/cpu/online"),
            processors_allowed: root.field("proc/self/status", "Cpus_allowed_list"),
            smt: processors::smt(&root),
            frequency_governors: processors::frequency(&root),
            idle_driver: processors::idle_driver(&root),
            idle_states: processors::idle_states(&root),
            clock_source: root.fact("sys/devices/system/clocksource/clocksource0/current_clocksource"),
            clock_sources_available: root
                .fact("sys/devices/system/clocksource/clocksource0/available_clocksource"),
            hypervisor: Hypervisor::read(&root),
            rt_throttling: Throttling::read(&root),
            isolated: root.list("sys/devices/system/cpu/isolated"),
            nohz_full: root.list("sys/devices/system/cpu/nohz_full"),
            interrupts_default: processors::default_affinity(&root),
            interrupts: processors::interrupts(&root),
            memory: Memory::read(&root),
            limits: Limits::read(&root),
            load_average: memory::load_average(&root),
            build: Build::of_this_program(commit),
        }
    }
}

#[cfg(test)]
mod tests;
