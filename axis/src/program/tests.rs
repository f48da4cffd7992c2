//! Claims on a program that runs: who decides what of giving way, and what a stall does.

use super::file::Source;
use super::{ActiveAlgorithm, Demand, Program};
use crate::chains::force::ForceOutput;
use crate::set_point::{ForceSetPoint, SetPoint};
use nominal::{Axis, RigParameters};
use protocol::frames::{ForceChainState, Sensors};

const LOAD: &str = r#"title = "presses"
[algorithm]
name = "force-p"
[giving-way]
name = "force-manual"
gain_m_per_n_s = 0.05
limit_m_per_s = 0.3
moving = 1.0
"#;

fn program(text: &str) -> Program {
    let source = Source { path: "p.toml".into(), title: "t".into(), text: text.into() };
    source.program(Axis::Drive, &RigParameters::baseline(), false).unwrap()
}

fn demand() -> Demand {
    Demand { position: SetPoint::at_rest(0.2), force: ForceSetPoint::at_rest(0.0) }
}

/// What the program wants at a force of -100 N, 5 m/s by the gain alone, after the chain has decided so.
fn giving_way(program: &mut Program, cycle: u64, limit_m_per_s: Option<f64>) -> f64 {
    program.set_chain_output(&ForceOutput {
        state: ForceChainState::Standstill,
        limit_m_per_s,
        feed_forward: false,
        dead_zone: true,
        set_force_n: None,
        relieved: false,
        fault: None,
    });
    program.observe(cycle, &Sensors { force_n: -100.0, ..Sensors::default() }, 7e5);
    let _ = program.control(cycle, &demand(), ActiveAlgorithm::ForceChain).unwrap();
    program.wanted_m_per_s(ActiveAlgorithm::ForceChain)
}

#[test]
fn of_the_chains_limit_and_the_users_the_lower_one_holds() {
    let mut program = program(LOAD);
    for (cycle, (of_chain, holds)) in
        [(Some(0.02), 0.02), (None, 0.3), (Some(1.0), 0.3), (Some(0.1), 0.1), (None, 0.3)].iter().enumerate()
    {
        assert_eq!(giving_way(&mut program, cycle as u64, *of_chain), *holds, "{of_chain:?}");
    }
    let place = program.place("giving-way.limit_m_per_s").unwrap();
    program.set(place, 0.01).unwrap();
    assert_eq!(giving_way(&mut program, 9, Some(0.02)), 0.01, "the user's, changed while running");
}

#[test]
fn what_the_chain_decides_stays_out_of_the_users_variables() {
    let mut program = program(LOAD);
    let before = program.values().to_vec();
    let _ = giving_way(&mut program, 0, Some(0.02));
    let _ = giving_way(&mut program, 1, None);
    assert_eq!(program.values(), before);
    assert_eq!(program.values()[program.place("giving-way.limit_m_per_s").unwrap()], 0.3);
    // Moving, there would be no dead zone: -100 N * 0.001 m/(N s) instead of 95 N of it.
    for (name, number) in [("gain_m_per_n_s", 0.001), ("dead_zone_n", 5.0)] {
        let place = program.place(&format!("giving-way.{name}")).unwrap();
        program.set(place, number).unwrap();
    }
    assert!((giving_way(&mut program, 2, None) - 0.095).abs() < 1e-12, "the chain says that it stands");
}

const DRIVE: &str = r#"title = "position"
[algorithm]
name = "position-pid"
integral_zone_m = 0.5
integral_limit_m = 0.1
rest_zone_m = 0.0
"#;

/// One cycle at this place: filtered velocity and what is wanted.
fn at(program: &mut Program, cycle: u64, position_m: f64) -> (f64, f64) {
    let sensors = Sensors { position_m, force_n: 50.0, ..Sensors::default() };
    program.observe(cycle, &sensors, 7e5);
    let _ = program.control(cycle, &demand(), ActiveAlgorithm::User).unwrap();
    (program.input.velocity_m_per_s, program.wanted_m_per_s(ActiveAlgorithm::User))
}

#[test]
fn after_a_stall_filters_and_algorithm_begin_anew_without_a_kick() {
    let (mut stalled, mut fresh) = (program(DRIVE), program(DRIVE));
    for cycle in 0..100 {
        let _ = at(&mut stalled, cycle, 0.15);
    }
    // 30 mm in 500 ms: over the longest period that there was, 100 ms, 0.3 m/s.
    let (velocity, wanted) = at(&mut stalled, 599, 0.18);
    assert_eq!((velocity, wanted), at(&mut fresh, 0, 0.18));
    assert_eq!(velocity, 0.0);
    for cycle in 1..100 {
        assert_eq!(at(&mut stalled, 599 + cycle, 0.18), at(&mut fresh, cycle, 0.18), "and go on as ever");
    }
}

#[test]
fn a_few_cycles_that_are_missing_are_no_stall() {
    let mut program = program(DRIVE);
    for cycle in 0..500 {
        let _ = at(&mut program, cycle, 0.1 + 1e-4 * cycle as f64);
    }
    // 0.1 m/s before and over the gap of 50 ms.
    let (velocity, _) = at(&mut program, 549, 0.1 + 1e-4 * 549.0);
    assert!((velocity - 0.1).abs() < 1e-9, "{velocity}");
}
