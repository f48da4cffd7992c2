//! The plant with smooth effects against equations written anew and solved by others.
//!
//! The bound is the baseline's of rig-model.md, Accuracy: a fifth of the sensors' noise, as rms over a window of 100 to 200
//! ms with equal start, of what is true and of what is shown. The differences are far below
//! (`plant/docs/effects-accuracy.md`), so a tenth of that is asked, and that each effect shows a hundred times as much as is
//! left of it.

mod independent;

use independent::{
    EXTENDING, MOTIONS, PUSHING, RETRACTING, SWEEP, Window, all_smooth, alone, is_smooth, motion_of,
};
use plant::effects::SHEETS;

/// Largest rms of a window, in units of noise.
const AGREED: f64 = 0.02;

/// Substeps of the plant's own period.
const SUBSTEPS: u32 = 10;

#[test]
fn all_smooth_effects_at_once_agree_with_an_independent_solver() {
    for motion in &MOTIONS {
        let difference = Window::new(all_smooth(motion), motion).difference(SUBSTEPS);
        assert!(difference.worst() <= AGREED, "{}: {difference:?}", motion.name);
        // The spool has an exact solution: what the solver's tolerance leaves.
        assert!(difference.spool <= 1e-9, "{}: {difference:?}", motion.name);
    }
}

#[test]
fn each_smooth_effect_alone_agrees_with_an_independent_solver() {
    for sheet in SHEETS.iter().filter(|sheet| is_smooth(sheet)) {
        let motion = motion_of(sheet);
        let difference = Window::new(alone(sheet), &motion).difference(SUBSTEPS);
        assert!(difference.worst() <= AGREED, "{}, {}: {difference:?}", sheet.name, motion.name);
    }
}

#[test]
fn what_an_effect_shows_is_far_above_what_is_left_of_it() {
    for sheet in SHEETS.iter().filter(|sheet| is_smooth(sheet)) {
        let window = Window::new(alone(sheet), &motion_of(sheet));
        let (change, difference) = (window.change(), window.difference(SUBSTEPS));
        let ratio = change.worst_shown() / difference.worst_shown();
        assert!(ratio >= 100.0, "{}: {change:?} against {difference:?}", sheet.name);
    }
}

#[test]
fn halving_the_step_divides_the_difference_by_about_four() {
    // Second order, with all effects on; a shorter step soon meets the solver's own tolerance, a longer one higher orders.
    for motion in [EXTENDING, RETRACTING, SWEEP, PUSHING] {
        let window = Window::new(all_smooth(&motion), &motion);
        let ratio = window.difference(SUBSTEPS).worst() / window.difference(2 * SUBSTEPS).worst();
        assert!((3.0..5.0).contains(&ratio), "{}: {ratio}", motion.name);
    }
}

#[test]
fn all_effects_but_these_are_smooth() {
    let others: Vec<&str> = SHEETS.iter().filter(|sheet| !is_smooth(sheet)).map(|sheet| sheet.name).collect();
    assert_eq!(others, ["spool-rate-limit", "line-delay", "rest-time-dependent-break-away"]);
}
