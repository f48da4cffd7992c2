//! The equations of a model as MathML, with the terms that a report adds to them.

use model::{Change, Expression, Model, Target, mathml_name};

/// Most bytes of an equation that is set; a longer one is easier to read in the file.
const LONGEST: usize = 20_000;

/// Equations of states, definitions and outputs, and the terms of these suspects; each a block.
pub(crate) fn equations(model: &Model, named: &[&str]) -> String {
    let own = |suspect: Option<usize>| suspect.is_none();
    let states = model.states.iter().filter(|state| own(state.suspect));
    let states = states.map(|state| equation(&rate(&state.name), &set(model, &state.derivative)));
    let definitions = model.definitions.iter().filter(|one| own(one.suspect));
    let definitions = definitions.map(|one| equation(&mathml_name(&one.name), &set(model, &one.value)));
    let outputs = model.outputs.iter();
    let outputs = outputs.map(|output| equation(&mathml_name(&output.name), &set(model, &output.value)));
    let is_there = |index: &usize| {
        let suspect = &model.suspects[*index];
        suspect.is_term || named.contains(&suspect.name.as_str())
    };
    let terms = (0..model.suspects.len()).filter(is_there).map(|index| term(model, index));
    states.chain(definitions).chain(outputs).chain(terms).collect()
}

/// What a suspect makes of its place.
fn term(model: &Model, index: usize) -> String {
    let suspect = &model.suspects[index];
    let name = model.target_name(suspect.target);
    let (left, before) = match suspect.target {
        Target::State(_) => (rate(name), "<mo>…</mo>".to_owned()),
        _ => (mathml_name(name), mathml_name(name)),
    };
    let expression = set(model, &suspect.expression);
    let bracket = |bracket: char| format!("<mo stretchy=\"false\">{bracket}</mo>");
    let in_brackets = format!("<mrow>{}{expression}{}</mrow>", bracket('('), bracket(')'));
    let right = match suspect.change {
        Change::Add => format!("{before}<mo>+</mo>{in_brackets}"),
        Change::Multiply => format!("{before}<mo>⋅</mo>{in_brackets}"),
        Change::Replace => expression,
    };
    let sign = if suspect.change == Change::Replace || matches!(suspect.target, Target::State(_)) {
        "="
    } else {
        "←"
    };
    let title = pagekit::page::escaped(&suspect.name);
    format!("<p class=\"soft\">{title}</p>\n{}", block(&format!("{left}<mo>{sign}</mo>{right}")))
}

fn set(model: &Model, expression: &Expression) -> String {
    let set = model.mathml(expression);
    if set.len() > LONGEST { "<mtext>…</mtext>".into() } else { set }
}

fn rate(name: &str) -> String {
    let name = mathml_name(name);
    format!("<mfrac><mrow><mi>d</mi>{name}</mrow><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>")
}

fn equation(left: &str, right: &str) -> String {
    block(&format!("{left}<mo>=</mo>{right}"))
}

fn block(inner: &str) -> String {
    format!("<math display=\"block\" style=\"margin:.6rem 0\"><mrow>{inner}</mrow></math>\n")
}
