//! From what was seen of a late cycle to its cause, with the evidence that a person can check.
//!
//! The rules in their order; the first that holds names the cause. *It* is the lateness or the slowness, whichever is larger.
//!
//! | rule | cause |
//! |---|---|
//! | the process was continued by SIGCONT in these cycles | emulator-stopped, controller-stopped |
//! | the probe saw the CPU stand still, no thread running on it, for half of it or more | machine-stood-still |
//! | cpu-contention as below, and the other process was late in the same moment without waiting for a CPU | machine-stood-still |
//! | the thread waited for the CPU for half of it or more, in the worst cycle or over all of the event | cpu-contention |
//! | more page faults than 20, or faults that explain a third of it | page-faults |
//! | slow work; another CPU stood still for half of it, or the other process was late in the same moment | machine-stood-still |
//! | slow work, and neither holds | unexplained |
//! | the probe watched that CPU and saw it taken for less than a quarter of it | unexplained |
//! | the kernel does not tell how long threads wait | unexplained |
//! | none of these | machine-stood-still, as what is left |
//!
//! A late timer interrupt leaves no trace in the scheduler: the thread was not yet ready, so it did not wait, and nobody was
//! ahead of it. On a virtual machine an interruption by its host looks like that. What another CPU wakes is ready at
//! once: there a CPU that stands still looks like waiting, which is why the probe and the other process are asked first.

use crate::files::EMULATOR;
use crate::model::Cause;
use crate::probe::ProbeCoverage;
use realtime::VitalCounts;

/// Faults in a cycle from which on they are a cause by themselves: a locked process has none.
const MANY_FAULTS: u64 = 20;
/// What a fault costs about, ns: minor on this kind of machine 0.5 to 2 us, major at least a read from a fast disk. A guess.
const MINOR_FAULT_NS: u64 = 1_000;
const MAJOR_FAULT_NS: u64 = 100_000;

/// Evidence of an event, at its worst cycle.
#[derive(Clone, Debug)]
pub(crate) struct LatenessEvidence {
    pub process: String,
    pub late_ns: u64,
    /// How much slower than usual, ns.
    pub slow_ns: u64,
    pub missed: u64,
    /// Lengths of the stages receive, step, send, ns.
    pub stages_ns: [u64; 3],
    pub vitals: VitalCounts,
    /// SIGCONTs in the event's cycles and right after.
    pub continued: u64,
    /// Whether the kernel tells for how long threads wait for a CPU.
    pub knows_run_delay: bool,
    /// Time that it waited for a CPU in all cycles of the event, ns.
    pub waited_ns: u64,
    /// Lateness or slowness of all cycles of the event, ns.
    pub together_ns: u64,
    pub probe_watched: ProbeCoverage,
    /// Longest gap of that probe within the event in which no thread had the CPU, ns.
    pub still_ns: u64,
    /// Longest in which another one had, ns.
    pub another_ns: u64,
    /// Longest gap on another CPU in which no thread had it, ns.
    pub still_elsewhere_ns: u64,
    /// Other processes that were late or slow in the same moment: name, by how much, for how long they waited for a CPU, ns.
    pub others: Vec<(String, u64, u64)>,
    /// Whether another process woke on time meanwhile, on another CPU.
    pub ran_elsewhere: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct Explanation {
    pub cause: Cause,
    pub sentence: String,
    pub evidence: Vec<String>,
}

pub(crate) fn cause(lateness: &LatenessEvidence) -> Explanation {
    let cause = first_that_holds(lateness);
    Explanation { cause, sentence: sentence(cause, lateness), evidence: evidence(lateness) }
}

fn first_that_holds(lateness: &LatenessEvidence) -> Cause {
    let bad_ns = lateness.bad_ns();
    let waited = lateness.waited_half();
    let slow = lateness.slow_ns > lateness.late_ns;
    if lateness.continued > 0 {
        return if lateness.process == EMULATOR { Cause::EmulatorStopped } else { Cause::ControllerStopped };
    }
    if lateness.still_ns.saturating_mul(2) >= bad_ns {
        return Cause::MachineStoodStill;
    }
    if waited {
        return if lateness.other_stood_still() { Cause::MachineStoodStill } else { Cause::CpuContention };
    }
    if lateness.faults() > MANY_FAULTS || lateness.fault_cost_ns().saturating_mul(3) >= bad_ns {
        return Cause::PageFaults;
    }
    if slow {
        let elsewhere =
            lateness.still_elsewhere_ns.saturating_mul(2) >= bad_ns || lateness.other_stood_still();
        return if elsewhere { Cause::MachineStoodStill } else { Cause::Unexplained };
    }
    let cpu_was_free = lateness.probe_watched == ProbeCoverage::Watched
        && lateness.still_ns.max(lateness.another_ns).saturating_mul(4) < bad_ns;
    if cpu_was_free || !lateness.knows_run_delay { Cause::Unexplained } else { Cause::MachineStoodStill }
}

impl LatenessEvidence {
    /// What is to be explained, ns.
    fn bad_ns(&self) -> u64 {
        self.late_ns.max(self.slow_ns)
    }

