//! A run as a trace in the JSON of Chrome's trace viewer, which Perfetto opens: cycles of each process, frames, faults.
//!
//! ```text
//!   emulator-timing.csv     ─► rig         cycle ├──────────────┤ woke ─ done       wake-up ├──┤ due ─ woke
//!   controller*-timing.csv  ─► controller        ├───┼────┼─────┤ its stages
//!   bus.log                 ─► bus         an instant for each frame, a row for each identifier
//!   faults.csv              ─► rig         an instant, drawn across all rows
//! ```
//! Time is in us since the first frame, or since cycle 0 if that was earlier. Timing rows use the monotonic clock, frames that
//! of the log: the due time of cycle 0 is known in both. The stages of a row have measured lengths; they are drawn one after
//! the other from the start of its slice, in the order of the process [`runlog::timing`]. A slice starts at the wake-up, or where
//! the slice before it ends.
//!
//! Source: "Trace Event Format", Google 2016: X is a slice, i an instant, M metadata.

use super::ExportError;
use super::controllers;
use super::run_table::RunTable;
use crate::recorded_log::RecordedLog;
use crate::warn;
use protocol::frames::MESSAGES;
use protocol::periods::CYCLE_NS;
use runlog::candump::FrameRecord;
use runlog::process::Process;
use runlog::run_folder::{FAULTS_CSV, FileError, read_text};
use runlog::timing::{self, CycleTiming};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Processes of the trace; controllers follow the rig.
const BUS: u32 = 1;
const RIG: u32 = 2;
/// Threads of a process with cycles.
const CYCLES: u32 = 1;
const WAKE_UPS: u32 = 2;
const FAULTS: u32 = 3;

/// Counters of what was written.
#[derive(Debug, Default)]
pub(super) struct WriteCounts {
    pub(super) frames: usize,
    pub(super) cycles: usize,
    pub(super) faults: usize,
}

#[derive(Serialize)]
struct Event<'a> {
    name: &'a str,
    ph: &'static str,
    pid: u32,
    tid: u32,
    /// Time, us.
    ts: f64,
    /// Length of a slice, us.
    #[serde(skip_serializing_if = "Option::is_none")]
    dur: Option<f64>,
    /// Scope of an instant: t its thread, p its process, g global.
    #[serde(skip_serializing_if = "Option::is_none")]
    s: Option<&'static str>,
    #[serde(skip_serializing_if = "Value::is_null")]
    args: Value,
}

/// The file and the origin of its time.
struct Trace {
    file: BufWriter<File>,
    /// Time 0, ns since the log's epoch.
    start_ns: u64,
    is_first: bool,
}

struct ProcessCycles {
    name: &'static str,
    pid: u32,
    /// Whether it sends before it receives and computes, as the rig does.
    sends_first: bool,
    rows: Vec<CycleTiming>,
}

/// Writes a trace to `part`: the frames of the log, and cycles and faults of `folder` if there is one.
///
/// # Errors
/// A table that cannot be read, or a failure to write `part`.
pub(super) fn write(
    part: &Path,
    log: &RecordedLog,
    folder: Option<&Path>,
) -> Result<WriteCounts, ExportError> {
    let processes = folder.map(processes).transpose()?.unwrap_or_default();
    let faults = folder.map(|folder| RunTable::open(&folder.join(FAULTS_CSV))).transpose()?.flatten();
    let stamps = log.frames.iter().map(|logged| logged.record.stamp_ns);
    let start_ns = stamps.chain(log.cycle_zero_ns).min().unwrap_or_default();
    let unwritten = |error: io::Error| FileError::write(part, error);
    let mut written = WriteCounts { frames: log.frames.len(), ..WriteCounts::default() };
    let zero_us = microseconds(i128::from(log.origin_ns()) - i128::from(start_ns));
    let about =
        json!({ "cycle_zero_us": log.cycle_zero_ns.map(|_| zero_us), "log": log.file.display().to_string() });
    let mut file = super::create(part).map_err(unwritten)?;
    write!(file, "{{\"displayTimeUnit\":\"ns\",\"otherData\":{about},\"traceEvents\":[")
        .map_err(unwritten)?;
    let mut trace = Trace { file, start_ns, is_first: true };
    trace.frames(log).map_err(unwritten)?;
    let rig = processes.iter().find(|process| process.pid == RIG);
    if let Some(first) = rig.and_then(|rig| rig.rows.first()) {
        let zero_ns = i128::from(first.due_ns) - i128::from(first.cycle) * i128::from(CYCLE_NS);
        let offset_ns = i128::from(log.origin_ns()) - zero_ns - i128::from(start_ns);
        for process in &processes {
            trace.cycles(process, offset_ns).map_err(unwritten)?;
            written.cycles += process.rows.len();
        }
    }
    if let Some(mut faults) = faults {
        trace.name("thread_name", RIG, FAULTS, "faults").map_err(unwritten)?;
        while let Some(ns) = faults.next_ns()? {
            let at_us = microseconds(i128::from(log.origin_ns() + ns) - i128::from(start_ns));
            trace.fault(&faults, at_us).map_err(unwritten)?;
            written.faults += 1;
        }
    }
    trace.file.write_all(b"\n]}\n").and_then(|()| trace.file.flush()).map_err(unwritten)?;
    Ok(written)
}

