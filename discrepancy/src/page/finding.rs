//! Findings in full: effects with numbers and alternatives, parameters, terms outside the catalogue, next experiment.

use super::{candidates, words};
use crate::outside::SHIFTS;
use crate::report::{
    Curve, Dependence, LocatedTerm, LocatedVariable, NamedEffect, Quantity, Report, Surface,
    UncataloguedTerm, Verdict, listed,
};
use model_fit::estimator::Convergence;
use pagekit::markup::{Cell, charts, heading, number, paragraph, table, words as text_cell};
use pagekit::plot::{Plot, Sample, figure, range};
use plant::effects::sheet;

pub(super) fn title(report: &Report) -> &'static str {
    match report.verdict {
        Verdict::NothingMissing if report.small.is_empty() => "Nothing above these limits",
        Verdict::NothingMissing | Verdict::BadData => "What was found",
        Verdict::ParametersOnly => "What is off",
        Verdict::Named => "What is missing",
        Verdict::Ambiguous => "What it can be",
        Verdict::OutsideCatalogue => "What it looks like",
    }
}

pub(super) fn finding(report: &Report) -> String {
    let mut text = String::new();
    if report.is_rig_file_enough() {
        text += &paragraph(
            "The rig file explains the records as well as their noise lets anything do. An effect above its limit below would \
             have shown; a smaller one may be there.",
        );
        text += &candidates::limits_table(report);
    }
    for named in &report.named {
        text += &effect(report, named);
    }
    if !report.small.is_empty() {
        text += &heading("Smaller effects");
        text += &paragraph(
            "Too small to be named. They are part of the model, and the extended rig file has them: a real \
             machine differs from its rig file by many of these.",
        );
        text += &effects_table(report, ("Smaller effects", "effect"), &report.small);
    }
    if !report.parameters.is_empty() {
        if !report.named.is_empty() {
            text += &heading("Numbers of the rig file that are off");
        }
        let about = "No effect is missing for these: the model is right, its numbers are not.";
        if report.verdict == Verdict::ParametersOnly && report.small.is_empty() {
            text += &paragraph(about);
        }
        text += &quantities("Parameters", "parameter", &report.parameters, |_| String::new());
    }
    if !report.insignificant.is_empty() {
        let why = if report.verdict == Verdict::OutsideCatalogue {
            "while something is missing, whether they are off cannot be told"
        } else {
            "by too little to call them off"
        };
        text +=
            &paragraph(&format!("Moved along with the fit, {why}; the extended rig file has them as well:"));
        text += &quantities("Moved along", "parameter", &report.insignificant, |_| String::new());
    }
    if let Some(doubt) = report.fit.and_then(Convergence::doubt) {
        text += &paragraph(&format!("Numbers of the model with care: {doubt}."));
    }
    if let Some(outside) = &report.outside {
        text += &unknown(outside);
    }
    if let Some(nearest) = &report.nearest {
        text += &heading("The nearest effect of the catalogue");
        text += &effect(report, nearest);
    }
    if let Some(remaining) = &report.remaining {
        text += &heading("What is left");
        text += &paragraph(&format!(
            "With it the model still disagrees in this balance: {}. It depends on:",
            words::balance(&remaining.balance)
        ));
        text += &located_variables("Dependence of what is left", remaining);
    }
    text
}

/// The law of an effect of the catalogue, or of a suspect beside it.
fn law(report: &Report, effect: &NamedEffect) -> Option<String> {
    let suspect = report.suspects.iter().find(|suspect| suspect.is(effect));
    let declared = suspect.map(|suspect| format!("adds {} to {}", suspect.add, suspect.adds_to));
    declared.or_else(|| Some(sheet(&effect.effect)?.law.to_owned()))
}

fn effect(report: &Report, named: &NamedEffect) -> String {
    let place = words::place(&named.effect, &named.place);
    let mut text = heading(&format!("{} at the {place}", named.effect));
    if let Some(law) = law(report, named) {
        text += &paragraph(&format!(
            "{}. It explains {} of the log misfit that the rig file leaves there.",
            sentence(&law),
            words::percent(named.share_explained)
        ));
    }
    text += &numbers(named);
    if let Some(variation) = named.amplitude_variation {
        text += &paragraph(&format!(
            "Stretches of the records differ by {} in the amplitude that they ask for, noise aside; a wrong law needs another \
             amplitude in each.",
            words::percent(variation)
        ));
    }
    if !named.alternatives.is_empty() {
        text += &paragraph("These records do not distinguish it from:");
        text += &effects_table(report, ("Alternatives", "it can be as well"), &named.alternatives);
    }
    text
}

