//! The page of a model file: what was found, the record with both models, suspects, numbers, equations.

use super::adequacy::Residual;
use super::explain::in_words;
use super::held_out::Traces;
use super::judge::share_in_words;
use super::report::{ModelReport, ParameterEstimate, ResidualComparison, SuspectJudgement, significant};
use super::term_curves::{Bin, TermCurve};
use super::typeset;
use model::Model;
use pagekit::markup::{Cell, charts, number, paragraph, section, table, words};
use pagekit::page::{document, escaped};
use pagekit::plot::{Plot, Sample, figure, range};
use std::ops::Range;

/// Rows of a picture; of a longer record the stretch around the largest difference is drawn.
const DRAWN_ROWS: usize = 1500;
/// Length of that stretch.
const STRETCH_ROWS: usize = 400;

pub(crate) fn page(
    models @ (model, _): (&Model, &Model),
    report: &ModelReport,
    (traces, curves): (&[Traces], &[TermCurve]),
    not_judged: Option<&str>,
) -> String {
    let mut head =
        format!("<h1>{}</h1>\n<p class=\"lead\">{}.</p>\n", escaped(&report.name), escaped(&report.headline));
    if let Some(why) = not_judged {
        head += &paragraph(&format!("The held-out record was not judged: {why}."));
    }
    let (unreached, notes) = report.notes.split_at(report.unreached.min(report.notes.len()));
    head.extend(
        unreached.iter().map(|note| paragraph(&format!("{}{}", note[..1].to_uppercase(), &note[1..]))),
    );
    let notes = match notes.is_empty() {
        true => String::new(),
        false => pagekit::markup::list(notes, ""),
    };
    let searched =
        if report.taken_back { "What a search found, and is taken back" } else { "What a search found" };
    let sections = [
        ("notes", "Notes", notes),
        ("records", "Measured, and both models", pictures(model, report, traces)),
        ("named", named_title(report), named(report)),
        ("term-curves", "What it looks like", term_curves(curves)),
        ("located", "Where it comes from", located(report)),
        ("discovered", searched, discovered(report)),
        (
            "held-out",
            "On held-out records",
            residual_table("Held-out records", &report.held_out) + &alternatives(report),
        ),
        (
            "training",
            "On the training records",
            residual_table("Training records", &report.training) + &residuals(&report.residuals),
        ),
        ("suspects", "Suspects, the most likely first", suspects(&report.suspects)),
        ("parameters", "Numbers of the model", numbers(&report.parameters)),
        ("structure", "What these records can tell apart", structure(report)),
        ("equations", "The model", equations(models, report)),
    ];
    let body: String = sections
        .iter()
        .filter(|(_, _, markup)| !markup.trim().is_empty())
        .map(|(name, title, markup)| section(name, title, markup))
        .collect();
    let version = report.schema_version;
    document(
        &report.name,
        &format!(
            "{head}<main>\n{body}</main>\n<footer class=\"page-foot\">\n<p>Schema version {version}. The same for programs is in \
             report.json beside this page. ± is one standard error.</p>\n</footer>\n"
        ),
    )
}

fn pictures(model: &Model, report: &ModelReport, traces: &[Traces]) -> String {
    let is_held_out = !report.held_out.is_empty();
    let mut all = Vec::new();
    for (record, trace) in traces.iter().enumerate().take(4) {
        for (output, series) in trace.outputs.iter().enumerate() {
            let what = &model.outputs[output];
            let scaled = series
                .each_ref()
                .map(|values| values.iter().map(|value| value / what.unit.factor).collect::<Vec<_>>());
            let rows = rows(&scaled);
            let label = format!("{} {}", what.name, what.unit.text);
            let identifier = format!("record-{record}-{output}");
            let kind = if is_held_out { "held out" } else { "fitted" };
            let start = match trace.first_row {
                0 => String::new(),
                rows => format!(" (its first {rows} samples are for its start)"),
            };
            let caption = format!("{}, {kind}{start}: {}", trace.record, what.name);
            let time_s = &trace.time_s[rows.clone()];
            let of = |which: usize| scaled[which][rows.clone()].to_vec();
            let residual =
                |which: usize| rows.clone().map(|row| scaled[0][row] - scaled[which][row]).collect();
            all.push(lines_over_time(
                (&identifier, &caption, &label),
                "Measured, the model alone and the extended model over time.",
                time_s,
                &[of(0), of(1), of(2)],
            ));
            all.push(lines_over_time(
                (&format!("{identifier}-left"), &format!("{caption}, measured minus model"), &label),
                "What both models leave over time.",
                time_s,
                &[residual(1), residual(2)],
            ));
        }
    }
    charts(&all)
}

