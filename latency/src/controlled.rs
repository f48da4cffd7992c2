//! What was not controlled: what another machine or another hour may do differently, a sentence each, from the machine's facts.
//!
//! CPUs are those that the loops were pinned to.

use super::add_new;
use super::claim::{cpus, virtual_machine};
use super::files::RunFiles;
use super::model::Conditions;
use realtime::machine::{FrequencyPolicy, Governor, InterruptRoute, SharedCores, ThrottlingState};
use realtime::{Grant, Machine};
use std::collections::BTreeSet;

/// The sentences of all runs, each once.
pub(crate) fn not_controlled(runs: &[RunFiles], conditions: &Conditions) -> Vec<String> {
    let mut reported = Vec::new();
    if let Some(host) = virtual_machine(runs) {
        reported.push(format!(
            "The machine is a virtual one ({host}): its host may stop it at any time, unseen from inside."
        ));
    }
    runs.iter().flat_map(of_run).for_each(|sentence| add_new(&mut reported, sentence));
    if conditions.load_generator.is_none() {
        reported.push("What else ran on the machine was not recorded.".into());
    }
    let unknown = runs.iter().filter(|run| run.conditions.is_none()).count();
    if unknown > 0 && runs.len() > unknown {
        reported.push(format!("{unknown} run(s) have no conditions.json."));
    }
    reported
}

fn of_run(run: &RunFiles) -> Vec<String> {
    let machine = run.machine();
    let machine: &Machine = &machine;
    let cpus: BTreeSet<u64> = cpus(run).into_iter().map(|(cpu, _)| cpu).collect();
    let mut reported = governors(machine);
    if !machine.is_preempt_rt() {
        reported.push("The kernel is not PREEMPT_RT: its own work can keep the loops waiting.".into());
    }
    reported.extend(isolation(machine, &cpus));
    reported.extend(cpus.iter().filter_map(|cpu| interrupts(machine, *cpu)));
    reported.extend(siblings(machine, &cpus));
    reported.extend(throttling(&machine.rt_throttling.about));
    let held = |granted: &[Grant]| granted.contains(&Grant::DmaLatency);
    let refused: Vec<_> =
        run.granted().filter(|(_, granted)| !held(granted)).map(|(process, _)| process).collect();
    if !refused.is_empty() {
        reported.push(format!(
            "{} did not hold /dev/cpu_dma_latency: CPUs may sleep deeply{}, and wake up late.",
            refused.join(" and "),
            idle_states(machine)
        ));
    }
    match machine.clock_source.as_str() {
        "tsc" => {}
        "" => reported.push("The clock source is not known.".into()),
        source => reported.push(format!(
            "The clock source is {source}, not tsc: reading it takes longer, and its steps are its own."
        )),
    }
    if let Some(kib) = machine.memory.swap_used_kib.filter(|kib| *kib > 0) {
        reported.push(format!("{kib} KiB of swap were in use: other programs waited for their pages."));
    }
    reported
}

/// Each policy that is not `performance`: one among others that are must not pass.
fn governors(machine: &Machine) -> Vec<String> {
    const NOT_KNOWN: &str = "The CPUs' frequency governor is not known.";
    const NO_CPUFREQ: &str = "This machine shows no frequency control (no cpufreq): whoever sets the clock of its CPUs is not \
                              in this kernel.";
    let policies = &machine.frequency_governors;
    if policies.is_empty() {
        return vec![NOT_KNOWN.into()];
    }
    let sentence = |policy: &FrequencyPolicy| match policy {
        FrequencyPolicy::Policy { governor: Governor::Performance, .. } => None,
        FrequencyPolicy::Policy { cpus, governor: Governor::Other(governor), .. } => {
            Some(format!("The frequency governor of {cpus} is {governor}: their clock may change."))
        }
        FrequencyPolicy::NoCpufreq { .. } => Some(NO_CPUFREQ.into()),
        FrequencyPolicy::Other(_) => Some(NOT_KNOWN.into()),
    };
    policies.iter().filter_map(sentence).collect()
}

