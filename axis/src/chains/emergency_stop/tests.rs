//! Tests of the emergency stop chain: its edges, its frames, and the lines of its way back.

use super::*;
use EmergencyStopChainState as S;
use proptest::prelude::*;
use protocol::can::CanFrame;
use protocol::frames::{Frame, RunControl, RunControlCommand};

const SUPPLY_PA: f64 = 7e5;

fn rig(emergency_stop: bool) -> RigStatus {
    RigStatus {
        emergency_stop,
        check_valves_shut: emergency_stop,
        supply_pressure_pa: if emergency_stop { 1e5 } else { SUPPLY_PA },
        ..RigStatus::default()
    }
}

struct Play {
    chain: EmergencyStopChain,
    inputs: StopInputs,
}

impl Play {
    fn new(after_emergency_stop: AfterStop) -> Self {
        let config = StopConfig { after_emergency_stop, supply_pressure_pa: SUPPLY_PA };
        let inputs = StopInputs {
            rig: Some(rig(false)),
            at_standstill: true,
            partner_fresh: true,
            sensors_fresh: true,
            ..StopInputs::default()
        };
        Self { chain: EmergencyStopChain::new(config), inputs }
    }

    /// One cycle; what was said is said once.
    fn step(&mut self) -> S {
        let state = self.chain.advance(&self.inputs);
        self.inputs.cycle += 1;
        self.inputs.frame = None;
        self.inputs.console = Console::default();
        state
    }

    fn run(&mut self, cycles: u64) -> S {
        (0..cycles).for_each(|_| {
            self.step();
        });
        self.chain.state()
    }

    /// Brings the chain to `state` by the rig's emergency stop.
    fn to(after_emergency_stop: AfterStop, state: S) -> Self {
        let mut play = Self::new(after_emergency_stop);
        play.step();
        if state == S::Ready {
            return play;
        }
        play.inputs.rig = Some(rig(true));
        play.step();
        if state == S::Tripped {
            return play;
        }
        play.run(100);
        if state == S::WaitingForRelease {
            return play;
        }
        play.inputs.rig = Some(rig(false));
        play.step();
        if state != S::Recovering {
            play.run(201);
        }
        assert_eq!(play.chain.state(), state);
        play
    }

    fn cause(&self) -> StopCause {
        self.chain.entered.cause
    }
}

#[test]
fn the_rigs_stop_goes_round_to_ready() {
    for after in [AfterStop::End, AfterStop::Restart] {
        let mut play = Play::to(after, S::Recovering);
        assert_eq!(play.cause(), StopCause::Released);
        assert_eq!(play.run(200), S::Recovering);
        assert_eq!(play.step(), S::Ready);
        assert_eq!(play.cause(), StopCause::Recovered);
    }
}

#[test]
fn on_start_waits_for_a_person() {
    let mut play = Play::to(AfterStop::OnStart, S::WaitingForStart);
    assert_eq!(play.run(100_000), S::WaitingForStart);
    play.inputs.console.start = true;
    assert_eq!((play.step(), play.cause()), (S::Ready, StopCause::Started));
}

#[test]
fn a_start_before_is_none() {
    for state in [S::Tripped, S::WaitingForRelease, S::Recovering] {
        let mut play = Play::to(AfterStop::OnStart, state);
        play.inputs.console.start = true;
        play.step();
        assert_eq!(play.chain.state(), state);
    }
}

#[test]
fn everything_trips_from_everywhere_in_its_cycle() {
    for state in [S::Ready, S::Recovering, S::WaitingForStart] {
        let mut play = Play::to(AfterStop::OnStart, state);
        play.inputs.rig = Some(rig(true));
        assert_eq!((play.step(), play.cause()), (S::Tripped, StopCause::Rig), "{state}");

        let mut play = Play::to(AfterStop::OnStart, state);
        play.inputs.frame = Some(EmergencyStopReason::Operator);
        let cause = StopCause::Frame(EmergencyStopReason::Operator);
        assert_eq!((play.step(), play.cause()), (S::Tripped, cause), "{state}");
    }
    for state in [S::Ready, S::Tripped, S::WaitingForRelease, S::Recovering, S::WaitingForStart] {
        let mut play = Play::to(AfterStop::OnStart, state);
        play.chain.trip(Fault::SensorLoss, play.inputs.cycle);
        assert_eq!(
            (play.chain.state(), play.cause()),
            (S::Tripped, StopCause::LocalFault(Fault::SensorLoss))
        );
        let stop = EmergencyStop { reason: EmergencyStopReason::SensorLoss, release: false };
        assert_eq!(play.chain.frame_due(play.inputs.cycle), Some(stop), "at once, in {state}");
    }
}