/// Each term over its variable.
fn term_curves(curves: &[TermCurve]) -> String {
    let drawn = curves.iter().enumerate().filter_map(|(place, curve)| {
        let column = |value: &dyn Fn(&Bin) -> f64| curve.bins.iter().map(value).collect::<Vec<f64>>();
        let [x, least, mean, most] = [
            column(&|bin| bin.x),
            column(&|bin| bin.least),
            column(&|bin| bin.mean),
            column(&|bin| bin.most),
        ];
        let side = |sign: f64| {
            let error = |bin: &Bin| Some(bin.mean + sign * 2.0 * bin.error?);
            curve.bins.iter().map(error).collect::<Option<Vec<f64>>>()
        };
        let band = side(-1.0).zip(side(1.0));
        let of_band = band.iter().flat_map(|(low, high)| low.iter().chain(high));
        let bounds = range(least.iter().chain(&most).chain(of_band).copied())?;
        let (x_label, y_label) =
            (labelled(&curve.variable, &curve.variable_unit), labelled(&curve.suspect, &curve.unit));
        let mut plot = Plot::new((x[0], x[x.len() - 1]), bounds, &x_label, &y_label);
        let mut legend =
            vec![(Sample::Line("line s0"), "mean"), (Sample::Line("line r0"), "smallest, largest")];
        if let Some((low, high)) = &band {
            plot.band(&x, low, high);
            legend.insert(1, (Sample::Area("area"), "± 2 standard errors of its numbers"));
        }
        for edge in [&least, &most] {
            plot.line("line r0", x.iter().copied().zip(edge.iter().copied()));
        }
        plot.line("line s0", x.iter().copied().zip(mean));
        let instead =
            curve.instead_of.as_ref().map_or(String::new(), |named| format!(" in place of {named}"));
        let caption = format!("{}{instead} at {}, over {}", curve.suspect, curve.place, curve.variable);
        let without =
            if band.is_some() { "" } else { " The records do not determine its numbers: it has no band." };
        let TermCurve { variable, .. } = curve;
        let most = if curve.is_most { "what most of it depends on" } else { "a variable that it depends on" };
        let about = format!(
            "Along the training records as the model with it has them; {variable} is {most} ({:.0} % of its variance).{without}",
            curve.share * 100.0
        );
        let drawing = plot.drawn(
            &format!("term-{place}"),
            &caption,
            "The term over its variable, with its standard errors and the spread of its values.",
        );
        Some(figure(&caption, &about, &legend, &drawing))
    });
    charts(&drawn.collect::<Vec<_>>())
}

fn labelled(name: &str, unit: &str) -> String {
    if unit == "1" { name.into() } else { format!("{name} {unit}") }
}

/// All rows, or the stretch around the largest difference of the model alone.
fn rows(series: &[Vec<f64>; 3]) -> Range<usize> {
    let count = series[0].len();
    if count <= DRAWN_ROWS {
        return 0..count;
    }
    let difference = |row: &usize| (series[0][*row] - series[1][*row]).abs();
    let worst = (0..count).filter(|row| difference(row).is_finite());
    let worst = worst.max_by(|a, b| difference(a).total_cmp(&difference(b))).unwrap_or(0);
    let first = worst.saturating_sub(STRETCH_ROWS / 2).min(count - STRETCH_ROWS);
    first..first + STRETCH_ROWS
}

const LINES: [(&str, &str); 3] = [("line s0", "measured"), ("line s1", "model"), ("line s2", "extended")];

