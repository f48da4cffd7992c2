//! Suspects that pay together where neither does alone, and fits that need several starting points to find what a suspect does.

use crate::closing::{self, named, number, random};
use model_fit::{ModelReport, Search, Verdict};
use std::fmt::Write as _;

fn closed(model: &str, record: impl Fn(u64) -> String) -> ModelReport {
    let folder = tempfile::tempdir().unwrap();
    let search = Search::MoreThanNoise;
    closing::closed(folder.path(), ("model.toml", model), [1, 2].map(record), search).report
}

/// What is missing is a small h. One suspect is a large w with h on it, the other w alone: of h + w the first explains the
/// hundredth that h is of its power, the second nothing, and both together all of it.
#[test]
fn two_suspects_that_explain_nothing_alone_are_named_together() {
    let model = "[inputs.u]\n[inputs.w]\n[inputs.h]\n[parameters]\np = { value = 1 }\n[outputs.y]\nvalue = \"p*u\"\n\
                 [[suspects]]\nname = \"both\"\nplace = \"y\"\nadd = \"a*(w + h)\"\n\
                 parameters.a = { value = 0.1, range = [-10, 10] }\n\
                 [[suspects]]\nname = \"large\"\nplace = \"y\"\nadd = \"b*w\"\n\
                 parameters.b = { value = 0.1, range = [-10, 10] }\n\
                 [[suspects]]\nname = \"square\"\nplace = \"y\"\nadd = \"c*u^2\"\n\
                 parameters.c = { value = 0.1, range = [-10, 10] }\n";
    let record = |mut seed: u64| {
        let mut text = "t_s,u,w,h,y\n".to_owned();
        for row in 0..400 {
            let [u, w, h, noise] = [1.0, 10.0, 1.0, 0.2].map(|size| size * random(&mut seed));
            let _ = writeln!(text, "{row},{u},{w},{h},{}", 2.0 * u + 3.0 * h + noise);
        }
        text
    };
    let report = closed(model, record);
    assert_eq!((report.verdict, report.confirmed), (Verdict::Named, Some(true)), "{}", report.headline);
    let mut names = named(&report);
    names.sort_unstable();
    assert_eq!(names, ["both", "large"], "{}", report.headline);
    assert!(report.notes.iter().any(|note| note.ends_with("were found together: neither passes alone")));
    for (name, expected) in [("a", 3.0), ("b", -3.0)] {
        let number = number(&report, name);
        assert!((number.value - expected).abs() < 0.1, "{number:?}");
    }
}

/// A bump over 7, fitted from 1: beside 7 it explains nothing, and the slope says nothing of where it is.
#[test]
fn a_suspect_is_found_far_from_its_first_value() {
    let model = "[inputs.u]\n[parameters]\np = { value = 1 }\n[outputs.y]\nvalue = \"p*u\"\n\
                 [[suspects]]\nname = \"bump\"\nplace = \"y\"\nadd = \"a*exp(-((u - c)/0.2)^2)\"\n\
                 parameters.a = { value = 0.1, range = [-10, 10] }\nparameters.c = { value = 1, range = [0, 10] }\n";
    let record = |mut seed: u64| {
        let mut text = "t_s,u,y\n".to_owned();
        for row in 0..600 {
            let (u, noise) = (5.0 + 10.0 * random(&mut seed), 0.2 * random(&mut seed));
            let _ = writeln!(
                text,
                "{row},{u},{}",
                2.0 * u + 2.0 * (-((u - 7.0) / 0.2_f64).powi(2)).exp() + noise
            );
        }
        text
    };
    let report = closed(model, record);
    assert_eq!(report.named.len(), 1, "{}", report.headline);
    let place = number(&report, "c");
    assert!((place.value - 7.0).abs() < 0.05, "{place:?}");
}

/// What a gain and a start do the other undoes along a valley that bends: a wider range may not end elsewhere in it.
#[test]
fn a_wider_range_does_not_leave_more() {
    let record = |mut seed: u64| {
        let (mut text, mut upper, mut lower) = ("t_s,u,y\n".to_owned(), 4.0_f64, 3.0_f64);
        for row in 0..300 {
            let u = 3.0 + f64::from((row / 25 * 7) % 5);
            let _ = writeln!(text, "{},{u},{}", 4 * row, lower + 0.02 * random(&mut seed));
            for _ in 0..40 {
                let flow = 0.05 * upper.max(0.0).sqrt();
                upper += 0.1 * (0.03 * u - flow);
                lower += 0.1 * (flow - 0.05 * lower.max(0.0).sqrt());
            }
        }
        text
    };
    let left = |range: &str| {
        let model = format!(
            "held_out.start_samples = 30\n[inputs.u]\n[parameters]\n\
             gain = {{ unit = \"1/s\", value = 0.02, range = {range} }}\n\
             one = {{ unit = \"1/s\", value = 0.03, range = {range} }}\n\
             two = {{ unit = \"1/s\", value = 0.03, range = {range} }}\n\
             [states.upper]\nstart = \"fitted\"\nguess = 5\nrange = [0, 50]\nderivative = \"gain*u - one*sqrt(max(upper, 0))\"\n\
             [states.lower]\nstart = \"fitted\"\nguess = 5\nrange = [0, 50]\n\
             derivative = \"one*sqrt(max(upper, 0)) - two*sqrt(max(lower, 0))\"\n[outputs.y]\nvalue = \"lower\"\n"
        );
        closed(&model, record).training[0].rms_before
    };
    // The noise of 0.02 from end to end is 0.0058 rms.
    let [narrow, wide] = ["[0.01, 0.1]", "[0, 100]"].map(left);
    assert!(narrow < 0.0065 && wide < 1.01 * narrow, "{narrow} and {wide}");
}
