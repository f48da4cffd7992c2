//! Writes the extended model file: selected terms join the baseline and are refitted with it in the next run.
//!
//! Everything of the old file stays, comments too. A term's numbers stand in it for people, under `fitted`; a linear term has no
//! use for them, since the next run refits it on its records.

use super::BalanceError;
use super::model::TermEntry;
use super::terms::{shown, term};
use crate::report::Quantity;
use crate::workflow::Reported;
use records::description_error::DescriptionError;
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value, value};

/// The model file with the terms of a report; paths become absolute.
///
/// # Errors
/// [`BalanceError`] when the model file cannot be read.
pub fn extended_model_text(model_file: &Path, reported: &Reported) -> Result<String, BalanceError> {
    let open = |reason: String| DescriptionError::Open { what: "model", file: model_file.into(), reason };
    let text = DescriptionError::read("model", model_file)?;
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
        DescriptionError::Syntax { file: model_file.into(), reason: error.to_string() }
    })?;
    let folder = model_file.parent().unwrap_or(Path::new(""));
    for key in ["mapping", "rig"] {
        if let Some(path) = document.get(key).and_then(Item::as_str) {
            let path = folder.join(path);
            let path = path.canonicalize().map_err(|error| open(format!("{}: {error}", path.display())))?;
            document[key] = value(path.display().to_string());
        }
    }
    let terms = document.entry("terms").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
    let Some(terms) = terms.as_array_of_tables_mut() else {
        let reason = "terms are written as [[terms]]".into();
        return Err(DescriptionError::Syntax { file: model_file.into(), reason }.into());
    };
    let records = reported.inputs.train.join(", ");
    for effect in &reported.named {
        terms.push(entry(&effect.effect, &effect.parameters, &records));
    }
    for quantity in &reported.parameters {
        terms.push(entry(&quantity.name, std::slice::from_ref(quantity), &records));
    }
    Ok(document.to_string())
}

fn entry(effect: &str, parameters: &[Quantity], records: &str) -> Table {
    let term = entry_of(effect, parameters);
    let mut table = Table::new();
    table.decor_mut().set_prefix(format!("\n# Found on {records}.\n"));
    table["effect"] = value(effect);
    if !term.form.is_empty() {
        table["form"] = value(term.form);
    }
    if !term.shape.is_empty() {
        let shape: InlineTable =
            term.shape.iter().map(|(key, number)| (key.clone(), Value::from(*number))).collect();
        table["shape"] = value(shape);
    }
    let mut fitted = InlineTable::new();
    for quantity in parameters.iter().filter(|quantity| !term.shape.contains_key(&quantity.name)) {
        let name = quantity.name.replace("parameter:", "");
        fitted.insert(&name, quantity.value.into());
        if let Some(error) = quantity.standard_error {
            fitted.insert(format!("{name}_standard_error"), error.into());
        }
    }
    table["fitted"] = value(fitted);
    table
}

/// The term that a named effect of a report is, by the names of its numbers.
fn entry_of(effect: &str, parameters: &[Quantity]) -> TermEntry {
    let forms = ["viscous", "root", "linear", "slope", "bump", "ripple"];
    let has = |name: &str| parameters.iter().any(|quantity| quantity.name == name);
    let form = forms.into_iter().find(|form| {
        let (name, ..) = shown(&term(effect, form, &[]));
        let (plain, ..) = shown(&term(effect, "", &[]));
        // The straight line over pressure has the name that a form without a name would have.
        has(name)
            && (name != plain || (*form == "linear") == (effect == "pressure-dependent-friction"))
            && allowed(effect, form)
    });
    let keys = ["velocity_mm_per_s", "exponent", "deflection_mm", "centre_mm", "width_mm", "pitch_mm"];
    let shape = parameters.iter().filter(|quantity| keys.contains(&quantity.name.as_str()));
    let shape: Vec<(&str, f64)> = shape.map(|quantity| (quantity.name.as_str(), quantity.value)).collect();
    term(effect, form.unwrap_or(""), &shape)
}

fn allowed(effect: &str, form: &str) -> bool {
    match effect {
        "friction-asymmetry" => form == "viscous",
        "pressure-dependent-friction" => ["root", "linear"].contains(&form),
        "position-dependent-friction" | "position-dependent-force" => {
            ["slope", "bump", "ripple"].contains(&form)
        }
        _ => false,
    }
}
