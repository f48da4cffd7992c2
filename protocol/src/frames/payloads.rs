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
    0 reason: EmergencyStopReason,
    /// The sender withdraws its stop; the rig recovers when every sender has.
    1 release: bool,
} }

payload! {
/// Command of a controller to its valve, latched by the rig at the start of the next cycle. Bits 29 to 31 are reserved.
///
/// Carried by [`DRIVE_VALVE_COMMAND`], [`LOAD_VALVE_COMMAND`].
ValveCommand {
    /// Valve opening u: positive extends the rod of the valve's own cylinder. Raw -2048 is not used, so 0 is exact and both ends are equal. Range: -1 to 1.
    0 opening: f64,
    /// Counts the sender's commands, modulo 16. Range: 0 to 15.
    1 alive: u8,
    /// Cycle number, low 12 bits, of the sensors that this command answers; the age of the command comes from it. Range: 0 to 4095.
    2 echo: u16,
    /// The controller asks for its valve to act; without it the valve is shut.
    3 enable: bool,
} }

payload! {
/// Sensors of one axis, sampled at the start of the cycle and sent at once. Values beyond their range saturate and set a flag in RigStatus.
///
/// Carried by [`DRIVE_SENSORS`], [`LOAD_SENSORS`].
Sensors {
    /// Position sensor, in rig coordinates for both axes. Range: 0 to 0.5 m.
    0 position_m: f64,
    /// Force between rod and carriage, compression positive. Range: -2000 to 2000 N.
    1 force_n: f64,
    /// Absolute pressure of the cap side chamber. Range: 0 to 1000000 Pa.
    2 pressure_a_pa: f64,
    /// Absolute pressure of the rod side chamber. Range: 0 to 1000000 Pa.
    3 pressure_b_pa: f64,
    /// Cycle number of the sample, low 4 bits. Range: 0 to 15.
    4 alive: u8,
} }

payload! {
/// The rig's time base: every 10 ms, and when cycles were skipped.
///
/// Carried by [`TICK`].
Tick {
    /// Number of the cycle in which the tick is sent, counted from 0 at the start of the rig. Range: 0 to 4294967295.
    0 cycle: u32,
    /// Cycles skipped by the rig in all, modulo 65536. Range: 0 to 65535.
    1 skipped: u16,
    /// This tick announces skipped cycles.
    2 catch_up: bool,
    /// The rig runs in lockstep: time is simulated.
    3 lockstep: bool,
    /// The rig stops after this tick.
    4 ending: bool,
} }

payload! {
/// State of the rig. Bits 29 to 31 are reserved.
///
/// Carried by [`RIG_STATUS`].
RigStatus {
    /// Absolute pressure of the supply node. Range: 0 to 1000000 Pa.
    0 supply_pressure_pa: f64,
    /// The load eye is linked to the carriage.
    1 linked: bool,
    /// The emergency stop is tripped: supply discharged, valve commands count as 0.
    2 emergency_stop: bool,
    /// The non-return valves on the chambers are shut.
    3 check_valves_shut: bool,
    /// The drive axis's position sensor was beyond its range since the last status.
    4 drive_position_saturated: bool,
    /// The drive axis's force sensor was beyond its range since the last status.
    5 drive_force_saturated: bool,
    /// The drive axis's pressure a sensor was beyond its range since the last status.
    6 drive_pressure_a_saturated: bool,
    /// The drive axis's pressure b sensor was beyond its range since the last status.
    7 drive_pressure_b_saturated: bool,
    /// The load axis's position sensor was beyond its range since the last status.
    8 load_position_saturated: bool,
    /// The load axis's force sensor was beyond its range since the last status.
    9 load_force_saturated: bool,
    /// The load axis's pressure a sensor was beyond its range since the last status.
    10 load_pressure_a_saturated: bool,
    /// The load axis's pressure b sensor was beyond its range since the last status.
    11 load_pressure_b_saturated: bool,
    /// The drive valve is shut because its newest command is older than 20 cycles.
    12 drive_stale: bool,
    /// The load valve is shut because its newest command is older than 20 cycles.
    13 load_stale: bool,
    /// Latched fault: two sources send drive valve commands; the valve is shut until one is silent for 20 cycles.
    14 drive_two_sources: bool,
    /// Latched fault: two sources send load valve commands; the valve is shut until one is silent for 20 cycles.
    15 load_two_sources: bool,
} }

payload! {
/// States of a controller's sequence chains. Bits 17 to 23 are reserved; so are identifiers 0x154 to 0x157, for further controllers.
///
/// Carried by [`DRIVE_CHAIN_STATUS`], [`LOAD_CHAIN_STATUS`].
ChainStatus {
    /// State of the main sequence chain.
    0 main_chain: MainChainState,
    /// State of the chain that runs the load's force: relieving, moving by hand, initial ramp, load profile.
    1 force_chain: ForceChainState,
    /// State of the chain that matches the two position sensors while the axes are linked.
    2 matching_chain: MatchingChainState,
    /// State of the emergency stop chain.
    3 emergency_stop_chain: EmergencyStopChainState,
    /// The controller has what it needs and no fault.
    4 ok: bool,
    /// Number of the experiment that runs or ran last. Range: 0 to 255.
    5 experiment: u8,
    /// Repetition of the experiment, from 0. Range: 0 to 255.
    6 repetition: u8,
} }

