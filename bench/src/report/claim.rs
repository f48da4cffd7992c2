//! Whether runs support a latency claim: what must be so is so, and what was not controlled is said.
//!
//! *Reasons* are what a claim cannot do without: real-time priority, locked memory, CPUs of their own, a reference measured in
//! turns with the runs, enough cycles for the percentiles that are told, no probe that burns the CPUs, no record lost. *Not
//! controlled* is what another machine or another hour may do differently, and what a reader must know to judge.

use super::files::RunFiles;
use super::model::{Claim, Conditions};

/// Cycles for a p99.9 that rests on a hundred samples.
const CYCLES_FOR_P999: u64 = 100_000;
/// Runs with a reference between them that are taken as alternating.
const PAIRS: usize = 2;

/// Judges the runs.
#[must_use]
pub fn claim(runs: &[RunFiles], conditions: &Conditions) -> Claim {
    let reasons = reasons(runs, conditions);
    let not_controlled = not_controlled(runs, conditions);
    let supported = reasons.is_empty();
    let sentence = match (supported, virtual_machine(conditions)) {
        (false, _) => format!("These runs support no latency claim, for {} reason(s).", reasons.len()),
        (true, Some(host)) => format!(
            "These runs support a claim about p50 and p99 beside the reference on this virtual machine ({host}); the largest \
             values are those of its host."
        ),
        (true, None) => "These runs support a latency claim for this machine under this load.".to_owned(),
    };
    Claim { supported, sentence, reasons, not_controlled }
}

fn reasons(runs: &[RunFiles], conditions: &Conditions) -> Vec<String> {
    let mut reasons = Vec::new();
    for (word, lack) in [
        ("SCHED_FIFO", "real-time priority (SCHED_FIFO)"),
        ("memory locked", "locked memory"),
        ("pinned to CPU", "a CPU of its own"),
    ] {
        let without = |(process, granted): (&str, Vec<&str>)| {
            (!granted.iter().any(|grant| grant.contains(word))).then(|| process.to_owned())
        };
        let mut who: Vec<_> =
            runs.iter().flat_map(|run| run.granted().filter_map(without).collect::<Vec<_>>()).collect();
        who.sort();
        who.dedup();
        if !who.is_empty() {
            reasons.push(format!("{} ran without {lack}.", who.join(" and ")));
        }
    }
    let unknown = runs.iter().filter(|run| run.run.is_null() || run.controllers.is_empty()).count();
    if unknown > 0 {
        reasons.push(format!("What was granted is not told by all processes of {unknown} run(s)."));
    }
    let pairs = runs.iter().filter(|run| run.reference.is_some()).count();
    if let Some(why) = &conditions.reference_missing_because {
        reasons.push(format!("There is no reference beside the runs: {}.", why.trim_end_matches('.')));
    } else if pairs < PAIRS || pairs < runs.len() {
        reasons.push(format!(
            "The reference did not alternate with the runs: {pairs} of {} have one.",
            runs.len()
        ));
    }
    let cycles: u64 = runs.iter().filter_map(|run| run.summary["cycles"].as_u64()).sum();
    if cycles < CYCLES_FOR_P999 {
        reasons
            .push(format!("{cycles} cycles are too few for p99.9 and beyond: {CYCLES_FOR_P999} at least."));
    }
    if conditions.probe {
        reasons.push(
            "The probe kept the CPUs busy: it keeps them awake, and takes caches from the loops.".into(),
        );
    }
    let dropped: u64 = runs
        .iter()
        .flat_map(RunFiles::reports)
        .filter_map(|(_, told)| told["records_dropped"].as_u64())
        .sum();
    if dropped > 0 {
        reasons.push(format!("{dropped} records did not reach the files."));
    }
    if runs.iter().any(|run| run.run["counts_allocations"] == true) {
        reasons.push("The build counts allocations, which costs time.".into());
    }
    reasons
}

