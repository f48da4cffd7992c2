//! Runs of one experiment side by side: a table of all figures, and their curves over each other.
//!
//! [`overlay`] draws the curves, [`differences`] their distance from the first run instead. Time begins with the experiment, so
//! that runs with different waits coincide.

pub(crate) mod differences;
pub(crate) mod overlay;

use crate::runs::{Run, rows};
use figures::SummaryError;
use figures::drawing::Picture;
use figures::picture::programs;
use pagekit::grid::Grid;
use pagekit::number::{in_use, without_unit};
use pagekit::page::{document, escaped};
use runlog::run_folder::FileError;
use std::path::{Path, PathBuf};

/// The table: a row for each figure that any run has, and the change against the first run.
pub(crate) fn table(runs: &[Run]) -> Grid {
    let Some((first, others)) = runs.split_first() else { return Grid::default() };
    let mut head = vec!["figure".to_owned(), first.name.clone()];
    for run in others {
        head.extend([run.name.clone(), "change".to_owned()]);
    }
    let known = rows().filter(|(name, _)| runs.iter().any(|run| run.figure(name).is_some()));
    let rows = known.map(|(name, unit)| {
        let reported =
            |run: &Run| run.figure(name).map_or_else(|| "-".to_owned(), |value| in_use(value, unit));
        let mut row = vec![without_unit(name), reported(first)];
        for run in others {
            row.extend([reported(run), change(first.figure(name), run.figure(name))]);
        }
        row
    });
    Grid { head, rows: rows.collect() }
}

/// Largest relative change shown, per cent: beyond it the first value was almost zero.
const MOST_CHANGE: f64 = 1000.0;

/// Relative change in per cent; empty where the first value is zero, almost zero or unknown.
fn change(first: Option<f64>, other: Option<f64>) -> String {
    match (first, other) {
        (Some(first), Some(other)) if first == other => "0 %".into(),
        (Some(first), Some(other)) if first != 0.0 => {
            let change = 100.0 * (other - first) / first.abs();
            if change.abs() > MOST_CHANGE {
                format!("over {MOST_CHANGE} %")
            } else {
                format!("{change:+.1} %")
            }
        }
        _ => "-".into(),
    }
}

/// The page: heading, runs, table, pictures, all in one file.
pub(crate) fn page(runs: &[Run], grid: &Grid, pictures: &[Picture]) -> Result<String, SummaryError> {
    let pictures = pictures.iter().map(|picture| {
        picture.svg().map_err(|error| FileError::write(Path::new("the page's picture"), error))
    });
    let pictures = pictures.collect::<Result<Vec<_>, _>>()?;
    let title = runs.first().map(Run::title).unwrap_or_default();
    let list: String = runs.iter().map(entry).collect();
    let figures: String = pictures.iter().map(|svg| format!("<figure>{svg}</figure>\n")).collect();
    let title = format!("{title}: {} runs side by side", runs.len());
    let body = format!("<h1>{}</h1>\n<ul>\n{list}</ul>\n{}{figures}", escaped(&title), grid.html());
    Ok(document(&title, &body))
}

/// Name of a run, with the programs that its experiment names.
fn entry(run: &Run) -> String {
    let programs = programs(&run.record);
    let programs = if programs.is_empty() { String::new() } else { format!(" ({})", programs.join(", ")) };
    let folder = run.folder.display().to_string();
    format!("<li><b>{}</b>{} in {}</li>\n", escaped(&run.name), escaped(&programs), escaped(&folder))
}

/// Writes the page to `out`, or to `compare.html` in it when that is a folder, with `compare.md` beside it.
pub(crate) fn write(
    runs: &[Run],
    grid: &Grid,
    pictures: &[Picture],
    out: &Path,
) -> Result<PathBuf, SummaryError> {
    let is_page = out.extension().is_some_and(|extension| extension == "html");
    let page_path = if is_page { out.into() } else { out.join("compare.html") };
    let folder = page_path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|error| FileError::write(folder, error))?;
    let markdown_path = page_path.with_extension("md");
    for (path, text) in [(&page_path, page(runs, grid, pictures)?), (&markdown_path, grid.markdown())] {
        std::fs::write(path, text).map_err(|error| FileError::write(path, error))?;
    }
    Ok(page_path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::{self, made};

    #[test]
    fn figures_stand_side_by_side_with_their_change() {
        let parent = tempfile::tempdir().unwrap();
        let folders = [("one", 0.002), ("two<", 0.001)]
            .map(|(name, error_m)| made::folder(parent.path(), name, "title = \"ramp\"", error_m));
        let runs = runs::read(&folders).unwrap();
        let grid = table(&runs);
        let row = grid.rows.iter().find(|row| row[0] == "position error dynamic").unwrap();
        assert_eq!(row[1..], ["2.000 mm", "1.000 mm", "-50.0 %"]);
        assert!(grid.rows.iter().all(|row| row[0] != "force settling"), "nobody has it");
        let page = write(&runs, &grid, &overlay::pictures(&runs), &parent.path().join("new")).unwrap();
        let text = std::fs::read_to_string(&page).unwrap();
        for part in ["ramp: 2 runs", "two&lt;", "<svg", "-50.0 %"] {
            assert!(text.contains(part), "{part}");
        }
        assert!(
            !text.contains("http://")
                || text.matches("http").count() == text.matches("http://www.w3.org").count()
        );
        assert!(page.with_extension("md").exists());
    }

    #[test]
    fn a_change_against_zero_or_the_unknown_is_none() {
        assert_eq!(change(Some(2.0), Some(3.0)), "+50.0 %");
        assert_eq!(change(Some(-2.0), Some(-3.0)), "-50.0 %");
        assert_eq!(change(Some(0.0), Some(0.0)), "0 %");
        assert_eq!(change(Some(0.0), Some(3.0)), "-");
        assert_eq!(change(Some(1e-16), Some(3.0)), "over 1000 %");
        assert_eq!(change(None, Some(3.0)), "-");
    }
}