payload! {
/// Figures of a controller's sequence chains.
///
/// Carried by [`DRIVE_CHAIN_VALUES`], [`LOAD_CHAIN_VALUES`].
ChainValues {
    /// Position sensor of the controller's axis, averaged over the last 0.2 s. Range: 0 to 0.5 m.
    0 averaged_position_m: f64,
    /// Set-point of the position. Range: 0 to 0.5 m.
    1 position_set_point_m: f64,
    /// Set-point of the force. Range: -2000 to 2000 N.
    2 force_set_point_n: f64,
    /// Position set-point minus position. Range: -0.5 to 0.5 m.
    3 control_error_m: f64,
} }

payload! {
/// Starts or aborts an experiment.
///
/// Carried by [`RUN_CONTROL`].
RunControl {
    /// What the controllers are asked for.
    0 command: RunControlCommand,
    /// Number of the experiment to start. Range: 0 to 255.
    1 experiment: u8,
} }

payload! {
/// Bench only: a hand pushes, in +x, until the next such frame.
///
/// Carried by [`HAND_FORCE`].
HandForce {
    /// Force of the hand on the carriage. Range: -2000 to 2000 N.
    0 carriage_n: f64,
    /// Force of the hand on the load eye. Range: -2000 to 2000 N.
    1 load_eye_n: f64,
} }

payload! {
/// Bench only: links or unlinks load eye and carriage. Bits 1 to 7 are reserved.
///
/// Carried by [`LINK`].
Link {
    /// What the rig is asked for; linking is refused outside the gap.
    0 request: LinkRequest,
} }

payload! {
/// Bench only: puts weights on the carriage.
///
/// Carried by [`WEIGHTS`].
Weights {
    /// Mass of all weights on the carriage. Range: 0 to 20 kg.
    0 added_mass_kg: f64,
} }

payload! {
/// Bench only: marks in the log where a planned fault begins or ends. Bits 17 to 23 are reserved; so are identifiers 0x185 to 0x187.
///
/// Carried by [`FAULT_MARK`].
FaultMark {
    /// Number of the fault in the bench's plan. Range: 0 to 65535.
    0 fault: u16,
    /// The fault begins; otherwise it ends.
    1 active: bool,
} }

payload! {
/// Bench only: where an axis shall go, or how hard it shall press, by hand. It obeys while an experiment that allows it runs. Bits 1 to 7 are reserved.
///
/// Carried by [`HAND_SET_POINT`].
HandSetPoint {
    /// Whom it is for.
    0 axis: HandSetPointAxis,
    /// Position that is to be reached, rig coordinate; an axis that is force controlled ignores it. Range: 0 to 0.5 m.
    1 position_m: f64,
    /// Force that is to be reached, compression positive; an axis that is position controlled ignores it. Range: -2000 to 2000 N.
    2 force_n: f64,
} }

payload! {
/// XCP command packet to a controller, padded to 8 bytes.
///
/// Carried by [`DRIVE_XCP_COMMAND`], [`LOAD_XCP_COMMAND`].
XcpCommand {
    /// Byte 0 of the packet. Range: 0 to 255.
    0 byte0: u8,
    /// Byte 1 of the packet. Range: 0 to 255.
    1 byte1: u8,
    /// Byte 2 of the packet. Range: 0 to 255.
    2 byte2: u8,
    /// Byte 3 of the packet. Range: 0 to 255.
    3 byte3: u8,
    /// Byte 4 of the packet. Range: 0 to 255.
    4 byte4: u8,
    /// Byte 5 of the packet. Range: 0 to 255.
    5 byte5: u8,
    /// Byte 6 of the packet. Range: 0 to 255.
    6 byte6: u8,
    /// Byte 7 of the packet. Range: 0 to 255.
    7 byte7: u8,
} }

plain_bytes!(XcpCommand: 8, byte0 byte1 byte2 byte3 byte4 byte5 byte6 byte7);

payload! {
/// XCP response, event or DAQ packet of a controller, padded to 8 bytes.
///
/// Carried by [`DRIVE_XCP_RESPONSE`], [`LOAD_XCP_RESPONSE`].
XcpResponse {
    /// Byte 0 of the packet. Range: 0 to 255.
    0 byte0: u8,
    /// Byte 1 of the packet. Range: 0 to 255.
    1 byte1: u8,
    /// Byte 2 of the packet. Range: 0 to 255.
    2 byte2: u8,
    /// Byte 3 of the packet. Range: 0 to 255.
    3 byte3: u8,
    /// Byte 4 of the packet. Range: 0 to 255.
    4 byte4: u8,
    /// Byte 5 of the packet. Range: 0 to 255.
    5 byte5: u8,
    /// Byte 6 of the packet. Range: 0 to 255.
    6 byte6: u8,
    /// Byte 7 of the packet. Range: 0 to 255.
    7 byte7: u8,
} }

plain_bytes!(XcpResponse: 8, byte0 byte1 byte2 byte3 byte4 byte5 byte6 byte7);
