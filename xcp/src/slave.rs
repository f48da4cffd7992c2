//! The XCP slave: packets in, packets out, over a memory and nothing else.
//!
//! ```text
//!   command(packet, cycle, actions) ─► answer or none     any bytes, at any time
//!   cycle(cycle, signals, parameters)                     after each answer to the rig
//!   next_daq() ─► packet or none                          what DAQ lists have to send
//! ```
//!
//! It knows no bus, no clock, no controller: what it changes it tells its [`ParameterActions`]. Whatever the bytes are, it
//! answers, refuses or keeps silent, and a session that is not open answers CONNECT alone. Nothing here allocates, locks,
//! prints or blocks.
//!
//! Source: ASAM MCD-1 XCP 1.1, part 2.

use crate::daq::{Daq, Entry, LISTS, LONGEST_ENTRY, ListMode, STAMP_BYTES};
use crate::image::{DESCRIPTION, Image, ParameterActions};
use crate::lock::{Lock, Turned};
use crate::packet::{BYTES, EVENT, EVENT_STORED, Fields, Packet, Refusal, command, refusal, response};
use crate::signals::COUNT;
use crc::{CRC_32_ISO_HDLC, Crc};

/// What can be written: calibration. What can be read by itself: DAQ.
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
/// Most bytes of a checksum; more would be felt in the cycle.
const CHECKSUM_BYTES: u32 = 4096;
/// Dynamic lists, prescaler, time stamps.
const DAQ_PROPERTIES: u8 = 0x13;
/// Unit of time stamps and of the event: 1 ms.
const UNIT_1_MS: u8 = 6;
/// Cycles without a command after which writing wants a key again: a minute.
const IDLE_CYCLES: u64 = 60_000;
/// Version of the protocol layer and of the layer below it.
const VERSION: u8 = 1;

static CRC_32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Where the texts of the description lie, within it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Texts {
    /// The A2L file: offset and bytes.
    pub a2l: (u32, u32),
    /// Its name, without the path.
    pub file: (u32, u32),
    /// Which controller, program and tables this is.
    pub epk: (u32, u32),
    pub event: (u32, u32),
}

pub(crate) struct SlaveParts {
    pub image: Image,
    pub texts: Texts,
    pub lock: Lock,
    /// DAQ packets that may leave in a cycle.
    pub daq_per_cycle: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SlaveCounters {
    pub sessions: u64,
    /// Commands that were answered well.
    pub answered: u64,
    pub refused: u64,
    pub unlocked: u64,
    pub wrong_keys: u64,
    /// DAQ packets handed out.
    pub daq_packets: u64,
}

/// A block that is being written.
#[derive(Clone)]
struct Block {
    bytes: [u8; BLOCK],
    had: usize,
    whole: usize,
}

#[derive(Clone)]
pub struct Slave {
    image: Image,
    texts: Texts,
    lock: Lock,
    pub(crate) daq: Daq,
    connected: bool,
    storing: bool,
    idle: u64,
    /// Where the next transfer begins; `None` until it is set.
    address: Option<u32>,
    block: Block,
    counters: SlaveCounters,
}

impl Slave {
    /// A slave without a session.
    pub(crate) fn new(parts: SlaveParts) -> Self {
        let SlaveParts { image, texts, lock, daq_per_cycle } = parts;
        Self {
            image,
            texts,
            lock,
            daq: Daq::new(daq_per_cycle),
            connected: false,
            storing: false,
            idle: 0,
            address: None,
            block: Block { bytes: [0; BLOCK], had: 0, whole: 0 },
            counters: SlaveCounters::default(),
        }
    }

    pub fn image(&self) -> &Image {
        &self.image
    }

    pub fn is_unlocked(&self) -> bool {
        self.lock.is_open()
    }

    pub(crate) fn counters(&self) -> &SlaveCounters {
        &self.counters
    }