/// Effects with their numbers, a row each; `head` stands above their names.
fn effects_table(report: &Report, (label, head): (&str, &str), effects: &[NamedEffect]) -> String {
    let row = |one: &NamedEffect| {
        vec![
            Cell::About(one.effect.clone(), law(report, one).unwrap_or_default()),
            text_cell(words::place(&one.effect, &one.place)),
            text_cell(words::numbers(one)),
            number(words::percent(one.share_explained)),
        ]
    };
    table(label, &[head, "where", "numbers", "share of the log misfit"], effects.iter().map(row))
}

fn numbers(named: &NamedEffect) -> String {
    let sheet = sheet(&named.effect);
    let meaning = |name: &str| {
        let key = sheet.and_then(|sheet| sheet.keys.iter().find(|key| key.name == name));
        key.map_or(String::new(), |key| key.meaning.to_owned())
    };
    quantities("Numbers of the effect", "number", &named.parameters, meaning)
}

/// Numbers with their errors and the values of the rig file.
fn quantities(label: &str, head: &str, all: &[Quantity], meaning: impl Fn(&str) -> String) -> String {
    let is_in_file = all.iter().any(|quantity| quantity.before.is_some());
    let row = |quantity: &Quantity| {
        let mut cells = vec![
            Cell::About(quantity.name.clone(), meaning(&quantity.name)),
            number(words::quantity(quantity)),
        ];
        if is_in_file {
            let before =
                quantity.before.map(|before| words::with_unit(&words::short(before), &quantity.unit));
            cells.push(number(before.unwrap_or_else(|| words::NOT_MEASURED.to_owned())));
        }
        cells
    };
    let heads = [head, "from the records", "in the rig file"];
    table(label, &heads[..if is_in_file { 3 } else { 2 }], all.iter().map(row))
}

/// With a capital and without its full stop.
fn sentence(law: &str) -> String {
    let mut letters = law.trim_end_matches('.').chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// The variables that the disagreement of a balance depends on, the strongest first.
pub(super) fn located_variables(label: &str, term: &LocatedTerm) -> String {
    let row = |one: &LocatedVariable| {
        let evidence = one.log_evidence.map_or_else(|| words::NOT_MEASURED.to_owned(), words::short);
        vec![text_cell(&one.variable), number(words::percent(one.share)), number(evidence)]
    };
    table(label, &["variable", "explains", "log evidence"], term.variables.iter().map(row))
}

/// The variables that an unknown input depends on, the strongest first.
fn dependence(label: &str, variables: &[Dependence]) -> String {
    let rows = variables.iter().map(|one| {
        // Smallest p value: no shifted series reached R2.
        let least = 1.0 / (SHIFTS + 1) as f64;
        let chance =
            if one.p_value <= least { format!("none of {SHIFTS}") } else { words::percent(one.p_value) };
        vec![text_cell(&one.variable), number(words::percent(one.r2.max(0.0))), number(chance)]
    });
    table(label, &["variable", "explains, on data it was not fitted on", "shuffled data reach that"], rows)
}

fn unknown(outside: &UncataloguedTerm) -> String {
    let mut text = paragraph(&format!(
        "No effect of the catalogue explains it. It is in this balance: {}. It depends on:",
        words::balance(&outside.balance)
    ));
    text += &dependence("Dependence", &outside.variables);
    if let Some(formula) = &outside.formula {
        text += &format!(
            "<p>A formula that fits: <code style=\"font-size:1.1rem\">{}</code></p>\n",
            pagekit::page::escaped(formula)
        );
    } else {
        text += &paragraph("No short formula fits.");
    }
    text += &paragraph(&table_added(outside));
    let curve = outside.curve.as_ref().map(|curve| {
        curve_figure("outside-curve", &format!("What is missing over {}", curve.variable), curve)
    });
    let pictures: Vec<String> =
        curve.into_iter().chain(outside.surface.as_ref().map(surface_figure)).collect();
    if !pictures.is_empty() {
        text += &charts(&pictures);
    }
    text
}

/// Whether the extended rig file has it, in a sentence.
fn table_added(outside: &UncataloguedTerm) -> String {
    if !outside.added {
        let why = outside.why_not.as_ref().map_or(String::new(), |why| format!(": {why}"));
        return format!("It is not added to the model{why}.");
    }
    let tables: Vec<String> = outside
        .tables
        .iter()
        .map(|table| format!("{} over {}", words::balance(&table.balance), table.variable))
        .collect();
    let share = outside.share_explained.map_or(String::new(), |share| {
        format!("; that takes {} of the log misfit of the training records", words::percent(share))
    });
    format!("It is added to the model as a table: {}{share}.", listed(&tables))
}

/// A surface as a curve for each value of its second variable.
fn surface_figure(surface: &Surface) -> String {
    const LINES: [&str; 3] = ["line s0", "line s1", "line s2"];
    let [first, second] = &surface.variables;
    let ((x_unit, x_factor), (z_unit, z_factor)) =
        (words::display_unit(&surface.variable_units[0]), words::display_unit(&surface.variable_units[1]));
    let (y_unit, y_factor) = words::shown_small(&surface.unit);
    let all = surface.value.iter().flatten().flatten().map(|value| value * y_factor);
    let at = surface.at[0].iter().map(|at| at * x_factor);
    let (Some(x), Some(y)) = (range(at.clone()), range(all.chain([0.0]))) else { return String::new() };
    let mut plot = Plot::new(x, y, &labelled(first, &x_unit), &labelled("unknown input", &y_unit));
    plot.level(0.0);
    let mut legend = Vec::new();
    for ((row, value), line) in surface.value.iter().zip(&surface.at[1]).zip(LINES) {
        let values = row.iter().map(|value| value.map_or(f64::NAN, |value| value * y_factor));
        plot.line(line, at.clone().zip(values));
        legend.push((Sample::Line(line), format!("{second} {} {z_unit}", words::short(value * z_factor))));
    }
    let legend: Vec<(Sample, &str)> =
        legend.iter().map(|(sample, name)| (*sample, name.trim_end())).collect();
    let caption = format!("What is missing over {first}, by {second}");
    figure(
        &caption,
        "",
        &legend,
        &plot.drawn("outside-surface", &caption, &format!("{} curves.", legend.len())),
    )
}

fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") }
}

