//! A table of subjects by figures, each the mean and the range over some kinds of noise.

use std::error::Error;
use tuning::cases::{Case, Made, figures};
use tuning::{Trial, in_parallel, rounded};

pub(crate) const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];

pub(crate) struct Subject {
    pub(crate) name: &'static str,
    pub(crate) drive: Option<&'static str>,
    pub(crate) load: Option<&'static str>,
    /// Whether they are of the paper's structure.
    pub(crate) papers: bool,
}

pub(crate) struct Column {
    pub(crate) head: &'static str,
    pub(crate) figure: &'static str,
    pub(crate) scale: f64,
}

/// An experiment, what is compared in it, and by which figures.
pub(crate) struct Sheet<'a> {
    pub(crate) experiment: &'a str,
    pub(crate) subjects: &'a [Subject],
    pub(crate) columns: &'a [Column],
    /// Figures of which it is asked whether they are half the paper's.
    pub(crate) halved: &'a [&'a str],
}

/// Mean, least and largest of a figure; `None` when a run lacks it.
#[derive(Clone, Copy)]
pub(crate) struct Spread {
    pub(crate) mean: f64,
    least: f64,
    most: f64,
}

impl Spread {
    pub(crate) fn of(values: impl Iterator<Item = Option<f64>>) -> Option<Self> {
        let values = values.collect::<Option<Vec<_>>>()?;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let ends = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick);
        Some(Self { mean, least: ends(f64::min)?, most: ends(f64::max)? })
    }

    /// `mean (least to largest)`, with the decimals that the size of the mean wants.
    pub(crate) fn cell(spread: Option<Self>, scale: f64) -> String {
        let Some(Self { mean, least, most }) = spread else { return "-".into() };
        let decimals = if (mean * scale).abs() < 9.95 { 2 } else { 1 };
        let show = |value: f64| rounded(value * scale, decimals);
        format!("{} ({} to {})", show(mean), show(least), show(most))
    }
}

impl Sheet<'_> {
    pub(crate) fn print(&self) -> Result<(), Box<dyn Error>> {
        let heads: Vec<_> = self.columns.iter().map(|column| column.head).collect();
        println!("| | {} |", heads.join(" | "));
        println!("|---{}|", "|---".repeat(heads.len()));
        let reported =
            self.subjects.iter().map(|subject| self.figures(subject)).collect::<Result<Vec<_>, _>>()?;
        for (subject, reported) in self.subjects.iter().zip(&reported) {
            let cells =
                reported.iter().zip(self.columns).map(|(spread, column)| Spread::cell(*spread, column.scale));
            println!("| {} | {} |", subject.name, cells.collect::<Vec<_>>().join(" | "));
        }
        println!("\nAt most half, and by how much (ratio of the means)?\n");
        let all = || self.subjects.iter().zip(&reported);
        for (subject, own) in all().filter(|(subject, _)| !subject.papers) {
            for (paper, papers) in all().filter(|(subject, _)| subject.papers) {
                self.verdicts(papers, own).iter().for_each(|verdict| {
                    println!("- {} against {}, {verdict}", subject.name, paper.name);
                });
            }
        }
        Ok(())
    }

    fn figures(&self, subject: &Subject) -> Result<Vec<Option<Spread>>, Box<dyn Error>> {
        let Subject { drive, load, .. } = *subject;
        let case = Case::new(&Made { experiment: self.experiment, drive, load, set: &[] })?;
        let runs = in_parallel(&SEEDS, |seed| {
            let figure = figures(&case.run(&Trial { seed: *seed, ..Trial::default() })?);
            Ok(self.columns.iter().map(|column| figure(column.figure)).collect::<Vec<_>>())
        })?;
        Ok((0..self.columns.len()).map(|place| Spread::of(runs.iter().map(|run| run[place]))).collect())
    }

    fn verdicts(&self, papers: &[Option<Spread>], own: &[Option<Spread>]) -> Vec<String> {
        let asked = self.columns.iter().zip(papers.iter().zip(own));
        let asked = asked.filter(|(column, _)| self.halved.contains(&column.figure));
        let said = asked.filter_map(|(column, (papers, own))| {
            let ratio = papers.as_ref()?.mean / own.as_ref()?.mean;
            let what = column.head.split(',').next().unwrap_or(column.head);
            Some(format!("{what}: **{}**, {ratio:.2}", if ratio >= 2.0 { "yes" } else { "no" }))
        });
        said.collect()
    }
}
