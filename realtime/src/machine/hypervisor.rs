//! What stands below the kernel: a hypervisor, and QEMU's emulation of the processor.
//!
//! # Source
//! `systemd-detect-virt`; `ABI/stable/sysfs-hypervisor-xen` in the kernel's tree.

use super::Machine;
use super::files::{Root, field};
use super::text::stored_as_text;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Whether a hypervisor runs below this kernel. Its text is the line in `run.json`, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum Hypervisor {
    /// No sign of one was found.
    Absent,
    /// Nothing was recorded: `unknown`, `no`, `false` or an empty text of another program.
    NotRecorded(String),
    /// The signs of one; a text that this version does not write counts as a sign.
    Present(Vec<HypervisorSign>),
}

/// A sign of a hypervisor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HypervisorSign {
    /// The processor has the flag `hypervisor`.
    CpuFlag,
    /// Content of `/sys/hypervisor/type`.
    Kind(String),
    /// A clock source that only a hypervisor offers.
    ClockSource(String),
    /// Vendor and product of a virtual machine.
    Dmi(String),
    /// A sign that this version does not write.
    Other(String),
}

const ABSENT: &str = "none";
/// Texts, in capital letters or small ones, that name no hypervisor.
const NOT_RECORDED: [&str; 5] = ["none", "no", "unknown", "false", ""];
const BETWEEN_SIGNS: &str = "; ";
const CPU_FLAG: &str = "cpuinfo flag 'hypervisor'";
const KIND: &str = "/sys/hypervisor/type ";
const CLOCK_SOURCE: &str = "clock source ";
const DMI: &str = "DMI ";
const KVM_CLOCK: &str = "kvm-clock";

/// Clock sources that only a hypervisor offers.
const PARAVIRTUAL_CLOCKS: [&str; 4] =
    [KVM_CLOCK, "xen", "hyperv_clocksource_tsc_page", "hyperv_clocksource_msr"];

/// Words in vendor or product of virtual machines, as systemd-detect-virt knows them.
const VIRTUAL_MACHINES: [&str; 12] = [
    "KVM",
    "QEMU",
    "VMware",
    "VirtualBox",
    "innotek",
    "Xen",
    "Bochs",
    "Parallels",
    "BHYVE",
    "Virtual Machine",
    "Google Compute Engine",
    "Amazon EC2",
];

impl Hypervisor {
    /// All signs of a hypervisor.
    pub(super) fn read(root: &Root) -> Self {
        let mut signs = Vec::new();
        let cpuinfo = root.text("proc/cpuinfo").unwrap_or_default();
        if field(&cpuinfo, "flags").is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")) {
            signs.push(HypervisorSign::CpuFlag);
        }
        signs.extend(root.text("sys/hypervisor/type").map(HypervisorSign::Kind));
        let sources = root.text("sys/devices/system/clocksource/clocksource0/available_clocksource");
        let sources = sources.unwrap_or_default();
        let paravirtual = sources.split(' ').filter(|source| PARAVIRTUAL_CLOCKS.contains(source));
        signs.extend(paravirtual.map(|source| HypervisorSign::ClockSource(source.to_owned())));
        let dmi = |name: &str| root.text(&format!("sys/class/dmi/id/{name}")).unwrap_or_default();
        let machine = format!("{} {}", dmi("sys_vendor"), dmi("product_name"));
        if VIRTUAL_MACHINES.iter().any(|name| machine.contains(name)) {
            signs.push(HypervisorSign::Dmi(machine.trim().to_owned()));
        }
        if signs.is_empty() { Self::Absent } else { Self::Present(signs) }
    }

    /// Whether the machine is a virtual one.
    #[must_use]
    pub fn is_present(&self) -> bool {
        matches!(self, Self::Present(_))
    }

    /// Whether a sign is one of KVM.
    fn is_kvm(&self) -> bool {
        matches!(self, Self::Present(signs) if signs.iter().any(HypervisorSign::is_of_kvm))
    }
}

impl HypervisorSign {
    fn is_of_kvm(&self) -> bool {
        match self {
            Self::CpuFlag => false,
            Self::ClockSource(source) => source == KVM_CLOCK,
            Self::Kind(text) | Self::Dmi(text) | Self::Other(text) => text.to_lowercase().contains("kvm"),
        }
    }
}

impl fmt::Display for Hypervisor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Absent => f.write_str(ABSENT),
            Self::NotRecorded(text) => f.write_str(text),
            Self::Present(signs) => {
                let signs: Vec<_> = signs.iter().map(HypervisorSign::to_string).collect();
                f.write_str(&signs.join(BETWEEN_SIGNS))
            }
        }
    }
}

impl fmt::Display for HypervisorSign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CpuFlag => f.write_str(CPU_FLAG),
            Self::Kind(kind) => write!(f, "{KIND}{kind}"),
            Self::ClockSource(source) => write!(f, "{CLOCK_SOURCE}{source}"),
            Self::Dmi(machine) => write!(f, "{DMI}{machine}"),
            Self::Other(text) => f.write_str(text),
        }
    }
}

impl From<&str> for Hypervisor {
    fn from(text: &str) -> Self {
        if text == ABSENT {
            return Self::Absent;
        }
        if NOT_RECORDED.iter().any(|word| text.eq_ignore_ascii_case(word)) {
            return Self::NotRecorded(text.to_owned());
        }
        Self::Present(text.split(BETWEEN_SIGNS).map(HypervisorSign::from).collect())
    }
}

impl From<&str> for HypervisorSign {
    fn from(text: &str) -> Self {
        let after = |prefix: &str| text.strip_prefix(prefix).map(str::to_owned);
        if text == CPU_FLAG {
            return Self::CpuFlag;
        }
        after(KIND)
            .map(Self::Kind)
            .or_else(|| after(CLOCK_SOURCE).map(Self::ClockSource))
            .or_else(|| after(DMI).map(Self::Dmi))
            .unwrap_or_else(|| Self::Other(text.to_owned()))
    }
}

stored_as_text!(Hypervisor);

impl Machine {
    /// Whether QEMU emulates the processor in software (TCG): its model says so, or it is QEMU's own model without KVM below.
    #[must_use]
    pub fn is_emulated_by_qemu(&self) -> bool {
        let offers_kvm = || self.clock_sources_available.split_whitespace().any(|source| source == KVM_CLOCK);
        let is_kvm = || self.hypervisor.is_kvm() || offers_kvm();
        self.processor.contains("TCG") || (self.processor.contains("QEMU Virtual CPU") && !is_kvm())
    }
}
