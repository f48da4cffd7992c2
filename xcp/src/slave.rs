//! The XCP slave: a function from packets to packets over an [`Image`].
//!
//! ```text
//!   command(packet, cycle, actions) ─► answer or none     any bytes, at any time
//!   cycle(cycle, signals, parameters)                     after each answer to the rig
//!   next_daq() ─► packet or none                          what DAQ lists have to send
//! ```
//!
//! It knows no bus, no clock, no controller: it changes parameters through [`ParameterActions`]. Any bytes lead to a response, an
//! error packet or silence; without a session CONNECT alone is answered. Nothing here allocates, locks, prints or blocks.
//!
//! Source: ASAM MCD-1 XCP 1.1, part 2.

use crate::daq::{Daq, Entry, LISTS, LONGEST_ENTRY, ListMode, STAMP_BYTES};
use crate::image::{DESCRIPTION, Image, ParameterActions};
use crate::lock::{KeyCheck, Lock};
use crate::packet::{BYTES, EVENT, EVENT_STORED, Fields, Packet, Refusal, command, refusal, response};
use crate::signals::COUNT;
use crc::{CRC_32_ISO_HDLC, Crc};

/// Resources: calibration (writing), DAQ (measuring).
const CALIBRATION: u8 = 0x01;
const DAQ: u8 = 0x04;
/// Bits of the session's state.
const STORING: u8 = 0x01;
const DAQ_RUNNING: u8 = 0x40;
/// SET_REQUEST: store the parameter set.
const STORE_REQUEST: u8 = 0x01;
/// Longest block that is written, bytes: 31 values and a rest.
const BLOCK: usize = 255;
/// Data bytes of a packet that writes.
const WRITE_BYTES: usize = BYTES - 2;
/// Packets of the longest block.
pub(crate) const BLOCK_PACKETS: u8 = BLOCK.div_ceil(WRITE_BYTES) as u8;
/// Type of the checksum: CRC-32 of IEEE 802.3.
const CHECKSUM_CRC_32: u8 = 0x09;
/// Most bytes of a checksum, to bound its time within the cycle.
const CHECKSUM_BYTES: u32 = 4096;
/// Dynamic lists, prescaler, time stamps.
const DAQ_PROPERTIES: u8 = 0x13;
/// Unit of time stamps and of the event: 1 ms.
const UNIT_1_MS: u8 = 6;
/// Cycles without a command after which writing is locked again: a minute.
const IDLE_CYCLES: u64 = 60_000;
/// Version of the protocol layer and of the layer below it.
const VERSION: u8 = 1;

static CRC_32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Offset and length of each text in the description region, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct TextLocations {
    pub a2l: (u32, u32),
    /// Name of the A2L file, without the path.
    pub file: (u32, u32),
    /// See [`crate::a2l::epk`].
    pub epk: (u32, u32),
    pub event: (u32, u32),
}

/// Counters of a slave since the start of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub(crate) struct SlaveCounters {
    pub(crate) sessions: u64,
    /// Commands with a positive response.
    pub(crate) answered: u64,
    /// Commands with an error packet, SYNCH excepted.
    pub(crate) refused: u64,
    pub(crate) unlocked: u64,
    pub(crate) wrong_keys: u64,
    /// DAQ packets handed out.
    pub(crate) daq_packets: u64,
}

/// A block that is being written.
#[derive(Clone)]
struct Block {
    bytes: [u8; BLOCK],
    received: usize,
    whole: usize,
}

/// A slave: session, lock, DAQ lists and image.
#[derive(Clone)]
pub struct Slave {
    /// The memory that clients see.
    pub image: Image,
    texts: TextLocations,
    lock: Lock,
    pub(crate) daq: Daq,
    connected: bool,
    storing: bool,
    idle: u64,
    /// Where the next transfer begins; `None` until it is set.
    address: Option<u32>,
    block: Block,
    pub(crate) counters: SlaveCounters,
}

impl Slave {
    /// A slave without a session, which may send so many DAQ packets in a cycle.
    pub(crate) fn new(image: Image, texts: TextLocations, lock: Lock, daq_per_cycle: u32) -> Self {
        Self {
            image,
            texts,
            lock,
            daq: Daq::new(daq_per_cycle),
            connected: false,
            storing: false,
            idle: 0,
            address: None,
            block: Block { bytes: [0; BLOCK], received: 0, whole: 0 },
            counters: SlaveCounters::default(),
        }
    }

