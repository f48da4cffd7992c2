//! What disturbed the runs as a whole: from the events and from what all processes counted.
//!
//! What somebody did comes first, in the order of [`Cause`]; what machines do by themselves last, by the lateness that it
//! explains. Lateness of which nothing was recorded is a finding too. A counter is a
//! witness that needs no interpretation, so counters speak even where no late cycle followed.

use super::explain::EVENT_OVER_NS;
use super::explain::rules::in_words;
use super::files::{EMULATOR, RunFiles};
use super::kinds::WAKE_UP;
use super::model::{Cause, Event, Finding};
use protocol::periods::CYCLE_NS;
use runlog::controller_report::ControllerReport;
use runlog::timing::CycleTiming;
use std::collections::BTreeMap;

/// Page faults of a process after its first second that are a storm; memory that is locked gives none.
const STORM_FAULTS: u64 = 1000;
/// Share of cycles with faults that is one.
const STORM_SHARE: f64 = 0.05;
/// Contention counts as done to a run, and not as what its machine does by itself, from so many events of a process on that took
/// this long each while the machine was seen running, or from two on that explain this much together. A host that takes a virtual
/// CPU away between two threads looks like one such event, and hardly comes back to the same thread; a hog does.
const HOG_EVENTS: usize = 3;
const HOG_EVENT_NS: u64 = 2_000_000;
const HOG_TOGETHER_NS: u64 = 8_000_000;
/// A maximum is that of a row when it is no further from it: logs keep three digits.
const SAME_MAXIMUM: f64 = 0.98;

/// All findings, the most telling first.
pub(crate) fn find(runs: &[RunFiles], events: &[Event]) -> Vec<Finding> {
    let mut found: Vec<_> = [
        stopped(runs, events, Cause::EmulatorStopped),
        stopped(runs, events, Cause::ControllerStopped),
        contention(events),
        unrecorded(runs),
        page_faults(runs, events),
        slow_listener(runs),
        frame_loss(runs),
        clock_step(runs),
        left_over(events, Cause::MachineStoodStill),
        left_over(events, Cause::Unexplained),
    ]
    .into_iter()
    .flatten()
    .collect();
    // A counted signal tells more than any length of waiting; what is left to interpret goes by what it explains.
    found.sort_by_key(|finding| {
        let explained_ns = if finding.by_itself { finding.explained_ns } else { 0 };
        (finding.by_itself, std::cmp::Reverse(explained_ns), finding.cause)
    });
    found
}

fn of(events: &[Event], cause: Cause) -> impl Iterator<Item = &Event> {
    events.iter().filter(move |event| event.cause == cause)
}

/// The worst lateness or slowness of events, in words.
fn worst<'a>(events: impl Iterator<Item = &'a Event>) -> String {
    in_words(events.map(|event| event.late_ns.max(event.slow_ns)).max().unwrap_or_default())
}

fn explained_ns(events: &[Event], cause: Cause) -> u64 {
    of(events, cause).map(|event| event.late_ns.max(event.slow_ns)).sum()
}

fn stopped(runs: &[RunFiles], events: &[Event], cause: Cause) -> Option<Finding> {
    let is_rig = cause == Cause::EmulatorStopped;
    let reports = runs.iter().flat_map(RunFiles::process_reports);
    let of_process = reports.filter(|(process, _)| (*process == EMULATOR) == is_rig);
    let counted = of_process.map(|(_, report)| report.timing.vitals.continued).sum::<u64>();
    let explained = of(events, cause).count() as u64;
    let count = counted.max(explained);
    let who = if is_rig { "The emulator" } else { "A controller" };
    let effect =
        if explained > 0 { format!(", at worst for {}", worst(of(events, cause))) } else { String::new() };
    (count > 0).then(|| Finding {
        cause,
        count,
        explained_ns: explained_ns(events, cause),
        by_itself: false,
        sentence: format!("{who} was stopped and continued by a signal {count} time(s){effect}."),
    })
}

