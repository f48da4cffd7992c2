//! The two sides: one asks at a fixed rhythm and measures, the other answers at once.

use super::line::{Gone, Line};
use protocol::can::CanFrame;
use realtime::{Clock, Instant, Interrupt, Recorder};
use std::time::Duration;

/// Identifiers that no frame of `rig.dbc` has, and that CANopen and diagnostics leave free.
const PING_ID: u16 = 0x7F0;
const PONG_ID: u16 = 0x7F1;
/// A ping without an answer for so long is lost.
const LOST_AFTER: Duration = Duration::from_secs(1);
/// How long to try for a first answer.
const FIRST_ANSWER: Duration = Duration::from_secs(5);
/// Time between two tries for it.
const TRY_PERIOD: Duration = Duration::from_millis(50);

#[derive(Debug, Default)]
pub(super) struct PingPongResult {
    pub(super) sent: u64,
    pub(super) answered: u64,
    /// Pings left out because the one before them was not back in time.
    pub(super) skipped: u64,
    /// From before sending to having read the answer, ns.
    pub(super) round_trip_ns: Recorder,
    /// From before sending to the answer's arrival at our queue, ns, where the line tells it.
    pub(super) to_arrival_ns: Recorder,
}

/// How long and how often.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rhythm {
    pub(super) interval: Duration,
    pub(super) pings: u64,
}

/// Waits for the other side to answer at all; false when it does not.
pub(super) fn serve(line: &mut dyn Line, clock: &impl Clock, interrupt: &Interrupt) -> Result<bool, Gone> {
    let until = clock.now() + FIRST_ANSWER;
    while clock.now() < until && !interrupt.came() {
        let again = clock.now() + TRY_PERIOD;
        // A bus that is not there yet is looked for by trying.
        line.send(&ping(0));
        let mut answered = false;
        while clock.now() < again && !answered {
            line.wait(&mut |frame, _| answered |= answers(frame, 0))?;
        }
        if answered {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Asks as long as the rhythm says, or until interrupted.
pub(super) fn ask(
    line: &mut dyn Line,
    clock: &impl Clock,
    rhythm: Rhythm,
    interrupt: &Interrupt,
) -> Result<PingPongResult, Gone> {
    let mut rally = PingPongResult::default();
    let start = clock.now() + rhythm.interval;
    let interval_ns = rhythm.interval.as_nanos() as u64;
    let mut beat = 0;
    while beat < rhythm.pings && !interrupt.came() {
        let due = Instant::from_nanos(start.as_nanos() + beat * interval_ns);
        clock.wait_until(due);
        rally.sent += 1;
        // Number 0 is the one that found the other side.
        if let Some((read, arrived_ns)) = exchange(line, clock, rally.sent, interrupt)? {
            rally.answered += 1;
            rally.round_trip_ns.record(read.0);
            if let Some(arrived_ns) = arrived_ns {
                rally.to_arrival_ns.record(arrived_ns.saturating_sub(read.1));
            }
        }
        // Beats that passed meanwhile are left out: their pings would measure the same wait again.
        let passed = clock.now().saturating_duration_since(due).as_nanos() as u64 / interval_ns;
        rally.skipped += passed.min(rhythm.pings - beat - 1);
        beat += 1 + passed;
    }
    Ok(rally)
}

/// Answers until the other side is gone or silent for `silence`.
pub(super) fn answer(line: &mut dyn Line, clock: &impl Clock, silence: Duration) {
    let mut received = clock.now();
    loop {
        // Answered once the batch is taken, as the controller does; there is one ping at a time.
        let mut asked = None;
        let waited = line.wait(&mut |frame, _| asked = number(frame, PING_ID).or(asked));
        if let Some(number) = asked {
            line.send(&CanFrame::new(PONG_ID, &number.to_le_bytes()));
            received = clock.now();
        }
        if waited.is_err() || clock.now().saturating_duration_since(received) > silence {
            return;
        }
    }
}

/// Length until the answer was read with the time of sending, in ns, and when it arrived.
type Exchanged = ((u64, u64), Option<u64>);

fn exchange(
    line: &mut dyn Line,
    clock: &impl Clock,
    number: u64,
    interrupt: &Interrupt,
) -> Result<Option<Exchanged>, Gone> {
    let sent = clock.now();
    line.send(&ping(number));
    loop {
        let mut answer = None;
        line.wait(&mut |frame, arrived_ns| {
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
    use super::super::line::OnSocket;
    use super::*;
    use realtime::MonotonicClock;
    use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};

    fn pair() -> [OnSocket; 2] {
        let (a, b) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None).unwrap();
        [a, b].map(|socket| OnSocket::new(socket).unwrap())
    }

    const RHYTHM: Rhythm = Rhythm { interval: Duration::from_millis(1), pings: 50 };

    #[test]
    fn every_ping_is_answered_or_counted_as_left_out() {
        let [mut ours, mut theirs] = pair();
        let pong = std::thread::spawn(move || answer(&mut theirs, &MonotonicClock, Duration::from_secs(60)));
        let interrupt = Interrupt::default();
        assert_eq!(serve(&mut ours, &MonotonicClock, &interrupt), Ok(true));
        let rally = ask(&mut ours, &MonotonicClock, RHYTHM, &interrupt).unwrap();
        assert_eq!(rally.answered, rally.sent);
        assert_eq!(rally.sent + rally.skipped, RHYTHM.pings);
        assert_eq!(rally.round_trip_ns.percentiles().count, rally.sent);
        assert_eq!(rally.to_arrival_ns.percentiles().count, 0, "a bare socket knows no arrivals");
        drop(ours);
        pong.join().expect("the other side ends when we are gone");
    }

    #[test]
    fn an_end_that_is_gone_is_told_and_a_signal_ends_the_waiting() {
        let [mut ours, theirs] = pair();
        let interrupt = Interrupt::default();
        interrupt.ask();
        assert_eq!(serve(&mut ours, &MonotonicClock, &interrupt), Ok(false));
        drop(theirs);
        let rally = ask(&mut ours, &MonotonicClock, RHYTHM, &Interrupt::default());
        assert_eq!(rally.err(), Some(Gone));
    }

    #[test]
    fn an_old_answer_and_a_strange_frame_answer_nothing() {
        assert!(answers(&CanFrame::new(PONG_ID, &7_u64.to_le_bytes()), 7));
        assert!(!answers(&CanFrame::new(PONG_ID, &6_u64.to_le_bytes()), 7));
        assert!(!answers(&ping(7), 7));
        assert!(!answers(&CanFrame::new(PONG_ID, &[7]), 7));
    }
}
