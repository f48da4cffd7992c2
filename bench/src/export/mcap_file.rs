//! MCAP 1, written: chunks without compression, and the index by which a reader goes to a time.
//!
//! ```text
//!   magic Header Metadata… Schema… Channel…  { Chunk (Message…) MessageIndex… }…  DataEnd
//!   summary: Schema… Channel… Statistics ChunkIndex… MetadataIndex… SummaryOffset… Footer magic
//! ```
//! A record is an opcode, the length of its fields in 8 bytes, and its fields, little-endian; a text and a map are preceded by
//! the number of their bytes in 4. The crate `mcap` writes the same; with it come 13 crates that nothing else needs, two of them
//! large macros on a second `syn`.
//!
//! Source: [mcap.dev/spec], records by their opcodes.

use crc::{CRC_32_ISO_HDLC, Crc};
use std::io::{self, Write};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0B;
const METADATA: u8 = 0x0C;
const METADATA_INDEX: u8 = 0x0D;
const SUMMARY_OFFSET: u8 = 0x0E;
const DATA_END: u8 = 0x0F;

/// A chunk is closed by the message that makes it so large.
const CHUNK_BYTES: usize = 768 * 1024;
/// "Not available", says the specification; each chunk has a checksum of its own.
const NO_CRC: u32 = 0;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A message whose data follow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) time_ns: u64,
}

/// Messages that are not written yet, and where each is.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    /// Times of the first and the last message.
    span_ns: Option<(u64, u64)>,
    /// By channel: time and place in `records` of each message.
    messages: Vec<Vec<(u64, u64)>>,
}

/// A file that is being written. Messages come in the order of their time.
pub(super) struct McapFile<W> {
    out: W,
    /// Bytes written.
    place: u64,
    chunk: Chunk,
    span_ns: Option<(u64, u64)>,
    /// By channel; each has a schema.
    message_counts: Vec<u64>,
    chunk_count: u32,
    metadata_count: u32,
    /// Records of the summary.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    chunk_index: Vec<u8>,
    metadata_index: Vec<u8>,
}

impl<W: Write> McapFile<W> {
    /// Begins a file; `library` names who writes it.
    ///
    /// # Errors
    /// What the system says, as of all that follow.
    pub(super) fn create(out: W, library: &str) -> io::Result<Self> {
        let mut file = Self {
            out,
            place: 0,
            chunk: Chunk::default(),
            span_ns: None,
            message_counts: Vec::new(),
            chunk_count: 0,
            metadata_count: 0,
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk_index: Vec::new(),
            metadata_index: Vec::new(),
        };
        file.put(MAGIC)?;
        file.put(&record(HEADER, |fields| {
            text(fields, "");
            text(fields, library);
        }))?;
        Ok(file)
    }

    pub(super) fn write_metadata(&mut self, name: &str, entries: &[(&str, &str)]) -> io::Result<()> {
        let place = self.place;
        let written = record(METADATA, |fields| {
            text(fields, name);
            counted(fields, |map| {
                for (key, value) in entries {
                    text(map, key);
                    text(map, value);
                }
            });
        });
        self.put(&written)?;
        self.metadata_count += 1;
        self.metadata_index.extend(record(METADATA_INDEX, |fields| {
            fields.extend(place.to_le_bytes());
            fields.extend((written.len() as u64).to_le_bytes());
            text(fields, name);
        }));
        Ok(())
    }

    /// Adds a channel of JSON messages under a JSON Schema of its own; returns its number.
    pub(super) fn add_channel(&mut self, topic: &str, schema_name: &str, schema: &str) -> io::Result<u16> {
        let id = u16::try_from(self.message_counts.len()).map_err(io::Error::other)?;
        // Schema 0 would say that there is none.
        let schema_id = id.checked_add(1).ok_or_else(|| io::Error::other("too many channels"))?;
        let schema = record(SCHEMA, |fields| {
            fields.extend(schema_id.to_le_bytes());
            text(fields, schema_name);
            text(fields, "jsonschema");
            text(fields, schema);
        });
        let channel = record(CHANNEL, |fields| {
            fields.extend(id.to_le_bytes());
            fields.extend(schema_id.to_le_bytes());
            text(fields, topic);
            text(fields, "json");
            counted(fields, |_| ());
        });
        self.put(&schema)?;
        self.put(&channel)?;
        self.schemas.extend(schema);
        self.channels.extend(channel);
        self.message_counts.push(0);
        self.chunk.messages.push(Vec::new());
        Ok(id)
    }

    pub(super) fn write_message(&mut self, head: Head, data: &[u8]) -> io::Result<()> {
        let channel = usize::from(head.channel);
        self.chunk.messages[channel].push((head.time_ns, self.chunk.records.len() as u64));
        append(&mut self.chunk.records, MESSAGE, |fields| {
            fields.extend(head.channel.to_le_bytes());
            fields.extend(head.sequence.to_le_bytes());
            fields.extend(head.time_ns.to_le_bytes()); // logged
            fields.extend(head.time_ns.to_le_bytes()); // published
            fields.extend(data);
        });
        self.message_counts[channel] += 1;
        for span_ns in [&mut self.chunk.span_ns, &mut self.span_ns] {
            let (first_ns, last_ns) = span_ns.unwrap_or((head.time_ns, head.time_ns));
            *span_ns = Some((first_ns.min(head.time_ns), last_ns.max(head.time_ns)));
        }
        if self.chunk.records.len() >= CHUNK_BYTES { self.close_chunk() } else { Ok(()) }
    }

