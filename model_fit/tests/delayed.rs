//! A feedback that acts late, found with its delay.

use crate::closing::{closed, number, random};
use model_fit::{Search, Verdict};
use std::fmt::Write as _;

const PERIOD_S: f64 = 0.05;
const RATE: f64 = 0.6;
const FEEDBACK: f64 = 0.9;
const LATE_S: f64 = 0.83;

const MODEL: &str = "[inputs.u]\n[parameters.rate]\nunit = \"1/s\"\nvalue = 1\nrange = [0, 20]\n\
    [states.x]\nstart = \"y\"\nderivative = \"2[1/s]*u - rate*x\"\n[outputs.y]\nvalue = \"x\"\n\
    [[suspects]]\nname = \"late-feedback\"\nplace = \"x\"\nadd = \"-gain*delay(x, late)\"\n\
    parameters.gain = { unit = \"1/s\", value = 0.2, range = [0, 5] }\n\
    parameters.late = { unit = \"s\", value = [0.2, 2], range = [0, 5] }\n\
    [[suspects]]\nname = \"quadratic\"\nplace = \"x\"\nadd = \"-bent*x*abs(x)\"\n\
    parameters.bent = { unit = \"1/s\", value = 0.1, range = [-5, 5] }\n\
    [[suspects]]\nname = \"offset\"\nplace = \"x\"\nadd = \"shift\"\n\
    parameters.shift = { unit = \"1/s\", value = 0.1, range = [-5, 5] }\n";

/// x' = 2 u - RATE x - FEEDBACK x(t - LATE) from 0, by 50 steps of Heun in a sample with straight lines between them.
fn record(mut seed: u64) -> String {
    const STEPS: usize = 50;
    let step_s = PERIOD_S / STEPS as f64;
    let mut random = || random(&mut seed);
    let mut x = vec![0.0_f64];
    let mut text = "t_s,u,y\n".to_owned();
    let mut u = 0.0;
    for row in 0..500 {
        if row % 20 == 0 {
            u = 4.0 * random();
        }
        let noise: f64 = 0.02 * (0..12).map(|_| random()).sum::<f64>();
        let _ = writeln!(text, "{},{u},{}", f64::from(row) * PERIOD_S, x[x.len() - 1] + noise);
        for _ in 0..STEPS {
            let (head, at) = (x[x.len() - 1], (x.len() - 1) as f64 - LATE_S / step_s);
            let late = |place: f64| {
                let before = place.max(0.0).floor();
                let [from, to] = [before, before + 1.0].map(|index| x[(index as usize).min(x.len() - 1)]);
                from + (place.max(0.0) - before) * (to - from)
            };
            let rate = |now: f64, then: f64| 2.0 * u - RATE * now - FEEDBACK * then;
            let first = rate(head, late(at));
            let second = rate(head + step_s * first, late(at + 1.0));
            x.push(head + 0.5 * step_s * (first + second));
        }
    }
    text
}

#[test]
fn a_late_feedback_is_found_with_its_delay() {
    let folder = tempfile::tempdir().unwrap();
    let search = Search::MoreThanNoise;
    let report = closed(folder.path(), ("model.toml", MODEL), [1, 2].map(record), search).report;
    assert_eq!((report.verdict, report.confirmed), (Verdict::Named, Some(true)), "{}", report.headline);
    assert_eq!(report.named[0].suspect, "late-feedback", "{}", report.headline);
    for (name, expected) in [("rate", RATE), ("gain", FEEDBACK), ("late", LATE_S)] {
        let number = number(&report, name);
        let error = number.standard_error.unwrap_or_else(|| panic!("{number:?}"));
        assert!((number.value - expected).abs() < 2.0 * error, "{number:?} for {expected}");
        // Half of the distance to the values from which the fit starts, at most.
        assert!(error < 0.3 * expected, "{number:?}");
    }
}
