//! What happened when something was late: rows of cycles become events, and each event gets a cause with its evidence.
//!
//! An event is a late, slow or missed cycle with those that follow closely. *Late* is counted from the time at which the first
//! missed cycle was due, *slow* from what the process usually takes from waking to done (its median). A controller is due when
//! its sensors arrive, so that a late rig does not make its controllers late too.
//!
//! | file | holds |
//! |---|---|
//! | [`rules`] | from what is known of an event to its cause |
//! | [`beside`] | what the flight recorder and the rig noted beside an event |
//!
//! Pure: rows in, events out; it knows nothing of who disturbed a run.

pub(crate) mod beside;
pub(crate) mod rules;

use super::files::{EMULATOR, RunFiles};
use super::findings::lost_by_gaps;
use super::model::{Event, NearbyCycle, ProbeGap};
use super::probe;
use protocol::periods::CYCLE_NS;
use rules::LatenessEvidence;
use runlog::probe::Gap;
use runlog::timing::CycleTiming;
use std::collections::BTreeMap;

/// A wake-up or an execution is looked at from this much later than usual on, ns.
pub(crate) const EVENT_OVER_NS: u64 = 200_000;
/// Late cycles this near to each other are one event.
const CLUSTER_CYCLES: u64 = 5;
/// Cycles shown on each side of an event.
const AROUND_CYCLES: u64 = 5;
/// Rows after an event in which the count of a SIGCONT may stand: its handler runs in whichever thread comes first.
const CONTINUED_WITHIN_CYCLES: u64 = 5;
/// Cycles in a row that were sent and not answered, from which on a controller is taken as not having read them.
const OVERTAKEN_CYCLES: usize = 2;
/// Time on each side of an event from which gaps of the probe are shown, ns.
const GAPS_WITHIN_NS: u64 = 2 * CYCLE_NS;
/// Gaps shown for an event, the longest.
const GAPS_SHOWN: usize = 20;

/// A late, slow or missed cycle.
#[derive(Clone, Copy, Debug)]
struct LateCycle {
    /// Place in the process's rows.
    place: usize,
    /// Cycles that this process missed right before.
    missed: u64,
    /// When the first of them was due, or this one.
    due_ns: u64,
    late_ns: u64,
    slow_ns: u64,
}

impl LateCycle {
    fn severity_ns(&self) -> u64 {
        self.late_ns.max(self.slow_ns)
    }
}

/// All events of a run, in the order of its cycles, process by process.
pub(crate) fn events(place_of_run: usize, run: &RunFiles) -> Vec<Event> {
    let late: Vec<_> =
        run.rows.iter().map(|(process, rows)| (process.as_str(), late_rows(process, rows, run))).collect();
    let mut events = Vec::new();
    for (process, late_rows) in &late {
        let rows = &run.rows[*process];
        let near = |before: &LateCycle, after: &LateCycle| {
            rows[after.place].cycle - after.missed <= rows[before.place].cycle + CLUSTER_CYCLES
        };
        for cluster in late_rows.chunk_by(near) {
            events.push(event(place_of_run, process, cluster, run, &late));
        }
    }
    events
}

/// Sorts by lateness or slowness, whichever is larger, falling; equal ones by run and cycle.
pub(crate) fn sort_by_severity(events: &mut [Event]) {
    events.sort_by_key(|event| (std::cmp::Reverse(event.late_ns.max(event.slow_ns)), event.run, event.cycle));
}

/// One event for each moment: what several processes suffered at once, by the same cause, stands under the worst of them.
/// `events` are sorted by [`sort_by_severity`].
pub(crate) fn one_of_each_moment(events: Vec<Event>) -> Vec<Event> {
    let severity_ns = |event: &Event| event.late_ns.max(event.slow_ns);
    let from_ns = |event: &Event| event.cycle * CYCLE_NS;
    let to_ns = |event: &Event| from_ns(event) + severity_ns(event).max(CYCLE_NS);
    let mut kept: Vec<Event> = Vec::new();
    for event in events {
        let same = kept.iter_mut().find(|other| {
            (other.run, other.cause) == (event.run, event.cause)
                && other.process != event.process
                && from_ns(other) < to_ns(&event)
                && from_ns(&event) < to_ns(other)
        });
        match same {
            Some(other) => other.evidence.push(format!("Of the same moment: {}", event.sentence)),
            None => kept.push(event),
        }
    }
    kept
}

fn execution_ns(row: &CycleTiming) -> u64 {
    row.done_ns.saturating_sub(row.woke_ns)
}

