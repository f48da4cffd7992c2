//! Kinds of wire faults with their parameters, and their random draws.

use crate::can::CanFrame;
use crate::frames::{ALIVE_RANGE, Frame};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A fault of the wire, or of a node on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireFault {
    /// Frames are lost for everyone.
    Loss {
        /// Probability for each, 0 to 1.
        probability: f64,
    },
    /// Frames come later.
    Delay {
        /// By how much, ms.
        delay_ms: u32,
    },
    /// Frames come more than once.
    Duplication {
        /// Probability for each, 0 to 1.
        probability: f64,
        /// How often more.
        copies: u32,
    },
    /// Frames are overtaken by the next one of their identifier.
    Reordering {
        /// Probability for each, 0 to 1.
        probability: f64,
    },
    /// Bits of the data are inverted; the frame's own checksum stays.
    Corruption {
        /// Probability for each frame, 0 to 1.
        probability: f64,
        /// Bits drawn, 1 to 64; one that is drawn twice is as before.
        bits: u32,
    },
    /// The data are cut, or padded with 0.
    WrongLength {
        /// Probability for each frame, 0 to 1.
        probability: f64,
        /// Bytes instead, 0 to 8.
        bytes: u8,
    },
    /// The counter of sensors and commands is off; the checksum is right.
    WrongCounter {
        /// Probability for each frame, 0 to 1.
        probability: f64,
        /// By how much, 1 to 15.
        step: u8,
    },
    /// A node says the same over and over.
    Babbling {
        /// Identifier of the frame that it repeats.
        id: u16,
        /// How often.
        frames_per_ms: f64,
        /// Bytes of data, 0 to 8, all 0.
        bytes: u8,
    },
    /// A node hears nothing and is not heard.
    BusOff {
        /// Which.
        node: WireNode,
    },
}

/// A node, known by what it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireNode {
    /// Who sends the drive's sensors.
    Rig,
    /// Who sends the drive's commands; a process for both axes is one node.
    DriveController,
    /// Who sends the load's commands.
    LoadController,
}

/// Which frames a fault concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frames {
    /// All.
    All,
    /// Those of an 11-bit identifier.
    Id(u16),
}

impl Frames {
    pub(super) fn hold(self, frame: &CanFrame) -> bool {
        match self {
            Self::All => true,
            Self::Id(id) => frame.standard_id() == Some(id),
        }
    }
}

impl WireFault {
    /// Name, as in the emulator's table and in the host's report.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Loss { .. } => "bus-loss",
            Self::Delay { .. } => "bus-delay",
            Self::Duplication { .. } => "bus-duplication",
            Self::Reordering { .. } => "bus-reordering",
            Self::Corruption { .. } => "bus-corruption",
            Self::WrongLength { .. } => "wrong-length",
            Self::WrongCounter { .. } => "wrong-counter",
            Self::Babbling { .. } => "babbling-node",
            Self::BusOff { .. } => "bus-off",
        }
    }

    /// With which probability it concerns a frame.
    pub(super) fn probability(&self) -> f64 {
        match *self {
            Self::Loss { probability }
            | Self::Duplication { probability, .. }
            | Self::Reordering { probability }
            | Self::Corruption { probability, .. }
            | Self::WrongLength { probability, .. }
            | Self::WrongCounter { probability, .. } => probability,
            Self::Delay { .. } | Self::Babbling { .. } | Self::BusOff { .. } => 1.0,
        }
    }

    /// The frame as the fault changes it; faults that change none return it as it is.
    pub(super) fn change(&self, frame: &CanFrame, rng: &mut FaultRng) -> CanFrame {
        let mut data = [0; 8];
        let length = frame.data().len();
        data[..length].copy_from_slice(frame.data());
        match *self {
            Self::Corruption { bits, .. } if length > 0 => {
                for _ in 0..bits {
                    let bit = rng.below(8 * length as u64) as usize;
                    data[bit / 8] ^= 1 << (bit % 8);
                }
                CanFrame::from_raw(frame.raw_id(), &data[..length])
            }
            Self::WrongLength { bytes, .. } => {
                CanFrame::from_raw(frame.raw_id(), &data[..usize::from(bytes.min(8))])
            }
            Self::WrongCounter { step, .. } => with_counter_off(frame, step).unwrap_or(*frame),
            _ => *frame,
        }
    }
}

/// The frame with its counter off; `None` for one without a counter, or one that is not as `rig.dbc` says.
fn with_counter_off(frame: &CanFrame, step: u8) -> Option<CanFrame> {
    let mut decoded = Frame::decode(frame).ok()?;
    let alive = match &mut decoded {
        Frame::DriveSensors(sensors) | Frame::LoadSensors(sensors) => &mut sensors.alive,
        Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command) => &mut command.alive,
        _ => return None,
    };
    *alive = (*alive + step) % ALIVE_RANGE as u8;
    decoded.encode().ok()
}

pub(super) struct FaultRng(Pcg64Mcg);

impl FaultRng {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// Whether an event of this probability happens.
    pub(super) fn hits(&mut self, probability: f64) -> bool {
        // `as` saturates: of 2^64 draws, a probability of 1 misses one.
        self.0.next_u64() < (probability * u64::MAX as f64) as u64
    }

    fn below(&mut self, most: u64) -> u64 {
        self.0.next_u64() % most
    }
}
