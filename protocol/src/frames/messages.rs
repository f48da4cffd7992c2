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
        signals: &EmergencyStop::signals([&["Rig", "DriveController", "LoadController", "Bench"]; 2]),
    },
    /// 0x109, 2 bytes, 100 ms, sent by Rig: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x109 RigEmergencyStop(EmergencyStop) RIG_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "Rig", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &EmergencyStop::signals([&["DriveController", "LoadController", "Console", "Bench"]; 2]),
    },
    /// 0x10A, 2 bytes, 100 ms, sent by DriveController: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x10A DriveEmergencyStop(EmergencyStop) DRIVE_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "DriveController", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &EmergencyStop::signals([&["Rig", "LoadController", "Console", "Bench"]; 2]),
    },
    /// 0x10B, 2 bytes, 100 ms, sent by LoadController: Trips or releases the central emergency stop; at once, then repeated while tripped.
    0x10B LoadEmergencyStop(EmergencyStop) LOAD_EMERGENCY_STOP {
        comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
        sender: "LoadController", send_type: "IfActive", cycle_time_ms: 100, length: 2, checksum_start: None, reserved: 0xFE00,
        signals: &EmergencyStop::signals([&["Rig", "DriveController", "Console", "Bench"]; 2]),
    },
    /// 0x110, 5 bytes, 1 ms, sent by DriveController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
    0x110 DriveValveCommand(ValveCommand) DRIVE_VALVE_COMMAND {
        comment: "Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.",
        sender: "DriveController", send_type: "Cyclic", cycle_time_ms: 1, length: 5, checksum_start: Some(32), reserved: 0xE0000000,
        signals: &ValveCommand::signals([&["Rig", "LoadController", "Bench"]; 4]),
    },
    /// 0x111, 5 bytes, 1 ms, sent by LoadController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
    0x111 LoadValveCommand(ValveCommand) LOAD_VALVE_COMMAND {
        comment: "Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.",
        sender: "LoadController", send_type: "Cyclic", cycle_time_ms: 1, length: 5, checksum_start: Some(32), reserved: 0xE0000000,
        signals: &ValveCommand::signals([&["Rig", "DriveController", "Bench"]; 4]),
    },
    /// 0x120, 8 bytes, 1 ms, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
    0x120 DriveSensors(Sensors) DRIVE_SENSORS {
        comment: "Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.",
        sender: "Rig", send_type: "Cyclic", cycle_time_ms: 1, length: 8, checksum_start: None, reserved: 0x0,
        signals: &Sensors::signals([&["DriveController", "LoadController", "Console", "Bench"]; 5]),
    },
    /// 0x121, 8 bytes, 1 ms, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
    0x121 LoadSensors(Sensors) LOAD_SENSORS {
        comment: "Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.",
        sender: "Rig", send_type: "Cyclic", cycle_time_ms: 1, length: 8, checksum_start: None, reserved: 0x0,
        signals: &Sensors::signals([&["DriveController", "LoadController", "Console", "Bench"]; 5]),
    },
    /// 0x130, 7 bytes, 10 ms, sent by Rig: The rig's time base: every 10 ms, and when cycles were skipped.
    0x130 Tick(Tick) TICK {
        comment: "The rig's time base: every 10 ms, and when cycles were skipped.",
        sender: "Rig", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 7, checksum_start: None, reserved: 0xF8000000000000,
        signals: &Tick::signals([&["DriveController", "LoadController", "Console", "Bench"]; 5]),
    },
    /// 0x140, 4 bytes, 10 ms, sent by Rig: State of the rig. Bits 29 to 31 are reserved.
    0x140 RigStatus(RigStatus) RIG_STATUS {
        comment: "State of the rig. Bits 29 to 31 are reserved.",
        sender: "Rig", send_type: "Cyclic", cycle_time_ms: 10, length: 4, checksum_start: None, reserved: 0xE0000000,
        signals: &RigStatus::signals([&["DriveController", "LoadController", "Console", "Bench"]; 16]),
    },
    /// 0x150, 5 bytes, 10 ms, sent by DriveController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
    0x150 DriveChainStatus(ChainStatus) DRIVE_CHAIN_STATUS {
        comment: "States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.",
        sender: "DriveController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 5, checksum_start: None, reserved: 0xFE0000,
        signals: &ChainStatus::signals([&["Rig", "LoadController", "Console", "Bench"]; 7]),
    },
    /// 0x151, 8 bytes, 10 ms, sent by DriveController: Figures of a controller's sequence chains.
    0x151 DriveChainValues(ChainValues) DRIVE_CHAIN_VALUES {
        comment: "Figures of a controller's sequence chains.",
        sender: "DriveController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 8, checksum_start: None, reserved: 0x0,
        signals: &ChainValues::signals([&["LoadController", "Console", "Bench"]; 4]),
    },
    /// 0x152, 5 bytes, 10 ms, sent by LoadController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
    0x152 LoadChainStatus(ChainStatus) LOAD_CHAIN_STATUS {
        comment: "States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.",
        sender: "LoadController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 5, checksum_start: None, reserved: 0xFE0000,
        signals: &ChainStatus::signals([&["Rig", "DriveController", "Console", "Bench"]; 7]),
    },
    /// 0x153, 8 bytes, 10 ms, sent by LoadController: Figures of a controller's sequence chains.
    0x153 LoadChainValues(ChainValues) LOAD_CHAIN_VALUES {
        comment: "Figures of a controller's sequence chains.",
        sender: "LoadController", send_type: "CyclicAndOnChange", cycle_time_ms: 10, length: 8, checksum_start: None, reserved: 0x0,
        signals: &ChainValues::signals([&["DriveController", "Console", "Bench"]; 4]),
    },
    /// 0x160, 2 bytes, event, sent by Console: Starts or aborts an experiment.
    0x160 RunControl(RunControl) RUN_CONTROL {
        comment: "Starts or aborts an experiment.",
        sender: "Console", send_type: "Event", cycle_time_ms: 0, length: 2, checksum_start: None, reserved: 0x0,
        signals: &RunControl::signals([&["DriveController", "LoadController", "Bench"]; 2]),
    },
    /// 0x180, 4 bytes, event, sent by Bench: Bench only: a hand pushes, in +x, until the next such frame.
    0x180 HandForce(HandForce) HAND_FORCE {
        comment: "Bench only: a hand pushes, in +x, until the next such frame.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 4, checksum_start: None, reserved: 0x0,
        signals: &HandForce::signals([&["Rig", "Console"]; 2]),
    },
    /// 0x181, 1 bytes, event, sent by Bench: Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
    0x181 Link(Link) LINK {
        comment: "Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 1, checksum_start: None, reserved: 0xFE,
        signals: &Link::signals([&["Rig", "Console"]; 1]),
    },
    /// 0x182, 2 bytes, event, sent by Bench: Bench only: puts weights on the carriage.
    0x182 Weights(Weights) WEIGHTS {
        comment: "Bench only: puts weights on the carriage.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 2, checksum_start: None, reserved: 0x0,
        signals: &Weights::signals([&["Rig", "Console"]; 1]),
    },
    /// 0x183, 3 bytes, event, sent by Bench: Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
    0x183 FaultMark(FaultMark) FAULT_MARK {
        comment: "Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 3, checksum_start: None, reserved: 0xFE0000,
        signals: &FaultMark::signals([&["Console"]; 2]),
    },
    /// 0x184, 5 bytes, event, sent by Bench: Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
    0x184 HandSetPoint(HandSetPoint) HAND_SET_POINT {
        comment: "Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.",
        sender: "Bench", send_type: "Event", cycle_time_ms: 0, length: 5, checksum_start: None, reserved: 0xFE,
        signals: &HandSetPoint::signals([&["DriveController", "LoadController", "Console"]; 3]),
    },
    /// 0x1E0, 8 bytes, event, sent by Console: XCP command packet to a controller, padded to 8 bytes.
    0x1E0 DriveXcpCommand(XcpCommand) DRIVE_XCP_COMMAND {
        comment: "XCP command packet to a controller, padded to 8 bytes.",
        sender: "Console", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &XcpCommand::signals([&["DriveController", "Bench"]; 8]),
    },
    /// 0x1E1, 8 bytes, event, sent by DriveController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
    0x1E1 DriveXcpResponse(XcpResponse) DRIVE_XCP_RESPONSE {
        comment: "XCP response, event or DAQ packet of a controller, padded to 8 bytes.",
        sender: "DriveController", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &XcpResponse::signals([&["Console", "Bench"]; 8]),
    },
    /// 0x1E2, 8 bytes, event, sent by Console: XCP command packet to a controller, padded to 8 bytes.
    0x1E2 LoadXcpCommand(XcpCommand) LOAD_XCP_COMMAND {
        comment: "XCP command packet to a controller, padded to 8 bytes.",
        sender: "Console", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &XcpCommand::signals([&["LoadController", "Bench"]; 8]),
    },
    /// 0x1E3, 8 bytes, event, sent by LoadController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
    0x1E3 LoadXcpResponse(XcpResponse) LOAD_XCP_RESPONSE {
        comment: "XCP response, event or DAQ packet of a controller, padded to 8 bytes.",
        sender: "LoadController", send_type: "Event", cycle_time_ms: 0, length: 8, checksum_start: None, reserved: 0x0,
        signals: &XcpResponse::signals([&["Console", "Bench"]; 8]),
    },
} }
