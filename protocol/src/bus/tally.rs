//! Frames by identifier as a peer counts them: in room that is taken once, so that counting never allocates.
//!
//! What `rig.dbc` names is counted by itself, everything else together. Held against the host's counts it gives an account
//! to the last frame: what left, what came, and where the difference is.

use crate::can::CanFrame;
use crate::frames::MESSAGES;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// Name under which all identifiers are written that `rig.dbc` does not know, and frames that are no plain data frame.
pub const OTHERS: &str = "others";

/// Frames by identifier.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct FrameTally {
    /// In the order of [`MESSAGES`], which is that of the identifiers.
    known: [u64; MESSAGES.len()],
    others: u64,
}

impl Default for FrameTally {
    fn default() -> Self {
        Self { known: [0; MESSAGES.len()], others: 0 }
    }
}

impl FrameTally {
    /// Counts one frame.
    pub fn count(&mut self, frame: &CanFrame) {
        let place =
            frame.standard_id().and_then(|id| MESSAGES.binary_search_by_key(&id, |spec| spec.id).ok());
        match place {
            Some(place) => self.known[place] += 1,
            None => self.others += 1,
        }
    }

    /// Identifiers of which frames were counted, by the names that candump gives them, with their number; [`OTHERS`] last.
    pub fn by_name(&self) -> impl Iterator<Item = (String, u64)> {
        let known =
            MESSAGES.iter().zip(self.known).map(|(spec, frames)| (format!("{:03X}", spec.id), frames));
        known.chain([(OTHERS.to_owned(), self.others)]).filter(|(_, frames)| *frames > 0)
    }
}

impl Serialize for FrameTally {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.by_name())
    }
}

/// Names that `rig.dbc` does not know, as in a file of another version, are counted together.
impl<'de> Deserialize<'de> for FrameTally {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut tally = Self::default();
        for (name, frames) in BTreeMap::<String, u64>::deserialize(deserializer)? {
            let place = MESSAGES.iter().position(|spec| format!("{:03X}", spec.id) == name);
            *place.map_or(&mut tally.others, |place| &mut tally.known[place]) += frames;
        }
        Ok(tally)
    }
}

impl fmt::Debug for FrameTally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.by_name()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::EXTENDED_FLAG;

    #[test]
    fn what_rig_dbc_names_is_counted_apart_and_all_else_together() {
        let mut tally = FrameTally::default();
        let frames = [
            CanFrame::new(0x120, &[0; 8]),
            CanFrame::new(0x110, &[0; 5]),
            CanFrame::new(0x120, &[]),
            CanFrame::new(0x7FF, &[]),
            CanFrame::from_raw(EXTENDED_FLAG | 0x110, &[]),
        ];
        frames.iter().for_each(|frame| tally.count(frame));
        let text = r#"{"110":1,"120":2,"others":2}"#;
        assert_eq!(serde_json::to_string(&tally).unwrap(), text);
        assert_eq!(serde_json::from_str::<FrameTally>(text).unwrap(), tally);
    }

    #[test]
    fn the_catalogue_is_in_the_order_of_identifiers() {
        assert!(MESSAGES.is_sorted_by_key(|spec| spec.id));
    }
}
