//! A run as MCAP: a channel for each table of the run's folder, for each message of the bus, and for the frames as they were.
//!
//! ```text
//!   measurement.csv ─► /measurement        truth.csv ─► /truth        controller-drive.csv ─► /controller/drive
//!   faults.csv      ─► /faults             bus.log   ─► /can (frames), /can/DriveSensors (signals) …
//! ```
//! Messages are JSON, described by JSON Schema: Foxglove and PlotJuggler plot every number of them. Their time is that of
//! `bus.log`: row k of a table is at cycle 0 plus its `time_s`. They are written in the order of time, without compression.
//!
//! Source: MCAP 1 [mcap.dev/spec], by the crate `mcap`; a test compares with the reader `mcap` of PyPI.

use super::ExportError;
use super::controllers;
use super::mdf4::comment;
use super::run_table::{RunTable, holds_words};
use super::signals::{MessageFrames, Signals};
use crate::recorded_log::RecordedLog;
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapResult, WriteOptions, Writer};
use protocol::can::{ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG};
use protocol::frames::SignalKind;
use runlog::Axis;
use runlog::run_folder::{FAULTS_CSV, FileError, MEASUREMENT_CSV, TRUTH_CSV, controller_csv};
use serde_json::{Map, Value, json};
use settings::unit_of;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Tables of a run's folder and their channels, those of a controller with its axis.
fn tables() -> [(String, String, Option<Axis>); 5] {
    let of_rig = |name: &str, topic: &str| (name.to_owned(), topic.to_owned(), None);
    let of_axis = |axis: Axis| (controller_csv(axis), format!("/controller/{}", axis.name()), Some(axis));
    [
        of_rig(MEASUREMENT_CSV, "/measurement"),
        of_rig(TRUTH_CSV, "/truth"),
        of_axis(Axis::Drive),
        of_axis(Axis::Load),
        of_rig(FAULTS_CSV, "/faults"),
    ]
}

/// Counters of what was written.
pub(super) struct WriteCounts {
    pub(super) channels: usize,
    pub(super) messages: u64,
}

/// Messages of a channel, in the order of their time.
struct Stream<'a> {
    channel: u16,
    sequence: u32,
    /// Time of the next message, ns since the log's epoch; `None` at the end.
    next_ns: Option<u64>,
    source: Source<'a>,
}

enum Source<'a> {
    Table {
        table: RunTable,
        /// Time of cycle 0, ns since the log's epoch.
        origin_ns: u64,
    },
    Signals {
        message: &'a MessageFrames,
        /// Index of the next frame.
        next: usize,
    },
    Frames {
        log: &'a RecordedLog,
        /// Index of the next frame.
        next: usize,
    },
}

/// Writes a run to `part`: its log, and the tables of `folder` if there is one.
///
/// # Errors
/// A table that cannot be read, or a failure to write `part`.
pub(super) fn write(
    part: &Path,
    log: &RecordedLog,
    signals: &Signals,
    folder: Option<&Path>,
) -> Result<WriteCounts, ExportError> {
    let unwritten = |error: mcap::McapError| FileError::write(part, error);
    let file = super::create(part).map_err(|error| FileError::write(part, error))?;
    let options = WriteOptions::new().library(concat!("airbench ", env!("CARGO_PKG_VERSION")));
    let mut file = options.create(file).map_err(unwritten)?;
    let origin = [("cycle_zero_ns".to_owned(), log.origin_ns().to_string())];
    if folder.is_some() {
        let metadata = Metadata { name: "airbench".into(), metadata: origin.into() };
        file.write_metadata(&metadata).map_err(unwritten)?;
    }
    let mut sources = Vec::new();
    for (name, topic, axis) in tables() {
        if let (Some(folder), Some(axis)) = (folder, axis)
            && !controllers::has_axis(folder, axis)?
        {
            continue;
        }
        if let Some(table) = folder.map(|folder| RunTable::open(&folder.join(name))).transpose()?.flatten() {
            sources.push((topic, Source::Table { table, origin_ns: log.origin_ns() }));
        }
    }
    for message in &signals.messages {
        sources.push((format!("/can/{}", message.spec.name), Source::Signals { message, next: 0 }));
    }
    sources.push(("/can".to_owned(), Source::Frames { log, next: 0 }));
    let mut streams = Vec::new();
    for (topic, mut source) in sources {
        let channel = channel(&mut file, &topic, &source).map_err(unwritten)?;
        streams.push(Stream { channel, sequence: 0, next_ns: source.next_ns()?, source });
    }
    let (mut data, mut messages) = (Vec::new(), 0);
    while let Some(stream) =
        streams.iter_mut().filter(|stream| stream.next_ns.is_some()).min_by_key(|stream| stream.next_ns)
        && let Some(time_ns) = stream.next_ns
    {
        data.clear();
        stream.source.write_json(&mut data)?;
        let (channel_id, sequence) = (stream.channel, stream.sequence);
        let head = MessageHeader { channel_id, sequence, log_time: time_ns, publish_time: time_ns };
        file.write_to_known_channel(&head, &data).map_err(unwritten)?;
        stream.sequence = stream.sequence.wrapping_add(1);
        stream.next_ns = stream.source.next_ns()?;
        messages += 1;
    }
    let _ = file.finish().map_err(unwritten)?;
    file.into_inner().flush().map_err(|error| FileError::write(part, error))?;
    Ok(WriteCounts { channels: streams.len(), messages })
}

