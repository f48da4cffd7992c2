//! Packets of the lockstep barrier: 32 bytes, so that none can be taken for the 16 bytes of a frame.
//!
//! ```text
//!   offset  0      4     5        8        12                32
//!           "ABLS" kind  members  cycle    name, zero-padded
//!                        + 2 pad  u32 LE
//! ```

/// Bytes of one control packet.
pub const CONTROL_BYTES: usize = 32;
/// Longest name of a member, in bytes.
pub const LONGEST_NAME: usize = 20;

const MAGIC: [u8; 4] = *b"ABLS";

/// Part that a peer plays in the barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The plant: acts first in each cycle. One for each bus.
    Rig,
    /// A controller: acts on the rig's frames of the cycle.
    Member,
}

/// Kind of a control packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A peer joins the barrier.
    Join(Role),
    /// A peer has posted its frames of the cycle.
    Done,
    /// All frames for the cycle are delivered: act. Carries how many members are in the barrier.
    Go {
        /// Members in the barrier, the rig not counted.
        members: u8,
    },
    /// A member was not done in time; the name is the member's. The barrier is broken.
    TimedOut,
}

/// One packet of the barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Control {
    /// Kind of the packet.
    pub kind: Kind,
    /// Cycle that it speaks of.
    pub cycle: u32,
    name: [u8; LONGEST_NAME],
}

impl Control {
    /// A packet without a name.
    #[must_use]
    pub fn new(kind: Kind, cycle: u32) -> Self {
        Self { kind, cycle, name: [0; LONGEST_NAME] }
    }

    /// A packet about the peer of that name; what exceeds [`LONGEST_NAME`] bytes is cut off.
    #[must_use]
    pub fn named(kind: Kind, cycle: u32, name: &str) -> Self {
        let mut packet = Self::new(kind, cycle);
        let kept = name.len().min(LONGEST_NAME);
        packet.name[..kept].copy_from_slice(&name.as_bytes()[..kept]);
        packet
    }

    /// The name that the packet carries.
    #[must_use]
    pub fn name(&self) -> String {
        let end = self.name.iter().position(|byte| *byte == 0).unwrap_or(LONGEST_NAME);
        String::from_utf8_lossy(&self.name[..end]).into_owned()
    }

    /// The packet's 32 bytes.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; CONTROL_BYTES] {
        let (kind, members) = match self.kind {
            Kind::Join(Role::Rig) => (1, 0),
            Kind::Join(Role::Member) => (2, 0),
            Kind::Done => (3, 0),
            Kind::Go { members } => (4, members),
            Kind::TimedOut => (5, 0),
        };
        let mut bytes = [0; CONTROL_BYTES];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4] = kind;
        bytes[5] = members;
        bytes[8..12].copy_from_slice(&self.cycle.to_le_bytes());
        bytes[12..].copy_from_slice(&self.name);
        bytes
    }

    /// The packet in `bytes`; `None` when they are none.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; CONTROL_BYTES] = bytes.try_into().ok()?;
        let kind = match (bytes[..4] == MAGIC, bytes[4]) {
            (true, 1) => Kind::Join(Role::Rig),
            (true, 2) => Kind::Join(Role::Member),
            (true, 3) => Kind::Done,
            (true, 4) => Kind::Go { members: bytes[5] },
            (true, 5) => Kind::TimedOut,
            _ => return None,
        };
        let cycle = u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]);
        let mut name = [0; LONGEST_NAME];
        name.copy_from_slice(&bytes[12..]);
        Some(Self { kind, cycle, name })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_survive_the_wire() {
        for kind in [
            Kind::Join(Role::Rig),
            Kind::Join(Role::Member),
            Kind::Done,
            Kind::Go { members: 2 },
            Kind::TimedOut,
        ] {
            let packet = Control::named(kind, 0x0102_0304, "controller drive");
            assert_eq!(Control::from_bytes(&packet.to_bytes()), Some(packet));
        }
        assert_eq!(
            Control::named(Kind::Done, 0, "a name of more than twenty bytes").name().len(),
            LONGEST_NAME
        );
    }

    #[test]
    fn a_packet_that_is_no_control_packet_is_refused() {
        let good = Control::new(Kind::Done, 1).to_bytes();
        assert_eq!(Control::from_bytes(&good[..16]), None);
        for position in [0, 4] {
            let mut bad = good;
            bad[position] = 0xEE;
            assert_eq!(Control::from_bytes(&bad), None);
        }
    }
}
