//! The real records beside the project closed by the models that ship: figures of effects.md, names, held-out ratios;
//! skipped aloud where the records are not there.

use crate::real::{crate_folder, data};
use discrepancy::report::{Report, Verdict};
use discrepancy::single_equation::{close, extended_model_text};
use discrepancy::workflow::Reported;
use std::io::Write;
use std::path::{Path, PathBuf};

fn model(name: &str) -> PathBuf {
    crate_folder().join("models").join(name)
}

fn closed(model: &Path, train: &[PathBuf], tests: &[PathBuf]) -> Report {
    let tests: Vec<&Path> = tests.iter().map(PathBuf::as_path).collect();
    let closed = close(model, train, &tests, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(closed.not_judged, None);
    closed.report
}

/// The residuals of a model file as it is, its terms fitted: training and held out.
fn residuals(model: &Path, train: &[PathBuf], tests: &[PathBuf]) -> [f64; 2] {
    let report = closed(model, train, tests);
    let misfit = report.misfit.values().next().expect("a record was held out");
    let trained = report.summary.split("Residual of the training records ").nth(1).unwrap();
    [trained.split(' ').next().unwrap().parse().unwrap(), misfit.before]
}

/// A shipped model with a change, that searches for nothing.
fn changed(name: &str, change: impl Fn(String) -> String) -> tempfile::NamedTempFile {
    let text = std::fs::read_to_string(model(name)).unwrap();
    let mappings = crate_folder().join("mappings");
    let text = text.replace("../mappings", mappings.to_str().unwrap()).replace("most = 3", "most = 0");
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(change(text).as_bytes()).unwrap();
    file
}

/// Within 3 %, the figures of effects.md.
fn near(computed: [f64; 2], figures: [f64; 2]) {
    for (computed, figure) in computed.into_iter().zip(figures) {
        assert!((computed / figure - 1.0).abs() < 0.03, "{computed} is not {figure}");
    }
}

fn with_term(term: &'static str) -> impl Fn(String) -> String {
    move |text| format!("{text}\n[[terms]]\n{term}\n")
}

const ASYMMETRY: &str = "effect = \"friction-asymmetry\"\nform = \"viscous\"";

fn emps(folder: &Path) -> ([PathBuf; 1], [PathBuf; 1]) {
    ([folder.join("emps/emps_train.csv")], [folder.join("emps/emps_test_pulses.csv")])
}

fn cylinder(folder: &Path, seal: &str, bars: [u32; 2]) -> [PathBuf; 2] {
    bars.map(|bar| folder.join(format!("cylinder-friction/cyl25_friction_{seal}_{bar}bar.csv")))
}

#[test]
fn the_emps_figures_are_those_of_the_literature() {
    let Some(folder) = data("the_emps_figures_are_those_of_the_literature") else { return };
    let (train, test) = emps(&folder);
    near(residuals(changed("emps.toml", |text| text).path(), &train, &test), [2.33, 2.76]);
    let residuals_with = |terms: &'static str| {
        let file = changed("emps.toml", with_term(terms));
        residuals(file.path(), &train, &test)
    };
    near(residuals_with(ASYMMETRY), [1.91, 2.37]);
    let stribeck = "effect = \"stribeck-friction\"\nshape = { velocity_mm_per_s = 10.0, exponent = 1.0 }";
    near(residuals_with(stribeck), [2.32, 2.76]);
    let ripple = "effect = \"friction-asymmetry\"\nform = \"viscous\"\n[[terms]]\neffect = \"position-dependent-force\"\n\
                  form = \"ripple\"\nshape = { pitch_mm = 2.5 }";
    near(residuals_with(ripple), [1.88, 2.41]);
}

