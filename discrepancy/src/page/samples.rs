//! Made-up reports, one for each verdict, as like real ones as made-up ones can be.

use super::{Pictures, Trace};
use crate::report::*;
use plant::effects::SHEETS;
use std::collections::BTreeMap;

pub(super) const VERDICTS: [Verdict; 6] = [
    Verdict::NothingMissing,
    Verdict::ParametersOnly,
    Verdict::Named,
    Verdict::Ambiguous,
    Verdict::OutsideCatalogue,
    Verdict::BadData,
];

pub(super) fn at(axis: &str, element: Option<&str>) -> RigPlace {
    RigPlace { axis: axis.to_owned(), element: element.map(str::to_owned) }
}

fn quantity(name: &str, value: f64, standard_error: f64, unit: &str, before: Option<f64>) -> Quantity {
    let standard_error = Some(standard_error);
    Quantity { name: name.to_owned(), value, unit: unit.to_owned(), standard_error, before }
}

fn named(effect: &str, place: RigPlace, parameters: Vec<Quantity>, share_explained: f64) -> NamedEffect {
    NamedEffect {
        effect: effect.to_owned(),
        place,
        parameters,
        share_explained,
        amplitude_variation: None,
        alternatives: Vec::new(),
    }
}

/// Numbers that look like noise and are the same in each run.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (state >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }
}

/// A stroke of 0.3 m and its pressures; `size` scales the disagreement.
pub(super) fn pictures(size: f64) -> Pictures {
    let trace = |signal: &str, unit: &str, scale: f64, offset: f64, noise_value: f64, over: f64| {
        let mut random = noise(signal.len() as u64);
        let time_s: Vec<f64> = (0..20_000).map(|ms| f64::from(ms) * 1e-3).collect();
        let shape =
            |t: f64| offset + scale * ((0.9 * t).sin() + 0.3 * (3.1 * t + 0.4 * (0.7 * t).sin()).sin());
        let misfit =
            |t: f64| size * over * noise_value * (0.9 * t).cos().powi(3) * (1.0 + 0.5 * (0.23 * t).sin());
        let truth: Vec<f64> = time_s.iter().map(|t| shape(*t)).collect();
        let measured: Vec<f64> = truth.iter().map(|value| value + noise_value * random()).collect();
        let before: Vec<f64> = time_s.iter().zip(&truth).map(|(t, value)| value - misfit(*t)).collect();
        let after: Vec<f64> = time_s.iter().zip(&truth).map(|(t, value)| value - 0.03 * misfit(*t)).collect();
        let minus = |model: &[f64]| measured.iter().zip(model).map(|(one, other)| one - other).collect();
        Trace {
            signal: signal.to_owned(),
            unit: unit.to_owned(),
            before_residual: minus(&before),
            after_residual: minus(&after),
            time_s,
            measured,
            before,
            after,
            noise: noise_value,
        }
    };
    Pictures {
        record: "test.csv".to_owned(),
        held_out: true,
        traces: vec![
            trace("drive_position_m", "m", 0.12, 0.25, 21e-6, 9.0),
            trace("drive_force_N", "N", 60.0, 0.0, 0.5, 4.0),
            trace("drive_pressure_a_Pa", "Pa", 0.8e5, 4.1e5, 404.0, 33.0),
            trace("drive_pressure_b_Pa", "Pa", 0.9e5, 4.4e5, 404.0, 28.0),
        ],
    }
}

fn misfit() -> BTreeMap<String, SignalMisfit> {
    [
        ("drive_force_N", 2.1, 0.53, 0.5, Some(0.993)),
        ("drive_position_m", 1.9e-4, 2.4e-5, 2.1e-5, Some(0.996)),
        ("drive_pressure_a_Pa", 9.1e3, 2.6e3, 404.0, Some(0.920)),
        ("drive_pressure_b_Pa", 404.5, 404.4, 404.0, None),
    ]
    .map(|(signal, before, after, floor, closed)| {
        (signal.to_owned(), SignalMisfit { before, after, floor, closed })
    })
    .into_iter()
    .collect()
}

fn verification() -> Verification {
    let both = |before, after| BeforeAfter { before, after };
    let of = |pair: BeforeAfter| [("drive_position_m".to_owned(), pair)].into_iter().collect();
    Verification {
        record: "test.csv".to_owned(),
        chi2_before: 57.3,
        chi2_after: 1.04,
        chi2_null: [0.93, 1.09],
        free_run_nrmse_percent: of(both(2.31, 0.21)),
        whiteness: of(both(0.97, 0.05)),
        physical: Vec::new(),
        confirmed: true,
        worse: false,
        adequate: true,
        more_missing: false,
    }
}

