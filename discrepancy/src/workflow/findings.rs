//! Report of the naming: verdict, effects with numbers, candidates, detection limits, summary.

use crate::calibrate::quantity;
use crate::engine::Engine;
use crate::name::{SelectionResult, is_large, is_same_effect, share_removed, significantly_off};
use crate::parameters::COUNT;
use crate::refit::{EffectEstimate, FittedModel};
use crate::report::{
    self, DetectionLimit, NamedEffect, Quantity, Report, SCHEMA_VERSION, Verdict, effect_place, place_of,
    strongest,
};

pub(super) fn report_of(engine: &Engine<'_>, found: &SelectionResult) -> Report {
    let (mut named, mut small) = effects(found);
    let (mut parameters, mut insignificant) = parameters(engine, found);
    let verdict = if found.not_explained.is_some() {
        Verdict::OutsideCatalogue
    } else if named.iter().any(|named| !named.alternatives.is_empty()) {
        Verdict::Ambiguous
    } else if !named.is_empty() {
        Verdict::Named
    } else if !parameters.is_empty() {
        Verdict::ParametersOnly
    } else {
        Verdict::NothingMissing
    };
    let nearest = if verdict == Verdict::OutsideCatalogue {
        std::mem::take(&mut named)
            .into_iter()
            .next()
            .map(|nearest| NamedEffect { alternatives: Vec::new(), ..nearest })
    } else {
        None
    };
    if verdict == Verdict::OutsideCatalogue {
        small.clear();
        // A fit without what is missing moves parameters that the file has right: none is called off.
        insignificant.splice(..0, parameters.drain(..));
    }
    let (not_excited, detection_limits) = limits(found);
    Report {
        named,
        small,
        adequate: Some(!found.lacks_fit && found.not_explained.is_none()),
        fit: Some(found.reported.convergence),
        nearest,
        parameters,
        insignificant,
        candidates: candidates(found),
        explanations: explanations(found),
        significance: found.significance.clone(),
        not_excited,
        detection_limits,
        ..empty(verdict, String::new())
    }
}

/// The effects of the model: those that are named, and smaller ones.
fn effects(found: &SelectionResult) -> (Vec<NamedEffect>, Vec<NamedEffect>) {
    let mut at = 0;
    let (mut named, mut small) = (Vec::new(), Vec::new());
    // What is not explained has no names, and the nearest effect.
    let model = if found.not_explained.is_some() { &found.model } else { &found.reported };
    let all = model.effects.iter().zip(&found.shares).zip(&found.alternatives);
    for (index, ((effect, share), alternatives)) in all.enumerate() {
        let disagreement = found.heterogeneity.get(index);
        let within = &model.errors[at..at + effect.coordinates.len()];
        let errors: Vec<f64> = match disagreement {
            Some(windows) => within.iter().zip(&windows.tau).map(|(one, other)| one.hypot(*other)).collect(),
            None => within.to_vec(),
        };
        at += effect.coordinates.len();
        let alternatives = alternatives
            .iter()
            .filter_map(|other| {
                let effect = other.fit.effects.last()?;
                let from = other.fit.errors.len() - COUNT - effect.coordinates.len();
                Some(named_effect(effect, &other.fit.errors[from..], other.share, Vec::new()))
            })
            .collect();
        let amplitude_variation = disagreement.filter(|_| found.lacks_fit).map(|windows| windows.variation);
        let reported =
            NamedEffect { amplitude_variation, ..named_effect(effect, &errors, *share, alternatives) };
        if found.not_explained.is_some() || found.is_named[index] {
            named.push(reported)
        } else {
            small.push(reported)
        }
    }
    for all in [&mut named, &mut small] {
        all.sort_by(|left, right| right.share_explained.total_cmp(&left.share_explained));
    }
    (named, small)
}

fn named_effect(
    effect: &EffectEstimate,
    errors: &[f64],
    share: f64,
    alternatives: Vec<NamedEffect>,
) -> NamedEffect {
    let candidate = &effect.candidate;
    let numbers = candidate.effect_parameters(&effect.coordinates);
    let parameters = candidate
        .sheet
        .keys
        .iter()
        .enumerate()
        .map(|(at, key)| Quantity {
            name: key.name.to_owned(),
            value: numbers[at],
            unit: key.unit.name().to_owned(),
            standard_error: Some(candidate.standard_error(at, effect.coordinates[at], errors[at]))
                .filter(|error| error.is_finite()),
            before: candidate.baseline(at),
        })
        .collect();
    NamedEffect {
        effect: candidate.sheet.name.to_owned(),
        place: place_of(candidate.place),
        parameters,
        share_explained: share,
        amplitude_variation: None,
        alternatives,
    }
}

