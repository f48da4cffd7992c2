//! The cycle of each frame of a log, from the sensors' low 4 bits, the ticks' full numbers and the stamps.
//!
//! A frame of sensors is of that cycle, out of those with its low bits, that the stamps come closest to; they may be off by 8 ms
//! from one frame to the next before that is wrong, so that another computer's clock or a hole of a minute does no harm. The
//! first tick gives all numbers before it their full value, each later one confirms them: no sensors before it are of a later
//! cycle, however late a busy computer stamped them.
//!
//! ```text
//!   sensors ..7   ..8   tick 8   ..9   ..A         tick 8 says that ..8 is cycle 8, and so is the shift of all before
//! ```

use super::ReadError;
use protocol::frames::{ALIVE_RANGE, Frame, Tick};
use protocol::periods;
use std::collections::BTreeSet;
use std::path::Path;

const CYCLE_NS: i64 = periods::CYCLE_NS as i64;
const ROUND: i64 = ALIVE_RANGE as i64;

/// A frame of a log that `rig.dbc` knows.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoggedFrame {
    pub(super) line: u64,
    pub(super) stamp_ns: u64,
    pub(super) frame: Frame,
}

pub(super) struct Cycles {
    /// The cycle of each frame of sensors, in the order of the log; `None` for other frames.
    pub(super) of: Vec<Option<u64>>,
    /// Cycles that the rig says it computed without sending them.
    pub(super) skipped: BTreeSet<u64>,
    /// Whether no tick gave the full numbers.
    pub(super) guessed: bool,
}

pub(super) fn find(file: &Path, log: &[LoggedFrame]) -> Result<Cycles, ReadError> {
    let mut numbers: Vec<Option<i64>> = vec![None; log.len()];
    let mut known: Option<(i64, u64)> = None;
    let mut anchored = false;
    let mut skipped = SkippedCycles::default();
    let next_ticks = next_ticks(log);
    for (place, logged) in log.iter().enumerate() {
        let expected = known.map(|(cycle, stamp_ns)| {
            let passed_ns = logged.stamp_ns.cast_signed() - stamp_ns.cast_signed();
            cycle + (passed_ns + CYCLE_NS / 2).div_euclid(CYCLE_NS)
        });
        match logged.frame {
            Frame::DriveSensors(sensors) | Frame::LoadSensors(sensors) => {
                let low = i64::from(sensors.alive);
                let mut cycle = expected.map_or(low, |expected| nearest(expected, low));
                if let (true, Some((newest, _)), Some(tick)) = (anchored, known, next_ticks[place]) {
                    let latest = wrapped(newest, tick);
                    let in_time = latest - (latest - low).rem_euclid(ROUND);
                    if cycle > latest && in_time >= newest {
                        cycle = in_time;
                    }
                }
                numbers[place] = Some(cycle);
                if known.is_none_or(|(newest, _)| cycle >= newest) {
                    known = Some((cycle, logged.stamp_ns));
                }
            }
            Frame::Tick(tick) => {
                let cycle = match known {
                    Some((newest, _)) if anchored => {
                        let cycle = wrapped(newest, tick.cycle);
                        if cycle < newest - ROUND {
                            let cycles = format!("cycle {} after {}", tick.cycle, newest.cast_unsigned());
                            let message = format!("the rig starts anew ({cycles}): split the log there");
                            return Err(ReadError::at(file, logged.line, message));
                        }
                        cycle
                    }
                    _ => {
                        let cycle = i64::from(tick.cycle);
                        // Counted from the log's first frame until now: all move by whole rounds.
                        let meant =
                            expected.map_or(cycle, |expected| nearest(expected, cycle.rem_euclid(ROUND)));
                        numbers.iter_mut().flatten().for_each(|number| *number += cycle - meant);
                        anchored = true;
                        cycle
                    }
                };
                known = Some((cycle, logged.stamp_ns));
                skipped.take(&tick, cycle, &numbers[..place]);
            }
            _ => {}
        }
    }
    // Before cycle 0 there is none; only a log without a tick could say so.
    let of = numbers.into_iter().map(|number| number.map(|cycle| cycle.max(0).cast_unsigned())).collect();
    Ok(Cycles { of, skipped: skipped.cycles, guessed: !anchored })
}

/// For each frame, the cycle of the first tick after it.
fn next_ticks(log: &[LoggedFrame]) -> Vec<Option<u32>> {
    let mut next = None;
    let mut ticks: Vec<_> = log
        .iter()
        .rev()
        .map(|logged| {
            let before = next;
            if let Frame::Tick(tick) = logged.frame {
                next = Some(tick.cycle);
            }
            before
        })
        .collect();
    ticks.reverse();
    ticks
}

/// The full number of a tick's cycle, which wraps at 32 bits, near another number.
fn wrapped(near: i64, cycle: u32) -> i64 {
    near + i64::from(cycle.wrapping_sub(near as u32).cast_signed())
}

