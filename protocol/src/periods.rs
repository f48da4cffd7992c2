//! The cycle of the rig, and how often and when cyclic frames are sent, in cycles: `rig.dbc`'s periods, and the places within
//! them.
//!
//! Tick and status of the rig are half a period apart, so that no millisecond carries both. Whoever sends or awaits one of
//! these frames counts by what stands here.

use crate::frames::{
    CONSOLE_EMERGENCY_STOP, DRIVE_CHAIN_STATUS, DRIVE_CHAIN_VALUES, DRIVE_EMERGENCY_STOP, DRIVE_SENSORS,
    LOAD_CHAIN_STATUS, LOAD_CHAIN_VALUES, LOAD_EMERGENCY_STOP, MessageSpec, RIG_EMERGENCY_STOP, RIG_STATUS,
    TICK,
};
use std::time::Duration;

/// A cycle of the rig (bus.md, Time): sensors are sent once in it.
pub const CYCLE: Duration = Duration::from_millis(DRIVE_SENSORS.cycle_time_ms as u64);
/// The same, ns.
pub const CYCLE_NS: u64 = CYCLE.as_nanos() as u64;
/// The same, s.
pub const CYCLE_S: f64 = DRIVE_SENSORS.cycle_time_ms as f64 / 1000.0;

/// From one tick of the rig to the next.
pub const TICK_CYCLES: u64 = cycles(TICK);
/// From one status of the rig to the next.
pub const STATUS_CYCLES: u64 = cycles(RIG_STATUS);
/// From one status or values of a chain to the next, while nothing changes.
pub const CHAIN_CYCLES: u64 = cycles(DRIVE_CHAIN_STATUS);
/// From one frame of an emergency stop that is held to the next.
pub const EMERGENCY_STOP_CYCLES: u64 = cycles(RIG_EMERGENCY_STOP);

/// Cycle of its period in which the tick is sent.
const TICK_PHASE: u64 = 0;
/// Cycle of its period in which the rig's status is sent.
const STATUS_PHASE: u64 = 5;

/// Whether the rig sends its tick in `cycle`.
#[must_use]
pub const fn tick_is_due(cycle: u64) -> bool {
    cycle % TICK_CYCLES == TICK_PHASE
}

/// Whether the rig sends its status in `cycle`.
#[must_use]
pub const fn status_is_due(cycle: u64) -> bool {
    cycle % STATUS_CYCLES == STATUS_PHASE
}

const fn cycles(message: &MessageSpec) -> u64 {
    (message.cycle_time_ms / DRIVE_SENSORS.cycle_time_ms) as u64
}

const _: () = {
    assert!(TICK_CYCLES == STATUS_CYCLES, "else tick and status meet in a millisecond");
    assert!(TICK_PHASE != STATUS_PHASE && STATUS_PHASE < STATUS_CYCLES);
    assert!(cycles(LOAD_CHAIN_STATUS) == CHAIN_CYCLES);
    assert!(cycles(DRIVE_CHAIN_VALUES) == CHAIN_CYCLES && cycles(LOAD_CHAIN_VALUES) == CHAIN_CYCLES);
    assert!(cycles(DRIVE_EMERGENCY_STOP) == EMERGENCY_STOP_CYCLES);
    assert!(cycles(LOAD_EMERGENCY_STOP) == EMERGENCY_STOP_CYCLES);
    assert!(cycles(CONSOLE_EMERGENCY_STOP) == EMERGENCY_STOP_CYCLES);
};
