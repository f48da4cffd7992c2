//! What was noted beside an event: the flight recorder's dump of it with its frames, and what the rig reported.

use crate::files::RunFiles;
use crate::model::Event;
use runlog::candump;
use runlog::event::EventKind;
use runlog::flight_dump;
use runlog::run_folder::BUS_LOG;
use runlog::summary::{RecordedEvent, Summary};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Cycles on each side of an event in which a dump of it may have its own cycle: neighbours are one event.
const DUMP_WITHIN_CYCLES: u64 = 5;
/// Cycles, of 1 ms, on each side of an event from which the rig's own events are reported.
const RIG_WITHIN_CYCLES: u64 = 10;

/// Adds to an event of this run what lies beside it in the run's folder and summary.
pub(crate) fn add(event: &mut Event, run: &RunFiles) {
    let last = event.cycle + event.skipped;
    if let Some(dump) = dump(&run.folder, &event.process, event.cycle, last) {
        event.frames = frames(&run.folder.join(&dump).join(BUS_LOG));
        event.dump = Some(dump);
    }
    event.rig_events =
        run.counted().map(|summary| rig_events(summary, event.cycle, last)).unwrap_or_default();
}

/// The folder of the dump of these cycles, within the run's.
fn dump(folder: &Path, process: &str, first: u64, last: u64) -> Option<String> {
    let within = first.saturating_sub(DUMP_WITHIN_CYCLES)..=last + DUMP_WITHIN_CYCLES;
    let dumps = flight_dump::list(folder).unwrap_or_default().into_iter();
    let near = dumps.filter(|(_, name)| name.process == process && within.contains(&name.cycle));
    let nearest = near.min_by_key(|(_, name)| name.cycle.abs_diff(last));
    nearest.map(|(dump, _)| format!("{}/{dump}", flight_dump::FOLDER))
}

/// Frames of a log of candump by identifier; nothing without one. A line that is no classic frame is left out.
fn frames(log: &Path) -> BTreeMap<String, u64> {
    let text = std::fs::read_to_string(log).unwrap_or_default();
    let mut counts = BTreeMap::new();
    for line in text.lines().filter_map(|line| candump::parse_line(line).ok()) {
        *counts.entry(line.identifier.to_owned()).or_default() += 1;
    }
    counts
}

/// What the rig noted near these cycles, but for the missed cycles themselves.
fn rig_events(summary: &Summary, first: u64, last: u64) -> Vec<String> {
    let near = first.saturating_sub(RIG_WITHIN_CYCLES)..=last + RIG_WITHIN_CYCLES;
    let mut reported: Vec<_> = summary.events.iter().filter_map(|event| in_words(event, &near)).collect();
    if summary.event_count.is_some_and(|count| count > summary.events.len() as u64) {
        reported.push("Of what came often the rig noted the first only.".to_owned());
    }
    reported
}

fn in_words(event: &RecordedEvent, near: &std::ops::RangeInclusive<u64>) -> Option<String> {
    let cycle = Some(event.cycle).filter(|cycle| near.contains(cycle))?;
    if matches!(event.known_kind(), Some(EventKind::Skipped { .. })) {
        return None;
    }
    // Kinds of other versions are shown too: name and details as they stand in the file.
    let (name, details) = match &event.kind {
        Value::String(name) => (name.as_str(), String::new()),
        Value::Object(kind) => {
            kind.iter().next().map(|(name, details)| (name.as_str(), details.to_string()))?
        }
        _ => return None,
    };
    Some(format!("Cycle {cycle}: {name} {details}").trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{explain, made_up};
    use runlog::Axis;
    use serde_json::json;

    #[test]
    fn the_dump_its_frames_and_the_rigs_own_events_stand_beside_an_event() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = made_up::stalled(500, "emulator", 100, 3_700_000);
        run.folder = folder.path().into();
        let event = |cycle, kind: EventKind| json!(runlog::event::Event { cycle, kind });
        made_up::edit_summary(&mut run, |summary| {
            summary["event_count"] = json!(5);
            summary["events"] = json!([
                event(20, EventKind::EmergencyStop),
                event(99, EventKind::Skipped { cycles: 3 }),
                event(103, EventKind::CommandStale(Axis::Drive)),
                { "cycle": 104, "kind": { "of-another-version": { "axis": "drive" } } },
                event(112, EventKind::BusLost),
            ]);
        });
        for name in ["emulator-0000000103-overrun", "controller-0000000103-late", "emulator-0000000300-late"]
        {
            let dump = folder.path().join("flight").join(name);
            std::fs::create_dir_all(&dump).unwrap();
            let log = "(1.000000) bus0 120#3E3E\n(1.000100) bus0 110#FF\n(1.001000) bus0 120#3F3E\n";
            std::fs::write(dump.join("bus.log"), log).unwrap();
        }
        let mut event = explain::events(0, &run).remove(0);
        add(&mut event, &run);
        assert_eq!(event.dump.as_deref(), Some("flight/emulator-0000000103-overrun"));
        assert_eq!(event.frames, BTreeMap::from([("110".to_owned(), 1), ("120".to_owned(), 2)]));
        let reported = [
            "Cycle 103: command-stale \"drive\"",
            "Cycle 104: of-another-version {\"axis\":\"drive\"}",
            "Cycle 112: bus-lost",
        ];
        assert_eq!(event.rig_events, reported);
    }

    #[test]
    fn without_a_dump_nothing_is_named() {
        let run = made_up::stalled(500, "emulator", 100, 3_700_000);
        let mut event = explain::events(0, &run).remove(0);
        add(&mut event, &run);
        assert_eq!((event.dump, event.frames.len(), event.rig_events.len()), (None, 0, 0));
    }
}