/// A picture of the last of [`LINES`], as many as there are values.
fn lines_over_time(
    (identifier, caption, label): (&str, &str, &str),
    description: &str,
    time_s: &[f64],
    values: &[Vec<f64>],
) -> String {
    let Some(bounds) = range(values.iter().flatten().copied()) else { return String::new() };
    let mut plot = Plot::new((time_s[0], time_s[time_s.len() - 1]), bounds, "time s", label);
    let lines = &LINES[LINES.len() - values.len()..];
    for ((look, _), values) in lines.iter().zip(values) {
        plot.line(look, time_s.iter().copied().zip(values.iter().copied()));
    }
    let legend: Vec<_> = lines.iter().map(|(look, name)| (Sample::Line(look), *name)).collect();
    figure(caption, "", &legend, &plot.drawn(identifier, caption, description))
}

fn named(report: &ModelReport) -> String {
    let rows = report.named.iter().map(|one| {
        vec![
            words(&one.suspect),
            words(&one.place),
            words(&one.term),
            number(format!("{:.1} %", one.share_explained * 100.0)),
            words(if one.alternatives.is_empty() { "none".into() } else { one.alternatives.join(", ") }),
        ]
    });
    let heads = ["suspect", "place", "term", "of what is left, on folds", "as good"];
    table(named_title(report), &heads, rows)
}

fn named_title(report: &ModelReport) -> &'static str {
    if report.taken_back { "What was named, and is taken back" } else { "What is missing" }
}

fn discovered(report: &ModelReport) -> String {
    let rows = report.discovered.iter().map(|one| {
        let others = if one.alternatives.is_empty() { "none".into() } else { one.alternatives.join("; ") };
        vec![
            Cell::Sentence(report.in_words(one)),
            Cell::Sentence(one.term.clone()),
            words(one.variables.join(", ")),
            number(format!("{:.1} %", one.share_explained * 100.0)),
            number(format!("{:.0} %", one.stability * 100.0)),
            Cell::Sentence(others),
        ]
    });
    let heads =
        ["term", "how it stands there", "reads", "of what is left, on folds", "best in halves", "as good"];
    table("Terms that no suspect describes", &heads, rows)
}

fn located(report: &ModelReport) -> String {
    report.located_in_words().map_or_else(String::new, |located| paragraph(&sentence(&located)))
}

fn residual_table(label: &str, all: &[ResidualComparison]) -> String {
    let rows = all.iter().map(|one| {
        vec![
            words(&one.record),
            words(&one.output),
            number(format!("{} {}", significant(one.rms_before), one.unit)),
            number(format!("{} {}", significant(one.rms_after), one.unit)),
            number(one.ratio.map_or_else(String::new, significant)),
            number(one.rows.to_string()),
        ]
    });
    table(label, &["record", "output", "model, rms", "extended, rms", "ratio", "samples"], rows)
}

fn alternatives(report: &ModelReport) -> String {
    let rows = report.held_out_alternatives.iter().map(|one| {
        let value = |value: f64| number(format!("{} {}", significant(value), one.residual.unit));
        vec![
            words(&one.suspect),
            words(&one.instead_of),
            words(&one.residual.record),
            words(&one.residual.output),
            value(one.residual.rms_before),
            value(one.residual.rms_after),
            number(one.residual.ratio.map_or_else(String::new, significant)),
        ]
    });
    let heads = ["with", "in place of", "record", "output", "model, rms", "extended, rms", "ratio"];
    table("What explains the training records as well", &heads, rows)
}

fn residuals(all: &[Residual]) -> String {
    let rows = all.iter().map(|one| {
        let value = |value: f64| number(format!("{} {}", significant(value), one.unit));
        let noise = if one.is_noise_declared { "declared" } else { "by differences of neighbours" };
        vec![
            words(&one.output),
            value(one.rms),
            value(one.signal_rms),
            Cell::About(format!("{} {}", significant(one.noise), one.unit), noise.into()),
            value(one.model_error_rms),
            words(if one.is_noise { "mostly noise" } else { "more than noise" }),
        ]
    });
    let heads = [
        "output",
        "left, rms",
        "signal, standard deviation",
        "noise",
        "declared model error",
        "what is left",
    ];
    table("What is left, and its noise", &heads, rows)
}

