//! Where and how it was measured, what nobody controlled, and how the page is to be read.

use crate::model::{Conditions, Fact, Report};
use pagekit::markup::{list, none};
use pagekit::number;
use pagekit::page::escaped;

/// Everything that was reported of the machine and of how the programs were started.
pub(super) fn conditions(conditions: &Conditions) -> String {
    let fact = |name: &str, value: &str| Fact { name: name.into(), value: value.into() };
    let load =
        conditions.load_generator.as_deref().unwrap_or("none was reported: the machine was taken as it was");
    let reference = match (&conditions.reference, &conditions.reference_missing_because) {
        (Some(reference), _) => reference.clone(),
        (None, Some(reason)) => format!("none: {reason}"),
        (None, None) => "none".into(),
    };
    let probe = if conditions.probe {
        "watched the machine for gaps"
    } else {
        "not running: whether the machine stood still is not known"
    };
    let accompanying =
        [fact("load generator", load), fact("reference", &reference), fact("spin-gap probe", probe)];
    [
        ("Machine, kernel, limits, build", conditions.machine.as_slice()),
        ("Command lines", &conditions.command_lines),
        ("Privileges", &conditions.privileges),
        ("Beside the runs", &accompanying),
    ]
    .map(|(title, facts)| format!("<h3>{title}</h3>\n{}", table(title, facts)))
    .concat()
}

fn table(title: &str, facts: &[Fact]) -> String {
    if facts.is_empty() {
        return none("None was recorded.");
    }
    let rows = facts.iter().map(|fact| {
        let (name, value) = (escaped(&fact.name), escaped(&fact.value));
        let value = if value.is_empty() { number::NOT_MEASURED.to_owned() } else { value };
        format!("<tr><th scope=\"row\">{name}</th><td class=\"code\">{value}</td></tr>\n")
    });
    let rows: String = rows.collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\">\n<table class=\"facts\">\n<tbody>\n{rows}\
         </tbody>\n</table>\n</div>\n"
    )
}

pub(super) fn not_controlled(report: &Report) -> String {
    list(&report.claim.not_controlled, "Nothing is known that was left uncontrolled.")
}

/// How to read the page, without anything that only this project would know.
const HOW_TO_READ: [(&str, &str); 9] = [
    (
        "Percentile",
        "p99 = 50 µs says: of all cycles (or frames) of all runs together, 99 in 100 took at most 50 µs. It is no average of \
         percentiles. p99.99 says something from about a hundred thousand samples on; with fewer it lies close to the maximum.",
    ),
    (
        "Maximum",
        "The longest that was seen, not the longest that can be. Maxima of two measurements do not compare; p50 and p99 do.",
    ),
    (
        "Scheduled time",
        "Wake-up latency counts from the time at which the cycle was due on a fixed grid of 1 ms, not from when the loop went to \
         sleep. A controller is due when the sensor frame arrives at its queue.",
    ),
    (
        "Coordinated omission",
        "A loop that stalls for 50 ms has missed 50 cycles. Measuring only the cycles that ran would show one late cycle and \
         forget the others; here every missed cycle is in the histogram with the lateness that it had.",
    ),
    (
        "Missed, lost, late",
        "A cycle is missed when its time passed before the loop woke. A frame is lost when a queue or the wire dropped it; it is \
         counted there and, apart from that, by the receiver as a gap in the counters.",
    ),
    (
        "Reference",
        "A program that others wrote and trust, with the same priority, interval and CPU, run in turns with ours: what it shows \
         is the machine's share. A ratio near 1 says that ours adds little.",
    ),
    (
        "Gap of the probe",
        "A thread that does nothing but read the clock saw no time pass as it should. If no other thread had its CPU, the \
         machine stood still (a hypervisor, firmware, an interrupt); no program on it can help that.",
    ),
    (
        "Cause",
        "Named by rule from what was recorded: stops and continues, page faults, switches, waiting for the CPU, counters of \
         frames, gaps. What no record explains is called unexplained.",
    ),
    (
        "Clock and numbers",
        "All stamps of all processes are of one clock (CLOCK_MONOTONIC). Runs and seconds are numbered from 0, as in report.json.",
    ),
];

pub(super) fn how_to_read() -> String {
    let entries = HOW_TO_READ
        .iter()
        .map(|(term, sentence)| format!("<dt><strong>{term}</strong></dt>\n<dd>{sentence}</dd>\n"));
    format!("<dl class=\"lead\">\n{}</dl>\n", entries.collect::<String>())
}
