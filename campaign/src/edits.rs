//! Sets numbers in the text of a TOML file by their paths, for the rig and the experiment of a run.
//!
//! ```text
//! friction.sliding_force_n            key of a table
//! valve.kv_supply_m3_per_h.3          place in a list of numbers, from 0
//! drive.set-point.1.to_m              key of a table in a list of tables, from 0
//! effects.valve-offset.drive.offset_percent   absent tables are added
//! ```
//!
//! Keys and ranges are checked by the reader of the file.
//!
//! A string value that names an existing file (a table of set-points, a library) is a file reference; in a text for another
//! folder it becomes an absolute path.

use std::path::{Path, PathBuf};
use toml_edit::visit_mut::{VisitMut, visit_value_mut};
use toml_edit::{DocumentMut, Item, Table, Value};

/// Why a number cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum EditError {
    #[error("is no TOML: {0}")]
    Form(String),
    #[error("{path}: {part} is {what}")]
    Path {
        path: String,
        part: String,
        /// What the text has there instead of a table, list or number.
        what: &'static str,
    },
}

/// The text with these numbers at their paths.
pub(crate) fn with<'a>(
    text: &str,
    numbers: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<String, EditError> {
    let mut numbers = numbers.into_iter().peekable();
    if numbers.peek().is_none() {
        return Ok(text.to_owned());
    }
    let mut document = document(text)?;
    for (path, number) in numbers {
        put(document.as_item_mut(), path, path, number)?;
    }
    Ok(document.to_string())
}

/// The existing files that the text of the file `path` names, as it spells them.
pub(crate) fn files_beside(text: &str, path: &Path) -> Result<Vec<String>, EditError> {
    let mut found = FileNames { path, names: Vec::new() };
    found.visit_document_mut(&mut document(text)?);
    Ok(found.names)
}

/// The text of the file `path` with absolute paths, for use in another folder.
pub(crate) fn moved(text: &str, path: &Path) -> Result<String, EditError> {
    let mut document = document(text)?;
    FileNames { path, names: Vec::new() }.visit_document_mut(&mut document);
    Ok(document.to_string())
}

/// The file that the one at `path` calls `name`.
pub(crate) fn sibling_path(path: &Path, name: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(name)
}

/// Collects the files that a text names and replaces them by their absolute paths.
struct FileNames<'a> {
    path: &'a Path,
    names: Vec<String>,
}

impl VisitMut for FileNames<'_> {
    fn visit_value_mut(&mut self, value: &mut Value) {
        let name = value.as_str().filter(|name| sibling_path(self.path, name).is_file());
        let whole = name.and_then(|name| std::path::absolute(sibling_path(self.path, name)).ok());
        if let (Some(name), Some(whole)) = (name, whole.as_ref().and_then(|whole| whole.to_str())) {
            self.names.push(name.to_owned());
            *value = whole.into();
        }
        visit_value_mut(self, value);
    }
}

fn document(text: &str) -> Result<DocumentMut, EditError> {
    text.parse().map_err(|error: toml_edit::TomlError| EditError::Form(error.to_string()))
}

/// Puts the number at `rest` below `item`; `path` is the whole, for messages.
fn put(item: &mut Item, path: &str, rest: &str, number: f64) -> Result<(), EditError> {
    let (part, further) = rest.split_once('.').map_or((rest, None), |(part, further)| (part, Some(further)));
    let wrong = |what| EditError::Path { path: path.to_owned(), part: part.to_owned(), what };
    match item {
        Item::Table(table) => match further {
            Some(further) => {
                let next = table.entry(part).or_insert_with(|| {
                    let mut made = Table::new();
                    made.set_implicit(true);
                    Item::Table(made)
                });
                put(next, path, further, number)
            }
            None if matches!(table.get(part), Some(Item::Table(_) | Item::ArrayOfTables(_))) => {
                Err(wrong("a table, and no number"))
            }
            None => {
                table[part] = toml_edit::value(number);
                Ok(())
            }
        },
        Item::ArrayOfTables(tables) => {
            let place = part.parse().map_err(|_| wrong("no place in a list of tables, from 0"))?;
            let table: &mut Table =
                tables.get_mut(place).ok_or_else(|| wrong("beyond the end of the list of tables"))?;
            let mut whole = Item::Table(std::mem::take(table));
            let put = further.map_or(Err(wrong("a table, and no number")), |further| {
                put(&mut whole, path, further, number)
            });
            if let Item::Table(whole) = whole {
                *table = whole;
            }
            put
        }
        Item::Value(Value::Array(list)) if further.is_none() => {
            let place: usize = part.parse().map_err(|_| wrong("no place in a list, from 0"))?;
            let value = list.get_mut(place).ok_or_else(|| wrong("beyond the end of the list"))?;
            *value = number.into();
            Ok(())
        }
        _ => Err(wrong("below something that is no table")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# kept\na = 1 # and this\n[t]\nlist = [1.0, 2.0]\n[[s.p]]\nx = 1\n[[s.p]]\nx = 2\n";

    fn number(text: &str, path: &[&str]) -> f64 {
        let whole: toml::Value = toml::from_str(text).unwrap();
        let found = path.iter().fold(&whole, |value, part| match part.parse::<usize>() {
            Ok(place) => &value[place],
            Err(_) => &value[*part],
        });
        found.as_float().unwrap()
    }

    #[test]
    fn numbers_go_where_their_paths_say_and_comments_stay() {
        let text = with(TEXT, [("a", 1.5), ("t.list.1", 3.0), ("s.p.1.x", 4.0), ("t.new", 5.0)]).unwrap();
        assert_eq!(number(&text, &["a"]), 1.5);
        assert_eq!(number(&text, &["t", "list", "1"]), 3.0);
        assert_eq!(number(&text, &["s", "p", "1", "x"]), 4.0);
        assert_eq!(number(&text, &["t", "new"]), 5.0);
        assert!(text.starts_with("# kept\n"), "{text}");
    }

    #[test]
    fn a_text_that_is_moved_names_its_files_by_their_whole_paths() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("way.csv"), "time_s,position_m\n").unwrap();
        let path = folder.path().join("e.toml");
        let text = "title = \"no file\"\n[[drive.set-point]]\nfile = \"way.csv\" # a table\n";
        assert_eq!(files_beside(text, &path).unwrap(), ["way.csv"]);
        let moved = moved(text, &path).unwrap();
        let whole = folder.path().join("way.csv").display().to_string();
        assert!(moved.contains(&format!("file = \"{whole}\"")) && moved.contains("no file"), "{moved}");
        assert_eq!(files_beside(&moved, Path::new("elsewhere/e.toml")).unwrap(), [whole]);
    }

    #[test]
    fn an_effect_is_switched_on_in_the_shipped_rig() {
        let path = "effects.rod-leakage.drive.a.leakage_nl_per_min";
        let text = with(plant::RigParameters::BASELINE_TOML, [(path, 2.0)]).unwrap();
        let rig = plant::RigParameters::from_toml(&text, "rig.toml").unwrap();
        assert_eq!(rig.effects().len(), 1);
        assert_eq!(rig.effects()[0].numbers[0], 2.0);
    }

    #[test]
    fn a_path_that_leads_nowhere_is_refused_with_its_part() {
        for (path, words) in [
            ("t", "a table"),
            ("a.b", "no table"),
            ("t.list.5", "beyond"),
            ("t.list.x", "no place"),
            ("s.p.7.x", "beyond"),
            ("s.p.0", "a table"),
        ] {
            let error = with(TEXT, [(path, 1.0)]).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains(path), "{path}: {error}");
        }
    }
}
