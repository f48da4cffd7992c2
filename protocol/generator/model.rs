//! `rig.dbc` as the generator sees it: messages, payloads and value tables, checked against the rules of the project.
//!
//! Rules beyond the syntax: 11-bit identifiers that leave CANopen and diagnostics alone; one sender for each identifier;
//! Intel byte order; no multiplexing and no IEEE floats; no overlap; both ends of a range lie on the grid of the signal; a unit
//! that the generator knows; comment and cycle time of its own for each message, comment for each signal; value tables named by
//! `VAL_TABLE_`, from 0; a checksum in the last byte.
//!
//! Messages whose names differ only by a leading node or axis word, with equal layout, share one payload.

use std::collections::BTreeSet;

use can_dbc::{
    AttributeValue, AttributeValueType, ByteOrder, Dbc, MultiplexIndicator, NumericValue, ValueType,
};

use crate::source::Source;

/// Leading words that distinguish senders or axes.
const NODE_WORDS: [&str; 4] = ["Drive", "Load", "Console", "Rig"];
/// Identifiers of CANopen and diagnostics.
const FOREIGN_IDS: [(u16, u16); 5] =
    [(0x000, 0x000), (0x080, 0x100), (0x580, 0x67F), (0x700, 0x77F), (0x7DF, 0x7EF)];
/// Longest name of a message or signal in a DBC file.
const NAME_LIMIT: usize = 32;
/// The one checksum that `src/checksum.rs` computes.
const CHECKSUM: &str = "SAE J1850";
/// Units of the DBC and what they append to a field's name.
const UNITS: [(&str, &str); 5] = [("", ""), ("m", "_m"), ("N", "_n"), ("Pa", "_pa"), ("kg", "_kg")];

/// Everything that `rig.dbc` says.
pub(crate) struct Catalogue {
    pub(crate) bit_rate_per_s: u64,
    /// By identifier.
    pub(crate) messages: Vec<Message>,
    pub(crate) payloads: Vec<Payload>,
    pub(crate) tables: Vec<Table>,
}

pub(crate) struct Message {
    pub(crate) name: String,
    pub(crate) id: u16,
    pub(crate) length: u64,
    pub(crate) sender: String,
    pub(crate) cycle_time_ms: u64,
    pub(crate) send_type: String,
    pub(crate) comment: String,
    /// First bit of the checksum's byte.
    pub(crate) checksum_start: Option<u64>,
    /// Without the checksum.
    pub(crate) signals: Vec<Signal>,
    /// Index into the payloads.
    pub(crate) payload: usize,
    line: usize,
}

#[derive(Clone, PartialEq)]
pub(crate) struct Signal {
    pub(crate) name: String,
    pub(crate) start: u64,
    pub(crate) length: u64,
    pub(crate) signed: bool,
    pub(crate) factor: f64,
    pub(crate) offset: f64,
    pub(crate) raw_min: i64,
    pub(crate) raw_max: i64,
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) unit: String,
    pub(crate) comment: String,
    pub(crate) field: String,
    pub(crate) kind: Kind,
    pub(crate) receivers: Vec<String>,
}

/// How a signal looks in Rust.
#[derive(Clone, PartialEq)]
pub(crate) enum Kind {
    /// A physical quantity, `f64`.
    Physical,
    /// Counts in the smallest integer that holds them.
    Integer(&'static str),
    Flag,
    /// An enum, by index into the tables.
    Table(usize),
}

/// A value table, which becomes an enum.
pub(crate) struct Table {
    pub(crate) name: String,
    pub(crate) values: Vec<(i64, String)>,
}

/// A struct that one or more messages carry.
pub(crate) struct Payload {
    pub(crate) name: String,
    /// Indices of the messages that carry it; the first stands for the layout.
    pub(crate) messages: Vec<usize>,
}

impl Catalogue {
    /// Reads and checks the file.
    ///
    /// # Errors
    /// The first problem with file and line.
    pub(crate) fn read(source: &Source) -> Result<Self, String> {
        let dbc = source.parse()?;
        check_unique(source, &dbc)?;
        let tables = read_tables(source, &dbc)?;
        let reader = Reader { source, dbc: &dbc, tables: &tables };
        let mut messages = dbc.messages.iter().map(|m| reader.message(m)).collect::<Result<Vec<_>, _>>()?;
        messages.sort_by_key(|message| message.id);
        let payloads = share_payloads(source, &mut messages)?;
        let bit_rate_per_s = match dbc.attribute_values_database.iter().find(|a| a.name == "Baudrate") {
            Some(attribute) => integer(&attribute.value).filter(|rate| *rate > 0),
            None => None,
        }
        .ok_or_else(|| source.at(source.keyword_line("BA_", "\"Baudrate\""), "Baudrate is not set"))?;
        Ok(Self { bit_rate_per_s, messages, payloads, tables })
    }
}

struct Reader<'a> {
    source: &'a Source<'a>,
    dbc: &'a Dbc,
    tables: &'a [Table],
}

