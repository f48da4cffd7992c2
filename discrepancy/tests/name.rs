//! Claims about naming, on records that the plant makes here with something hidden in it.

use crate::record::{both_gridded, gridded, gridded_briefly, hiding};
use discrepancy::candidates::Candidate;
use discrepancy::engine::Engine;
use discrepancy::name::{SelectionResult, is_large, name, weigh_by_marginal_likelihood};
use discrepancy::parameters::{COUNT, with_factors};
use discrepancy::report::ExplanationKind;
use plant::RigParameters;

fn found(hidden: &RigParameters, without: &[&str]) -> SelectionResult {
    found_beside(&RigParameters::baseline(), hidden, without)
}

fn found_beside(rig: &RigParameters, hidden: &RigParameters, without: &[&str]) -> SelectionResult {
    let records = [gridded_briefly(hidden, &RigParameters::baseline())];
    let engine = Engine::new(&records, rig);
    let without: Vec<String> = without.iter().map(|name| (*name).to_owned()).collect();
    let mut found = name(&engine, Candidate::all(rig, [true, false], false, &without), &mut |_| ());
    weigh_by_marginal_likelihood(&engine, &mut found);
    found
}

fn names(found: &SelectionResult) -> Vec<String> {
    found.model.effects.iter().map(|effect| effect.candidate.name()).collect()
}

