//! What the emulator reported of a run, read from `summary.json`, and what the valve did meanwhile.

use crate::records::{Table, count};
use serde_json::Value;
use std::ops::Range;

#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    pub cycle: usize,
    /// Its name, as `command-stale`.
    pub kind: String,
    /// What belongs to it: an axis, or null.
    pub of: Value,
}

pub fn all(summary: &Value) -> Vec<Event> {
    let events = summary["events"].as_array().expect("events");
    assert_eq!(count(summary, "/event_count"), events.len() as u64, "more events than the summary keeps");
    events.iter().map(read).collect()
}

fn read(event: &Value) -> Event {
    let cycle = count(event, "/cycle") as usize;
    match &event["kind"] {
        Value::String(kind) => Event { cycle, kind: kind.clone(), of: Value::Null },
        Value::Object(kind) => {
            let (kind, of) = kind.iter().next().expect("a kind");
            Event { cycle, kind: kind.clone(), of: of.clone() }
        }
        other => panic!("no event: {other}"),
    }
}

pub fn times(events: &[Event], kind: &str) -> usize {
    events.iter().filter(|event| event.kind == kind).count()
}

/// Rows from each event `from` of the drive to the next `to`, or to the last row.
pub fn spans(events: &[Event], from: &str, to: &str, rows: usize) -> Vec<Range<usize>> {
    let of_drive = |event: &&Event, kind: &str| event.kind == kind && event.of == "drive";
    let starts = events.iter().enumerate().filter(|(_, event)| of_drive(event, from));
    starts
        .map(|(index, start)| {
            let end = events[index..].iter().find(|event| of_drive(event, to));
            start.cycle..end.map_or(rows, |end| end.cycle)
        })
        .collect()
}

/// Holds that the drive's valve was shut from each event `from` to the next `to`, and that it moved before the first of
/// them and after the last.
#[track_caller]
pub fn expect_valve_shut_between(summary: &Value, measurement: &Table, from: &str, to: &str) {
    let valve = measurement.column("drive_valve");
    let spans = spans(&all(summary), from, to, valve.len());
    assert!(!spans.is_empty(), "no {from} was reported: {:#}", summary["events"]);
    for span in &spans {
        let open = span.clone().find(|row| valve[*row] != 0.0);
        assert_eq!(open, None, "the valve is open in a row of {span:?}, from {from} to {to}");
    }
    let moves = |rows: &[f64]| rows.iter().any(|opening| *opening != 0.0);
    assert!(moves(&valve[..spans[0].start]), "the valve never moved before {from}");
    assert!(moves(&valve[spans[spans.len() - 1].end..]), "the valve never moved after {to}");
}
