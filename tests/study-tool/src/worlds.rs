//! A study of two worlds as one table: the results where the catalogue's laws are exact, and where the whole rig has small
//! model errors.

use crate::draws::Kind;
use crate::interval::Rate;
use crate::leave_out::LeaveOutJudgement;
use crate::leave_out::tables::STILL_CLOSED;
use crate::probability::{JudgedExplanation, Reliability, by_marginal};
use crate::score::tables::{QuantileSummary, hidden, is_clear, over_limit};
use crate::score::{Case, Score};
use crate::target::{Outcome, Target};
use serde::Serialize;
use statrs::distribution::{Binomial, DiscreteCDF};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Relative error from which a parameter is much off.
const MUCH_OFF: f64 = 0.02;
/// Multiple of the limit between weak and strong effects.
const STRONG: f64 = 10.0;
/// Targets in the exact world and with a background: median and longest wall time of a draw, s; calibration error, points.
const MEDIAN_S: [f64; 2] = [12.0, 15.0];
const LONGEST_S: [f64; 2] = [60.0, 90.0];
const CALIBRATION_POINTS: [u32; 2] = [5, 10];

/// Results of a program in both worlds: the exact one, then the one with a background.
#[derive(Debug, Serialize)]
pub struct Worlds {
    pub(crate) rows: Vec<Row>,
    /// Number of draws with a result, and of all draws of the study.
    pub(crate) done: [usize; 2],
    /// Draws with a result in which the hidden effects were left out.
    pub(crate) left_out: usize,
    /// Calibration; draws with effects left out included.
    pub(crate) reliability: [Reliability; 2],
    /// The same for reports that state marginal likelihoods: with the stated probabilities, and with those.
    pub(crate) rules: [[Reliability; 2]; 2],
    pub(crate) wall_s: [QuantileSummary; 2],
    /// Chi2 per degree of freedom of the rig file on held-out records with nothing hidden and no wrong parameter: with a
    /// background it shows the size of that.
    pub(crate) null_chi2: [QuantileSummary; 2],
    /// Draws that took longer than the targets of the median and of the longest, in each world.
    pub(crate) longer: [[Rate; 2]; 2],
    pub(crate) errors: usize,
    /// Draws whose classes are not known, of both scores: there the class is the effect alone.
    pub(crate) without_classes: usize,
    /// Other programs on the same draws.
    pub(crate) others: Vec<PairedCounts>,
}

/// Paired counts of two programs: which got a draw exactly right (name, place, no other name), in each world.
#[derive(Debug, Serialize)]
pub(crate) struct PairedCounts {
    pub(crate) label: String,
    /// Right by both, by the first only, by the other only, by neither.
    pub(crate) counts: [[usize; 4]; 2],
}

impl PairedCounts {
    fn of(score: &Score, other: &Score) -> Self {
        let theirs: BTreeMap<usize, &Case> = other.cases.iter().map(|case| (case.number, case)).collect();
        let mut counts = [[0; 4]; 2];
        for case in &score.cases {
            let Some(other) = theirs.get(&case.number) else { continue };
            let place = 2 * usize::from(!is_exact(case)) + usize::from(!is_exact(other));
            counts[usize::from(case.background)][place] += 1;
        }
        PairedCounts { label: other.label.clone(), counts }
    }
}

/// Whether a case is right, without any other name.
fn is_exact(case: &Case) -> bool {
    let judgement = &case.judgement;
    match case.kind {
        Kind::Single => judgement.alone && hidden(case).where_right,
        Kind::Null => is_no_name(case),
        Kind::Parameter => judgement.parameter_right,
        Kind::Pair | Kind::Triple => {
            judgement.hidden.iter().all(|judged| judged.right) && judgement.too_many == 0
        }
    }
}

fn is_no_name(case: &Case) -> bool {
    ["nothing", "parameter", "outside"].contains(&case.judgement.called.as_str())
}

/// Exact McNemar test: two-sided probability of a split at least as uneven of the draws that only one program got right.
fn mcnemar(one: usize, other: usize) -> f64 {
    let of = (one + other) as u64;
    Binomial::new(0.5, of).map_or(1.0, |binomial| (2.0 * binomial.cdf(one.min(other) as u64)).min(1.0))
}

