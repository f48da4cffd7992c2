//! Value tables of `rig.dbc`, and a struct for each payload.
//!
//! @generated from rig.dbc by the tests of this crate (generator/): cargo test -p protocol generated

use super::*;

/// Bit rate of the bus, in bit/s.
pub const BIT_RATE_PER_S: u32 = 1000000;

value_table! { EmergencyStopReason {
    0 None "none",
    1 Operator "operator",
    2 ControllerFault "controller-fault",
    3 SensorLoss "sensor-loss",
    4 PartnerLost "partner-lost",
    5 RigFault "rig-fault",
    6 LimitExceeded "limit-exceeded",
    7 Shutdown "shutdown",
} }

value_table! { MainChainState {
    0 WaitingForRig "waiting-for-rig",
    1 InitialPositioning "initial-positioning",
    2 Preparing "preparing",
    3 InitialForce "initial-force",
    4 Settling "settling",
    5 Experiment "experiment",
    6 FinalSettling "final-settling",
    7 Done "done",
    8 Aborted "aborted",
    9 Fault "fault",
} }

value_table! { ForceChainState {
    0 Idle "idle",
    1 Limited "limited",
    2 Standstill "standstill",
    3 Moving "moving",
    4 InitialRamp "initial-ramp",
    5 LoadProfile "load-profile",
    6 Done "done",
    7 Fault "fault",
} }

value_table! { MatchingChainState {
    0 Idle "idle",
    1 WaitingForRest "waiting-for-rest",
    2 Averaging "averaging",
    3 Matched "matched",
    4 Fault "fault",
} }

value_table! { EmergencyStopChainState {
    0 Ready "ready",
    1 Tripped "tripped",
    2 WaitingForRelease "waiting-for-release",
    3 Recovering "recovering",
    4 WaitingForStart "waiting-for-start",
} }

value_table! { RunControlCommand {
    0 None "none",
    1 Start "start",
    2 Abort "abort",
} }

value_table! { LinkRequest {
    0 Unlink "unlink",
    1 Link "link",
} }

value_table! { HandSetPointAxis {
    0 Drive "drive",
    1 Load "load",
} }

