//! A rig for the check: says on the bus what the rig says, obeys valves, and can be asked to fall silent or to stop.
//!
//! It is no plant and stands for none: a carriage follows its valve with a lag, so that a controller has something to move and
//! its set-points come true. Pressures and forces stand still. A controller is judged by what it sends, never by where the
//! carriage goes.
//!
//! ```text
//!   v' = (V s(u) - v) / T        s(u) = sign(u) max(|u| - 0.03, 0)        V = 1.15 m/s, T = 30 ms
//! ```
//!
//! V and the dead band are those of the nominal valve between an opening of 0.03 and 0.3 (plant/rig.toml, choked exhaust); T is a
//! guess, shorter than the air's lag.

use super::cli::CheckedAxis;
use protocol::can::CanFrame;
use protocol::frames::{
    ALIVE_RANGE, EmergencyStop, EmergencyStopReason, Frame, RigStatus, Sensors, TICK, Tick,
};
use protocol::periods::{self, CYCLE_S};

const DEAD_BAND: f64 = 0.03;
const SPEED_M_PER_S: f64 = 1.15;
const LAG_S: f64 = 0.03;
const STROKE_M: f64 = 0.5;
/// An identifier that rig.dbc does not know.
const UNKNOWN_ID: u16 = 0x5A5;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Disturbance {
    pub(super) sensors_lost: bool,
    /// Frames that a controller has to pass over, beside the right ones.
    pub(super) noise: bool,
    /// The emergency stop is tripped, since this cycle.
    pub(super) stopped_since: Option<u64>,
    /// Cycles that were skipped right before this one.
    pub(super) skipped: u64,
}

pub(super) struct StandIn {
    axis: CheckedAxis,
    lockstep: bool,
    /// Of the drive and the load, in rig coordinates.
    positions_m: [f64; 2],
    velocity_m_per_s: f64,
    skipped: u64,
}

impl StandIn {
    pub(super) fn new(axis: CheckedAxis, lockstep: bool) -> Self {
        Self { axis, lockstep, positions_m: [0.1, 0.5], velocity_m_per_s: 0.0, skipped: 0 }
    }

    /// What it says in `cycle`, in the order of identifiers but for a tick that announces skipped cycles.
    pub(super) fn frames(&mut self, cycle: u64, disturbance: &Disturbance, frames: &mut Vec<CanFrame>) {
        frames.clear();
        self.skipped += disturbance.skipped;
        let tick = Tick {
            cycle: cycle as u32,
            skipped: self.skipped as u16,
            catch_up: disturbance.skipped > 0,
            lockstep: self.lockstep,
            ending: false,
        };
        let mut say =
            |frame: Frame| frames.push(frame.encode().expect("the stand-in stays within the ranges"));
        if disturbance.skipped > 0 {
            say(Frame::Tick(tick));
        }
        if let Some(since) = disturbance.stopped_since
            && (cycle - since).is_multiple_of(periods::EMERGENCY_STOP_CYCLES)
        {
            let stop = EmergencyStop { reason: EmergencyStopReason::Operator, release: false };
            say(Frame::ConsoleEmergencyStop(stop));
        }
        for axis in [CheckedAxis::Drive, CheckedAxis::Load] {
            if axis != self.axis || !disturbance.sensors_lost {
                say(self.sensors(axis, cycle));
            }
        }
        if disturbance.skipped == 0 && periods::tick_is_due(cycle) {
            say(Frame::Tick(tick));
        }
        if periods::status_is_due(cycle) {
            say(Frame::RigStatus(RigStatus {
                supply_pressure_pa: 7e5,
                linked: self.axis == CheckedAxis::Load,
                emergency_stop: disturbance.stopped_since.is_some(),
                ..RigStatus::default()
            }));
        }
        if disturbance.noise {
            let sensors = self.axis.sensors().id;
            frames.push(CanFrame::new(UNKNOWN_ID, &cycle.to_le_bytes()));
            frames.push(CanFrame::from_raw(protocol::can::EXTENDED_FLAG | u32::from(sensors), &[0xFF; 8]));
            frames.push(CanFrame::new(sensors, &[0xFF; 4]));
            frames.push(CanFrame::new(TICK.id, &[0xFF; 3]));
        }
    }

    /// Moves the carriage for one cycle under this opening of the axis's valve.
    pub(super) fn advance(&mut self, opening: f64) {
        let drive = (opening.abs() - DEAD_BAND).max(0.0).copysign(opening) * SPEED_M_PER_S;
        self.velocity_m_per_s += (drive - self.velocity_m_per_s) * CYCLE_S / LAG_S;
        let (position_m, sign) = match self.axis {
            CheckedAxis::Drive => (&mut self.positions_m[0], 1.0),
            CheckedAxis::Load => (&mut self.positions_m[1], -1.0),
        };
        *position_m = (*position_m + sign * self.velocity_m_per_s * CYCLE_S).clamp(0.0, STROKE_M);
    }

    /// Somebody moves the carriage by so much, where there is room for it.
    pub(super) fn push(&mut self, way_m: f64) {
        let position_m = &mut self.positions_m[usize::from(self.axis == CheckedAxis::Load)];
        *position_m += if *position_m > STROKE_M / 2.0 { -way_m } else { way_m };
    }

    fn sensors(&self, axis: CheckedAxis, cycle: u64) -> Frame {
        let sensors = |position_m| Sensors {
            position_m,
            force_n: 0.0,
            pressure_a_pa: 3.1e5,
            pressure_b_pa: 3.5e5,
            alive: (cycle % ALIVE_RANGE) as u8,
        };
        match axis {
            CheckedAxis::Drive => Frame::DriveSensors(sensors(self.positions_m[0])),
            CheckedAxis::Load => Frame::LoadSensors(sensors(self.positions_m[1])),
        }
    }
}
