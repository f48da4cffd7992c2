//! What disturbed the runs as a whole: from the events and from what all processes counted.
//!
//! What somebody did comes first, in the order of [`Cause`]: a stopped process, another thread on the CPU, pages, a listener that
//! does not read, a wire that loses, a stepped clock. What machines do by themselves comes last. A counter is a witness that
//! needs no interpretation, so counters speak even where no late cycle followed.

use super::explain::rules::in_words;
use super::files::RunFiles;
use super::model::{Cause, Event, Finding};
use serde_json::Value;

/// Page faults of a process after its first second that are a storm; memory that is locked gives none.
const STORM_FAULTS: u64 = 1000;
/// Share of cycles with faults that is one.
const STORM_SHARE: f64 = 0.05;
/// Contention is a finding from one event of the first length on, or from so many of the second. Less is what interrupts and
/// kernel threads do now and then, and what a virtual CPU that its host takes away between two threads looks like: it stays
/// with its events. A guess, held against ten undisturbed runs by `scripts/disturb`.
const CONTENTION_LATE_NS: u64 = 4_000_000;
const CONTENTION_EVENTS: usize = 10;
const CONTENTION_OFTEN_NS: u64 = 1_000_000;

/// All findings, the most telling first.
#[must_use]
pub fn find(runs: &[RunFiles], events: &[Event]) -> Vec<Finding> {
    let mut found: Vec<_> = [
        stopped(runs, events, Cause::EmulatorStopped),
        stopped(runs, events, Cause::ControllerStopped),
        contention(events),
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
    found.sort_by_key(|finding| finding.cause);
    found
}

fn of(events: &[Event], cause: Cause) -> impl Iterator<Item = &Event> {
    events.iter().filter(move |event| event.cause == cause)
}

/// The worst lateness or slowness of events, in words.
fn worst<'a>(events: impl Iterator<Item = &'a Event>) -> String {
    in_words(events.map(|event| event.late_ns.max(event.slow_ns)).max().unwrap_or_default())
}

/// A count under a key of each process's report, summed.
fn total<'a>(values: impl Iterator<Item = &'a Value>) -> u64 {
    values.filter_map(Value::as_u64).sum()
}

fn stopped(runs: &[RunFiles], events: &[Event], cause: Cause) -> Option<Finding> {
    let is_rig = cause == Cause::EmulatorStopped;
    let reports = runs.iter().flat_map(RunFiles::reports);
    let of_process = reports.filter(|(process, _)| (*process == "emulator") == is_rig);
    let counted = total(of_process.map(|(_, told)| &told["vitals"]["continued"]));
    let seen = of(events, cause).count() as u64;
    let count = counted.max(seen);
    let who = if is_rig { "The emulator" } else { "A controller" };
    let effect =
        if seen > 0 { format!(", at worst for {}", worst(of(events, cause))) } else { String::new() };
    (count > 0).then(|| Finding {
        cause,
        count,
        sentence: format!("{who} was stopped and continued by a signal {count} time(s){effect}."),
    })
}

fn contention(events: &[Event]) -> Option<Finding> {
    let cause = Cause::CpuContention;
    let count = of(events, cause).count() as u64;
    let at_least = |ns: u64| of(events, cause).filter(|event| event.late_ns.max(event.slow_ns) >= ns).count();
    let found = at_least(CONTENTION_LATE_NS) > 0 || at_least(CONTENTION_OFTEN_NS) >= CONTENTION_EVENTS;
    found.then(|| {
        let mut who: Vec<_> = of(events, cause).map(|event| event.process.as_str()).collect();
        who.sort_unstable();
        who.dedup();
        let sentence = format!(
            "{count} time(s) other threads of the same or a higher priority, or interrupts, kept {} from the CPU, at worst \
             for {}.",
            who.join(" and "),
            worst(of(events, cause))
        );
        Finding { cause, count, sentence }
    })
}

fn page_faults(runs: &[RunFiles], events: &[Event]) -> Option<Finding> {
    let cause = Cause::PageFaults;
    let mut faults = 0;
    let mut storms = Vec::new();
    for (process, told) in runs.iter().flat_map(RunFiles::reports) {
        let vitals = &told["vitals"];
        let of_process = total([&vitals["minor_faults"], &vitals["major_faults"]].into_iter());
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
        Finding { cause, count: faults.max(late), sentence }
    })
}

fn slow_listener(runs: &[RunFiles]) -> Option<Finding> {
    let mut count = 0;
    let mut who = Vec::new();
    for run in runs {
        for peer in run.summary["bus_host"]["peers"].as_array().into_iter().flatten() {
            let dropped = sum_of(&peer["dropped_at_queue"]);
            if dropped > 0 {
                count += dropped;
                let listens = peer["frames_received"].as_u64() == Some(0);
                let name = peer["name"].as_str().unwrap_or("a peer");
                who.push(format!(
                    "{name} ({})",
                    if listens { "a listener, which sends nothing" } else { "a sender too" }
                ));
            }
        }
        for (process, told) in run.reports() {
            let dropped = told["bus"]["dropped_on_receive"].as_u64().unwrap_or_default();
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
    })
}

/// The sum of counts by name.
fn sum_of(counts: &Value) -> u64 {
    total(counts.as_object().into_iter().flat_map(|counts| counts.values()))
}

/// Frames that never came, by gaps in the counters at rig and controllers.
#[must_use]
pub fn lost_by_gaps(run: &RunFiles) -> u64 {
    let at_rig = run.summary["frames_lost_at_rig"].as_u64();
    let by_axis = || total(["drive_commands", "load_commands"].iter().map(|key| &run.summary[key]["lost"]));
    let axes = run.controllers.values().flat_map(|told| told["axes"].as_object().into_iter().flatten());
    let at_controllers = axes.map(|(_, axis)| match &axis["sensors_lost"] {
        Value::Object(_) => sum_of(&axis["sensors_lost"]),
        count => count.as_u64().unwrap_or_default(),
    });
    at_rig.unwrap_or_else(by_axis) + at_controllers.sum::<u64>()
}

