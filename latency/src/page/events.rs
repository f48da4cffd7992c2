//! The worst events, a card each, and the findings over all runs.

use super::timeline::{by_process, timeline};
use crate::explain::EVENT_OVER_NS;
use crate::model::{Cause, Event, Finding, NearbyCycle, Report};
use pagekit::markup::{Cell, Table, folded, list, none, number, words as text};
use pagekit::number;
use pagekit::page::escaped;
use runlog::process::TIMING_END;

/// Rows of a card's table; more would make the page heavy, and the flight recorder's dump has them all.
const MOST_ROWS: usize = 400;

/// The hatching of gaps in which another thread ran, once for all drawings.
const HATCH: &str = "<svg width=\"0\" height=\"0\" style=\"position:absolute;width:0;height:0\" aria-hidden=\"true\">\
<defs><pattern id=\"hatch\" width=\"5\" height=\"5\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
<line class=\"hatch\" x1=\"0\" y1=\"0\" x2=\"0\" y2=\"5\"/></pattern></defs></svg>\n";

pub(super) fn worst(report: &Report) -> String {
    if report.worst.is_empty() {
        return none(&nothing(report));
    }
    let cards =
        report.worst.iter().enumerate().map(|(place, event)| card(event, place, report.conditions.probe));
    HATCH.to_owned() + &cards.collect::<String>()
}

/// What it means that there is no event.
fn nothing(report: &Report) -> String {
    if report.runs.is_empty() || report.findings.iter().any(|finding| finding.cause == Cause::Unknown) {
        return "None was recorded, which does not mean that none was: see what disturbed the runs.".into();
    }
    let over = number::length(EVENT_OVER_NS);
    if report.runs.iter().any(|run| run.lacks.iter().any(|lack| lack.contains(TIMING_END))) {
        return format!(
            "None was recorded: no cycle was missed and no wake-up over {over} counted; slower work shows only beyond the \
             flight recorder's limit, because not every run wrote its timing tables."
        );
    }
    format!("None: no cycle was missed, nor late or slower than usual by more than {over}.")
}

fn card(event: &Event, place: usize, is_probed: bool) -> String {
    let rank = place + 1;
    format!(
        "<article class=\"card\" aria-labelledby=\"event-{place}\">\n<h3 id=\"event-{place}\">{rank}. {}: {}</h3>\n\
         <p class=\"soft\">{}</p>\n<p><span class=\"tag\">{}</span> {}</p>\n{}{}{}{}</article>\n",
        escaped(&event.process),
        lateness_text(event),
        occurrence_text(event),
        cause(event.cause),
        escaped(&event.sentence),
        list(&event.evidence, "Nothing was recorded that speaks for or against it."),
        recorded_beside(event),
        timeline(event, place, is_probed),
        rows(event, place),
    )
}

/// Records of the flight recorder and of the rig near the event.
fn recorded_beside(event: &Event) -> String {
    let mut reported = Vec::new();
    if let Some(dump) = &event.dump {
        let frames: Vec<_> =
            event.frames.iter().map(|(id, n)| format!("{} of {id}", number::count(*n))).collect();
        let frames =
            if frames.is_empty() { "no frames".into() } else { format!("frames {}", frames.join(", ")) };
        reported.push(format!("Flight recorder: {dump}, with {frames}."));
    }
    reported.extend(event.rig_events.iter().map(|noted| format!("The rig noted: {noted}")));
    if reported.is_empty() { String::new() } else { list(&reported, "") }
}

/// Lateness, slowness and missed cycles of an event.
fn lateness_text(event: &Event) -> String {
    let mut parts = Vec::new();
    if event.late_ns > 0 {
        parts.push(format!("{} late", number::length(event.late_ns)));
    }
    if event.slow_ns > 0 {
        parts.push(format!("{} slower than usual", number::length(event.slow_ns)));
    }
    if event.skipped > 0 {
        parts.push(number::counted(event.skipped, "cycle missed", "cycles missed"));
    }
    if parts.is_empty() { "on time".into() } else { parts.join(", ") }
}

fn occurrence_text(event: &Event) -> String {
    format!(
        "Run {}, cycle {}, at {} s.",
        event.run,
        number::count(event.cycle),
        number::decimal(event.at_s, 3)
    )
}