fn contention(events: &[Event]) -> Option<Finding> {
    let cause = Cause::CpuContention;
    let count = of(events, cause).count() as u64;
    // What a process waited is no more lateness than it had.
    let waited_ns = |event: &Event| event.waited_ns.min(event.late_ns.max(event.slow_ns));
    let mut hogged: BTreeMap<(usize, &str), Vec<u64>> = BTreeMap::new();
    let mut who: Vec<_> = of(events, cause).map(|event| event.process.as_str()).collect();
    for event in of(events, cause).filter(|event| event.machine_ran && waited_ns(event) >= HOG_EVENT_NS) {
        hogged.entry((event.run, &event.process)).or_default().push(waited_ns(event));
    }
    let is_hog = |waits: &Vec<u64>| {
        waits.len() >= HOG_EVENTS || (waits.len() > 1 && waits.iter().sum::<u64>() >= HOG_TOGETHER_NS)
    };
    let by_itself = !hogged.values().any(is_hog);
    let explained_ns = of(events, cause).map(waited_ns).sum();
    (count > 0).then(|| {
        who.sort_unstable();
        who.dedup();
        let rare = if by_itself {
            " So few or so short ones are also what a host does that takes away a virtual CPU."
        } else {
            ""
        };
        let sentence = format!(
            "{count} time(s) other threads of the same or a higher priority, or interrupts, kept {} from the CPU, at worst \
             for {}; together that explains {} of lateness.{rare}",
            who.join(" and "),
            worst(of(events, cause)),
            in_words(explained_ns)
        );
        Finding { cause, count, explained_ns, by_itself, sentence }
    })
}

/// What is known to have been late or missed, and of which there is no row; or that nothing is known.
fn unrecorded(runs: &[RunFiles]) -> Option<Finding> {
    let (mut skipped, mut worst_ns, mut unknown) = (0, 0, 0);
    for run in runs {
        let rows = run.rows.get(EMULATOR).map(Vec::as_slice).unwrap_or_default();
        let summary = run.counted();
        let counted = summary.and_then(|summary| summary.skipped);
        let logged = run.logged.get(WAKE_UP).and_then(|series| series.samples.max_ns());
        let longest_ns = logged.or(summary.and_then(|summary| summary.wakeup_ns.max));
        let missing = counted.unwrap_or_default().saturating_sub(rows.iter().map(|row| row.skipped).sum());
        let late_ns = |row: &CycleTiming| (row.woke_ns + row.skipped * CYCLE_NS).saturating_sub(row.due_ns);
        let of_rows_ns = rows.iter().map(late_ns).max().unwrap_or_default();
        let max_ns =
            longest_ns.filter(|ns| of_rows_ns as f64 / (*ns as f64) < SAME_MAXIMUM).unwrap_or_default();
        // Rows tell lateness that histograms do not know, never the other way round.
        if missing > 0 || max_ns > EVENT_OVER_NS {
            skipped += missing;
            worst_ns = worst_ns.max(longest_ns.unwrap_or_default());
        }
        unknown += u64::from(rows.is_empty() && (counted.is_none() || longest_ns.is_none()));
    }
    let mut reported = Vec::new();
    if skipped > 0 || worst_ns > EVENT_OVER_NS {
        let worst = if worst_ns > 0 { in_words(worst_ns) } else { "not recorded".into() };
        reported.push(format!(
            "{skipped} cycles skipped, worst wake-up {worst}; no rows recorded, the cause is not known (run with \
             --full-timing)."
        ));
    }
    if unknown > 0 {
        reported.push(format!(
            "{unknown} run(s) hold neither rows nor both counts and wake-ups of the rig: whether a cycle was late is not known."
        ));
    }
    (!reported.is_empty()).then(|| Finding {
        cause: Cause::Unknown,
        count: skipped.max(1),
        explained_ns: 0,
        by_itself: true,
        sentence: reported.join(" "),
    })
}

fn page_faults(runs: &[RunFiles], events: &[Event]) -> Option<Finding> {
    let cause = Cause::PageFaults;
    let mut faults = 0;
    let mut storms = Vec::new();
    for (process, report) in runs.iter().flat_map(RunFiles::process_reports) {
        let of_process = report.timing.vitals.minor_faults + report.timing.vitals.major_faults;
        faults += of_process;
        if of_process > STORM_FAULTS {
            storms.push(process.to_owned());
        }
    }
    for run in runs.iter().filter(|run| run.whole) {
        for (process, rows) in &run.rows {
            // The first second touches everything for the first time.
            let settled = rows.iter().filter(|row| row.cycle >= 1000);
            let (all, with) = settled.fold((0u64, 0u64), |(all, with), row| {
                (all + 1, with + u64::from(row.vitals.minor_faults + row.vitals.major_faults > 0))
            });
            if with as f64 > STORM_SHARE * all as f64 {
                storms.push(process.clone());
            }
        }
    }
    storms.sort();
    storms.dedup();
    let late = of(events, cause).count() as u64;
    (late > 0 || !storms.is_empty()).then(|| {
        let who = if storms.is_empty() { String::new() } else { format!(" in {}", storms.join(" and ")) };
        let sentence = format!(
            "{faults} page faults after the first second{who}; {late} late or slow cycle(s) by them."
        );
        let explained_ns = explained_ns(events, cause);
        Finding { cause, count: faults.max(late), explained_ns, by_itself: false, sentence }
    })
}

