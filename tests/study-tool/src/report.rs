//! `report.json` of a program under study, parsed strictly.
//!
//! A report that cannot be parsed is a result: the program wrote no good report. The same holds for a name that the catalogue
//! lacks, a place that the effect cannot have, a number that is not valid, and a verdict that contradicts the list of names.
//! Fields that the study does not judge are ignored.

pub(crate) use discrepancy::report::Verdict;
use discrepancy::report::{
    self, Explanation, LocatedTerm, NamedEffect, NextExperiment, Quantity, SignalMisfit, UncataloguedTerm,
    Verification,
};
use plant::effects::sheet::{Place, Sheet};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// A valid report: the fields that the study judges.
#[derive(Debug, Clone)]
pub struct Report {
    pub(crate) verdict: Verdict,
    /// Missing effects, the best explanation first.
    pub(crate) named: Vec<Named>,
    /// The effect nearest to something outside the catalogue.
    pub(crate) nearest: Option<Named>,
    pub(crate) parameters: Vec<Quantity>,
    pub(crate) misfit: BTreeMap<String, SignalMisfit>,
    /// What is missing and not in the catalogue.
    pub(crate) outside: Option<UncataloguedTerm>,
    /// What the model of the rig file lacks, whatever the verdict.
    pub(crate) dependence: Option<LocatedTerm>,
    /// Check of the model on the held-out record.
    pub(crate) verification: Option<Verification>,
    pub(crate) explanations: Vec<Explanation>,
    pub(crate) next: Option<NextExperiment>,
}

/// An effect of the catalogue at one of its places.
#[derive(Debug, Clone)]
pub(crate) struct Named {
    pub(crate) sheet: &'static Sheet,
    pub(crate) place: Place,
    pub(crate) parameters: Vec<Quantity>,
    /// Effects that explain the record as well.
    pub(crate) alternatives: Vec<Named>,
}

/// Reads and checks a report.
///
/// # Errors
/// A sentence for the list of errors: what is wrong with it.
pub fn read(path: &Path) -> Result<Report, String> {
    let bytes = fs::read(path).map_err(|_| "wrote no report.json".to_owned())?;
    parse(&bytes)
}

pub(crate) fn parse(bytes: &[u8]) -> Result<Report, String> {
    let raw: report::Report =
        serde_json::from_slice(bytes).map_err(|error| format!("report.json: {error}"))?;
    let named = raw.named.into_iter().map(known).collect::<Result<Vec<_>, _>>()?;
    let nearest = raw.nearest.map(known).transpose()?;
    let says_names = matches!(raw.verdict, Verdict::Named | Verdict::Ambiguous);
    if says_names && named.is_empty() {
        return Err(format!("verdict {:?} without a name", raw.verdict));
    }
    let says_none =
        matches!(raw.verdict, Verdict::NothingMissing | Verdict::ParametersOnly | Verdict::BadData);
    if says_none && !named.is_empty() {
        return Err(format!("verdict {:?} with names", raw.verdict));
    }
    if raw.verdict == Verdict::ParametersOnly && raw.parameters.is_empty() {
        return Err("verdict ParametersOnly without a parameter".to_owned());
    }
    let dependence = raw.location.and_then(|location| location.dependence);
    let report::Report { verdict, parameters, misfit, outside, verification, explanations, next, .. } = raw;
    Ok(Report {
        verdict,
        named,
        nearest,
        parameters,
        misfit,
        outside,
        dependence,
        verification,
        explanations,
        next,
    })
}

fn known(raw: NamedEffect) -> Result<Named, String> {
    let sheet = plant::effects::sheet(&raw.effect)
        .ok_or_else(|| format!("names '{}', which is not in the catalogue", raw.effect))?;
    let place = raw.place.to_string();
    let place = sheet.place_named(&place).ok_or_else(|| format!("{} cannot be at '{place}'", sheet.name))?;
    let alternatives = raw.alternatives.into_iter().map(known).collect::<Result<_, _>>()?;
    Ok(Named { sheet, place, parameters: raw.parameters, alternatives })
}

impl Report {
    /// File name of the proposed experiment; `None` unless it is a plain name beside the report.
    pub(crate) fn proposed(&self) -> Option<&str> {
        let name = self.next.as_ref()?.experiment.as_deref()?;
        let plain = Path::new(name).file_name().is_some_and(|file| file == name);
        (plain && name.starts_with("next") && name.ends_with(".toml")).then_some(name)
    }

    /// Smallest share of the gap that the program claims to have closed, over the signals that state one.
    pub(crate) fn claimed_closed(&self) -> Option<f64> {
        self.misfit.values().filter_map(|misfit| misfit.closed).reduce(f64::min)
    }

    /// Share of the gap that was closed, all signals together, each in units of its noise: a signal with a small gap has a
    /// small weight.
    ///
    /// ```text
    /// 1 - sum(after^2 / floor^2 - 1) / sum(before^2 / floor^2 - 1)
    /// ```
    ///
    /// `None` when no signal has all three numbers, or there was no gap.
    pub(crate) fn claimed_joint(&self) -> Option<f64> {
        let mut excess = [0.0, 0.0];
        let is_whole =
            |misfit: &&SignalMisfit| misfit.floor > 0.0 && !misfit.before.is_nan() && !misfit.after.is_nan();
        for SignalMisfit { before, after, floor, .. } in self.misfit.values().filter(is_whole) {
            excess[0] += (before / floor).powi(2) - 1.0;
            excess[1] += (after / floor).powi(2) - 1.0;
        }
        (excess[0] > 0.0).then(|| 1.0 - excess[1] / excess[0])
    }

