//! Reads a log of the bus (`candump -L`) by `rig.dbc`: a row for each cycle, with the command that acts over it.
//!
//! ```text
//!   frames ──► cycles.rs: of which cycle ──► acting.rs: which command acts ──► rows
//! ```
//!
//! Sensors missing in the log are absent in their row, as are those of skipped cycles. The valve of such a row is known where the
//! contract defines the acting command. A log cannot show that the kernel stamped a frame and delivered it late to the rig's
//! socket on an overloaded machine.
//!
//! Source: bus.md, Time and Frames.

use super::acting::ValveCommands;
use super::cycles::{self, Cycles, LoggedFrame};
use super::{Channel, Form, LoggedBy, ReadError, Record, RigSetup, Signal};
use plant::{Axis, PERIOD_S};
use protocol::frames::{DecodeError, Frame, RigStatus, Sensors};
use protocol::periods::CYCLE_NS;
use runlog::candump;
use runlog::run_folder::SUMMARY_JSON;
use runlog::summary::JoinedSummary;
use std::collections::BTreeMap;
use std::path::Path;

/// Cycles over which the begin of cycles is estimated from stamps.
const BLOCK_CYCLES: u64 = 1000;
/// Commands that arrive so shortly before an estimated begin may have come after the true one: the rig samples meanwhile.
const MARGIN_NS: u64 = 100_000;
/// A longer hole is no hole in a record but two records; and a wrong stamp would make rows out of years.
const LONGEST_HOLE_S: u64 = 10;

pub(super) fn read(file: &Path, logged_by: LoggedBy) -> Result<Record, ReadError> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| ReadError::Open { file: file.into(), reason: error.to_string() })?;
    let mut record = Record::new(file, Form::BusLog, RigSetup::default());
    record.nominal_period_s = Some(PERIOD_S);
    let log = frames(file, &text, &mut record)?;
    let cycles = cycles::find(file, &log)?;
    let Some(first) = cycles.of.iter().flatten().min().copied() else {
        return Err(ReadError::NoSensors { file: file.into(), frames: log.len() });
    };
    expect_no_long_hole(file, &log, &cycles)?;
    if cycles.guessed {
        record.warn(None, "no tick in the log: the time of the first row is a guess within 16 ms");
    }
    let starts = CycleStarts::of(file, &log, &cycles, logged_by);
    rows(file, &log, &cycles, first, &starts, logged_by, &mut record)?;
    Ok(record)
}

/// The frames that `rig.dbc` knows; the others are counted.
fn frames(file: &Path, text: &str, record: &mut Record) -> Result<Vec<LoggedFrame>, ReadError> {
    let mut log = Vec::new();
    let (mut unknown, mut malformed) = (Vec::new(), Vec::new());
    let cut = text.rfind('\n').map_or(0, |end| end + 1);
    let whole = if candump::read_line(&text[cut..]).is_some() { text } else { &text[..cut] };
    for (line, text) in (1..).zip(whole.lines()).filter(|(_, text)| !text.trim().is_empty()) {
        let Some(read) = candump::read_line(text) else {
            let text: String = text.chars().take(80).collect();
            let message = "is no line of candump -L, such as (1700000000.123456) can0 120#0011AABB";
            return Err(ReadError::at(file, line, format!("'{text}' {message}")));
        };
        match Frame::decode(&read.frame) {
            Ok(frame) => log.push(LoggedFrame { line, stamp_ns: read.stamp_ns, frame }),
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => {
                unknown.push(line)
            }
            Err(_) => malformed.push(line),
        }
    }
    record.warn_cut((whole.len() < text.len()).then(|| whole.lines().count() as u64 + 1));
    for (lines, what) in [(unknown, "that rig.dbc does not know"), (malformed, "that rig.dbc does not allow")]
    {
        if let Some(first) = lines.first() {
            record.warn(*first, format!("{} frames {what} are left out", lines.len()));
        }
    }
    Ok(log)
}

/// Start times of cycles, by the clock of the log.
enum CycleStarts {
    /// From the run's summary: start of cycle 0.
    Reported { zero_ns: u64 },
    /// From the earliest sensor frames, by blocks of cycles.
    Estimated { blocks: BTreeMap<u64, u64> },
}

impl CycleStarts {
    fn of(file: &Path, log: &[LoggedFrame], cycles: &Cycles, logged_by: LoggedBy) -> Self {
        let reported = (logged_by == LoggedBy::Rig).then(|| reported_zero_ns(file)).flatten();
        let mut blocks: BTreeMap<u64, u64> = BTreeMap::new();
        for (logged, cycle) in log.iter().zip(&cycles.of) {
            let Some(cycle) = cycle else { continue };
            let zero_ns = logged.stamp_ns.saturating_sub(cycle * CYCLE_NS);
            let block = blocks.entry(cycle / BLOCK_CYCLES).or_insert(zero_ns);
            *block = zero_ns.min(*block);
        }
        // A summary of another run would put the sensors before their cycle, or far behind it.
        let fits = |zero_ns: &u64| {
            blocks.values().all(|block| *block + 1000 >= *zero_ns && block - zero_ns.min(block) < CYCLE_NS)
        };
        reported.filter(fits).map_or(Self::Estimated { blocks }, |zero_ns| Self::Reported { zero_ns })
    }

