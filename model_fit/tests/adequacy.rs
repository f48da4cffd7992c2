//! Whether a report says that a residual is more than noise.

use crate::closing::{close, file, random};
use model_fit::{ClosedModel, Verdict};

const LINE: &str = r#"
[inputs.u]
unit = "V"
[parameters]
gain = { unit = "mm/V", value = 1 }
[outputs.y]
unit = "mm"
value = "gain*u"
"#;

const OFFSET: &str = r#"
[[suspects]]
name = "offset"
place = "y"
add = "o"
parameters.o = { unit = "mm", value = 0.1 }
"#;

/// 600 rows of 3 mm/V, a noise of 0.1 mm, and something more.
fn closed(model: &str, more: impl Fn(f64) -> f64) -> ClosedModel {
    let mut state = 1_u64;
    let mut random = || random(&mut state);
    let mut text = "t_s,u,y\n".to_owned();
    for row in 0..600 {
        let [t, u] = [f64::from(row) * 0.1, f64::from(row / 7 % 5) - 2.0];
        // A uniform distribution of standard deviation 0.1.
        text += &format!("{t},{u},{}\n", 3.0 * u + 0.346 * random() + more(t));
    }
    let folder = tempfile::tempdir().unwrap();
    let [model, record] =
        [("model.toml", model), ("record.csv", &text)].map(|(name, text)| file(folder.path(), name, text));
    close(&model, &[record], &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn slow(t: f64) -> f64 {
    0.5 * (0.7 * t).sin()
}

#[test]
fn a_residual_that_is_no_noise_and_no_suspect_is_not_called_nothing_missing() {
    let found = closed(&format!("{LINE}{OFFSET}"), slow);
    let report = &found.report;
    assert_eq!((report.verdict, report.adequate), (Verdict::OutsideCatalogue, false), "{}", report.headline);
    let headline = &report.headline;
    assert!(headline.starts_with("None of the suspects explains what is left: y 0.3"), "{headline}");
    let residual = &report.residuals[0];
    // The sine has an rms of 0.35, and moves by 0.025 rms from row to row.
    assert!((residual.rms - 0.37).abs() < 0.03 && (residual.noise - 0.1).abs() < 0.02, "{residual:?}");
    assert!(!residual.is_noise_declared && residual.signal_rms > 3.0, "{residual:?}");
    assert!(found.is_unexplained() && found.page.contains("more than noise"));
}

#[test]
fn noise_alone_is_noise_with_and_without_suspects() {
    for model in [LINE.to_owned(), format!("{LINE}{OFFSET}")] {
        let found = closed(&model, |_| 0.0);
        let report = &found.report;
        assert_eq!((report.verdict, report.adequate), (Verdict::NothingMissing, true), "{report:#?}");
        assert!(!found.is_unexplained() && report.residuals[0].is_noise);
    }
}

#[test]
fn a_model_without_suspects_says_too_that_more_than_noise_is_left() {
    let report = closed(LINE, slow).report;
    assert!(report.headline.contains("what is left is more than noise: y"), "{}", report.headline);
}

#[test]
fn a_declared_error_or_noise_is_allowed_for_and_no_more() {
    let with = |key: &str| closed(&LINE.replace("[outputs.y]", &format!("[outputs.y]\n{key}")), slow).report;
    assert!(with("model_error = 0.4").adequate && with("noise = 0.4").adequate);
    assert!(!with("model_error = 0.05").adequate && !with("noise = 0.1").adequate);
}

#[test]
fn more_beside_what_is_named_is_said_in_the_headline() {
    let report = closed(&format!("{LINE}{OFFSET}"), |t| 1.0 + slow(t)).report;
    assert_eq!((report.verdict, report.adequate), (Verdict::Named, false), "{report:#?}");
    let headline = &report.headline;
    assert!(headline.starts_with("offset is missing; more is missing beside: y"), "{headline}");
}
