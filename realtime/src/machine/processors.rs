//! Processors: what they are, how fast they may run, how deep they may sleep, which interrupts they take.

use super::files::{Root, field, listed, number_in};
use super::frequency::{FrequencyPolicy, Governor};
use super::sharing::{InterruptRoute, SharedCores};
use std::collections::BTreeMap;

const CPUS: &str = "sys/devices/system/cpu";

pub(super) fn model(root: &Root) -> String {
    let text = root.text("proc/cpuinfo").unwrap_or_default();
    // x86 says "model name", other architectures "Model", "cpu" or "uarch".
    let names = ["model name", "Model", "Processor", "cpu", "uarch"];
    let found = names.iter().find_map(|name| field(&text, name));
    found.map_or_else(|| "unknown: /proc/cpuinfo names no model".to_owned(), str::to_owned)
}

/// Number of CPUs that run.
pub(super) fn count(root: &Root) -> usize {
    let online = root.text(&format!("{CPUS}/online")).unwrap_or_default();
    crate::privileges::parse_cpu_list(&online).map_or(0, |cpus| cpus.len())
}

pub(super) fn smt(root: &Root) -> SharedCores {
    let siblings = |cpu: &String| root.text(&format!("{CPUS}/{cpu}/topology/thread_siblings_list"));
    let mut cores: Vec<String> =
        cpus(root).iter().filter_map(siblings).filter(|list| list.contains([',', '-'])).collect();
    cores.sort();
    cores.dedup();
    let control =
        root.text(&format!("{CPUS}/smt/control")).unwrap_or_else(|| "not reported by the kernel".to_owned());
    let control = Some(control);
    if cores.is_empty() {
        SharedCores::NoneShared { control }
    } else {
        SharedCores::Shared { cores, control }
    }
}

pub(super) fn frequency(root: &Root) -> Vec<FrequencyPolicy> {
    let policies: Vec<_> = root.names(&format!("{CPUS}/cpufreq"));
    let policies = policies.iter().filter(|name| name.starts_with("policy"));
    let reported: Vec<_> = policies
        .map(|policy| {
            let get = |name: &str| root.text(&format!("{CPUS}/cpufreq/{policy}/{name}"));
            let known = |name: &str| get(name).unwrap_or_else(|| "unknown".to_owned());
            let mhz = |name: &str| {
                let khz: Option<u64> = get(name).and_then(|text| text.parse().ok());
                khz.map_or_else(|| "unknown".to_owned(), |khz| (khz / 1000).to_string())
            };
            let (driver, lowest, highest) =
                (known("scaling_driver"), mhz("scaling_min_freq"), mhz("scaling_max_freq"));
            FrequencyPolicy::Policy {
                cpus: format!("CPUs {}", known("affected_cpus").replace(' ', ",")),
                governor: Governor::from(known("scaling_governor").as_str()),
                range: format!(", driver {driver}, {lowest} to {highest} MHz"),
            }
        })
        .collect();
    if reported.is_empty() { vec![FrequencyPolicy::no_cpufreq()] } else { reported }
}

pub(super) fn idle_driver(root: &Root) -> String {
    let get = |name: &str| root.text(&format!("{CPUS}/cpuidle/{name}"));
    let governor = get("current_governor").or_else(|| get("current_governor_ro"));
    match (get("current_driver"), governor) {
        (Some(driver), Some(governor)) => format!("driver {driver}, governor {governor}"),
        (Some(driver), None) => format!("driver {driver}"),
        _ => "no cpuidle".to_owned(),
    }
}

pub(super) fn idle_states(root: &Root) -> Vec<String> {
    let Some(first) = cpus(root).into_iter().next() else { return Vec::new() };
    let folder = format!("{CPUS}/{first}/cpuidle");
    let state = |state: &String| {
        let get = |name: &str| root.text(&format!("{folder}/{state}/{name}"));
        let off = if get("disable").is_some_and(|off| off != "0") { ", disabled" } else { "" };
        Some(format!("{}: {} us to leave{off}", get("name")?, get("latency")?))
    };
    root.names(&folder).iter().filter_map(state).collect()
}

/// The mask is of 32-bit words in hexadecimal, the highest first.
pub(super) fn default_affinity(root: &Root) -> String {
    let path = "proc/irq/default_smp_affinity";
    let Some(mask) = root.text(path) else { return root.fact(path) };
    let mut cpus = Vec::new();
    for (word, digits) in mask.rsplit(',').enumerate() {
        let Ok(bits) = u32::from_str_radix(digits, 16) else {
            return format!("unknown: /{path} is '{mask}'");
        };
        cpus.extend((0..32).filter(|bit| bits >> bit & 1 == 1).map(|bit| word as u64 * 32 + bit));
    }
    listed(&cpus)
}

/// By CPU: numbers of the interrupts that may come to it, and those that the kernel sends to it now, with their names.
pub(super) fn interrupts(root: &Root) -> BTreeMap<String, InterruptRoute> {
    let names = interrupt_names(root);
    let mut may: BTreeMap<u64, Vec<u64>> =
        cpus(root).iter().filter_map(|cpu| Some((number_in(cpu)?, Vec::new()))).collect();
    let mut does: BTreeMap<u64, Vec<String>> = BTreeMap::new();
    for number in root.names("proc/irq").iter().filter_map(|name| name.parse::<u64>().ok()) {
        let cpus_in = |file: &str| {
            let list = root.text(&format!("proc/irq/{number}/{file}")).unwrap_or_default();
            crate::privileges::parse_cpu_list(&list).unwrap_or_default()
        };
        for cpu in cpus_in("smp_affinity_list") {
            // CPUs that could be plugged in stand in the mask too.
            if let Some(list) = may.get_mut(&(cpu as u64)) {
                list.push(number);
            }
        }
        // Numbers that nobody has asked for come nowhere.
        if let Some(name) = names.get(&number) {
            for cpu in cpus_in("effective_affinity_list") {
                does.entry(cpu as u64).or_default().push(format!("{number} {name}"));
            }
        }
    }
    let of_cpu = |(cpu, numbers): (u64, Vec<u64>)| {
        let allowed = (!numbers.is_empty()).then(|| listed(&numbers));
        let routed = does.remove(&cpu).map(|names| names.join(", "));
        (format!("CPU {cpu}"), InterruptRoute::Known { allowed, routed })
    };
    may.into_iter().map(of_cpu).collect()
}

/// Names of the interrupts in use: what follows counts, chip and line in `/proc/interrupts`.
fn interrupt_names(root: &Root) -> BTreeMap<u64, String> {
    let text = root.text("proc/interrupts").unwrap_or_default();
    let name = |line: &str| {
        let (number, rest) = line.split_once(':')?;
        let words: Vec<&str> =
            rest.split_whitespace().skip_while(|word| word.parse::<u64>().is_ok()).collect();
        // Chip, line and trigger come first: "IO-APIC 4-edge ttyS0", "PCI-MSIX-0000:00:01.0 0-edge virtio0".
        let name = words.get(2..).filter(|name| !name.is_empty()).unwrap_or(&words).join(" ");
        Some((number.trim().parse().ok()?, name))
    };
    text.lines().filter_map(name).collect()
}

/// Names of the folders of all CPUs, `cpu0` first.
fn cpus(root: &Root) -> Vec<String> {
    let is_cpu = |name: &String| {
        name.strip_prefix("cpu")
            .is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()))
    };
    root.names(CPUS).into_iter().filter(is_cpu).collect()
}
