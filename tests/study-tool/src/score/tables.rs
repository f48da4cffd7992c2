//! Tables over all cases of a score.

use super::{CLEAR, Case};
use crate::draws::Kind;
use crate::interval::Rate;
use crate::judge::{HiddenJudgement, NumberJudgement};
use model_fit::stats::quantile;
use plant::effects::SHEETS;
use serde::Serialize;
use std::collections::BTreeMap;

/// Columns of the confusion matrix other than the effects.
pub(crate) const OTHER_COLUMNS: [&str; 5] = ["nothing", "parameter", "outside", "ambiguous", "error"];

/// All tables of a score but those of effects left out.
#[derive(Debug, Serialize)]
pub struct Tables {
    /// The rates that have targets.
    pub headline: Vec<Line>,
    /// Single effects, by difficulty and by amplitude.
    pub(crate) splits: Vec<Split>,
    pub(crate) effects: Vec<Split>,
    /// True effects against the verdicts.
    pub(crate) confusion: Vec<ConfusionRow>,
    /// Verdicts in cases with nothing hidden, and in those of a wrong parameter.
    pub(crate) nothing_hidden: Vec<ConfusionRow>,
    pub(crate) numbers: Numbers,
    pub(crate) wall_s: QuantileSummary,
    pub(crate) memory_mib: QuantileSummary,
    /// Share of the gap that the program claims to have closed on the held-out record, for single effects that were named
    /// right.
    pub(crate) claimed_closed_ratio: QuantileSummary,
    /// The same for all signals together, each in units of its noise.
    pub(crate) claimed_joint_ratio: QuantileSummary,
    /// Reasons why cases have no good report, and how many.
    pub(crate) errors: BTreeMap<String, usize>,
}

#[derive(Debug, Clone, Serialize)]
pub struct Line {
    pub name: String,
    /// Count, total and intervals.
    pub rate: Rate,
    pub wanted: &'static str,
}

impl Line {
    /// The rate of the items for which `is` holds.
    pub(crate) fn of<T>(
        name: &str,
        wanted: &'static str,
        items: impl IntoIterator<Item = T>,
        is: impl FnMut(T) -> bool,
    ) -> Self {
        Line { name: name.to_owned(), rate: Rate::of(items, is), wanted }
    }

    pub(crate) fn of_errors(cases: &[Case]) -> Self {
        let name = "no good report (crash, time limit, bad JSON, refused)";
        Self::of(name, "none", cases, |case| case.judgement.error.is_some())
    }

