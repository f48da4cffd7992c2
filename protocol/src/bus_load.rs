//! Bus load: whether everything that `rig.dbc` sends in cycles fits on the wire, counted for the worst case of bit stuffing.
//!
//! ```text
//! bits(n) = 34 + 8 n + 13 + floor((34 + 8 n - 1) / 4)     classic frame, 11-bit identifier, n bytes
//! load    = sum over cyclic frames of bits / period, and one DAQ frame of 8 bytes each ms in reserve
//! ```
//!
//! 34 bits from start of frame to CRC without data are stuffed, 13 (delimiters, acknowledge, end of frame, intermission) are
//! not. Worst-case stuffing adds a bit for each four after the first. A frame that is sent only while its cause lasts (emergency
//! stop) counts as if it always did; frames sent on a change or an event are not cyclic and not counted.
//!
//! Frames of one period may fall into the same millisecond. That [`FULLEST_MILLISECOND_BITS`] may exceed what a millisecond
//! carries: then arbitration sends the lower identifiers, which are the faster frames, and the rest waits for [`BACKLOG_MS`].
//!
//! Source: Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis: Refuted, revisited and
//! revised", Real-Time Systems 35 (2007), eq. 1.

use std::fmt;

use crate::frames::{BIT_RATE_PER_S, MESSAGES, MessageSpec};

/// Highest share of the bus that cyclic frames and reserve may take, in parts per million.
pub(crate) const LOAD_LIMIT_PPM: u64 = 700_000;

/// Cyclic load with reserve, in parts per million of the bus.
const LOAD_PPM: u64 = load_ppm_at(BIT_RATE_PER_S);

/// Worst-case bits of the DAQ frame that is held in reserve each millisecond.
pub(crate) const RESERVE_BITS: u32 = worst_case_bits(8);

/// Worst-case bits when every cyclic frame, and the reserve, falls into the same millisecond.
const FULLEST_MILLISECOND_BITS: u32 = sum_of_cyclic_bits(u32::MAX) + RESERVE_BITS;

/// Milliseconds, the fullest one included, until everything of it was sent.
const BACKLOG_MS: u32 = backlog_ms();

/// Capacity of the bus in one millisecond, bits.
const BITS_PER_MS: u32 = BIT_RATE_PER_S / 1000;

// A load below 70 % leaves room for frames on change, events and repeated frames after an error.
const _: () = assert!(LOAD_PPM < LOAD_LIMIT_PPM, "cyclic frames of rig.dbc exceed the bus load limit");
// Sensors and commands reach their receiver within their millisecond, even in the fullest one: what outranks them, all
// of them, and one longest frame that was already on the wire fit in.
const _: () =
    assert!(bits_down_to_fastest() + worst_case_bits(8) <= BITS_PER_MS, "1 ms frames exceed their ms");

/// Worst-case bits on the wire of a classic frame with an 11-bit identifier and `bytes` bytes of data, intermission included.
#[must_use]
pub const fn worst_case_bits(bytes: u8) -> u32 {
    let stuffed = 34 + 8 * bytes as u32;
    stuffed + 13 + (stuffed - 1) / 4
}

/// Worst-case bits of all cyclic frames with a period of at most `period_ms`.
const fn sum_of_cyclic_bits(period_ms: u32) -> u32 {
    let (mut bits, mut index) = (0, 0);
    while index < MESSAGES.len() {
        let message = MESSAGES[index];
        if message.cycle_time_ms > 0 && message.cycle_time_ms <= period_ms {
            bits += worst_case_bits(message.length);
        }
        index += 1;
    }
    bits
}

/// Worst-case bits of all cyclic frames that outrank or are the last of the 1 ms frames.
const fn bits_down_to_fastest() -> u32 {
    let (mut bits, mut bits_so_far, mut index) = (0, 0, 0);
    // MESSAGES is in the order of identifiers, which is that of arbitration.
    while index < MESSAGES.len() {
        let message = MESSAGES[index];
        if message.cycle_time_ms > 0 {
            bits_so_far += worst_case_bits(message.length);
        }
        if message.cycle_time_ms == 1 {
            bits = bits_so_far;
        }
        index += 1;
    }
    bits
}

/// Share of a bus of `bits_per_s` that a frame of so many bits takes each period, in parts per million.
pub(crate) const fn share_ppm_at(bits: u32, period_ms: u32, bits_per_s: u32) -> u64 {
    (bits as u64 * 1_000_000_000).div_ceil(period_ms as u64 * bits_per_s as u64)
}