    fn start_ns(&self, cycle: u64) -> u64 {
        let zero_ns = match self {
            Self::Reported { zero_ns } => *zero_ns,
            Self::Estimated { blocks } => {
                let block = cycle / BLOCK_CYCLES;
                let near =
                    blocks.range(block.saturating_sub(1)..=block + 1).map(|(_, zero_ns)| *zero_ns).min();
                // A block without sensors takes the last one that has them.
                near.or_else(|| blocks.range(..block).next_back().map(|(_, zero_ns)| *zero_ns)).unwrap_or(0)
            }
        };
        zero_ns + cycle * CYCLE_NS
    }
}

/// Start of cycle 0, from `summary.json` beside a run's `bus.log`.
fn reported_zero_ns(file: &Path) -> Option<u64> {
    let summary = JoinedSummary::read(&file.parent()?.join(SUMMARY_JSON)).ok()?;
    Some((summary.bus_log_cycle_zero_s? * 1e9).round() as u64)
}

fn expect_no_long_hole(file: &Path, log: &[LoggedFrame], cycles: &Cycles) -> Result<(), ReadError> {
    let lines: BTreeMap<u64, u64> =
        log.iter().zip(&cycles.of).filter_map(|(logged, cycle)| Some(((*cycle)?, logged.line))).collect();
    for ((before, _), (after, line)) in lines.iter().zip(lines.iter().skip(1)) {
        let hole_s = (after - before) as f64 * PERIOD_S;
        if hole_s > LONGEST_HOLE_S as f64 {
            let message = format!("{hole_s:.0} s without a frame of sensors before this line");
            let advice = format!("{LONGEST_HOLE_S} s at most: split the log there");
            return Err(ReadError::at(file, *line, format!("{message}, {advice}")));
        }
    }
    Ok(())
}

fn rows(
    file: &Path,
    log: &[LoggedFrame],
    cycles: &Cycles,
    first: u64,
    starts: &CycleStarts,
    logged_by: LoggedBy,
    record: &mut Record,
) -> Result<(), ReadError> {
    let mut sent: BTreeMap<u64, Row> = BTreeMap::new();
    let mut statuses = StatusSummary::default();
    let mut newest = first;
    for (logged, cycle) in log.iter().zip(&cycles.of) {
        match (logged.frame, cycle) {
            (Frame::DriveSensors(sensors) | Frame::LoadSensors(sensors), Some(cycle)) => {
                newest = newest.max(*cycle);
                let axis = usize::from(matches!(logged.frame, Frame::LoadSensors(_)));
                sent.entry(*cycle).or_default().add_sensors(file, axis, sensors, logged.line, *cycle)?;
            }
            (Frame::RigStatus(status), _) => {
                sent.entry(newest).or_default().supply_pressure_pa = Some(status.supply_pressure_pa);
                statuses.take(logged.line, &status, record);
            }
            (Frame::Weights(weights), _) => {
                if newest > first {
                    record
                        .warn(logged.line, "weights were put on or taken off within the log: split it there");
                }
                record.setup.added_mass_kg = weights.added_mass_kg;
            }
            _ => {}
        }
    }
    let last = *sent.keys().next_back().unwrap_or(&first);
    let axes = Axis::ALL.map(|axis| sent.values().any(|row| row.sensors[axis.index()].is_some()));
    for axis in Axis::ALL.into_iter().filter(|axis| axes[axis.index()]) {
        Signal::ALL
            .map(|signal| Channel::Of(axis, signal))
            .into_iter()
            .filter(|channel| !channel.foreign_only())
            .for_each(|channel| record.add(channel));
    }
    record.add(Channel::SupplyPressure);
    let mut acting = ValveCommands::new(first, logged_by);
    let mut frames = log.iter().zip(&cycles.of).peekable();
    let mut line = log.first().map_or(1, |logged| logged.line);
    let mut lost = [0_u64; 2];
    for cycle in first..=last {
        let row = sent.remove(&cycle).unwrap_or_default();
        line = row.line.unwrap_or(line);
        // Everything up to the sensors of this cycle, and what arrived before it began.
        let start_ns = starts.start_ns(cycle);
        while let Some((logged, _)) =
            frames.next_if(|(logged, of)| of.map_or(logged.stamp_ns < start_ns + CYCLE_NS, |of| of <= cycle))
        {
            acting.note(*logged);
        }
        let skipped = cycles.skipped.contains(&cycle) && row.line.is_none();
        let valves = if skipped { acting.skip(cycle) } else { acting.latch(cycle, start_ns) };
        record.push_row(line, cycle as f64 * PERIOD_S);
        for axis in Axis::ALL.into_iter().filter(|axis| axes[axis.index()]) {
            lost[axis.index()] += u64::from(!skipped && row.sensors[axis.index()].is_none());
            put_row(record, axis, valves[axis.index()], row.sensors[axis.index()].as_ref());
        }
        if let Some(pressure_pa) = row.supply_pressure_pa {
            record.put(Channel::SupplyPressure, pressure_pa);
        }
    }
    add_warnings(record, log, starts, cycles, lost, &acting);
    Ok(())
}