fn isolation(machine: &Machine, loops: &BTreeSet<u64>) -> Option<String> {
    let list = machine.isolated.as_str();
    let isolated = in_list(list);
    if isolated.is_empty() {
        return Some("No CPU is isolated: interrupts and other threads share those of the loops.".into());
    }
    let shared: Vec<_> = loops.difference(&isolated).map(u64::to_string).collect();
    (!shared.is_empty()).then(|| {
        format!(
            "CPU {} of the loops is not among the isolated ones ({list}): others share it.",
            shared.join(", ")
        )
    })
}

fn interrupts(machine: &Machine, cpu: u64) -> Option<String> {
    match machine.interrupts.get(&format!("CPU {cpu}"))? {
        InterruptRoute::Known { routed: Some(routed), .. } => {
            Some(format!("Interrupts come to CPU {cpu} of the loops: {routed}."))
        }
        InterruptRoute::Known { allowed: Some(allowed), .. } => {
            Some(format!("Interrupts may come to CPU {cpu} of the loops: {allowed}."))
        }
        InterruptRoute::Known { allowed: None, routed: None } => None,
        InterruptRoute::Other(line) => {
            Some(format!("Whether interrupts come to CPU {cpu} of the loops is not known: {line}."))
        }
    }
}

fn siblings(machine: &Machine, loops: &BTreeSet<u64>) -> Option<String> {
    let cores = match &machine.smt {
        SharedCores::Shared { cores, .. } => cores,
        SharedCores::Other(line) if !line.is_empty() => {
            return Some(format!("Whether CPUs of the loops share a core is not known: {line}."));
        }
        // A record from before SMT was read has no text.
        SharedCores::NoneShared { .. } | SharedCores::Other(_) => return None,
    };
    let of_loops: Vec<_> =
        cores.iter().map(String::as_str).filter(|core| !in_list(core).is_disjoint(loops)).collect();
    (!of_loops.is_empty()).then(|| {
        format!(
            "CPUs of the loops share a core with others ({}): what runs there slows them.",
            of_loops.join("; ")
        )
    })
}

fn throttling(state: &ThrottlingState) -> Option<String> {
    match state {
        ThrottlingState::On { .. } => {
            Some(format!("RT throttling is {state}: a loop that needs more is stopped for the rest."))
        }
        ThrottlingState::Other(line) if !line.is_empty() => {
            Some(format!("Whether RT throttling is on is not known: {line}."))
        }
        ThrottlingState::Off
        | ThrottlingState::WithoutEffect
        | ThrottlingState::Unreadable
        | ThrottlingState::Other(_) => None,
    }
}

fn idle_states(machine: &Machine) -> String {
    let states = machine.idle_states.join(", ");
    if states.is_empty() { states } else { format!(" ({states})") }
}

