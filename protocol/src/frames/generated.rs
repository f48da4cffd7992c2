// @generated from rig.dbc by the tests of this crate (generator/): cargo test -p protocol generated

/// Bit rate of the bus, in bit/s.
pub const BIT_RATE_PER_S: u32 = 1000000;

/// Value table `EmergencyStopReason` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum EmergencyStopReason {
    /// 0: none.
    #[default]
    None = 0,
    /// 1: operator.
    Operator = 1,
    /// 2: controller-fault.
    ControllerFault = 2,
    /// 3: sensor-loss.
    SensorLoss = 3,
    /// 4: partner-lost.
    PartnerLost = 4,
    /// 5: rig-fault.
    RigFault = 5,
    /// 6: limit-exceeded.
    LimitExceeded = 6,
    /// 7: shutdown.
    Shutdown = 7,
}

impl EmergencyStopReason {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::None),
            1 => Some(Self::Operator),
            2 => Some(Self::ControllerFault),
            3 => Some(Self::SensorLoss),
            4 => Some(Self::PartnerLost),
            5 => Some(Self::RigFault),
            6 => Some(Self::LimitExceeded),
            7 => Some(Self::Shutdown),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Operator => "operator",
            Self::ControllerFault => "controller-fault",
            Self::SensorLoss => "sensor-loss",
            Self::PartnerLost => "partner-lost",
            Self::RigFault => "rig-fault",
            Self::LimitExceeded => "limit-exceeded",
            Self::Shutdown => "shutdown",
        }
    }
}

impl fmt::Display for EmergencyStopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `MainChainState` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum MainChainState {
    /// 0: waiting-for-rig.
    #[default]
    WaitingForRig = 0,
    /// 1: initial-positioning.
    InitialPositioning = 1,
    /// 2: preparing.
    Preparing = 2,
    /// 3: initial-force.
    InitialForce = 3,
    /// 4: settling.
    Settling = 4,
    /// 5: experiment.
    Experiment = 5,
    /// 6: final-settling.
    FinalSettling = 6,
    /// 7: done.
    Done = 7,
    /// 8: aborted.
    Aborted = 8,
    /// 9: fault.
    Fault = 9,
}

impl MainChainState {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::WaitingForRig),
            1 => Some(Self::InitialPositioning),
            2 => Some(Self::Preparing),
            3 => Some(Self::InitialForce),
            4 => Some(Self::Settling),
            5 => Some(Self::Experiment),
            6 => Some(Self::FinalSettling),
            7 => Some(Self::Done),
            8 => Some(Self::Aborted),
            9 => Some(Self::Fault),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::WaitingForRig => "waiting-for-rig",
            Self::InitialPositioning => "initial-positioning",
            Self::Preparing => "preparing",
            Self::InitialForce => "initial-force",
            Self::Settling => "settling",
            Self::Experiment => "experiment",
            Self::FinalSettling => "final-settling",
            Self::Done => "done",
            Self::Aborted => "aborted",
            Self::Fault => "fault",
        }
    }
}

impl fmt::Display for MainChainState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `ForceChainState` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ForceChainState {
    /// 0: idle.
    #[default]
    Idle = 0,
    /// 1: limited.
    Limited = 1,
    /// 2: standstill.
    Standstill = 2,
    /// 3: moving.
    Moving = 3,
    /// 4: initial-ramp.
    InitialRamp = 4,
    /// 5: load-profile.
    LoadProfile = 5,
    /// 6: done.
    Done = 6,
    /// 7: fault.
    Fault = 7,
}

impl ForceChainState {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::Idle),
            1 => Some(Self::Limited),
            2 => Some(Self::Standstill),
            3 => Some(Self::Moving),
            4 => Some(Self::InitialRamp),
            5 => Some(Self::LoadProfile),
            6 => Some(Self::Done),
            7 => Some(Self::Fault),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Limited => "limited",
            Self::Standstill => "standstill",
            Self::Moving => "moving",
            Self::InitialRamp => "initial-ramp",
            Self::LoadProfile => "load-profile",
            Self::Done => "done",
            Self::Fault => "fault",
        }
    }
}

impl fmt::Display for ForceChainState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `MatchingChainState` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum MatchingChainState {
    /// 0: idle.
    #[default]
    Idle = 0,
    /// 1: waiting-for-rest.
    WaitingForRest = 1,
    /// 2: averaging.
    Averaging = 2,
    /// 3: matched.
    Matched = 3,
    /// 4: fault.
    Fault = 4,
}

impl MatchingChainState {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::Idle),
            1 => Some(Self::WaitingForRest),
            2 => Some(Self::Averaging),
            3 => Some(Self::Matched),
            4 => Some(Self::Fault),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::WaitingForRest => "waiting-for-rest",
            Self::Averaging => "averaging",
            Self::Matched => "matched",
            Self::Fault => "fault",
        }
    }
}

impl fmt::Display for MatchingChainState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `EmergencyStopChainState` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum EmergencyStopChainState {
    /// 0: ready.
    #[default]
    Ready = 0,
    /// 1: tripped.
    Tripped = 1,
    /// 2: waiting-for-release.
    WaitingForRelease = 2,
    /// 3: recovering.
    Recovering = 3,
    /// 4: waiting-for-start.
    WaitingForStart = 4,
}

impl EmergencyStopChainState {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::Ready),
            1 => Some(Self::Tripped),
            2 => Some(Self::WaitingForRelease),
            3 => Some(Self::Recovering),
            4 => Some(Self::WaitingForStart),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ready => "ready",
            Self::Tripped => "tripped",
            Self::WaitingForRelease => "waiting-for-release",
            Self::Recovering => "recovering",
            Self::WaitingForStart => "waiting-for-start",
        }
    }
}

impl fmt::Display for EmergencyStopChainState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `RunControlCommand` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum RunControlCommand {
    /// 0: none.
    #[default]
    None = 0,
    /// 1: start.
    Start = 1,
    /// 2: abort.
    Abort = 2,
}

impl RunControlCommand {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::None),
            1 => Some(Self::Start),
            2 => Some(Self::Abort),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Start => "start",
            Self::Abort => "abort",
        }
    }
}

impl fmt::Display for RunControlCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `LinkRequest` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum LinkRequest {
    /// 0: unlink.
    #[default]
    Unlink = 0,
    /// 1: link.
    Link = 1,
}

impl LinkRequest {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::Unlink),
            1 => Some(Self::Link),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unlink => "unlink",
            Self::Link => "link",
        }
    }
}