/// The explanation that is most probable by the marginal likelihoods, which sum to one.
fn most_probable_by_marginal(found: &SelectionResult) -> usize {
    let all: Vec<f64> = found
        .explanations
        .iter()
        .map(|one| one.marginal.expect("of rods that are not linked").probability)
        .collect();
    assert!((all.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{all:?}");
    (0..all.len()).max_by(|one, other| all[*one].total_cmp(&all[*other])).expect("one at least")
}

/// Factors of the parameters with their errors.
fn factors(found: &SelectionResult) -> Vec<(f64, f64)> {
    let errors = &found.model.errors[found.model.errors.len() - COUNT..];
    found.model.factors.iter().copied().zip(errors.iter().copied()).collect()
}

#[test]
fn rigs_side_by_side_show_what_each_shows_alone() {
    let records = [gridded(&RigParameters::baseline(), &RigParameters::baseline())];
    let engine = Engine::new(&records, &RigParameters::baseline());
    let off = |at: usize| {
        let mut factors = [1.0; COUNT];
        factors[at] = 1.01;
        with_factors(&RigParameters::baseline(), &factors)
    };
    // More than have room in one group, and one that does not run in lanes.
    let mut rigs: Vec<RigParameters> = (0..COUNT).map(off).collect();
    rigs[3] = hiding(&[("inclination", "drive", &[("force_n", 20.0)])]);
    let windows = &engine.windows[0];
    let together = windows.simulate_side_by_side(&rigs);
    for (rig, batched) in rigs.iter().zip(&together) {
        let alone = windows.simulate_coarsely(rig);
        assert!(alone.iter().map(|value| value.to_bits()).eq(batched.iter().map(|value| value.to_bits())));
    }
    assert!((1..rigs.len()).all(|at| together[at] != together[0]), "each moves something");
}

#[test]
fn where_nothing_is_hidden_nothing_is_named_and_no_parameter_is_off() {
    let found = found(&RigParameters::baseline(), &[]);
    assert_eq!(names(&found), Vec::<String>::new());
    assert_eq!(found.not_explained, None);
    assert!(found.significance.is_none(), "nothing was to be named: {:?}", found.significance);
    let kinds: Vec<ExplanationKind> = found.explanations.iter().map(|explanation| explanation.kind).collect();
    assert_eq!(kinds, [ExplanationKind::Null, ExplanationKind::Parameters, ExplanationKind::NoneOfThese]);
    assert_eq!(most_probable_by_marginal(&found), 0);
    let nothing = found.explanations[0].features.expect("of the rig file");
    assert!(nothing.loss_per_dof.abs() < 0.08 && nothing.parameters_moved == 0.0, "{nothing:?}");
    for (at, (factor, error)) in factors(&found).into_iter().enumerate() {
        assert!((factor - 1.0).abs() < 5.0 * error + 0.003, "parameter {at}: {factor} +- {error}");
    }
    let moved = found.reported.factors.iter().filter(|factor| **factor != 1.0).count();
    assert!(moved <= 2, "what is reported moves parameters that nobody misses: {:?}", found.reported.factors);

    // A limit is what its name says: half as much again is named, be it noise that set the limit or the least that counts.
    for (effect, place, key) in
        [("rod-leakage", "drive.b", "leakage_nl_per_min"), ("inclination", "drive", "force_n")]
    {
        let amount = 1.5 * limit(&found, &format!("{effect} {place}"));
        let found = self::found(&hiding(&[(effect, place, &[(key, amount)])]), &[]);
        assert_eq!(names(&found), [format!("{effect} {place}")], "{amount}");
    }
}

#[test]
fn parameters_that_absorb_a_missing_law_disagree_between_windows_and_one_that_is_off_does_not() {
    let baseline = RigParameters::baseline();
    let alone = |rig: &RigParameters| {
        let records = [gridded_briefly(rig, &baseline)];
        name(&Engine::new(&records, &baseline), Vec::new(), &mut |_| ())
    };
    let absorbing = alone(&hiding(&[("friction-asymmetry", "drive", &[("asymmetry_percent", 30.0)])]));
    let moved = absorbing.reported.factors.iter().zip(absorbing.parameter_tau);
    let disagree =
        moved.filter(|(factor, tau)| **factor != 1.0 && *tau > 0.3 * (**factor - 1.0).abs()).count();
    let mut factors = [1.0; COUNT];
    factors[0] = 1.03;
    let off = alone(&with_factors(&baseline, &factors));
    assert!(disagree > 0, "{:?} {:?}", absorbing.reported.factors, absorbing.parameter_tau);
    assert!((off.reported.factors[0] - 1.03).abs() < 0.01, "{:?}", off.reported.factors);
    assert_eq!(off.parameter_tau, [0.0; COUNT]);
}

/// Amplitude from which on a candidate would have been named.
fn limit(found: &SelectionResult, name: &str) -> f64 {
    let at = found.columns.candidates.iter().position(|known| known.name() == name).expect("a candidate");
    let candidate = &found.columns.candidates[at];
    let mut coordinates = candidate.origin();
    coordinates[0] = found.limits[at].expect("it is excited");
    candidate.effect_parameters(&coordinates)[0]
}

#[test]
fn a_hidden_leak_is_named_with_its_place_and_its_amount() {
    let found = found(&hiding(&[("rod-leakage", "drive.b", &[("leakage_nl_per_min", 4.0)])]), &[]);
    assert_eq!(names(&found), ["rod-leakage drive.b"]);
    let effect = &found.model.effects[0];
    let leakage = effect.candidate.effect_parameters(&effect.coordinates)[0];
    let error = found.model.errors[0] * effect.candidate.slope(0, effect.coordinates[0]).abs();
    assert!((leakage - 4.0).abs() < 4.0 * error + 0.05, "{leakage} +- {error}");
    assert!(found.shares[0] > 0.9, "{:?}", found.shares);
    let tests = found.significance.as_ref().expect("it was to be named");
    let chance = tests.chance.as_ref().expect("the rods are not linked");
    assert!(tests.rejection_reason().is_none() && chance.draws == 5 && chance.p_value < 0.005, "{tests:?}");
    let explanation = &found.explanations[2];
    assert_eq!(explanation.sets[0][0].candidate.name(), "rod-leakage drive.b");
    assert_eq!(most_probable_by_marginal(&found), 2);
    let features = explanation.features.expect("of the leak");
    assert!(features.loss_difference == 0.0 && features.amplitude_variation < Some(0.1), "{features:?}");
    for other in &found.explanations[..2] {
        assert!(other.features.expect("of another explanation").loss_difference > 100.0, "{other:?}");
    }
}

#[test]
fn two_hidden_effects_are_both_named() {
    let hidden = hiding(&[
        ("inclination", "drive", &[("force_n", 12.0)]),
        ("valve-dead-zone", "drive", &[("dead_zone_percent", 2.0)]),
    ]);
    let mut named = names(&found(&hidden, &[]));
    named.sort();
    assert_eq!(named, ["inclination drive", "valve-dead-zone drive"]);
}

#[test]
fn what_is_missing_is_named_beside_what_is_too_small_for_a_name() {
    let hidden = hiding(&[
        ("heat-exchange", "drive", &[("coefficient_w_per_m2_k", 385.0)]),
        ("piston-leakage", "drive", &[("leakage_nl_per_min", 3.2)]),
    ]);
    let found = found(&hidden, &[]);
    let (large, small): (Vec<_>, Vec<_>) = found.reported.effects.iter().partition(|effect| is_large(effect));
    let [large, small] =
        [large, small].map(|all| all.iter().map(|effect| effect.candidate.name()).collect::<Vec<_>>());
    assert_eq!(large, ["piston-leakage drive"]);
    assert_eq!(small, ["heat-exchange drive"]);
    assert_eq!(found.not_explained, None);
}

#[test]
fn an_effect_that_the_rig_file_has_is_named_where_it_is_off_and_only_there() {
    let leaking =
        |nl_per_min: f64| hiding(&[("piston-leakage", "drive", &[("leakage_nl_per_min", nl_per_min)])]);
    let rig = leaking(3.0);
    assert_eq!(names(&found_beside(&rig, &rig, &[])), Vec::<String>::new());
    for truth in [0.0, 6.0] {
        let found = found_beside(&rig, &leaking(truth), &[]);
        assert_eq!(names(&found), ["piston-leakage drive"], "{truth}");
        let effect = &found.reported.effects[0];
        let reported = effect.candidate.effect_parameters(&effect.coordinates)[0];
        assert!((reported - truth).abs() < 0.3, "{reported}, in truth {truth}");
        assert_eq!(effect.candidate.baseline(0), Some(3.0));
    }
}

#[test]
fn a_wrong_mass_is_a_parameter_and_no_effect() {
    let rig = RigParameters::baseline();
    let heavier = rig.with("mass.drive_kg", &[5.5]).and_then(|rig| rig.with("mass.carriage_kg", &[3.85]));
    let found = found(&heavier.expect("a heavier rig"), &[]);
    assert_eq!(names(&found), Vec::<String>::new());
    let (mass, error) = factors(&found)[0];
    assert!((mass - 1.1).abs() < 4.0 * error + 0.005, "{mass} +- {error}");
    // What is reported is a fit of its own: the mass is as right without the parameters that went back to what the file says.
    let reported = found.reported.factors;
    assert!((reported[0] - 1.1).abs() < 4.0 * error + 0.005, "{reported:?}");
    assert!(reported.iter().filter(|factor| **factor == 1.0).count() >= COUNT / 2, "{reported:?}");
    assert!(found.reported.loss < found.model.loss + 20.0 * COUNT as f64);
}

#[test]
fn what_is_no_candidate_is_outside_the_catalogue() {
    let hidden = hiding(&[("position-dependent-force", "drive", &[("spring_n", 30.0)])]);
    let found = found(&hidden, &["position-dependent-force"]);
    assert!(found.not_explained.is_some(), "named {:?}", names(&found));
}

/// Each axis has its own weights: with one for both, what is missing on the load took nine tenths of the drive's.
#[test]
fn what_is_missing_on_the_other_axis_hides_no_effect() {
    let hidden = hiding(&[
        ("valve-dead-zone", "drive", &[("dead_zone_percent", 1.0)]),
        ("heat-exchange", "load", &[("coefficient_w_per_m2_k", 60.0)]),
    ]);
    let records = [both_gridded(&hidden, &RigParameters::baseline())];
    assert!(records[0].measured == [true, true] && !records[0].linked);
    let engine = Engine::new(&records, &RigParameters::baseline());
    let without = ["heat-exchange".to_owned()];
    let candidates = Candidate::all(&RigParameters::baseline(), [true, true], false, &without);
    let found = name(&engine, candidates, &mut |_| ());
    assert_eq!(found.not_explained, None);
    assert_eq!(names(&found)[0], "valve-dead-zone drive");
    let explanation = found.explanations.iter().find(|one| one.kind == ExplanationKind::Effects);
    let features = explanation.and_then(|one| one.features).expect("of the dead zone");
    assert!(found.lacks_fit && features.loss_per_dof < 0.1 && features.share > 0.9, "{features:?}");
}

#[test]
fn a_smaller_dead_volume_is_no_larger_machine() {
    // All else larger by as much as the volume is smaller shows the same: only the priors of masses and areas differ.
    let found = found(&hiding(&[("dead-volume", "drive", &[("volume_cm3", 16.4)])]), &[]);
    assert_eq!(names(&found), ["dead-volume drive"]);
    for (at, (factor, _)) in factors(&found).into_iter().enumerate() {
        assert!((factor - 1.0).abs() < 0.05, "parameter {at}: {factor}");
    }
}

/// A suspect of the library that ships and one of a user's own, beside a friction along the stroke that is hidden.
#[test]
fn a_law_of_a_library_is_screened_beside_a_rig_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("suspects.toml").display().to_string();
    std::fs::write(
        folder.path().join("seals.toml"),
        "about = \"seals\"\nunit = \"N\"\n[variables]\nv = { unit = \"m/s\", about = \"speed\" }\n\
         p = { unit = \"Pa\", about = \"gauge pressure\" }\n\
         [[suspects]]\nname = \"lip\"\nabout = \"pressed on\"\nadd = \"growth*sign(v)*max(p, 0)\"\n\
         parameters.growth = { unit = \"N/bar\", dimension = \"place/p\", value = 2, range = [0, 100] }\n",
    )
    .unwrap();
    let text = "[[suspects]]\nuse = \"friction/position-dependent\"\nplace = \"drive.force\"\ntimes = \"-1\"\n\
                parameters.slope = { range = [0, 500], prior = 100 }\n\
                [[suspects]]\nuse = \"seals.toml/lip\"\nplace = \"drive.force\"\ntimes = \"-1\"\nwith.p = \"p_b - 1[bar]\"\n";
    let suspects = discrepancy::suspects::read(text, &file).unwrap_or_else(|error| panic!("{error}"));
    let expressions: Vec<&str> = suspects.iter().map(|one| one.declared.add.as_str()).collect();
    assert_eq!(expressions, ["(-1)*(slope*x*(sign(v)))", "(-1)*(growth*sign(v)*max((p_b - 1[bar]), 0))"]);
    let rig = RigParameters::baseline();
    let hidden = rig.with_term(&suspects[0].declared.with(&[120.0]).unwrap());
    let records = [gridded_briefly(&hidden, &rig)];
    let engine = Engine::new(&records, &rig);
    let found = name(&engine, Candidate::of_suspects(&rig, [true, false], &suspects), &mut |_| ());
    assert_eq!(names(&found), ["position-dependent drive"]);
    let effect = &found.model.effects[0];
    let slope = effect.candidate.effect_parameters(&effect.coordinates)[0];
    let error = found.model.errors[0] * effect.candidate.slope(0, effect.coordinates[0]).abs();
    assert!((slope - 120.0).abs() < 4.0 * error + 1.0, "{slope} +- {error}");
    // What keeps values, or is no term that is added, is not for a rig.
    for used in ["friction/presliding", "friction/stick-slip", "sensor/gain", "stiffness/play"] {
        let text = text.replacen("friction/position-dependent", used, 1);
        let message = discrepancy::suspects::read(&text, &file).unwrap_err().to_string();
        let expected = format!("suspects.toml:2:8: use: {used}: the rig takes terms that are added");
        assert!(message.contains(&expected), "{message}");
    }
}
