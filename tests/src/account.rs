//! Accounts of frames by what a listener heard: what must have been lost between two of them.
//!
//! It repeats the products' sums from another place and in another way: from a trace of all frames that passed the wire,
//! with the numbers that senders put into them.

use protocol::can::CanFrame;
use protocol::frames::{Frame, Tick};

/// What a trace shows of the sensor frames of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorAccount {
    /// Frames that the first tick says were sent by then, and that were not heard.
    pub missing_before_first_tick: u64,
    /// Frames missing between the first and the last tick.
    pub missing_between_ticks: u64,
}

/// The account of the sensor frames with identifier `id`, from the beginning of the run to the last tick heard.
pub fn of_sensors(received: &[CanFrame], id: u16) -> SensorAccount {
    let mut frames = 0;
    let mut at_ticks = Vec::new();
    for frame in received {
        match Frame::decode(frame) {
            Ok(Frame::Tick(tick)) => at_ticks.push((sent_by(&tick), frames)),
            _ if frame.standard_id() == Some(id) => frames += 1,
            _ => {}
        }
    }
    let ((sent_first, received_first), (sent_last, received_last)) =
        (at_ticks[0], *at_ticks.last().expect("at least one tick"));
    SensorAccount {
        missing_before_first_tick: sent_first - received_first,
        missing_between_ticks: sent_last - sent_first - (received_last - received_first),
    }
}

/// Sensor frames of an axis that were sent before `tick`: one for each cycle that was not skipped. The tick of a catch-up
/// and the last one come before the sensors of the cycle that they name.
fn sent_by(tick: &Tick) -> u64 {
    let named = u64::from(!(tick.catch_up || tick.ending));
    u64::from(tick.cycle) + named - u64::from(tick.skipped)
}

/// Counters of the valve commands with identifier `id`, in the order heard.
pub fn command_counters(received: &[CanFrame], id: u16) -> Vec<u8> {
    let commands = received.iter().filter(|frame| frame.standard_id() == Some(id));
    commands
        .filter_map(|frame| match Frame::decode(frame) {
            Ok(Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command)) => Some(command.alive),
            _ => None,
        })
        .collect()
}

/// Frames missing between the first and the last of `counters`, which count modulo 16, none missing 16 in a row.
pub fn gaps(counters: &[u8]) -> u64 {
    counters.windows(2).map(|pair| u64::from((pair[1] + 15 - pair[0]) % 16)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(cycle: u32, skipped: u16, ending: bool) -> CanFrame {
        Frame::Tick(Tick { cycle, skipped, ending, ..Tick::default() }).encode().unwrap()
    }

    #[test]
    fn what_is_missing_is_counted_on_its_side_of_the_first_tick() {
        let sensors = CanFrame::new(0x120, &[0; 8]);
        // Cycles 0 to 10, of which one is missing; 11 to 20, of which two were skipped and three are missing.
        let received =
            [vec![sensors; 10], vec![tick(10, 0, false)], vec![sensors; 5], vec![tick(20, 2, false)]]
                .concat();
        let expected = SensorAccount { missing_before_first_tick: 1, missing_between_ticks: 3 };
        assert_eq!(of_sensors(&received, 0x120), expected);
    }

    #[test]
    fn the_last_tick_names_a_cycle_that_was_not_sent() {
        let sensors = CanFrame::new(0x121, &[0; 8]);
        let received =
            [vec![sensors], vec![tick(0, 0, false)], vec![sensors; 4], vec![tick(5, 0, true)]].concat();
        let expected = SensorAccount { missing_before_first_tick: 0, missing_between_ticks: 0 };
        assert_eq!(of_sensors(&received, 0x121), expected);
    }

    #[test]
    fn gaps_of_a_counter_are_summed_over_its_turns() {
        assert_eq!(gaps(&[14, 15, 0, 3, 4]), 2);
        assert_eq!(gaps(&[7]), 0);
    }
}
