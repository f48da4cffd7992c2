//! Merges the parts of a campaign, from one folder or several, into one table: `runs.csv`.
//!
//! It merges only a complete set of parts of one version, without duplicates.

use crate::campaign::Campaign;
use crate::factor::Values;
use crate::file::is_figure;
use crate::parts::{PartError, Parts, temporary_file_in};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

#[derive(Debug, thiserror::Error)]
pub(crate) enum MergeError {
    #[error(
        "{missing} of {all} parts are missing, the first is part {first} (runs {from} to {to}); the same 'run' does only what is missing"
    )]
    Missing { missing: u64, all: u64, first: u64, from: u64, to: u64 },
    #[error(
        "part {part} is in {one} and in {other}: one run would count twice; name one folder once, or delete one of them"
    )]
    Duplicate { part: u64, one: String, other: String },
    /// A part of another campaign or program, or an incomplete one.
    #[error(transparent)]
    Part(#[from] PartError),
    #[error("{path}: {error}")]
    Write { path: String, error: io::Error },
}

/// The columns of the table of runs that the page needs.
#[derive(Debug, Default)]
pub(crate) struct Results {
    pub runs: u64,
    /// Simulated time of all runs, s.
    pub simulated_s: f64,
    /// Numbers by the name of their column; NaN where a run has none.
    numbers: BTreeMap<String, Vec<f64>>,
    words: BTreeMap<String, CategoricalColumn>,
    /// The first [`MAX_REPORTED`] runs that were not completed.
    pub incomplete_runs: Vec<IncompleteRun>,
}

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct IncompleteRun {
    pub run: u64,
    /// `time-over`, `stopped` or `failed`.
    pub ended: String,
    pub because: String,
}

/// Most unfinished runs that are reported one by one.
const MAX_REPORTED: usize = 100;

/// A categorical column: its distinct values, and an index for each run.
#[derive(Debug, Default)]
pub(crate) struct CategoricalColumn {
    /// The distinct values, in the order of their first run.
    pub known: Vec<String>,
    /// For each run the index of its value in `known`.
    pub places: Vec<u32>,
}

impl CategoricalColumn {
    fn push(&mut self, word: &str) {
        let place = self.known.iter().position(|known| known == word).unwrap_or_else(|| {
            self.known.push(word.to_owned());
            self.known.len() - 1
        });
        self.places.push(place as u32);
    }
}

/// Merges the parts in `folders` into `to`/runs.csv.
///
/// # Errors
/// [`MergeError`]; `runs.csv` is unchanged then.
pub(crate) fn merge(campaign: &Campaign, folders: &[PathBuf], to: &Path) -> Result<Results, MergeError> {
    let parts = &campaign.parts;
    let part_folders = part_folders(parts, folders)?;
    let path = to.join("runs.csv");
    let failed = |error| MergeError::Write { path: path.display().to_string(), error };
    std::fs::create_dir_all(to).map_err(failed)?;
    let temporary = temporary_file_in(to).map_err(failed)?;
    let mut file = BufWriter::new(temporary);
    writeln!(file, "{}", parts.columns.join(",")).map_err(failed)?;
    let mut results = Results::of(campaign);
    for (part, folder) in part_folders.iter().enumerate() {
        let rows = parts.read(folder, part as u64)?.ok_or_else(|| missing(parts, &[part as u64]))?;
        file.write_all(rows.as_bytes()).map_err(failed)?;
        results.add(&parts.columns, &rows);
    }
    assert_eq!(results.runs, parts.runs, "parts that are whole have a row for each of their runs");
    let temporary = file.into_inner().map_err(|error| failed(error.into_error()))?;
    temporary.as_file().sync_all().map_err(failed)?;
    temporary.persist(&path).map_err(|error| failed(error.error))?;
    File::open(to).and_then(|folder| folder.sync_all()).map_err(failed)?;
    Ok(results)
}