pub(super) fn curve_figure(identifier: &str, caption: &str, curve: &Curve) -> String {
    let (x_unit, x_factor) = words::display_unit(&curve.variable_unit);
    let (y_unit, y_factor) = words::shown_small(&curve.unit);
    let scaled =
        |values: &[f64], factor: f64| -> Vec<f64> { values.iter().map(|value| value * factor).collect() };
    let (at, value) = (scaled(&curve.at, x_factor), scaled(&curve.value, y_factor));
    let band = scaled(&curve.band, y_factor);
    let with = |sign: f64| -> Vec<f64> {
        value
            .iter()
            .zip(band.iter().chain(std::iter::repeat(&0.0)))
            .map(|(value, band)| value + sign * band)
            .collect()
    };
    let (low, high) = (with(-1.0), with(1.0));
    let (Some(x), Some(y)) =
        (range(at.iter().copied()), range(low.iter().chain(&high).copied().chain([0.0])))
    else {
        return String::new();
    };
    let mut plot = Plot::new(x, y, &labelled(&curve.variable, &x_unit), &labelled("unknown input", &y_unit));
    plot.band(&at, &low, &high);
    plot.level(0.0);
    plot.line("line s0", at.iter().copied().zip(value.iter().copied()));
    let count = format!("{} values.", at.len());
    figure(
        caption,
        "",
        &[(Sample::Line("line s0"), "unknown input"), (Sample::Area("area"), "\u{b1} 2 standard errors")],
        &plot.drawn(identifier, caption, &count),
    )
}

pub(super) fn next(report: &Report) -> String {
    let Some(next) = &report.next else { return String::new() };
    let mut text = paragraph(&next.reason);
    if let Some(experiment) = &next.experiment {
        let probability =
            next.probability.zip(next.probability_interval).map_or(String::new(), |(value, of)| {
                format!(
                    " It tells them apart with a probability of {:.0} % ({:.0} to {:.0} %), if one of these explanations \
                     is exact.",
                    1e2 * value,
                    1e2 * of[0],
                    1e2 * of[1]
                )
            });
        let then = next.then.as_ref().map_or(String::new(), |then| {
            format!(
                " If the records still leave it open, <code>{}</code> is next: both together tell them apart with a \
                 probability of {:.0} %, if one of them is exact.",
                pagekit::page::escaped(&then.experiment),
                1e2 * then.probability
            )
        });
        text += &format!(
            "<p>Run <code>{}</code>, which stands beside this page.{probability}{then}</p>\n",
            pagekit::page::escaped(experiment)
        );
    }
    if let Some(otherwise) = &next.otherwise {
        text += &paragraph(otherwise);
    }
    text
}