fn late_rows(process: &str, rows: &[CycleTiming], run: &RunFiles) -> Vec<LateCycle> {
    let mut executions: Vec<_> = rows.iter().map(execution_ns).collect();
    executions.sort_unstable();
    let usual_ns = executions.get(executions.len() / 2).copied().unwrap_or_default();
    let lost = lost_by_gaps(run);
    let with_late = |place: usize| {
        let row = &rows[place];
        let (missed, due_ns) = match process {
            EMULATOR => (row.skipped, row.due_ns.saturating_sub(row.skipped * CYCLE_NS)),
            _ => missed_by_controller(place, process, run, lost),
        };
        let late_ns = row.woke_ns.saturating_sub(due_ns);
        LateCycle { place, missed, due_ns, late_ns, slow_ns: execution_ns(row).saturating_sub(usual_ns) }
    };
    let all = (0..rows.len()).map(with_late);
    all.filter(|late| late.missed > 0 || late.severity_ns() > EVENT_OVER_NS).collect()
}

/// Cycles whose sensors a controller had and let pass, and when the first of them arrived.
///
/// Its row counts all cycles without one of their own, be their sensors overtaken, lost or never sent. The rig's rows tell which
/// were sent, and the flight recorder for how long the oldest sensors waited. Without its word, several cycles in a row that were
/// sent and of which nothing was lost in the whole run must have been overtaken.
fn missed_by_controller(place: usize, process: &str, run: &RunFiles, lost: u64) -> (u64, u64) {
    let rows = &run.rows[process];
    let row = &rows[place];
    let recorded_ns = run.recorded_late_ns.get(process).and_then(|reported| reported.get(&row.cycle));
    let lateness_ns = row.woke_ns.saturating_sub(row.due_ns);
    let came_ns = recorded_ns.map(|late_ns| row.woke_ns.saturating_sub((*late_ns).max(lateness_ns)));
    // Between dumps of the flight recorder lie cycles that nobody missed.
    let before = place.checked_sub(1).map(|before| &rows[before]).filter(|_| run.whole);
    let Some(before) = before.filter(|before| row.cycle > before.cycle + 1) else {
        return (0, came_ns.unwrap_or(row.due_ns));
    };
    let Some(rig) = run.rows.get(EMULATOR) else { return (0, came_ns.unwrap_or(row.due_ns)) };
    let from = rig.partition_point(|sent| sent.cycle <= before.cycle);
    let sent_ns = rig[from..].iter().take_while(|sent| sent.cycle < row.cycle).filter_map(|sent| {
        [sent.drive.sensors_ns, sent.load.sensors_ns].into_iter().filter(|ns| *ns > 0).min()
    });
    let (missed, first_ns) = match came_ns {
        // Sent a moment before they came.
        Some(came_ns) => (sent_ns.filter(|ns| ns + CYCLE_NS / 2 >= came_ns).count() as u64, came_ns),
        None => {
            let sent_ns: Vec<_> = sent_ns.collect();
            let overtaken = lost == 0 && sent_ns.len() >= OVERTAKEN_CYCLES;
            if overtaken { (sent_ns.len() as u64, sent_ns[0]) } else { (0, row.due_ns) }
        }
    };
    (missed, first_ns.min(row.due_ns))
}

fn event(
    place_of_run: usize,
    process: &str,
    cluster: &[LateCycle],
    run: &RunFiles,
    all_late: &[(&str, Vec<LateCycle>)],
) -> Event {
    let rows = &run.rows[process];
    // A cluster is never empty.
    let worst = cluster.iter().max_by_key(|late| late.severity_ns()).copied().unwrap_or(cluster[0]);
    let row = rows[worst.place];
    let lateness = lateness_evidence(process, cluster, &worst, run, all_late);
    let reported = rules::cause(&lateness);
    let due_ns = worst.due_ns;
    Event {
        run: place_of_run,
        process: process.to_owned(),
        cycle: row.cycle - worst.missed.min(row.cycle),
        at_s: (row.cycle - worst.missed.min(row.cycle)) as f64 / 1000.0,
        late_ns: worst.late_ns,
        slow_ns: worst.slow_ns,
        skipped: cluster.iter().map(|late| late.missed).sum(),
        cause: reported.cause,
        sentence: reported.sentence,
        evidence: reported.evidence,
        nearby_cycles: nearby_cycles(row.cycle, worst.missed, due_ns, run),
        probe: gaps_around(due_ns, row.done_ns, run.gaps.as_deref().unwrap_or_default()),
        waited_ns: lateness.waited_ns,
        machine_ran: lateness.machine_ran(),
        ..Event::default()
    }
}