/// CPUs of a list in the kernel's form, `0-3,8`; none for words.
fn in_list(list: &str) -> BTreeSet<u64> {
    let part = |part: &str| {
        let (first, last) = part.trim().split_once('-').unwrap_or((part.trim(), part.trim()));
        Some(first.parse::<u64>().ok()?..=last.parse().ok()?)
    };
    list.split(',').filter_map(part).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;
    use serde_json::json;
    use std::collections::BTreeMap;

    #[test]
    fn a_machine_with_everything_has_nothing_to_tell() {
        assert_eq!(of_run(&made_up::run(10)), [""; 0]);
    }

    #[test]
    fn each_fact_has_its_sentence() {
        let cases = [
            ("frequency_governors", json!(["no cpufreq: whoever"]), "no frequency control (no cpufreq)"),
            (
                "frequency_governors",
                json!(["CPUs 0: governor performance, driver x", "CPUs 1: governor powersave, driver x"]),
                "governor of CPUs 1 is powersave",
            ),
            ("isolated", json!("1-3"), "CPU 0 of the loops is not among the isolated ones (1-3)"),
            ("isolated", json!("none"), "No CPU is isolated"),
            (
                "interrupts",
                json!({ "CPU 1": "may come: 3-5; do come: 24 virtio0" }),
                "to CPU 1 of the loops: 24 virtio0",
            ),
            (
                "interrupts",
                json!({ "CPU 0": "may come: 3-5; do come: none" }),
                "may come to CPU 0 of the loops: 3-5",
            ),
            ("smt", json!("CPUs that share a core: 0,2; 3,4 (control: on)"), "with others (0,2)"),
            (
                "rt_throttling",
                json!({ "about": "on: 950000 us of each 1000000 us" }),
                "RT throttling is on: 950000",
            ),
            ("clock_source", json!("kvm-clock"), "clock source is kvm-clock"),
            ("memory", json!({ "swap_used_kib": 12 }), "12 KiB of swap"),
        ];
        for (key, value, words) in cases {
            let mut run = made_up::run(10);
            made_up::edit_run(&mut run, |file| file["machine"][key] = value);
            let reported = of_run(&run);
            assert!(reported.len() == 1 && reported[0].contains(words), "{words}: {reported:?}");
        }
    }

    #[test]
    fn a_sentence_follows_from_the_type_of_its_fact() {
        let policy =
            |governor| FrequencyPolicy::Policy { cpus: "CPUs 0".into(), governor, range: String::new() };
        let of_policy =
            |policy| governors(&Machine { frequency_governors: vec![policy], ..Machine::default() }).concat();
        assert_eq!(of_policy(policy(Governor::Performance)), "");
        assert!(of_policy(policy(Governor::Other("schedutil".into()))).contains("CPUs 0 is schedutil"));
        assert_eq!(of_policy(FrequencyPolicy::Other("?".into())), governors(&Machine::default()).concat());

        let of_route = |allowed: Option<&str>, routed: Option<&str>| {
            let [allowed, routed] = [allowed, routed].map(|list| list.map(str::to_owned));
            let interrupts = BTreeMap::from([("CPU 0".into(), InterruptRoute::Known { allowed, routed })]);
            super::interrupts(&Machine { interrupts, ..Machine::default() }, 0)
        };
        assert_eq!(of_route(None, None), None);
        assert!(of_route(Some("3"), None).unwrap().contains("may come to CPU 0 of the loops: 3"));
        assert!(of_route(Some("3"), Some("3 eth0")).unwrap().contains("come to CPU 0 of the loops: 3 eth0"));

        let of_cores = |smt| siblings(&Machine { smt, ..Machine::default() }, &BTreeSet::from([0]));
        let shared = |core: &str| SharedCores::Shared { cores: vec![core.into()], control: None };
        assert_eq!(of_cores(SharedCores::NoneShared { control: None }), None);
        assert_eq!(of_cores(shared("1-2")), None);
        assert!(of_cores(shared("0-1")).unwrap().contains("with others (0-1)"));

        let of_brake = |state: ThrottlingState| throttling(&state).is_some();
        assert!(of_brake(ThrottlingState::On { runtime_us: 1, period_us: 2 }));
        assert!(![ThrottlingState::Off, ThrottlingState::WithoutEffect].into_iter().any(of_brake));
    }

    #[test]
    fn a_text_that_is_not_understood_is_not_taken_as_controlled() {
        let cases = [
            ("frequency_governors", json!(["governed well"]), "frequency governor is not known"),
            (
                "interrupts",
                json!({ "CPU 0": "all but a few" }),
                "interrupts come to CPU 0 of the loops is not known: all but a few",
            ),
            ("smt", json!("shared or not"), "share a core is not known: shared or not"),
            ("rt_throttling", json!({ "about": "somewhat" }), "RT throttling is on is not known: somewhat"),
            ("hypervisor", json!("somebody"), "virtual one (somebody)"),
        ];
        for (key, value, words) in cases {
            let mut run = made_up::run(10);
            made_up::edit_run(&mut run, |file| file["machine"][key] = value);
            let conditions = Conditions { load_generator: Some("none".into()), ..Conditions::default() };
            let reported = not_controlled(&[run], &conditions);
            assert!(reported.len() == 1 && reported[0].contains(words), "{words}: {reported:?}");
        }
    }

    #[test]
    fn a_refused_latency_tells_the_idle_states() {
        let mut run = made_up::run(10);
        made_up::edit_run(&mut run, |file| {
            file["realtime_granted"].as_array_mut().unwrap().remove(0);
            file["machine"]["idle_states"] = json!(["C6: 133 us to leave"]);
        });
        let reported = of_run(&run);
        assert!(reported.len() == 1 && reported[0].starts_with("emulator did not hold"), "{reported:?}");
        assert!(reported[0].contains("(C6: 133 us to leave)"), "{reported:?}");
    }
}
