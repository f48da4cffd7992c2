//! A table of controller variants by figures, each the mean and the range over some kinds of noise.

use std::error::Error;
use tuning::cases::{Case, CaseSpec, figures};
use tuning::{Trial, in_parallel, rounded};

pub(crate) const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];

pub(crate) struct ControllerVariant {
    pub(crate) name: &'static str,
    pub(crate) drive: Option<&'static str>,
    pub(crate) load: Option<&'static str>,
    /// Whether its programs have the paper's structure.
    pub(crate) is_papers: bool,
}

pub(crate) struct Column {
    pub(crate) head: &'static str,
    pub(crate) figure: &'static str,
    pub(crate) scale: f64,
}

/// An experiment, what is compared in it, and by which figures.
pub(crate) struct ComparisonTable<'a> {
    pub(crate) experiment: &'a str,
    pub(crate) variants: &'a [ControllerVariant],
    pub(crate) columns: &'a [Column],
    /// Figures of which it is asked whether they are half the paper's.
    pub(crate) halved: &'a [&'a str],
}

/// Mean, least and largest of a figure; `None` when a run lacks it.
#[derive(Clone, Copy)]
pub(crate) struct MeanAndRange {
    pub(crate) mean: f64,
    least: f64,
    most: f64,
}

impl MeanAndRange {
    pub(crate) fn of(values: impl Iterator<Item = Option<f64>>) -> Option<Self> {
        let values = values.collect::<Option<Vec<_>>>()?;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let ends = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick);
        Some(Self { mean, least: ends(f64::min)?, most: ends(f64::max)? })
    }

    /// `mean (least to largest)`, with the decimals that the size of the mean wants.
    pub(crate) fn cell(summary: Option<Self>, scale: f64) -> String {
        let Some(Self { mean, least, most }) = summary else { return "-".into() };
        let decimals = if (mean * scale).abs() < 9.95 { 2 } else { 1 };
        let show = |value: f64| rounded(value * scale, decimals);
        format!("{} ({} to {})", show(mean), show(least), show(most))
    }
}

impl ComparisonTable<'_> {
    pub(crate) fn print(&self) -> Result<(), Box<dyn Error>> {
        let heads: Vec<_> = self.columns.iter().map(|column| column.head).collect();
        println!("| | {} |", heads.join(" | "));
        println!("|---{}|", "|---".repeat(heads.len()));
        let reported =
            self.variants.iter().map(|variant| self.figures(variant)).collect::<Result<Vec<_>, _>>()?;
        for (variant, reported) in self.variants.iter().zip(&reported) {
            let cells = reported
                .iter()
                .zip(self.columns)
                .map(|(summary, column)| MeanAndRange::cell(*summary, column.scale));
            println!("| {} | {} |", variant.name, cells.collect::<Vec<_>>().join(" | "));
        }
        println!("\nAt most half, and by how much (ratio of the means)?\n");
        let all = || self.variants.iter().zip(&reported);
        for (variant, ours) in all().filter(|(variant, _)| !variant.is_papers) {
            for (paper, papers) in all().filter(|(variant, _)| variant.is_papers) {
                self.verdicts(papers, ours).iter().for_each(|verdict| {
                    println!("- {} against {}, {verdict}", variant.name, paper.name);
                });
            }
        }
        Ok(())
    }

    fn figures(&self, variant: &ControllerVariant) -> Result<Vec<Option<MeanAndRange>>, Box<dyn Error>> {
        let ControllerVariant { drive, load, .. } = *variant;
        let case = Case::new(&CaseSpec { experiment: self.experiment, drive, load, set: &[] })?;
        let runs = in_parallel(&SEEDS, |seed| {
            let figure = figures(&case.run(&Trial { seed: *seed, ..Trial::default() })?);
            Ok(self.columns.iter().map(|column| figure(column.figure)).collect::<Vec<_>>())
        })?;
        Ok((0..self.columns.len()).map(|place| MeanAndRange::of(runs.iter().map(|run| run[place]))).collect())
    }

    fn verdicts(&self, papers: &[Option<MeanAndRange>], ours: &[Option<MeanAndRange>]) -> Vec<String> {
        let asked = self.columns.iter().zip(papers.iter().zip(ours));
        let asked = asked.filter(|(column, _)| self.halved.contains(&column.figure));
        let verdicts = asked.filter_map(|(column, (papers, ours))| {
            let ratio = papers.as_ref()?.mean / ours.as_ref()?.mean;
            let what = column.head.split(',').next().unwrap_or(column.head);
            Some(format!("{what}: **{}**, {ratio:.2}", if ratio >= 2.0 { "yes" } else { "no" }))
        });
        verdicts.collect()
    }
}