/// Everything that the rules may know of an event.
fn lateness_evidence(
    process: &str,
    cluster: &[LateCycle],
    worst: &LateCycle,
    run: &RunFiles,
    all_late: &[(&str, Vec<LateCycle>)],
) -> LatenessEvidence {
    let rows = &run.rows[process];
    let row = rows[worst.place];
    let (from_ns, to_ns) = (worst.due_ns, row.done_ns);
    let last = cluster.last().map_or(worst.place, |late| late.place);
    let until = rows[last].cycle + CONTINUED_WITHIN_CYCLES;
    let after = rows[cluster[0].place..].iter().take_while(|row| row.cycle <= until);
    let same_time =
        |late: &&LateCycle, rows: &[CycleTiming]| late.due_ns < to_ns && rows[late.place].done_ns > from_ns;
    let others = all_late.iter().filter(|(other, _)| *other != process).filter_map(|(other, late)| {
        let rows = run.rows[*other].as_slice();
        let worst = late.iter().filter(|late| same_time(late, rows)).max_by_key(|late| late.severity_ns())?;
        Some(((*other).to_owned(), worst.severity_ns(), rows[worst.place].vitals.run_delay_ns))
    });
    let covered = |want: &dyn Fn(&&Gap) -> bool| {
        let gaps = run.gaps.as_deref().unwrap_or_default().iter().filter(want);
        gaps.map(|gap| gap.within_ns(from_ns, to_ns)).max().unwrap_or_default()
    };
    let cpu = row.vitals.cpu;
    LatenessEvidence {
        process: process.to_owned(),
        late_ns: worst.late_ns,
        slow_ns: worst.slow_ns,
        missed: worst.missed,
        stages_ns: [row.receive_ns, row.step_ns, row.send_ns],
        vitals: row.vitals,
        continued: after.map(|row| row.vitals.continued).sum(),
        knows_run_delay: rows.iter().any(|row| row.vitals.run_delay_ns > 0),
        waited_ns: rows[cluster[0].place..=last].iter().map(|row| row.vitals.run_delay_ns).sum(),
        together_ns: cluster.iter().map(LateCycle::severity_ns).sum(),
        probe_watched: probe::watched(run.gaps.as_deref(), cpu, to_ns),
        still_ns: covered(&|gap| gap.cpu == cpu && !gap.another_ran),
        another_ns: covered(&|gap| gap.cpu == cpu && gap.another_ran),
        still_elsewhere_ns: covered(&|gap| gap.cpu != cpu && !gap.another_ran),
        others: others.collect(),
        ran_elsewhere: run.rows.iter().filter(|(other, _)| *other != process).any(|(_, rows)| {
            let first = rows.partition_point(|row| row.woke_ns < from_ns);
            let within = rows[first..].iter().take_while(|row| row.woke_ns < to_ns);
            let on_time = |row: &CycleTiming| row.woke_ns.saturating_sub(row.due_ns) <= EVENT_OVER_NS;
            within.into_iter().any(|row| row.vitals.cpu != cpu && on_time(row))
        }),
    }
}

fn nearby_cycles(cycle: u64, missed: u64, due_ns: u64, run: &RunFiles) -> BTreeMap<String, Vec<NearbyCycle>> {
    let (first, last) = (cycle.saturating_sub(missed + AROUND_CYCLES), cycle + AROUND_CYCLES);
    let us = |ns: u64| ns as f64 / 1000.0;
    let from_due_us = |ns: u64| (i128::from(ns) - i128::from(due_ns)) as f64 / 1000.0;
    let shown = |row: &CycleTiming| NearbyCycle {
        cycle: row.cycle,
        due_us: from_due_us(row.due_ns),
        late_us: us(row.woke_ns.saturating_sub(row.due_ns)),
        execution_us: us(execution_ns(row)),
        run_delay_us: us(row.vitals.run_delay_ns),
        faults: row.vitals.minor_faults + row.vitals.major_faults,
        involuntary_switches: row.vitals.involuntary_switches,
        cpu: row.vitals.cpu,
    };
    let of = |rows: &Vec<CycleTiming>| {
        let from = rows.partition_point(|row| row.cycle < first);
        rows[from..].iter().take_while(|row| row.cycle <= last).map(shown).collect::<Vec<_>>()
    };
    run.rows
        .iter()
        .map(|(process, rows)| (process.clone(), of(rows)))
        .filter(|(_, rows)| !rows.is_empty())
        .collect()
}

fn gaps_around(due_ns: u64, done_ns: u64, gaps: &[Gap]) -> Vec<ProbeGap> {
    let (from, to) = (due_ns.saturating_sub(GAPS_WITHIN_NS), done_ns + GAPS_WITHIN_NS);
    let mut near: Vec<_> = gaps.iter().filter(|gap| gap.within_ns(from, to) > 0).collect();
    near.sort_by_key(|gap| std::cmp::Reverse(gap.to_ns - gap.from_ns));
    near.truncate(GAPS_SHOWN);
    near.sort_by_key(|gap| gap.from_ns);
    let shown = |gap: &&Gap| ProbeGap {
        cpu: gap.cpu,
        from_us: (i128::from(gap.from_ns) - i128::from(due_ns)) as f64 / 1000.0,
        length_us: (gap.to_ns - gap.from_ns) as f64 / 1000.0,
        another_ran: gap.another_ran,
    };
    near.iter().map(shown).collect()
}

#[cfg(test)]
mod tests;
