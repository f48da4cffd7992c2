//! The extended model file: what was named stands under `[[terms]]`, numbers are those of the fit.
//!
//! Numbers of a library are written beside its `use`. Everything else of the file stays, comments too. Terms are fitted again
//! with the model in the next run.

use super::declared::declared;
use super::discover::DiscoveredTerm;
use super::report::{ModelReport, NamedSuspect, SCHEMA_VERSION, equations};
use model::{Library, LibrarySuspect, Model};
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, value};

/// What stands above a term that a held-out record takes back.
const TAKEN_BACK: &str = "# Taken back: a held-out record gets worse with this term.";

/// Why a model file cannot be extended.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum ExtendError {
    #[error(transparent)]
    Text(#[from] toml_edit::TomlError),
    #[error("suspect {name} of the report is not in the model file: is it the report of this model?")]
    Unknown { name: String },
    #[error("the report is of another model: one of both has no '{equation}'; close this model again")]
    Other { equation: String },
    #[error("the model file was changed since its report: one of both has no '{line}'; close it again")]
    Version { line: String },
    #[error("the report has schema version {version}; this program reads {SCHEMA_VERSION}")]
    Schema { version: u32 },
    #[error("suspects and terms are written as [[suspects]] and [[terms]]")]
    Form,
}

impl ModelReport {
    /// Whether it is the report of this model, and of this version of its file: only values from which a fit starts may differ.
    ///
    /// # Errors
    /// The first line in which they differ.
    pub fn is_of(&self, model: &Model) -> Result<(), ExtendError> {
        if self.schema_version != SCHEMA_VERSION {
            return Err(ExtendError::Schema { version: self.schema_version });
        }
        if let Some(equation) = difference(&self.equations, &equations(model)) {
            return Err(ExtendError::Other { equation });
        }
        match difference(&self.declared, &declared(model)) {
            Some(line) => Err(ExtendError::Version { line }),
            None => Ok(()),
        }
    }

    /// A term, with a comment where a held-out record takes it back.
    fn marked(&self, mut term: Table) -> Table {
        if self.taken_back {
            let before = term.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or("\n").to_owned();
            term.decor_mut().set_prefix(format!("{before}{TAKEN_BACK}\n"));
        }
        term
    }
}

/// The first line that one of both lacks; none where the report, which is of before 0.1.0, has none at all.
fn difference(reported: &[String], in_file: &[String]) -> Option<String> {
    let unknown = reported.iter().find(|line| !in_file.contains(line));
    let added = in_file.iter().find(|line| !reported.contains(line));
    unknown.or(added).filter(|_| !reported.is_empty()).cloned()
}

/// The text of a model file, which stands in this folder, with what its report names. A library of the user is named by its whole
/// path, since the text may be written elsewhere.
///
/// # Errors
/// A text that is no TOML, or a report of another model.
pub fn extended(text: &str, folder: &Path, report: &ModelReport) -> Result<String, ExtendError> {
    let mut document: DocumentMut = text.parse()?;
    put(document.as_table_mut(), report, (None, folder));
    let terms = document.get_mut("terms").and_then(Item::as_array_of_tables_mut);
    for term in terms.into_iter().flat_map(ArrayOfTables::iter_mut) {
        let name = name_of(term, folder);
        put(term, report, (name.as_deref(), folder));
    }
    for NamedSuspect { suspect, .. } in &report.named {
        let suspects = document.get_mut("suspects").and_then(Item::as_array_of_tables_mut);
        let suspects = suspects.ok_or_else(|| ExtendError::Unknown { name: suspect.clone() })?;
        let is_it = |table: &Table| name_of(table, folder).as_ref() == Some(suspect);
        let place = suspects.iter().position(is_it);
        let place = place.ok_or_else(|| ExtendError::Unknown { name: suspect.clone() })?;
        let mut term = suspects.get(place).expect("it was found").clone();
        suspects.remove(place);
        put(&mut term, report, (Some(suspect), folder));
        push(&mut document, report.marked(term))?;
    }
    for DiscoveredTerm { name, text, .. } in &report.discovered {
        let text: DocumentMut = text.parse()?;
        let first = text.get("suspects").and_then(Item::as_array_of_tables).and_then(|all| all.get(0));
        let mut term = first.ok_or(ExtendError::Form)?.clone();
        put(&mut term, report, (Some(name), folder));
        push(&mut document, report.marked(term))?;
    }
    for key in ["terms", "suspects"] {
        let all = document.get_mut(key).and_then(Item::as_array_of_tables_mut);
        all.into_iter().flat_map(ArrayOfTables::iter_mut).for_each(|table| find_again(table, folder));
    }
    Ok(document.to_string())
}