    /// A cycle was answered: takes its signals and the parameters as they are now.
    pub fn cycle(&mut self, cycle: u64, signals: &[f64; COUNT], parameters: &[f64]) {
        self.image.refresh(cycle, signals, parameters);
        self.lock.cycle();
        self.idle += 1;
        if self.idle >= IDLE_CYCLES {
            self.lock.shut();
        }
        self.daq.cycle(cycle, &self.image);
    }

    pub(crate) fn restart(&mut self) {
        self.image.restart();
    }

    pub fn next_daq(&mut self) -> Option<Packet> {
        let packet = self.daq.next_packet()?;
        self.counters.daq_packets += 1;
        Some(packet)
    }

    /// The parameter set was stored: the event that tells so.
    pub(crate) fn stored(&mut self) -> Option<Packet> {
        self.storing = false;
        self.connected.then_some([EVENT, EVENT_STORED, 0, 0, 0, 0, 0, 0])
    }

    /// The answer to a packet of any bytes, received in `cycle`; `None` where none is due.
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
        // Whoever comes finds a session without a past: shut, no lists that run.
        self.leave();
        self.daq.free();
        (self.connected, self.idle) = (true, 0);
        self.counters.sessions += 1;
        // Intel, address granularity of a byte, no slave block mode, GET_COMM_MODE_INFO can be asked for.
        let basic = 0x80;
        response(&[CALIBRATION | DAQ, basic, BYTES as u8, BYTES as u8, 0, VERSION, VERSION])
    }

    fn leave(&mut self) {
        self.connected = false;
        self.lock.shut();
        self.daq.stop();
        // What waits is for nobody.
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
                self.leave();
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

    /// Resources that want a key.
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
            // Measuring is open to everybody.
            return Ok(response(&[0]));
        }
        let (left, [a, b, c, d, e, f]) = self.lock.seed(mode == 1)?;
        Ok(response(&[left, a, b, c, d, e, f]))
    }

    fn unlock(&mut self, fields: Fields<'_>) -> Result<Packet, Refusal> {
        let left = fields.byte(1)?;
        let part = fields.bytes(2, usize::from(left).min(WRITE_BYTES))?;
        match self.lock.turn(left, part)? {
            Turned::Halfway => {}
            Turned::Open => self.counters.unlocked += 1,
            Turned::Wrong => {
                self.counters.wrong_keys += 1;
                self.leave();
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

    /// A packet that writes; a block is answered at its end, or where it goes wrong.
    fn write(
        &mut self,
        goes_on: bool,
        fields: Fields<'_>,
        actions: &mut dyn ParameterActions,
    ) -> Result<Option<Packet>, Refusal> {
        let count = usize::from(fields.byte(1)?);
        let left = self.block.whole.saturating_sub(self.block.had);
        let wanted = std::mem::take(&mut self.block.whole);
        self.check_unlocked()?;
        let address = self.address.ok_or(Refusal::Sequence)?;
        // Neither a rest that is not the one awaited, nor another block in the midst of one: half of it would be lost unnoticed.
        let in_order = if goes_on { left > 0 && count == left } else { wanted == 0 };
        if !in_order {
            return Err(Refusal::Sequence);
        }
        if count == 0 {
            return Err(Refusal::OutOfRange);
        }
        let part = fields.bytes(2, count.min(WRITE_BYTES))?;
        let Block { bytes, had, whole } = &mut self.block;
        if !goes_on {
            *had = 0;
        }
        bytes[*had..*had + part.len()].copy_from_slice(part);
        *had += part.len();
        let all = if goes_on { wanted } else { count };
        if *had < all {
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

/// An address at `at`, behind its extension, which is 0 here.
fn address(fields: Fields<'_>, at: usize) -> Result<u32, Refusal> {
    let (extension, address) = (fields.byte(at)?, fields.long(at + 1)?);
    if extension == 0 { Ok(address) } else { Err(Refusal::AccessDenied) }
}

#[cfg(test)]
mod tests;
