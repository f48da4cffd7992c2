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

struct ChainBench {
    chain: EmergencyStopChain,
    inputs: StopInputs,
}

impl ChainBench {
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

    /// One cycle; frame and console inputs last for one cycle.
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
        let mut bench = Self::new(after_emergency_stop);
        bench.step();
        if state == S::Ready {
            return bench;
        }
        bench.inputs.rig = Some(rig(true));
        bench.step();
        if state == S::Tripped {
            return bench;
        }
        bench.run(100);
        if state == S::WaitingForRelease {
            return bench;
        }
        bench.inputs.rig = Some(rig(false));
        bench.step();
        if state != S::Recovering {
            bench.run(201);
        }
        assert_eq!(bench.chain.state(), state);
        bench
    }
}

#[test]
fn the_rigs_stop_goes_round_to_ready() {
    for after in [AfterStop::End, AfterStop::Restart] {
        let mut bench = ChainBench::to(after, S::Recovering);
        assert_eq!(bench.chain.entered.cause, StopCause::Released);
        assert_eq!(bench.run(200), S::Recovering);
        assert_eq!(bench.step(), S::Ready);
        assert_eq!(bench.chain.entered.cause, StopCause::Recovered);
    }
}

#[test]
fn on_start_waits_for_a_person() {
    let mut bench = ChainBench::to(AfterStop::OnStart, S::WaitingForStart);
    assert_eq!(bench.run(100_000), S::WaitingForStart);
    bench.inputs.console.start = true;
    assert_eq!((bench.step(), bench.chain.entered.cause), (S::Ready, StopCause::Started));
}

#[test]
fn a_start_before_is_none() {
    for state in [S::Tripped, S::WaitingForRelease, S::Recovering] {
        let mut bench = ChainBench::to(AfterStop::OnStart, state);
        bench.inputs.console.start = true;
        bench.step();
        assert_eq!(bench.chain.state(), state);
    }
}

#[test]
fn everything_trips_from_everywhere_in_its_cycle() {
    for state in [S::Ready, S::Recovering, S::WaitingForStart] {
        let mut bench = ChainBench::to(AfterStop::OnStart, state);
        bench.inputs.rig = Some(rig(true));
        assert_eq!((bench.step(), bench.chain.entered.cause), (S::Tripped, StopCause::Rig), "{state}");

        let mut bench = ChainBench::to(AfterStop::OnStart, state);
        bench.inputs.frame = Some(EmergencyStopReason::Operator);
        let cause = StopCause::Frame(EmergencyStopReason::Operator);
        assert_eq!((bench.step(), bench.chain.entered.cause), (S::Tripped, cause), "{state}");
    }
    for state in [S::Ready, S::Tripped, S::WaitingForRelease, S::Recovering, S::WaitingForStart] {
        let mut bench = ChainBench::to(AfterStop::OnStart, state);
        bench.chain.trip(Fault::SensorLoss, bench.inputs.cycle);
        assert_eq!(
            (bench.chain.state(), bench.chain.entered.cause),
            (S::Tripped, StopCause::LocalFault(Fault::SensorLoss))
        );
        let stop = EmergencyStop { reason: EmergencyStopReason::SensorLoss, release: false };
        assert_eq!(bench.chain.frame_due(bench.inputs.cycle), Some(stop), "at once, in {state}");
    }
}

#[test]
fn tripped_lasts_until_standstill_and_a_second_at_most() {
    for (at_standstill, cycles, cause) in
        [(true, 100, StopCause::Standstill), (false, 1000, StopCause::NoStandstill)]
    {
        let mut bench = ChainBench::to(AfterStop::Restart, S::Tripped);
        bench.inputs.at_standstill = at_standstill;
        assert_eq!(bench.run(cycles - 1), S::Tripped);
        assert_eq!((bench.step(), bench.chain.entered.cause), (S::WaitingForRelease, cause));
    }
}

#[test]
fn a_rig_that_is_not_heard_has_not_released() {
    let mut bench = ChainBench::to(AfterStop::Restart, S::WaitingForRelease);
    bench.inputs.rig = None;
    assert_eq!(bench.run(5000), S::WaitingForRelease);
}

#[test]
fn the_supply_must_be_back_for_a_while_without_a_break() {
    let low = RigStatus { supply_pressure_pa: 0.89 * SUPPLY_PA, ..rig(false) };
    let shut = RigStatus { check_valves_shut: true, ..rig(false) };
    for not_yet in [low, shut] {
        let mut bench = ChainBench::to(AfterStop::Restart, S::Recovering);
        bench.run(150);
        bench.inputs.rig = Some(not_yet);
        assert_eq!(bench.run(1000), S::Recovering);
        bench.inputs.rig = Some(rig(false));
        assert_eq!(bench.run(200), S::Recovering);
        assert_eq!(bench.step(), S::Ready);
    }
}

#[test]
fn an_own_stop_is_repeated_every_hundred_cycles() {
    let mut bench = ChainBench::new(AfterStop::Restart);
    bench.chain.trip(Fault::PartnerLost, 0);
    let mut sent = vec![];
    for cycle in 0..1000 {
        bench.step();
        if let Some(stop) = bench.chain.frame_due(cycle) {
            assert_eq!(stop, EmergencyStop { reason: EmergencyStopReason::PartnerLost, release: false });
            sent.push(cycle);
        }
    }
    assert_eq!(sent, (0..1000).step_by(100).collect::<Vec<_>>());
}