/// A rate in both worlds, and its targets.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) rates: [Rate; 2],
    pub(crate) wanted: [Target; 2],
    /// `None` without a target.
    pub(crate) outcomes: [Option<Outcome>; 2],
}

impl Row {
    fn new(name: &'static str, rates: [Rate; 2], wanted: [Target; 2]) -> Self {
        let outcomes = [0, 1].map(|world: usize| Outcome::of(&rates[world], wanted[world]));
        Row { name, rates, wanted, outcomes }
    }
}

impl Worlds {
    /// The results of a score with the whole catalogue, of one with the hidden effects left out, and of other programs; `draws`
    /// is the number of draws of the study.
    pub fn of(score: &Score, left: Option<&Score>, others: &[Score], draws: usize) -> Self {
        let in_worlds = |score: Option<&Score>| {
            [false, true].map(|background| -> Vec<Case> {
                let cases = score.into_iter().flat_map(|score| &score.cases);
                cases.filter(|case| case.background == background).cloned().collect()
            })
        };
        let without_classes = score.without_classes + left.map_or(0, |left| left.without_classes);
        let (worlds, left) = (in_worlds(Some(score)), in_worlds(left));
        let mut rows = rows(&worlds);
        rows.extend(left_out_rows(&left));
        let of_both = |world: usize| worlds[world].iter().chain(&left[world]);
        let reliability = [0, 1].map(|world| {
            let all = of_both(world).map(|case| (case.kind, &case.explanations[..]));
            Reliability::of(&all.collect::<Vec<_>>())
        });
        let rules = [0, 1].map(|world| {
            let both: Vec<(Kind, &[JudgedExplanation], Vec<JudgedExplanation>)> = of_both(world)
                .filter_map(|case| {
                    Some((case.kind, &case.explanations[..], by_marginal(&case.explanations)?))
                })
                .collect();
            [
                Reliability::of(
                    &both.iter().map(|(kind, deciding, _)| (*kind, *deciding)).collect::<Vec<_>>(),
                ),
                Reliability::of(
                    &both.iter().map(|(kind, _, marginal)| (*kind, &marginal[..])).collect::<Vec<_>>(),
                ),
            ]
        });
        let cases = || worlds.iter().chain(&left).flatten();
        let longer = [MEDIAN_S, LONGEST_S].map(|limits_s| {
            [0, 1].map(|world: usize| Rate::of(&worlds[world], |case: &Case| case.wall_s > limits_s[world]))
        });
        Worlds {
            rows,
            done: [worlds.iter().map(Vec::len).sum(), draws],
            left_out: left.iter().map(Vec::len).sum(),
            reliability,
            rules,
            null_chi2: [0, 1].map(|world: usize| {
                let right =
                    worlds[world].iter().filter(|case| case.kind == Kind::Null && !case.wrong_parameters);
                QuantileSummary::of(right.filter_map(|case| case.rig_file_chi2))
            }),
            wall_s: [0, 1]
                .map(|world: usize| QuantileSummary::of(worlds[world].iter().map(|case| case.wall_s))),
            longer,
            others: others.iter().map(|other| PairedCounts::of(score, other)).collect(),
            without_classes,
            errors: cases().filter(|case| case.judgement.error.is_some()).count(),
        }
    }

    pub fn markdown(&self) -> String {
        let mut text = format!(
            "{} of {} draws, and {} with what is hidden left out of the catalogue; {} without a good report, which count as \
             wrong.\n\n\
             | | exact world | wanted | outcome | background | wanted | outcome |\n|---|---|---|---|---|---|---|\n",
            self.done[0], self.done[1], self.left_out, self.errors
        );
        for Row { name, rates, wanted, outcomes } in &self.rows {
            let cells = [0, 1].map(|world: usize| {
                format!("{} | {} | {}", in_words(rates[world]), wanted[world], outcome_cell(outcomes[world]))
            });
            let _ = writeln!(text, "| {name} | {} |", cells.join(" | "));
        }
        text += &self.wall_time_rows();
        if self.without_classes > 0 {
            let _ = writeln!(
                text,
                "\n**{} draws have no classes**: there twins count as wrong names. Run `scripts/study cosines --out DIR --done \
                 LABEL` first.",
                self.without_classes
            );
        }
        text += &self.null_chi2_in_words();
        text += &self.others_in_words();
        text += &self.calibration_in_words();
        text += &self.rules_in_words();
        text
    }