    /// Whether the rate should be low: then its upper bound is reported.
    pub(crate) fn is_low(&self) -> bool {
        self.wanted == "none" || self.wanted.starts_with("at most")
    }
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Split {
    pub(crate) name: String,
    pub(crate) class_right: Rate,
    pub(crate) top: Rate,
    /// The effect itself alone, of those without twins.
    pub(crate) alone: Rate,
    /// The place, of those whose class was named.
    pub(crate) where_right: Rate,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct ConfusionRow {
    pub(crate) truth: String,
    pub(crate) of: usize,
    /// Cases with this verdict: all, of its class, at the right place.
    pub(crate) called: BTreeMap<String, [usize; 3]>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Numbers {
    /// |fitted - true| / |true| of amplitudes, in the catalogue's form.
    pub(crate) off_ratio: QuantileSummary,
    /// Standard error / |true| of amplitudes.
    pub(crate) error_ratio: QuantileSummary,
    /// Share of amplitudes within two standard errors.
    pub(crate) covered: Rate,
    /// Share of all numbers within two standard errors.
    pub(crate) all_covered: Rate,
    /// The same for draws of another form.
    pub(crate) foreign_covered: Rate,
    /// Right names without a number or without its standard error.
    pub(crate) untold: usize,
}

#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(crate) struct QuantileSummary {
    pub(crate) of: usize,
    /// Smallest, median, 90th percentile, largest; `None` without values.
    pub(crate) quantiles: Option<[f64; 4]>,
}

impl QuantileSummary {
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        let all = [0.0, 0.5, 0.9, 1.0].map(|share| quantile(&mut values, share));
        let [Some(least), Some(median), Some(high), Some(largest)] = all else {
            return QuantileSummary::default();
        };
        QuantileSummary { of: values.len(), quantiles: Some([least, median, high, largest]) }
    }
}

impl Tables {
    pub(crate) fn of(cases: &[Case]) -> Self {
        let singles: Vec<&Case> = of_kind(cases, Kind::Single).collect();
        let mut errors = BTreeMap::new();
        for error in cases.iter().filter_map(|case| case.judgement.error.clone()) {
            *errors.entry(error).or_default() += 1;
        }
        let of_sheet =
            |name: &'static str| singles.iter().copied().filter(move |case| hidden(case).effect == name);
        let judged_right = || singles.iter().filter(|case| right(case)).map(|case| &case.judgement);
        Tables {
            headline: headline(cases, &singles),
            splits: splits(&singles),
            effects: SHEETS.iter().map(|sheet| split(sheet.name, of_sheet(sheet.name))).collect(),
            confusion: SHEETS.iter().map(|sheet| row(sheet.name, of_sheet(sheet.name))).collect(),
            nothing_hidden: nothing_hidden(cases),
            numbers: numbers(&singles),
            wall_s: QuantileSummary::of(cases.iter().map(|case| case.wall_s)),
            memory_mib: QuantileSummary::of(cases.iter().map(|case| case.memory_kib as f64 / 1024.0)),
            claimed_closed_ratio: QuantileSummary::of(
                judged_right().filter_map(|judgement| judgement.claimed_closed_ratio),
            ),
            claimed_joint_ratio: QuantileSummary::of(
                judged_right().filter_map(|judgement| judgement.claimed_joint_ratio),
            ),
            errors,
        }
    }
}

fn of_kind(cases: &[Case], kind: Kind) -> impl Iterator<Item = &Case> {
    cases.iter().filter(move |case| case.kind == kind)
}

pub(crate) fn hidden(case: &Case) -> &HiddenJudgement {
    &case.judgement.hidden[0]
}

fn right(case: &Case) -> bool {
    hidden(case).right
}

pub(crate) fn over_limit(case: &Case) -> Option<f64> {
    case.over_limit.first().copied().flatten()
}

pub(crate) fn is_clear(case: &Case) -> bool {
    over_limit(case).is_some_and(|ratio| ratio >= CLEAR)
}

fn headline(cases: &[Case], singles: &[&Case]) -> Vec<Line> {
    let clear = || singles.iter().copied().filter(|case| is_clear(case));
    let alone = || clear().filter(|case| hidden(case).class_size == 1);
    let named = || clear().filter(|case| right(case));
    let white = || named().filter(|case| !case.foreign_form).filter_map(|case| case.judgement.claimed_white);
    let nulls = || of_kind(cases, Kind::Null);
    let parameters = || of_kind(cases, Kind::Parameter);
    let pairs = || of_kind(cases, Kind::Pair).filter(|case| case.separable);
    let triples = || of_kind(cases, Kind::Triple).filter(|case| case.separable);
    let all_right = |case: &Case| case.judgement.hidden.iter().all(|hidden| hidden.right);
    let false_alarm = |case: &Case| case.judgement.false_alarm;
    let reported = |case: &Case| case.judgement.parameter_right;
    vec![
        Line::of(
            "one effect, 3 x limit and more: its class among the names",
            "at least 95 %",
            clear(),
            right,
        ),
        Line::of("the same, alone in its class: right alone", "at least 85 %", alone(), |case| {
            case.judgement.alone
        }),
        Line::of("the same, class named: where right", "all", named(), |case| hidden(case).where_right),
        Line::of(
            "the same, the catalogue's form: held-out chi2 claimed to be that of nothing missing",
            "at least 80 %",
            white(),
            |white| white,
        ),
        Line::of("nothing hidden: called missing", "at most 2 %", nulls(), false_alarm),
        Line::of("a parameter off: reported, no effect named", "all", parameters(), reported),
        Line::of("a parameter off: called missing", "none", parameters(), false_alarm),
        Line::of("two effects, separable: both classes named", "at least 80 %", pairs(), all_right),
        Line::of("two effects, separable: no third", "at least 90 %", pairs(), |case| {
            case.judgement.too_many == 0
        }),
        Line::of("three effects, separable: all classes named", "no target", triples(), all_right),
        Line::of_errors(cases),
    ]
}

pub(crate) type IsPart = Box<dyn Fn(&Case) -> bool>;

/// Parts of single effects, by amplitude and by difficulty.
pub(crate) fn parts() -> Vec<(&'static str, IsPart)> {
    fn part(is: impl Fn(&Case) -> bool + 'static) -> IsPart {
        Box::new(is)
    }
    let between = |least: f64, most: f64| {
        part(move |case| over_limit(case).is_some_and(|ratio| ratio >= least && ratio < most))
    };
    vec![
        ("all", part(|_| true)),
        ("below the limit", between(0.0, 1.0)),
        ("1 to 3 x limit", between(1.0, CLEAR)),
        ("3 x limit and more", between(CLEAR, f64::INFINITY)),
        ("3 to 10 x limit", between(CLEAR, 10.0)),
        ("10 x limit and more", between(10.0, f64::INFINITY)),
        ("limit not known", part(|case| over_limit(case).is_none())),
        ("3 x limit, the catalogue's form", part(|case| is_clear(case) && !case.foreign_form)),
        ("3 x limit, another form", part(|case| is_clear(case) && case.foreign_form)),
        ("3 x limit, parameters right", part(|case| is_clear(case) && !case.wrong_parameters)),
        ("3 x limit, parameters off", part(|case| is_clear(case) && case.wrong_parameters)),
        ("3 x limit, white noise", part(|case| is_clear(case) && !case.coloured_noise)),
        ("3 x limit, coloured noise and jitter", part(|case| is_clear(case) && case.coloured_noise)),
    ]
}

fn splits(singles: &[&Case]) -> Vec<Split> {
    let of_part = |(name, is): &(&str, IsPart)| split(name, singles.iter().copied().filter(|case| is(case)));
    parts().iter().map(of_part).collect()
}

fn split<'a>(name: &str, cases: impl Iterator<Item = &'a Case>) -> Split {
    let cases: Vec<&Case> = cases.collect();
    let all = || cases.iter().copied();
    Split {
        name: name.to_owned(),
        class_right: Rate::of(all(), right),
        top: Rate::of(all(), |case| case.judgement.top),
        alone: Rate::of(all().filter(|case| hidden(case).class_size == 1), |case| case.judgement.alone),
        where_right: Rate::of(all().filter(|case| right(case)), |case| hidden(case).where_right),
    }
}

