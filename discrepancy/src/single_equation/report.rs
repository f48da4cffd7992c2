//! The report of a balance: selected and rejected terms, and the held-out record.
//!
//! The noise of the sensors is not known for a foreign record, so that `gap.floor` is 0 and `closed` a lower bound. For the
//! same reason `chi2` counts in the power that the extended model leaves on the training records, and its range is that of their
//! folds.

use super::fit::{clustered_t, rms};
use super::model::{Kind, TermEntry};
use super::runs::Run;
use super::select::{CandidateEvaluation, Taken, describe};
use super::terms::{self, shape_unit, shown};
use super::{Fitted, Study};
use crate::report::{
    BeforeAfter, Candidate, Curve, DetectionLimit, EffectPlace, InputFiles, Location, Misfit, NamedEffect,
    Next, Outside, Quantity, Report, Verdict, Verification, Where,
};
use crate::verify::{WORSE, leaves_more};
use crate::workflow::empty;
use std::collections::BTreeMap;
use std::path::Path;

/// Bins of the residual over speed.
const BINS: usize = 20;

fn drive() -> Where {
    Where { axis: "drive".into(), element: None }
}

/// An effect of a balance, without alternatives.
fn named_effect(effect: &str, parameters: Vec<Quantity>, share_explained: f64) -> NamedEffect {
    let (effect, place) = (effect.to_owned(), place(effect));
    NamedEffect {
        effect,
        place,
        parameters,
        share_explained,
        amplitude_variation: None,
        alternatives: Vec::new(),
    }
}

/// Where an effect of a balance is: a chamber's is chamber a's.
fn place(effect: &str) -> Where {
    let element = ["rod-leakage", "pressure-sensor-offset"].contains(&effect).then(|| "a".to_owned());
    let element = if effect == "position-sensor-offset" { Some("position".into()) } else { element };
    Where { element, ..drive() }
}

impl Study {
    pub(super) fn report(&self, model_file: &Path) -> Report {
        let named: Vec<NamedEffect> = self.named();
        let parameters = self.parameters();
        let other =
            |effect: &NamedEffect| effect.alternatives.iter().any(|twin| twin.effect != effect.effect);
        let checks = self.checks();
        if let Some(fatal) = checks.iter().flat_map(|check| &check.findings).find(|finding| finding.fatal) {
            let summary = format!("{}: a record cannot be used: {}", self.model.name, fatal.text);
            return Report { inputs: self.inputs(model_file), checks, ..empty(Verdict::BadData, summary) };
        }
        let verdict = match () {
            () if self.found.decoy.is_some() => Verdict::OutsideCatalogue,
            () if named.iter().any(other) => Verdict::Ambiguous,
            () if !named.is_empty() => Verdict::Named,
            () if !parameters.is_empty() => Verdict::ParametersOnly,
            () => Verdict::NothingMissing,
        };
        let [before, after] = self.trained_rms();
        let unit = self.unit();
        let names: Vec<&str> = named.iter().map(|effect| effect.effect.as_str()).collect();
        let found = match verdict {
            Verdict::NothingMissing => "No term of the catalogue passes on the training records.".to_owned(),
            Verdict::OutsideCatalogue => {
                "A term that is in no catalogue does better than every effect.".to_owned()
            }
            Verdict::ParametersOnly => "Numbers of the model are off.".to_owned(),
            _ => format!("{} {} missing.", names.join(" and "), if names.len() == 1 { "is" } else { "are" }),
        };
        let summary = format!(
            "{}: {found} Residual of the training records {before:.4} {unit} rms, {after:.4} {unit} after; baseline: {}.",
            self.model.name,
            self.baseline_numbers()
        );
        let next = self.next(&named);
        Report {
            inputs: self.inputs(model_file),
            named,
            parameters,
            outside: self.outside(),
            candidates: self.candidates(),
            not_excited: self.not_excited(),
            detection_limits: self.detection_limits(),
            location: Some(Location { maps: self.map().into_iter().collect(), ..Location::default() }),
            checks,
            next,
            ..empty(verdict, summary)
        }
    }