/// Rows of all processes and the probe's gaps.
fn rows(event: &Event, place: usize) -> String {
    let total: usize = event.nearby_cycles.values().map(Vec::len).sum();
    if total + event.probe.len() == 0 {
        return String::new();
    }
    let label = format!("Rows around event {}", place + 1);
    let head = [
        "process",
        "cycle",
        "due, µs",
        "late, µs",
        "execution, µs",
        "waited for the CPU, µs",
        "page faults",
        "switched out",
        "CPU",
    ];
    let us = |value: f64| number(number::decimal(value, 1));
    let mut table = Table::new(label, head);
    let mut left_out = 0;
    for (process, cycles) in by_process(event) {
        let shown = nearest(cycles, MOST_ROWS / event.nearby_cycles.len().max(1));
        left_out += cycles.len() - shown.len();
        for row in shown {
            let is_hit = process == event.process && row.cycle == event.cycle;
            table.marked_row(
                if is_hit { "hit" } else { "" },
                [
                    text(process),
                    number(number::count(row.cycle)),
                    us(row.due_us),
                    us(row.late_us),
                    us(row.execution_us),
                    us(row.run_delay_us),
                    number(number::count(row.faults)),
                    number(number::count(row.involuntary_switches)),
                    number(row.cpu.to_string()),
                ],
            );
        }
    }
    let mut gaps = Table::new(
        format!("Gaps around event {}", place + 1),
        ["CPU", "from, µs", "length, µs", "meanwhile"],
    );
    for gap in &event.probe {
        let meanwhile = if gap.another_ran { "another thread ran" } else { "the CPU itself stood still" };
        gaps.row([text(format!("CPU {}", gap.cpu)), us(gap.from_us), us(gap.length_us), text(meanwhile)]);
    }
    let note = match left_out {
        0 => String::new(),
        left_out => none(&format!(
            "{} further away are left out here; report.json has them.",
            number::counted(left_out as u64, "row", "rows")
        )),
    };
    let gaps = if event.probe.is_empty() { String::new() } else { gaps.html_or("") };
    let summary = format!(
        "The {} around it{}",
        number::counted(total as u64, "cycle", "cycles"),
        if event.probe.is_empty() { "" } else { " and the probe's gaps" }
    );
    folded(&summary, &format!("{}{note}{gaps}", table.html_or("No cycles around it were recorded.")))
}

/// As many rows as there is room for, around the due time of the event.
fn nearest(rows: &[NearbyCycle], room: usize) -> &[NearbyCycle] {
    if rows.len() <= room {
        return rows;
    }
    let middle = rows.partition_point(|row| row.due_us < 0.0);
    let start = middle.saturating_sub(room / 2).min(rows.len() - room);
    &rows[start..start + room]
}

pub(super) fn findings(findings: &[Finding]) -> String {
    let mut table = Table::new("Findings", ["what", "how often", "in words"]);
    for finding in findings {
        table.row([
            text(cause(finding.cause)),
            number(number::count(finding.count)),
            Cell::Sentence(finding.sentence.clone()),
        ]);
    }
    table.html_or("None: nothing was found that disturbed the runs.")
}

fn cause(cause: Cause) -> &'static str {
    match cause {
        Cause::EmulatorStopped => "the rig's process was stopped",
        Cause::ControllerStopped => "a controller's process was stopped",
        Cause::CpuContention => "another thread had the CPU",
        Cause::PageFaults => "page faults",
        Cause::SlowListener => "a listener does not read its queue",
        Cause::FrameLoss => "frames lost on the wire",
        Cause::ClockStep => "the wall clock was stepped",
        Cause::MachineStoodStill => "the machine stood still",
        Cause::Unexplained => "unexplained",
        Cause::Unknown => "not recorded",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_nearest_to_the_event_are_shown() {
        let row = |cycle: u64| {
            let due_us = cycle as f64 * 1000.0 - 5000.0;
            NearbyCycle { cycle, due_us, ..NearbyCycle::default() }
        };
        let rows: Vec<_> = (0..20).map(row).collect();
        let cycles = |room| nearest(&rows, room).iter().map(|row| row.cycle).collect::<Vec<_>>();
        assert_eq!(cycles(4), [3, 4, 5, 6]);
        assert_eq!(cycles(30).len(), 20);
        assert_eq!(cycles(14)[0], 0);
    }
}