impl Reader<'_> {
    fn message(&self, raw: &can_dbc::Message) -> Result<Message, String> {
        let name = raw.name.clone();
        let line = self.source.message_line(u64::from(raw.id.raw()), &name);
        let fail = |problem: String| Err(self.source.at(line, &problem));
        let can_dbc::MessageId::Standard(id) = raw.id else {
            return fail(format!("{name}: extended identifiers are not supported"));
        };
        let Some(line) = line.filter(|_| id < 0x800) else {
            let line = self.source.message_name_line(&name);
            return Err(self.source.at(line, &format!("{name}: identifier exceeds 11 bits")));
        };
        if let Some((from, to)) = FOREIGN_IDS.iter().find(|(from, to)| (from..=to).contains(&&id)) {
            return fail(format!(
                "{name}: {id:#x} lies in {from:#x}..={to:#x}, kept for CANopen and diagnostics"
            ));
        }
        if name.len() > NAME_LIMIT {
            return fail(format!("{name}: {} characters, allowed are {NAME_LIMIT}", name.len()));
        }
        if !(1..=8).contains(&raw.size) {
            return fail(format!("{name}: {} bytes, allowed are 1 to 8", raw.size));
        }
        let Some(sender) = raw.transmitter.clone().filter(|s| self.dbc.nodes.iter().any(|node| node.0 == *s))
        else {
            return fail(format!("{name}: sender {:?} is not in BU_", raw.transmitter));
        };
        if self.dbc.message_transmitters.iter().any(|t| t.message_id == raw.id) {
            return fail(format!("{name}: BO_TX_BU_ names further senders; one sender for each identifier"));
        }
        let Some(comment) = self.dbc.message_comment(raw.id).map(str::to_owned) else {
            return fail(format!("{name}: no CM_ BO_ {id}"));
        };
        let Some(cycle_time_ms) = self.dbc.message_attribute(raw.id, "GenMsgCycleTime").and_then(integer)
        else {
            return fail(format!("{name}: GenMsgCycleTime is not set"));
        };
        let Some(send_type) = self.send_type(raw.id) else {
            return fail(format!("{name}: GenMsgSendType is not set to one of its values"));
        };

        let mut signals =
            raw.signals.iter().map(|s| self.signal(raw, line, s)).collect::<Result<Vec<_>, _>>()?;
        self.check_bits(raw, line, &signals)?;
        let checksum_start = self.checksum(raw, line, &mut signals)?;
        signals.sort_by_key(|signal| signal.start);
        Ok(Message {
            name,
            id,
            length: raw.size,
            sender,
            cycle_time_ms,
            send_type,
            comment,
            checksum_start,
            signals,
            payload: usize::MAX,
            line,
        })
    }

    fn signal(
        &self,
        message: &can_dbc::Message,
        line: usize,
        raw: &can_dbc::Signal,
    ) -> Result<Signal, String> {
        self.check_construct(message, raw).and_then(|()| self.supported_signal(message, raw)).map_err(
            |problem| {
                let line = self.source.signal_line(line, &raw.name);
                self.source.at(line, &format!("{}.{}: {problem}", message.name, raw.name))
            },
        )
    }

    fn check_construct(&self, message: &can_dbc::Message, raw: &can_dbc::Signal) -> Result<(), String> {
        let fail = |problem: &str| Err(problem.to_owned());
        let known = |receiver: &String| self.dbc.nodes.iter().any(|node| node.0 == *receiver);
        if raw.name.len() > NAME_LIMIT || raw.name != raw.name.to_lowercase() {
            fail("a signal's name is snake_case and has at most 32 characters")
        } else if raw.byte_order != ByteOrder::LittleEndian {
            fail("Motorola byte order is not supported; write @1")
        } else if raw.multiplexer_indicator != MultiplexIndicator::Plain {
            fail("multiplexed signals are not supported")
        } else if self.dbc.extended_value_type_for_signal(message.id, &raw.name).is_some() {
            fail("SIG_VALTYPE_ is not supported")
        } else if !(1..=32).contains(&raw.size) || raw.start_bit + raw.size > 8 * message.size {
            fail("a signal has 1 to 32 bits and lies within its message")
        } else if raw.receivers.is_empty() {
            fail("no receiver")
        } else if let Some(node) = raw.receivers.iter().find(|receiver| !known(receiver)) {
            Err(format!("receiver {node} is not in BU_"))
        } else {
            Ok(())
        }
    }

    fn supported_signal(&self, message: &can_dbc::Message, raw: &can_dbc::Signal) -> Result<Signal, String> {
        let units = UNITS.map(|(unit, _)| unit);
        let suffix = UNITS.iter().find(|(unit, _)| *unit == raw.unit).map(|(_, suffix)| suffix);
        let suffix = suffix.ok_or_else(|| format!("unit {:?} is unknown; known are {units:?}", raw.unit))?;
        let comment = self.dbc.signal_comment(message.id, &raw.name).ok_or("no CM_ SG_")?;
        let (raw_min, raw_max) = raw_range(raw)?;
        Ok(Signal {
            name: raw.name.clone(),
            start: raw.start_bit,
            length: raw.size,
            signed: raw.value_type == ValueType::Signed,
            factor: raw.factor,
            offset: raw.offset,
            raw_min,
            raw_max,
            min: number(raw.min),
            max: number(raw.max),
            unit: raw.unit.clone(),
            comment: comment.to_owned(),
            field: format!("{}{suffix}", raw.name),
            kind: self.kind(message.id, raw, raw_max)?,
            receivers: raw.receivers.clone(),
        })
    }

    fn kind(&self, id: can_dbc::MessageId, raw: &can_dbc::Signal, raw_max: i64) -> Result<Kind, String> {
        let counts = raw.factor == 1.0 && raw.offset == 0.0 && raw.unit.is_empty();
        let signed = raw.value_type == ValueType::Signed;
        if let Some(descriptions) = self.dbc.value_descriptions_for_signal(id, &raw.name) {
            let values = values(descriptions);
            let table = self.tables.iter().position(|table| table.values == values);
            let table = table.ok_or("its VAL_ equals no VAL_TABLE_")?;
            if !counts || signed || raw.size > 8 || raw_max + 1 != values.len() as i64 {
                return Err("a signal with a value table is unsigned, has at most 8 bits and no factor, and its range \
                            ends with the table"
                    .to_owned());
            }
            return Ok(Kind::Table(table));
        }
        Ok(match (signed, raw.size) {
            _ if !counts => Kind::Physical,
            (false, 1) => Kind::Flag,
            (false, ..=8) => Kind::Integer("u8"),
            (false, ..=16) => Kind::Integer("u16"),
            (false, _) => Kind::Integer("u32"),
            (true, ..=8) => Kind::Integer("i8"),
            (true, ..=16) => Kind::Integer("i16"),
            (true, _) => Kind::Integer("i32"),
        })
    }

    fn send_type(&self, id: can_dbc::MessageId) -> Option<String> {
        let definition = self.dbc.attribute_definitions.iter().find_map(|definition| match definition {
            can_dbc::AttributeDefinition::Message(name, AttributeValueType::Enum(types))
                if name == "GenMsgSendType" =>
            {
                Some(types)
            }
            _ => None,
        })?;
        match self.dbc.message_attribute(id, "GenMsgSendType")? {
            AttributeValue::String(name) => definition.iter().find(|t| *t == name).cloned(),
            index => definition.get(usize::try_from(integer(index)?).ok()?).cloned(),
        }
    }

    fn check_bits(&self, message: &can_dbc::Message, line: usize, signals: &[Signal]) -> Result<(), String> {
        let mut taken = 0_u64;
        for signal in signals {
            let bits = ((1_u64 << signal.length) - 1) << signal.start;
            if taken & bits != 0 {
                let line = self.source.signal_line(line, &signal.name);
                let problem = format!("{}.{} overlaps the signals before it", message.name, signal.name);
                return Err(self.source.at(line, &problem));
            }
            taken |= bits;
        }
        Ok(())
    }

    /// Takes the checksum out of the signals and returns its place.
    fn checksum(
        &self,
        message: &can_dbc::Message,
        line: usize,
        signals: &mut Vec<Signal>,
    ) -> Result<Option<u64>, String> {
        let attribute = |name| match self.dbc.resolved_message_attribute(message.id, name) {
            Some(AttributeValue::String(text)) => text.as_str(),
            _ => "",
        };
        let fail = |problem: String| Err(self.source.at(Some(line), &format!("{}: {problem}", message.name)));
        let (algorithm, name) = (attribute("Checksum"), attribute("ChecksumSignal"));
        match (algorithm, name) {
            ("", "") => Ok(None),
            (CHECKSUM, name) => {
                let last_byte = 8 * (message.size - 1);
                match signals.iter().position(|s| s.name == name && s.start == last_byte && s.length == 8) {
                    Some(index) => Ok(Some(signals.remove(index).start)),
                    None => fail(format!("ChecksumSignal {name:?} is not an 8-bit signal in the last byte")),
                }
            }
            _ => fail(format!("Checksum {algorithm:?} in signal {name:?} is unknown; known is {CHECKSUM:?}")),
        }
    }
}

