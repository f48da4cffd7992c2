//! Libraries that pass their trial and fail later: the guard latches and nothing of theirs leaves any more.

use crate::build::{Libraries, trier};
use algorithms::algorithm::AlgorithmInput;
use algorithms::guard::{AlgorithmFault, Guarded, LONGEST_ONCE};
use nominal::RigParameters;
use plugin::load_tried_by;
use realtime::MonotonicClock;

/// The library of `options` under the guard, after 999 good steps.
fn after_999_steps(libraries: &Libraries, options: &[&str], real_time: bool) -> Guarded {
    let mut all = vec!["-DSTEP_NUMBER=1000"];
    all.extend(options);
    let plugin = load_tried_by(&trier(), &libraries.hostile(&all), &RigParameters::baseline()).unwrap();
    let mut guarded =
        Guarded::new(Box::new(plugin), if real_time { Some(Box::new(MonotonicClock)) } else { None });
    guarded.reset(&AlgorithmInput::default(), &[1.0, 1.0]).unwrap();
    for _ in 1..1000 {
        assert_eq!(step(&mut guarded), Ok(0.1));
    }
    guarded
}

fn step(guarded: &mut Guarded) -> Result<f64, AlgorithmFault> {
    guarded.step(&AlgorithmInput::default(), &[1.0, 1.0])
}

#[test]
fn what_is_no_number_in_the_thousandth_step_latches_until_the_restart() {
    let libraries = Libraries::new();
    for bad in ["-DAT_STEP=return NAN;", "-DAT_STEP=return INFINITY;", "-DAT_STEP=return -INFINITY;"] {
        let mut guarded = after_999_steps(&libraries, &[bad], false);
        assert_eq!(step(&mut guarded), Err(AlgorithmFault::NotANumber));
        // The library would give good results again.
        assert_eq!(step(&mut guarded), Err(AlgorithmFault::NotANumber));
        guarded.restart();
        guarded.reset(&AlgorithmInput::default(), &[1.0, 1.0]).unwrap();
        assert_eq!(step(&mut guarded), Ok(0.1));
    }
}

#[test]
fn a_library_that_sleeps_past_its_cycle_latches_in_real_time() {
    let libraries = Libraries::new();
    let mut guarded = after_999_steps(&libraries, &["-DAT_STEP=usleep(50000);"], true);
    let Err(fault @ AlgorithmFault::TooSlow { took }) = step(&mut guarded) else { panic!("not latched") };
    assert!(took.as_millis() >= 50 && took > LONGEST_ONCE, "{took:?}");
    assert!(fault.to_string().contains("too slow"), "{fault}");
    assert_eq!(step(&mut guarded), Err(fault));
}

#[test]
fn without_real_time_a_library_that_sleeps_gives_the_same_results() {
    let libraries = Libraries::new();
    let mut guarded = after_999_steps(&libraries, &["-DAT_STEP=usleep(50000);"], false);
    assert_eq!(step(&mut guarded), Ok(0.1));
}
