//! The two sides: one sends at a fixed period and measures, the other answers at once.

use super::transport::{Disconnected, FrameTransport};
use protocol::can::CanFrame;
use realtime::{Clock, Instant, Interrupt, Recorder};
use std::time::Duration;

/// Identifiers that are not in `rig.dbc` and that CANopen and diagnostics leave free.
const PING_ID: u16 = 0x7F0;
const PONG_ID: u16 = 0x7F1;
/// Time after which an unanswered ping is lost.
const LOST_AFTER: Duration = Duration::from_secs(1);
/// Longest wait for the first answer.
const FIRST_ANSWER: Duration = Duration::from_secs(5);
/// Period of the attempts before it.
const TRY_PERIOD: Duration = Duration::from_millis(50);

#[derive(Debug, Default)]
pub(super) struct PingPongResult {
    pub(super) sent: u64,
    pub(super) answered: u64,
    /// Pings omitted because the one before was still in flight.
    pub(super) skipped: u64,
    /// From before sending until the answer was read, ns.
    pub(super) round_trip_ns: Recorder,
    /// From before sending until the answer's arrival at our queue, ns, where the transport reports it.
    pub(super) to_arrival_ns: Recorder,
}

/// Period and number of pings.
#[derive(Clone, Copy, Debug)]
pub(super) struct PingSchedule {
    pub(super) interval: Duration,
    pub(super) pings: u64,
}

/// Waits for the first answer; false without one.
pub(super) fn serve(
    transport: &mut dyn FrameTransport,
    clock: &impl Clock,
    interrupt: &Interrupt,
) -> Result<bool, Disconnected> {
    let until = clock.now() + FIRST_ANSWER;
    while clock.now() < until && !interrupt.came() {
        let again = clock.now() + TRY_PERIOD;
        // Attempts, since a bus may not exist yet.
        transport.send(&ping(0));
        let mut answered = false;
        while clock.now() < again && !answered {
            transport.wait(&mut |frame, _| answered |= answers(frame, 0))?;
        }
        if answered {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Sends pings as scheduled, or until interrupted.
pub(super) fn ask(
    transport: &mut dyn FrameTransport,
    clock: &impl Clock,
    schedule: PingSchedule,
    interrupt: &Interrupt,
) -> Result<PingPongResult, Disconnected> {
    let mut rally = PingPongResult::default();
    let start = clock.now() + schedule.interval;
    let interval_ns = schedule.interval.as_nanos() as u64;
    let mut beat = 0;
    while beat < schedule.pings && !interrupt.came() {
        let due = Instant::from_nanos(start.as_nanos() + beat * interval_ns);
        clock.wait_until(due);
        rally.sent += 1;
        // Number 0 was the first attempt.
        if let Some((read, arrived_ns)) = exchange(transport, clock, rally.sent, interrupt)? {
            rally.answered += 1;
            rally.round_trip_ns.record(read.0);
            if let Some(arrived_ns) = arrived_ns {
                rally.to_arrival_ns.record(arrived_ns.saturating_sub(read.1));
            }
        }
        // Pings due meanwhile are omitted: they would measure the same wait again.
        let passed = clock.now().saturating_duration_since(due).as_nanos() as u64 / interval_ns;
        rally.skipped += passed.min(schedule.pings - beat - 1);
        beat += 1 + passed;
    }
    Ok(rally)
}

/// Answers until the other side has ended or is silent for `silence`.
pub(super) fn answer(transport: &mut dyn FrameTransport, clock: &impl Clock, silence: Duration) {
    let mut received = clock.now();
    loop {
        // Answered after the batch is taken, as the controller does; there is one ping at a time.
        let mut asked = None;
        let waited = transport.wait(&mut |frame, _| asked = number(frame, PING_ID).or(asked));
        if let Some(number) = asked {
            transport.send(&CanFrame::new(PONG_ID, &number.to_le_bytes()));
            received = clock.now();
        }
        if waited.is_err() || clock.now().saturating_duration_since(received) > silence {
            return;
        }
    }
}

/// Round-trip time and time of sending, in ns, and the time to arrival.
type RoundTrip = ((u64, u64), Option<u64>);

fn exchange(
    transport: &mut dyn FrameTransport,
    clock: &impl Clock,
    number: u64,
    interrupt: &Interrupt,
) -> Result<Option<RoundTrip>, Disconnected> {
    let sent = clock.now();
    transport.send(&ping(number));
    loop {
        let mut answer = None;
        transport.wait(&mut |frame, arrived_ns| {
            if answers(frame, number) {
                answer = Some(arrived_ns);
            }
        })?;
        let waited = clock.now().saturating_duration_since(sent);
        if let Some(arrived_ns) = answer {
            return Ok(Some(((waited.as_nanos() as u64, sent.as_nanos()), arrived_ns)));
        }
        if waited > LOST_AFTER || interrupt.came() {
            return Ok(None);
        }
    }
}

fn ping(number: u64) -> CanFrame {
    CanFrame::new(PING_ID, &number.to_le_bytes())
}

fn answers(frame: &CanFrame, asked: u64) -> bool {
    number(frame, PONG_ID) == Some(asked)
}

fn number(frame: &CanFrame, id: u16) -> Option<u64> {
    let data = frame.data().try_into().ok()?;
    (frame.standard_id() == Some(id)).then(|| u64::from_le_bytes(data))
}

#[cfg(test)]
mod tests {
    use super::super::transport::SocketTransport;
    use super::*;
    use realtime::MonotonicClock;
    use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};

    fn pair() -> [SocketTransport; 2] {
        let (a, b) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None).unwrap();
        [a, b].map(|socket| SocketTransport::new(socket).unwrap())
    }

    const SCHEDULE: PingSchedule = PingSchedule { interval: Duration::from_millis(1), pings: 50 };

    #[test]
    fn every_ping_is_answered_or_counted_as_left_out() {
        let [mut ours, mut theirs] = pair();
        let pong = std::thread::spawn(move || answer(&mut theirs, &MonotonicClock, Duration::from_secs(60)));
        let interrupt = Interrupt::default();
        assert_eq!(serve(&mut ours, &MonotonicClock, &interrupt), Ok(true));
        let rally = ask(&mut ours, &MonotonicClock, SCHEDULE, &interrupt).unwrap();
        assert_eq!(rally.answered, rally.sent);
        assert_eq!(rally.sent + rally.skipped, SCHEDULE.pings);
        assert_eq!(rally.round_trip_ns.percentiles().count, rally.sent);
        assert_eq!(rally.to_arrival_ns.percentiles().count, 0, "a bare socket knows no arrivals");
        drop(ours);
        pong.join().expect("the other side ends when we are gone");
    }

    #[test]
    fn a_disconnected_end_is_reported_and_a_signal_ends_the_waiting() {
        let [mut ours, theirs] = pair();
        let interrupt = Interrupt::default();
        interrupt.ask();
        assert_eq!(serve(&mut ours, &MonotonicClock, &interrupt), Ok(false));
        drop(theirs);
        let rally = ask(&mut ours, &MonotonicClock, SCHEDULE, &Interrupt::default());
        assert_eq!(rally.err(), Some(Disconnected));
    }

    #[test]
    fn an_old_answer_and_a_strange_frame_answer_nothing() {
        assert!(answers(&CanFrame::new(PONG_ID, &7_u64.to_le_bytes()), 7));
        assert!(!answers(&CanFrame::new(PONG_ID, &6_u64.to_le_bytes()), 7));
        assert!(!answers(&ping(7), 7));
        assert!(!answers(&CanFrame::new(PONG_ID, &[7]), 7));
    }
}