fn check_unique(source: &Source, dbc: &Dbc) -> Result<(), String> {
    let (mut ids, mut names) = (BTreeSet::new(), BTreeSet::new());
    for can_dbc::Message { id, name, .. } in &dbc.messages {
        if !ids.insert(id.raw()) || !names.insert(name) {
            let line = source.message_line(u64::from(id.raw()), name);
            return Err(source.at(line, &format!("{name}: name or identifier {:#x} is taken", id.raw())));
        }
    }
    Ok(())
}

/// The counts at both ends of the range, which must stand for the ends exactly: what decodes then encodes again.
fn raw_range(raw: &can_dbc::Signal) -> Result<(i64, i64), String> {
    let (min, max) = (number(raw.min), number(raw.max));
    let span = 1_i64 << raw.size;
    let (lowest, highest) =
        if raw.value_type == ValueType::Signed { (-span / 2, span / 2 - 1) } else { (0, span - 1) };
    let on_grid = |limit: f64| {
        let counts = ((limit - raw.offset) / raw.factor).round_ties_even();
        let exact = counts * raw.factor + raw.offset == limit;
        (exact && counts >= lowest as f64 && counts <= highest as f64).then_some(counts as i64)
    };
    match (on_grid(min), on_grid(max)) {
        (Some(raw_min), Some(raw_max)) if raw.factor > 0.0 && min < max => Ok((raw_min, raw_max)),
        _ => Err(format!(
            "range {min} to {max} is empty, beyond {} bits, or its ends are not exact multiples of the factor {:e}",
            raw.size, raw.factor
        )),
    }
}