    fn wall_time_rows(&self) -> String {
        let mut text = String::new();
        for (at, (name, limits_s)) in [("median", MEDIAN_S), ("longest", LONGEST_S)].into_iter().enumerate() {
            let cells = [0, 1].map(|world: usize| {
                let quantiles = self.wall_s[world].quantiles;
                let time =
                    quantiles.map_or_else(String::new, |quantiles| format!("{:.0} s", quantiles[1 + 2 * at]));
                let outcome = match Outcome::of(&self.longer[at][world], self.longer_wanted(at)) {
                    // The targets leave rehearsals out.
                    Some(Outcome::Missed) => "missed with rehearsals".to_owned(),
                    outcome => outcome_cell(outcome),
                };
                format!("{time} | {} s | {outcome}", limits_s[world])
            });
            let _ = writeln!(text, "| {name} of the wall time | {} |", cells.join(" | "));
        }
        text
    }

    /// Comparison with other programs on the same draws.
    fn others_in_words(&self) -> String {
        let mut text = String::new();
        for (label, world, [both, ours, theirs, neither]) in self.others.iter().flat_map(|paired| {
            let worlds = ["exact world", "background"].into_iter().zip(paired.counts);
            worlds.map(|(world, counts)| (&paired.label, world, counts))
        }) {
            let of = both + ours + theirs + neither;
            let _ = writeln!(
                text,
                "\nThe same draws by *{label}*, {world}: of {of} both get {both} exactly right, this program alone {ours}, \
                 *{label}* alone {theirs} (exact McNemar test: p = {:.2}).",
                mcnemar(ours, theirs)
            );
        }
        text
    }

    /// Calibration of the probabilities, with a table of their bins.
    fn calibration_in_words(&self) -> String {
        let mut text = String::new();
        for (at, (world, reliability)) in
            ["exact world", "background"].into_iter().zip(&self.reliability).enumerate()
        {
            let [right, of] = reliability.first_right;
            let error = reliability.shown_error().map_or_else(
                || "too few for a calibration error: no bin lies above 50 %".to_owned(),
                |error| {
                    let wanted = CALIBRATION_POINTS[at];
                    format!(
                        "expected calibration error {:.1} points (wanted: at most {wanted})",
                        100.0 * error
                    )
                },
            );
            let log_loss = reliability
                .log_loss
                .map_or_else(String::new, |log_loss| format!("; mean log loss {log_loss:.2}"));
            let _ = write!(
                text,
                "\nProbabilities, {world}, draws left out included: \
                 the most probable explanation is right for {right} of {of};\n{error}{log_loss}.\n\n\
                 | said | explanations | mean said | right | band |\n|---|---|---|---|---|\n"
            );
            for bin in &reliability.bins {
                let [low, high] = bin.between.map(|end| 100.0 * end);
                let [least, most] = bin.band.map(|end| 100.0 * end);
                let _ = writeln!(
                    text,
                    "| {low:.1} to {high:.1} % | {} | {:.1} % | {:.1} % | {least:.1} to {most:.1} % |",
                    bin.explanations,
                    100.0 * bin.stated,
                    100.0 * bin.right
                );
            }
        }
        text
    }

