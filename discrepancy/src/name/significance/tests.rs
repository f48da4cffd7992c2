//! The tests of a name on records that the plant makes here.

use super::*;
use crate::calibrate::calibrate;
use crate::candidates::Candidate;
use crate::gridded_record::GriddedRecord;
use crate::refit::refit;
use crate::verify::tests::record_over;
use plant::RigParameters;

const PERIODS: usize = 6000;

fn synthetic_record(rig: &RigParameters, seed: u64) -> [GriddedRecord; 1] {
    [record_over(PERIODS, rig, &RigParameters::baseline(), seed)]
}

fn inclined() -> RigParameters {
    RigParameters::baseline().with_effect("inclination", "drive", &[("force_n", 30.0)]).unwrap()
}

/// An engine of a record with what a test needs of it.
struct Case<'a> {
    engine: Engine<'a>,
    linearisation: Linearisation,
    columns: Columns,
    calibrated: FittedModel,
}

impl<'a> Case<'a> {
    fn new(records: &'a [GriddedRecord]) -> Self {
        let baseline = RigParameters::baseline();
        let engine = Engine::new(records, &baseline);
        let linearisation = Linearisation::at_baseline(&engine);
        let columns = Columns::new(&engine, Candidate::all(&baseline, [true, false], false, &[]));
        let calibrated = calibrate(&engine, &linearisation);
        Case { engine, linearisation, columns, calibrated }
    }

    /// The best candidate of the screening, or the one of a name, refitted.
    fn fitted(&self, name: Option<&str>) -> FittedModel {
        let residual = self.engine.residual(&self.engine.simulate(&self.engine.rig));
        let (_, mut screened) = self.columns.screen(&self.engine, &self.linearisation, &residual, &[]);
        screened.sort_by(|left, right| left.loss.total_cmp(&right.loss));
        let is_it = |name: &str, start: &EffectEstimate| start.candidate.sheet.name == name;
        let best = screened.into_iter().find(|one| name.is_none_or(|name| is_it(name, &one.start))).unwrap();
        refit(&self.engine, &self.linearisation, &[best.start]).unwrap()
    }

    fn significance(&self, model: &FittedModel, explanations: &[Explanation]) -> Significance {
        let Case { engine, linearisation, columns, calibrated } = self;
        let fitted = Fitted { engine, linearisation, columns, calibrated, explanations, threshold: 0.0 };
        fitted.significance(model).unwrap()
    }
}

#[test]
fn a_gain_of_three_windows_is_none_without_them() {
    let dof = [10.0; 40];
    let (mut without, with) = ([10.0; 40], [10.0; 40]);
    without[..3].fill(1e3);
    let gains = window_gains(&dof, &without, &with);
    assert!(gains.iter().sum::<f64>() > 100.0 && without_best(&gains) == 0.0, "{gains:?}");
    without[3..8].fill(1e2);
    let gain = without_best(&window_gains(&dof, &without, &with));
    assert!((gain - 50.0 * 10.0_f64.ln()).abs() < 1e-9, "{gain}");
}

#[test]
fn a_fifth_of_the_windows_at_most_is_left_out() {
    assert_eq!([4, 5, 10, 14, 15, 200].map(best_windows), [0, 1, 2, 2, 3, 3]);
    assert_eq!(without_best(&[7.0, 2.0, 1.0]), 10.0);
}

#[test]
fn what_best_fits_noise_is_not_significant_and_neither_is_a_gain_of_the_best_windows() {
    let records = synthetic_record(&RigParameters::baseline(), 5);
    let case = Case::new(&records);
    let mut model = case.fitted(None);
    let tests = case.significance(&model, &[]);
    let chance = tests.chance.as_ref().expect("the rods are not linked");
    assert!(tests.rejection_reason().is_some() && !chance.significant && chance.draws >= 2, "{tests:?}");
    assert!(chance.reached >= 2 && chance.ended == StoppingReason::Reached, "{tests:?}");

    model.squares.clone_from(&case.calibrated.squares);
    let left_out = best_windows(model.squares.len());
    assert!(left_out > 0);
    model.squares[..left_out].iter_mut().for_each(|square| *square *= 0.5);
    let tests = case.significance(&model, &[]);
    assert!(tests.gain > MIN_GAIN && tests.gain_without_best < 0.0, "{tests:?}");
    assert_eq!(tests.rejection_reason(), Some("gains too little outside its best windows"));
    model.squares.iter_mut().for_each(|square| *square *= 0.9);
    assert_eq!(case.significance(&model, &[]).rejection_reason(), None);
}

#[test]
fn a_strong_effect_is_significant_after_five_draws_with_any_number_of_threads() {
    let records = synthetic_record(&inclined(), 5);
    let case = Case::new(&records);
    let [model, other] = ["inclination", "dead-volume"].map(|name| case.fitted(Some(name)));
    let explanations = [&model, &other].map(|fit| Explanation {
        kind: ExplanationKind::Effects,
        sets: vec![fit.effects.clone()],
        features: None,
        fit: Some(fit.clone()),
        probability: 0.5,
        marginal: None,
    });
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| case.significance(&model, &explanations))
    };
    let tests = of(1);
    assert_eq!(format!("{tests:?}"), format!("{:?}", of(3)));
    let [chance, other] = [&tests.chance, &tests.other].map(|drawn| drawn.as_ref().expect("both were drawn"));
    assert_eq!(tests.rejection_reason(), None, "{tests:?}");
    for drawn in [chance, other] {
        assert!(
            drawn.ended == StoppingReason::FarAbove && drawn.draws == 5 && drawn.p_value < 0.005,
            "{tests:?}"
        );
    }
    assert_eq!(other.effects[0].effect, "dead-volume");
    // The other way round the records look as if drawn with what was tested.
    let turned = case.significance(explanations[1].fit.as_ref().unwrap(), &explanations);
    assert!(!turned.other.is_some_and(|drawn| drawn.significant));
}
