//! Whether runs support a latency claim: what must be so is so, and what was not controlled is said.
//!
//! *Reasons* are what a claim cannot do without: real-time priority, locked memory, CPUs of their own, a reference measured in
//! turns with the runs, enough cycles for the percentiles that are reported, no probe that burns the CPUs, no record lost. *Not
//! controlled* is what another machine or another hour may do differently, and what a reader must know to judge.

use super::add_new;
use super::controlled::not_controlled;
use super::files::{EMULATOR, RunFiles};
use super::model::{Claim, Conditions};
use super::reference;
use realtime::Grant;
use realtime::machine::Hypervisor;

/// Cycles for a p99.9 that rests on a hundred samples.
const CYCLES_FOR_P999: u64 = 100_000;
/// Runs with a reference between them that are taken as alternating.
const PAIRS: usize = 2;
/// Share of cycles that may be missed.
const SKIPPED_SHARE: f64 = 1e-3;
/// How much longer or shorter than its run a reference may be and still be a slice of the same length.
const SAME_LENGTH: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Interval of the reference: the cycle's.
const INTERVAL_US: &str = "1000";

/// Judges runs that ended.
pub(crate) fn claim(runs: &[RunFiles], conditions: &Conditions) -> Claim {
    let reasons = reasons(runs, conditions);
    let not_controlled = not_controlled(runs, conditions);
    let supported = reasons.is_empty();
    let sentence = match (supported, virtual_machine(runs)) {
        (false, _) => format!("These runs support no latency claim, for {} reason(s).", reasons.len()),
        (true, Some(host)) => format!(
            "These runs support a claim about p50 and p99 beside the reference on this virtual machine ({host}); the largest \
             values are those of its host."
        ),
        (true, None) => "These runs support a latency claim for this machine under this load.".to_owned(),
    };
    Claim { supported, sentence, reasons, not_controlled }
}

/// Judgement of a run that has not ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InterimClaim {
    /// Reasons against a claim that the rest of the run cannot remove.
    pub against: Vec<String>,
    /// Requirements of a claim that are not yet met.
    pub missing: Vec<String>,
}

/// Cycles of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleCount {
    /// Cycles begun, skipped ones included.
    pub cycles: u64,
    /// Cycles computed late and not sent.
    pub skipped: u64,
}

impl CycleCount {
    /// From `summary.json`; 0 where it is missing.
    fn of(run: &RunFiles) -> Self {
        let summary = run.counted();
        Self {
            cycles: summary.and_then(|summary| summary.cycles).unwrap_or_default(),
            skipped: summary.and_then(|summary| summary.skipped).unwrap_or_default(),
        }
    }
}

/// Judges a run that still goes on by the same rules, after `count` cycles.
pub fn interim_claim(run: &RunFiles, conditions: &Conditions, count: CycleCount) -> InterimClaim {
    let (runs, counts) = (std::slice::from_ref(run), [count]);
    let against = [not_granted(runs), disturbed(runs, conditions, &counts)].concat();
    InterimClaim { against, missing: missing(runs, conditions, &counts) }
}

fn reasons(runs: &[RunFiles], conditions: &Conditions) -> Vec<String> {
    let counts: Vec<_> = runs.iter().map(CycleCount::of).collect();
    let (missing, disturbed) = (missing(runs, conditions, &counts), disturbed(runs, conditions, &counts));
    [not_granted(runs), missing, disturbed].concat()
}

/// What processes ran without.
fn not_granted(runs: &[RunFiles]) -> Vec<String> {
    let mut reasons = Vec::new();
    type Kind = fn(&Grant) -> bool;
    let needed: [(Kind, &str); 3] = [
        (|grant| matches!(grant, Grant::Fifo(_)), "real-time priority (SCHED_FIFO)"),
        (|grant| *grant == Grant::LockedMemory, "locked memory"),
        (|grant| matches!(grant, Grant::Cpu(_)), "a CPU of its own"),
    ];
    for (is_needed, lack) in needed {
        let without = |(process, granted): (&str, &[Grant])| {
            (!granted.iter().any(is_needed)).then(|| process.to_owned())
        };
        let mut who: Vec<_> =
            runs.iter().flat_map(|run| run.granted().filter_map(without).collect::<Vec<_>>()).collect();
        who.sort();
        who.dedup();
        if !who.is_empty() {
            reasons.push(format!("{} ran without {lack}.", who.join(" and ")));
        }
    }
    reasons
}