    fn inputs(&self, model_file: &Path) -> InputFiles {
        InputFiles {
            rig: model_file.display().to_string(),
            train: self.runs.iter().map(|run| run.name.clone()).collect(),
            ..InputFiles::default()
        }
    }

    fn unit(&self) -> &'static str {
        if self.model.kind == Kind::Chamber { "m^3/s" } else { "N" }
    }

    fn balance_name(&self) -> &'static str {
        if self.model.kind == Kind::Chamber { "drive.flow-a" } else { "drive.force" }
    }

    /// The baseline's numbers beside the selected terms, in words.
    fn baseline_numbers(&self) -> String {
        let columns = terms::baseline(&self.model);
        let each = columns.iter().zip(&self.extended_fit.numbers);
        let each: Vec<String> = each
            .map(|(column, number)| match column.name {
                // Newton per pascal is square metres; people know square millimetres.
                "area" => format!("area {:.2} mm2", number * 1e6),
                name => format!("{name} {number:.3} {}", column.unit),
            })
            .collect();
        if each.is_empty() { "the rig file's".into() } else { each.join(", ") }
    }

    /// Numbers of a term that stands at `first` among the columns of a fit.
    fn quantities(&self, entry: &TermEntry, first: usize, numbers: &[f64], errors: &[f64]) -> Vec<Quantity> {
        let (name, unit, factor) = shown(entry);
        let quantity = |name: &str, unit: &str, value: f64, standard_error: Option<f64>| Quantity {
            name: name.into(),
            value,
            unit: unit.into(),
            standard_error,
            before: None,
        };
        let mut all = Vec::new();
        let value = terms::amplitude(entry, &numbers[first..]);
        let error = terms::amplitude_error(entry, &numbers[first..], &errors[first..]);
        let base = terms::baseline(&self.model);
        let viscous = base.iter().position(|column| column.name == "viscous").map(|at| numbers[at]);
        if let Some(viscous) = viscous.filter(|b| entry.effect == "friction-asymmetry" && *b != 0.0) {
            let [percent, error] = [value, error].map(|number| 100.0 * number / viscous);
            all.push(quantity("asymmetry_percent", "%", percent, Some(error.abs())));
            all.push(quantity("viscous_outward_n_s_per_m", "N s/m", viscous + value, None));
            all.push(quantity("viscous_inward_n_s_per_m", "N s/m", viscous - value, None));
        }
        let before = match entry.effect.as_str() {
            "parameter:kv-scale" => Some(1.0),
            "parameter:flow-lag" => {
                self.rig.as_ref().map(|rig| rig.valve().flow_lag_time_constant_s * factor)
            }
            "dead-volume" => self.rig.as_ref().map(|rig| rig.cylinder().dead_volume_m3 * factor),
            _ => None,
        };
        let describe = value * factor + before.unwrap_or(0.0);
        let error = Some(error * factor);
        all.push(Quantity { before, ..quantity(name, unit, describe, error) });
        all.extend(entry.shape.iter().map(|(key, value)| quantity(key, shape_unit(key), *value, None)));
        all
    }

    /// Clustered standard errors of a fit over these columns; an unknown one is NaN, and reported as null.
    fn errors(&self, columns: &super::Columns, fit: &super::Fit) -> Vec<f64> {
        self.rows.covariance(columns, fit, &self.time).map_or_else(
            || vec![f64::NAN; columns.len()],
            |c| c.diagonal().iter().map(|v| v.sqrt()).collect(),
        )
    }

    fn named(&self) -> Vec<NamedEffect> {
        let effect = |(taken, entry, numbers): (&Taken, &TermEntry, Vec<Quantity>)| {
            let evaluation = &taken.evaluation;
            let forms = evaluation.ties.iter().map(|variant| (evaluation.place, *variant));
            let twins = forms.chain(taken.alternatives.iter().copied()).map(|twin| self.alternative(twin));
            let alternatives = twins.chain(alias(entry, &numbers, self)).collect();
            NamedEffect { alternatives, ..named_effect(&entry.effect, finite(numbers), evaluation.share) }
        };
        self.taken(false).map(effect).collect()
    }

    /// The selected terms that are parameters, or those that are effects, with their numbers.
    fn taken(&self, parameters: bool) -> impl Iterator<Item = (&Taken, &TermEntry, Vec<Quantity>)> {
        let errors = self.errors(&self.extended, &self.extended_fit);
        let mut next = self.base.len();
        let all = self.found.taken.iter().map(move |taken| {
            let prepared = &self.families[taken.evaluation.place];
            let entry = &prepared.family.variants[taken.evaluation.variant];
            let first = next;
            next += prepared.columns[taken.evaluation.variant].len();
            (taken, entry, self.quantities(entry, first, &self.extended_fit.numbers, &errors))
        });
        all.filter(move |(_, entry, _)| entry.effect.starts_with("parameter:") == parameters)
    }

    /// What explains the records as well, fitted beside the baseline alone.
    fn alternative(&self, (place_of, variant): (usize, usize)) -> NamedEffect {
        let prepared = &self.families[place_of];
        let entry = &prepared.family.variants[variant];
        let columns: super::Columns = self.base.iter().chain(&prepared.columns[variant]).cloned().collect();
        let first = self.found.first.iter().find(|evaluation| evaluation.place == place_of);
        let parameters = self.rows.fit(&columns).map_or_else(Vec::new, |fit| {
            let errors = self.errors(&columns, &fit);
            finite(self.quantities(entry, self.base.len(), &fit.numbers, &errors))
        });
        named_effect(&entry.effect, parameters, first.map_or(0.0, |evaluation| evaluation.share))
    }

    fn parameters(&self) -> Vec<Quantity> {
        self.taken(true)
            .filter_map(|(_, entry, numbers)| {
                Some(Quantity { name: entry.effect.clone(), ..finite(numbers).into_iter().next()? })
            })
            .collect()
    }

    fn candidates(&self) -> Vec<Candidate> {
        let taken = |candidate: &CandidateEvaluation| {
            self.found.taken.iter().position(|taken| taken.evaluation.place == candidate.place)
        };
        let mut candidates: Vec<Candidate> = self
            .found
            .first
            .iter()
            .map(|evaluation| {
                let entry = &self.families[evaluation.place].family.variants[evaluation.variant];
                let (_, unit, factor) = shown(entry);
                let last = self.found.last.iter().find(|last| last.place == evaluation.place);
                let decision = match (taken(evaluation), last) {
                    (Some(round), _) => {
                        let ordinal = ["first", "second", "third"]
                            .get(round)
                            .map_or_else(|| format!("as number {}", round + 1), |name| (*name).to_owned());
                        format!("taken {ordinal} ({})", describe(entry))
                    }
                    (None, Some(last)) if last.passes => {
                        format!("passes, but another was better ({})", describe(entry))
                    }
                    (None, Some(last)) => {
                        let entry = &self.families[last.place].family.variants[last.variant];
                        format!("rejected: {} ({})", last.gate, describe(entry))
                    }
                    (None, None) => "not tried".to_owned(),
                };
                Candidate {
                    effect: entry.effect.clone(),
                    place: place(&entry.effect),
                    score: evaluation.score,
                    share_explained: Some(evaluation.share),
                    fit: None,
                    amplitude: evaluation.number * factor,
                    unit: unit.into(),
                    decision,
                }
            })
            .collect();
        candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
        candidates
    }

    /// Families collinear with the baseline.
    fn not_excited(&self) -> Vec<EffectPlace> {
        let describe = self.found.first.iter().filter(|evaluation| !evaluation.is_excited);
        let effects =
            describe.map(|evaluation| self.families[evaluation.place].family.variants[0].effect.clone());
        effects.map(|effect| EffectPlace { place: place(&effect), effect }).collect()
    }

    /// Detection limit: the number that would remove the required share of the remaining power.
    fn detection_limits(&self) -> Vec<DetectionLimit> {
        let rss = self.rows.rss(&self.extended_fit.residual);
        let mut limits = Vec::new();
        for evaluation in &self.found.last {
            let prepared = &self.families[evaluation.place];
            let entry = &prepared.family.variants[evaluation.variant];
            let (name, unit, factor) = shown(entry);
            if entry.effect.starts_with("decoy:") || !evaluation.is_excited {
                continue;
            }
            let column =
                super::Rows { target: prepared.columns[evaluation.variant][0].clone(), ..self.rows.clone() };
            let Some(alone) = column.fit(&self.extended) else { continue };
            let alone_rss = column.rss(&alone.residual);
            if alone_rss > 0.0 {
                let value = (self.model.selection.share_floor * rss / alone_rss).sqrt() * factor;
                limits.push(DetectionLimit {
                    effect: entry.effect.clone(),
                    place: place(&entry.effect),
                    name: name.into(),
                    value,
                    unit: unit.into(),
                });
            }
        }
        limits
    }

    /// What the baseline leaves, over speed.
    fn map(&self) -> Option<Curve> {
        let speeds: Vec<f64> =
            self.runs.iter().flat_map(|run| run.kept.iter().map(|at| run.v_m_per_s[*at])).collect();
        let cut = self.rows.in_bands("speed", &speeds, BINS);
        let (variable, variable_unit, unit) = ("v".into(), "m/s".into(), self.unit().into());
        let mut curve = Curve { variable, variable_unit, unit, ..Curve::default() };
        for fold in cut.folds.iter().filter(|fold| fold.len() > 2) {
            let mean = |of: &[f64]| fold.iter().map(|row| of[*row]).sum::<f64>() / fold.len() as f64;
            let value = mean(&self.base_fit.residual);
            let square = fold.iter().map(|row| (self.base_fit.residual[*row] - value).powi(2)).sum::<f64>();
            let rows = fold.len() as f64;
            curve.at.push(mean(&speeds));
            curve.value.push(value);
            curve.band.push(2.0 * (square / (rows - 1.0) / rows).sqrt());
        }
        Some(curve)
    }

    fn outside(&self) -> Option<Outside> {
        self.found.decoy.as_ref()?;
        let why_not = Some("a model of one balance takes no table".to_owned());
        let (balance, curve) = (self.balance_name().into(), self.map());
        Some(Outside { balance, curve, why_not, ..Outside::default() })
    }

    fn next(&self, named: &[NamedEffect]) -> Option<Next> {
        let twins: Vec<&NamedEffect> = named.iter().flat_map(|effect| &effect.alternatives).collect();
        let first = named.iter().find(|effect| !effect.alternatives.is_empty())?;
        let otherwise = match first.effect.as_str() {
            "pressure-dependent-friction" => "the same strokes at three levels of pressure or more",
            "dead-volume" => {
                "the other chamber of the same strokes: an offset of the position takes from it what it gives here"
            }
            "inclination" => "the same strokes with the axis tilted, or with the force sensor unloaded",
            _ => "strokes at other speeds and other levels of pressure",
        };
        let names: Vec<String> = twins
            .iter()
            .map(|twin| {
                if twin.effect == first.effect {
                    format!("another form of {}", twin.effect)
                } else {
                    twin.effect.clone()
                }
            })
            .collect();
        Some(Next {
            reason: format!("{} fits these records as well as {}", names.join(", "), first.effect),
            experiment: None,
            divergence: None,
            otherwise: Some(otherwise.into()),
        })
    }

    /// What both models leave of records that were not used.
    pub(super) fn verify(&self, runs: &[Run], fitted: &Fitted, report: &mut Report) {
        let Fitted { rows, residuals: [before, after] } = fitted;
        let signal = match self.model.kind {
            Kind::Chamber => "drive_flow_a_m3_per_s".to_owned(),
            _ => self.model.channels["force"].column(),
        };
        let [before_rms, after_rms] = [before, after].map(|values| rms(values));
        let closed = (before_rms > 0.0).then(|| 1.0 - (after_rms / before_rms).powi(2));
        report
            .misfit
            .insert(signal.clone(), Misfit { before: before_rms, after: after_rms, floor: 0.0, closed });
        let cut = rows.in_time(self.model.selection.blocks);
        let squares = |residual: &[f64]| -> Vec<f64> {
            cut.folds.iter().map(|fold| fold.iter().map(|row| residual[*row].powi(2)).sum()).collect()
        };
        let differences: Vec<f64> =
            squares(before).iter().zip(squares(after)).map(|(before, after)| before - after).collect();
        let trained = rms(&self.extended_fit.residual).powi(2).max(f64::MIN_POSITIVE);
        let lag = |residual: &[f64]| {
            let products: f64 = residual.windows(2).map(|pair| pair[0] * pair[1]).sum();
            products / residual.iter().map(|r| r * r).sum::<f64>().max(f64::MIN_POSITIVE)
        };
        let mut folds: Vec<f64> = self
            .time
            .folds
            .iter()
            .map(|fold| fold_mean_square(&self.extended_fit.residual, fold) / trained)
            .collect();
        folds.sort_by(f64::total_cmp);
        let worse = after_rms > WORSE * before_rms;
        let (chi2_after, chi2_null) = (after_rms.powi(2) / trained, [folds[0], folds[folds.len() - 1]]);
        report.verification = Some(Verification {
            record: runs.iter().map(|run| run.name.clone()).collect::<Vec<_>>().join(", "),
            chi2_before: before_rms.powi(2) / trained,
            chi2_after,
            chi2_null,
            free_run_nrmse_percent: BTreeMap::new(),
            whiteness: BTreeMap::from([(signal, BeforeAfter { before: lag(before), after: lag(after) })]),
            physical: Vec::new(),
            confirmed: !worse && !self.found.taken.is_empty() && clustered_t(&differences) > 3.0,
            worse,
            adequate: chi2_after <= chi2_null[1],
            more_missing: leaves_more(chi2_after, chi2_null, false),
        });
    }
}

