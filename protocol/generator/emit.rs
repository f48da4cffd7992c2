//! Rust text for the messages of `rig.dbc`; what it says is explained in `src/frames.rs`, which includes it.
//!
//! The text holds no arithmetic: ranges, factors and bits go into the tables, and the few functions that use them are
//! written by hand in `src/frames.rs`.

use std::fmt::Write;

use crate::model::{Catalogue, Kind, Message, Payload, Signal, Table, camel_case};

/// The whole of `src/frames/generated.rs`.
pub(crate) fn catalogue(catalogue: &Catalogue) -> String {
    let mut out = String::from(
        "// @generated from rig.dbc by the tests of this crate (generator/): cargo test -p protocol generated\n\n",
    );
    let rate = catalogue.bit_rate_per_s;
    out += &format!("/// Bit rate of the bus, in bit/s.\npub const BIT_RATE_PER_S: u32 = {rate};\n\n");
    for table in &catalogue.tables {
        value_table(&mut out, table);
    }
    for message in &catalogue.messages {
        message_spec(&mut out, message, &catalogue.tables);
    }
    let constants: Vec<_> = catalogue.messages.iter().map(|message| constant(&message.name)).collect();
    out += "/// Every message of `rig.dbc`, by identifier.\n";
    out += &format!("pub const MESSAGES: &[&MessageSpec] = &[{}];\n\n", constants.join(", "));
    for each in &catalogue.payloads {
        payload(&mut out, each, catalogue);
    }
    frame(&mut out, catalogue);
    out
}

fn value_table(out: &mut String, table: &Table) {
    let name = &table.name;
    let users = format!("Value table `{name}` of `rig.dbc`.");
    *out +=
        &format!("/// {users}\n#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]\n#[repr(u8)]\n");
    *out += &format!("pub enum {name} {{\n");
    let (mut from_raw, mut names) = (String::new(), String::new());
    for (raw, text) in &table.values {
        let variant = camel_case(text);
        let default = if *raw == 0 { "    #[default]\n" } else { "" };
        *out += &format!("    /// {raw}: {text}.\n{default}    {variant} = {raw},\n");
        from_raw += &format!("            {raw} => Some(Self::{variant}),\n");
        names += &format!("            Self::{variant} => {text:?},\n");
    }
    *out += &format!(
        "}}

impl {name} {{
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {{
        match raw {{
{from_raw}            _ => None,
        }}
    }}

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {{
        self as u8
    }}

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {{
        match self {{
{names}        }}
    }}
}}

impl fmt::Display for {name} {{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {{
        f.write_str(self.name())
    }}
}}

"
    );
}