fn curve(variable: &str, variable_unit: &str, unit: &str, term: impl Fn(f64) -> f64, reach: f64) -> Curve {
    let at: Vec<f64> = (0..=40).map(|i| reach * (f64::from(i) / 20.0 - 1.0)).collect();
    let value: Vec<f64> = at.iter().map(|x| term(*x)).collect();
    let largest = value.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let band = at.iter().map(|x| largest * (0.04 + 0.15 * (x / reach).powi(4))).collect();
    let [variable, variable_unit, unit] = [variable, variable_unit, unit].map(str::to_owned);
    Curve { variable, variable_unit, unit, at, value, band }
}

fn term(balance: &str, variable: &str) -> LocatedTerm {
    let variable = LocatedVariable { variable: variable.to_owned(), log_evidence: Some(214.0), share: 0.71 };
    LocatedTerm { balance: balance.to_owned(), variables: vec![variable] }
}

fn location(size: f64) -> Location {
    let balances =
        [("drive.flow-a", 31.0), ("drive.flow-b", 24.0), ("drive.force", 1.2), ("drive.force-sensor", 0.98)];
    let regimes = [
        ("hold", 0.9, 140),
        ("onset", 0.3, 36),
        ("motion-out", 0.12, 61),
        ("motion-in", 0.1, 58),
        ("valve-edge", 0.4, 22),
    ];
    let over = |size_of: f64, share: f64| 1.0 + size * (size_of - 1.0) * share;
    let time_s: Vec<f64> = (0..2000).map(|i| f64::from(i) * 1e-2).collect();
    Location {
        dependence: Some(term("drive.flow-a", "p_a")),
        sensor_ratio: Some("drive.force is 1.96e-3 m^2 times an offset of pressure sensor a".into()),
        balances: balances
            .map(|(balance, value)| BalanceBar {
                balance: balance.to_owned(),
                birge_ratio: over(value, 1.0),
                rms: 0.08 * over(value, 1.0),
                unit: if balance.contains("flow") { "Nl/min" } else { "N" }.to_owned(),
            })
            .to_vec(),
        regimes: balances
            .iter()
            .flat_map(|(balance, value)| {
                regimes.map(|(regime, share, windows)| RegimeCell {
                    balance: (*balance).to_owned(),
                    regime: regime.to_owned(),
                    windows: if regime == "onset" && balance.contains("sensor") { 0 } else { windows },
                    birge_ratio: over(*value, share),
                })
            })
            .collect(),
        maps: vec![curve("p_a-p_b", "Pa", "Nl/min", |x| size * 2.5e-5 * x, 3e5)],
        series: vec![UnknownInput {
            balance: "drive.flow-a".to_owned(),
            unit: "Nl/min".to_owned(),
            value: time_s.iter().map(|t| size * 2.0 * (0.9 * t).cos()).collect(),
            time_s,
            noise: 0.12,
        }],
    }
}

fn candidates(size: f64) -> Vec<Candidate> {
    SHEETS
        .iter()
        .enumerate()
        .map(|(at_place, sheet)| {
            let place = place_of(sheet.place.places()[0]);
            Candidate {
                effect: sheet.name.to_owned(),
                place,
                score: size * 240.0 / (1.0 + 1.6 * at_place as f64) + 0.4,
                share_explained: (at_place < 4).then(|| 0.97 / (1.0 + at_place as f64)),
                fit: None,
                amplitude: sheet.keys[0].drawn[0],
                unit: sheet.keys[0].unit.name().to_owned(),
                decision: if at_place == 0 { "named" } else { "explained by the first" }.to_owned(),
            }
        })
        .collect()
}

fn check(file: &str) -> RecordCheck {
    let channel = |noise, quantum| ChannelCheck { noise: Some(noise), quantum: Some(quantum), unusable: 0.0 };
    RecordCheck {
        file: file.to_owned(),
        usable: true,
        rows: 20_000,
        length_s: 19.999,
        findings: Vec::new(),
        channels: [
            ("drive_position_m", channel(2.1e-5, 7.6e-6)),
            ("drive_force_N", channel(0.5, 0.061)),
            ("drive_pressure_a_Pa", channel(404.0, 61.0)),
            ("drive_pressure_b_Pa", ChannelCheck { noise: None, quantum: None, unusable: 0.012 }),
        ]
        .map(|(column, check)| (column.to_owned(), check))
        .into_iter()
        .collect(),
    }
}