/// Parameters that are significantly off, and those that the model moved by less.
fn parameters(engine: &Engine<'_>, found: &SelectionResult) -> (Vec<Quantity>, Vec<Quantity>) {
    let model = found.reported.widened(&found.parameter_tau);
    let is_off = significantly_off(engine, &model);
    let (significant, insignificant): (Vec<usize>, Vec<usize>) =
        (0..COUNT).filter(|at| model.factors[*at] != 1.0).partition(|at| is_off[*at]);
    let quantities = |all: Vec<usize>| all.into_iter().map(|at| quantity(engine, at, &model)).collect();
    (quantities(significant), quantities(insignificant))
}

fn candidates(found: &SelectionResult) -> Vec<report::Candidate> {
    let calibrated_loss = found.calibrated_loss;
    let objection = found.significance.as_ref().and_then(|tests| Some((tests, tests.rejection_reason()?)));
    found
        .screened
        .iter()
        .map(|screened| {
            let effect = &screened.start;
            let candidate = &effect.candidate;
            let is_it = |other: &EffectEstimate| is_same_effect(other, effect);
            let is_last = |fit: &&FittedModel| fit.effects.last().is_some_and(is_it);
            let alone = found.fitted.iter().filter(|fit| fit.effects.len() == 1).find(is_last);
            let of_model = found.model.effects.iter().position(is_it);
            let is_alike = found.alternatives.iter().flatten().any(|alternative| is_last(&&alternative.fit));
            let shown = alone.map_or(effect, |fit| &fit.effects[0]);
            let share = alone.map(|fit| share_removed(found.calibrated.loss, fit.loss));
            let decision = if let Some(reason) = of_model.and(found.not_explained) {
                reason.reason()
            } else if let Some(at) = of_model {
                if found.is_named[at] { "named" } else { "part of the model, and too small to be named" }
            } else if let Some((_, objection)) =
                objection.filter(|(tests, _)| tests.effects.contains(&effect_place(effect)))
            {
                objection
            } else if is_alike && found.not_explained.is_none() {
                "explains as much as what is named"
            } else if alone.is_some_and(|fit| !is_large(&fit.effects[0])) {
                "fitted, and below the smallest amplitude that is named"
            } else if alone.is_some() {
                "fitted, and others explain more"
            } else if found.fitted.iter().any(|fit| is_last(&fit)) {
                "fitted beside what was named first, and others explain more"
            } else {
                "not among the best of the screening"
            };
            report::Candidate {
                effect: candidate.sheet.name.to_owned(),
                place: place_of(candidate.place),
                score: (calibrated_loss - screened.loss) / found.threshold.max(1e-9),
                share_explained: share,
                fit: alone.map(|fit| fit.convergence),
                amplitude: candidate.effect_parameters(&shown.coordinates)[0],
                unit: candidate.sheet.keys[0].unit.name().to_owned(),
                decision: decision.to_owned(),
            }
        })
        .collect()
}

pub(super) fn explanations(found: &SelectionResult) -> Vec<report::Explanation> {
    let all = found.explanations.iter().map(|explanation| report::Explanation {
        kind: explanation.kind,
        probability: explanation.probability,
        sets: explanation.sets.iter().map(|set| set.iter().map(effect_place).collect()).collect(),
        evidence: explanation.features,
        marginal: explanation.marginal,
    });
    all.collect()
}