fn read_tables(source: &Source, dbc: &Dbc) -> Result<Vec<Table>, String> {
    let mut tables: Vec<Table> = Vec::new();
    for raw in &dbc.value_tables {
        let fail = |problem: &str| {
            Err(source.at(source.keyword_line("VAL_TABLE_", &raw.name), &format!("{}: {problem}", raw.name)))
        };
        let values = values(&raw.descriptions);
        if !values.iter().map(|(value, _)| *value).eq(0..values.len() as i64)
            || !(1..=256).contains(&values.len())
        {
            return fail("the values of a table count from 0, in order, to 255 at most");
        }
        if values.iter().map(|(_, text)| camel_case(text)).collect::<BTreeSet<_>>().len() != values.len() {
            return fail("two values have the same name");
        }
        if tables.iter().any(|other| other.values == values || other.name == raw.name) {
            return fail(
                "another VAL_TABLE_ has the same name or values; signals find their table by its values",
            );
        }
        tables.push(Table { name: raw.name.clone(), values });
    }
    Ok(tables)
}

fn share_payloads(source: &Source, messages: &mut [Message]) -> Result<Vec<Payload>, String> {
    let stem = |name: &str| -> String {
        NODE_WORDS.iter().find_map(|word| name.strip_prefix(word)).unwrap_or(name).to_owned()
    };
    let mut payloads: Vec<Payload> = Vec::new();
    for index in 0..messages.len() {
        let name = stem(&messages[index].name);
        let shared = payloads.iter().position(|payload| stem(&payload.name) == name);
        let found = match shared {
            Some(found) if same_layout(&messages[payloads[found].messages[0]], &messages[index]) => {
                payloads[found].name = name;
                payloads[found].messages.push(index);
                found
            }
            Some(found) => {
                let other = &messages[payloads[found].messages[0]].name;
                let problem = format!(
                    "{} and {other} share the name {name}, so they share comment, layout, and all of each signal but receivers",
                    messages[index].name
                );
                return Err(source.at(Some(messages[index].line), &problem));
            }
            None => {
                payloads.push(Payload { name: messages[index].name.clone(), messages: vec![index] });
                payloads.len() - 1
            }
        };
        messages[index].payload = found;
    }
    Ok(payloads)
}

fn same_layout(one: &Message, other: &Message) -> bool {
    let layout = |message: &Message| -> Vec<Signal> {
        message.signals.iter().map(|signal| Signal { receivers: Vec::new(), ..signal.clone() }).collect()
    };
    (&one.comment, one.length, one.checksum_start, layout(one))
        == (&other.comment, other.length, other.checksum_start, layout(other))
}

fn values(raw: &[can_dbc::ValDescription]) -> Vec<(i64, String)> {
    raw.iter().map(|value| (value.id, value.description.clone())).collect()
}

fn number(value: NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => value as f64,
        NumericValue::Int(value) => value as f64,
        NumericValue::Double(value) => value,
    }
}

fn integer(value: &AttributeValue) -> Option<u64> {
    match value {
        AttributeValue::Uint(value) => Some(*value),
        _ => None,
    }
}

/// `waiting-for-rig` and `drive_stale` as `WaitingForRig` and `DriveStale`.
pub(crate) fn camel_case(text: &str) -> String {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric());
    words.map(|word| word[..word.len().min(1)].to_uppercase() + &word[word.len().min(1)..]).collect()
}