fn explanations() -> Vec<Explanation> {
    let effect = |name: &str| EffectPlace { effect: name.to_owned(), place: at("drive", None) };
    let evidence = |loss_per_dof, loss_difference, amplitude_variation| Features {
        loss_per_dof,
        loss_difference,
        parameters_moved: 0.4,
        amplitude_variation,
        smallest_amplitude: amplitude_variation.map(|_| 5.0),
        small_beside: 0,
        share: 0.968,
    };
    let of = |kind, probability, sets, evidence| {
        let marginal = Marginal {
            log_likelihood: 10.0 * probability,
            probability,
            probability_range: [0.9 * probability, probability],
            by_quadrature: false,
        };
        Explanation { kind, probability, sets, evidence, marginal: Some(marginal) }
    };
    let leakages = ["piston-leakage", "valve-null-leakage"];
    vec![
        of(ExplanationKind::Null, 0.0, Vec::new(), Some(evidence(3.1, 4200.0, None))),
        of(ExplanationKind::Parameters, 0.0, Vec::new(), Some(evidence(1.2, 1600.0, None))),
        of(
            ExplanationKind::Effects,
            0.97,
            leakages.map(|name| vec![effect(name)]).to_vec(),
            Some(evidence(-0.01, 0.0, Some(0.02))),
        ),
        of(ExplanationKind::NoneOfThese, 0.03, Vec::new(), None),
    ]
}

fn significance() -> Significance {
    let effect = |name: &str| vec![EffectPlace { effect: name.to_owned(), place: at("drive", None) }];
    let drawn = |effects, observed, reached, largest, p_value| DrawnRecords {
        effects,
        observed,
        draws: 5,
        reached,
        largest,
        p_value,
        ended: StoppingReason::FarAbove,
        significant: true,
    };
    Significance {
        effects: effect("piston-leakage"),
        gain: 1612.0,
        best_windows: 3,
        gain_without_best: 1480.0,
        least_gain: 0.0,
        chance: Some(drawn(Vec::new(), 1480.0, 0, -2.6, 2e-7)),
        other: Some(drawn(effect("inclination"), 300.0, 0, -41.0, 0.0021)),
    }
}