fn fold_mean_square(residual: &[f64], fold: &[usize]) -> f64 {
    fold.iter().map(|row| residual[*row].powi(2)).sum::<f64>() / fold.len().max(1) as f64
}

/// No standard error rather than one that is no number.
fn finite(mut quantities: Vec<Quantity>) -> Vec<Quantity> {
    for quantity in &mut quantities {
        quantity.standard_error = quantity.standard_error.filter(|error| error.is_finite());
    }
    quantities
}

/// Effects with an identical column, reported without a fit.
fn alias(entry: &TermEntry, numbers: &[Quantity], study: &Study) -> Vec<NamedEffect> {
    let named = |effect: &str, parameters: Vec<Quantity>| named_effect(effect, parameters, 0.0);
    match (entry.effect.as_str(), &study.rig, numbers.first()) {
        ("dead-volume", Some(rig), Some(volume)) => {
            // A position that is read o too long makes the volume A o too large.
            let per_mm_cm3 = rig.cylinder().piston_area_m2 * 1e3;
            let offset = Quantity {
                name: "offset_mm".into(),
                unit: "mm".into(),
                value: (volume.before.unwrap_or(0.0) - volume.value) / per_mm_cm3,
                standard_error: volume.standard_error.map(|error| error / per_mm_cm3),
                before: None,
            };
            vec![named("position-sensor-offset", vec![offset])]
        }
        ("inclination", _, Some(force)) => {
            let sliding = named("friction-asymmetry", Vec::new());
            let offset = Quantity { name: "offset_n".into(), ..force.clone() };
            vec![named("force-sensor-offset", vec![offset]), sliding]
        }
        _ => Vec::new(),
    }
}
