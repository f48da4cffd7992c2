//! The messages of `rig.dbc` with all that it says about them and their signals.
//!
//! @generated from rig.dbc by the tests of this crate (generator/): cargo test -p protocol generated

use super::*;

frames! {
/// A frame of the wire with its payload in physical quantities.
pub enum Frame {
    /// 0x108, 2 bytes, 100 ms, sent by Console: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x108 ConsoleEmergencyStop(EmergencyStop) CONSOLE_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "Console", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &[
            SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["Rig", "DriveController", "LoadController", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "LoadController", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x109, 2 bytes, 100 ms, sent by Rig: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x109 RigEmergencyStop(EmergencyStop) RIG_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "Rig", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &[
            SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x10A, 2 bytes, 100 ms, sent by DriveController: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x10A DriveEmergencyStop(EmergencyStop) DRIVE_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "DriveController", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &[
            SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x10B, 2 bytes, 100 ms, sent by LoadController: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x10B LoadEmergencyStop(EmergencyStop) LOAD_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "LoadController", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &[
            SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x110, 5 bytes, 1 ms, sent by DriveController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
    0x110 DriveValveCommand(ValveCommand) DRIVE_VALVE_COMMAND {
        comment: "Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.",
        sender: "DriveController", send_type: "Cyclic", cycle_time_ms: 1, length: 5, checksum_start: Some(32), reserved: 0xE0000000,
        signals: &[
            SignalSpec { name: "opening", field: "opening", unit: "", comment: "Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal.", start: 0, length: 12, signed: true, factor: 0.0004885197850512946, offset: 0.0, raw_min: -2047, raw_max: 2047, min: -1.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "alive", field: "alive", unit: "", comment: "Counts the sender's commands, modulo 16.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "echo", field: "echo", unit: "", comment: "Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it.", start: 16, length: 12, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4095, min: 0.0, max: 4095.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "enable", field: "enable", unit: "", comment: "The controller asks for its valve to act; without it the valve is shut.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x111, 5 bytes, 1 ms, sent by LoadController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
    0x111 LoadValveCommand(ValveCommand) LOAD_VALVE_COMMAND {
        comment: "Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.",
        sender: "LoadController", send_type: "Cyclic", cycle_time_ms: 1, length: 5, checksum_start: Some(32), reserved: 0xE0000000,
        signals: &[
            SignalSpec { name: "opening", field: "opening", unit: "", comment: "Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal.", start: 0, length: 12, signed: true, factor: 0.0004885197850512946, offset: 0.0, raw_min: -2047, raw_max: 2047, min: -1.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "alive", field: "alive", unit: "", comment: "Counts the sender's commands, modulo 16.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "echo", field: "echo", unit: "", comment: "Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it.", start: 16, length: 12, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4095, min: 0.0, max: 4095.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "enable", field: "enable", unit: "", comment: "The controller asks for its valve to act; without it the valve is shut.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x120, 8 bytes, 1 ms, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
    0x120 DriveSensors(Sensors) DRIVE_SENSORS {
        comment: "Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.",
        sender: "Rig", send_type: "Cyclic", cycle_time_ms: 1, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "position", field: "position_m", unit: "m", comment: "Position sensor, in rig coordinates for both axes.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "force", field: "force_n", unit: "N", comment: "Force between rod and carriage, compression positive.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "pressure_a", field: "pressure_a_pa", unit: "Pa", comment: "Absolute pressure of the cap side chamber.", start: 32, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "pressure_b", field: "pressure_b_pa", unit: "Pa", comment: "Absolute pressure of the rod side chamber.", start: 46, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "alive", field: "alive", unit: "", comment: "Cycle number of the sample, low 4 bits.", start: 60, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x121, 8 bytes, 1 ms, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
    0x121 LoadSensors(Sensors) LOAD_SENSORS {
        comment: "Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.",
        sender: "Rig", send_type: "Cyclic", cycle_time_ms: 1, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "position", field: "position_m", unit: "m", comment: "Position sensor, in rig coordinates for both axes.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "force", field: "force_n", unit: "N", comment: "Force between rod and carriage, compression positive.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "pressure_a", field: "pressure_a_pa", unit: "Pa", comment: "Absolute pressure of the cap side chamber.", start: 32, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "pressure_b", field: "pressure_b_pa", unit: "Pa", comment: "Absolute pressure of the rod side chamber.", start: 46, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "alive", field: "alive", unit: "", comment: "Cycle number of the sample, low 4 bits.", start: 60, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x130, 7 bytes, 10 ms, sent by Rig: The rig's time base: every 10 ms, and when cycles were skipped.
    0x130 Tick(Tick) TICK {
        comment: "The rig's time base: every 10 ms, and when cycles were skipped.",
        sender: "Rig", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 7, checksum_start: None, reserved: 0xF8000000000000,
        signals: &[
            SignalSpec { name: "cycle", field: "cycle", unit: "", comment: "Number of the cycle in which the tick is sent, counted from 0 at the start of the rig.", start: 0, length: 32, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4294967295, min: 0.0, max: 4294967295.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "skipped", field: "skipped", unit: "", comment: "Cycles skipped by the rig in all, modulo 65536.", start: 32, length: 16, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 65535.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "catch_up", field: "catch_up", unit: "", comment: "This tick announces skipped cycles.", start: 48, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "lockstep", field: "lockstep", unit: "", comment: "The rig runs in lockstep: time is simulated.", start: 49, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "ending", field: "ending", unit: "", comment: "The rig stops after this tick.", start: 50, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x140, 4 bytes, 10 ms, sent by Rig: State of the rig. Bits 29 to 31 are reserved.
    0x140 RigStatus(RigStatus) RIG_STATUS {
        comment: "State of the rig. Bits 29 to 31 are reserved.",
        sender: "Rig", send_type: "Cyclic", cycle_time_ms: 10, length: 4, checksum_start: None, reserved: 0xE0000000,
        signals: &[
            SignalSpec { name: "supply_pressure", field: "supply_pressure_pa", unit: "Pa", comment: "Absolute pressure of the supply node.", start: 0, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "linked", field: "linked", unit: "", comment: "The load eye is linked to the carriage.", start: 14, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "emergency_stop", field: "emergency_stop", unit: "", comment: "The emergency stop is tripped: supply discharged, valve commands count as 0.", start: 15, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "check_valves_shut", field: "check_valves_shut", unit: "", comment: "The non-return valves on the chambers are shut.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "drive_position_saturated", field: "drive_position_saturated", unit: "", comment: "The drive axis's position sensor was beyond its range since the last status.", start: 17, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "drive_force_saturated", field: "drive_force_saturated", unit: "", comment: "The drive axis's force sensor was beyond its range since the last status.", start: 18, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "drive_pressure_a_saturated", field: "drive_pressure_a_saturated", unit: "", comment: "The drive axis's pressure a sensor was beyond its range since the last status.", start: 19, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "drive_pressure_b_saturated", field: "drive_pressure_b_saturated", unit: "", comment: "The drive axis's pressure b sensor was beyond its range since the last status.", start: 20, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "load_position_saturated", field: "load_position_saturated", unit: "", comment: "The load axis's position sensor was beyond its range since the last status.", start: 21, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "load_force_saturated", field: "load_force_saturated", unit: "", comment: "The load axis's force sensor was beyond its range since the last status.", start: 22, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "load_pressure_a_saturated", field: "load_pressure_a_saturated", unit: "", comment: "The load axis's pressure a sensor was beyond its range since the last status.", start: 23, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "load_pressure_b_saturated", field: "load_pressure_b_saturated", unit: "", comment: "The load axis's pressure b sensor was beyond its range since the last status.", start: 24, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "drive_stale", field: "drive_stale", unit: "", comment: "The drive valve is shut because its newest command is older than 20 cycles.", start: 25, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "load_stale", field: "load_stale", unit: "", comment: "The load valve is shut because its newest command is older than 20 cycles.", start: 26, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "drive_two_sources", field: "drive_two_sources", unit: "", comment: "Latched fault: two sources send drive valve commands; the valve is shut until one is silent for 20 cycles.", start: 27, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "load_two_sources", field: "load_two_sources", unit: "", comment: "Latched fault: two sources send load valve commands; the valve is shut until one is silent for 20 cycles.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        ],
    },
    /// 0x150, 5 bytes, 10 ms, sent by DriveController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
    0x150 DriveChainStatus(ChainStatus) DRIVE_CHAIN_STATUS {
        comment: "States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.",
        sender: "DriveController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 5, checksum_start: None, reserved: 0xFE0000,
        signals: &[
            SignalSpec { name: "main_chain", field: "main_chain", unit: "", comment: "State of the main sequence chain.", start: 0, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 9, min: 0.0, max: 9.0, values: &["waiting-for-rig", "initial-positioning", "preparing", "initial-force", "settling", "experiment", "final-settling", "done", "aborted", "fault"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "force_chain", field: "force_chain", unit: "", comment: "State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.", start: 4, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["idle", "limited", "standstill", "moving", "initial-ramp", "load-profile", "done", "fault"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "matching_chain", field: "matching_chain", unit: "", comment: "State of the chain that matches the two position sensors while the axes are linked.", start: 8, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["idle", "waiting-for-rest", "averaging", "matched", "fault"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "emergency_stop_chain", field: "emergency_stop_chain", unit: "", comment: "State of the emergency stop chain.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["ready", "tripped", "waiting-for-release", "recovering", "waiting-for-start"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "ok", field: "ok", unit: "", comment: "The controller has what it needs and no fault.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "experiment", field: "experiment", unit: "", comment: "Number of the experiment that runs or ran last.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "repetition", field: "repetition", unit: "", comment: "Repetition of the experiment, from 0.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x151, 8 bytes, 10 ms, sent by DriveController: Figures of a controller's sequence chains.
    0x151 DriveChainValues(ChainValues) DRIVE_CHAIN_VALUES {
        comment: "Figures of a controller's sequence chains.",
        sender: "DriveController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "averaged_position", field: "averaged_position_m", unit: "m", comment: "Position sensor of the controller's axis, averaged over the last 0.2 s.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "position_set_point", field: "position_set_point_m", unit: "m", comment: "Set-point of the position.", start: 16, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "force_set_point", field: "force_set_point_n", unit: "N", comment: "Set-point of the force.", start: 32, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "control_error", field: "control_error_m", unit: "m", comment: "Position set-point minus position.", start: 48, length: 16, signed: true, factor: 1.5259254737998596e-5, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -0.5, max: 0.5, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        ],
    },
    /// 0x152, 5 bytes, 10 ms, sent by LoadController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
    0x152 LoadChainStatus(ChainStatus) LOAD_CHAIN_STATUS {
        comment: "States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.",
        sender: "LoadController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 5, checksum_start: None, reserved: 0xFE0000,
        signals: &[
            SignalSpec { name: "main_chain", field: "main_chain", unit: "", comment: "State of the main sequence chain.", start: 0, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 9, min: 0.0, max: 9.0, values: &["waiting-for-rig", "initial-positioning", "preparing", "initial-force", "settling", "experiment", "final-settling", "done", "aborted", "fault"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "force_chain", field: "force_chain", unit: "", comment: "State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.", start: 4, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["idle", "limited", "standstill", "moving", "initial-ramp", "load-profile", "done", "fault"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "matching_chain", field: "matching_chain", unit: "", comment: "State of the chain that matches the two position sensors while the axes are linked.", start: 8, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["idle", "waiting-for-rest", "averaging", "matched", "fault"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "emergency_stop_chain", field: "emergency_stop_chain", unit: "", comment: "State of the emergency stop chain.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["ready", "tripped", "waiting-for-release", "recovering", "waiting-for-start"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "ok", field: "ok", unit: "", comment: "The controller has what it needs and no fault.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Flag },
            SignalSpec { name: "experiment", field: "experiment", unit: "", comment: "Number of the experiment that runs or ran last.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "repetition", field: "repetition", unit: "", comment: "Repetition of the experiment, from 0.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x153, 8 bytes, 10 ms, sent by LoadController: Figures of a controller's sequence chains.
    0x153 LoadChainValues(ChainValues) LOAD_CHAIN_VALUES {
        comment: "Figures of a controller's sequence chains.",
        sender: "LoadController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "averaged_position", field: "averaged_position_m", unit: "m", comment: "Position sensor of the controller's axis, averaged over the last 0.2 s.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "position_set_point", field: "position_set_point_m", unit: "m", comment: "Set-point of the position.", start: 16, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "force_set_point", field: "force_set_point_n", unit: "N", comment: "Set-point of the force.", start: 32, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
            SignalSpec { name: "control_error", field: "control_error_m", unit: "m", comment: "Position set-point minus position.", start: 48, length: 16, signed: true, factor: 1.5259254737998596e-5, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -0.5, max: 0.5, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
        ],
    },
    /// 0x160, 2 bytes, event, sent by Console: Starts or aborts an experiment.
    0x160 RunControl(RunControl) RUN_CONTROL {
        comment: "Starts or aborts an experiment.",
        sender: "Console", send_type: "Event", cycle_time_ms: 0, length: 2, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "command", field: "command", unit: "", comment: "What the controllers are asked for.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 2, min: 0.0, max: 2.0, values: &["none", "start", "abort"], receivers: &["DriveController", "LoadController", "Bench"], kind: SignalKind::Table },
            SignalSpec { name: "experiment", field: "experiment", unit: "", comment: "Number of the experiment to start.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "LoadController", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x180, 4 bytes, event, sent by Bench: Bench only: a hand pushes, in +x, until the next such frame.
    0x180 HandForce(HandForce) HAND_FORCE {
        comment: "Bench only: a hand pushes, in +x, until the next such frame.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 4, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "carriage", field: "carriage_n", unit: "N", comment: "Force of the hand on the carriage.", start: 0, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["Rig", "Console"], kind: SignalKind::Physical },
            SignalSpec { name: "load_eye", field: "load_eye_n", unit: "N", comment: "Force of the hand on the load eye.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["Rig", "Console"], kind: SignalKind::Physical },
        ],
    },
    /// 0x181, 1 bytes, event, sent by Bench: Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
    0x181 Link(Link) LINK {
        comment: "Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 1, checksum_start: None, reserved: 0xFE,
        signals: &[
            SignalSpec { name: "request", field: "request", unit: "", comment: "What the rig is asked for; linking is refused outside the gap.", start: 0, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &["unlink", "link"], receivers: &["Rig", "Console"], kind: SignalKind::Table },
        ],
    },
    /// 0x182, 2 bytes, event, sent by Bench: Bench only: puts weights on the carriage.
    0x182 Weights(Weights) WEIGHTS {
        comment: "Bench only: puts weights on the carriage.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 2, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "added_mass", field: "added_mass_kg", unit: "kg", comment: "Mass of all weights on the carriage.", start: 0, length: 16, signed: false, factor: 0.00030518043793392844, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 20.0, values: &[], receivers: &["Rig", "Console"], kind: SignalKind::Physical },
        ],
    },
    /// 0x183, 3 bytes, event, sent by Bench: Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
    0x183 FaultMark(FaultMark) FAULT_MARK {
        comment: "Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 3, checksum_start: None, reserved: 0xFE0000,
        signals: &[
            SignalSpec { name: "fault", field: "fault", unit: "", comment: "Number of the fault in the bench's plan.", start: 0, length: 16, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 65535.0, values: &[], receivers: &["Console"], kind: SignalKind::Integer },
            SignalSpec { name: "active", field: "active", unit: "", comment: "The fault begins; otherwise it ends.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Console"], kind: SignalKind::Flag },
        ],
    },
    /// 0x184, 5 bytes, event, sent by Bench: Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
    0x184 HandSetPoint(HandSetPoint) HAND_SET_POINT {
        comment: "Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 5, checksum_start: None, reserved: 0xFE,
        signals: &[
            SignalSpec { name: "axis", field: "axis", unit: "", comment: "Whom it is for.", start: 0, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &["drive", "load"], receivers: &["DriveController", "LoadController", "Console"], kind: SignalKind::Table },
            SignalSpec { name: "position", field: "position_m", unit: "m", comment: "Position that is to be reached, rig coordinate; an axis that is force controlled ignores it.", start: 8, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "LoadController", "Console"], kind: SignalKind::Physical },
            SignalSpec { name: "force", field: "force_n", unit: "N", comment: "Force that is to be reached, compression positive; an axis that is position controlled ignores it.", start: 24, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "LoadController", "Console"], kind: SignalKind::Physical },
        ],
    },
    /// 0x1E0, 8 bytes, event, sent by Console: XCP command packet to a controller, padded to 8 bytes.
    0x1E0 DriveXcpCommand(XcpCommand) DRIVE_XCP_COMMAND {
        comment: "XCP command packet to a controller, padded to 8 bytes.",
        sender: "Console", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "byte0", field: "byte0", unit: "", comment: "Byte 0 of the packet.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte1", field: "byte1", unit: "", comment: "Byte 1 of the packet.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte2", field: "byte2", unit: "", comment: "Byte 2 of the packet.", start: 16, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte3", field: "byte3", unit: "", comment: "Byte 3 of the packet.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte4", field: "byte4", unit: "", comment: "Byte 4 of the packet.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte5", field: "byte5", unit: "", comment: "Byte 5 of the packet.", start: 40, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte6", field: "byte6", unit: "", comment: "Byte 6 of the packet.", start: 48, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte7", field: "byte7", unit: "", comment: "Byte 7 of the packet.", start: 56, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x1E1, 8 bytes, event, sent by DriveController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
    0x1E1 DriveXcpResponse(XcpResponse) DRIVE_XCP_RESPONSE {
        comment: "XCP response, event or DAQ packet of a controller, padded to 8 bytes.",
        sender: "DriveController", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "byte0", field: "byte0", unit: "", comment: "Byte 0 of the packet.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte1", field: "byte1", unit: "", comment: "Byte 1 of the packet.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte2", field: "byte2", unit: "", comment: "Byte 2 of the packet.", start: 16, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte3", field: "byte3", unit: "", comment: "Byte 3 of the packet.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte4", field: "byte4", unit: "", comment: "Byte 4 of the packet.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte5", field: "byte5", unit: "", comment: "Byte 5 of the packet.", start: 40, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte6", field: "byte6", unit: "", comment: "Byte 6 of the packet.", start: 48, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte7", field: "byte7", unit: "", comment: "Byte 7 of the packet.", start: 56, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x1E2, 8 bytes, event, sent by Console: XCP command packet to a controller, padded to 8 bytes.
    0x1E2 LoadXcpCommand(XcpCommand) LOAD_XCP_COMMAND {
        comment: "XCP command packet to a controller, padded to 8 bytes.",
        sender: "Console", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "byte0", field: "byte0", unit: "", comment: "Byte 0 of the packet.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte1", field: "byte1", unit: "", comment: "Byte 1 of the packet.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte2", field: "byte2", unit: "", comment: "Byte 2 of the packet.", start: 16, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte3", field: "byte3", unit: "", comment: "Byte 3 of the packet.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte4", field: "byte4", unit: "", comment: "Byte 4 of the packet.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte5", field: "byte5", unit: "", comment: "Byte 5 of the packet.", start: 40, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte6", field: "byte6", unit: "", comment: "Byte 6 of the packet.", start: 48, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte7", field: "byte7", unit: "", comment: "Byte 7 of the packet.", start: 56, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["LoadController", "Bench"], kind: SignalKind::Integer },
        ],
    },
    /// 0x1E3, 8 bytes, event, sent by LoadController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
    0x1E3 LoadXcpResponse(XcpResponse) LOAD_XCP_RESPONSE {
        comment: "XCP response, event or DAQ packet of a controller, padded to 8 bytes.",
        sender: "LoadController", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &[
            SignalSpec { name: "byte0", field: "byte0", unit: "", comment: "Byte 0 of the packet.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte1", field: "byte1", unit: "", comment: "Byte 1 of the packet.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte2", field: "byte2", unit: "", comment: "Byte 2 of the packet.", start: 16, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte3", field: "byte3", unit: "", comment: "Byte 3 of the packet.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte4", field: "byte4", unit: "", comment: "Byte 4 of the packet.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte5", field: "byte5", unit: "", comment: "Byte 5 of the packet.", start: 40, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte6", field: "byte6", unit: "", comment: "Byte 6 of the packet.", start: 48, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
            SignalSpec { name: "byte7", field: "byte7", unit: "", comment: "Byte 7 of the packet.", start: 56, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Console", "Bench"], kind: SignalKind::Integer },
        ],
    },
} }
