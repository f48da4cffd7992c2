//! DAQ lists: measurements that the slave sends by itself, every cycle or every `prescaler` cycles.
//!
//! ```text
//!   FREE_DAQ ─► ALLOC_DAQ ─► ALLOC_ODT ─► ALLOC_ODT_ENTRY ─► SET_DAQ_PTR, WRITE_DAQ ─► mode, start ─► packets
//!
//!   packet = number of the ODT | time stamp, 2 bytes, in the first ODT of a list if asked for | up to 7 bytes of entries
//! ```
//!
//! All entries of a list are sampled in the same cycle, after the answer to the sensors. A limited number of packets is sent per
//! cycle, to keep the reserve of the bus; the others follow in the next cycles. Lists whose mean rate exceeds that limit are
//! refused at their start ([`Refusal::DaqConfig`]). The time stamp is the rig's cycle, low 16 bits.
//!
//! All memory is allocated at the start.

use crate::image::Image;
use crate::packet::{BYTES, LAST_PID, Packet, Refusal};
use std::collections::VecDeque;

/// Largest number of DAQ lists.
pub(crate) const LISTS: usize = 8;
/// Most ODTs of all lists together; each has one packet.
pub(crate) const ODTS: usize = 32;
/// Most entries of an ODT.
pub(crate) const ENTRIES: usize = 7;
/// Longest entry, bytes.
pub(crate) const LONGEST_ENTRY: u8 = 7;
pub(crate) const STAMP_BYTES: usize = 2;
/// Capacity of the transmit queue, packets.
const ROOM: usize = 2 * ODTS;

/// Bit of a list's mode: with time stamps. A client can set no other one.
const MODE_STAMP: u8 = 0x10;
/// Bits of a list's mode in the response to the master: selected, running.
const SELECTED: u8 = 0x01;
const RUNNING: u8 = 0x40;

const _: () = assert!(ODTS <= LAST_PID as usize, "an ODT's number is its packet's first byte");

/// An entry of an ODT: the memory that is sent.
#[derive(Clone, Copy, Default)]
pub(crate) struct Entry {
    pub address: u32,
    /// Bytes; 0 for an entry that was not written.
    pub size: u8,
}

#[derive(Clone, Copy, Default)]
struct Odt {
    entries: [Entry; ENTRIES],
    count: usize,
}

#[derive(Clone, Copy, Default)]
struct List {
    first: usize,
    odts: usize,
    mode: u8,
    prescaler: u8,
    priority: u8,
    selected: bool,
    running: bool,
    /// Cycles until its next sample.
    wait: u8,
}

/// Progress of the allocation, whose commands come in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
enum AllocationStage {
    #[default]
    Initial,
    Freed,
    Lists,
    Odts,
    Entries,
}

/// All lists, and the queue of their packets.
#[derive(Clone, Default)]
pub(crate) struct Daq {
    pub(crate) per_cycle: u32,
    stage: AllocationStage,
    lists: [List; LISTS],
    count: usize,
    odts: [Odt; ODTS],
    used: usize,
    pointer: Option<(usize, usize)>,
    waiting: VecDeque<Packet>,
    /// Packets lost to a full queue; the admission at the start keeps it 0.
    pub(crate) dropped: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ListMode {
    /// Bits as they stand in the response.
    pub mode: u8,
    /// Cycles from sample to sample.
    pub prescaler: u8,
    /// As the client set it; it has no effect.
    pub priority: u8,
}

impl Daq {
    /// No lists; `per_cycle` packets may be sent in a cycle.
    pub(crate) fn new(per_cycle: u32) -> Self {
        Self { per_cycle, waiting: VecDeque::with_capacity(ROOM), ..Self::default() }
    }

    pub(crate) fn runs(&self) -> bool {
        self.lists[..self.count].iter().any(|list| list.running)
    }

    fn idle(&self) -> Result<(), Refusal> {
        if self.runs() { Err(Refusal::DaqActive) } else { Ok(()) }
    }

