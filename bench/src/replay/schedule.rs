//! Due time of each frame of a log, and the frames that are not sent.
//!
//! due = start + (stamp - first stamp), absolute: a late frame delays no other, and there is no drift. A stamp before an
//! earlier line's is due with that line and counted; the order on the bus is that of the log.

use super::kind::{Exclusion, Kind};
use crate::recorded_log::RecordedLog;
use protocol::can::CanFrame;
use std::time::Duration;

/// Longest log: a longer one contains a stamp of another clock.
pub(super) const LONGEST: Duration = Duration::from_secs(7 * 24 * 3600);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ScheduledFrame {
    /// Since the first frame of the log, ns.
    pub(super) after_ns: u64,
    pub(super) frame: CanFrame,
}

/// The frames to send, and counts of the others.
#[derive(Clone, Debug, Default)]
pub(super) struct Schedule {
    pub(super) frames: Vec<ScheduledFrame>,
    /// Left out on request.
    pub(super) left_out: u64,
    pub(super) error_frames: u64,
    /// Frames with a stamp before an earlier line's.
    pub(super) disordered: u64,
    /// Commands among `frames`.
    pub(super) commands: u64,
    /// Frames of the rig among `frames`.
    pub(super) of_the_rig: u64,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LogTooLong {
    /// Line of the first frame beyond the limit.
    pub(super) line: u64,
}

impl Schedule {
    pub(super) fn of(log: &RecordedLog, leave_out: &[Exclusion]) -> Result<Self, LogTooLong> {
        let first_ns = log.frames[0].record.stamp_ns;
        let mut schedule = Self::default();
        let mut newest_ns = first_ns;
        for logged in &log.frames {
            let (stamp_ns, frame) = (logged.record.stamp_ns, logged.record.frame);
            schedule.disordered += u64::from(stamp_ns < newest_ns);
            newest_ns = newest_ns.max(stamp_ns);
            let after_ns = newest_ns - first_ns;
            if u128::from(after_ns) > LONGEST.as_nanos() {
                return Err(LogTooLong { line: logged.line });
            }
            let kind = Kind::of(&frame);
            if kind == Kind::Error {
                schedule.error_frames += 1;
            } else if leave_out.iter().any(|left_out| left_out.names(&frame)) {
                schedule.left_out += 1;
            } else {
                schedule.commands += u64::from(kind == Kind::Command);
                schedule.of_the_rig += u64::from(kind == Kind::Rig);
                schedule.frames.push(ScheduledFrame { after_ns, frame });
            }
        }
        Ok(schedule)
    }

    /// Whether it must not be sent beside a live rig.
    pub(super) fn disturbs_a_rig(&self) -> bool {
        self.commands + self.of_the_rig > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use runlog::candump::LogReader;

    fn schedule(text: &str, leave_out: &[Exclusion]) -> Result<Schedule, LogTooLong> {
        let frames = LogReader::new(text.as_bytes()).map(Result::unwrap).collect();
        let log = RecordedLog {
            file: "a.log".into(),
            seen_at: Vec::new(),
            frames,
            interfaces: vec!["a".into()],
            cut_line: None,
            cycle_zero_ns: None,
        };
        Schedule::of(&log, leave_out)
    }

    #[test]
    fn frames_are_due_by_their_stamps_and_never_before_the_one_before() {
        let text = "(5.000001) a 7F0#01\n(5.000003) a 7F0#02\n(5.000002) a 7F0#03\n(5.000009) a 7F0#04\n";
        let schedule = schedule(text, &[]).unwrap();
        let due: Vec<_> = schedule.frames.iter().map(|due| (due.after_ns, due.frame.data()[0])).collect();
        assert_eq!(due, [(0, 1), (2000, 2), (2000, 3), (8000, 4)]);
        assert_eq!((schedule.disordered, schedule.disturbs_a_rig()), (1, false));
    }

    #[test]
    fn what_disturbs_a_rig_is_counted_and_can_be_left_out() {
        let text = "(0.1) a 110#0000000000\n(0.1) a 120#0000000000000000\n(0.1) a 7F0#\n(0.1) a 20000004#\n";
        let all = schedule(text, &[]).unwrap();
        assert_eq!((all.commands, all.of_the_rig, all.error_frames, all.frames.len()), (1, 1, 1, 3));
        let without_commands = schedule(text, &[Exclusion::Commands]).unwrap();
        assert!(without_commands.disturbs_a_rig(), "a second rig's sensors");
        let others = schedule(text, &[Exclusion::Commands, Exclusion::Rig]).unwrap();
        assert_eq!((others.disturbs_a_rig(), others.left_out, others.frames.len()), (false, 2, 1));
    }

    #[test]
    fn a_log_that_jumps_by_years_is_refused_by_its_line() {
        let text = "(5.0) a 7F0#\n(18446744073.0) a 7F0#\n";
        assert_eq!(schedule(text, &[]).unwrap_err(), LogTooLong { line: 2 });
    }
}
