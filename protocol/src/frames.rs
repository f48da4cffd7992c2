//! The typed frames of the wire, generated from `rig.dbc`.
//!
//! ```text
//! Frame::DriveValveCommand(ValveCommand { opening, .. })  --encode-->  CanFrame 110#...
//!                                                         <--decode--
//! ```
//!
//! *Physical* means SI units in `f64`, *raw* means counts as they cross the wire: physical = raw * factor + offset. Encoding
//! rounds to the nearest count, ties to even, as cantools in Python does. A value beyond its range is an error with name, value,
//! range and unit; only a millionth of a count is forgiven, so that rounding errors at the ends of a range are not.
//! Bits that no signal covers are reserved: 0 when sent, refused when received.
//!
//! `rig.dbc` is the only place where a range, a factor, a bit or an identifier is written. `generator/` makes of it, in
//! `frames/payloads.rs` and `frames/messages.rs`,
//!
//! - a payload struct for each layout, shared by messages that differ by a leading node or axis word,
//! - [`Frame`], one variant for each identifier, with [`Frame::encode`] and [`Frame::decode`],
//! - a [`MessageSpec`] for each message, such as [`DRIVE_VALVE_COMMAND`], and all of them in [`MESSAGES`],
//! - an enum for each value table.
//!
//! Neither encode nor decode allocates: both run in the 1 ms path.

use std::fmt;
use std::time::Duration;

use crate::can::{CanFrame, ERROR_FLAG, REMOTE_FLAG};
use crate::checksum;

mod layout;
mod messages;
mod payloads;

use layout::{Field, exact, frames, payload, plain_bytes, put_counts, value_table};
pub use messages::*;
pub use payloads::*;

/// Values of the counter `alive` in commands and sensors: it counts modulo this.
pub const ALIVE_RANGE: u64 = 16;
/// Values of the `echo` in a command: the cycle number that it answers, modulo this.
pub const ECHO_RANGE: u64 = 4096;

/// Specification of a message in `rig.dbc`.
#[derive(Debug, PartialEq)]
pub struct MessageSpec {
    /// Name, unique.
    pub name: &'static str,
    /// 11-bit identifier, unique.
    pub id: u16,
    /// Bytes of data, 1 to 8.
    pub length: u8,
    /// Period in ms; 0 for a message that is sent on events only.
    pub cycle_time_ms: u32,
    /// When it is sent: `Cyclic`, `Event`, `IfActive` (cyclic while its cause lasts) or `CyclicAndOnChange`.
    pub send_type: &'static str,
    /// The one node that sends it.
    pub sender: &'static str,
    /// Purpose of the message.
    pub comment: &'static str,
    /// First bit of the checksum's byte, the last of the frame; `None` without a checksum.
    pub checksum_start: Option<u8>,
    /// Bits that must be 0, bit 0 of byte 0 lowest.
    pub reserved: u64,
    /// Signals by their first bit, without the checksum.
    pub signals: &'static [SignalSpec],
}

impl MessageSpec {
    /// Period; `None` for a message that is sent on events only.
    #[must_use]
    pub const fn cycle_time(&self) -> Option<Duration> {
        match self.cycle_time_ms {
            0 => None,
            ms => Some(Duration::from_millis(ms as u64)),
        }
    }

    /// The entry of [`MESSAGES`] with identifier `id`.
    #[must_use]
    pub fn by_id(id: u16) -> Option<&'static Self> {
        MESSAGES.iter().find(|spec| spec.id == id).copied()
    }
}