/// Evidence that the runs lack.
fn missing(runs: &[RunFiles], conditions: &Conditions, counts: &[CycleCount]) -> Vec<String> {
    let mut reasons = Vec::new();
    let unknown = runs.iter().filter(|run| run.run.is_none() || run.controllers.is_empty()).count();
    if unknown > 0 {
        reasons.push(format!("Not all processes of {unknown} run(s) reported their real-time grants."));
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
    let cycles: u64 = counts.iter().map(|count| count.cycles).sum();
    if cycles < CYCLES_FOR_P999 {
        reasons
            .push(format!("{cycles} cycles are too few for p99.9 and beyond: {CYCLES_FOR_P999} at least."));
    }
    reasons
}

/// What was not as it should have been.
fn disturbed(runs: &[RunFiles], conditions: &Conditions, counts: &[CycleCount]) -> Vec<String> {
    let mut reasons = Vec::new();
    if conditions.probe {
        reasons.push(
            "The probe kept the CPUs busy: it keeps them awake, and takes caches from the loops.".into(),
        );
    }
    let dropped: u64 = runs
        .iter()
        .flat_map(RunFiles::process_reports)
        .filter_map(|(_, report)| report.records_dropped)
        .sum();
    if dropped > 0 {
        reasons.push(format!("{dropped} records did not reach the files."));
    }
    for (run, count) in runs.iter().zip(counts) {
        let found = [unlike_reference(run), shared_cpu(run), of_the_run(run, *count)].concat();
        found.into_iter().for_each(|sentence| add_new(&mut reasons, sentence));
    }
    if runs.iter().filter_map(RunFiles::description).any(|description| description.counts_allocations) {
        reasons.push("The build counts allocations, which costs time.".into());
    }
    reasons
}

/// CPU of each process of a run that has one of its own, in their order.
pub(super) fn cpus(run: &RunFiles) -> Vec<(u64, &str)> {
    let cpu =
        |(process, granted): (_, &[Grant])| Some((granted.iter().find_map(Grant::cpu)? as u64, process));
    let mut cpus: Vec<_> = run.granted().filter_map(cpu).collect();
    cpus.sort_unstable();
    cpus
}

/// Where the reference was not measured as the rig runs.
fn unlike_reference(run: &RunFiles) -> Vec<String> {
    let Some(reported) = &run.reference else { return Vec::new() };
    let mut unlike = Vec::new();
    let rig = run.granted().next().filter(|(process, _)| *process == EMULATOR);
    let granted = rig.map(|(_, granted)| granted).unwrap_or_default();
    let line = &reported.command_line;
    let mut compare = |what: &str, theirs: Option<&str>, ours: Option<String>| {
        // What the rig lacks is a reason of its own.
        if let Some(ours) = ours.filter(|ours| theirs != Some(ours.as_str())) {
            let theirs = theirs.unwrap_or("none");
            unlike.push(format!("The reference had {what} {theirs}, the rig {ours}."));
        }
    };
    let priority = granted.iter().find_map(Grant::fifo_priority);
    compare(
        "priority",
        reference::option(line, 'p', "priority").or(reference::option(line, 'p', "prio")),
        priority.map(|priority| priority.to_string()),
    );
    let cpu = granted.iter().find_map(Grant::cpu);
    compare("CPU", reference::option(line, 'a', "affinity"), cpu.map(|cpu| cpu.to_string()));
    let interval = reference::option(line, 'i', "interval").unwrap_or(INTERVAL_US);
    compare("an interval in us of", Some(interval), Some(INTERVAL_US.to_owned()));
    let length_s = reported.samples.count() as f64 * interval.parse::<f64>().unwrap_or_default() * 1e-6;
    if !SAME_LENGTH.contains(&(length_s / run.duration_s())) {
        let ours_s = run.duration_s();
        unlike.push(format!("A reference of {length_s:.0} s stands beside a run of {ours_s:.0} s."));
    }
    unlike
}

fn shared_cpu(run: &RunFiles) -> Vec<String> {
    let cpus = cpus(run);
    let shared = cpus.chunk_by(|one, next| one.0 == next.0).filter(|who| who.len() > 1);
    let reported = |of_cpu: &[(u64, &str)]| {
        let who: Vec<_> = of_cpu.iter().map(|(_, process)| *process).collect();
        format!("{} shared CPU {}: they wait for each other.", who.join(" and "), of_cpu[0].0)
    };
    shared.map(reported).collect()
}

/// What the run itself, its build and its machine forbid.
fn of_the_run(run: &RunFiles, count: CycleCount) -> Vec<String> {
    let mut found = Vec::new();
    let machine = run.machine();
    let build = &machine.build;
    if build.profile.is_for_debugging() || build.debug_assertions {
        found.push(format!("The emulator is a build for debugging ({}).", build.profile));
    }
    if run.counted().is_some_and(|summary| summary.passed == Some(false)) {
        found.push("The verdict of a run itself is not passed.".into());
    }
    let (skipped, cycles) = (count.skipped as f64, count.cycles as f64);
    if skipped > SKIPPED_SHARE * cycles {
        let share = 100.0 * skipped / cycles.max(1.0);
        found.push(format!("A run missed {share:.1} % of its cycles: {} % at most.", 100.0 * SKIPPED_SHARE));
    }
    if machine.is_emulated_by_qemu() {
        found.push(
            "The machine is emulated by QEMU (TCG): its instructions take what the emulation takes.".into(),
        );
    }
    if run.circumstances().uncommitted_files > Some(0) {
        found.push(
            "The source tree held changes that nobody committed: the commit does not identify the build."
                .into(),
        );
    }
    found
}

/// The hypervisors below the runs, if there is one.
pub(super) fn virtual_machine(runs: &[RunFiles]) -> Option<String> {
    let mut hosts: Vec<String> = Vec::new();
    for hypervisor in runs.iter().map(RunFiles::hypervisor).filter(Hypervisor::is_present) {
        add_new(&mut hosts, hypervisor.to_string());
    }
    (!hosts.is_empty()).then(|| hosts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditions::conditions;
    use crate::made_up::{self, edit_controller, edit_run, edit_summary};
    use realtime::machine::{BuildProfile, HypervisorSign};
    use serde_json::json;

    const LOCKED: &str = "memory locked, current and future";

    fn good() -> Vec<RunFiles> {
        let mut run = made_up::run(10);
        edit_summary(&mut run, |summary| summary["cycles"] = json!(60_000));
        made_up::reference(&mut run, (0..60_000).map(|_| 13_000).collect());
        vec![run.clone(), run]
    }

    fn reference_line(run: &mut RunFiles, line: &str) {
        run.reference.as_mut().unwrap().command_line = line.into();
    }

    fn judged(runs: &[RunFiles]) -> Claim {
        claim(runs, &conditions(runs))
    }

    #[test]
    fn runs_with_everything_support_a_claim() {
        let reported = judged(&good());
        assert!(reported.supported, "{:?}", reported.reasons);
        assert_eq!(reported.not_controlled, [""; 0]);
    }

    #[test]
    fn each_reason_is_reported() {
        type RunEdit = fn(&mut RunFiles);
        let cases: [(&str, RunEdit); 18] = [
            ("SCHED_FIFO", |run| {
                edit_run(run, |file| file["realtime_granted"] = json!([LOCKED, "pinned to CPU 0"]));
            }),
            ("a CPU of its own", |run| {
                edit_controller(run, |file| {
                    file["realtime_granted"] = json!([LOCKED, "SCHED_FIFO priority 80"])
                });
            }),
            ("reported their real-time grants", |run| run.controllers.clear()),
            ("did not alternate", |run| run.reference = None),
            ("too few", |run| {
                edit_summary(run, |file| file["cycles"] = json!(20_000));
                made_up::reference(run, (0..20_000).map(|_| 13_000).collect());
            }),
            ("probe", |run| run.conditions.get_or_insert_default().probe = true),
            ("did not reach", |run| edit_summary(run, |file| file["records_dropped"] = json!(3))),
            ("priority 70, the rig 80", |run| reference_line(run, "cyclictest -p 70 -a 0 -i 1000")),
            ("CPU 1, the rig 0", |run| reference_line(run, "cyclictest --priority=80 --affinity=1")),
            ("CPU none, the rig 0", |run| reference_line(run, "cyclictest -p80 -i1000")),
            ("beside a run of 60 s", |run| {
                made_up::reference(run, (0..9_000).map(|_| 13_000).collect());
            }),
            ("shared CPU 0", |run| {
                edit_controller(run, |file| file["realtime_granted"][2] = json!("pinned to CPU 0"));
            }),
            ("debugging", |run| {
                edit_run(run, |file| file["machine"]["build"]["profile"] = json!("debug, opt-level 0"));
            }),
            ("not passed", |run| edit_summary(run, |file| file["passed"] = json!(false))),
            ("missed 0.2 %", |run| edit_summary(run, |file| file["skipped"] = json!(120))),
            ("QEMU (TCG)", |run| {
                edit_run(run, |file| file["machine"]["processor"] = json!("QEMU TCG CPU version 2.5+"));
            }),
            ("nobody committed", |run| run.conditions.get_or_insert_default().uncommitted_files = Some(2)),
            ("counts allocations", |run| edit_run(run, |file| file["counts_allocations"] = json!(true))),
        ];
        for (words, edit) in cases {
            let mut runs = good();
            edit(&mut runs[1]);
            let reported = judged(&runs);
            assert!(!reported.supported && reported.reasons.len() == 1, "{words}: {:?}", reported.reasons);
            assert!(reported.reasons[0].contains(words), "{:?}", reported.reasons);
        }
    }

    #[test]
    fn a_claim_of_a_virtual_machine_follows_from_the_hypervisor_of_any_run() {
        let with = |hypervisor: Hypervisor| {
            let mut runs = good();
            edit_run(&mut runs[1], |file| file["machine"]["hypervisor"] = json!(hypervisor));
            (virtual_machine(&runs), judged(&runs).sentence.contains("virtual machine"))
        };
        let signs = vec![HypervisorSign::CpuFlag, HypervisorSign::ClockSource("kvm-clock".into())];
        let host = "cpuinfo flag 'hypervisor'; clock source kvm-clock".to_owned();
        assert_eq!(with(Hypervisor::Present(signs)), (Some(host), true));
        assert_eq!(with(Hypervisor::Absent), (None, false));
        assert_eq!(with(Hypervisor::NotRecorded("unknown".into())), (None, false));
        assert_eq!(virtual_machine(&[RunFiles::default()]), None);
    }

    #[test]
    fn a_build_for_debugging_is_a_reason_by_its_profile() {
        let with = |profile: BuildProfile| {
            let mut runs = good();
            edit_run(&mut runs[0], |file| file["machine"]["build"]["profile"] = json!(profile));
            judged(&runs).supported
        };
        assert!(!with(BuildProfile::Debug { settings: String::new() }));
        assert!(with(BuildProfile::Release { settings: ", opt-level s".into() }));
        assert!(with(BuildProfile::default()));
    }

    #[test]
    fn what_was_not_controlled_is_said_and_weakens_the_sentence() {
        let mut runs = good();
        for run in &mut runs {
            edit_run(run, |file| {
                file["machine"] = json!({ "kernel": "PREEMPT_DYNAMIC", "hypervisor": "KVM" });
            });
            run.conditions.get_or_insert_default().load_generator = None;
        }
        let reported = judged(&runs);
        assert!(reported.supported && reported.sentence.contains("virtual machine (KVM)"), "{reported:?}");
        assert!(reported.not_controlled.len() >= 5, "{:?}", reported.not_controlled);
    }
}