fn not_controlled(runs: &[RunFiles], conditions: &Conditions) -> Vec<String> {
    let mut told = Vec::new();
    if let Some(host) = virtual_machine(conditions) {
        told.push(format!(
            "The machine is a virtual one ({host}): its host may stop it at any time, unseen from inside."
        ));
    }
    let fact = |words: &[&str]| {
        let named = |name: &str| words.iter().any(|word| name.to_lowercase().contains(word));
        conditions.machine.iter().find(|fact| named(&fact.name)).map(|fact| fact.value.to_lowercase())
    };
    match fact(&["governor"]) {
        Some(governor) if governor.contains("performance") => {}
        Some(governor) => {
            told.push(format!("The CPUs' frequency governor is {governor}: their clock may change."))
        }
        None => told.push("The CPUs' frequency governor is not known.".into()),
    }
    let kernel = fact(&["preemption", "kernel"]).unwrap_or_default();
    if !conditions.machine.iter().any(|fact| fact.value.contains("PREEMPT_RT"))
        && !kernel.contains("preempt_rt")
    {
        told.push("The kernel is not PREEMPT_RT: its own work can keep the loops waiting.".into());
    }
    let isolated = conditions.machine.iter().any(|fact| {
        (fact.name.contains("isolated") && fact.value.chars().any(|digit| digit.is_ascii_digit()))
            || fact.value.contains("isolcpus=")
    });
    if !isolated {
        told.push("No CPU is isolated: interrupts and other threads share those of the loops.".into());
    }
    if conditions.load_generator.is_none() {
        told.push("What else ran on the machine was not told.".into());
    }
    let unknown = runs.iter().filter(|run| run.conditions.is_null()).count();
    if unknown > 0 && runs.len() > unknown {
        told.push(format!("{unknown} run(s) have no conditions.json."));
    }
    told
}

/// The hypervisor, if the machine has one.
fn virtual_machine(conditions: &Conditions) -> Option<&str> {
    let fact = conditions.machine.iter().find(|fact| fact.name.to_lowercase().contains("hypervisor"))?;
    let none = ["none", "no", "unknown", "false", ""];
    (!none.iter().any(|word| fact.value.eq_ignore_ascii_case(word))).then_some(fact.value.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::conditions::conditions;
    use crate::report::made_up;
    use serde_json::json;

    fn good() -> Vec<RunFiles> {
        let mut run = made_up::run(10);
        run.summary["cycles"] = json!(60_000);
        run.run["machine"]["isolated_cpus"] = json!("0-1");
        made_up::reference(&mut run, [13_000].into_iter().collect());
        vec![run.clone(), run]
    }

    fn judged(runs: &[RunFiles]) -> Claim {
        claim(runs, &conditions(runs))
    }

    #[test]
    fn runs_with_everything_support_a_claim() {
        let told = judged(&good());
        assert!(told.supported, "{:?}", told.reasons);
        assert_eq!(told.not_controlled, [""; 0]);
    }

    #[test]
    fn each_reason_is_told() {
        type Spoil = fn(&mut RunFiles);
        let cases: [(&str, Spoil); 8] = [
            ("SCHED_FIFO", |run| run.run["realtime_granted"] = json!(["memory locked", "pinned to CPU 0"])),
            ("a CPU of its own", |run| {
                run.controllers.get_mut("controller").unwrap()["realtime_granted"] =
                    json!(["memory locked", "SCHED_FIFO"]);
            }),
            ("not told by all", |run| run.controllers.clear()),
            ("did not alternate", |run| run.reference = None),
            ("too few", |run| run.summary["cycles"] = json!(20_000)),
            ("probe", |run| run.conditions["probe"] = json!(true)),
            ("did not reach", |run| run.summary["records_dropped"] = json!(3)),
            ("counts allocations", |run| run.run["counts_allocations"] = json!(true)),
        ];
        for (words, spoil) in cases {
            let mut runs = good();
            spoil(&mut runs[1]);
            let told = judged(&runs);
            assert!(!told.supported && told.reasons.len() == 1, "{words}: {:?}", told.reasons);
            assert!(told.reasons[0].contains(words), "{:?}", told.reasons);
        }
    }

    #[test]
    fn what_was_not_controlled_is_said_and_weakens_the_sentence() {
        let mut runs = good();
        for run in &mut runs {
            run.run["machine"] = json!({ "kernel": "PREEMPT_DYNAMIC", "hypervisor": "KVM" });
            run.conditions["load_generator"] = json!(null);
        }
        let told = judged(&runs);
        assert!(told.supported && told.sentence.contains("virtual machine (KVM)"), "{told:?}");
        assert_eq!(told.not_controlled.len(), 5, "{:?}", told.not_controlled);
    }
}