fn slow_listener(runs: &[RunFiles]) -> Option<Finding> {
    let mut count = 0;
    let mut who = Vec::new();
    for run in runs {
        let host = run.counted().and_then(|summary| summary.bus_host.as_ref());
        for peer in host.into_iter().flat_map(|host| &host.peers) {
            let dropped = peer.dropped_at_queue.total();
            if dropped > 0 {
                count += dropped;
                let what = if peer.frames_received == 0 {
                    "a listener, which sends nothing"
                } else {
                    "a sender too"
                };
                who.push(format!("{} ({what})", peer.name));
            }
        }
        for (process, report) in run.process_reports() {
            let dropped = report.bus.map_or(0, |bus| bus.dropped_on_receive);
            if dropped > 0 {
                count += dropped;
                who.push(process.to_owned());
            }
        }
    }
    who.sort();
    who.dedup();
    (count > 0).then(|| Finding {
        cause: Cause::SlowListener,
        count,
        sentence: format!(
            "{count} frames did not fit the full queue of {}, which did not read it in time; other peers had theirs.",
            who.join(", ")
        ),
        ..Finding::default()
    })
}

/// Frames that never came, by gaps in the counters at rig and controllers.
pub(crate) fn lost_by_gaps(run: &RunFiles) -> u64 {
    let at_rig = run.counted().map_or(0, |summary| {
        summary.frames_lost_at_rig.unwrap_or(summary.drive_commands.lost + summary.load_commands.lost)
    });
    let of_process =
        |report: &ControllerReport| report.axes.values().filter_map(|axis| axis.sensors_lost).sum::<u64>();
    let at_controllers = run.controller_reports().map(|(_, report)| of_process(report)).sum::<u64>();
    at_rig + at_controllers
}

fn frame_loss(runs: &[RunFiles]) -> Option<Finding> {
    let (mut lost, mut at_queues, mut on_wire) = (0, 0, 0);
    for run in runs {
        lost += lost_by_gaps(run);
        if let Some(host) = run.counted().and_then(|summary| summary.bus_host.as_ref()) {
            on_wire += host.injected_loss.total();
            // A listener's queue says nothing of what rig and controllers missed.
            let ours = host.peers.iter().filter(|peer| peer.frames_received > 0);
            at_queues += ours.map(|peer| peer.dropped_at_queue.total()).sum::<u64>();
        }
        let buses = run.process_reports().filter_map(|(_, report)| report.bus);
        at_queues += buses.map(|bus| bus.dropped_on_receive + bus.dropped_on_send).sum::<u64>();
    }
    let unaccounted = lost.saturating_sub(at_queues);
    (unaccounted > 0 || on_wire > 0).then(|| {
        let witness = if on_wire > 0 {
            format!("the host of the bus counted {on_wire} frames of all kinds that its wire lost")
        } else {
            "no queue that was counted dropped them".to_owned()
        };
        Finding {
            cause: Cause::FrameLoss,
            count: unaccounted.max(on_wire),
            sentence: format!(
                "{lost} frames never came, by gaps in the counters at rig and controllers; {witness}."
            ),
            ..Finding::default()
        }
    })
}

fn clock_step(runs: &[RunFiles]) -> Option<Finding> {
    let reports = runs.iter().flat_map(RunFiles::process_reports);
    let steps: Vec<f64> =
        reports.flat_map(|(_, report)| &report.wall_clock_steps).map(|step| step.step_s).collect();
    let largest = steps.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    Some(Finding {
        cause: Cause::ClockStep,
        count: steps.len() as u64,
        sentence: format!(
            "The wall clock was stepped, by {largest:+.3} s at most ({} sighting(s)); the cycles run on the monotonic clock and \
             were not touched by it.",
            steps.len()
        ),
        ..Finding::default()
    })
}

fn left_over(events: &[Event], cause: Cause) -> Option<Finding> {
    let count = of(events, cause).count() as u64;
    let at_worst = worst(of(events, cause));
    let sentence = match cause {
        Cause::MachineStoodStill => {
            format!("{count} time(s) the machine stood still, at worst for {at_worst}.")
        }
        _ => format!(
            "{count} late or slow cycle(s), at worst by {at_worst}, are not explained by what was recorded."
        ),
    };
    let explained_ns = explained_ns(events, cause);
    (count > 0).then_some(Finding { cause, count, explained_ns, by_itself: true, sentence })
}

#[cfg(test)]
mod tests;