fn frame_loss(runs: &[RunFiles]) -> Option<Finding> {
    let (mut lost, mut at_queues, mut on_wire) = (0, 0, 0);
    for run in runs {
        lost += lost_by_gaps(run);
        let host = &run.summary["bus_host"];
        on_wire += sum_of(&host["injected_loss"]);
        // A listener's queue says nothing of what rig and controllers missed.
        let peers = host["peers"].as_array().into_iter().flatten();
        let ours = peers.filter(|peer| peer["frames_received"].as_u64().is_some_and(|sent| sent > 0));
        at_queues += ours.map(|peer| sum_of(&peer["dropped_at_queue"])).sum::<u64>();
        at_queues += total(run.reports().map(|(_, told)| &told["bus"]["dropped_on_receive"]));
        at_queues += total(run.reports().map(|(_, told)| &told["bus"]["dropped_on_send"]));
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
        }
    })
}

fn clock_step(runs: &[RunFiles]) -> Option<Finding> {
    let reports = runs.iter().flat_map(RunFiles::reports);
    let steps: Vec<f64> = reports
        .flat_map(|(_, told)| told["wall_clock_steps"].as_array().into_iter().flatten())
        .filter_map(|step| step["step_s"].as_f64())
        .collect();
    let largest = steps.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    Some(Finding {
        cause: Cause::ClockStep,
        count: steps.len() as u64,
        sentence: format!(
            "The wall clock was stepped, by {largest:+.3} s at most ({} sighting(s)); the cycles run on the monotonic clock and \
             were not touched by it.",
            steps.len()
        ),
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
    (count > 0).then_some(Finding { cause, count, sentence })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{explain, made_up};
    use serde_json::json;

    fn found(run: RunFiles) -> Vec<Cause> {
        let events = explain::events(0, &run);
        find(&[run], &events).iter().map(|finding| finding.cause).collect()
    }

    #[test]
    fn nothing_is_found_in_an_undisturbed_run() {
        assert_eq!(found(made_up::run(3000)), []);
    }

    #[test]
    fn counters_speak_without_any_late_cycle() {
        let cases: [(&str, Value, Cause); 6] = [
            ("/summary/vitals", json!({ "continued": 1 }), Cause::EmulatorStopped),
            ("/summary/vitals", json!({ "minor_faults": 5000, "major_faults": 0 }), Cause::PageFaults),
            ("/summary/bus_host/injected_loss", json!({ "110": 30, "120": 25 }), Cause::FrameLoss),
            ("/summary/frames_lost_at_rig", json!(7), Cause::FrameLoss),
            ("/summary/bus/dropped_on_receive", json!(3), Cause::SlowListener),
            ("/summary/wall_clock_steps", json!([{ "at_s": 1.0, "step_s": -3600.0 }]), Cause::ClockStep),
        ];
        for (path, value, cause) in cases {
            let mut run = made_up::run(100);
            let (parent, key) = path.trim_start_matches("/summary").rsplit_once('/').unwrap();
            run.summary.pointer_mut(parent).unwrap()[key] = value;
            assert_eq!(found(run), [cause], "{path}");
        }
        let mut run = made_up::run(100);
        run.controllers.get_mut("controller").unwrap()["vitals"] = json!({ "continued": 2 });
        assert_eq!(found(run), [Cause::ControllerStopped]);
    }

    #[test]
    fn a_listener_that_does_not_read_costs_nobody_else_a_frame() {
        let mut run = made_up::run(100);
        let peers = run.summary.pointer_mut("/bus_host/peers").unwrap().as_array_mut().unwrap();
        peers.push(json!({ "name": "process 3", "frames_received": 0, "dropped_at_queue": { "120": 40 } }));
        assert_eq!(found(run), [Cause::SlowListener]);
    }

    #[test]
    fn what_a_queue_of_ours_dropped_is_not_lost_on_the_wire() {
        let mut run = made_up::run(100);
        run.summary["bus_host"]["peers"][1]["dropped_at_queue"] = json!({ "110": 5 });
        run.summary["frames_lost_at_rig"] = json!(5);
        assert_eq!(found(run), [Cause::SlowListener]);
    }

    #[test]
    fn faults_in_many_cycles_are_a_storm_without_a_late_one() {
        let mut run = made_up::run(3000);
        let rows = run.rows.get_mut("controller").unwrap();
        rows.iter_mut().step_by(10).for_each(|row| row.vitals.minor_faults = 2);
        assert_eq!(found(run), [Cause::PageFaults]);
    }

    #[test]
    fn a_little_contention_stays_with_its_event_and_much_is_a_finding() {
        let mut run = made_up::run(3000);
        made_up::stall(&mut run, "emulator", 100, 300_000).vitals.run_delay_ns = 290_000;
        assert_eq!(found(run.clone()), []);
        made_up::stall(&mut run, "emulator", 500, 4_300_000).vitals.run_delay_ns = 4_200_000;
        assert_eq!(found(run), [Cause::CpuContention]);
    }

    #[test]
    fn what_somebody_did_stands_before_what_machines_do() {
        let mut run = made_up::run(3000);
        made_up::stall(&mut run, "emulator", 100, 9_300_000);
        made_up::stall(&mut run, "emulator", 500, 5_300_000).vitals.continued = 1;
        assert_eq!(found(run), [Cause::EmulatorStopped, Cause::MachineStoodStill]);
    }
}
