//! The model file with what was found: the terms join the baseline, and are fitted with it when it runs again.
//!
//! Everything of the old file stays, comments too. A term's numbers stand in it for people, under `fitted`; a linear term has no use for
//! them, since the next run fits it again on its own records.

use super::BalanceError;
use super::tell::entry_of;
use crate::report::{Quantity, Report};
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value, value};

/// The model file with the terms of a report; paths in it are made absolute, so that it may lie anywhere.
///
/// # Errors
/// [`BalanceError`] when the model file cannot be read.
pub fn extended_model_text(model_file: &Path, report: &Report) -> Result<String, BalanceError> {
    let open = |reason: String| BalanceError::Open { file: model_file.into(), reason };
    let text = std::fs::read_to_string(model_file).map_err(|error| open(error.to_string()))?;
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
        BalanceError::Syntax { file: model_file.into(), reason: error.to_string() }
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
        return Err(BalanceError::Syntax { file: model_file.into(), reason });
    };
    let records = report.inputs.train.join(", ");
    for effect in &report.named {
        terms.push(entry(&effect.effect, &effect.parameters, &records));
    }
    for quantity in &report.parameters {
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
            fitted.insert(&format!("{name}_standard_error"), error.into());
        }
    }
    table["fitted"] = value(fitted);
    table
}