/// Cyclic load with reserve at `bits_per_s`, in parts per million of the bus.
pub(crate) const fn load_ppm_at(bits_per_s: u32) -> u64 {
    let (mut ppm, mut index) = (share_ppm_at(RESERVE_BITS, 1, bits_per_s), 0);
    while index < MESSAGES.len() {
        let message = MESSAGES[index];
        if message.cycle_time_ms > 0 {
            ppm += share_ppm_at(worst_case_bits(message.length), message.cycle_time_ms, bits_per_s);
        }
        index += 1;
    }
    ppm
}

const fn backlog_ms() -> u32 {
    let each_ms = sum_of_cyclic_bits(1) + RESERVE_BITS;
    1 + FULLEST_MILLISECOND_BITS.saturating_sub(BITS_PER_MS).div_ceil(BITS_PER_MS - each_ms)
}

/// The load of all that `rig.dbc` sends in cycles, as a table for people: one line for each cyclic frame, sum, reserve, fullest
/// millisecond.
#[derive(Clone, Copy, Debug)]
pub struct BusLoad;

impl fmt::Display for BusLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |ppm: u64| ppm as f64 / 1e4;
        writeln!(
            f,
            "{:<22} {:>5} {:>5} {:>5} {:>9} {:>8}",
            "frame", "id", "bytes", "bits", "period_ms", "share_%"
        )?;
        for message in MESSAGES.iter().filter(|message| message.cycle_time_ms > 0) {
            let MessageSpec { name, id, length, cycle_time_ms, .. } = message;
            let bits = worst_case_bits(*length);
            let share = percent(share_ppm_at(bits, *cycle_time_ms, BIT_RATE_PER_S));
            writeln!(f, "{name:<22} {id:#05X} {length:>5} {bits:>5} {cycle_time_ms:>9} {share:>8.2}")?;
        }
        let reserve = share_ppm_at(RESERVE_BITS, 1, BIT_RATE_PER_S);
        let (name, sum) = ("reserve: one DAQ frame", percent(LOAD_PPM - reserve));
        writeln!(f, "{:<22} {:>36.2}", "sum of cyclic frames", sum)?;
        writeln!(f, "{name:<22} {:>5} {:>5} {RESERVE_BITS:>5} {:>9} {:>8.2}", "", 8, 1, percent(reserve))?;
        writeln!(f, "{:<22} {:>36.2}   limit {:.0}", "load", percent(LOAD_PPM), percent(LOAD_LIMIT_PPM))?;
        write!(
            f,
            "fullest millisecond: {FULLEST_MILLISECOND_BITS} bits, {:.1} % of what it carries; sent after {BACKLOG_MS} ms",
            100.0 * f64::from(FULLEST_MILLISECOND_BITS) / f64::from(BITS_PER_MS)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worst_case_bits_are_those_of_the_contract() {
        assert_eq!([4, 5, 8].map(worst_case_bits), [95, 105, 135]);
    }

    #[test]
    fn messages_stand_in_the_order_of_arbitration() {
        assert!(MESSAGES.is_sorted_by(|one, other| one.id < other.id));
    }

    /// By hand: per ms 2 commands of 105, 2 sensors of 135 and the reserve of 135; per 10 ms Tick 125, RigStatus 95,
    /// 2 ChainStatus of 105, 2 ChainValues of 135; per 100 ms 4 emergency stops of 75.
    #[test]
    fn load_is_the_sum_made_by_hand() {
        let bits_per_ms = 615.0 + (125.0 + 95.0 + 210.0 + 270.0) / 10.0 + 300.0 / 100.0;
        assert_eq!(LOAD_PPM as f64, bits_per_ms * 1e6 / 1000.0);
        assert_eq!(FULLEST_MILLISECOND_BITS, 615 + 125 + 95 + 210 + 270 + 300);
        // 615 bits are left over, 385 can be made up in each ms.
        assert_eq!(BACKLOG_MS, 1 + 2);
    }

    #[test]
    fn table_shows_each_cyclic_frame_and_the_sums() {
        let table = BusLoad.to_string();
        for message in MESSAGES {
            assert_eq!(table.contains(message.name), message.cycle_time_ms > 0, "{}", message.name);
        }
        for text in ["0x110", "load", "68.80", "limit 70", "fullest millisecond: 1615 bits, 161.5 %"] {
            assert!(table.contains(text), "{text} is not in\n{table}");
        }
    }
}
