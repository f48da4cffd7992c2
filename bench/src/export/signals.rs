//! The frames of a log as signals of `rig.dbc`: stamps and data of each message.
//!
//! Frames that `rig.dbc` does not know or does not allow (length, checksum, range) are counted, with the line of the first.

use crate::recorded_log::RecordedLog;
use protocol::frames::{DecodeError, Frame, MESSAGES, MessageSpec, SignalKind, SignalSpec};

#[derive(Clone, Debug)]
pub(super) struct MessageFrames {
    pub(super) spec: &'static MessageSpec,
    /// Stamps and data (byte 0 lowest), in the order of the log; at least one.
    pub(super) frames: Vec<(u64, u64)>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Signals {
    /// Messages in the log, by identifier.
    pub(super) messages: Vec<MessageFrames>,
    /// Frames without signals, by the kinds of [`LEFT_OUT`].
    pub(super) left_out: [UndecodedFrames; 2],
}

/// A count of frames without signals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct UndecodedFrames {
    pub(super) frames: u64,
    pub(super) first_line: u64,
}

/// Names of the two kinds of frames without signals.
pub(super) const LEFT_OUT: [&str; 2] = ["that rig.dbc does not know", "that rig.dbc does not allow"];

impl Signals {
    pub(super) fn of(log: &RecordedLog) -> Self {
        let mut frames: Vec<Vec<(u64, u64)>> = vec![Vec::new(); MESSAGES.len()];
        let mut left_out = [UndecodedFrames::default(); 2];
        for logged in &log.frames {
            match Frame::decode(&logged.record.frame) {
                Ok(frame) => {
                    let place = MESSAGES.iter().position(|spec| spec.id == frame.id());
                    let place = place.expect("what decodes is a message of the table");
                    let mut bytes = [0; 8];
                    let data = logged.record.frame.data();
                    bytes[..data.len()].copy_from_slice(data);
                    frames[place].push((logged.record.stamp_ns, u64::from_le_bytes(bytes)));
                }
                Err(error) => {
                    let unknown = matches!(
                        error,
                        DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }
                    );
                    let kind = &mut left_out[usize::from(!unknown)];
                    if kind.frames == 0 {
                        kind.first_line = logged.line;
                    }
                    kind.frames += 1;
                }
            }
        }
        let messages = MESSAGES.iter().zip(frames).filter(|(_, frames)| !frames.is_empty());
        Self { messages: messages.map(|(spec, frames)| MessageFrames { spec, frames }).collect(), left_out }
    }
}

/// Name of a signal's column or channel, with its unit, as `DriveSensors.position_m`.
pub(super) fn name(message: &MessageSpec, signal: &SignalSpec) -> String {
    format!("{}.{}", message.name, signal.field)
}

/// The value of a signal in SI; the number of a state, 0 or 1 for a flag.
pub(super) fn value(signal: &SignalSpec, word: u64) -> f64 {
    let raw = signal.raw(word);
    if signal.kind == SignalKind::Physical { signal.physical(raw) } else { raw as f64 }
}