/// The number with these low bits that is nearest to `expected`.
fn nearest(expected: i64, low: i64) -> i64 {
    let ahead = (low - expected).rem_euclid(ROUND);
    expected + if ahead > ROUND / 2 { ahead - ROUND } else { ahead }
}

/// Which cycles were skipped: those just before a tick that says so.
#[derive(Default)]
struct SkippedCycles {
    counted: Option<u16>,
    cycles: BTreeSet<u64>,
}

impl SkippedCycles {
    fn take(&mut self, tick: &Tick, cycle: i64, before: &[Option<i64>]) {
        // What was skipped before the log began lies outside of it.
        let counted = self.counted.replace(tick.skipped).unwrap_or(tick.skipped);
        let more = u64::from(tick.skipped.wrapping_sub(counted));
        if more == 0 {
            return;
        }
        let recent = before.iter().rev().flatten().take(4 * more as usize + 64);
        let sent: BTreeSet<i64> = recent.copied().collect();
        let mut left = more;
        let mut candidate = cycle - 1;
        // A tick that came in time belongs to sensors; after a lost one the hole lies further back.
        while left > 0 && candidate >= 0 && candidate >= cycle - 2 * more as i64 - 2 * ROUND {
            if !sent.contains(&candidate) {
                self.cycles.insert(candidate.cast_unsigned());
                left -= 1;
            }
            candidate -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::Sensors;

    fn sensors(cycle: u64, stamp_ns: u64) -> LoggedFrame {
        let alive = (cycle % ALIVE_RANGE) as u8;
        let sensors =
            Sensors { position_m: 0.1, force_n: 0.0, pressure_a_pa: 1e5, pressure_b_pa: 1e5, alive };
        LoggedFrame { line: 1, stamp_ns, frame: Frame::DriveSensors(sensors) }
    }

    fn tick(cycle: u64, skipped: u16, stamp_ns: u64) -> LoggedFrame {
        let catch_up = false;
        let tick = Tick { cycle: cycle as u32, skipped, catch_up, lockstep: false, ending: false };
        LoggedFrame { line: 2, stamp_ns, frame: Frame::Tick(tick) }
    }

    fn found(log: &[LoggedFrame]) -> Vec<u64> {
        find(Path::new("a.log"), log).unwrap().of.into_iter().flatten().collect()
    }

    #[test]
    fn a_log_that_begins_in_the_midst_gets_its_numbers_from_the_first_tick() {
        let mut log: Vec<_> = (1003..1010).map(|cycle| sensors(cycle, cycle * 1_000_000)).collect();
        log.push(tick(1009, 0, 1_009_050_000));
        log.extend((1010..1100).map(|cycle| sensors(cycle, cycle * 1_000_000)));
        assert_eq!(found(&log), (1003..1100).collect::<Vec<_>>());
    }

    #[test]
    fn a_hole_of_a_minute_and_a_clock_that_drifts_cost_nothing() {
        // 100 ppm: 6 ms in a minute.
        let stamp = |cycle: u64| cycle * 1_000_100;
        let mut log = vec![sensors(0, stamp(0)), tick(0, 0, stamp(0))];
        log.extend([1, 2, 60_003, 60_004, 60_020].map(|cycle| sensors(cycle, stamp(cycle))));
        assert_eq!(found(&log), [0, 1, 2, 60_003, 60_004, 60_020]);
    }

    #[test]
    fn frames_that_were_held_up_and_stamped_together_keep_their_cycles() {
        for held_up in [9, 12, 30, 47] {
            // Stamped when they came through, all those of the time in which they were held up at its end.
            let stamp = |cycle: u64| if (20..20 + held_up).contains(&cycle) { 20 + held_up } else { cycle };
            let log: Vec<_> = (0..100)
                .flat_map(|cycle| {
                    let stamp_ns = stamp(cycle) * 1_000_000;
                    let tick = (cycle % 10 == 0).then(|| tick(cycle, 0, stamp_ns));
                    std::iter::once(sensors(cycle, stamp_ns)).chain(tick)
                })
                .collect();
            assert_eq!(found(&log), (0..100).collect::<Vec<_>>(), "{held_up} ms");
        }
    }

    #[test]
    fn skipped_cycles_are_those_before_the_tick_that_counts_them() {
        let mut log: Vec<_> = [0, 1, 2].map(|cycle| sensors(cycle, cycle * 1_000_000)).into();
        log.insert(1, tick(0, 0, 0));
        log.push(tick(6, 3, 6_200_000));
        log.push(sensors(6, 6_210_000));
        let cycles = find(Path::new("a.log"), &log).unwrap();
        assert_eq!(cycles.skipped.into_iter().collect::<Vec<_>>(), [3, 4, 5]);
    }

    #[test]
    fn a_rig_that_starts_anew_is_reported_with_its_line() {
        let log = [sensors(500, 0), tick(500, 0, 0), sensors(0, 5_000_000_000), tick(0, 0, 5_000_000_000)];
        let message = find(Path::new("a.log"), &log).err().unwrap().to_string();
        assert!(message.contains("a.log:2: the rig starts anew (cycle 0 after 5"), "{message}");
    }
}