    /// The marginal likelihood against the rule that decides.
    fn rules_in_words(&self) -> String {
        let mut text = String::new();
        for (world, [decides, marginal]) in ["exact world", "background"].into_iter().zip(&self.rules) {
            let (Some(of_deciding), Some(of_marginal)) = (decides.log_loss, marginal.log_loss) else {
                continue;
            };
            let errors = match (marginal.shown_error(), decides.shown_error()) {
                (Some(marginal_error), Some(deciding_error)) => {
                    format!(
                        "expected calibration error {:.1} and {:.1} points, ",
                        100.0 * marginal_error,
                        100.0 * deciding_error
                    )
                }
                _ => String::new(),
            };
            let _ = writeln!(
                text,
                "\nBy the marginal likelihood, {world}: of {} reports that have it, its most probable explanation is right \
                 for {}, that of the rule that decides for {}; {errors}mean log loss {of_marginal:.2} and {of_deciding:.2}.",
                marginal.first_right[1], marginal.first_right[0], decides.first_right[0]
            );
        }
        text
    }

    fn null_chi2_in_words(&self) -> String {
        let of_world = |(world, spread): (&str, &QuantileSummary)| {
            let [least, median, _, largest] = spread.quantiles?;
            let of = spread.of;
            Some(format!("{world} {median:.2} in the median ({least:.2} to {largest:.2}, {of} draws)"))
        };
        let worlds: Vec<String> =
            ["exact world", "background"].into_iter().zip(&self.null_chi2).filter_map(of_world).collect();
        if worlds.is_empty() {
            return String::new();
        }
        format!(
            "\nThe rig file on held-out records with nothing hidden and no parameter off, chi2 per degree of freedom: {}.\n",
            worlds.join("; ")
        )
    }

    /// Target of the draws that took longer than the target of the median (0), and of the longest (1).
    fn longer_wanted(&self, at: usize) -> Target {
        let [done, draws] = self.done;
        match at {
            // At most half of the draws exceed the median.
            0 => Target::AtMost(50),
            // Part of the draws does not bound the longest of all.
            _ if done < draws => Target::NoneOf(usize::MAX),
            _ => Target::NoneOf(1),
        }
    }
}

fn outcome_cell(outcome: Option<Outcome>) -> String {
    outcome.map_or_else(String::new, |outcome| outcome.to_string())
}

fn in_words(rate: Rate) -> String {
    let [low, high] = rate.interval.map(|end| 100.0 * end);
    let share = rate.share.map_or_else(String::new, |share| format!(", {:.0} %", 100.0 * share));
    format!("{}/{}{share} ({low:.0} to {high:.0} %)", rate.count, rate.of)
}

type IsCase<'a> = &'a dyn Fn(&Case) -> bool;

/// The rate of the cases of `all` for which `is` holds.
fn row(
    name: &'static str,
    wanted: [Target; 2],
    worlds: &[Vec<Case>; 2],
    all: IsCase<'_>,
    is: IsCase<'_>,
) -> Row {
    let of_world = |world: &Vec<Case>| Rate::of(world.iter().filter(|case| all(case)), is);
    Row::new(name, worlds.each_ref().map(of_world), wanted)
}