#[derive(Default)]
struct Row {
    line: Option<u64>,
    sensors: [Option<Sensors>; 2],
    supply_pressure_pa: Option<f64>,
}

impl Row {
    fn add_sensors(
        &mut self,
        file: &Path,
        axis: usize,
        sensors: Sensors,
        line: u64,
        cycle: u64,
    ) -> Result<(), ReadError> {
        self.line.get_or_insert(line);
        match self.sensors[axis].replace(sensors) {
            Some(before) if before != sensors => {
                let message = format!("other sensors of cycle {cycle} than before: two rigs on one bus?");
                Err(ReadError::at(file, line, message + " Record each alone"))
            }
            _ => Ok(()),
        }
    }
}

fn put_row(record: &mut Record, axis: Axis, valve: Option<f64>, sensors: Option<&Sensors>) {
    if let Some(opening) = valve {
        record.put(Channel::Of(axis, Signal::Valve), opening);
    }
    let Some(sensors) = sensors else { return };
    for (signal, value) in [
        (Signal::Position, sensors.position_m),
        (Signal::Force, sensors.force_n),
        (Signal::PressureA, sensors.pressure_a_pa),
        (Signal::PressureB, sensors.pressure_b_pa),
    ] {
        record.put(Channel::Of(axis, signal), value);
    }
}

/// Status of the rig as far as a reader must report it.
#[derive(Default)]
struct StatusSummary {
    linked: Option<bool>,
    saturated: bool,
}

impl StatusSummary {
    fn take(&mut self, line: u64, status: &RigStatus, record: &mut Record) {
        match self.linked.replace(status.linked) {
            None => record.setup.linked = status.linked,
            Some(before) if before != status.linked => {
                record.warn(line, "the rods were linked or parted within the log: split it there");
            }
            Some(_) => {}
        }
        let flags = [
            status.drive_position_saturated,
            status.drive_force_saturated,
            status.drive_pressure_a_saturated,
            status.drive_pressure_b_saturated,
            status.load_position_saturated,
            status.load_force_saturated,
            status.load_pressure_a_saturated,
            status.load_pressure_b_saturated,
        ];
        if flags.contains(&true) && !std::mem::replace(&mut self.saturated, true) {
            record.warn(line, "the rig says here for the first time that a sensor saturated");
        }
    }
}

fn add_warnings(
    record: &mut Record,
    log: &[LoggedFrame],
    starts: &CycleStarts,
    cycles: &Cycles,
    lost: [u64; 2],
    acting: &ValveCommands,
) {
    for axis in Axis::ALL.into_iter().filter(|axis| record.has_axis(*axis)).collect::<Vec<_>>() {
        let name = axis.name();
        let (commands, disputes) = acting.counted()[axis.index()];
        if lost[axis.index()] > 0 {
            record.warn(None, format!("{} frames of {name} sensors are not in the log", lost[axis.index()]));
        }
        if commands > 0 {
            record.warn(None, format!("{commands} {name} commands are not in the log, by their counters"));
        }
        if disputes > 0 {
            record.warn(None, format!("two senders of {name} commands: its valve was shut meanwhile"));
        }
    }
    if !cycles.skipped.is_empty() {
        record.warn(None, format!("the rig skipped {} cycles: they have no sensors", cycles.skipped.len()));
    }
    if matches!(starts, CycleStarts::Estimated { .. }) {
        let close = log.iter().filter(|logged| {
            let command = matches!(logged.frame, Frame::DriveValveCommand(_) | Frame::LoadValveCommand(_));
            let zero_ns = starts.start_ns(0);
            let into_cycle = logged.stamp_ns.saturating_sub(zero_ns) % CYCLE_NS;
            command && into_cycle >= CYCLE_NS - MARGIN_NS
        });
        let close = close.count();
        if close > 0 {
            let text =
                "commands came within 0.1 ms before a cycle whose begin is estimated: they may act one later";
            record.warn(None, format!("{close} {text}"));
        }
    }
}
