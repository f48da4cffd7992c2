//! The page of a model file before any fit: its equations set, what they are made of, and its suspects, each with its own
//! equations.

use super::explain::{column, kind, value_of};
use super::report::{place, significant, term};
use super::typeset;
use model::{Hold, Input, Model, Output, Parameter, Start, State};
use pagekit::markup::{Cell, list, section, table, words};
use pagekit::page::{document, escaped};

/// The page; `records` are the lines that training records say, `text` is the whole as text.
pub(crate) fn page(model: &Model, records: &[String], text: &str) -> String {
    let is_of_model = |suspect: Option<usize>| suspect.is_none_or(|suspect| model.suspects[suspect].is_term);
    let states: Vec<&State> = model.states.iter().filter(|one| is_of_model(one.suspect)).collect();
    let parameters: Vec<&Parameter> =
        model.parameters.iter().filter(|one| is_of_model(one.suspect)).collect();
    let suspects = (0..model.suspects.len()).filter(|index| !model.suspects[*index].is_term);
    let records = match records {
        [] => String::new(),
        records => list(records, ""),
    };
    let sections = [
        (
            "equations",
            "Equations",
            format!("<div class=\"chart\">\n{}</div>\n", typeset::equations(model, &[])),
        ),
        ("inputs", "Inputs", table("Inputs", &INPUTS, model.inputs.iter().map(|one| input(model, one)))),
        ("states", "States", table("States", &STATES, states.into_iter().map(|one| state(model, one)))),
        ("outputs", "Outputs", table("Outputs", &OUTPUTS, model.outputs.iter().map(output))),
        ("parameters", "Parameters", numbers(&parameters)),
        ("suspects", "Suspects", suspects.map(|index| suspect(model, index)).collect()),
        ("records", "What the records can tell apart", records),
        ("text", "As text", format!("<pre>{}</pre>\n", escaped(text))),
    ];
    let is_empty = |name: &str| match name {
        "inputs" => model.inputs.is_empty(),
        "states" => model.states.is_empty(),
        _ => false,
    };
    let body: String = sections
        .iter()
        .filter(|(name, _, markup)| !markup.trim().is_empty() && !is_empty(name))
        .map(|(name, title, markup)| section(name, title, markup))
        .collect();
    document(&model.name, &format!("<h1>{}</h1>\n<main>\n{body}</main>\n", escaped(&model.name)))
}

const INPUTS: [&str; 4] = ["input", "unit", "from", "between samples"];
const STATES: [&str; 3] = ["state", "unit", "start"];
const OUTPUTS: [&str; 4] = ["output", "unit", "compared with", "noise"];

fn input(model: &Model, input: &Input) -> Vec<Cell> {
    let from = match input.rate_of {
        Some(of) => format!("rate of {}", model.inputs[of].name),
        None => column(&input.column, input.scale),
    };
    let between = match input.hold {
        Hold::Zero => "keeps its value",
        Hold::Linear => "straight",
    };
    vec![words(&input.name), words(&input.unit.text), words(from), words(between)]
}

fn state(model: &Model, state: &State) -> Vec<Cell> {
    let start = match state.start {
        Start::Known { value_si } => significant(value_si / state.unit.factor),
        Start::Fitted { .. } => "fitted in each record".to_owned(),
        Start::Record { output } => format!("first sample of {}", model.outputs[output].name),
        Start::Input { input } => format!("first sample of {}", model.inputs[input].name),
    };
    vec![words(&state.name), words(&state.unit.text), words(start)]
}

fn output(output: &Output) -> Vec<Cell> {
    let noise =
        output.noise_si.map_or("estimated".to_owned(), |noise| significant(noise / output.unit.factor));
    let compared = column(&output.column, output.scale);
    vec![words(&output.name), words(&output.unit.text), words(compared), words(noise)]
}

fn numbers(parameters: &[&Parameter]) -> String {
    if parameters.is_empty() {
        return String::new();
    }
    let rows = parameters.iter().map(|one| {
        let value = value_of(one);
        vec![words(&one.name), Cell::Sentence(value)]
    });
    table("Parameters", &["number", "value"], rows)
}