    fn close_chunk(&mut self) -> io::Result<()> {
        let Some(span_ns) = self.chunk.span_ns.take() else { return Ok(()) };
        let (chunk_place, size) = (self.place, self.chunk.records.len() as u64);
        let written = record(CHUNK, |fields| {
            times(fields, span_ns);
            fields.extend(size.to_le_bytes());
            fields.extend(CRC.checksum(&self.chunk.records).to_le_bytes());
            text(fields, ""); // compression
            fields.extend(size.to_le_bytes());
            fields.append(&mut self.chunk.records);
        });
        self.put(&written)?;
        let index_place = self.place;
        let mut places = Vec::new();
        for (channel, messages) in (0_u16..).zip(&mut self.chunk.messages) {
            if messages.is_empty() {
                continue;
            }
            let index = record(MESSAGE_INDEX, |fields| {
                fields.extend(channel.to_le_bytes());
                counted(fields, |entries| {
                    for (time_ns, place) in messages.drain(..) {
                        entries.extend(time_ns.to_le_bytes());
                        entries.extend(place.to_le_bytes());
                    }
                });
            });
            places.extend(channel.to_le_bytes());
            places.extend(self.place.to_le_bytes());
            self.out.write_all(&index)?;
            self.place += index.len() as u64;
        }
        self.chunk_count += 1;
        let index_length = self.place - index_place;
        append(&mut self.chunk_index, CHUNK_INDEX, |fields| {
            times(fields, span_ns);
            fields.extend(chunk_place.to_le_bytes());
            fields.extend((written.len() as u64).to_le_bytes());
            counted(fields, |map| map.append(&mut places));
            fields.extend(index_length.to_le_bytes());
            text(fields, ""); // compression
            fields.extend(size.to_le_bytes()); // compressed
            fields.extend(size.to_le_bytes());
        });
        Ok(())
    }

    /// Writes what is left and the summary.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.close_chunk()?;
        self.put(&record(DATA_END, |fields| fields.extend(NO_CRC.to_le_bytes())))?;
        let statistics = record(STATISTICS, |fields| {
            let channels = self.message_counts.len();
            fields.extend(self.message_counts.iter().sum::<u64>().to_le_bytes());
            fields.extend((channels as u16).to_le_bytes()); // schemas
            fields.extend((channels as u32).to_le_bytes());
            fields.extend(0_u32.to_le_bytes()); // attachments
            fields.extend(self.metadata_count.to_le_bytes());
            fields.extend(self.chunk_count.to_le_bytes());
            times(fields, self.span_ns.unwrap_or_default());
            counted(fields, |map| {
                for (channel, count) in (0_u16..).zip(&self.message_counts) {
                    map.extend(channel.to_le_bytes());
                    map.extend(count.to_le_bytes());
                }
            });
        });
        let (summary_place, mut summary, mut offsets) = (self.place, Vec::new(), Vec::new());
        for (opcode, group) in [
            (SCHEMA, &self.schemas),
            (CHANNEL, &self.channels),
            (STATISTICS, &statistics),
            (CHUNK_INDEX, &self.chunk_index),
            (METADATA_INDEX, &self.metadata_index),
        ] {
            if !group.is_empty() {
                append(&mut offsets, SUMMARY_OFFSET, |fields| {
                    fields.push(opcode);
                    fields.extend((summary_place + summary.len() as u64).to_le_bytes());
                    fields.extend((group.len() as u64).to_le_bytes());
                });
                summary.extend(group);
            }
        }
        let offsets_place = summary_place + summary.len() as u64;
        summary.append(&mut offsets);
        append(&mut summary, FOOTER, |fields| {
            fields.extend(summary_place.to_le_bytes());
            fields.extend(offsets_place.to_le_bytes());
            fields.extend(NO_CRC.to_le_bytes());
        });
        // Of the summary and of the footer up to here.
        let end = summary.len() - size_of::<u32>();
        let crc = CRC.checksum(&summary[..end]);
        summary[end..].copy_from_slice(&crc.to_le_bytes());
        self.put(&summary)?;
        self.put(MAGIC)?;
        self.out.flush()
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.place += bytes.len() as u64;
        self.out.write_all(bytes)
    }
}

fn record(opcode: u8, fields: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = Vec::new();
    append(&mut out, opcode, fields);
    out
}

fn append(out: &mut Vec<u8>, opcode: u8, fields: impl FnOnce(&mut Vec<u8>)) {
    out.push(opcode);
    let from = out.len() + size_of::<u64>();
    out.extend([0; size_of::<u64>()]);
    fields(out);
    let length = (out.len() - from) as u64;
    out[from - size_of::<u64>()..from].copy_from_slice(&length.to_le_bytes());
}

/// What `inner` appends, preceded by its length.
fn counted(out: &mut Vec<u8>, inner: impl FnOnce(&mut Vec<u8>)) {
    let from = out.len() + size_of::<u32>();
    out.extend([0; size_of::<u32>()]);
    inner(out);
    let length = (out.len() - from) as u32;
    out[from - size_of::<u32>()..from].copy_from_slice(&length.to_le_bytes());
}

fn text(out: &mut Vec<u8>, text: &str) {
    counted(out, |out| out.extend(text.as_bytes()));
}

fn times(out: &mut Vec<u8>, (first_ns, last_ns): (u64, u64)) {
    out.extend(first_ns.to_le_bytes());
    out.extend(last_ns.to_le_bytes());
}