#[test]
fn tripped_lasts_until_standstill_and_a_second_at_most() {
    for (at_standstill, cycles, cause) in
        [(true, 100, StopCause::Standstill), (false, 1000, StopCause::NoStandstill)]
    {
        let mut play = Play::to(AfterStop::Restart, S::Tripped);
        play.inputs.at_standstill = at_standstill;
        assert_eq!(play.run(cycles - 1), S::Tripped);
        assert_eq!((play.step(), play.cause()), (S::WaitingForRelease, cause));
    }
}

#[test]
fn a_rig_that_is_not_heard_has_not_released() {
    let mut play = Play::to(AfterStop::Restart, S::WaitingForRelease);
    play.inputs.rig = None;
    assert_eq!(play.run(5000), S::WaitingForRelease);
}

#[test]
fn the_supply_must_be_back_for_a_while_without_a_break() {
    let low = RigStatus { supply_pressure_pa: 0.89 * SUPPLY_PA, ..rig(false) };
    let shut = RigStatus { check_valves_shut: true, ..rig(false) };
    for not_yet in [low, shut] {
        let mut play = Play::to(AfterStop::Restart, S::Recovering);
        play.run(150);
        play.inputs.rig = Some(not_yet);
        assert_eq!(play.run(1000), S::Recovering);
        play.inputs.rig = Some(rig(false));
        assert_eq!(play.run(200), S::Recovering);
        assert_eq!(play.step(), S::Ready);
    }
}

#[test]
fn an_own_stop_is_repeated_every_hundred_cycles() {
    let mut play = Play::new(AfterStop::Restart);
    play.chain.trip(Fault::PartnerLost, 0);
    let mut sent = vec![];
    for cycle in 0..1000 {
        play.step();
        if let Some(stop) = play.chain.frame_due(cycle) {
            assert_eq!(stop, EmergencyStop { reason: EmergencyStopReason::PartnerLost, release: false });
            sent.push(cycle);
        }
    }
    assert_eq!(sent, (0..1000).step_by(100).collect::<Vec<_>>());
}

/// A chain that waits with a stop of its own.
fn holding(fault: Fault) -> Play {
    let mut play = Play::new(AfterStop::Restart);
    play.chain.trip(fault, 0);
    play.chain.frame_due(0);
    play.inputs.rig = Some(rig(true));
    play.run(200);
    assert_eq!((play.chain.state(), play.chain.holds()), (S::WaitingForRelease, Some(fault)));
    play
}

#[test]
fn an_own_stop_is_withdrawn_once_by_a_persons_release() {
    let mut play = holding(Fault::PartnerLost);
    play.inputs.console.release = true;
    play.step();
    let release = EmergencyStop { reason: EmergencyStopReason::None, release: true };
    assert_eq!(play.chain.frame_due(play.inputs.cycle), Some(release));
    for _ in 0..500 {
        play.step();
        assert_eq!(play.chain.frame_due(play.inputs.cycle), None);
    }
    assert_eq!((play.chain.state(), play.chain.holds()), (S::WaitingForRelease, None), "others still hold");
    // The frame was lost: the person's next release sends another.
    play.inputs.console.release = true;
    play.step();
    assert_eq!(play.chain.frame_due(play.inputs.cycle), Some(release));
    play.inputs.rig = Some(rig(false));
    assert_eq!(play.step(), S::Recovering);
}

#[test]
fn an_own_stop_holds_though_the_rig_says_nothing_of_it() {
    let mut play = holding(Fault::PartnerLost);
    play.inputs.rig = Some(rig(false));
    assert_eq!(play.run(5000), S::WaitingForRelease);
}

#[test]
fn a_release_is_not_taken_while_its_cause_lasts() {
    type Lasts = fn(&mut StopInputs);
    let cases: [(Fault, Lasts); 2] = [
        (Fault::PartnerLost, |inputs| inputs.partner_fresh = false),
        (Fault::SensorLoss, |inputs| inputs.sensors_fresh = false),
    ];
    for (fault, lasts) in cases {
        let mut play = holding(fault);
        lasts(&mut play.inputs);
        play.inputs.console.release = true;
        play.run(10);
        (play.inputs.partner_fresh, play.inputs.sensors_fresh) = (true, true);
        play.run(1000);
        assert_eq!(play.chain.holds(), Some(fault), "it came too early");
        play.inputs.console.release = true;
        play.step();
        assert_eq!(play.chain.holds(), None);
    }
}