/// A suspect: its place and law, its equations, its numbers.
fn suspect(model: &Model, index: usize) -> String {
    let suspect = &model.suspects[index];
    let decoy = if suspect.is_decoy { ", a decoy" } else { "" };
    let about = [format!("{}: {}", place(model, index), term(model, index))];
    let about: Vec<String> = about.into_iter().chain(kind(suspect)).collect();
    let parameters: Vec<&Parameter> =
        model.parameters.iter().filter(|one| one.suspect == Some(index)).collect();
    format!(
        "<h3>{}{decoy}</h3>\n<div class=\"chart\">\n{}</div>\n{}{}",
        escaped(&suspect.name),
        typeset::of_suspect(model, index),
        list(&about, ""),
        numbers(&parameters)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const MODEL: &str = r#"
name = "A <tank>"
[inputs.pump]
unit = "V"
column = "u"
hold = "linear"
[parameters]
leak = { unit = "1/s", value = 0.1, range = [0, 2] }
[states.level]
unit = "V"
start = "level_V"
derivative = "pump/1[s] - leak*level"
[outputs.level_V]
unit = "V"
value = "level"
noise = 0.02
[[suspects]]
name = "late"
place = "level"
add = "-k*delay(level, tau)"
twins = ["other"]
parameters.k = { unit = "1/s", value = [0.1, 1] }
parameters.tau = { unit = "s", value = 2, range = [0, 9] }
[[suspects]]
use = "sensor/lag"
place = "level_V"
parameters.lag = { value = 0.5 }
"#;

    #[test]
    fn a_page_has_what_the_model_is_made_of_and_each_suspect_with_its_equations() {
        let model = Model::parse(MODEL, Path::new("m.toml")).unwrap_or_else(|error| panic!("{error}"));
        let page = page(&model, &["leak: not determined".to_owned()], "all of it");
        let markup = page.replace("<!DOCTYPE html>", "");
        let page = roxmltree::Document::parse(&markup).unwrap_or_else(|error| panic!("{error}\n{markup}"));
        let text = |node: roxmltree::Node<'_, '_>| -> Vec<String> {
            let text = node.descendants().filter(roxmltree::Node::is_text).filter_map(|one| one.text());
            text.map(|text| text.trim().to_owned()).filter(|text| !text.is_empty()).collect()
        };
        let all = |tag: &str| page.descendants().filter(|one| one.has_tag_name(tag)).collect::<Vec<_>>();
        let rows: Vec<String> = all("tr").into_iter().map(|row| text(row).join(" | ")).collect();
        for row in [
            "pump | V | column u | straight",
            "level | V | first sample of level_V",
            "level_V | V | column level_V | 0.0200",
            "leak | 0.100 1/s, fitted within 0 to 2.00",
            "tau | 2.00 s, fitted within 0 to 9.00",
        ] {
            assert!(rows.iter().any(|found| found == row), "{row}\n{rows:#?}");
        }
        let titles: Vec<&str> = all("div").iter().filter_map(|one| one.attribute("title")).collect();
        for title in [
            "dlevel/dt = pump/1[s] - leak*level",
            "level_V = level",
            "dlevel/dt = … + (-k*delay(level, tau))",
        ] {
            assert!(titles.contains(&title), "{title}\n{titles:#?}");
        }
        let lag = "dlate/dt = (level_V - late)/lag";
        assert!(titles.iter().any(|title| title.starts_with(lag)), "{titles:#?}");
        let told = text(page.root_element()).join("\n");
        for said in [
            "A <tank>",
            "does the same as other",
            "from the library: sensor/lag",
            "leak: not determined",
            "all of it",
        ] {
            assert!(told.contains(said), "{said}");
        }
    }

    #[test]
    fn a_model_without_inputs_states_and_suspects_has_no_empty_sections() {
        let model = Model::parse("[outputs.y]\nvalue = \"t/1[s]\"\n", Path::new("m.toml")).unwrap();
        let page = page(&model, &[], "");
        for name in ["inputs", "states", "parameters", "suspects", "records"] {
            assert!(!page.contains(&format!("id=\"{name}\"")), "{name}");
        }
        assert!(page.contains("id=\"outputs\""));
    }
}