fn rows(worlds: &[Vec<Case>; 2]) -> Vec<Row> {
    use Target::{AtLeast, AtMost, Between, Component, NoneOf, Reported};

    let single = |case: &Case| case.kind == Kind::Single && is_clear(case);
    let ordinary = |case: &Case| single(case) && !case.foreign_form && !case.beyond_drawn;
    let other = |case: &Case| single(case) && !ordinary(case);
    let foreign = |case: &Case| single(case) && case.foreign_form && !case.beyond_drawn;
    let strong = |case: &Case| over_limit(case).is_some_and(|ratio| ratio >= STRONG);
    let named = |case: &Case| hidden(case).right;
    let resembled = |case: &Case| named(case) || case.judgement.resembled;
    let where_right = |case: &Case| hidden(case).where_right;
    let right_alone = |case: &Case| case.judgement.alone && where_right(case);
    let null = |case: &Case| case.kind == Kind::Null;
    let outside = |case: &Case| case.judgement.called == "outside";
    let off = |case: &Case| !case.parameter_errors.is_empty();
    let much_off = |case: &Case| case.parameter_errors.iter().any(|off| *off > MUCH_OFF);
    let pair = |case: &Case| case.kind == Kind::Pair && case.separable;
    let triple = |case: &Case| case.kind == Kind::Triple && case.separable;
    let all_named = |case: &Case| case.judgement.hidden.iter().all(|judged| judged.right);
    let no_third = |case: &Case| case.judgement.too_many == 0;
    let of_form = |foreign: bool| {
        let reported = |case: &Case| -> Vec<bool> {
            let counts = case.kind == Kind::Single && case.foreign_form == foreign;
            let numbers =
                case.judgement.hidden.first().filter(|_| counts).map_or(&[][..], |judged| &judged.numbers);
            numbers.iter().filter_map(|number| number.covered).collect()
        };
        worlds.each_ref().map(|world| Rate::of(world.iter().flat_map(reported), |covered| covered))
    };
    let row = |name, wanted, all: IsCase<'_>, is: IsCase<'_>| row(name, wanted, worlds, all, is);
    let part = [Component; 2];
    vec![
        row("one effect of the catalogue's form: class named", [AtLeast(97), AtLeast(88)], &ordinary, &named),
        row("the same, named or resembled", part, &ordinary, &resembled),
        row("the catalogue's form, 3 to 10 limits", part, &|case| ordinary(case) && !strong(case), &named),
        row("the same, 10 limits and more", part, &|case| ordinary(case) && strong(case), &named),
        row(
            "another form, or beyond the drawn range: class named",
            [AtLeast(92), AtLeast(80)],
            &other,
            &named,
        ),
        row("the same, named or resembled", part, &other, &resembled),
        row("another form, within the drawn range: class named", part, &foreign, &named),
        row(
            "beyond the drawn range, whatever the form: class named",
            part,
            &|case| single(case) && case.beyond_drawn,
            &named,
        ),
        row("one effect: name, place, nothing beside", [AtLeast(92), AtLeast(75)], &single, &right_alone),
        row(
            "class named: place and element right",
            [AtLeast(97), AtLeast(92)],
            &|case| single(case) && named(case),
            &where_right,
        ),
        row("nothing hidden: a name, or no report", [NoneOf(200), AtMost(5)], &null, &|case| {
            !is_no_name(case)
        }),
        row("nothing hidden: said to be outside the catalogue", part, &null, &outside),
        row("nothing hidden: a parameter off that the file has right", [AtMost(2), AtMost(10)], &null, &off),
        row("the same by more than 2 % of its value", [Component, NoneOf(200)], &null, &much_off),
        row("two effects: both classes named", [AtLeast(88), AtLeast(70)], &pair, &all_named),
        row("two effects: no third", [AtLeast(95), AtLeast(90)], &pair, &no_third),
        row("three effects: all classes named", [AtLeast(60), Reported], &triple, &all_named),
        Row::new(
            "numbers within two standard errors, catalogue's form",
            of_form(false),
            [Between(93, 97), AtLeast(85)],
        ),
        Row::new("the same, another form", of_form(true), [AtLeast(85); 2]),
    ]
}

fn left_out_rows(worlds: &[Vec<Case>; 2]) -> Vec<Row> {
    use Target::{AtLeast, Reported};

    let is = |case: &Case, is: &dyn Fn(&LeaveOutJudgement) -> bool| case.left_out.as_ref().is_some_and(is);
    let closed = |case: &Case| case.judgement.claimed_joint_ratio.is_some_and(|ratio| ratio >= STILL_CLOSED);
    let remembers = |case: &Case| is(case, &|left| left.with_memory);
    let forgets = |case: &Case| !remembers(case);
    let unnamed = |case: &Case| is(case, &|left| left.no_wrong_name);
    let located = |case: &Case| is(case, &|left| left.balance_right && left.variable_right);
    let row = |name, wanted, all: IsCase<'_>, is: IsCase<'_>| row(name, wanted, worlds, all, is);
    vec![
        row("left out: no wrong name", [AtLeast(94), AtLeast(88)], &|_| true, &unnamed),
        row(
            "left out: balance, and variable among the first two",
            [AtLeast(85), AtLeast(75)],
            &|_| true,
            &located,
        ),
        row("left out: 60 % of the gap closed, without memory", [AtLeast(95), Reported], &forgets, &closed),
        row("left out: 60 % of the gap closed, with memory", [AtLeast(70), Reported], &remembers, &closed),
    ]
}

#[cfg(test)]
mod tests;