    /// Whether it waited for a CPU for half of it or more, in the worst cycle or over all of them.
    fn waited_half(&self) -> bool {
        self.vitals.run_delay_ns.saturating_mul(2) >= self.bad_ns()
            || self.waited_ns.saturating_mul(2) >= self.together_ns
    }

    /// Whether something shows that the machine ran: a thread that kept the probe away, a process on another CPU, or that the
    /// rig, which its own CPU's timer wakes, was ready for half of it.
    pub(crate) fn machine_ran(&self) -> bool {
        self.another_ns.saturating_mul(2) >= self.bad_ns()
            || self.ran_elsewhere
            || (self.process == EMULATOR && self.waited_half())
    }

    fn faults(&self) -> u64 {
        self.vitals.minor_faults + self.vitals.major_faults
    }

    fn fault_cost_ns(&self) -> u64 {
        self.vitals.minor_faults * MINOR_FAULT_NS + self.vitals.major_faults * MAJOR_FAULT_NS
    }

    /// Whether another process was about as late in the same moment, and not because it waited for a CPU.
    fn other_stood_still(&self) -> bool {
        let still = |(_, bad_ns, waited_ns): &(String, u64, u64)| {
            bad_ns.saturating_mul(2) >= self.bad_ns() && waited_ns.saturating_mul(2) < *bad_ns
        };
        self.others.iter().any(still)
    }
}

/// A length of time as a person reads it.
pub(crate) fn in_words(ns: u64) -> String {
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => format!("{:.1} us", ns as f64 * 1e-3),
        1_000_000..1_000_000_000 => format!("{:.2} ms", ns as f64 * 1e-6),
        _ => format!("{:.2} s", ns as f64 * 1e-9),
    }
}

fn sentence(cause: Cause, lateness: &LatenessEvidence) -> String {
    let LatenessEvidence { process, missed, vitals, .. } = lateness;
    let what = if lateness.slow_ns > lateness.late_ns {
        format!("The {process} was {} slower than usual", in_words(lateness.slow_ns))
    } else {
        format!("The {process} woke {} late", in_words(lateness.late_ns))
    };
    let and_missed = match missed {
        0 => String::new(),
        1 => " and missed 1 cycle".into(),
        missed => format!(" and missed {missed} cycles"),
    };
    let cpu = vitals.cpu;
    let because = match cause {
        Cause::EmulatorStopped | Cause::ControllerStopped => {
            "because its process was stopped and continued by a signal".to_owned()
        }
        Cause::CpuContention => format!(
            "because other threads had CPU {cpu} for {}: to a FIFO thread only threads of the same or a higher priority, \
             interrupts and the kernel's stop threads can do that",
            in_words(lateness.waited_ns)
        ),
        Cause::PageFaults => {
            format!("because it had to wait for pages: {} faults in one cycle", lateness.faults())
        }
        Cause::MachineStoodStill if lateness.still_ns.saturating_mul(2) >= lateness.bad_ns() => format!(
            "because the machine stood still: for {} no thread ran on CPU {cpu}, which the probe saw",
            in_words(lateness.still_ns)
        ),
        Cause::MachineStoodStill if lateness.other_stood_still() || lateness.still_elsewhere_ns > 0 => {
            let waited = in_words(lateness.waited_ns);
            // The kernel's account and the other witness contradict each other: a waiting thread has a CPU that runs.
            let (likely, although) = if lateness.waited_half() {
                (
                    "most likely ",
                    format!(
                        ", although by the kernel's account it was ready and waited {waited} for CPU {cpu}"
                    ),
                )
            } else {
                ("", String::new())
            };
            format!(
                "{likely}because the machine stood still: more than this process was late in the same moment{although}"
            )
        }
        Cause::MachineStoodStill => format!(
            "most likely because the machine stood still: it waited only {} of {} for CPU {cpu}, had {} page faults and was \
             not stopped, so that the timer's interrupt itself came late",
            in_words(lateness.waited_ns),
            in_words(lateness.together_ns),
            if lateness.faults() == 0 { "no".to_owned() } else { lateness.faults().to_string() }
        ),
        _ if lateness.probe_watched == ProbeCoverage::Watched && lateness.slow_ns <= lateness.late_ns => {
            format!("and nothing explains it: the probe saw CPU {cpu} free in that time")
        }
        _ if lateness.slow_ns > lateness.late_ns => {
            "and nothing that was recorded tells whether its work was longer or the CPU stood still under it"
                .to_owned()
        }
        _ => "and nothing that was recorded explains it".to_owned(),
    };
    format!("{what}{and_missed}, {because}.")
}

