//! Rust text for the messages of `rig.dbc`; what it says is explained in `src/frames.rs`, whose modules it makes.
//!
//! The text is lists: ranges, factors and bits go into the tables, and the macros of `src/frames/layout.rs` make the types.

use crate::model::{Catalogue, Kind, Message, Payload, Signal, Table, camel_case};

/// The first line of a file, which says what it holds.
fn head(purpose: &str) -> String {
    format!(
        "//! {purpose}\n//!\n//! @generated from rig.dbc by the tests of this crate (generator/): cargo test -p protocol generated\n\n"
    )
}

/// The whole of `src/frames/payloads.rs`.
pub(crate) fn payloads(catalogue: &Catalogue) -> String {
    let mut out = head("Value tables of `rig.dbc`, and a struct for each payload.");
    let rate = catalogue.bit_rate_per_s;
    out += "use super::*;\n\n";
    out += &format!("/// Bit rate of the bus, in bit/s.\npub const BIT_RATE_PER_S: u32 = {rate};\n\n");
    for table in &catalogue.tables {
        value_table(&mut out, table);
    }
    for each in &catalogue.payloads {
        payload(&mut out, each, catalogue);
    }
    out.truncate(out.trim_end().len());
    out + "\n"
}

/// The whole of `src/frames/messages.rs`.
pub(crate) fn messages(catalogue: &Catalogue) -> String {
    let mut out = head("The messages of `rig.dbc` with all that it says about them and their signals.");
    out += "use super::*;\n\n";
    frames(&mut out, catalogue);
    out
}

fn value_table(out: &mut String, table: &Table) {
    *out += &format!("value_table! {{ {} {{\n", table.name);
    for (raw, text) in &table.values {
        *out += &format!("    {raw} {} {text:?},\n", camel_case(text));
    }
    *out += "} }\n\n";
}

fn payload(out: &mut String, payload: &Payload, catalogue: &Catalogue) {
    let name = &payload.name;
    let first = &catalogue.messages[payload.messages[0]];
    let carriers: Vec<_> = payload
        .messages
        .iter()
        .map(|index| format!("[`{}`]", constant(&catalogue.messages[*index].name)))
        .collect();
    *out += &format!(
        "payload! {{\n/// {}\n///\n/// Carried by {}.\n{name} {{\n",
        doc(&first.comment),
        carriers.join(", ")
    );
    for (index, signal) in first.signals.iter().enumerate() {
        let kind = match signal.kind {
            Kind::Physical => "f64",
            Kind::Integer(kind) => kind,
            Kind::Flag => "bool",
            Kind::Table(table) => &catalogue.tables[table].name,
        };
        let (comment, field) = (doc(&signal.comment), &signal.field);
        let spec = signal_spec(signal, &catalogue.tables);
        *out += &format!("    /// {comment}{}\n    {index} {field}: {kind} {{ {spec} }},\n", range(signal));
    }
    *out += "} }\n\n";
    if let Some(bytes) = plain_bytes(first) {
        *out += &format!("plain_bytes!({name}: {}, {});\n\n", bytes.len(), bytes.join(" "));
    }
}

fn range(signal: &Signal) -> String {
    match signal.kind {
        Kind::Physical if signal.unit.is_empty() => format!(" Range: {} to {}.", signal.min, signal.max),
        Kind::Physical => format!(" Range: {} to {} {}.", signal.min, signal.max, signal.unit),
        Kind::Integer(_) => format!(" Range: {} to {}.", signal.raw_min, signal.raw_max),
        Kind::Flag | Kind::Table(_) => String::new(),
    }
}

/// The fields of a payload that is nothing but bytes.
fn plain_bytes(message: &Message) -> Option<Vec<&str>> {
    let is_byte = |(index, signal): (usize, &Signal)| {
        signal.start == 8 * index as u64 && signal.length == 8 && signal.kind == Kind::Integer("u8")
    };
    let plain = message.signals.len() > 1 && message.signals.iter().enumerate().all(is_byte);
    plain.then(|| message.signals.iter().map(|signal| signal.field.as_str()).collect())
}

fn frames(out: &mut String, catalogue: &Catalogue) {
    *out += "frames! {\n/// A frame of the wire with its payload in physical quantities.\npub enum Frame {\n";
    for message in &catalogue.messages {
        let Message { name, id, length, sender, cycle_time_ms, send_type, comment, checksum_start, .. } =
            message;
        let payload = &catalogue.payloads[message.payload].name;
        let covered = message.signals.iter().map(|signal| mask(signal.start, signal.length));
        let covered =
            covered.chain(checksum_start.map(|start| mask(start, 8))).fold(0, |all, bits| all | bits);
        let reserved = mask(0, 8 * length) & !covered;
        let period = if *cycle_time_ms == 0 { "event".to_owned() } else { format!("{cycle_time_ms} ms") };
        *out += &format!(
            "    /// {id:#05X}, {length} bytes, {period}, sent by {sender}: {}
    {id:#05X} {name}({payload}) {} {{
        comment: {comment:?},
        sender: {sender:?}, send_type: {send_type:?}, cycle_time_ms: {cycle_time_ms}, \
             length: {length}, checksum_start: {checksum_start:?}, reserved: {reserved:#X},
        signals: &{payload}::signals({}),
    }},\n",
            doc(comment),
            constant(name),
            receivers(&message.signals),
        );
    }
    *out += "} }\n";
}

/// Who listens to each signal: mostly all listen to the whole message.
fn receivers(signals: &[Signal]) -> String {
    let each: Vec<_> = signals.iter().map(|signal| format!("&{:?}", signal.receivers)).collect();
    match &each[..] {
        [first, rest @ ..] if rest.iter().all(|other| other == first) => format!("[{first}; {}]", each.len()),
        _ => format!("[{}]", each.join(", ")),
    }
}

/// What all messages of a payload say of a signal.
fn signal_spec(signal: &Signal, tables: &[Table]) -> String {
    let Signal { name, start, length, signed, factor, offset, kind, .. } = signal;
    let Signal { raw_min, raw_max, min, max, unit, comment, .. } = signal;
    let values: Vec<_> = match kind {
        Kind::Table(index) => tables[*index].values.iter().map(|(_, text)| text.as_str()).collect(),
        _ => Vec::new(),
    };
    let kind = match kind {
        Kind::Physical => "Physical",
        Kind::Integer(_) => "Integer",
        Kind::Flag => "Flag",
        Kind::Table(_) => "Table",
    };
    format!(
        "name: {name:?}, unit: {unit:?}, comment: {comment:?}, start: {start}, length: {length}, \
         signed: {signed}, factor: {factor:?}, offset: {offset:?}, raw_min: {raw_min}, raw_max: {raw_max}, min: {min:?}, \
         max: {max:?}, values: &{values:?}, kind: SignalKind::{kind}"
    )
}

/// `DriveValveCommand` as `DRIVE_VALVE_COMMAND`.
fn constant(name: &str) -> String {
    let mut out = String::new();
    for (index, letter) in name.chars().enumerate() {
        if index > 0 && letter.is_ascii_uppercase() {
            out.push('_');
        }
        out.push(letter.to_ascii_uppercase());
    }
    out
}

fn mask(start: u64, length: u64) -> u64 {
    (u64::MAX >> (64 - length)) << start
}

/// A comment as rustdoc text: no accidental links or tags.
fn doc(comment: &str) -> String {
    comment.replace('[', "\\[").replace(']', "\\]").replace('<', "\\<").replace('\n', " ")
}