    /// Whether the session may write.
    pub fn is_unlocked(&self) -> bool {
        self.lock.is_open()
    }

    /// Ends a cycle of the rig: takes its signals, in the order of their table, and the current parameters, in the order of the
    /// variables; samples the DAQ lists that are due.
    pub fn cycle(&mut self, cycle: u64, signals: &[f64; COUNT], parameters: &[f64]) {
        self.image.refresh(cycle, signals, parameters);
        self.lock.cycle();
        self.idle += 1;
        if self.idle >= IDLE_CYCLES {
            self.lock.shut();
        }
        self.daq.cycle(cycle, &self.image);
    }

    /// The next DAQ packet to send; `None` when none waits.
    pub fn next_daq(&mut self) -> Option<Packet> {
        let packet = self.daq.next_packet()?;
        self.counters.daq_packets += 1;
        Some(packet)
    }

    /// Ends a request to store; the event to send, if a session is open.
    pub(crate) fn stored(&mut self) -> Option<Packet> {
        self.storing = false;
        self.connected.then_some([EVENT, EVENT_STORED, 0, 0, 0, 0, 0, 0])
    }

    /// Processes a packet of any bytes, received in the rig's `cycle`, and returns the response, if the packet has one.
    pub fn command(
        &mut self,
        packet: &[u8],
        cycle: u64,
        actions: &mut dyn ParameterActions,
    ) -> Option<Packet> {
        let fields = Fields(&packet[..packet.len().min(BYTES)]);
        let code = fields.byte(0).ok()?;
        if code == command::CONNECT {
            self.counters.answered += 1;
            return Some(self.connect());
        }
        if !self.connected {
            return None;
        }
        self.idle = 0;
        let answer = self.answer(code, fields, cycle, actions);
        match answer {
            Ok(answer) => {
                self.counters.answered += 1;
                answer
            }
            Err(why) => {
                self.counters.refused += u64::from(why != Refusal::Synch);
                Some(refusal(why))
            }
        }
    }

    fn connect(&mut self) -> Packet {
        // A new session is locked and has no lists.
        self.end_session();
        self.daq.free();
        (self.connected, self.idle) = (true, 0);
        self.counters.sessions += 1;
        // Intel, address granularity of a byte, no slave block mode, GET_COMM_MODE_INFO can be asked for.
        let basic = 0x80;
        response(&[CALIBRATION | DAQ, basic, BYTES as u8, BYTES as u8, 0, VERSION, VERSION])
    }

    fn end_session(&mut self) {
        self.connected = false;
        self.lock.shut();
        self.daq.stop();
        // Discard the packets of the session.
        while self.daq.next_packet().is_some() {}
        self.address = None;
        self.block.whole = 0;
        self.image.forget();
    }

    fn answer(
        &mut self,
        code: u8,
        fields: Fields<'_>,
        cycle: u64,
        actions: &mut dyn ParameterActions,
    ) -> Result<Option<Packet>, Refusal> {
        if code == command::DOWNLOAD || code == command::DOWNLOAD_NEXT {
            return self.write(code == command::DOWNLOAD_NEXT, fields, actions);
        }
        self.block.whole = 0;
        let answer = match code {
            command::DISCONNECT => {
                self.end_session();
                response(&[])
            }
            command::GET_STATUS => self.status(),
            command::SYNCH => {
                self.image.forget();
                return Err(Refusal::Synch);
            }
            command::GET_COMM_MODE_INFO => {
                // Master block mode; no least distance between its packets; nothing is queued.
                response(&[0, 0x01, 0, BLOCK_PACKETS, 0, 0, VERSION])
            }
            command::GET_ID => self.identify(fields.byte(1)?),
            command::SET_REQUEST => self.request(fields.byte(1)?, actions)?,
            command::GET_SEED => self.seed(fields)?,
            command::UNLOCK => self.unlock(fields)?,
            command::SET_MTA => {
                self.address = Some(address(fields, 3)?);
                self.image.forget();
                response(&[])
            }
            command::UPLOAD => self.upload(fields.byte(1)?)?,
            command::SHORT_UPLOAD => {
                let address = address(fields, 3)?;
                self.address = Some(address);
                self.upload(fields.byte(1)?)?
            }
            command::BUILD_CHECKSUM => self.checksum(fields.long(4)?)?,
            _ => self.measure(code, fields, cycle)?,
        };
        Ok(Some(answer))
    }