#[test]
fn an_early_release_is_sent_at_standstill() {
    let mut play = Play::new(AfterStop::Restart);
    play.chain.trip(Fault::SettlingTimeout, 0);
    play.chain.frame_due(0);
    (play.inputs.rig, play.inputs.at_standstill) = (Some(rig(true)), false);
    play.inputs.console.release = true;
    for cycle in 0..500 {
        play.step();
        assert_eq!(play.chain.frame_due(cycle), None);
    }
    play.inputs.at_standstill = true;
    play.step();
    assert!(play.chain.frame_due(500).unwrap().release);
}

#[test]
fn the_first_fault_is_kept() {
    let mut play = holding(Fault::PartnerLost);
    play.chain.trip(Fault::SettlingTimeout, play.inputs.cycle);
    assert_eq!(play.chain.holds(), Some(Fault::PartnerLost));
}

#[test]
fn the_rigs_stop_does_not_hide_an_own_one() {
    let mut play = Play::to(AfterStop::Restart, S::Tripped);
    play.chain.trip(Fault::LimitExceeded, play.inputs.cycle);
    play.run(200);
    play.inputs.rig = Some(rig(false));
    assert_eq!(play.run(1000), S::WaitingForRelease);
}

#[test]
fn a_new_rig_makes_ready_from_everywhere() {
    for state in [S::Ready, S::Tripped, S::WaitingForRelease, S::Recovering, S::WaitingForStart] {
        let mut play = Play::to(AfterStop::OnStart, state);
        play.chain.restart(0);
        assert_eq!((play.chain.state(), play.cause()), (S::Ready, StopCause::RigRestarted));
    }
    let mut play = holding(Fault::PartnerLost);
    play.chain.restart(0);
    assert_eq!((play.chain.holds(), play.chain.frame_due(0)), (None, None));
}

#[test]
fn the_lines_of_the_way_back_are_the_frames_they_name() {
    let decode = |id: u16, data: &[u8]| Frame::decode(&CanFrame::new(id, data)).unwrap();
    let operator = EmergencyStop { reason: EmergencyStopReason::Operator, release: false };
    let release = EmergencyStop { reason: EmergencyStopReason::None, release: true };
    let start = RunControl { command: RunControlCommand::Start, experiment: 9 };
    let abort = RunControl { command: RunControlCommand::Abort, experiment: 0 };
    assert_eq!(decode(0x108, &[0x01, 0x00]), Frame::ConsoleEmergencyStop(operator));
    assert_eq!(decode(0x108, &[0x00, 0x01]), Frame::ConsoleEmergencyStop(release));
    assert_eq!(decode(0x10A, &[0x00, 0x01]), Frame::DriveEmergencyStop(release));
    assert_eq!(decode(0x10B, &[0x00, 0x01]), Frame::LoadEmergencyStop(release));
    assert_eq!(decode(0x160, &[0x01, 0x09]), Frame::RunControl(start));
    assert_eq!(decode(0x160, &[0x02, 0x00]), Frame::RunControl(abort));
}

proptest! {
    #[test]
    fn whatever_comes_only_the_diagrams_edges_are_gone(
        row in prop::collection::vec((0_u64..300, any::<[bool; 6]>(), 0_u8..20, 0_usize..200), 1..300),
        after in prop_oneof![Just(AfterStop::End), Just(AfterStop::Restart), Just(AfterStop::OnStart)],
    ) {
        let mut play = Play::new(after);
        let mut before = S::Ready;
        for (cycles, [tripped, still, fresh, start, release, received], frame, fault) in row {
            play.inputs.cycle += cycles;
            play.inputs.rig = received.then_some(rig(tripped && frame < 10));
            play.inputs.at_standstill = still;
            play.inputs.partner_fresh = fresh;
            play.inputs.console = Console { start, release, abort: false };
            play.inputs.frame = (frame == 0).then_some(EmergencyStopReason::RigFault);
            let holds = play.chain.holds();
            let state = play.step();
            let allowed = match before {
                S::Ready => [S::Ready, S::Tripped, S::Tripped],
                S::Tripped => [S::Tripped, S::WaitingForRelease, S::WaitingForRelease],
                S::WaitingForRelease => [S::WaitingForRelease, S::Recovering, S::Recovering],
                S::Recovering if after == AfterStop::OnStart => [S::Recovering, S::Tripped, S::WaitingForStart],
                S::Recovering => [S::Recovering, S::Tripped, S::Ready],
                S::WaitingForStart => [S::WaitingForStart, S::Tripped, S::Ready],
            };
            prop_assert!(allowed.contains(&state), "{before} -> {state}");
            prop_assert!(holds.is_none() || matches!(state, S::Tripped | S::WaitingForRelease) || release);
            before = state;
            if let Some(fault) = Fault::ALL.get(fault) {
                play.chain.trip(*fault, play.inputs.cycle);
                before = play.chain.state();
            }
            play.chain.frame_due(play.inputs.cycle);
        }
    }
}