/// A chain that waits with a stop of its own.
fn holding(fault: Fault) -> ChainBench {
    let mut bench = ChainBench::new(AfterStop::Restart);
    bench.chain.trip(fault, 0);
    bench.chain.frame_due(0);
    bench.inputs.rig = Some(rig(true));
    bench.run(200);
    assert_eq!((bench.chain.state(), bench.chain.holds()), (S::WaitingForRelease, Some(fault)));
    bench
}

#[test]
fn an_own_stop_is_withdrawn_once_by_a_persons_release() {
    let mut bench = holding(Fault::PartnerLost);
    bench.inputs.console.release = true;
    bench.step();
    let release = EmergencyStop { reason: EmergencyStopReason::None, release: true };
    assert_eq!(bench.chain.frame_due(bench.inputs.cycle), Some(release));
    for _ in 0..500 {
        bench.step();
        assert_eq!(bench.chain.frame_due(bench.inputs.cycle), None);
    }
    assert_eq!((bench.chain.state(), bench.chain.holds()), (S::WaitingForRelease, None), "others still hold");
    // The frame was lost: the person's next release sends another.
    bench.inputs.console.release = true;
    bench.step();
    assert_eq!(bench.chain.frame_due(bench.inputs.cycle), Some(release));
    bench.inputs.rig = Some(rig(false));
    assert_eq!(bench.step(), S::Recovering);
}

#[test]
fn an_own_stop_holds_though_the_rig_says_nothing_of_it() {
    let mut bench = holding(Fault::PartnerLost);
    bench.inputs.rig = Some(rig(false));
    assert_eq!(bench.run(5000), S::WaitingForRelease);
}

#[test]
fn a_release_is_not_taken_while_its_cause_lasts() {
    type CausePersists = fn(&mut StopInputs);
    let cases: [(Fault, CausePersists); 2] = [
        (Fault::PartnerLost, |inputs| inputs.partner_fresh = false),
        (Fault::SensorLoss, |inputs| inputs.sensors_fresh = false),
    ];
    for (fault, keep_cause) in cases {
        let mut bench = holding(fault);
        keep_cause(&mut bench.inputs);
        bench.inputs.console.release = true;
        bench.run(10);
        (bench.inputs.partner_fresh, bench.inputs.sensors_fresh) = (true, true);
        bench.run(1000);
        assert_eq!(bench.chain.holds(), Some(fault), "it came too early");
        bench.inputs.console.release = true;
        bench.step();
        assert_eq!(bench.chain.holds(), None);
    }
}

#[test]
fn an_early_release_is_sent_at_standstill() {
    let mut bench = ChainBench::new(AfterStop::Restart);
    bench.chain.trip(Fault::SettlingTimeout, 0);
    bench.chain.frame_due(0);
    (bench.inputs.rig, bench.inputs.at_standstill) = (Some(rig(true)), false);
    bench.inputs.console.release = true;
    for cycle in 0..500 {
        bench.step();
        assert_eq!(bench.chain.frame_due(cycle), None);
    }
    bench.inputs.at_standstill = true;
    bench.step();
    assert!(bench.chain.frame_due(500).unwrap().release);
}

#[test]
fn the_first_fault_is_kept() {
    let mut bench = holding(Fault::PartnerLost);
    bench.chain.trip(Fault::SettlingTimeout, bench.inputs.cycle);
    assert_eq!(bench.chain.holds(), Some(Fault::PartnerLost));
}

#[test]
fn the_rigs_stop_does_not_hide_an_own_one() {
    let mut bench = ChainBench::to(AfterStop::Restart, S::Tripped);
    bench.chain.trip(Fault::LimitExceeded, bench.inputs.cycle);
    bench.run(200);
    bench.inputs.rig = Some(rig(false));
    assert_eq!(bench.run(1000), S::WaitingForRelease);
}

#[test]
fn a_new_rig_makes_ready_from_everywhere() {
    for state in [S::Ready, S::Tripped, S::WaitingForRelease, S::Recovering, S::WaitingForStart] {
        let mut bench = ChainBench::to(AfterStop::OnStart, state);
        bench.chain.restart(0);
        assert_eq!((bench.chain.state(), bench.chain.entered.cause), (S::Ready, StopCause::RigRestarted));
    }
    let mut bench = holding(Fault::PartnerLost);
    bench.chain.restart(0);
    assert_eq!((bench.chain.holds(), bench.chain.frame_due(0)), (None, None));
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
        let mut bench = ChainBench::new(after);
        let mut before = S::Ready;
        for (cycles, [tripped, still, fresh, start, release, received], frame, fault) in row {
            bench.inputs.cycle += cycles;
            bench.inputs.rig = received.then_some(rig(tripped && frame < 10));
            bench.inputs.at_standstill = still;
            bench.inputs.partner_fresh = fresh;
            bench.inputs.console = Console { start, release, abort: false };
            bench.inputs.frame = (frame == 0).then_some(EmergencyStopReason::RigFault);
            let holds = bench.chain.holds();
            let state = bench.step();
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
                bench.chain.trip(*fault, bench.inputs.cycle);
                before = bench.chain.state();
            }
            bench.chain.frame_due(bench.inputs.cycle);
        }
    }
}