    fn status(&self) -> Packet {
        let bit = |is: bool, bit: u8| if is { bit } else { 0 };
        let state = bit(self.storing, STORING) | bit(self.daq.runs(), DAQ_RUNNING);
        response(&[state, self.protected(), 0, 0, 0])
    }

    /// Resources that need a key.
    fn protected(&self) -> u8 {
        if self.lock.is_open() { 0 } else { CALIBRATION }
    }

    fn identify(&mut self, kind: u8) -> Packet {
        let (offset, length) = match kind {
            0 | 5 => self.texts.epk,
            1 => self.texts.file,
            4 => self.texts.a2l,
            _ => (0, 0),
        };
        self.address = Some(DESCRIPTION + offset);
        let [a, b, c, d] = length.to_le_bytes();
        response(&[0, 0, 0, a, b, c, d])
    }

    fn request(&mut self, mode: u8, actions: &mut dyn ParameterActions) -> Result<Packet, Refusal> {
        if mode != STORE_REQUEST {
            return Err(Refusal::OutOfRange);
        }
        self.check_unlocked()?;
        if self.storing || !actions.store(self.image.parameters()) {
            return Err(Refusal::Busy);
        }
        self.storing = true;
        Ok(response(&[]))
    }

    fn check_unlocked(&self) -> Result<(), Refusal> {
        if self.lock.is_open() { Ok(()) } else { Err(Refusal::AccessLocked) }
    }

    fn seed(&mut self, fields: Fields<'_>) -> Result<Packet, Refusal> {
        let (mode, resource) = (fields.byte(1)?, fields.byte(2)?);
        if mode > 1 || mode == 0 && resource != CALIBRATION && resource != DAQ {
            return Err(Refusal::OutOfRange);
        }
        if mode == 0 && resource == DAQ {
            // Measuring needs no key.
            return Ok(response(&[0]));
        }
        let (left, [a, b, c, d, e, f]) = self.lock.seed(mode == 1)?;
        Ok(response(&[left, a, b, c, d, e, f]))
    }

    fn unlock(&mut self, fields: Fields<'_>) -> Result<Packet, Refusal> {
        let left = fields.byte(1)?;
        let part = fields.bytes(2, usize::from(left).min(WRITE_BYTES))?;
        match self.lock.check_key(left, part)? {
            KeyCheck::Incomplete => {}
            KeyCheck::Open => self.counters.unlocked += 1,
            KeyCheck::Wrong => {
                self.counters.wrong_keys += 1;
                self.end_session();
                return Err(Refusal::AccessLocked);
            }
        }
        Ok(response(&[self.protected()]))
    }

    fn upload(&mut self, count: u8) -> Result<Packet, Refusal> {
        let address = self.address.ok_or(Refusal::Sequence)?;
        let mut bytes = [0; BYTES - 1];
        let bytes = bytes.get_mut(..usize::from(count)).ok_or(Refusal::OutOfRange)?;
        self.image.read(address, bytes)?;
        self.address = Some(address + u32::from(count));
        Ok(response(bytes))
    }

    fn checksum(&mut self, count: u32) -> Result<Packet, Refusal> {
        let address = self.address.ok_or(Refusal::Sequence)?;
        if count == 0 || count > CHECKSUM_BYTES {
            return Err(Refusal::OutOfRange);
        }
        self.image.check_readable(address, count)?;
        let mut digest = CRC_32.digest();
        let mut piece = [0; 64];
        let mut at = 0;
        while at < count {
            let piece = &mut piece[..(count - at).min(64) as usize];
            self.image.read(address + at, piece)?;
            digest.update(piece);
            at += piece.len() as u32;
        }
        self.address = Some(address + count);
        let [a, b, c, d] = digest.finalize().to_le_bytes();
        Ok(response(&[CHECKSUM_CRC_32, 0, 0, a, b, c, d]))
    }

    /// DOWNLOAD and DOWNLOAD_NEXT; a block is answered at its end, or at its first error.
    fn write(
        &mut self,
        is_continuation: bool,
        fields: Fields<'_>,
        actions: &mut dyn ParameterActions,
    ) -> Result<Option<Packet>, Refusal> {
        let count = usize::from(fields.byte(1)?);
        let left = self.block.whole.saturating_sub(self.block.received);
        let wanted = std::mem::take(&mut self.block.whole);
        self.check_unlocked()?;
        let address = self.address.ok_or(Refusal::Sequence)?;
        // A block out of order would lose half of another one without an error.
        let in_order = if is_continuation { left > 0 && count == left } else { wanted == 0 };
        if !in_order {
            return Err(Refusal::Sequence);
        }
        if count == 0 {
            return Err(Refusal::OutOfRange);
        }
        let part = fields.bytes(2, count.min(WRITE_BYTES))?;
        let Block { bytes, received, whole } = &mut self.block;
        if !is_continuation {
            *received = 0;
        }
        bytes[*received..*received + part.len()].copy_from_slice(part);
        *received += part.len();
        let all = if is_continuation { wanted } else { count };
        if *received < all {
            *whole = all;
            return Ok(None);
        }
        self.image.write(address, &bytes[..all], actions)?;
        self.address = Some(address + all as u32);
        Ok(Some(response(&[])))
    }