payload! {
/// Trips or releases the central emergency stop; at once, then repeated while tripped.
///
/// Carried by [`CONSOLE_EMERGENCY_STOP`], [`RIG_EMERGENCY_STOP`], [`DRIVE_EMERGENCY_STOP`], [`LOAD_EMERGENCY_STOP`].
EmergencyStop {
    /// Why the sender stops the rig; none in a release.
    0 reason: EmergencyStopReason { name: "reason", unit: "", comment: "Why the sender stops the rig; none in a release.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["none", "operator", "controller-fault", "sensor-loss", "partner-lost", "rig-fault", "limit-exceeded", "shutdown"], kind: SignalKind::Table },
    /// The sender withdraws its stop; the rig recovers when every sender has.
    1 release: bool { name: "release", unit: "", comment: "The sender withdraws its stop; the rig recovers when every sender has.", start: 8, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
} }

payload! {
/// Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
///
/// Carried by [`DRIVE_VALVE_COMMAND`], [`LOAD_VALVE_COMMAND`].
ValveCommand {
    /// Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal. Range: -1 to 1.
    0 opening: f64 { name: "opening", unit: "", comment: "Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal.", start: 0, length: 12, signed: true, factor: 0.0004885197850512946, offset: 0.0, raw_min: -2047, raw_max: 2047, min: -1.0, max: 1.0, values: &[], kind: SignalKind::Physical },
    /// Counts the sender's commands, modulo 16. Range: 0 to 15.
    1 alive: u8 { name: "alive", unit: "", comment: "Counts the sender's commands, modulo 16.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], kind: SignalKind::Integer },
    /// Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it. Range: 0 to 4095.
    2 echo: u16 { name: "echo", unit: "", comment: "Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it.", start: 16, length: 12, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4095, min: 0.0, max: 4095.0, values: &[], kind: SignalKind::Integer },
    /// The controller asks for its valve to act; without it the valve is shut.
    3 enable: bool { name: "enable", unit: "", comment: "The controller asks for its valve to act; without it the valve is shut.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
} }

payload! {
/// Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
///
/// Carried by [`DRIVE_SENSORS`], [`LOAD_SENSORS`].
Sensors {
    /// Position sensor, in rig coordinates for both axes. Range: 0 to 0.5 m.
    0 position_m: f64 { name: "position", unit: "m", comment: "Position sensor, in rig coordinates for both axes.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], kind: SignalKind::Physical },
    /// Force between rod and carriage, compression positive. Range: -2000 to 2000 N.
    1 force_n: f64 { name: "force", unit: "N", comment: "Force between rod and carriage, compression positive.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], kind: SignalKind::Physical },
    /// Absolute pressure of the cap side chamber. Range: 0 to 1000000 Pa.
    2 pressure_a_pa: f64 { name: "pressure_a", unit: "Pa", comment: "Absolute pressure of the cap side chamber.", start: 32, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], kind: SignalKind::Physical },
    /// Absolute pressure of the rod side chamber. Range: 0 to 1000000 Pa.
    3 pressure_b_pa: f64 { name: "pressure_b", unit: "Pa", comment: "Absolute pressure of the rod side chamber.", start: 46, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], kind: SignalKind::Physical },
    /// Cycle number of the sample, low 4 bits. Range: 0 to 15.
    4 alive: u8 { name: "alive", unit: "", comment: "Cycle number of the sample, low 4 bits.", start: 60, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 15, min: 0.0, max: 15.0, values: &[], kind: SignalKind::Integer },
} }

payload! {
/// The rig's time base: every 10 ms, and when cycles were skipped.
///
/// Carried by [`TICK`].
Tick {
    /// Number of the cycle in which the tick is sent, counted from 0 at the start of the rig. Range: 0 to 4294967295.
    0 cycle: u32 { name: "cycle", unit: "", comment: "Number of the cycle in which the tick is sent, counted from 0 at the start of the rig.", start: 0, length: 32, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4294967295, min: 0.0, max: 4294967295.0, values: &[], kind: SignalKind::Integer },
    /// Cycles skipped by the rig in all, modulo 65536. Range: 0 to 65535.
    1 skipped: u16 { name: "skipped", unit: "", comment: "Cycles skipped by the rig in all, modulo 65536.", start: 32, length: 16, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 65535.0, values: &[], kind: SignalKind::Integer },
    /// This tick announces skipped cycles.
    2 catch_up: bool { name: "catch_up", unit: "", comment: "This tick announces skipped cycles.", start: 48, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The rig runs in lockstep: time is simulated.
    3 lockstep: bool { name: "lockstep", unit: "", comment: "The rig runs in lockstep: time is simulated.", start: 49, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The rig stops after this tick.
    4 ending: bool { name: "ending", unit: "", comment: "The rig stops after this tick.", start: 50, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
} }

payload! {
/// State of the rig. Bits 29 to 31 are reserved.
///
/// Carried by [`RIG_STATUS`].
RigStatus {
    /// Absolute pressure of the supply node. Range: 0 to 1000000 Pa.
    0 supply_pressure_pa: f64 { name: "supply_pressure", unit: "Pa", comment: "Absolute pressure of the supply node.", start: 0, length: 14, signed: false, factor: 61.038881767686014, offset: 0.0, raw_min: 0, raw_max: 16383, min: 0.0, max: 1000000.0, values: &[], kind: SignalKind::Physical },
    /// The load eye is linked to the carriage.
    1 linked: bool { name: "linked", unit: "", comment: "The load eye is linked to the carriage.", start: 14, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The emergency stop is tripped: supply discharged, valve commands count as 0.
    2 emergency_stop: bool { name: "emergency_stop", unit: "", comment: "The emergency stop is tripped: supply discharged, valve commands count as 0.", start: 15, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The non-return valves on the chambers are shut.
    3 check_valves_shut: bool { name: "check_valves_shut", unit: "", comment: "The non-return valves on the chambers are shut.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The drive axis's position sensor was beyond its range since the last status.
    4 drive_position_saturated: bool { name: "drive_position_saturated", unit: "", comment: "The drive axis's position sensor was beyond its range since the last status.", start: 17, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The drive axis's force sensor was beyond its range since the last status.
    5 drive_force_saturated: bool { name: "drive_force_saturated", unit: "", comment: "The drive axis's force sensor was beyond its range since the last status.", start: 18, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The drive axis's pressure a sensor was beyond its range since the last status.
    6 drive_pressure_a_saturated: bool { name: "drive_pressure_a_saturated", unit: "", comment: "The drive axis's pressure a sensor was beyond its range since the last status.", start: 19, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The drive axis's pressure b sensor was beyond its range since the last status.
    7 drive_pressure_b_saturated: bool { name: "drive_pressure_b_saturated", unit: "", comment: "The drive axis's pressure b sensor was beyond its range since the last status.", start: 20, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The load axis's position sensor was beyond its range since the last status.
    8 load_position_saturated: bool { name: "load_position_saturated", unit: "", comment: "The load axis's position sensor was beyond its range since the last status.", start: 21, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The load axis's force sensor was beyond its range since the last status.
    9 load_force_saturated: bool { name: "load_force_saturated", unit: "", comment: "The load axis's force sensor was beyond its range since the last status.", start: 22, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The load axis's pressure a sensor was beyond its range since the last status.
    10 load_pressure_a_saturated: bool { name: "load_pressure_a_saturated", unit: "", comment: "The load axis's pressure a sensor was beyond its range since the last status.", start: 23, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The load axis's pressure b sensor was beyond its range since the last status.
    11 load_pressure_b_saturated: bool { name: "load_pressure_b_saturated", unit: "", comment: "The load axis's pressure b sensor was beyond its range since the last status.", start: 24, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The drive valve is shut because its newest command is older than 20 cycles.
    12 drive_stale: bool { name: "drive_stale", unit: "", comment: "The drive valve is shut because its newest command is older than 20 cycles.", start: 25, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// The load valve is shut because its newest command is older than 20 cycles.
    13 load_stale: bool { name: "load_stale", unit: "", comment: "The load valve is shut because its newest command is older than 20 cycles.", start: 26, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// Latched fault: two sources send drive valve commands; the valve is shut until one is silent for 20 cycles.
    14 drive_two_sources: bool { name: "drive_two_sources", unit: "", comment: "Latched fault: two sources send drive valve commands; the valve is shut until one is silent for 20 cycles.", start: 27, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// Latched fault: two sources send load valve commands; the valve is shut until one is silent for 20 cycles.
    15 load_two_sources: bool { name: "load_two_sources", unit: "", comment: "Latched fault: two sources send load valve commands; the valve is shut until one is silent for 20 cycles.", start: 28, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
} }

payload! {
/// States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
///
/// Carried by [`DRIVE_CHAIN_STATUS`], [`LOAD_CHAIN_STATUS`].
ChainStatus {
    /// State of the main sequence chain.
    0 main_chain: MainChainState { name: "main_chain", unit: "", comment: "State of the main sequence chain.", start: 0, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 9, min: 0.0, max: 9.0, values: &["waiting-for-rig", "initial-positioning", "preparing", "initial-force", "settling", "experiment", "final-settling", "done", "aborted", "fault"], kind: SignalKind::Table },
    /// State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.
    1 force_chain: ForceChainState { name: "force_chain", unit: "", comment: "State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.", start: 4, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 7, min: 0.0, max: 7.0, values: &["idle", "limited", "standstill", "moving", "initial-ramp", "load-profile", "done", "fault"], kind: SignalKind::Table },
    /// State of the chain that matches the two position sensors while the axes are linked.
    2 matching_chain: MatchingChainState { name: "matching_chain", unit: "", comment: "State of the chain that matches the two position sensors while the axes are linked.", start: 8, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["idle", "waiting-for-rest", "averaging", "matched", "fault"], kind: SignalKind::Table },
    /// State of the emergency stop chain.
    3 emergency_stop_chain: EmergencyStopChainState { name: "emergency_stop_chain", unit: "", comment: "State of the emergency stop chain.", start: 12, length: 4, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 4, min: 0.0, max: 4.0, values: &["ready", "tripped", "waiting-for-release", "recovering", "waiting-for-start"], kind: SignalKind::Table },
    /// The controller has what it needs and no fault.
    4 ok: bool { name: "ok", unit: "", comment: "The controller has what it needs and no fault.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
    /// Number of the experiment that runs or ran last. Range: 0 to 255.
    5 experiment: u8 { name: "experiment", unit: "", comment: "Number of the experiment that runs or ran last.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Repetition of the experiment, from 0. Range: 0 to 255.
    6 repetition: u8 { name: "repetition", unit: "", comment: "Repetition of the experiment, from 0.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
} }

payload! {
/// Figures of a controller's sequence chains.
///
/// Carried by [`DRIVE_CHAIN_VALUES`], [`LOAD_CHAIN_VALUES`].
ChainValues {
    /// Position sensor of the controller's axis, averaged over the last 0.2 s. Range: 0 to 0.5 m.
    0 averaged_position_m: f64 { name: "averaged_position", unit: "m", comment: "Position sensor of the controller's axis, averaged over the last 0.2 s.", start: 0, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], kind: SignalKind::Physical },
    /// Set-point of the position. Range: 0 to 0.5 m.
    1 position_set_point_m: f64 { name: "position_set_point", unit: "m", comment: "Set-point of the position.", start: 16, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], kind: SignalKind::Physical },
    /// Set-point of the force. Range: -2000 to 2000 N.
    2 force_set_point_n: f64 { name: "force_set_point", unit: "N", comment: "Set-point of the force.", start: 32, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], kind: SignalKind::Physical },
    /// Position set-point minus position. Range: -0.5 to 0.5 m.
    3 control_error_m: f64 { name: "control_error", unit: "m", comment: "Position set-point minus position.", start: 48, length: 16, signed: true, factor: 1.5259254737998596e-5, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -0.5, max: 0.5, values: &[], kind: SignalKind::Physical },
} }

payload! {
/// Starts or aborts an experiment.
///
/// Carried by [`RUN_CONTROL`].
RunControl {
    /// What the controllers are asked for.
    0 command: RunControlCommand { name: "command", unit: "", comment: "What the controllers are asked for.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 2, min: 0.0, max: 2.0, values: &["none", "start", "abort"], kind: SignalKind::Table },
    /// Number of the experiment to start. Range: 0 to 255.
    1 experiment: u8 { name: "experiment", unit: "", comment: "Number of the experiment to start.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
} }

payload! {
/// Bench only: a hand pushes, in +x, until the next such frame.
///
/// Carried by [`HAND_FORCE`].
HandForce {
    /// Force of the hand on the carriage. Range: -2000 to 2000 N.
    0 carriage_n: f64 { name: "carriage", unit: "N", comment: "Force of the hand on the carriage.", start: 0, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], kind: SignalKind::Physical },
    /// Force of the hand on the load eye. Range: -2000 to 2000 N.
    1 load_eye_n: f64 { name: "load_eye", unit: "N", comment: "Force of the hand on the load eye.", start: 16, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], kind: SignalKind::Physical },
} }

payload! {
/// Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
///
/// Carried by [`LINK`].
Link {
    /// What the rig is asked for; linking is refused outside the gap.
    0 request: LinkRequest { name: "request", unit: "", comment: "What the rig is asked for; linking is refused outside the gap.", start: 0, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &["unlink", "link"], kind: SignalKind::Table },
} }

payload! {
/// Bench only: puts weights on the carriage.
///
/// Carried by [`WEIGHTS`].
Weights {
    /// Mass of all weights on the carriage. Range: 0 to 20 kg.
    0 added_mass_kg: f64 { name: "added_mass", unit: "kg", comment: "Mass of all weights on the carriage.", start: 0, length: 16, signed: false, factor: 0.00030518043793392844, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 20.0, values: &[], kind: SignalKind::Physical },
} }

payload! {
/// Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
///
/// Carried by [`FAULT_MARK`].
FaultMark {
    /// Number of the fault in the bench's plan. Range: 0 to 65535.
    0 fault: u16 { name: "fault", unit: "", comment: "Number of the fault in the bench's plan.", start: 0, length: 16, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 65535.0, values: &[], kind: SignalKind::Integer },
    /// The fault begins; otherwise it ends.
    1 active: bool { name: "active", unit: "", comment: "The fault begins; otherwise it ends.", start: 16, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &[], kind: SignalKind::Flag },
} }

payload! {
/// Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
///
/// Carried by [`HAND_SET_POINT`].
HandSetPoint {
    /// Whom it is for.
    0 axis: HandSetPointAxis { name: "axis", unit: "", comment: "Whom it is for.", start: 0, length: 1, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 1, min: 0.0, max: 1.0, values: &["drive", "load"], kind: SignalKind::Table },
    /// Position that is to be reached, rig coordinate; an axis that is force controlled ignores it. Range: 0 to 0.5 m.
    1 position_m: f64 { name: "position", unit: "m", comment: "Position that is to be reached, rig coordinate; an axis that is force controlled ignores it.", start: 8, length: 16, signed: false, factor: 7.629510948348211e-6, offset: 0.0, raw_min: 0, raw_max: 65535, min: 0.0, max: 0.5, values: &[], kind: SignalKind::Physical },
    /// Force that is to be reached, compression positive; an axis that is position controlled ignores it. Range: -2000 to 2000 N.
    2 force_n: f64 { name: "force", unit: "N", comment: "Force that is to be reached, compression positive; an axis that is position controlled ignores it.", start: 24, length: 16, signed: true, factor: 0.061037018951994385, offset: 0.0, raw_min: -32767, raw_max: 32767, min: -2000.0, max: 2000.0, values: &[], kind: SignalKind::Physical },
} }

payload! {
/// XCP command packet to a controller, padded to 8 bytes.
///
/// Carried by [`DRIVE_XCP_COMMAND`], [`LOAD_XCP_COMMAND`].
XcpCommand {
    /// Byte 0 of the packet. Range: 0 to 255.
    0 byte0: u8 { name: "byte0", unit: "", comment: "Byte 0 of the packet.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 1 of the packet. Range: 0 to 255.
    1 byte1: u8 { name: "byte1", unit: "", comment: "Byte 1 of the packet.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 2 of the packet. Range: 0 to 255.
    2 byte2: u8 { name: "byte2", unit: "", comment: "Byte 2 of the packet.", start: 16, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 3 of the packet. Range: 0 to 255.
    3 byte3: u8 { name: "byte3", unit: "", comment: "Byte 3 of the packet.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 4 of the packet. Range: 0 to 255.
    4 byte4: u8 { name: "byte4", unit: "", comment: "Byte 4 of the packet.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 5 of the packet. Range: 0 to 255.
    5 byte5: u8 { name: "byte5", unit: "", comment: "Byte 5 of the packet.", start: 40, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 6 of the packet. Range: 0 to 255.
    6 byte6: u8 { name: "byte6", unit: "", comment: "Byte 6 of the packet.", start: 48, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 7 of the packet. Range: 0 to 255.
    7 byte7: u8 { name: "byte7", unit: "", comment: "Byte 7 of the packet.", start: 56, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
} }

plain_bytes!(XcpCommand: 8, byte0 byte1 byte2 byte3 byte4 byte5 byte6 byte7);

payload! {
/// XCP response, event or DAQ packet of a controller, padded to 8 bytes.
///
/// Carried by [`DRIVE_XCP_RESPONSE`], [`LOAD_XCP_RESPONSE`].
XcpResponse {
    /// Byte 0 of the packet. Range: 0 to 255.
    0 byte0: u8 { name: "byte0", unit: "", comment: "Byte 0 of the packet.", start: 0, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 1 of the packet. Range: 0 to 255.
    1 byte1: u8 { name: "byte1", unit: "", comment: "Byte 1 of the packet.", start: 8, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 2 of the packet. Range: 0 to 255.
    2 byte2: u8 { name: "byte2", unit: "", comment: "Byte 2 of the packet.", start: 16, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 3 of the packet. Range: 0 to 255.
    3 byte3: u8 { name: "byte3", unit: "", comment: "Byte 3 of the packet.", start: 24, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 4 of the packet. Range: 0 to 255.
    4 byte4: u8 { name: "byte4", unit: "", comment: "Byte 4 of the packet.", start: 32, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 5 of the packet. Range: 0 to 255.
    5 byte5: u8 { name: "byte5", unit: "", comment: "Byte 5 of the packet.", start: 40, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 6 of the packet. Range: 0 to 255.
    6 byte6: u8 { name: "byte6", unit: "", comment: "Byte 6 of the packet.", start: 48, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
    /// Byte 7 of the packet. Range: 0 to 255.
    7 byte7: u8 { name: "byte7", unit: "", comment: "Byte 7 of the packet.", start: 56, length: 8, signed: false, factor: 1.0, offset: 0.0, raw_min: 0, raw_max: 255, min: 0.0, max: 255.0, values: &[], kind: SignalKind::Integer },
} }

plain_bytes!(XcpResponse: 8, byte0 byte1 byte2 byte3 byte4 byte5 byte6 byte7);