/// Specification of a signal of a message in `rig.dbc`.
#[derive(Debug, PartialEq)]
pub struct SignalSpec {
    /// Name in the DBC, unique in its message.
    pub name: &'static str,
    /// Name of the field in Rust, which adds the unit.
    pub field: &'static str,
    /// Unit of the physical value: `m`, `N`, `Pa`, `kg` or empty.
    pub unit: &'static str,
    /// Meaning of the signal.
    pub comment: &'static str,
    /// First bit, bit 0 of byte 0 being 0; Intel byte order.
    pub start: u8,
    /// Bits, 1 to 32.
    pub length: u8,
    /// Whether raw values are two's complement.
    pub signed: bool,
    /// Physical value of one count.
    pub factor: f64,
    /// Physical value of raw 0.
    pub offset: f64,
    /// Smallest raw value allowed.
    pub raw_min: i64,
    /// Largest raw value allowed.
    pub raw_max: i64,
    /// Smallest physical value allowed, exactly that of `raw_min`.
    pub min: f64,
    /// Largest physical value allowed, exactly that of `raw_max`.
    pub max: f64,
    /// Names of the raw values from 0 on; empty without a value table.
    pub values: &'static [&'static str],
    /// Nodes that listen to it.
    pub receivers: &'static [&'static str],
    /// How the field looks in Rust.
    pub kind: SignalKind,
}

/// How the field of a signal looks in Rust.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalKind {
    /// `f64` in the signal's unit.
    Physical,
    /// An integer of counts.
    Integer,
    /// `bool`.
    Flag,
    /// The enum of a value table.
    Table,
}

impl SignalSpec {
    /// Physical value of `raw`.
    #[must_use]
    pub fn physical(&self, raw: i64) -> f64 {
        raw as f64 * self.factor + self.offset
    }

    /// The counts of this signal in the data `word` (byte 0 lowest), not checked against its range.
    #[must_use]
    pub const fn raw(&self, word: u64) -> i64 {
        // Shifting up to the sign bit and back down extends the sign.
        let up = 64 - self.start as u32 - self.length as u32;
        let down = 64 - self.length as u32;
        if self.signed { ((word << up) as i64) >> down } else { ((word << up) >> down) as i64 }
    }

    const fn allows(&self, raw: i64) -> bool {
        self.raw_min <= raw && raw <= self.raw_max
    }

    const fn place(&self, raw: i64) -> u64 {
        let mask = u64::MAX >> (64 - self.length);
        ((raw as u64) & mask) << self.start
    }
}

impl Frame {
    /// The 11-bit identifier.
    #[must_use]
    pub const fn id(&self) -> u16 {
        self.spec().id
    }

    /// The message's name in `rig.dbc`.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.spec().name
    }

    /// The frame as it crosses the wire, with its checksum if it has one.
    ///
    /// # Errors
    /// [`EncodeError`] names the first signal whose value is not finite or beyond its range.
    pub fn encode(&self) -> Result<CanFrame, EncodeError> {
        let spec = self.spec();
        let mut data = self.pack()?.to_le_bytes();
        let data = &mut data[..usize::from(spec.length)];
        if spec.checksum_start.is_some()
            && let Some((crc, before)) = data.split_last_mut()
        {
            *crc = checksum::of(spec.id, before);
        }
        Ok(CanFrame::new(spec.id, data))
    }
}

/// A value that a signal cannot carry.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EncodeError {
    /// NaN or infinite.
    #[error("{}.{} is {value}, which is not finite; allowed is {}", message.name, signal.name, Allowed(signal))]
    NotFinite {
        /// The message that was to be sent.
        message: &'static MessageSpec,
        /// Signal whose value is refused.
        signal: &'static SignalSpec,
        /// Refused value, in the signal's unit.
        value: f64,
    },
    /// Beyond the range of the signal.
    #[error("{}.{} is {value}{}; allowed is {}", message.name, signal.name, Unit(signal), Allowed(signal))]
    OutOfRange {
        /// The message that was to be sent.
        message: &'static MessageSpec,
        /// Signal whose value is refused.
        signal: &'static SignalSpec,
        /// Its value in the signal's unit.
        value: f64,
    },
}

