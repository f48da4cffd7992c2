//! A stand-in for the rig: sends the frames of a rig, follows valve commands, and injects losses of sensors and stops.
//!
//! It is no model of the plant: a carriage follows its valve with a lag, so that a controller has something to move and reaches
//! its set-points. Pressures and forces are constant. Controllers are judged by what they send, never by the position of the
//! carriage.
//!
//! ```text
//!   v' = (V s(u) - v) / T        s(u) = sign(u) max(|u| - 0.03, 0)        V = 1.15 m/s, T = 30 ms
//! ```
//!
//! V and the dead band are those of the nominal valve between openings of 0.03 and 0.3 (plant/rig.toml, choked exhaust); T is a
//! guess, shorter than the lag of the air.

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
/// An identifier that is not in rig.dbc.
const UNKNOWN_ID: u16 = 0x5A5;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Disturbance {
    pub(super) sensors_lost: bool,
    /// Frames that a controller must ignore are sent beside the valid ones.
    pub(super) noise: bool,
    /// The emergency stop is tripped since this cycle.
    pub(super) stopped_since: Option<u64>,
    /// Cycles that were skipped just before this one.
    pub(super) skipped: u64,
}

pub(super) struct RigStandIn {
    axis: CheckedAxis,
    lockstep: bool,
    /// Positions of drive and load, in rig coordinates.
    positions_m: [f64; 2],
    velocity_m_per_s: f64,
    skipped: u64,
}

impl RigStandIn {
    pub(super) fn new(axis: CheckedAxis, lockstep: bool) -> Self {
        Self { axis, lockstep, positions_m: [0.1, 0.5], velocity_m_per_s: 0.0, skipped: 0 }
    }

    /// The frames of `cycle` in the order of identifiers, except that a tick with skipped cycles comes first.
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
        let mut send =
            |frame: Frame| frames.push(frame.encode().expect("the stand-in stays within the ranges"));
        if disturbance.skipped > 0 {
            send(Frame::Tick(tick));
        }
        if let Some(since) = disturbance.stopped_since
            && (cycle - since).is_multiple_of(periods::EMERGENCY_STOP_CYCLES)
        {
            let stop = EmergencyStop { reason: EmergencyStopReason::Operator, release: false };
            send(Frame::ConsoleEmergencyStop(stop));
        }
        for axis in [CheckedAxis::Drive, CheckedAxis::Load] {
            if axis != self.axis || !disturbance.sensors_lost {
                send(self.sensors(axis, cycle));
            }
        }
        if disturbance.skipped == 0 && periods::tick_is_due(cycle) {
            send(Frame::Tick(tick));
        }
        if periods::status_is_due(cycle) {
            send(Frame::RigStatus(RigStatus {
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

    /// Moves the carriage for one cycle at this opening of the valve.
    pub(super) fn advance(&mut self, opening: f64) {
        let drive = (opening.abs() - DEAD_BAND).max(0.0).copysign(opening) * SPEED_M_PER_S;
        self.velocity_m_per_s += (drive - self.velocity_m_per_s) * CYCLE_S / LAG_S;
        let (position_m, sign) = match self.axis {
            CheckedAxis::Drive => (&mut self.positions_m[0], 1.0),
            CheckedAxis::Load => (&mut self.positions_m[1], -1.0),
        };
        *position_m = (*position_m + sign * self.velocity_m_per_s * CYCLE_S).clamp(0.0, STROKE_M);
    }

    /// Moves the carriage by `distance_m`, within its stroke.
    pub(super) fn push(&mut self, distance_m: f64) {
        let position_m = &mut self.positions_m[usize::from(self.axis == CheckedAxis::Load)];
        *position_m += if *position_m > STROKE_M / 2.0 { -distance_m } else { distance_m };
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