    fn measure(&mut self, code: u8, fields: Fields<'_>, cycle: u64) -> Result<Packet, Refusal> {
        match code {
            command::FREE_DAQ => self.daq.free(),
            command::ALLOC_DAQ => self.daq.alloc_lists(fields.word(2)?)?,
            command::ALLOC_ODT => self.daq.alloc_odts(fields.word(2)?, fields.byte(4)?)?,
            command::ALLOC_ODT_ENTRY => {
                self.daq.alloc_entries(fields.word(2)?, fields.byte(4)?, fields.byte(5)?)?;
            }
            command::CLEAR_DAQ_LIST => self.daq.clear(fields.word(2)?)?,
            command::SET_DAQ_PTR => self.daq.point(fields.word(2)?, fields.byte(4)?, fields.byte(5)?)?,
            command::WRITE_DAQ => {
                let (bit, size) = (fields.byte(1)?, fields.byte(2)?);
                if bit != 0xFF {
                    return Err(Refusal::OutOfRange);
                }
                self.daq.write(&self.image, Entry { address: address(fields, 3)?, size })?;
            }
            command::READ_DAQ => {
                let Entry { address, size } = self.daq.read()?;
                let [a, b, c, d] = address.to_le_bytes();
                return Ok(response(&[0xFF, size, 0, a, b, c, d]));
            }
            command::SET_DAQ_LIST_MODE => {
                let (mode, prescaler, priority) = (fields.byte(1)?, fields.byte(6)?, fields.byte(7)?);
                let asked = ListMode { mode, prescaler, priority };
                self.daq.set_mode(fields.word(2)?, fields.word(4)?, asked)?;
            }
            command::GET_DAQ_LIST_MODE => {
                let ListMode { mode, prescaler, priority } = self.daq.mode(fields.word(2)?)?;
                return Ok(response(&[mode, 0, 0, 0, 0, prescaler, priority]));
            }
            command::START_STOP_DAQ_LIST => {
                let first = self.daq.start_stop(fields.byte(1)?, fields.word(2)?)?;
                return Ok(response(&[first]));
            }
            command::START_STOP_SYNCH => self.daq.start_stop_selected(fields.byte(1)?)?,
            command::GET_DAQ_CLOCK => {
                let [a, b, c, d] = (cycle as u32).to_le_bytes();
                return Ok(response(&[0, 0, 0, a, b, c, d]));
            }
            command::GET_DAQ_PROCESSOR_INFO => {
                // Lists at most, one event, none fixed; a packet begins with the number of its ODT.
                return Ok(response(&[DAQ_PROPERTIES, LISTS as u8, 0, 1, 0, 0, 0]));
            }
            command::GET_DAQ_RESOLUTION_INFO => {
                let stamp = UNIT_1_MS << 4 | STAMP_BYTES as u8;
                return Ok(response(&[1, LONGEST_ENTRY, 1, 0, stamp, 1, 0]));
            }
            command::GET_DAQ_EVENT_INFO => {
                if fields.word(2)? != 0 {
                    return Err(Refusal::OutOfRange);
                }
                let (offset, length) = self.texts.event;
                self.address = Some(DESCRIPTION + offset);
                // DAQ, all lists, one cycle of 1 ms, lowest priority but one.
                return Ok(response(&[0x04, LISTS as u8, length as u8, 1, UNIT_1_MS, 0]));
            }
            _ => return Err(Refusal::Unknown),
        }
        Ok(response(&[]))
    }
}

/// The address after its extension at `at`, which must be 0.
fn address(fields: Fields<'_>, at: usize) -> Result<u32, Refusal> {
    let (extension, address) = (fields.byte(at)?, fields.long(at + 1)?);
    if extension == 0 { Ok(address) } else { Err(Refusal::AccessDenied) }
}

#[cfg(test)]
mod tests;