fn message_spec(out: &mut String, message: &Message, tables: &[Table]) {
    let Message { name, id, length, sender, cycle_time_ms, send_type, comment, checksum_start, .. } = message;
    let covered = message.signals.iter().map(|signal| mask(signal.start, signal.length));
    let covered = covered.chain(checksum_start.map(|start| mask(start, 8))).fold(0, |all, bits| all | bits);
    let reserved = mask(0, 8 * length) & !covered;
    let period = if *cycle_time_ms == 0 { "event".to_owned() } else { format!("{cycle_time_ms} ms") };
    *out += &format!(
        "/// `{name}`, {id:#05X}, {length} bytes, {period}, sent by {sender}: {}
pub const {}: &MessageSpec = &MessageSpec {{
    name: {name:?},
    id: {id:#05X},
    length: {length},
    cycle_time_ms: {cycle_time_ms},
    send_type: {send_type:?},
    sender: {sender:?},
    comment: {comment:?},
    checksum_start: {checksum_start:?},
    reserved: {reserved:#X},
    signals: &[\n",
        doc(comment),
        constant(name),
    );
    for signal in &message.signals {
        let Signal {
            name,
            start,
            length,
            signed,
            factor,
            offset,
            raw_min,
            raw_max,
            min,
            max,
            unit,
            comment,
            ..
        } = signal;
        let values: Vec<_> = match signal.kind {
            Kind::Table(index) => tables[index].values.iter().map(|(_, text)| text.as_str()).collect(),
            _ => Vec::new(),
        };
        let (field, receivers) = (&signal.field, &signal.receivers);
        *out += &format!(
            "        SignalSpec {{ name: {name:?}, field: {field:?}, unit: {unit:?}, comment: {comment:?}, start: {start}, \
             length: {length}, signed: {signed}, factor: {factor:?}, offset: {offset:?}, raw_min: {raw_min}, \
             raw_max: {raw_max}, min: {min:?}, max: {max:?}, values: &{values:?}, receivers: &{receivers:?}, \
             kind: SignalKind::{} }},\n",
            match signal.kind {
                Kind::Physical => "Physical",
                Kind::Integer(_) => "Integer",
                Kind::Flag => "Flag",
                Kind::Table(_) => "Table",
            }
        );
    }
    *out += "    ],\n};\n\n";
}

fn payload(out: &mut String, payload: &Payload, catalogue: &Catalogue) {
    let name = &payload.name;
    let first = &catalogue.messages[payload.messages[0]];
    let carriers: Vec<_> = payload
        .messages
        .iter()
        .map(|index| format!("[`{}`]", constant(&catalogue.messages[*index].name)))
        .collect();
    let [mut fields, mut pack, mut unpack, mut visit, mut names, mut build] = [const { String::new() }; 6];
    for (index, signal) in first.signals.iter().enumerate() {
        let Field { name, kind, put, take, to_f64, from_f64 } = Field::new(index, signal, &catalogue.tables);
        let _ =
            write!(fields, "    /// {}{}\n    pub {name}: {kind},\n", doc(&signal.comment), range(signal));
        let _ = writeln!(pack, "        word |= {put};");
        let _ = writeln!(unpack, "            {name}: {take},");
        let _ = writeln!(visit, "        visit(&spec.signals[{index}], {to_f64});");
        let _ = write!(names, "{name}, ");
        let _ = writeln!(build, "            {name}{from_f64},");
    }
    *out += &format!(
        "/// {}
///
/// Carried by {}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct {name} {{
{fields}}}

impl {name} {{
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {{
        let mut word = 0;
{pack}        Ok(word)
    }}

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {{
        Ok(Self {{
{unpack}        }})
    }}

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {{
{visit}    }}

    fn from_values(values: &[f64]) -> Option<Self> {{
        let &[{names}] = values else {{ return None }};
        Some(Self {{
{build}        }})
    }}
}}

",
        doc(&first.comment),
        carriers.join(", ")
    );
    if let Some(bytes) = plain_bytes(first) {
        let count = bytes.len();
        let list = bytes.join(", ");
        let of_self: Vec<_> = bytes.iter().map(|byte| format!("self.{byte}")).collect();
        *out += &format!(
            "impl {name} {{
    /// The payload from its bytes in the order of the wire.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; {count}]) -> Self {{
        let [{list}] = bytes;
        Self {{ {list} }}
    }}

    /// The bytes in the order of the wire.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; {count}] {{
        [{}]
    }}
}}

",
            of_self.join(", ")
        );
    }
}

/// The Rust text that stands for one signal in its payload.
struct Field<'a> {
    name: &'a str,
    kind: &'a str,
    /// Expression for its bits in the data word.
    put: String,
    /// Expression for its value from the data word.
    take: String,
    to_f64: String,
    /// What follows the field's name in a struct expression, its f64 having that name.
    from_f64: String,
}

