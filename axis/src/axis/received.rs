//! Frames that an axis received since its last answer: partner, emergency stops, console, set-points by hand.

use crate::chains::{Console, Partner};
use nominal::Axis;
use protocol::frames::{EmergencyStop, EmergencyStopReason, Frame, HandSetPoint, HandSetPointAxis};

pub(super) struct Received {
    /// The receiving axis.
    axis: Axis,
    experiment: u8,
    pub(super) partner: Partner,
    partner_status_received: bool,
    pub(super) console: Console,
    pub(super) stop: Option<EmergencyStopReason>,
    pub(super) hand_set_point: Option<HandSetPoint>,
    answered: Option<u64>,
}

impl Received {
    /// Nothing, by `axis` in experiment number `experiment`.
    pub(super) fn new(axis: Axis, experiment: u8) -> Self {
        Self {
            axis,
            experiment,
            partner: Partner::default(),
            partner_status_received: false,
            console: Console::default(),
            stop: None,
            hand_set_point: None,
            answered: None,
        }
    }

    /// Processes a frame; those of this axis come from another controller and are ignored.
    pub(super) fn take(&mut self, frame: &Frame) {
        match (self.axis, frame) {
            (Axis::Load, Frame::DriveChainStatus(status)) | (Axis::Drive, Frame::LoadChainStatus(status)) => {
                self.partner.status = Some(*status);
                self.partner_status_received = true;
            }
            (Axis::Load, Frame::DriveChainValues(values)) | (Axis::Drive, Frame::LoadChainValues(values)) => {
                self.partner.values = Some(*values);
            }
            (Axis::Load, Frame::DriveEmergencyStop(stop))
            | (Axis::Drive, Frame::LoadEmergencyStop(stop))
            | (_, Frame::RigEmergencyStop(stop)) => self.take_stop(stop),
            (_, Frame::ConsoleEmergencyStop(stop)) => {
                self.console.release |= stop.release;
                self.take_stop(stop);
            }
            (_, Frame::RunControl(control)) => self.console.take_run_control(control, self.experiment),
            (axis, Frame::HandSetPoint(hand)) if axis == axis_of(hand) => self.hand_set_point = Some(*hand),
            _ => {}
        }
    }

    fn take_stop(&mut self, stop: &EmergencyStop) {
        if !stop.release {
            self.stop = Some(stop.reason);
        }
    }

    /// Updates the cycle in which the partner was received last. Cycles that the rig skipped or that this process missed do not
    /// count as silence of the partner: it had nothing to answer, or its frames were not received.
    pub(super) fn update_partner_age(&mut self, cycle: u64) {
        let missed = self.answered.map_or(0, |last| cycle.saturating_sub(last + 1));
        self.answered = Some(cycle);
        let received = &mut self.partner.received;
        *received = received.map(|received| received + missed);
        if std::mem::take(&mut self.partner_status_received) {
            *received = Some(cycle);
        }
    }
}

fn axis_of(hand: &HandSetPoint) -> Axis {
    match hand.axis {
        HandSetPointAxis::Drive => Axis::Drive,
        HandSetPointAxis::Load => Axis::Load,
    }
}