    /// Whether the program claims that the residual of its model on the held-out record is within the range of a complete
    /// model.
    pub(crate) fn claimed_white(&self) -> Option<bool> {
        let Verification { chi2_after, chi2_null: [low, high], .. } = self.verification.as_ref()?;
        Some((low..=high).contains(&chi2_after))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(entry: &str) -> String {
        format!(r#"{{"schema_version": 1, "verdict": "named", "named": [{entry}], "next": null}}"#)
    }

    #[test]
    fn a_good_report_is_read() {
        let entry = r#"{"effect": "rod-leakage", "where": {"axis": "drive", "element": "b"},
            "parameters": [{"name": "leakage_nl_per_min", "value": 2.5, "unit": "Nl/min", "standard_error": 0.1}],
            "share_explained": 0.9,
            "alternatives": [{"effect": "valve-offset", "where": {"axis": "drive", "element": null}}]}"#;
        let report = parse(named(entry).as_bytes()).unwrap();
        assert_eq!(report.verdict, Verdict::Named);
        assert_eq!(report.named[0].sheet.name, "rod-leakage");
        assert_eq!(report.named[0].place.to_string(), "drive.b");
        assert_eq!(report.named[0].parameters[0].value, 2.5);
        assert_eq!(report.named[0].alternatives[0].sheet.name, "valve-offset");
    }

    #[test]
    fn what_is_no_report_says_why() {
        let entry = |effect, axis, element| {
            named(&format!(
                r#"{{"effect": "{effect}", "where": {{"axis": "{axis}", "element": {element}}}}}"#
            ))
        };
        let nan = named(
            r#"{"effect": "inclination", "where": {"axis": "drive", "element": null},
            "parameters": [{"name": "force_n", "value": NaN, "unit": "N", "standard_error": 1}]}"#,
        );
        for (text, reason) in [
            ("", "EOF"),
            ("{\"verdict\": \"named\", \"named\": [", "EOF"),
            (r#"{"verdict": "perhaps"}"#, "perhaps"),
            (r#"{"named": []}"#, "verdict"),
            (&named(""), "without a name"),
            (r#"{"verdict": "parameters-only"}"#, "without a parameter"),
            (&entry("phlogiston", "drive", "null"), "phlogiston"),
            (&entry("inclination", "drive", "\"a\""), "cannot be at 'drive.a'"),
            (&entry("rod-leakage", "nowhere", "\"a\""), "cannot be at"),
            (
                &entry("inclination", "drive", "null").replace("\"named\",", "\"nothing-missing\","),
                "with names",
            ),
            (&nan, "report.json"),
        ] {
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.contains(reason), "'{error}' does not tell '{reason}'");
        }
    }

    #[test]
    fn what_is_outside_the_catalogue_is_read_with_its_variables_in_order() {
        let text = r#"{"schema_version": 1, "verdict": "outside-catalogue", "outside": {"balance": "load.force", "variables":
            [{"variable": "x", "r2": 0.8, "p_value": 0.005}, {"variable": "sign(v)", "r2": 0.1, "p_value": 0.2}],
            "curve": {"at": []}, "formula": null}, "verification": {"chi2_after": 1.2, "chi2_null": [0.9, 1.1]}}"#;
        let report = parse(text.as_bytes()).unwrap();
        assert_eq!(report.claimed_white(), Some(false));
        let outside = report.outside.unwrap();
        assert_eq!(
            (outside.balance.as_str(), outside.variables[1].variable.as_str()),
            ("load.force", "sign(v)")
        );
        let bad = text.replace("\"balance\": \"load.force\",", "");
        assert!(parse(bad.as_bytes()).unwrap_err().contains("balance"));
        assert!(parse(br#"{"verdict": "nothing-missing", "outside": null}"#).unwrap().outside.is_none());
    }

    #[test]
    fn the_next_experiment_is_read_where_it_is_reported() {
        let with = |next: &str| {
            parse(format!(r#"{{"verdict": "nothing-missing", "next": {next}}}"#).as_bytes()).unwrap().next
        };
        let next = with(
            r#"{"reason": "alike", "experiment": "next-ends.toml", "divergence": 88, "otherwise": null}"#,
        );
        assert_eq!(next.unwrap().experiment.unwrap(), "next-ends.toml");
        assert_eq!(
            with(r#"{"reason": "alike", "otherwise": "tilting"}"#).unwrap().otherwise.unwrap(),
            "tilting"
        );
        assert_eq!(with("null"), None);
        let elsewhere = |name: &str| {
            let text = format!(r#"{{"verdict": "nothing-missing", "next": {{"experiment": "{name}"}}}}"#);
            parse(text.as_bytes()).unwrap().proposed().map(str::to_owned)
        };
        assert_eq!(elsewhere("next-ends.toml").as_deref(), Some("next-ends.toml"));
        assert_eq!(elsewhere("../next-ends.toml").or(elsewhere("report.json")), None);
    }

    #[test]
    fn the_claim_is_the_worst_signal_or_all_of_them_together() {
        let text = r#"{"verdict": "nothing-missing", "gap": {"p": {"before": 3, "after": 1, "floor": 1, "closed": 1.0},
            "x": {"before": 2, "after": 1.5, "floor": 1, "closed": 0.5}, "f": {"closed": null}}}"#;
        assert_eq!(parse(text.as_bytes()).unwrap().claimed_closed(), Some(0.5));
        // 9 - 1 and 4 - 1 before, nothing and 2.25 - 1 after; the force tells no numbers.
        let together = parse(text.as_bytes()).unwrap().claimed_joint().unwrap();
        assert!((together - (1.0 - 1.25 / 11.0)).abs() < 1e-12, "{together}");
        let none = r#"{"verdict": "nothing-missing", "gap": {"f": {"closed": 1}}}"#;
        assert_eq!(parse(none.as_bytes()).unwrap().claimed_joint(), None);
    }
}