impl<'a> Field<'a> {
    fn new(index: usize, signal: &'a Signal, tables: &'a [Table]) -> Self {
        let name = signal.field.as_str();
        let counted = |kind, counts: &str, take, from_f64| Self {
            name,
            kind,
            put: format!("put_counts(spec, {index}, i64::from({counts}))?"),
            take,
            to_f64: format!("f64::from({counts})"),
            from_f64,
        };
        let (counts, value) = (format!("counts(spec, {index}, word)?"), format!("self.{name}"));
        match signal.kind {
            Kind::Physical => Self {
                name,
                kind: "f64",
                put: format!("put_physical(spec, {index}, {value})?"),
                take: format!("physical(spec, {index}, word)?"),
                to_f64: value,
                from_f64: String::new(),
            },
            Kind::Integer(kind) => {
                counted(kind, &value, format!("{counts} as {kind}"), format!(": exact({name})?"))
            }
            Kind::Flag => {
                let flag = format!(": exact::<u8>({name}).filter(|bit| *bit < 2)? != 0");
                counted("bool", &value, format!("{counts} != 0"), flag)
            }
            Kind::Table(table) => {
                let kind = tables[table].name.as_str();
                let take = format!(
                    "{kind}::from_raw(raw(spec, {index}, word) as u8).ok_or_else(|| not_in_table(spec, {index}, word))?"
                );
                counted(kind, &format!("{value}.raw()"), take, format!(": {kind}::from_raw(exact({name})?)?"))
            }
        }
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

fn frame(out: &mut String, catalogue: &Catalogue) {
    let [mut variants, mut specs, mut pack, mut unpack, mut visit, mut build] = [const { String::new() }; 6];
    for message in &catalogue.messages {
        let (name, id, spec) = (&message.name, message.id, constant(&message.name));
        let payload = &catalogue.payloads[message.payload].name;
        let _ = write!(
            variants,
            "    /// {id:#05X}, sent by {}: {}\n    {name}({payload}),\n",
            message.sender,
            doc(&message.comment)
        );
        let _ = writeln!(specs, "            Self::{name}(_) => {spec},");
        let _ = writeln!(pack, "            Self::{name}(payload) => payload.pack({spec}),");
        let _ = writeln!(
            unpack,
            "            {id:#05X} => Self::{name}({payload}::unpack({spec}, open({spec}, frame)?)?),"
        );
        let _ = writeln!(visit, "            Self::{name}(payload) => payload.visit({spec}, &mut visit),");
        let _ =
            writeln!(build, "            {id:#05X} => Some(Self::{name}({payload}::from_values(values)?)),");
    }
    *out += &format!(
        "/// A frame of the wire with its payload in physical quantities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frame {{
{variants}}}

impl Frame {{
    /// The message's entry in [`MESSAGES`].
    #[must_use]
    pub const fn spec(&self) -> &'static MessageSpec {{
        match self {{
{specs}        }}
    }}

    fn pack(&self) -> Result<u64, EncodeError> {{
        match self {{
{pack}        }}
    }}

    /// The frame that `frame` carries.
    ///
    /// # Errors
    /// [`DecodeError`] names message, signal and raw value of the first thing that `rig.dbc` does not allow.
    pub fn decode(frame: &CanFrame) -> Result<Self, DecodeError> {{
        let id = frame.standard_id().ok_or(DecodeError::NotPlainData {{ raw_id: frame.raw_id() }})?;
        Ok(match id {{
{unpack}            _ => return Err(DecodeError::UnknownIdentifier {{ id }}),
        }})
    }}

    /// Calls `visit` with each signal and its value, in the order of [`MessageSpec::signals`]; flags are 0 and 1, values
    /// of a table their counts.
    pub fn for_each_signal(&self, mut visit: impl FnMut(&'static SignalSpec, f64)) {{
        match self {{
{visit}        }}
    }}

    /// The frame with identifier `id` and one value for each signal, in the order of [`MessageSpec::signals`].
    ///
    /// `None` when there is no such message, the number of values differs, or a value does not fit the Rust type of its field
    /// (which for integers may be wider than the signal: [`Frame::encode`] checks the range).
    #[must_use]
    pub fn from_values(id: u16, values: &[f64]) -> Option<Self> {{
        match id {{
{build}            _ => None,
        }}
    }}
}}
"
    );
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
