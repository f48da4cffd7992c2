//! Signals as MDF4: a group with its own time for each message, a channel with unit and meaning for each signal.
//!
//! Physical values are 64-bit floats in SI, all others integers. Time is in s since the origin; the start time of the file is
//! the origin in ns since 1970, so that lockstep, whose time has no date, starts in 1970.
//!
//! Source: ASAM MDF 4.1, by the crate `mdf4-rs`; a test compares values, units and times with asammdf.

use super::signals::{MessageFrames, Signals, name, value};
use mdf4_rs::{DataType, DecodedValue, MdfWriter};
use protocol::frames::{SignalKind, SignalSpec};

/// Offset of the start time in a header block: 24 bytes of head and links of 8 bytes [ASAM MDF 4.1, HD block].
const START_TIME_OFFSET: u64 = 72;

pub(super) fn write(path: &str, signals: &Signals, origin_ns: u64) -> mdf4_rs::Result<()> {
    let mut file = MdfWriter::new(path)?;
    file.init_mdf_file()?;
    if let Some(header) = file.get_block_position("hd_block") {
        // The crate writes 0; a link is 8 bytes in the byte order of this number.
        file.update_link(header + START_TIME_OFFSET, origin_ns)?;
    }
    for message in &signals.messages {
        let group = file.add_channel_group(None, |_| {})?;
        file.set_channel_group_name(&group, message.spec.name)?;
        file.set_channel_group_comment(&group, message.spec.comment)?;
        let time = file.add_channel(&group, None, |channel| {
            channel.data_type = DataType::FloatLE;
            channel.bit_count = 64;
            channel.name = Some("time".into());
        })?;
        file.set_time_channel(&time)?;
        file.set_channel_unit(&time, "s")?;
        let mut previous = time;
        for signal in message.spec.signals {
            let channel = file.add_channel(&group, Some(&previous), |channel| {
                channel.data_type = data_type(signal);
                channel.bit_count = 64;
                channel.name = Some(name(message.spec, signal));
            })?;
            if !signal.unit.is_empty() {
                file.set_channel_unit(&channel, signal.unit)?;
            }
            file.set_channel_comment(&channel, &comment(signal))?;
            previous = channel;
        }
        records(&mut file, &group, message, origin_ns)?;
    }
    file.finalize()
}

fn records<W: mdf4_rs::writer::MdfWrite>(
    file: &mut MdfWriter<W>,
    group: &str,
    message: &MessageFrames,
    origin_ns: u64,
) -> mdf4_rs::Result<()> {
    file.start_data_block_for_cg(group, 0)?;
    let mut row = Vec::with_capacity(message.spec.signals.len() + 1);
    for (stamp_ns, word) in &message.frames {
        row.clear();
        // The difference is exact and rounded once.
        row.push(DecodedValue::Float((i128::from(*stamp_ns) - i128::from(origin_ns)) as f64 / 1e9));
        row.extend(message.spec.signals.iter().map(|signal| match data_type(signal) {
            DataType::FloatLE => DecodedValue::Float(value(signal, *word)),
            DataType::SignedIntegerLE => DecodedValue::SignedInteger(signal.raw(*word)),
            _ => DecodedValue::UnsignedInteger(signal.raw(*word).cast_unsigned()),
        }));
        file.write_record(group, &row)?;
    }
    file.finish_data_block(group)
}

fn data_type(signal: &SignalSpec) -> DataType {
    match signal.kind {
        SignalKind::Physical => DataType::FloatLE,
        _ if signal.signed => DataType::SignedIntegerLE,
        _ => DataType::UnsignedIntegerLE,
    }
}

/// Meaning of a signal, with the names of its states.
pub(super) fn comment(signal: &SignalSpec) -> String {
    let states: Vec<_> =
        signal.values.iter().enumerate().map(|(raw, name)| format!("{raw} {name}")).collect();
    if states.is_empty() {
        signal.comment.to_owned()
    } else {
        format!("{} {}", signal.comment, states.join(", "))
    }
}