fn suspects(all: &[SuspectJudgement]) -> String {
    let rows = all.iter().map(|one| {
        let name = if one.is_decoy { format!("{} (decoy)", one.suspect) } else { one.suspect.clone() };
        let values: Vec<String> = one
            .numbers
            .iter()
            .map(|value| format!("{} {} {}", value.name, significant(value.value), value.unit))
            .collect();
        vec![
            Cell::About(name, one.place.clone()),
            number(format!("{:.1} %", one.probability * 100.0)),
            number(format!("{:.1}, {:.1}", one.gain, one.penalty)),
            number(share_in_words(one.share)),
            Cell::Sentence(one.decision.clone()),
            Cell::Sentence(values.join(", ")),
        ]
    });
    let heads =
        ["suspect", "probability", "gain, penalty", "on folds, of what is left", "decision", "numbers"];
    table("Suspects beside the model alone", &heads, rows)
}

fn numbers(all: &[ParameterEstimate]) -> String {
    let rows = all.iter().map(|one| {
        let error =
            one.standard_error.map_or("not determined".into(), |error| format!("± {}", significant(error)));
        let error = if one.is_at_bound { "none".to_owned() } else { error };
        let bound = if one.is_at_bound { "at the end of its range" } else { "" };
        vec![
            Cell::About(one.name.clone(), bound.into()),
            number(significant(one.value)),
            number(error),
            words(&one.unit),
            number(one.baseline.map_or_else(String::new, significant)),
        ]
    });
    table("Numbers of the extended model", &["number", "value", "error", "unit", "without the term"], rows)
}

fn structure(report: &ModelReport) -> String {
    let structure = &report.structure;
    let idle = structure.without_effect.iter().map(|name| format!("{name} changes no output."));
    let is_moved = |name: &&String| !structure.without_effect.contains(name);
    let undetermined = structure.undetermined.iter().filter(is_moved);
    let undetermined = undetermined.map(|name| format!("{name} is not determined."));
    let hidden = structure.hidden.iter().filter(is_moved);
    let hidden = hidden.map(|name| format!("{name} looks like a change of the model's own numbers."));
    let twins = structure.twins.iter().map(|twins| {
        let [one, other] = &twins.suspects;
        let is_other = |name: &String| name == one || name == other;
        let named = report.named.iter().find(|named| is_other(&named.suspect));
        let told = match named {
            Some(named) if named.alternatives.iter().any(is_other) => ", and so say the fits",
            Some(_) => "; the fits tell them apart by what they leave",
            None => "",
        };
        format!(
            "{one} and {other} do the same to these records at their first values (cosine {:.3}){told}.",
            twins.cosine
        )
    });
    let advice = structure.advice.iter().map(|advice| sentence(&advice.in_words()));
    let all: Vec<String> = idle.chain(undetermined).chain(hidden).chain(twins).chain(advice).collect();
    pagekit::markup::list(&all, "Every number, and every suspect from each other.")
}

/// Those of the extended model; `extended` has the terms of a search among its suspects.
fn equations((model, extended): (&Model, &Model), report: &ModelReport) -> String {
    let named = report.named.iter().map(|one| one.suspect.as_str());
    let named: Vec<&str> = named.chain(report.discovered.iter().map(|one| one.name.as_str())).collect();
    let about = match (named.as_slice(), report.taken_back) {
        ([], _) => String::new(),
        (all, false) => paragraph(&format!("Marked: {}, beside the model of the file.", all.join(" and "))),
        (all, true) => paragraph(&format!("Marked, and taken back: {}.", all.join(" and "))),
    };
    format!(
        "{about}<div class=\"chart\">\n{}</div>\n<details>\n<summary>As text, with units and numbers</summary>\n<pre>{}</pre>\n\
         </details>\n",
        typeset::equations(extended, &named),
        escaped(&in_words(model))
    )
}

/// With a capital and a full stop.
fn sentence(words: &str) -> String {
    let (first, rest) = words.split_at(1);
    format!("{}{rest}.", first.to_uppercase())
}