fn evidence(lateness: &LatenessEvidence) -> Vec<String> {
    let LatenessEvidence { vitals, .. } = lateness;
    let mut reported = Vec::new();
    if lateness.continued > 0 {
        reported.push(format!("SIGCONT was counted {} time(s) in these cycles.", lateness.continued));
    }
    reported.push(if lateness.knows_run_delay {
        format!("It was ready and waited for the CPU for {}.", in_words(lateness.waited_ns))
    } else {
        "The kernel does not tell how long threads wait for a CPU.".to_owned()
    });
    reported.push(format!(
        "Page faults in the cycle: {} minor, {} major.",
        vitals.minor_faults, vitals.major_faults
    ));
    if vitals.involuntary_switches > 0 {
        reported
            .push(format!("Another thread took the CPU from it {} time(s).", vitals.involuntary_switches));
    }
    if vitals.voluntary_switches > 1 {
        let switches = vitals.voluntary_switches;
        reported.push(format!(
            "It gave the CPU away {switches} times; once a cycle is usual, so its own work blocked."
        ));
    }
    if lateness.slow_ns > lateness.late_ns {
        let [receive, step, send] = lateness.stages_ns.map(in_words);
        reported.push(format!("Stages of that cycle: receive {receive}, step {step}, send {send}."));
    }
    for (other, bad_ns, waited_ns) in &lateness.others {
        let (bad, waited) = (in_words(*bad_ns), in_words(*waited_ns));
        reported.push(format!(
            "In the same moment {other} was late or slow by {bad}, of which it waited {waited} for a CPU."
        ));
    }
    reported.push(probe_evidence(lateness));
    reported
}

fn probe_evidence(lateness: &LatenessEvidence) -> String {
    let cpu = lateness.vitals.cpu;
    let mut text = if lateness.probe_watched == ProbeCoverage::Unwatched {
        format!("No probe watched CPU {cpu}: whether it stood still was not seen directly.")
    } else if lateness.probe_watched == ProbeCoverage::NotReported {
        format!("The probe's table has no gap of CPU {cpu}, and does not tell whether that CPU was watched.")
    } else if lateness.still_ns > 0 {
        format!(
            "The probe saw CPU {cpu} stand still for {} of it, no other thread running.",
            in_words(lateness.still_ns)
        )
    } else if lateness.another_ns > 0 {
        format!(
            "The probe was kept from CPU {cpu} by another thread for {} of it.",
            in_words(lateness.another_ns)
        )
    } else {
        format!("The probe on CPU {cpu} saw no gap in that time.")
    };
    if lateness.still_elsewhere_ns > 0 {
        text.push_str(&format!(
            " Another CPU stood still for {} of it.",
            in_words(lateness.still_elsewhere_ns)
        ));
    }
    text
}
