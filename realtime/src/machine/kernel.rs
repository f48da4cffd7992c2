//! What the kernel says of itself and of what is below it: preemption, hypervisor, throttling.

use super::files::{Root, field};
use flate2::read::GzDecoder;
use serde::{Deserialize, Serialize};
use std::io::Read;

/// How the kernel lets an urgent thread take the CPU.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Preemption {
    /// `PREEMPT_RT`, `full`, `lazy`, `voluntary`, `none`, or `unknown`.
    pub model: String,
    /// Source of the value, or why there is none.
    pub told_by: String,
}

/// Kernel options of the models, in the order in which they are looked for.
const MODEL_OPTIONS: [(&str, &str); 5] = [
    ("CONFIG_PREEMPT_RT=y", "PREEMPT_RT"),
    ("CONFIG_PREEMPT=y", "full"),
    ("CONFIG_PREEMPT_LAZY=y", "lazy"),
    ("CONFIG_PREEMPT_VOLUNTARY=y", "voluntary"),
    ("CONFIG_PREEMPT_NONE=y", "none"),
];

impl Preemption {
    pub(super) fn read(root: &Root) -> Self {
        let found = |model: &str, told_by: &str| Self { model: model.into(), told_by: told_by.into() };
        let version = root.text("proc/version").unwrap_or_default();
        if root.number("sys/kernel/realtime") == Some(1) {
            return found("PREEMPT_RT", "/sys/kernel/realtime");
        }
        if version.contains("PREEMPT_RT") || version.contains("PREEMPT RT") {
            return found("PREEMPT_RT", "/proc/version");
        }
        // The file holds all modes and marks the one in use: "none voluntary (full) lazy".
        let debug = root.text("sys/kernel/debug/sched/preempt").unwrap_or_default();
        if let Some(mode) =
            debug.split_whitespace().find_map(|word| word.strip_prefix('(')?.strip_suffix(')'))
        {
            return found(mode, "/sys/kernel/debug/sched/preempt");
        }
        let dynamic = version.contains("PREEMPT_DYNAMIC");
        let command_line = root.text("proc/cmdline").unwrap_or_default();
        let asked =
            command_line.split_whitespace().filter_map(|word| word.strip_prefix("preempt=")).next_back();
        if let (true, Some(mode)) = (dynamic, asked) {
            return found(mode, "preempt= in /proc/cmdline of a kernel with PREEMPT_DYNAMIC");
        }
        if let Some((model, file)) = configured(root) {
            let how = if dynamic {
                "default of a kernel with PREEMPT_DYNAMIC, which /sys/kernel/debug/sched/preempt may have changed since; "
            } else {
                ""
            };
            return found(model, &format!("{how}{file}"));
        }
        if dynamic {
            return found(
                "unknown",
                "PREEMPT_DYNAMIC without preempt= in /proc/cmdline; /sys/kernel/debug/sched/preempt cannot be read (mount \
                 debugfs, be root), and no configuration of the kernel can",
            );
        }
        if version.split_whitespace().any(|word| word == "PREEMPT") {
            return found("full", "/proc/version");
        }
        found("unknown", "/proc/version does not tell, and no configuration of the kernel can be read")
    }
}

/// The model that the kernel was configured with, and the file that tells it.
fn configured(root: &Root) -> Option<(&'static str, String)> {
    let packed = root.bytes("proc/config.gz").and_then(|packed| {
        let mut text = String::new();
        GzDecoder::new(packed.as_slice()).read_to_string(&mut text).ok()?;
        Some((text, "/proc/config.gz".to_owned()))
    });
    let plain = || {
        let path = format!("boot/config-{}", root.text("proc/sys/kernel/osrelease")?);
        Some((root.text(&path)?, format!("/{path}")))
    };
    let (text, file) = packed.or_else(plain)?;
    let is_set = |option: &str| text.lines().any(|line| line == option);
    MODEL_OPTIONS.iter().find(|(option, _)| is_set(option)).map(|(_, model)| (*model, file))
}

/// All signs of a hypervisor, or `none`.
pub(super) fn hypervisor(root: &Root) -> String {
    let mut signs = Vec::new();
    let cpuinfo = root.text("proc/cpuinfo").unwrap_or_default();
    if field(&cpuinfo, "flags").is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")) {
        signs.push("cpuinfo flag 'hypervisor'".to_owned());
    }
    signs.extend(root.text("sys/hypervisor/type").map(|kind| format!("/sys/hypervisor/type {kind}")));
    let sources = root.text("sys/devices/system/clocksource/clocksource0/available_clocksource");
    let sources = sources.unwrap_or_default();
    let paravirtual = sources.split(' ').filter(|source| PARAVIRTUAL_CLOCKS.contains(source));
    signs.extend(paravirtual.map(|source| format!("clock source {source}")));
    let dmi = |name: &str| root.text(&format!("sys/class/dmi/id/{name}")).unwrap_or_default();
    let machine = format!("{} {}", dmi("sys_vendor"), dmi("product_name"));
    if VIRTUAL_MACHINES.iter().any(|name| machine.contains(name)) {
        signs.push(format!("DMI {}", machine.trim()));
    }
    if signs.is_empty() { "none".to_owned() } else { signs.join("; ") }
}

/// Clock sources that only a hypervisor offers.
const PARAVIRTUAL_CLOCKS: [&str; 4] =
    ["kvm-clock", "xen", "hyperv_clocksource_tsc_page", "hyperv_clocksource_msr"];

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

/// The kernel's brake on real-time threads. Off is -1; else a thread that never sleeps is stopped for the rest of each period.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Throttling {
    /// What real-time threads may have of each period, us; -1: all; null: unknown.
    pub runtime_us: Option<i64>,
    /// The period, us.
    pub period_us: Option<i64>,
    /// The same in words.
    pub about: String,
}

impl Throttling {
    pub(super) fn read(root: &Root) -> Self {
        let runtime_us = root.number("proc/sys/kernel/sched_rt_runtime_us");
        let period_us = root.number("proc/sys/kernel/sched_rt_period_us");
        let about = match (runtime_us, period_us) {
            (Some(-1), _) => "off".to_owned(),
            (Some(runtime), Some(period)) if runtime < period => {
                format!("on: {runtime} us of each {period} us")
            }
            (Some(_), Some(_)) => "without effect: all of each period".to_owned(),
            _ => "unknown: /proc/sys/kernel/sched_rt_runtime_us cannot be read".to_owned(),
        };
        Self { runtime_us, period_us, about }
    }
}
