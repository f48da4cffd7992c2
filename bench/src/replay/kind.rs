//! The senders of the frames of a log, by identifier, and whether the frames may be sent.
//!
//! | kind | frames | beside a live rig |
//! |---|---|---|
//! | command | of controllers, console and bench in `rig.dbc` | stale: valves would follow the past |
//! | rig | of the rig in `rig.dbc` | a second rig: controllers would receive old sensor values |
//! | other | identifiers that `rig.dbc` does not know | ignored by rig and controllers |
//!
//! An error frame is a report of an interface to its host; it cannot be sent.

use protocol::can::{CanFrame, ERROR_FLAG, EXTENDED_FLAG, EXTENDED_MASK, STANDARD_MASK};
use protocol::frames::MessageSpec;
use std::str::FromStr;

/// The node of the emulator in `rig.dbc`.
const RIG: &str = "Rig";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Sent by a controller, the console or the bench.
    Command,
    Rig,
    /// Unknown to `rig.dbc`.
    Other,
    Error,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exclusion {
    /// All of [`Kind::Command`].
    Commands,
    /// All of [`Kind::Rig`].
    Rig,
    /// An identifier, with the flag of an extended one.
    Identifier(u32),
}

/// An invalid value of --leave-out.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is neither 'commands' nor 'rig' nor an identifier of 3 or 8 hexadecimal digits")]
pub(crate) struct InvalidExclusion(String);

impl Kind {
    /// By the identifier: a malformed frame of the rig still comes from a rig.
    pub(super) fn of(frame: &CanFrame) -> Self {
        if frame.raw_id() & ERROR_FLAG != 0 {
            return Self::Error;
        }
        match frame.standard_id().and_then(MessageSpec::by_id) {
            Some(spec) if spec.sender == RIG => Self::Rig,
            Some(_) => Self::Command,
            None => Self::Other,
        }
    }
}

impl Exclusion {
    pub(crate) fn names(self, frame: &CanFrame) -> bool {
        match self {
            Self::Commands => Kind::of(frame) == Kind::Command,
            Self::Rig => Kind::of(frame) == Kind::Rig,
            Self::Identifier(id) => frame.raw_id() & (EXTENDED_FLAG | EXTENDED_MASK) == id,
        }
    }
}

impl FromStr for Exclusion {
    type Err = InvalidExclusion;

    fn from_str(text: &str) -> Result<Self, InvalidExclusion> {
        let hex = text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let number = u32::from_str_radix(text, 16).ok().filter(|_| hex);
        match (text, text.len(), number) {
            ("commands", _, _) => Ok(Self::Commands),
            ("rig", _, _) => Ok(Self::Rig),
            (_, 3, Some(id)) if id <= STANDARD_MASK => Ok(Self::Identifier(id)),
            (_, 8, Some(id)) if id <= EXTENDED_MASK => Ok(Self::Identifier(id | EXTENDED_FLAG)),
            _ => Err(InvalidExclusion(text.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::can::REMOTE_FLAG;

    #[test]
    fn a_frame_is_its_senders() {
        for (raw_id, kind) in [
            (0x110, Kind::Command),
            (0x160, Kind::Command),
            (0x108, Kind::Command),
            (0x109, Kind::Rig),
            (0x120, Kind::Rig),
            (0x7FF, Kind::Other),
            (EXTENDED_FLAG | 0x110, Kind::Other),
            (ERROR_FLAG | 4, Kind::Error),
        ] {
            assert_eq!(Kind::of(&CanFrame::from_raw(raw_id, &[])), kind, "{raw_id:X}");
        }
    }

    #[test]
    fn what_is_left_out_is_named_by_word_or_identifier() {
        let frame = |raw_id| CanFrame::from_raw(raw_id, &[]);
        let left_out = |text: &str| text.parse::<Exclusion>().unwrap();
        assert!(left_out("commands").names(&frame(0x111)) && !left_out("commands").names(&frame(0x121)));
        assert!(left_out("rig").names(&frame(0x121)) && !left_out("rig").names(&frame(0x111)));
        assert!(left_out("7fF").names(&frame(REMOTE_FLAG | 0x7FF)));
        assert!(!left_out("000007FF").names(&frame(0x7FF)));
        assert!(left_out("000007FF").names(&frame(EXTENDED_FLAG | 0x7FF)));
        for text in ["", "command", "800", "+12", "20000000", "12"] {
            assert!(text.parse::<Exclusion>().is_err(), "{text}");
        }
    }
}