fn channel(file: &mut Writer<BufWriter<File>>, topic: &str, source: &Source<'_>) -> McapResult<u16> {
    let (title, about) = match source {
        Source::Table { .. } => (topic.trim_start_matches('/').replace('/', "."), "A row of a run's table."),
        Source::Signals { message, .. } => (message.spec.name.to_owned(), message.spec.comment),
        Source::Frames { .. } => ("frame".to_owned(), "A frame of the bus as it was."),
    };
    let schema = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title, "description": about, "type": "object", "properties": source.properties(),
    });
    let schema =
        file.add_schema(&format!("airbench.{title}"), "jsonschema", schema.to_string().as_bytes())?;
    file.add_channel(schema, topic, "json", &BTreeMap::new())
}

/// JSON Schema of a key: type, meaning and unit, as far as they are known.
fn property(kind: &str, about: &str, unit: &str) -> Value {
    let mut property = json!({ "type": kind });
    if !about.is_empty() {
        property["description"] = about.into();
    }
    if !unit.is_empty() {
        property["unit"] = unit.into();
    }
    property
}

impl Source<'_> {
    /// The keys of a message with type, meaning and unit.
    fn properties(&self) -> Map<String, Value> {
        match self {
            Self::Table { table, .. } => {
                let of = |name: &String| {
                    let kind = if holds_words(name) { "string" } else { "number" };
                    (name.clone(), property(kind, "", unit_of(name).unwrap_or_default()))
                };
                table.names.iter().map(of).collect()
            }
            Self::Signals { message, .. } => {
                let signals = message.spec.signals.iter().map(|signal| {
                    let kind = if signal.kind == SignalKind::Physical { "number" } else { "integer" };
                    (signal.field.to_owned(), property(kind, &comment(signal), signal.unit))
                });
                signals.collect()
            }
            Self::Frames { .. } => [
                ("id".to_owned(), property("integer", "Identifier, without flags.", "")),
                ("interface".to_owned(), property("string", "Where it was seen.", "")),
                ("frame".to_owned(), property("string", "Identifier and data as candump writes them.", "")),
            ]
            .into_iter()
            .collect(),
        }
    }

    /// Time of the next message, ns since the log's epoch; reads the row of a table.
    fn next_ns(&mut self) -> Result<Option<u64>, FileError> {
        Ok(match self {
            Self::Table { table, origin_ns } => table.next_ns()?.map(|ns| *origin_ns + ns),
            Self::Signals { message, next } => message.frames.get(*next).map(|(stamp_ns, _)| *stamp_ns),
            Self::Frames { log, next } => log.frames.get(*next).map(|logged| logged.record.stamp_ns),
        })
    }

    /// Writes the next message and advances. An empty cell has no key.
    fn write_json(&mut self, out: &mut Vec<u8>) -> Result<(), FileError> {
        out.push(b'{');
        match self {
            Self::Table { table, .. } => {
                for (name, cell) in table.names.iter().zip(table.cells()).filter(|(_, cell)| !cell.is_empty())
                {
                    let value =
                        if holds_words(name) { Value::from(cell) } else { Value::from(table.number(cell)?) };
                    key(out, name, &value);
                }
            }
            Self::Signals { message, next } => {
                let (_, word) = message.frames[*next];
                for signal in message.spec.signals {
                    let raw = signal.raw(word);
                    let physical = signal.kind == SignalKind::Physical;
                    let value = if physical { Value::from(signal.physical(raw)) } else { Value::from(raw) };
                    key(out, signal.field, &value);
                }
                *next += 1;
            }
            Self::Frames { log, next } => {
                let frame = &log.frames[*next].record.frame;
                key(out, "id", &Value::from(frame.raw_id() & !(ERROR_FLAG | EXTENDED_FLAG | REMOTE_FLAG)));
                let interface = &log.interfaces[usize::from(log.seen_at[*next])];
                key(out, "interface", &Value::from(interface.as_str()));
                key(out, "frame", &Value::from(frame.to_string()));
                *next += 1;
            }
        }
        out.push(b'}');
        Ok(())
    }
}

/// Appends a key and its value to an open object.
fn key(out: &mut Vec<u8>, name: &str, value: &Value) {
    let comma = if out.last() == Some(&b'{') { "" } else { "," };
    // Writing to memory cannot fail.
    let _ = write!(out, "{comma}{}:{value}", Value::from(name));
}