impl fmt::Display for LinkRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Value table `HandSetPointAxis` of `rig.dbc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum HandSetPointAxis {
    /// 0: drive.
    #[default]
    Drive = 0,
    /// 1: load.
    Load = 1,
}

impl HandSetPointAxis {
    /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw {
            0 => Some(Self::Drive),
            1 => Some(Self::Load),
            _ => None,
        }
    }

    /// The counts that cross the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self as u8
    }

    /// The name in the value table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::Load => "load",
        }
    }
}

impl fmt::Display for HandSetPointAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// `ConsoleEmergencyStop`, 0x108, 2 bytes, 100 ms, sent by Console: Trips or releases the central emergency stop; at once, then repeated while tripped.
pub const CONSOLE_EMERGENCY_STOP: &MessageSpec = &MessageSpec {
    name: "ConsoleEmergencyStop",
    id: 0x108,
    length: 2,
    cycle_time_ms: 100,
    send_type: "IfActive",
    sender: "Console",
    comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
    checksum_start: None,
    reserved: 0xFE00,
    signals: &[
        SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["Rig", "DriveController", "LoadController", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "LoadController", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `RigEmergencyStop`, 0x109, 2 bytes, 100 ms, sent by Rig: Trips or releases the central emergency stop; at once, then repeated while tripped.
pub const RIG_EMERGENCY_STOP: &MessageSpec = &MessageSpec {
    name: "RigEmergencyStop",
    id: 0x109,
    length: 2,
    cycle_time_ms: 100,
    send_type: "IfActive",
    sender: "Rig",
    comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
    checksum_start: None,
    reserved: 0xFE00,
    signals: &[
        SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `DriveEmergencyStop`, 0x10A, 2 bytes, 100 ms, sent by DriveController: Trips or releases the central emergency stop; at once, then repeated while tripped.
pub const DRIVE_EMERGENCY_STOP: &MessageSpec = &MessageSpec {
    name: "DriveEmergencyStop",
    id: 0x10A,
    length: 2,
    cycle_time_ms: 100,
    send_type: "IfActive",
    sender: "DriveController",
    comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
    checksum_start: None,
    reserved: 0xFE00,
    signals: &[
        SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `LoadEmergencyStop`, 0x10B, 2 bytes, 100 ms, sent by LoadController: Trips or releases the central emergency stop; at once, then repeated while tripped.
pub const LOAD_EMERGENCY_STOP: &MessageSpec = &MessageSpec {
    name: "LoadEmergencyStop",
    id: 0x10B,
    length: 2,
    cycle_time_ms: 100,
    send_type: "IfActive",
    sender: "LoadController",
    comment: "Trips or releases the central emergency stop; at once, then repeated while tripped.",
    checksum_start: None,
    reserved: 0xFE00,
    signals: &[
        SignalSpec { name: "reason", field: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "release", field: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `DriveValveCommand`, 0x110, 5 bytes, 1 ms, sent by DriveController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
pub const DRIVE_VALVE_COMMAND: &MessageSpec = &MessageSpec {
    name: "DriveValveCommand",
    id: 0x110,
    length: 5,
    cycle_time_ms: 1,
    send_type: "Cyclic",
    sender: "DriveController",
    comment: "Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.",
    checksum_start: Some(32),
    reserved: 0xE0000000,
    signals: &[
        SignalSpec { name: "opening", field: "opening", unit: "", comment: "Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal.", start: 0, length: 12, signed: true, factor: 0.0004885197850512946, offset: 0.0, raw_min: -2047, raw_max: 2047, min: -1.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "alive", field: "alive", unit: "", comment: "Counts the sender's commands, modulo 16.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "echo", field: "echo", unit: "", comment: "Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it.", start: 16, length: 12, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4095, min: 0.0, max: 4095.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "enable", field: "enable", unit: "", comment: "The controller asks for its valve to act; without it the valve is shut.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `LoadValveCommand`, 0x111, 5 bytes, 1 ms, sent by LoadController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
pub const LOAD_VALVE_COMMAND: &MessageSpec = &MessageSpec {
    name: "LoadValveCommand",
    id: 0x111,
    length: 5,
    cycle_time_ms: 1,
    send_type: "Cyclic",
    sender: "LoadController",
    comment: "Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.",
    checksum_start: Some(32),
    reserved: 0xE0000000,
    signals: &[
        SignalSpec { name: "opening", field: "opening", unit: "", comment: "Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal.", start: 0, length: 12, signed: true, factor: 0.0004885197850512946, offset: 0.0, raw_min: -2047, raw_max: 2047, min: -1.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "alive", field: "alive", unit: "", comment: "Counts the sender's commands, modulo 16.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "echo", field: "echo", unit: "", comment: "Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it.", start: 16, length: 12, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4095, min: 0.0, max: 4095.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "enable", field: "enable", unit: "", comment: "The controller asks for its valve to act; without it the valve is shut.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `DriveSensors`, 0x120, 8 bytes, 1 ms, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
pub const DRIVE_SENSORS: &MessageSpec = &MessageSpec {
    name: "DriveSensors",
    id: 0x120,
    length: 8,
    cycle_time_ms: 1,
    send_type: "Cyclic",
    sender: "Rig",
    comment: "Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "position", field: "position_m", unit: "m", comment: "Position sensor, in rig coordinates for both axes.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "force", field: "force_n", unit: "N", comment: "Force between rod and carriage, compression positive.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "pressure_a", field: "pressure_a_pa", unit: "Pa", comment: "Absolute pressure of the cap side chamber.", start: 32, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "pressure_b", field: "pressure_b_pa", unit: "Pa", comment: "Absolute pressure of the rod side chamber.", start: 46, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "alive", field: "alive", unit: "", comment: "Cycle number of the sample, low 4 bits.", start: 60, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
    ],
};

/// `LoadSensors`, 0x121, 8 bytes, 1 ms, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
pub const LOAD_SENSORS: &MessageSpec = &MessageSpec {
    name: "LoadSensors",
    id: 0x121,
    length: 8,
    cycle_time_ms: 1,
    send_type: "Cyclic",
    sender: "Rig",
    comment: "Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "position", field: "position_m", unit: "m", comment: "Position sensor, in rig coordinates for both axes.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "force", field: "force_n", unit: "N", comment: "Force between rod and carriage, compression positive.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "pressure_a", field: "pressure_a_pa", unit: "Pa", comment: "Absolute pressure of the cap side chamber.", start: 32, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "pressure_b", field: "pressure_b_pa", unit: "Pa", comment: "Absolute pressure of the rod side chamber.", start: 46, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "alive", field: "alive", unit: "", comment: "Cycle number of the sample, low 4 bits.", start: 60, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
    ],
};

/// `Tick`, 0x130, 7 bytes, 10 ms, sent by Rig: The rig's time base: every 10 ms, and when cycles were skipped.
pub const TICK: &MessageSpec = &MessageSpec {
    name: "Tick",
    id: 0x130,
    length: 7,
    cycle_time_ms: 10,
    send_type: "CyclicAndOnChange",
    sender: "Rig",
    comment: "The rig's time base: every 10 ms, and when cycles were skipped.",
    checksum_start: None,
    reserved: 0xF8000000000000,
    signals: &[
        SignalSpec { name: "cycle", field: "cycle", unit: "", comment: "Number of the cycle in which the tick is sent, counted from 0 at the start of the rig.", start: 0, length: 32, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4294967295, min: 0.0, max: 4294967295.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "skipped", field: "skipped", unit: "", comment: "Cycles skipped by the rig in all, modulo 65536.", start: 32, length: 16, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 65535.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "catch_up", field: "catch_up", unit: "", comment: "This tick announces skipped cycles.", start: 48, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        SignalSpec { name: "lockstep", field: "lockstep", unit: "", comment: "The rig runs in lockstep: time is simulated.", start: 49, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        SignalSpec { name: "ending", field: "ending", unit: "", comment: "The rig stops after this tick.", start: 50, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["DriveController", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
    ],
};

/// `RigStatus`, 0x140, 4 bytes, 10 ms, sent by Rig: State of the rig. Bits 29 to 31 are reserved.
pub const RIG_STATUS: &MessageSpec = &MessageSpec {
    name: "RigStatus",
    id: 0x140,
    length: 4,
    cycle_time_ms: 10,
    send_type: "Cyclic",
    sender: "Rig",
    comment: "State of the rig. Bits 29 to 31 are reserved.",
    checksum_start: None,
    reserved: 0xE0000000,
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
};

/// `DriveChainStatus`, 0x150, 5 bytes, 10 ms, sent by DriveController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
pub const DRIVE_CHAIN_STATUS: &MessageSpec = &MessageSpec {
    name: "DriveChainStatus",
    id: 0x150,
    length: 5,
    cycle_time_ms: 10,
    send_type: "CyclicAndOnChange",
    sender: "DriveController",
    comment: "States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.",
    checksum_start: None,
    reserved: 0xFE0000,
    signals: &[
        SignalSpec { name: "main_chain", field: "main_chain", unit: "", comment: "State of the main sequence chain.", start: 0, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 9, min: 0.0, max: 9.0, values: &["waiting-for-rig", "initial-positioning", "preparing", "initial-force", "settling", "experiment", "final-settling", "done", "aborted", "fault"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "force_chain", field: "force_chain", unit: "", comment: "State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.", start: 4, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["idle", "limited", "standstill", "moving", "initial-ramp", "load-profile", "done", "fault"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "matching_chain", field: "matching_chain", unit: "", comment: "State of the chain that matches the two position sensors while the axes are linked.", start: 8, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["idle", "waiting-for-rest", "averaging", "matched", "fault"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "emergency_stop_chain", field: "emergency_stop_chain", unit: "", comment: "State of the emergency stop chain.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["ready", "tripped", "waiting-for-release", "recovering", "waiting-for-start"], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "ok", field: "ok", unit: "", comment: "The controller has what it needs and no fault.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Flag },
        SignalSpec { name: "experiment", field: "experiment", unit: "", comment: "Number of the experiment that runs or ran last.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "repetition", field: "repetition", unit: "", comment: "Repetition of the experiment, from 0.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "LoadController", "Console", "Bench"], kind: SignalKind::Integer },
    ],
};

/// `DriveChainValues`, 0x151, 8 bytes, 10 ms, sent by DriveController: Figures of a controller's sequence chains.
pub const DRIVE_CHAIN_VALUES: &MessageSpec = &MessageSpec {
    name: "DriveChainValues",
    id: 0x151,
    length: 8,
    cycle_time_ms: 10,
    send_type: "CyclicAndOnChange",
    sender: "DriveController",
    comment: "Figures of a controller's sequence chains.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "averaged_position", field: "averaged_position_m", unit: "m", comment: "Position sensor of the controller's axis, averaged over the last 0.2 s.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "position_set_point", field: "position_set_point_m", unit: "m", comment: "Set-point of the position.", start: 16, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "force_set_point", field: "force_set_point_n", unit: "N", comment: "Set-point of the force.", start: 32, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "control_error", field: "control_error_m", unit: "m", comment: "Position set-point minus position.", start: 48, length: 16, signed: true, factor: 1.5259254737998596e-5, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -0.5, max: 0.5, values: &[], receivers: &["LoadController", "Console", "Bench"], kind: SignalKind::Physical },
    ],
};

/// `LoadChainStatus`, 0x152, 5 bytes, 10 ms, sent by LoadController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
pub const LOAD_CHAIN_STATUS: &MessageSpec = &MessageSpec {
    name: "LoadChainStatus",
    id: 0x152,
    length: 5,
    cycle_time_ms: 10,
    send_type: "CyclicAndOnChange",
    sender: "LoadController",
    comment: "States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.",
    checksum_start: None,
    reserved: 0xFE0000,
    signals: &[
        SignalSpec { name: "main_chain", field: "main_chain", unit: "", comment: "State of the main sequence chain.", start: 0, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 9, min: 0.0, max: 9.0, values: &["waiting-for-rig", "initial-positioning", "preparing", "initial-force", "settling", "experiment", "final-settling", "done", "aborted", "fault"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "force_chain", field: "force_chain", unit: "", comment: "State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.", start: 4, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["idle", "limited", "standstill", "moving", "initial-ramp", "load-profile", "done", "fault"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "matching_chain", field: "matching_chain", unit: "", comment: "State of the chain that matches the two position sensors while the axes are linked.", start: 8, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["idle", "waiting-for-rest", "averaging", "matched", "fault"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "emergency_stop_chain", field: "emergency_stop_chain", unit: "", comment: "State of the emergency stop chain.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["ready", "tripped", "waiting-for-release", "recovering", "waiting-for-start"], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "ok", field: "ok", unit: "", comment: "The controller has what it needs and no fault.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Flag },
        SignalSpec { name: "experiment", field: "experiment", unit: "", comment: "Number of the experiment that runs or ran last.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Integer },
        SignalSpec { name: "repetition", field: "repetition", unit: "", comment: "Repetition of the experiment, from 0.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["Rig", "DriveController", "Console", "Bench"], kind: SignalKind::Integer },
    ],
};

/// `LoadChainValues`, 0x153, 8 bytes, 10 ms, sent by LoadController: Figures of a controller's sequence chains.
pub const LOAD_CHAIN_VALUES: &MessageSpec = &MessageSpec {
    name: "LoadChainValues",
    id: 0x153,
    length: 8,
    cycle_time_ms: 10,
    send_type: "CyclicAndOnChange",
    sender: "LoadController",
    comment: "Figures of a controller's sequence chains.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "averaged_position", field: "averaged_position_m", unit: "m", comment: "Position sensor of the controller's axis, averaged over the last 0.2 s.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "position_set_point", field: "position_set_point_m", unit: "m", comment: "Set-point of the position.", start: 16, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "force_set_point", field: "force_set_point_n", unit: "N", comment: "Set-point of the force.", start: 32, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
        SignalSpec { name: "control_error", field: "control_error_m", unit: "m", comment: "Position set-point minus position.", start: 48, length: 16, signed: true, factor: 1.5259254737998596e-5, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -0.5, max: 0.5, values: &[], receivers: &["DriveController", "Console", "Bench"], kind: SignalKind::Physical },
    ],
};

/// `RunControl`, 0x160, 2 bytes, event, sent by Console: Starts or aborts an experiment.
pub const RUN_CONTROL: &MessageSpec = &MessageSpec {
    name: "RunControl",
    id: 0x160,
    length: 2,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Console",
    comment: "Starts or aborts an experiment.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "command", field: "command", unit: "", comment: "What the controllers are asked for.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 2, min: 0.0, max: 2.0, values: &["none", "start", "abort"], receivers: &["DriveController", "LoadController", "Bench"], kind: SignalKind::Table },
        SignalSpec { name: "experiment", field: "experiment", unit: "", comment: "Number of the experiment to start.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], receivers: &["DriveController", "LoadController", "Bench"], kind: SignalKind::Integer },
    ],
};

/// `HandForce`, 0x180, 4 bytes, event, sent by Bench: Bench only: a hand pushes, in +x, until the next such frame.
pub const HAND_FORCE: &MessageSpec = &MessageSpec {
    name: "HandForce",
    id: 0x180,
    length: 4,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Bench",
    comment: "Bench only: a hand pushes, in +x, until the next such frame.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "carriage", field: "carriage_n", unit: "N", comment: "Force of the hand on the carriage.", start: 0, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["Rig", "Console"], kind: SignalKind::Physical },
        SignalSpec { name: "load_eye", field: "load_eye_n", unit: "N", comment: "Force of the hand on the load eye.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["Rig", "Console"], kind: SignalKind::Physical },
    ],
};

/// `Link`, 0x181, 1 bytes, event, sent by Bench: Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
pub const LINK: &MessageSpec = &MessageSpec {
    name: "Link",
    id: 0x181,
    length: 1,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Bench",
    comment: "Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.",
    checksum_start: None,
    reserved: 0xFE,
    signals: &[
        SignalSpec { name: "request", field: "request", unit: "", comment: "What the rig is asked for; linking is refused outside the gap.", start: 0, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &["unlink", "link"], receivers: &["Rig", "Console"], kind: SignalKind::Table },
    ],
};

/// `Weights`, 0x182, 2 bytes, event, sent by Bench: Bench only: puts weights on the carriage.
pub const WEIGHTS: &MessageSpec = &MessageSpec {
    name: "Weights",
    id: 0x182,
    length: 2,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Bench",
    comment: "Bench only: puts weights on the carriage.",
    checksum_start: None,
    reserved: 0x0,
    signals: &[
        SignalSpec { name: "added_mass", field: "added_mass_kg", unit: "kg", comment: "Mass of all weights on the carriage.", start: 0, length: 16, signed: false, factor: 0.00030518043793392844, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 20.0, values: &[], receivers: &["Rig", "Console"], kind: SignalKind::Physical },
    ],
};

/// `FaultMark`, 0x183, 3 bytes, event, sent by Bench: Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
pub const FAULT_MARK: &MessageSpec = &MessageSpec {
    name: "FaultMark",
    id: 0x183,
    length: 3,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Bench",
    comment: "Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.",
    checksum_start: None,
    reserved: 0xFE0000,
    signals: &[
        SignalSpec { name: "fault", field: "fault", unit: "", comment: "Number of the fault in the bench's plan.", start: 0, length: 16, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 65535.0, values: &[], receivers: &["Console"], kind: SignalKind::Integer },
        SignalSpec { name: "active", field: "active", unit: "", comment: "The fault begins; otherwise it ends.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], receivers: &["Console"], kind: SignalKind::Flag },
    ],
};

/// `HandSetPoint`, 0x184, 5 bytes, event, sent by Bench: Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
pub const HAND_SET_POINT: &MessageSpec = &MessageSpec {
    name: "HandSetPoint",
    id: 0x184,
    length: 5,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Bench",
    comment: "Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.",
    checksum_start: None,
    reserved: 0xFE,
    signals: &[
        SignalSpec { name: "axis", field: "axis", unit: "", comment: "Whom it is for.", start: 0, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &["drive", "load"], receivers: &["DriveController", "LoadController", "Console"], kind: SignalKind::Table },
        SignalSpec { name: "position", field: "position_m", unit: "m", comment: "Position that is to be reached, rig coordinate; an axis that is force controlled ignores it.", start: 8, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], receivers: &["DriveController", "LoadController", "Console"], kind: SignalKind::Physical },
        SignalSpec { name: "force", field: "force_n", unit: "N", comment: "Force that is to be reached, compression positive; an axis that is position controlled ignores it.", start: 24, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], receivers: &["DriveController", "LoadController", "Console"], kind: SignalKind::Physical },
    ],
};

/// `DriveXcpCommand`, 0x1E0, 8 bytes, event, sent by Console: XCP command packet to a controller, padded to 8 bytes.
pub const DRIVE_XCP_COMMAND: &MessageSpec = &MessageSpec {
    name: "DriveXcpCommand",
    id: 0x1E0,
    length: 8,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Console",
    comment: "XCP command packet to a controller, padded to 8 bytes.",
    checksum_start: None,
    reserved: 0x0,
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
};

/// `DriveXcpResponse`, 0x1E1, 8 bytes, event, sent by DriveController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
pub const DRIVE_XCP_RESPONSE: &MessageSpec = &MessageSpec {
    name: "DriveXcpResponse",
    id: 0x1E1,
    length: 8,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "DriveController",
    comment: "XCP response, event or DAQ packet of a controller, padded to 8 bytes.",
    checksum_start: None,
    reserved: 0x0,
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
};

/// `LoadXcpCommand`, 0x1E2, 8 bytes, event, sent by Console: XCP command packet to a controller, padded to 8 bytes.
pub const LOAD_XCP_COMMAND: &MessageSpec = &MessageSpec {
    name: "LoadXcpCommand",
    id: 0x1E2,
    length: 8,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "Console",
    comment: "XCP command packet to a controller, padded to 8 bytes.",
    checksum_start: None,
    reserved: 0x0,
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
};

/// `LoadXcpResponse`, 0x1E3, 8 bytes, event, sent by LoadController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
pub const LOAD_XCP_RESPONSE: &MessageSpec = &MessageSpec {
    name: "LoadXcpResponse",
    id: 0x1E3,
    length: 8,
    cycle_time_ms: 0,
    send_type: "Event",
    sender: "LoadController",
    comment: "XCP response, event or DAQ packet of a controller, padded to 8 bytes.",
    checksum_start: None,
    reserved: 0x0,
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
};

/// Every message of `rig.dbc`, by identifier.
pub const MESSAGES: &[&MessageSpec] = &[CONSOLE_EMERGENCY_STOP, RIG_EMERGENCY_STOP, DRIVE_EMERGENCY_STOP, LOAD_EMERGENCY_STOP, DRIVE_VALVE_COMMAND, LOAD_VALVE_COMMAND, DRIVE_SENSORS, LOAD_SENSORS, TICK, RIG_STATUS, DRIVE_CHAIN_STATUS, DRIVE_CHAIN_VALUES, LOAD_CHAIN_STATUS, LOAD_CHAIN_VALUES, RUN_CONTROL, HAND_FORCE, LINK, WEIGHTS, FAULT_MARK, HAND_SET_POINT, DRIVE_XCP_COMMAND, DRIVE_XCP_RESPONSE, LOAD_XCP_COMMAND, LOAD_XCP_RESPONSE];

/// Trips or releases the central emergency stop; at once, then repeated while tripped.
///
/// Carried by [`CONSOLE_EMERGENCY_STOP`], [`RIG_EMERGENCY_STOP`], [`DRIVE_EMERGENCY_STOP`], [`LOAD_EMERGENCY_STOP`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EmergencyStop {
    /// Why the sender stops the rig; none in a release.
    pub reason: EmergencyStopReason,
    /// The sender withdraws its stop; the rig recovers when every sender has.
    pub release: bool,
}

impl EmergencyStop {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.reason.raw()))?;
        word |= put_counts(spec, 1, i64::from(self.release))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            reason: EmergencyStopReason::from_raw(raw(spec, 0, word) as u8).ok_or_else(|| not_in_table(spec, 0, word))?,
            release: counts(spec, 1, word)? != 0,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.reason.raw()));
        visit(&spec.signals[1], f64::from(self.release));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[reason, release, ] = values else { return None };
        Some(Self {
            reason: EmergencyStopReason::from_raw(exact(reason)?)?,
            release: exact::<u8>(release).filter(|bit| *bit < 2)? != 0,
        })
    }
}

/// Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
///
/// Carried by [`DRIVE_VALVE_COMMAND`], [`LOAD_VALVE_COMMAND`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ValveCommand {
    /// Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal. Range: -1 to 1.
    pub opening: f64,
    /// Counts the sender's commands, modulo 16. Range: 0 to 15.
    pub alive: u8,
    /// Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it. Range: 0 to 4095.
    pub echo: u16,
    /// The controller asks for its valve to act; without it the valve is shut.
    pub enable: bool,
}

impl ValveCommand {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_physical(spec, 0, self.opening)?;
        word |= put_counts(spec, 1, i64::from(self.alive))?;
        word |= put_counts(spec, 2, i64::from(self.echo))?;
        word |= put_counts(spec, 3, i64::from(self.enable))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            opening: physical(spec, 0, word)?,
            alive: counts(spec, 1, word)? as u8,
            echo: counts(spec, 2, word)? as u16,
            enable: counts(spec, 3, word)? != 0,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], self.opening);
        visit(&spec.signals[1], f64::from(self.alive));
        visit(&spec.signals[2], f64::from(self.echo));
        visit(&spec.signals[3], f64::from(self.enable));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[opening, alive, echo, enable, ] = values else { return None };
        Some(Self {
            opening,
            alive: exact(alive)?,
            echo: exact(echo)?,
            enable: exact::<u8>(enable).filter(|bit| *bit < 2)? != 0,
        })
    }
}

/// Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
///
/// Carried by [`DRIVE_SENSORS`], [`LOAD_SENSORS`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Position sensor, in rig coordinates for both axes. Range: 0 to 0.5 m.
    pub position_m: f64,
    /// Force between rod and carriage, compression positive. Range: -2000 to 2000 N.
    pub force_n: f64,
    /// Absolute pressure of the cap side chamber. Range: 0 to 1000000 Pa.
    pub pressure_a_pa: f64,
    /// Absolute pressure of the rod side chamber. Range: 0 to 1000000 Pa.
    pub pressure_b_pa: f64,
    /// Cycle number of the sample, low 4 bits. Range: 0 to 15.
    pub alive: u8,
}

impl Sensors {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_physical(spec, 0, self.position_m)?;
        word |= put_physical(spec, 1, self.force_n)?;
        word |= put_physical(spec, 2, self.pressure_a_pa)?;
        word |= put_physical(spec, 3, self.pressure_b_pa)?;
        word |= put_counts(spec, 4, i64::from(self.alive))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            position_m: physical(spec, 0, word)?,
            force_n: physical(spec, 1, word)?,
            pressure_a_pa: physical(spec, 2, word)?,
            pressure_b_pa: physical(spec, 3, word)?,
            alive: counts(spec, 4, word)? as u8,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], self.position_m);
        visit(&spec.signals[1], self.force_n);
        visit(&spec.signals[2], self.pressure_a_pa);
        visit(&spec.signals[3], self.pressure_b_pa);
        visit(&spec.signals[4], f64::from(self.alive));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[position_m, force_n, pressure_a_pa, pressure_b_pa, alive, ] = values else { return None };
        Some(Self {
            position_m,
            force_n,
            pressure_a_pa,
            pressure_b_pa,
            alive: exact(alive)?,
        })
    }
}

/// The rig's time base: every 10 ms, and when cycles were skipped.
///
/// Carried by [`TICK`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tick {
    /// Number of the cycle in which the tick is sent, counted from 0 at the start of the rig. Range: 0 to 4294967295.
    pub cycle: u32,
    /// Cycles skipped by the rig in all, modulo 65536. Range: 0 to 65535.
    pub skipped: u16,
    /// This tick announces skipped cycles.
    pub catch_up: bool,
    /// The rig runs in lockstep: time is simulated.
    pub lockstep: bool,
    /// The rig stops after this tick.
    pub ending: bool,
}

impl Tick {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.cycle))?;
        word |= put_counts(spec, 1, i64::from(self.skipped))?;
        word |= put_counts(spec, 2, i64::from(self.catch_up))?;
        word |= put_counts(spec, 3, i64::from(self.lockstep))?;
        word |= put_counts(spec, 4, i64::from(self.ending))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            cycle: counts(spec, 0, word)? as u32,
            skipped: counts(spec, 1, word)? as u16,
            catch_up: counts(spec, 2, word)? != 0,
            lockstep: counts(spec, 3, word)? != 0,
            ending: counts(spec, 4, word)? != 0,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.cycle));
        visit(&spec.signals[1], f64::from(self.skipped));
        visit(&spec.signals[2], f64::from(self.catch_up));
        visit(&spec.signals[3], f64::from(self.lockstep));
        visit(&spec.signals[4], f64::from(self.ending));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[cycle, skipped, catch_up, lockstep, ending, ] = values else { return None };
        Some(Self {
            cycle: exact(cycle)?,
            skipped: exact(skipped)?,
            catch_up: exact::<u8>(catch_up).filter(|bit| *bit < 2)? != 0,
            lockstep: exact::<u8>(lockstep).filter(|bit| *bit < 2)? != 0,
            ending: exact::<u8>(ending).filter(|bit| *bit < 2)? != 0,
        })
    }
}

/// State of the rig. Bits 29 to 31 are reserved.
///
/// Carried by [`RIG_STATUS`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigStatus {
    /// Absolute pressure of the supply node. Range: 0 to 1000000 Pa.
    pub supply_pressure_pa: f64,
    /// The load eye is linked to the carriage.
    pub linked: bool,
    /// The emergency stop is tripped: supply discharged, valve commands count as 0.
    pub emergency_stop: bool,
    /// The non-return valves on the chambers are shut.
    pub check_valves_shut: bool,
    /// The drive axis's position sensor was beyond its range since the last status.
    pub drive_position_saturated: bool,
    /// The drive axis's force sensor was beyond its range since the last status.
    pub drive_force_saturated: bool,
    /// The drive axis's pressure a sensor was beyond its range since the last status.
    pub drive_pressure_a_saturated: bool,
    /// The drive axis's pressure b sensor was beyond its range since the last status.
    pub drive_pressure_b_saturated: bool,
    /// The load axis's position sensor was beyond its range since the last status.
    pub load_position_saturated: bool,
    /// The load axis's force sensor was beyond its range since the last status.
    pub load_force_saturated: bool,
    /// The load axis's pressure a sensor was beyond its range since the last status.
    pub load_pressure_a_saturated: bool,
    /// The load axis's pressure b sensor was beyond its range since the last status.
    pub load_pressure_b_saturated: bool,
    /// The drive valve is shut because its newest command is older than 20 cycles.
    pub drive_stale: bool,
    /// The load valve is shut because its newest command is older than 20 cycles.
    pub load_stale: bool,
    /// Latched fault: two sources send drive valve commands; the valve is shut until one is silent for 20 cycles.
    pub drive_two_sources: bool,
    /// Latched fault: two sources send load valve commands; the valve is shut until one is silent for 20 cycles.
    pub load_two_sources: bool,
}

impl RigStatus {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_physical(spec, 0, self.supply_pressure_pa)?;
        word |= put_counts(spec, 1, i64::from(self.linked))?;
        word |= put_counts(spec, 2, i64::from(self.emergency_stop))?;
        word |= put_counts(spec, 3, i64::from(self.check_valves_shut))?;
        word |= put_counts(spec, 4, i64::from(self.drive_position_saturated))?;
        word |= put_counts(spec, 5, i64::from(self.drive_force_saturated))?;
        word |= put_counts(spec, 6, i64::from(self.drive_pressure_a_saturated))?;
        word |= put_counts(spec, 7, i64::from(self.drive_pressure_b_saturated))?;
        word |= put_counts(spec, 8, i64::from(self.load_position_saturated))?;
        word |= put_counts(spec, 9, i64::from(self.load_force_saturated))?;
        word |= put_counts(spec, 10, i64::from(self.load_pressure_a_saturated))?;
        word |= put_counts(spec, 11, i64::from(self.load_pressure_b_saturated))?;
        word |= put_counts(spec, 12, i64::from(self.drive_stale))?;
        word |= put_counts(spec, 13, i64::from(self.load_stale))?;
        word |= put_counts(spec, 14, i64::from(self.drive_two_sources))?;
        word |= put_counts(spec, 15, i64::from(self.load_two_sources))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            supply_pressure_pa: physical(spec, 0, word)?,
            linked: counts(spec, 1, word)? != 0,
            emergency_stop: counts(spec, 2, word)? != 0,
            check_valves_shut: counts(spec, 3, word)? != 0,
            drive_position_saturated: counts(spec, 4, word)? != 0,
            drive_force_saturated: counts(spec, 5, word)? != 0,
            drive_pressure_a_saturated: counts(spec, 6, word)? != 0,
            drive_pressure_b_saturated: counts(spec, 7, word)? != 0,
            load_position_saturated: counts(spec, 8, word)? != 0,
            load_force_saturated: counts(spec, 9, word)? != 0,
            load_pressure_a_saturated: counts(spec, 10, word)? != 0,
            load_pressure_b_saturated: counts(spec, 11, word)? != 0,
            drive_stale: counts(spec, 12, word)? != 0,
            load_stale: counts(spec, 13, word)? != 0,
            drive_two_sources: counts(spec, 14, word)? != 0,
            load_two_sources: counts(spec, 15, word)? != 0,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], self.supply_pressure_pa);
        visit(&spec.signals[1], f64::from(self.linked));
        visit(&spec.signals[2], f64::from(self.emergency_stop));
        visit(&spec.signals[3], f64::from(self.check_valves_shut));
        visit(&spec.signals[4], f64::from(self.drive_position_saturated));
        visit(&spec.signals[5], f64::from(self.drive_force_saturated));
        visit(&spec.signals[6], f64::from(self.drive_pressure_a_saturated));
        visit(&spec.signals[7], f64::from(self.drive_pressure_b_saturated));
        visit(&spec.signals[8], f64::from(self.load_position_saturated));
        visit(&spec.signals[9], f64::from(self.load_force_saturated));
        visit(&spec.signals[10], f64::from(self.load_pressure_a_saturated));
        visit(&spec.signals[11], f64::from(self.load_pressure_b_saturated));
        visit(&spec.signals[12], f64::from(self.drive_stale));
        visit(&spec.signals[13], f64::from(self.load_stale));
        visit(&spec.signals[14], f64::from(self.drive_two_sources));
        visit(&spec.signals[15], f64::from(self.load_two_sources));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[supply_pressure_pa, linked, emergency_stop, check_valves_shut, drive_position_saturated, drive_force_saturated, drive_pressure_a_saturated, drive_pressure_b_saturated, load_position_saturated, load_force_saturated, load_pressure_a_saturated, load_pressure_b_saturated, drive_stale, load_stale, drive_two_sources, load_two_sources, ] = values else { return None };
        Some(Self {
            supply_pressure_pa,
            linked: exact::<u8>(linked).filter(|bit| *bit < 2)? != 0,
            emergency_stop: exact::<u8>(emergency_stop).filter(|bit| *bit < 2)? != 0,
            check_valves_shut: exact::<u8>(check_valves_shut).filter(|bit| *bit < 2)? != 0,
            drive_position_saturated: exact::<u8>(drive_position_saturated).filter(|bit| *bit < 2)? != 0,
            drive_force_saturated: exact::<u8>(drive_force_saturated).filter(|bit| *bit < 2)? != 0,
            drive_pressure_a_saturated: exact::<u8>(drive_pressure_a_saturated).filter(|bit| *bit < 2)? != 0,
            drive_pressure_b_saturated: exact::<u8>(drive_pressure_b_saturated).filter(|bit| *bit < 2)? != 0,
            load_position_saturated: exact::<u8>(load_position_saturated).filter(|bit| *bit < 2)? != 0,
            load_force_saturated: exact::<u8>(load_force_saturated).filter(|bit| *bit < 2)? != 0,
            load_pressure_a_saturated: exact::<u8>(load_pressure_a_saturated).filter(|bit| *bit < 2)? != 0,
            load_pressure_b_saturated: exact::<u8>(load_pressure_b_saturated).filter(|bit| *bit < 2)? != 0,
            drive_stale: exact::<u8>(drive_stale).filter(|bit| *bit < 2)? != 0,
            load_stale: exact::<u8>(load_stale).filter(|bit| *bit < 2)? != 0,
            drive_two_sources: exact::<u8>(drive_two_sources).filter(|bit| *bit < 2)? != 0,
            load_two_sources: exact::<u8>(load_two_sources).filter(|bit| *bit < 2)? != 0,
        })
    }
}

/// States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
///
/// Carried by [`DRIVE_CHAIN_STATUS`], [`LOAD_CHAIN_STATUS`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChainStatus {
    /// State of the main sequence chain.
    pub main_chain: MainChainState,
    /// State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.
    pub force_chain: ForceChainState,
    /// State of the chain that matches the two position sensors while the axes are linked.
    pub matching_chain: MatchingChainState,
    /// State of the emergency stop chain.
    pub emergency_stop_chain: EmergencyStopChainState,
    /// The controller has what it needs and no fault.
    pub ok: bool,
    /// Number of the experiment that runs or ran last. Range: 0 to 255.
    pub experiment: u8,
    /// Repetition of the experiment, from 0. Range: 0 to 255.
    pub repetition: u8,
}

impl ChainStatus {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.main_chain.raw()))?;
        word |= put_counts(spec, 1, i64::from(self.force_chain.raw()))?;
        word |= put_counts(spec, 2, i64::from(self.matching_chain.raw()))?;
        word |= put_counts(spec, 3, i64::from(self.emergency_stop_chain.raw()))?;
        word |= put_counts(spec, 4, i64::from(self.ok))?;
        word |= put_counts(spec, 5, i64::from(self.experiment))?;
        word |= put_counts(spec, 6, i64::from(self.repetition))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            main_chain: MainChainState::from_raw(raw(spec, 0, word) as u8).ok_or_else(|| not_in_table(spec, 0, word))?,
            force_chain: ForceChainState::from_raw(raw(spec, 1, word) as u8).ok_or_else(|| not_in_table(spec, 1, word))?,
            matching_chain: MatchingChainState::from_raw(raw(spec, 2, word) as u8).ok_or_else(|| not_in_table(spec, 2, word))?,
            emergency_stop_chain: EmergencyStopChainState::from_raw(raw(spec, 3, word) as u8).ok_or_else(|| not_in_table(spec, 3, word))?,
            ok: counts(spec, 4, word)? != 0,
            experiment: counts(spec, 5, word)? as u8,
            repetition: counts(spec, 6, word)? as u8,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.main_chain.raw()));
        visit(&spec.signals[1], f64::from(self.force_chain.raw()));
        visit(&spec.signals[2], f64::from(self.matching_chain.raw()));
        visit(&spec.signals[3], f64::from(self.emergency_stop_chain.raw()));
        visit(&spec.signals[4], f64::from(self.ok));
        visit(&spec.signals[5], f64::from(self.experiment));
        visit(&spec.signals[6], f64::from(self.repetition));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[main_chain, force_chain, matching_chain, emergency_stop_chain, ok, experiment, repetition, ] = values else { return None };
        Some(Self {
            main_chain: MainChainState::from_raw(exact(main_chain)?)?,
            force_chain: ForceChainState::from_raw(exact(force_chain)?)?,
            matching_chain: MatchingChainState::from_raw(exact(matching_chain)?)?,
            emergency_stop_chain: EmergencyStopChainState::from_raw(exact(emergency_stop_chain)?)?,
            ok: exact::<u8>(ok).filter(|bit| *bit < 2)? != 0,
            experiment: exact(experiment)?,
            repetition: exact(repetition)?,
        })
    }
}

/// Figures of a controller's sequence chains.
///
/// Carried by [`DRIVE_CHAIN_VALUES`], [`LOAD_CHAIN_VALUES`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChainValues {
    /// Position sensor of the controller's axis, averaged over the last 0.2 s. Range: 0 to 0.5 m.
    pub averaged_position_m: f64,
    /// Set-point of the position. Range: 0 to 0.5 m.
    pub position_set_point_m: f64,
    /// Set-point of the force. Range: -2000 to 2000 N.
    pub force_set_point_n: f64,
    /// Position set-point minus position. Range: -0.5 to 0.5 m.
    pub control_error_m: f64,
}

impl ChainValues {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_physical(spec, 0, self.averaged_position_m)?;
        word |= put_physical(spec, 1, self.position_set_point_m)?;
        word |= put_physical(spec, 2, self.force_set_point_n)?;
        word |= put_physical(spec, 3, self.control_error_m)?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            averaged_position_m: physical(spec, 0, word)?,
            position_set_point_m: physical(spec, 1, word)?,
            force_set_point_n: physical(spec, 2, word)?,
            control_error_m: physical(spec, 3, word)?,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], self.averaged_position_m);
        visit(&spec.signals[1], self.position_set_point_m);
        visit(&spec.signals[2], self.force_set_point_n);
        visit(&spec.signals[3], self.control_error_m);
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[averaged_position_m, position_set_point_m, force_set_point_n, control_error_m, ] = values else { return None };
        Some(Self {
            averaged_position_m,
            position_set_point_m,
            force_set_point_n,
            control_error_m,
        })
    }
}

/// Starts or aborts an experiment.
///
/// Carried by [`RUN_CONTROL`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunControl {
    /// What the controllers are asked for.
    pub command: RunControlCommand,
    /// Number of the experiment to start. Range: 0 to 255.
    pub experiment: u8,
}

impl RunControl {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.command.raw()))?;
        word |= put_counts(spec, 1, i64::from(self.experiment))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            command: RunControlCommand::from_raw(raw(spec, 0, word) as u8).ok_or_else(|| not_in_table(spec, 0, word))?,
            experiment: counts(spec, 1, word)? as u8,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.command.raw()));
        visit(&spec.signals[1], f64::from(self.experiment));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[command, experiment, ] = values else { return None };
        Some(Self {
            command: RunControlCommand::from_raw(exact(command)?)?,
            experiment: exact(experiment)?,
        })
    }
}

/// Bench only: a hand pushes, in +x, until the next such frame.
///
/// Carried by [`HAND_FORCE`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandForce {
    /// Force of the hand on the carriage. Range: -2000 to 2000 N.
    pub carriage_n: f64,
    /// Force of the hand on the load eye. Range: -2000 to 2000 N.
    pub load_eye_n: f64,
}

impl HandForce {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_physical(spec, 0, self.carriage_n)?;
        word |= put_physical(spec, 1, self.load_eye_n)?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            carriage_n: physical(spec, 0, word)?,
            load_eye_n: physical(spec, 1, word)?,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], self.carriage_n);
        visit(&spec.signals[1], self.load_eye_n);
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[carriage_n, load_eye_n, ] = values else { return None };
        Some(Self {
            carriage_n,
            load_eye_n,
        })
    }
}

/// Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
///
/// Carried by [`LINK`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// What the rig is asked for; linking is refused outside the gap.
    pub request: LinkRequest,
}

impl Link {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.request.raw()))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            request: LinkRequest::from_raw(raw(spec, 0, word) as u8).ok_or_else(|| not_in_table(spec, 0, word))?,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.request.raw()));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[request, ] = values else { return None };
        Some(Self {
            request: LinkRequest::from_raw(exact(request)?)?,
        })
    }
}

/// Bench only: puts weights on the carriage.
///
/// Carried by [`WEIGHTS`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weights {
    /// Mass of all weights on the carriage. Range: 0 to 20 kg.
    pub added_mass_kg: f64,
}

impl Weights {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_physical(spec, 0, self.added_mass_kg)?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            added_mass_kg: physical(spec, 0, word)?,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], self.added_mass_kg);
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[added_mass_kg, ] = values else { return None };
        Some(Self {
            added_mass_kg,
        })
    }
}

/// Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
///
/// Carried by [`FAULT_MARK`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaultMark {
    /// Number of the fault in the bench's plan. Range: 0 to 65535.
    pub fault: u16,
    /// The fault begins; otherwise it ends.
    pub active: bool,
}

impl FaultMark {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.fault))?;
        word |= put_counts(spec, 1, i64::from(self.active))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            fault: counts(spec, 0, word)? as u16,
            active: counts(spec, 1, word)? != 0,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.fault));
        visit(&spec.signals[1], f64::from(self.active));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[fault, active, ] = values else { return None };
        Some(Self {
            fault: exact(fault)?,
            active: exact::<u8>(active).filter(|bit| *bit < 2)? != 0,
        })
    }
}

/// Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
///
/// Carried by [`HAND_SET_POINT`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandSetPoint {
    /// Whom it is for.
    pub axis: HandSetPointAxis,
    /// Position that is to be reached, rig coordinate; an axis that is force controlled ignores it. Range: 0 to 0.5 m.
    pub position_m: f64,
    /// Force that is to be reached, compression positive; an axis that is position controlled ignores it. Range: -2000 to 2000 N.
    pub force_n: f64,
}

impl HandSetPoint {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.axis.raw()))?;
        word |= put_physical(spec, 1, self.position_m)?;
        word |= put_physical(spec, 2, self.force_n)?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            axis: HandSetPointAxis::from_raw(raw(spec, 0, word) as u8).ok_or_else(|| not_in_table(spec, 0, word))?,
            position_m: physical(spec, 1, word)?,
            force_n: physical(spec, 2, word)?,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.axis.raw()));
        visit(&spec.signals[1], self.position_m);
        visit(&spec.signals[2], self.force_n);
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[axis, position_m, force_n, ] = values else { return None };
        Some(Self {
            axis: HandSetPointAxis::from_raw(exact(axis)?)?,
            position_m,
            force_n,
        })
    }
}

/// XCP command packet to a controller, padded to 8 bytes.
///
/// Carried by [`DRIVE_XCP_COMMAND`], [`LOAD_XCP_COMMAND`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct XcpCommand {
    /// Byte 0 of the packet. Range: 0 to 255.
    pub byte0: u8,
    /// Byte 1 of the packet. Range: 0 to 255.
    pub byte1: u8,
    /// Byte 2 of the packet. Range: 0 to 255.
    pub byte2: u8,
    /// Byte 3 of the packet. Range: 0 to 255.
    pub byte3: u8,
    /// Byte 4 of the packet. Range: 0 to 255.
    pub byte4: u8,
    /// Byte 5 of the packet. Range: 0 to 255.
    pub byte5: u8,
    /// Byte 6 of the packet. Range: 0 to 255.
    pub byte6: u8,
    /// Byte 7 of the packet. Range: 0 to 255.
    pub byte7: u8,
}

impl XcpCommand {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.byte0))?;
        word |= put_counts(spec, 1, i64::from(self.byte1))?;
        word |= put_counts(spec, 2, i64::from(self.byte2))?;
        word |= put_counts(spec, 3, i64::from(self.byte3))?;
        word |= put_counts(spec, 4, i64::from(self.byte4))?;
        word |= put_counts(spec, 5, i64::from(self.byte5))?;
        word |= put_counts(spec, 6, i64::from(self.byte6))?;
        word |= put_counts(spec, 7, i64::from(self.byte7))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            byte0: counts(spec, 0, word)? as u8,
            byte1: counts(spec, 1, word)? as u8,
            byte2: counts(spec, 2, word)? as u8,
            byte3: counts(spec, 3, word)? as u8,
            byte4: counts(spec, 4, word)? as u8,
            byte5: counts(spec, 5, word)? as u8,
            byte6: counts(spec, 6, word)? as u8,
            byte7: counts(spec, 7, word)? as u8,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.byte0));
        visit(&spec.signals[1], f64::from(self.byte1));
        visit(&spec.signals[2], f64::from(self.byte2));
        visit(&spec.signals[3], f64::from(self.byte3));
        visit(&spec.signals[4], f64::from(self.byte4));
        visit(&spec.signals[5], f64::from(self.byte5));
        visit(&spec.signals[6], f64::from(self.byte6));
        visit(&spec.signals[7], f64::from(self.byte7));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[byte0, byte1, byte2, byte3, byte4, byte5, byte6, byte7, ] = values else { return None };
        Some(Self {
            byte0: exact(byte0)?,
            byte1: exact(byte1)?,
            byte2: exact(byte2)?,
            byte3: exact(byte3)?,
            byte4: exact(byte4)?,
            byte5: exact(byte5)?,
            byte6: exact(byte6)?,
            byte7: exact(byte7)?,
        })
    }
}

impl XcpCommand {
    /// The payload from its bytes in the order of the wire.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 8]) -> Self {
        let [byte0, byte1, byte2, byte3, byte4, byte5, byte6, byte7] = bytes;
        Self { byte0, byte1, byte2, byte3, byte4, byte5, byte6, byte7 }
    }

    /// The bytes in the order of the wire.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 8] {
        [self.byte0, self.byte1, self.byte2, self.byte3, self.byte4, self.byte5, self.byte6, self.byte7]
    }
}

/// XCP response, event or DAQ packet of a controller, padded to 8 bytes.
///
/// Carried by [`DRIVE_XCP_RESPONSE`], [`LOAD_XCP_RESPONSE`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct XcpResponse {
    /// Byte 0 of the packet. Range: 0 to 255.
    pub byte0: u8,
    /// Byte 1 of the packet. Range: 0 to 255.
    pub byte1: u8,
    /// Byte 2 of the packet. Range: 0 to 255.
    pub byte2: u8,
    /// Byte 3 of the packet. Range: 0 to 255.
    pub byte3: u8,
    /// Byte 4 of the packet. Range: 0 to 255.
    pub byte4: u8,
    /// Byte 5 of the packet. Range: 0 to 255.
    pub byte5: u8,
    /// Byte 6 of the packet. Range: 0 to 255.
    pub byte6: u8,
    /// Byte 7 of the packet. Range: 0 to 255.
    pub byte7: u8,
}

impl XcpResponse {
    fn pack(&self, spec: &'static MessageSpec) -> Result<u64, EncodeError> {
        let mut word = 0;
        word |= put_counts(spec, 0, i64::from(self.byte0))?;
        word |= put_counts(spec, 1, i64::from(self.byte1))?;
        word |= put_counts(spec, 2, i64::from(self.byte2))?;
        word |= put_counts(spec, 3, i64::from(self.byte3))?;
        word |= put_counts(spec, 4, i64::from(self.byte4))?;
        word |= put_counts(spec, 5, i64::from(self.byte5))?;
        word |= put_counts(spec, 6, i64::from(self.byte6))?;
        word |= put_counts(spec, 7, i64::from(self.byte7))?;
        Ok(word)
    }

    fn unpack(spec: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
        Ok(Self {
            byte0: counts(spec, 0, word)? as u8,
            byte1: counts(spec, 1, word)? as u8,
            byte2: counts(spec, 2, word)? as u8,
            byte3: counts(spec, 3, word)? as u8,
            byte4: counts(spec, 4, word)? as u8,
            byte5: counts(spec, 5, word)? as u8,
            byte6: counts(spec, 6, word)? as u8,
            byte7: counts(spec, 7, word)? as u8,
        })
    }

    fn visit(&self, spec: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
        visit(&spec.signals[0], f64::from(self.byte0));
        visit(&spec.signals[1], f64::from(self.byte1));
        visit(&spec.signals[2], f64::from(self.byte2));
        visit(&spec.signals[3], f64::from(self.byte3));
        visit(&spec.signals[4], f64::from(self.byte4));
        visit(&spec.signals[5], f64::from(self.byte5));
        visit(&spec.signals[6], f64::from(self.byte6));
        visit(&spec.signals[7], f64::from(self.byte7));
    }

    fn from_values(values: &[f64]) -> Option<Self> {
        let &[byte0, byte1, byte2, byte3, byte4, byte5, byte6, byte7, ] = values else { return None };
        Some(Self {
            byte0: exact(byte0)?,
            byte1: exact(byte1)?,
            byte2: exact(byte2)?,
            byte3: exact(byte3)?,
            byte4: exact(byte4)?,
            byte5: exact(byte5)?,
            byte6: exact(byte6)?,
            byte7: exact(byte7)?,
        })
    }
}

impl XcpResponse {
    /// The payload from its bytes in the order of the wire.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 8]) -> Self {
        let [byte0, byte1, byte2, byte3, byte4, byte5, byte6, byte7] = bytes;
        Self { byte0, byte1, byte2, byte3, byte4, byte5, byte6, byte7 }
    }

    /// The bytes in the order of the wire.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 8] {
        [self.byte0, self.byte1, self.byte2, self.byte3, self.byte4, self.byte5, self.byte6, self.byte7]
    }
}

/// A frame of the wire with its payload in physical quantities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frame {
    /// 0x108, sent by Console: Trips or releases the central emergency stop; at once, then repeated while tripped.
    ConsoleEmergencyStop(EmergencyStop),
    /// 0x109, sent by Rig: Trips or releases the central emergency stop; at once, then repeated while tripped.
    RigEmergencyStop(EmergencyStop),
    /// 0x10A, sent by DriveController: Trips or releases the central emergency stop; at once, then repeated while tripped.
    DriveEmergencyStop(EmergencyStop),
    /// 0x10B, sent by LoadController: Trips or releases the central emergency stop; at once, then repeated while tripped.
    LoadEmergencyStop(EmergencyStop),
    /// 0x110, sent by DriveController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
    DriveValveCommand(ValveCommand),
    /// 0x111, sent by LoadController: Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
    LoadValveCommand(ValveCommand),
    /// 0x120, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
    DriveSensors(Sensors),
    /// 0x121, sent by Rig: Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
    LoadSensors(Sensors),
    /// 0x130, sent by Rig: The rig's time base: every 10 ms, and when cycles were skipped.
    Tick(Tick),
    /// 0x140, sent by Rig: State of the rig. Bits 29 to 31 are reserved.
    RigStatus(RigStatus),
    /// 0x150, sent by DriveController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
    DriveChainStatus(ChainStatus),
    /// 0x151, sent by DriveController: Figures of a controller's sequence chains.
    DriveChainValues(ChainValues),
    /// 0x152, sent by LoadController: States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
    LoadChainStatus(ChainStatus),
    /// 0x153, sent by LoadController: Figures of a controller's sequence chains.
    LoadChainValues(ChainValues),
    /// 0x160, sent by Console: Starts or aborts an experiment.
    RunControl(RunControl),
    /// 0x180, sent by Bench: Bench only: a hand pushes, in +x, until the next such frame.
    HandForce(HandForce),
    /// 0x181, sent by Bench: Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
    Link(Link),
    /// 0x182, sent by Bench: Bench only: puts weights on the carriage.
    Weights(Weights),
    /// 0x183, sent by Bench: Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
    FaultMark(FaultMark),
    /// 0x184, sent by Bench: Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
    HandSetPoint(HandSetPoint),
    /// 0x1E0, sent by Console: XCP command packet to a controller, padded to 8 bytes.
    DriveXcpCommand(XcpCommand),
    /// 0x1E1, sent by DriveController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
    DriveXcpResponse(XcpResponse),
    /// 0x1E2, sent by Console: XCP command packet to a controller, padded to 8 bytes.
    LoadXcpCommand(XcpCommand),
    /// 0x1E3, sent by LoadController: XCP response, event or DAQ packet of a controller, padded to 8 bytes.
    LoadXcpResponse(XcpResponse),
}

impl Frame {
    /// The message's entry in [`MESSAGES`].
    #[must_use]
    pub const fn spec(&self) -> &'static MessageSpec {
        match self {
            Self::ConsoleEmergencyStop(_) => CONSOLE_EMERGENCY_STOP,
            Self::RigEmergencyStop(_) => RIG_EMERGENCY_STOP,
            Self::DriveEmergencyStop(_) => DRIVE_EMERGENCY_STOP,
            Self::LoadEmergencyStop(_) => LOAD_EMERGENCY_STOP,
            Self::DriveValveCommand(_) => DRIVE_VALVE_COMMAND,
            Self::LoadValveCommand(_) => LOAD_VALVE_COMMAND,
            Self::DriveSensors(_) => DRIVE_SENSORS,
            Self::LoadSensors(_) => LOAD_SENSORS,
            Self::Tick(_) => TICK,
            Self::RigStatus(_) => RIG_STATUS,
            Self::DriveChainStatus(_) => DRIVE_CHAIN_STATUS,
            Self::DriveChainValues(_) => DRIVE_CHAIN_VALUES,
            Self::LoadChainStatus(_) => LOAD_CHAIN_STATUS,
            Self::LoadChainValues(_) => LOAD_CHAIN_VALUES,
            Self::RunControl(_) => RUN_CONTROL,
            Self::HandForce(_) => HAND_FORCE,
            Self::Link(_) => LINK,
            Self::Weights(_) => WEIGHTS,
            Self::FaultMark(_) => FAULT_MARK,
            Self::HandSetPoint(_) => HAND_SET_POINT,
            Self::DriveXcpCommand(_) => DRIVE_XCP_COMMAND,
            Self::DriveXcpResponse(_) => DRIVE_XCP_RESPONSE,
            Self::LoadXcpCommand(_) => LOAD_XCP_COMMAND,
            Self::LoadXcpResponse(_) => LOAD_XCP_RESPONSE,
        }
    }

    fn pack(&self) -> Result<u64, EncodeError> {
        match self {
            Self::ConsoleEmergencyStop(payload) => payload.pack(CONSOLE_EMERGENCY_STOP),
            Self::RigEmergencyStop(payload) => payload.pack(RIG_EMERGENCY_STOP),
            Self::DriveEmergencyStop(payload) => payload.pack(DRIVE_EMERGENCY_STOP),
            Self::LoadEmergencyStop(payload) => payload.pack(LOAD_EMERGENCY_STOP),
            Self::DriveValveCommand(payload) => payload.pack(DRIVE_VALVE_COMMAND),
            Self::LoadValveCommand(payload) => payload.pack(LOAD_VALVE_COMMAND),
            Self::DriveSensors(payload) => payload.pack(DRIVE_SENSORS),
            Self::LoadSensors(payload) => payload.pack(LOAD_SENSORS),
            Self::Tick(payload) => payload.pack(TICK),
            Self::RigStatus(payload) => payload.pack(RIG_STATUS),
            Self::DriveChainStatus(payload) => payload.pack(DRIVE_CHAIN_STATUS),
            Self::DriveChainValues(payload) => payload.pack(DRIVE_CHAIN_VALUES),
            Self::LoadChainStatus(payload) => payload.pack(LOAD_CHAIN_STATUS),
            Self::LoadChainValues(payload) => payload.pack(LOAD_CHAIN_VALUES),
            Self::RunControl(payload) => payload.pack(RUN_CONTROL),
            Self::HandForce(payload) => payload.pack(HAND_FORCE),
            Self::Link(payload) => payload.pack(LINK),
            Self::Weights(payload) => payload.pack(WEIGHTS),
            Self::FaultMark(payload) => payload.pack(FAULT_MARK),
            Self::HandSetPoint(payload) => payload.pack(HAND_SET_POINT),
            Self::DriveXcpCommand(payload) => payload.pack(DRIVE_XCP_COMMAND),
            Self::DriveXcpResponse(payload) => payload.pack(DRIVE_XCP_RESPONSE),
            Self::LoadXcpCommand(payload) => payload.pack(LOAD_XCP_COMMAND),
            Self::LoadXcpResponse(payload) => payload.pack(LOAD_XCP_RESPONSE),
        }
    }

    /// The frame that `frame` carries.
    ///
    /// # Errors
    /// [`DecodeError`] names message, signal and raw value of the first thing that `rig.dbc` does not allow.
    pub fn decode(frame: &CanFrame) -> Result<Self, DecodeError> {
        let id = frame.standard_id().ok_or(DecodeError::NotPlainData { raw_id: frame.raw_id() })?;
        Ok(match id {
            0x108 => Self::ConsoleEmergencyStop(EmergencyStop::unpack(CONSOLE_EMERGENCY_STOP, open(CONSOLE_EMERGENCY_STOP, frame)?)?),
            0x109 => Self::RigEmergencyStop(EmergencyStop::unpack(RIG_EMERGENCY_STOP, open(RIG_EMERGENCY_STOP, frame)?)?),
            0x10A => Self::DriveEmergencyStop(EmergencyStop::unpack(DRIVE_EMERGENCY_STOP, open(DRIVE_EMERGENCY_STOP, frame)?)?),
            0x10B => Self::LoadEmergencyStop(EmergencyStop::unpack(LOAD_EMERGENCY_STOP, open(LOAD_EMERGENCY_STOP, frame)?)?),
            0x110 => Self::DriveValveCommand(ValveCommand::unpack(DRIVE_VALVE_COMMAND, open(DRIVE_VALVE_COMMAND, frame)?)?),
            0x111 => Self::LoadValveCommand(ValveCommand::unpack(LOAD_VALVE_COMMAND, open(LOAD_VALVE_COMMAND, frame)?)?),
            0x120 => Self::DriveSensors(Sensors::unpack(DRIVE_SENSORS, open(DRIVE_SENSORS, frame)?)?),
            0x121 => Self::LoadSensors(Sensors::unpack(LOAD_SENSORS, open(LOAD_SENSORS, frame)?)?),
            0x130 => Self::Tick(Tick::unpack(TICK, open(TICK, frame)?)?),
            0x140 => Self::RigStatus(RigStatus::unpack(RIG_STATUS, open(RIG_STATUS, frame)?)?),
            0x150 => Self::DriveChainStatus(ChainStatus::unpack(DRIVE_CHAIN_STATUS, open(DRIVE_CHAIN_STATUS, frame)?)?),
            0x151 => Self::DriveChainValues(ChainValues::unpack(DRIVE_CHAIN_VALUES, open(DRIVE_CHAIN_VALUES, frame)?)?),
            0x152 => Self::LoadChainStatus(ChainStatus::unpack(LOAD_CHAIN_STATUS, open(LOAD_CHAIN_STATUS, frame)?)?),
            0x153 => Self::LoadChainValues(ChainValues::unpack(LOAD_CHAIN_VALUES, open(LOAD_CHAIN_VALUES, frame)?)?),
            0x160 => Self::RunControl(RunControl::unpack(RUN_CONTROL, open(RUN_CONTROL, frame)?)?),
            0x180 => Self::HandForce(HandForce::unpack(HAND_FORCE, open(HAND_FORCE, frame)?)?),
            0x181 => Self::Link(Link::unpack(LINK, open(LINK, frame)?)?),
            0x182 => Self::Weights(Weights::unpack(WEIGHTS, open(WEIGHTS, frame)?)?),
            0x183 => Self::FaultMark(FaultMark::unpack(FAULT_MARK, open(FAULT_MARK, frame)?)?),
            0x184 => Self::HandSetPoint(HandSetPoint::unpack(HAND_SET_POINT, open(HAND_SET_POINT, frame)?)?),
            0x1E0 => Self::DriveXcpCommand(XcpCommand::unpack(DRIVE_XCP_COMMAND, open(DRIVE_XCP_COMMAND, frame)?)?),
            0x1E1 => Self::DriveXcpResponse(XcpResponse::unpack(DRIVE_XCP_RESPONSE, open(DRIVE_XCP_RESPONSE, frame)?)?),
            0x1E2 => Self::LoadXcpCommand(XcpCommand::unpack(LOAD_XCP_COMMAND, open(LOAD_XCP_COMMAND, frame)?)?),
            0x1E3 => Self::LoadXcpResponse(XcpResponse::unpack(LOAD_XCP_RESPONSE, open(LOAD_XCP_RESPONSE, frame)?)?),
            _ => return Err(DecodeError::UnknownIdentifier { id }),
        })
    }

    /// Calls `visit` with each signal and its value, in the order of [`MessageSpec::signals`]; flags are 0 and 1, values
    /// of a table their counts.
    pub fn for_each_signal(&self, mut visit: impl FnMut(&'static SignalSpec, f64)) {
        match self {
            Self::ConsoleEmergencyStop(payload) => payload.visit(CONSOLE_EMERGENCY_STOP, &mut visit),
            Self::RigEmergencyStop(payload) => payload.visit(RIG_EMERGENCY_STOP, &mut visit),
            Self::DriveEmergencyStop(payload) => payload.visit(DRIVE_EMERGENCY_STOP, &mut visit),
            Self::LoadEmergencyStop(payload) => payload.visit(LOAD_EMERGENCY_STOP, &mut visit),
            Self::DriveValveCommand(payload) => payload.visit(DRIVE_VALVE_COMMAND, &mut visit),
            Self::LoadValveCommand(payload) => payload.visit(LOAD_VALVE_COMMAND, &mut visit),
            Self::DriveSensors(payload) => payload.visit(DRIVE_SENSORS, &mut visit),
            Self::LoadSensors(payload) => payload.visit(LOAD_SENSORS, &mut visit),
            Self::Tick(payload) => payload.visit(TICK, &mut visit),
            Self::RigStatus(payload) => payload.visit(RIG_STATUS, &mut visit),
            Self::DriveChainStatus(payload) => payload.visit(DRIVE_CHAIN_STATUS, &mut visit),
            Self::DriveChainValues(payload) => payload.visit(DRIVE_CHAIN_VALUES, &mut visit),
            Self::LoadChainStatus(payload) => payload.visit(LOAD_CHAIN_STATUS, &mut visit),
            Self::LoadChainValues(payload) => payload.visit(LOAD_CHAIN_VALUES, &mut visit),
            Self::RunControl(payload) => payload.visit(RUN_CONTROL, &mut visit),
            Self::HandForce(payload) => payload.visit(HAND_FORCE, &mut visit),
            Self::Link(payload) => payload.visit(LINK, &mut visit),
            Self::Weights(payload) => payload.visit(WEIGHTS, &mut visit),
            Self::FaultMark(payload) => payload.visit(FAULT_MARK, &mut visit),
            Self::HandSetPoint(payload) => payload.visit(HAND_SET_POINT, &mut visit),
            Self::DriveXcpCommand(payload) => payload.visit(DRIVE_XCP_COMMAND, &mut visit),
            Self::DriveXcpResponse(payload) => payload.visit(DRIVE_XCP_RESPONSE, &mut visit),
            Self::LoadXcpCommand(payload) => payload.visit(LOAD_XCP_COMMAND, &mut visit),
            Self::LoadXcpResponse(payload) => payload.visit(LOAD_XCP_RESPONSE, &mut visit),
        }
    }

    /// The frame with identifier `id` and one value for each signal, in the order of [`MessageSpec::signals`].
    ///
    /// `None` when there is no such message, the number of values differs, or a value does not fit the Rust type of its field
    /// (which for integers may be wider than the signal: [`Frame::encode`] checks the range).
    #[must_use]
    pub fn from_values(id: u16, values: &[f64]) -> Option<Self> {
        match id {
            0x108 => Some(Self::ConsoleEmergencyStop(EmergencyStop::from_values(values)?)),
            0x109 => Some(Self::RigEmergencyStop(EmergencyStop::from_values(values)?)),
            0x10A => Some(Self::DriveEmergencyStop(EmergencyStop::from_values(values)?)),
            0x10B => Some(Self::LoadEmergencyStop(EmergencyStop::from_values(values)?)),
            0x110 => Some(Self::DriveValveCommand(ValveCommand::from_values(values)?)),
            0x111 => Some(Self::LoadValveCommand(ValveCommand::from_values(values)?)),
            0x120 => Some(Self::DriveSensors(Sensors::from_values(values)?)),
            0x121 => Some(Self::LoadSensors(Sensors::from_values(values)?)),
            0x130 => Some(Self::Tick(Tick::from_values(values)?)),
            0x140 => Some(Self::RigStatus(RigStatus::from_values(values)?)),
            0x150 => Some(Self::DriveChainStatus(ChainStatus::from_values(values)?)),
            0x151 => Some(Self::DriveChainValues(ChainValues::from_values(values)?)),
            0x152 => Some(Self::LoadChainStatus(ChainStatus::from_values(values)?)),
            0x153 => Some(Self::LoadChainValues(ChainValues::from_values(values)?)),
            0x160 => Some(Self::RunControl(RunControl::from_values(values)?)),
            0x180 => Some(Self::HandForce(HandForce::from_values(values)?)),
            0x181 => Some(Self::Link(Link::from_values(values)?)),
            0x182 => Some(Self::Weights(Weights::from_values(values)?)),
            0x183 => Some(Self::FaultMark(FaultMark::from_values(values)?)),
            0x184 => Some(Self::HandSetPoint(HandSetPoint::from_values(values)?)),
            0x1E0 => Some(Self::DriveXcpCommand(XcpCommand::from_values(values)?)),
            0x1E1 => Some(Self::DriveXcpResponse(XcpResponse::from_values(values)?)),
            0x1E2 => Some(Self::LoadXcpCommand(XcpCommand::from_values(values)?)),
            0x1E3 => Some(Self::LoadXcpResponse(XcpResponse::from_values(values)?)),
            _ => None,
        }
    }
}