    /// Frees all lists; running ones stop.
    pub(crate) fn free(&mut self) {
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.clear();
        let Self { per_cycle, dropped, .. } = *self;
        *self = Self { per_cycle, stage: AllocationStage::Freed, waiting, dropped, ..Self::default() };
    }

    /// Allocates `count` lists.
    ///
    /// # Errors
    /// [`Refusal::Sequence`] out of order, [`Refusal::MemoryOverflow`] beyond [`LISTS`].
    pub(crate) fn alloc_lists(&mut self, count: u16) -> Result<(), Refusal> {
        self.in_order(AllocationStage::Freed, AllocationStage::Freed, AllocationStage::Lists)?;
        if usize::from(count) > LISTS {
            return Err(Refusal::MemoryOverflow);
        }
        self.count = usize::from(count);
        self.lists = [List { prescaler: 1, ..List::default() }; LISTS];
        Ok(())
    }

    /// Allocates `count` ODTs of a list.
    ///
    /// # Errors
    /// [`Refusal::Sequence`] out of order or again, [`Refusal::OutOfRange`] for no such list, [`Refusal::MemoryOverflow`] beyond
    /// [`ODTS`].
    pub(crate) fn alloc_odts(&mut self, list: u16, count: u8) -> Result<(), Refusal> {
        let place = self.list(list)?;
        if self.lists[place].odts > 0 {
            return Err(Refusal::Sequence);
        }
        self.in_order(AllocationStage::Lists, AllocationStage::Odts, AllocationStage::Odts)?;
        let count = usize::from(count);
        if self.used + count > ODTS {
            return Err(Refusal::MemoryOverflow);
        }
        (self.lists[place].first, self.lists[place].odts) = (self.used, count);
        self.used += count;
        Ok(())
    }

    /// Allocates `count` entries of an ODT.
    ///
    /// # Errors
    /// As [`Daq::alloc_odts`]; [`Refusal::DaqActive`] while a list runs.
    pub(crate) fn alloc_entries(&mut self, list: u16, odt: u8, count: u8) -> Result<(), Refusal> {
        self.idle()?;
        let odt = self.odt(list, odt)?;
        self.in_order(AllocationStage::Odts, AllocationStage::Entries, AllocationStage::Entries)?;
        if usize::from(count) > ENTRIES {
            return Err(Refusal::MemoryOverflow);
        }
        self.odts[odt] = Odt { count: usize::from(count), ..Odt::default() };
        Ok(())
    }

    fn in_order(
        &mut self,
        least: AllocationStage,
        most: AllocationStage,
        then: AllocationStage,
    ) -> Result<(), Refusal> {
        if !(least..=most).contains(&self.stage) {
            return Err(Refusal::Sequence);
        }
        self.stage = then;
        Ok(())
    }

    fn list(&self, list: u16) -> Result<usize, Refusal> {
        let list = usize::from(list);
        if list < self.count { Ok(list) } else { Err(Refusal::OutOfRange) }
    }

    fn odt(&self, list: u16, odt: u8) -> Result<usize, Refusal> {
        let List { first, odts, .. } = self.lists[self.list(list)?];
        if usize::from(odt) < odts { Ok(first + usize::from(odt)) } else { Err(Refusal::OutOfRange) }
    }

    /// Empties the entries of a list; it stops.
    pub(crate) fn clear(&mut self, list: u16) -> Result<(), Refusal> {
        let place = self.list(list)?;
        let List { first, odts, .. } = self.lists[place];
        (self.lists[place].running, self.lists[place].selected) = (false, false);
        self.odts[first..first + odts].iter_mut().for_each(|odt| odt.entries = [Entry::default(); ENTRIES]);
        Ok(())
    }

    /// Sets the entry that is written or read next.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] for no such entry, [`Refusal::DaqActive`] while a list runs.
    pub(crate) fn point(&mut self, list: u16, odt: u8, entry: u8) -> Result<(), Refusal> {
        self.idle()?;
        self.pointer = None;
        let odt = self.odt(list, odt)?;
        if usize::from(entry) >= self.odts[odt].count {
            return Err(Refusal::OutOfRange);
        }
        self.pointer = Some((odt, usize::from(entry)));
        Ok(())
    }