/// A frame that `rig.dbc` does not allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Extended, remote or error frame.
    #[error("frame {raw_id:#010x} is {}, not a data frame with an 11-bit identifier", frame_kind(*raw_id))]
    NotPlainData {
        /// Identifier with the kernel's flags.
        raw_id: u32,
    },
    /// No message has this identifier.
    #[error("identifier {id:#05x} is unknown")]
    UnknownIdentifier {
        /// Identifier as received, 11 bits.
        id: u16,
    },
    /// Shorter or longer than the message.
    #[error("{message} has {length} bytes; expected {expected}")]
    WrongLength {
        /// Name of the message.
        message: &'static str,
        /// Bytes received.
        length: u8,
        /// Bytes of the message.
        expected: u8,
    },
    /// Corrupted, or meant for another identifier.
    #[error("{message} has checksum {found:#04x}; expected {expected:#04x}")]
    WrongChecksum {
        /// Name of the message.
        message: &'static str,
        /// Checksum received.
        found: u8,
        /// Checksum of the identifier and the other bytes.
        expected: u8,
    },
    /// Bits set that no signal covers.
    #[error("{message} has reserved bits set: {bits:#x}")]
    ReservedBits {
        /// Name of the message.
        message: &'static str,
        /// The reserved bits that are set, byte 0 lowest.
        bits: u64,
    },
    /// Counts beyond the range of the signal.
    #[error("{message}.{signal} has raw value {raw}; allowed is {min} to {max}")]
    RawOutOfRange {
        /// Name of the message.
        message: &'static str,
        /// Name of the signal.
        signal: &'static str,
        /// Counts received.
        raw: i64,
        /// Smallest counts allowed.
        min: i64,
        /// Largest counts allowed.
        max: i64,
    },
    /// Counts that the value table does not name.
    #[error("{message}.{signal} has raw value {raw}; its value table ends at {max}")]
    NotInValueTable {
        /// Name of the message.
        message: &'static str,
        /// Name of the signal.
        signal: &'static str,
        /// Counts received.
        raw: i64,
        /// Largest counts in the table.
        max: i64,
    },
}

struct Unit<'a>(&'a SignalSpec);

impl EmergencyStop {
    /// An operator's stop, or its release, which has no reason: there is none to go on stopping.
    #[must_use]
    pub fn of_operator(release: bool) -> Self {
        let reason = if release { EmergencyStopReason::None } else { EmergencyStopReason::Operator };
        Self { reason, release }
    }
}

impl fmt::Display for Unit<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.unit.is_empty() { Ok(()) } else { write!(f, " {}", self.0.unit) }
    }
}

struct Allowed<'a>(&'a SignalSpec);

impl fmt::Display for Allowed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}{}", self.0.min, self.0.max, Unit(self.0))
    }
}

fn frame_kind(raw_id: u32) -> &'static str {
    if raw_id & ERROR_FLAG != 0 {
        "an error frame"
    } else if raw_id & REMOTE_FLAG != 0 {
        "a remote request"
    } else {
        "extended"
    }
}

/// The data of a frame in one word, after length, checksum and reserved bits were checked.
fn open(message: &'static MessageSpec, frame: &CanFrame) -> Result<u64, DecodeError> {
    let (name, data) = (message.name, frame.data());
    if data.len() != usize::from(message.length) {
        let length = data.len() as u8; // at most 8
        return Err(DecodeError::WrongLength { message: name, length, expected: message.length });
    }
    if message.checksum_start.is_some()
        && let Some((found, before)) = data.split_last()
    {
        let expected = checksum::of(message.id, before);
        if *found != expected {
            return Err(DecodeError::WrongChecksum { message: name, found: *found, expected });
        }
    }
    let mut bytes = [0; 8];
    bytes[..data.len()].copy_from_slice(data);
    let word = u64::from_le_bytes(bytes);
    match word & message.reserved {
        0 => Ok(word),
        bits => Err(DecodeError::ReservedBits { message: name, bits }),
    }
}