#[test]
fn emps_has_viscous_friction_that_differs_with_the_direction() {
    let Some(folder) = data("emps_has_viscous_friction_that_differs_with_the_direction") else { return };
    let (train, test) = emps(&folder);
    let report = closed(&model("emps.toml"), &train, &test);
    assert_eq!(report.verdict, Verdict::Named);
    assert_eq!(report.named.len(), 1, "{:#?}", report.named);
    assert_eq!(report.named[0].effect, "friction-asymmetry");
    let asymmetry = &report.named[0].parameters[0];
    assert!(
        (-25.0..-15.0).contains(&asymmetry.value) && asymmetry.name == "asymmetry_percent",
        "{asymmetry:?}"
    );
    let misfit = &report.misfit["drive_applied_force_N"];
    assert!(misfit.after <= 0.88 * misfit.before, "{misfit:?}");
    assert!(report.verification.as_ref().unwrap().confirmed);
    // By the training record alone: the same list without the held-out one.
    let alone = closed(&model("emps.toml"), &train, &[]);
    for name in ["stribeck-friction", "position-dependent-force", "position-dependent-friction"] {
        let fates = alone.candidates.iter().filter(|candidate| candidate.effect == name);
        assert!(fates.clone().count() > 0);
        assert!(fates.clone().all(|candidate| candidate.decision.starts_with("rejected: ")), "{name}");
    }
    let ripple = alone.candidates.iter().filter(|candidate| candidate.decision.contains("pitch_mm 2.5000"));
    assert!(ripple.clone().count() >= 2, "as a force, and as friction");
    let candidates = |report: &Report| serde_json::to_string(&report.candidates).unwrap();
    assert_eq!(candidates(&alone), candidates(&report));
    // The extended model lacks nothing.
    let extended = extended_model_text(&model("emps.toml"), &Reported::from(&report)).unwrap();
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(extended.as_bytes()).unwrap();
    let again = closed(file.path(), &train, &test);
    assert_eq!(again.verdict, Verdict::NothingMissing, "{extended}");
    let before = again.misfit["drive_applied_force_N"].before;
    assert!((before - misfit.after).abs() < 1e-6, "the term is in the model: {before}");
}

#[test]
fn an_o_ring_rubs_the_more_the_more_pressure_there_is() {
    let Some(folder) = data("an_o_ring_rubs_the_more_the_more_pressure_there_is") else { return };
    let [train, test] = [[1, 5], [3, 7]].map(|bars| cylinder(&folder, "O-ring257", bars));
    let alone = changed("cylinder-friction.toml", |text| format!("{text}\n[baseline]\nsliding = false\n"));
    near(residuals(alone.path(), &train, &test), [6.1, 6.8]);
    near(residuals(&model("cylinder-friction.toml"), &train, &test), [1.29, 1.47]);
    let report = closed(&model("cylinder-friction.toml"), &train, &test);
    assert_eq!((report.verdict, report.named.len()), (Verdict::Named, 1), "{:#?}", report.named);
    let friction = &report.named[0];
    assert_eq!(friction.effect, "pressure-dependent-friction");
    let misfit = &report.misfit["drive_force_N"];
    // 0.524 for the root; the straight line, which two levels of pressure cannot tell from it, has 0.603.
    assert!(misfit.after <= 0.60 * misfit.before, "{misfit:?}");
    let linear = &friction.alternatives[0];
    assert_eq!(
        (linear.effect.as_str(), linear.parameters[0].name.as_str()),
        (friction.effect.as_str(), "slope_n_per_bar")
    );
    assert!(report.next.as_ref().unwrap().otherwise.as_ref().unwrap().contains("three levels"));
    let residuals_with = |form: &'static str| {
        let file = changed("cylinder-friction.toml", with_term(form));
        residuals(file.path(), &train, &test)
    };
    near(residuals_with("effect = \"pressure-dependent-friction\"\nform = \"root\""), [0.49, 0.78]);
    near(residuals_with("effect = \"pressure-dependent-friction\"\nform = \"linear\""), [0.49, 0.90]);
}

#[test]
fn an_x_ring_does_too_but_at_seven_bar_it_rubs_more_than_any_law_of_the_others_says() {
    let Some(folder) =
        data("an_x_ring_does_too_but_at_seven_bar_it_rubs_more_than_any_law_of_the_others_says")
    else {
        return;
    };
    let train = cylinder(&folder, "X-ring257", [1, 5]);
    let misfit = |bar: u32| {
        let report = closed(
            &model("cylinder-friction.toml"),
            &train,
            &cylinder(&folder, "X-ring257", [bar, bar])[..1],
        );
        assert_eq!(report.named[0].effect, "pressure-dependent-friction");
        report.misfit["drive_force_N"].clone()
    };
    let (three, seven) = (misfit(3), misfit(7));
    // At 3 bar both models are right to a newton; at 7 bar the term takes a third, and leaves thirteen times what it left in
    // training.
    assert!(three.before < 1.0 && three.after < 1.0, "{three:?}");
    assert!(seven.after < 0.70 * seven.before && seven.after > 5.0, "{seven:?}");
}