    /// Writes the next entry.
    ///
    /// # Errors
    /// [`Refusal::Sequence`] with none pointed at; [`Refusal::OutOfRange`] for a size that no packet holds, alone or with the
    /// others of its ODT; [`Refusal::AccessDenied`] for memory that is not there; [`Refusal::DaqActive`] while a list runs.
    pub(crate) fn write(&mut self, image: &Image, entry: Entry) -> Result<(), Refusal> {
        self.idle()?;
        let (odt, place) = self.pointer.ok_or(Refusal::Sequence)?;
        if entry.size == 0 || entry.size > LONGEST_ENTRY {
            return Err(Refusal::OutOfRange);
        }
        image.check_readable(entry.address, u32::from(entry.size))?;
        let odt_entries = &mut self.odts[odt];
        let before = std::mem::replace(&mut odt_entries.entries[place], entry);
        if odt_entries.bytes() >= BYTES {
            odt_entries.entries[place] = before;
            return Err(Refusal::OutOfRange);
        }
        self.advance_pointer(odt, place);
        Ok(())
    }

    /// Reads the next entry.
    ///
    /// # Errors
    /// [`Refusal::Sequence`] with none pointed at.
    pub(crate) fn read(&mut self) -> Result<Entry, Refusal> {
        let (odt, place) = self.pointer.ok_or(Refusal::Sequence)?;
        self.advance_pointer(odt, place);
        Ok(self.odts[odt].entries[place])
    }

    fn advance_pointer(&mut self, odt: usize, place: usize) {
        self.pointer = (place + 1 < self.odts[odt].count).then_some((odt, place + 1));
    }

    /// Sets how a list is run: its mode (time stamps or none), the event, of which there is one, its prescaler and priority.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] for anything that is not offered, [`Refusal::DaqActive`] while the list runs.
    pub(crate) fn set_mode(&mut self, list: u16, event: u16, asked: ListMode) -> Result<(), Refusal> {
        let place = self.list(list)?;
        if self.lists[place].running {
            return Err(Refusal::DaqActive);
        }
        let ListMode { mode, prescaler, priority } = asked;
        if event != 0 || mode & !MODE_STAMP != 0 || prescaler == 0 {
            return Err(Refusal::OutOfRange);
        }
        self.lists[place] = List { mode, prescaler, priority, ..self.lists[place] };
        Ok(())
    }

    pub(crate) fn mode(&self, list: u16) -> Result<ListMode, Refusal> {
        let List { mode, prescaler, priority, selected, running, .. } = self.lists[self.list(list)?];
        let bit = |is: bool, bit: u8| if is { bit } else { 0 };
        let mode = mode | bit(selected, SELECTED) | bit(running, RUNNING);
        Ok(ListMode { mode, prescaler, priority })
    }

    /// Stops (0), starts (1) or selects (2) a list; returns the number of its first packet.
    ///
    /// # Errors
    /// [`Refusal::DaqConfig`] for a list without ODTs, for one whose entries exceed a packet, and where the mean rate of all
    /// running lists would exceed the limit.
    pub(crate) fn start_stop(&mut self, mode: u8, list: u16) -> Result<u8, Refusal> {
        let place = self.list(list)?;
        match mode {
            0 => self.lists[place].running = false,
            1 => {
                self.check(place)?;
                self.admit(|other, list| other == place || list.running)?;
                self.start(place);
            }
            2 => {
                self.check(place)?;
                self.lists[place].selected = true;
            }
            _ => return Err(Refusal::OutOfRange),
        }
        Ok(self.lists[place].first as u8)
    }