fn row<'a>(truth: &str, cases: impl Iterator<Item = &'a Case>) -> ConfusionRow {
    let mut row = ConfusionRow { truth: truth.to_owned(), of: 0, called: BTreeMap::new() };
    for case in cases {
        row.of += 1;
        let cell = row.called.entry(case.judgement.called.clone()).or_default();
        let hidden = case.judgement.hidden.first();
        cell[0] += 1;
        cell[1] += usize::from(hidden.is_some_and(|hidden| hidden.right));
        cell[2] += usize::from(hidden.is_some_and(|hidden| hidden.where_right));
    }
    row
}

fn nothing_hidden(cases: &[Case]) -> Vec<ConfusionRow> {
    let nulls = |off| of_kind(cases, Kind::Null).filter(move |case| case.wrong_parameters == off);
    let mut rows = vec![
        row("nothing, parameters right", nulls(false)),
        row("nothing, parameters off by 1 to 3 %", nulls(true)),
    ];
    let wrong =
        |case: &Case| case.recipe["wrong_parameters"][0]["name"].as_str().unwrap_or_default().to_owned();
    rows.extend(
        crate::draws::SINGLE_PARAMETERS
            .iter()
            .map(|name| row(name, of_kind(cases, Kind::Parameter).filter(|case| wrong(case) == *name))),
    );
    rows
}

fn numbers(singles: &[&Case]) -> Numbers {
    let reported = |foreign| {
        singles.iter().filter(move |case| case.foreign_form == foreign).flat_map(|case| &hidden(case).numbers)
    };
    let amplitudes = || reported(false).filter(|number| number.amplitude);
    let covered = |numbers: &mut dyn Iterator<Item = &NumberJudgement>| {
        Rate::of(numbers.filter_map(|number| number.covered), |covered| covered)
    };
    Numbers {
        off_ratio: QuantileSummary::of(amplitudes().map(|number| number.off_ratio)),
        error_ratio: QuantileSummary::of(amplitudes().filter_map(|number| number.error_ratio)),
        covered: covered(&mut amplitudes()),
        all_covered: covered(&mut reported(false)),
        foreign_covered: covered(&mut reported(true)),
        untold: singles
            .iter()
            .filter(|case| case.judgement.top && hidden(case).where_right)
            .filter(|case| {
                !hidden(case).numbers.iter().any(|number| number.amplitude && number.covered.is_some())
            })
            .count(),
    }
}