fn part_folders<'f>(parts: &Parts, folders: &'f [PathBuf]) -> Result<Vec<&'f Path>, MergeError> {
    let mut part_folders = Vec::new();
    let mut absent = Vec::new();
    for part in 0..parts.count() {
        let mut holders = folders.iter().filter(|folder| parts.path(folder, part).exists());
        match (holders.next(), holders.next()) {
            (Some(one), Some(other)) => {
                let (one, other) = (one.display().to_string(), other.display().to_string());
                return Err(MergeError::Duplicate { part, one, other });
            }
            (Some(one), None) => part_folders.push(one.as_path()),
            (None, _) => absent.push(part),
        }
    }
    if absent.is_empty() { Ok(part_folders) } else { Err(missing(parts, &absent)) }
}

fn missing(parts: &Parts, absent: &[u64]) -> MergeError {
    let first = absent.first().copied().unwrap_or(0);
    let runs = parts.runs_of(first);
    MergeError::Missing {
        missing: absent.len() as u64,
        all: parts.count(),
        first,
        from: runs.start,
        to: runs.end - 1,
    }
}

impl Results {
    fn of(campaign: &Campaign) -> Self {
        let mut results = Self::default();
        let numbers_of = |values: &Values| match values {
            Values::Range(_) => true,
            Values::List(list) => list.iter().all(|value| value.number().is_some()),
        };
        for factor in &campaign.file.factors {
            if numbers_of(&factor.values) {
                results.numbers.insert(factor.name.clone(), Vec::new());
            } else {
                results.words.insert(factor.name.clone(), CategoricalColumn::default());
            }
        }
        for name in ["run", "passed"] {
            results.numbers.insert(name.to_owned(), Vec::new());
        }
        results.words.insert("ended".to_owned(), CategoricalColumn::default());
        let confusion = campaign.file.confusion.iter().flatten();
        for name in confusion.filter(|name| !results.numbers.contains_key(*name)).cloned().collect::<Vec<_>>()
        {
            results.words.entry(name).or_default();
        }
        // The figures of an experiment are numbers; those of a command may be words.
        for name in &campaign.parts.columns {
            let is_collected = campaign.file.figures.contains(name) && !results.words.contains_key(name);
            if is_figure(name) || is_collected {
                results.numbers.insert(name.clone(), Vec::new());
            }
        }
        results
    }

    fn add(&mut self, columns: &[String], rows: &str) {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(rows.as_bytes());
        let place = |name: &str| columns.iter().position(|column| column == name);
        let (ended, because) = (place("ended"), place("because"));
        for row in reader.records().map_while(Result::ok) {
            let cell = |place: Option<usize>| place.and_then(|place| row.get(place)).unwrap_or_default();
            if cell(ended) != "done" && self.incomplete_runs.len() < MAX_REPORTED {
                let (ended, because) = (cell(ended).to_owned(), cell(because).to_owned());
                self.incomplete_runs.push(IncompleteRun { run: self.runs, ended, because });
            }
            self.runs += 1;
            for (name, cell) in columns.iter().zip(&row) {
                if name == "simulated_s" {
                    self.simulated_s += cell.parse().unwrap_or(0.0);
                }
                if let Some(column) = self.numbers.get_mut(name) {
                    column.push(cell.parse().unwrap_or(f64::NAN));
                } else if let Some(column) = self.words.get_mut(name) {
                    column.push(cell);
                }
            }
        }
    }

    /// A column of numbers, a place for each run; NaN where a run has none.
    pub(crate) fn numbers(&self, name: &str) -> Option<&[f64]> {
        self.numbers.get(name).map(Vec::as_slice)
    }

    /// Whether every run was completed and kept the bounds of its experiment.
    pub(crate) fn all_passed(&self) -> bool {
        self.incomplete_runs.is_empty() && !self.numbers("passed").unwrap_or_default().contains(&0.0)
    }

    pub(crate) fn words(&self, name: &str) -> Option<&CategoricalColumn> {
        self.words.get(name)
    }
}