/// The processes with recorded cycles; controllers only beside the rig, whose record has the time of cycle 0.
fn processes(folder: &Path) -> Result<Vec<ProcessCycles>, FileError> {
    let mut processes = Vec::new();
    for process in Process::ALL {
        let path = folder.join(process.timing());
        let is_rig = process == Process::Emulator;
        let name = if is_rig { "rig" } else { process.name() };
        if !path.exists() || !is_rig && !controllers::has_process(folder, process) {
            continue;
        }
        let rows = timing::read(&read_text(&path)?).map_err(|error| FileError::read(&path, error))?;
        let pid = if is_rig { RIG } else { RIG + 1 + processes.len() as u32 };
        processes.push(ProcessCycles { name, pid, sends_first: is_rig, rows });
    }
    if processes.first().is_some_and(|process| process.pid != RIG) {
        let path = folder.join(Process::Emulator.timing());
        warn(&format!("{}: is missing, and with it the time of the controllers' cycles", path.display()));
        processes.clear();
    }
    Ok(processes)
}

impl Trace {
    fn add(&mut self, event: &impl Serialize) -> io::Result<()> {
        self.file.write_all(if self.is_first { b"\n" } else { b",\n" })?;
        self.is_first = false;
        serde_json::to_writer(&mut self.file, event).map_err(Into::into)
    }

    /// Names a process or a thread.
    fn name(&mut self, kind: &'static str, pid: u32, tid: u32, name: &str) -> io::Result<()> {
        self.add(&json!({ "name": kind, "ph": "M", "pid": pid, "tid": tid, "args": { "name": name } }))
    }

    /// An instant for each frame, in a thread for each identifier.
    fn frames(&mut self, log: &RecordedLog) -> io::Result<()> {
        self.name("process_name", BUS, 0, "bus")?;
        let mut threads = BTreeMap::new();
        for (logged, place) in log.frames.iter().zip(&log.seen_at) {
            let FrameRecord { stamp_ns, frame } = logged.record;
            let known = threads.len() as u32;
            let thread = threads.entry(frame.raw_id());
            let message = MESSAGES.iter().find(|spec| u32::from(spec.id) == frame.raw_id());
            let text = frame.to_string();
            let name = message.map_or_else(|| text.split('#').next().unwrap_or_default(), |spec| spec.name);
            let is_new = matches!(thread, std::collections::btree_map::Entry::Vacant(_));
            let tid = *thread.or_insert(known + 1);
            if is_new {
                self.name("thread_name", BUS, tid, name)?;
            }
            let interface = &log.interfaces[usize::from(*place)];
            self.add(&Event {
                name,
                ph: "i",
                pid: BUS,
                tid,
                ts: microseconds(i128::from(stamp_ns) - i128::from(self.start_ns)),
                dur: None,
                s: Some("t"),
                args: json!({ "frame": text, "interface": interface }),
            })?;
        }
        Ok(())
    }

    /// A slice for each cycle with its stages, and one for the wait before it; `offset_ns` converts the monotonic clock to the
    /// time of the trace.
    fn cycles(&mut self, process: &ProcessCycles, offset_ns: i128) -> io::Result<()> {
        let pid = process.pid;
        self.name("process_name", pid, 0, process.name)?;
        self.name("thread_name", pid, CYCLES, "cycles")?;
        self.name("thread_name", pid, WAKE_UPS, "wake-up: due to woke")?;
        let (mut previous_woke_ns, mut drawn_to_ns) = (i128::MIN, i128::MIN);
        for row in &process.rows {
            let [due_ns, woke_ns, done_ns] =
                [row.due_ns, row.woke_ns, row.done_ns].map(|ns| i128::from(ns) + offset_ns);
            let wake_up_us = microseconds(woke_ns - due_ns);
            // Slices of a thread must not overlap. A row that was due before the previous wake-up waits from there on; a row
            // that shares a wake-up with the previous row is drawn behind it.
            let waits_from_ns = due_ns.max(previous_woke_ns).min(woke_ns);
            previous_woke_ns = woke_ns;
            let args = json!({ "wake_up_us": wake_up_us });
            self.add(&slice("wake-up", (pid, WAKE_UPS), [waits_from_ns, woke_ns], args))?;
            let args = json!({
                "cycle": row.cycle, "skipped": row.skipped, "wake_up_us": wake_up_us, "cpu": row.vitals.cpu,
                "run_delay_us": microseconds(i128::from(row.vitals.run_delay_ns)),
            });
            let name = format!("cycle {}", row.cycle);
            let mut from_ns = woke_ns.max(drawn_to_ns);
            drawn_to_ns = from_ns + done_ns - woke_ns;
            self.add(&slice(&name, (pid, CYCLES), [from_ns, drawn_to_ns], args))?;
            let (receive, step, send) =
                (("receive", row.receive_ns), ("step", row.step_ns), ("send", row.send_ns));
            let stages = if process.sends_first { [send, receive, step] } else { [receive, step, send] };
            for (name, length_ns) in stages {
                let to_ns = from_ns + i128::from(length_ns);
                self.add(&slice(name, (pid, CYCLES), [from_ns, to_ns], Value::Null))?;
                from_ns = to_ns;
            }
        }
        Ok(())
    }

    fn fault(&mut self, table: &RunTable, at_us: f64) -> io::Result<()> {
        let row: BTreeMap<&str, &str> = table.names.iter().map(String::as_str).zip(table.cells()).collect();
        let of = |name| row.get(name).copied().unwrap_or_default();
        self.add(&Event {
            name: &format!("{} {}: {}", of("fault"), of("at"), of("what")),
            ph: "i",
            pid: RIG,
            tid: FAULTS,
            ts: at_us,
            dur: None,
            s: Some("g"),
            args: json!(row),
        })
    }
}

/// A slice of a process's thread, ns of the trace.
fn slice(name: &str, (pid, tid): (u32, u32), [from_ns, to_ns]: [i128; 2], args: Value) -> Event<'_> {
    let (ts, dur) = (microseconds(from_ns), Some(microseconds(to_ns - from_ns)));
    Event { name, ph: "X", pid, tid, ts, dur, s: None, args }
}

fn microseconds(ns: i128) -> f64 {
    ns as f64 / 1e3
}