pub(super) fn sample(verdict: Verdict) -> (Report, Pictures) {
    let size = if verdict == Verdict::NothingMissing { 0.02 } else { 1.0 };
    let mut pictures = pictures(size);
    let mut report = Report {
        inputs: InputFiles {
            rig: "rig.toml".to_owned(),
            train: vec!["train.csv".to_owned(), "more <&>.csv".to_owned()],
            axes: vec!["drive".into()],
            searched_share: 1.0,
        },
        misfit: misfit(),
        adequate: Some(verdict != Verdict::OutsideCatalogue),
        verification: Some(verification()),
        candidates: candidates(size),
        explanations: explanations(),
        not_excited: vec![
            EffectPlace { effect: "silencer-back-pressure".to_owned(), place: at("drive", None) },
            EffectPlace { effect: "supply-droop".to_owned(), place: at("supply", None) },
        ],
        detection_limits: SHEETS
            .iter()
            .take(30)
            .map(|sheet| DetectionLimit {
                effect: sheet.name.to_owned(),
                place: place_of(sheet.place.places()[0]),
                name: sheet.keys[0].name.to_owned(),
                value: 0.1 * sheet.keys[0].drawn[0],
                unit: sheet.keys[0].unit.name().to_owned(),
            })
            .collect(),
        location: Some(location(size)),
        checks: vec![check("train.csv"), check("more <&>.csv")],
        ..crate::workflow::empty(verdict, String::new())
    };
    let leakage = || {
        let value = quantity("leakage_nl_per_min", 2.513_17, 0.0412, "Nl/min", None);
        named("piston-leakage", at("drive", None), vec![value], 0.968)
    };
    match verdict {
        Verdict::NothingMissing => {
            report.summary = "Nothing is missing above the detection limits of these records.".to_owned();
            pictures.traces.iter_mut().for_each(|trace| {
                trace.after.clear();
                trace.after_residual.clear();
            });
        }
        Verdict::ParametersOnly => {
            report.summary =
                "No effect is missing; the moving mass is 5 % larger than the rig file says.".to_owned();
            report.parameters = vec![quantity("parameter:mass", 5.2631, 0.041, "kg", Some(5.0))];
        }
        Verdict::Named => {
            report.summary = "Air leaks past the drive's piston: 2.51 Nl/min from 6 to 1 bar.".to_owned();
            report.named = vec![leakage()];
            report.significance = Some(significance());
            let offset = vec![quantity("offset_percent", 0.21, 0.02, "%", None)];
            let offset = named("valve-offset", at("load", None), offset, 0.012);
            report.small = vec![NamedEffect { amplitude_variation: Some(0.04), ..offset }];
        }
        Verdict::Ambiguous => {
            report.summary =
                "A constant force acts on the drive, or its friction differs with the direction.".to_owned();
            let force = vec![quantity("force_n", 12.37, 0.31, "N", None)];
            let mut first = named("inclination", at("drive", None), force, 0.941);
            let asymmetry = vec![quantity("asymmetry_percent", 47.1, 1.2, "%", None)];
            first.alternatives = vec![named("friction-asymmetry", at("drive", None), asymmetry, 0.938)];
            report.named = vec![first];
            report.next = Some(NextExperiment {
                reason:
                    "While the piston slides, both are a constant force; only break-away and speed differ."
                        .to_owned(),
                experiment: Some("next.toml".to_owned()),
                divergence: Some(63.0),
                probability: Some(0.95),
                probability_interval: Some([0.76, 0.99]),
                rehearsals: Some(20),
                then: None,
                otherwise: Some("Tilting the rig would tell at once.".to_owned()),
            });
        }
        Verdict::OutsideCatalogue => {
            report.summary =
                "A force on the drive that depends on the position is missing, and no effect has its shape."
                    .to_owned();
            let dependence =
                |variable: &str, r2, p_value| Dependence { variable: variable.to_owned(), r2, p_value };
            report.nearest = Some(NamedEffect { share_explained: 0.6, ..leakage() });
            report.remaining = Some(term("drive.flow-b", "p_b"));
            report.outside = Some(UncataloguedTerm {
                balance: "drive.force".to_owned(),
                variables: vec![dependence("x", 0.913, 1.0 / 201.0), dependence("p_a-p_b", 0.08, 0.21)],
                curve: Some(curve("x", "m", "N", |x| 14.0 * (9.0 * x).sin() + 20.0 * x * x, 0.25)),
                surface: Some(Surface {
                    variables: ["x", "sign(v)"].map(str::to_owned),
                    variable_units: ["m", ""].map(str::to_owned),
                    unit: "N".to_owned(),
                    at: [vec![0.1, 0.2, 0.4], vec![-1.0, 1.0]],
                    value: vec![vec![Some(-4.0), None, Some(2.0)], vec![Some(3.0), Some(5.0), Some(-1.0)]],
                    band: vec![vec![Some(0.5), None, Some(0.4)], vec![Some(0.5), Some(0.3), Some(0.4)]],
                }),
                formula: Some("14 sin(9 x) + 20 x^2".to_owned()),
                added: true,
                why_not: None,
                tables: vec![TableTerm {
                    balance: "drive.force".to_owned(),
                    variable: "x".to_owned(),
                    variable_unit: "m".to_owned(),
                    unit: "N".to_owned(),
                    at: vec![0.0, 0.2, 0.4],
                    value: vec![0.0, 14.4, -3.0],
                }],
                share_explained: Some(0.83),
            });
        }
        Verdict::BadData => {
            report.summary = "train.csv: pressure b does not change after line 4711.".to_owned();
            let finding = |kind: &str, column: Option<&str>, line, fatal, text: &str| Finding {
                kind: kind.to_owned(),
                column: column.map(str::to_owned),
                line,
                fatal,
                text: text.to_owned(),
            };
            report.checks[0].usable = false;
            report.checks[0].findings = vec![
                finding(
                    "gap",
                    None,
                    Some(812),
                    false,
                    "50 ms are missing after line 812: windows there are left out",
                ),
                finding(
                    "stuck",
                    Some("drive_pressure_b_Pa"),
                    Some(4711),
                    true,
                    "the value 349386.6 stands from line 4711 to the end: look at the sensor's cable, and record again",
                ),
            ];
            report.candidates.clear();
            report.explanations.clear();
            report.location = None;
            report.adequate = None;
            report.misfit.clear();
            report.verification = None;
            report.detection_limits.clear();
            report.not_excited.clear();
            pictures = Pictures::default();
        }
    }
    (report, pictures)
}