fn push(document: &mut DocumentMut, term: Table) -> Result<(), ExtendError> {
    let terms = document.entry("terms").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
    terms.as_array_of_tables_mut().ok_or(ExtendError::Form)?.push(term);
    Ok(())
}

fn library_of(table: &dyn TableLike, folder: &Path) -> Option<LibrarySuspect> {
    table.get("use").and_then(Item::as_str).and_then(|used| Library::find(used, folder).ok())
}

/// Names a library of the user by its whole path.
fn find_again(table: &mut Table, folder: &Path) {
    let Some((library, suspect)) =
        table.get("use").and_then(Item::as_str).and_then(|used| used.rsplit_once('/'))
    else {
        return;
    };
    if let Ok(whole) = folder.join(library).canonicalize()
        && library.ends_with(".toml")
    {
        table["use"] = value(format!("{}/{suspect}", whole.display()));
    }
}

/// What reports call a suspect or a term: its name, else that in its library.
fn name_of(table: &dyn TableLike, folder: &Path) -> Option<String> {
    let given = table.get("name").and_then(Item::as_str);
    given.map(str::to_owned).or_else(|| library_of(table, folder).map(|found| found.entry().name.clone()))
}

/// Writes fitted numbers over the values of a table's parameters. One at an end of its range keeps that of the file.
fn put(table: &mut dyn TableLike, report: &ModelReport, (suspect, folder): (Option<&str>, &Path)) {
    let numbers = report.parameters.iter().filter(|number| number.suspect.as_deref() == suspect);
    // Numbers that stand in a library get a place of their own.
    let library = library_of(table, folder);
    let parameters = match table.get_mut("parameters") {
        None if library.is_none() => return,
        None => {
            let mut dotted = Table::new();
            dotted.set_dotted(true);
            table.entry("parameters").or_insert(Item::Table(dotted))
        }
        Some(parameters) => parameters,
    };
    let Some(parameters) = parameters.as_table_like_mut() else { return };
    for number in numbers {
        let is_of_library = library.as_ref().is_some_and(|found| found.entry().has_parameter(&number.name));
        if is_of_library && !number.is_at_bound {
            let inner = || value(InlineTable::new());
            let parameter = parameters.entry(&number.name).or_insert_with(inner);
            if let Some(parameter) = parameter.as_table_like_mut() {
                parameter.entry("value").or_insert(value(number.value));
            }
        }
        let Some(parameter) = parameters.get_mut(&number.name).and_then(Item::as_table_like_mut) else {
            continue;
        };
        if let Some(item) = parameter.get_mut("value").filter(|_| !number.is_at_bound) {
            *item = value(number.value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::ParameterEstimate;
    use super::*;

    const MODEL: &str = r#"
# A comment.
[parameters]
mass = { unit = "kg", value = 1 } # of the carriage
[[suspects]]
name = "drag"
parameters.k = { value = [1, 2], range = [0, 9] }
[[suspects]]
name = "offset"
"#;

    fn report(suspect: &str) -> ModelReport {
        let text = format!(
            r#"{{"schema_version": 1, "named": [{{"suspect": "{suspect}"}}], "parameters": [
                {{"name": "mass", "suspect": null, "value": 1.5, "is_at_bound": false}},
                {{"name": "k", "suspect": "drag", "value": 0.25, "is_at_bound": false}}]}}"#
        );
        serde_json::from_str(&text).unwrap()
    }

    impl ModelReport {
        fn with(mut self, name: &str, value: f64) -> Self {
            let suspect = Some("drag".to_owned());
            self.parameters.push(ParameterEstimate {
                name: name.into(),
                suspect,
                value,
                ..ParameterEstimate::default()
            });
            self
        }
    }

    #[test]
    fn what_is_named_becomes_a_term_with_its_number() {
        let text = extended(MODEL, Path::new(""), &report("drag")).unwrap();
        let read: toml::Table = text.parse().unwrap();
        assert_eq!(read["suspects"].as_array().unwrap().len(), 1, "{text}");
        assert_eq!(read["terms"][0]["parameters"]["k"]["value"].as_float(), Some(0.25), "{text}");
        assert_eq!(read["parameters"]["mass"]["value"].as_float(), Some(1.5), "{text}");
        assert!(text.contains("# A comment.") && text.contains("# of the carriage"), "{text}");
    }

    #[test]
    fn a_number_of_a_library_stands_with_the_term_that_uses_it() {
        let model =
            "[[suspects]]\nname = \"drag\"\nuse = \"damping/turbulent\"\nplace = \"v\"\nwith.v = \"v\"\n";
        let text = extended(model, Path::new(""), &report("drag").with("c", 2.5)).unwrap();
        let term = &text.parse::<toml::Table>().unwrap()["terms"][0];
        assert_eq!(term["parameters"]["c"]["value"].as_float(), Some(2.5), "{text}");
        assert_eq!(term["use"].as_str(), Some("damping/turbulent"), "{text}");
        // `k` of the report is no number of this suspect.
        assert!(term["parameters"].get("k").is_none(), "{text}");
        // Once more, over the number that stands there now.
        let again = extended(
            &text.replace("[[terms]]", "[[suspects]]"),
            Path::new(""),
            &report("drag").with("c", 3.5),
        )
        .unwrap();
        assert!(again.contains("3.5") && !again.contains("2.5"), "{again}");
        // Without a name of its own it is called as in the library.
        let reported: ModelReport = serde_json::from_value(serde_json::json!({
            "schema_version": 1,
            "named": [{"suspect": "turbulent"}],
            "parameters": [{"name": "c", "suspect": "turbulent", "value": 4.5, "is_at_bound": false}],
        }))
        .unwrap();
        let nameless = extended(&model.replace("name = \"drag\"\n", ""), Path::new(""), &reported).unwrap();
        let term = &nameless.parse::<toml::Table>().unwrap()["terms"][0];
        assert_eq!(term["parameters"]["c"]["value"].as_float(), Some(4.5), "{nameless}");
    }

    #[test]
    fn a_term_that_was_taken_back_is_marked() {
        let plain = extended(MODEL, Path::new(""), &report("drag")).unwrap();
        let marked =
            extended(MODEL, Path::new(""), &ModelReport { taken_back: true, ..report("drag") }).unwrap();
        assert!(marked.contains(&format!("{TAKEN_BACK}\n[[terms]]\nname = \"drag\"")), "{marked}");
        assert_eq!(marked.replace(&format!("{TAKEN_BACK}\n"), ""), plain);
    }

    #[test]
    fn the_report_of_another_model_is_refused() {
        let message = extended(MODEL, Path::new(""), &report("leak")).unwrap_err().to_string();
        assert!(message.contains("suspect leak of the report is not in the model file"), "{message}");
    }

    #[test]
    fn a_library_of_the_user_is_found_from_wherever_the_text_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let library = "about = \"\"\n[[suspects]]\nname = \"drag\"\nabout = \"\"\nadd = \"k\"\nparameters.k = { value = 1 }\n";
        std::fs::write(folder.path().join("own.toml"), library).unwrap();
        let model = "[[suspects]]\nuse = \"own.toml/drag\"\n[[suspects]]\nuse = \"damping/linear\"\nname = \"other\"\n";
        let text = extended(model, folder.path(), &report("drag")).unwrap();
        let read: toml::Table = text.parse().unwrap();
        let whole = folder.path().canonicalize().unwrap().join("own.toml/drag");
        assert_eq!(read["terms"][0]["use"].as_str(), whole.to_str(), "{text}");
        assert_eq!(read["terms"][0]["parameters"]["k"]["value"].as_float(), Some(0.25), "{text}");
        assert_eq!(read["suspects"][0]["use"].as_str(), Some("damping/linear"), "{text}");
    }
}