/// Candidates that the records do not excite, and the detection limits of the others.
fn limits(found: &SelectionResult) -> (Vec<report::EffectPlace>, Vec<DetectionLimit>) {
    let mut not_excited = Vec::new();
    let mut limits = Vec::new();
    for (candidate, limit) in found.columns.candidates.iter().zip(&found.limits) {
        let place = place_of(candidate.place);
        let effect = candidate.sheet.name.to_owned();
        match limit {
            Some(z) if *z <= 1.0 => {
                let key = &candidate.sheet.keys[0];
                let at = candidate.effect_parameters(&{
                    let mut coordinates = candidate.origin();
                    coordinates[0] = *z;
                    coordinates
                })[0];
                limits.push(DetectionLimit {
                    effect,
                    place,
                    name: key.name.to_owned(),
                    value: candidate.baseline(0).map_or(at, |from| (at - from).abs()),
                    unit: key.unit.name().to_owned(),
                });
            }
            _ => not_excited.push(report::EffectPlace { effect, place }),
        }
    }
    (not_excited, limits)
}

pub(crate) fn empty(verdict: Verdict, summary: String) -> Report {
    Report { schema_version: SCHEMA_VERSION, verdict, summary, ..Report::default() }
}

/// The verdict in a sentence or two.
pub(super) fn summary(report: &Report) -> String {
    let not_named = report.significance.as_ref().filter(|_| report.nearest.is_none());
    let not_named =
        not_named.and_then(|tests| Some(format!(" {} {}.", tests.tested(), tests.rejection_reason()?)));
    let improbable = report.named_explanation().zip(report.more_probable()).map(|(named, other)| {
        let [named, other] = [named, other].map(|one| 1e2 * one.probability);
        format!(" Its probability is {named:.0} %; another explanation has {other:.0} %.")
    });
    verdict_in_words(report) + &not_named.unwrap_or_default() + &improbable.unwrap_or_default()
}

fn verdict_in_words(report: &Report) -> String {
    let one = |effect: &NamedEffect| format!("{} ({})", effect.effect, effect.place);
    let parameters =
        report.parameters.iter().map(|parameter| parameter.name.as_str()).collect::<Vec<_>>().join(", ");
    let off =
        if parameters.is_empty() { String::new() } else { format!(" Off in the rig file: {parameters}.") };
    let small = match &report.small[..] {
        [] => String::new(),
        all => format!(" Smaller: {}.", all.iter().map(one).collect::<Vec<_>>().join(", ")),
    };
    let remaining = report.remaining.as_ref().map_or(String::new(), |remaining| {
        format!(" {} depends on {}.", remaining.balance, remaining.strongest())
    });
    let more = match report.adequate {
        Some(false) if remaining.is_empty() => " More is missing.".to_owned(),
        Some(false) => format!(" More is missing:{remaining}"),
        _ => String::new(),
    };
    match report.verdict {
        _ if report.is_rig_file_enough() => {
            "Nothing is missing above the detection limits of these records.".to_owned()
        }
        Verdict::NothingMissing | Verdict::ParametersOnly => {
            let size = if small.is_empty() { "" } else { " that is large enough to be named" };
            format!("No effect is missing{size}.{small}{off}")
        }
        Verdict::Named => {
            let named = report.named.iter().map(one).collect::<Vec<_>>().join(" and ");
            format!("Missing: {named}.{small}{off}{more}")
        }
        Verdict::Ambiguous => {
            let quantities = report.named.iter().map(|named| {
                std::iter::once(named).chain(&named.alternatives).map(one).collect::<Vec<_>>().join(" or ")
            });
            format!(
                "Missing, and not to be told apart by these records: {}.{small}{off}{more}",
                quantities.collect::<Vec<_>>().join("; and ")
            )
        }
        Verdict::OutsideCatalogue => {
            let nearest = report.nearest.as_ref().map_or(String::new(), |nearest| {
                let decision = report
                    .candidates
                    .iter()
                    .find(|candidate| candidate.effect == nearest.effect && candidate.place == nearest.place)
                    .map_or("", |candidate| candidate.decision.as_str());
                let rest =
                    if remaining.is_empty() { ".".to_owned() } else { format!("; of the rest,{remaining}") };
                format!(
                    " It resembles {}, whose law takes {:.0} % of the log misfit and {decision}{rest}",
                    one(nearest),
                    1e2 * nearest.share_explained
                )
            });
            match &report.outside {
                Some(outside) => format!(
                    "Not in the catalogue: something in {} that depends on {}.{nearest}{off}",
                    outside.balance,
                    strongest(outside.variables.first().map(|dependence| dependence.variable.as_str()))
                ),
                None => format!("Something is missing that the catalogue does not explain.{nearest}{off}"),
            }
        }
        Verdict::BadData => report.summary.clone(),
    }
}