    /// Stops all (0), starts (1) or stops (2) the selected lists.
    ///
    /// # Errors
    /// As [`Daq::start_stop`]; none is started then.
    pub(crate) fn start_stop_selected(&mut self, mode: u8) -> Result<(), Refusal> {
        match mode {
            0 => self.stop(),
            1 => {
                // Again: mode and entries may have changed since they were selected.
                for place in (0..self.count).filter(|place| self.lists[*place].selected) {
                    self.check(place)?;
                }
                self.admit(|_, list| list.selected || list.running)?;
                for place in 0..self.count {
                    if std::mem::take(&mut self.lists[place].selected) {
                        self.start(place);
                    }
                }
            }
            2 => {
                for list in &mut self.lists[..self.count] {
                    if std::mem::take(&mut list.selected) {
                        list.running = false;
                    }
                }
            }
            _ => return Err(Refusal::OutOfRange),
        }
        Ok(())
    }

    pub(crate) fn stop(&mut self) {
        self.lists.iter_mut().for_each(|list| (list.running, list.selected) = (false, false));
    }

    fn start(&mut self, place: usize) {
        (self.lists[place].running, self.lists[place].wait) = (true, 0);
    }

    /// Whether a list has ODTs and each fits its packet.
    fn check(&self, place: usize) -> Result<(), Refusal> {
        let List { first, odts, mode, .. } = self.lists[place];
        let mut head = 1 + if mode & MODE_STAMP != 0 { STAMP_BYTES } else { 0 };
        for odt in &self.odts[first..first + odts] {
            if head + odt.bytes() > BYTES {
                return Err(Refusal::DaqConfig);
            }
            head = 1;
        }
        if odts == 0 { Err(Refusal::DaqConfig) } else { Ok(()) }
    }

    /// Whether the mean rate of these lists, packets per cycle, is within the limit; in millionths, without floating point.
    fn admit(&self, of: impl Fn(usize, &List) -> bool) -> Result<(), Refusal> {
        let lists = self.lists[..self.count].iter().enumerate().filter(|(place, list)| of(*place, list));
        // Each term is rounded up, so that the sum is never too small.
        let parts: u64 = lists
            .map(|(_, list)| (list.odts as u64 * 1_000_000).div_ceil(u64::from(list.prescaler.max(1))))
            .sum();
        // Rounding adds less than one millionth for each list.
        if parts <= u64::from(self.per_cycle) * 1_000_000 + LISTS as u64 {
            Ok(())
        } else {
            Err(Refusal::DaqConfig)
        }
    }

    /// Samples the lists that are due in a cycle and queues their packets.
    pub(crate) fn cycle(&mut self, cycle: u64, image: &Image) {
        for place in 0..self.count {
            let list = &mut self.lists[place];
            if !list.running {
                continue;
            }
            if list.wait > 0 {
                list.wait -= 1;
                continue;
            }
            list.wait = list.prescaler - 1;
            let List { first, odts, mode, .. } = *list;
            for number in first..first + odts {
                let stamped = number == first && mode & MODE_STAMP != 0;
                self.queue(self.packet(number, stamped.then_some(cycle), image));
            }
        }
    }

    fn packet(&self, number: usize, stamp: Option<u64>, image: &Image) -> Packet {
        let mut packet = [0; BYTES];
        packet[0] = number as u8;
        let mut at = 1;
        if let Some(cycle) = stamp {
            packet[1..3].copy_from_slice(&(cycle as u16).to_le_bytes());
            at += STAMP_BYTES;
        }
        let Odt { entries, count } = &self.odts[number];
        for entry in &entries[..*count] {
            let size = usize::from(entry.size);
            // Checked when the entry was written; regions do not change.
            let _ = image.read(entry.address, &mut packet[at..at + size]);
            at += size;
        }
        packet
    }

    fn queue(&mut self, packet: Packet) {
        if self.waiting.len() == ROOM {
            self.dropped += 1;
        } else {
            self.waiting.push_back(packet);
        }
    }

    pub(crate) fn next_packet(&mut self) -> Option<Packet> {
        self.waiting.pop_front()
    }
}

impl Odt {
    fn bytes(&self) -> usize {
        self.entries[..self.count].iter().map(|entry| usize::from(entry.size)).sum()
    }
}

#[cfg(test)]
mod tests;
