//! Groups of runs side by side: change of the medians, and whether it is beyond the noise of repeated runs.
//!
//! A run gives one value of each figure, so that groups of a few runs are compared by rank, without a distribution: the exact
//! two-sided Mann-Whitney test at 5 %. Four runs on each side are the fewest that can pass it (2 of 70 orders, 2.9 %); with fewer
//! the report says that there are too few to tell. One figure in twenty is marked by chance alone: look for several that agree.
//!
//! # Source
//! H. B. Mann, D. R. Whitney, Annals of Mathematical Statistics 18 (1947) 50-60.

use super::add_new;
use super::kinds;
use super::model::{Comparison, ComparisonCell, ComparisonRow, RunPart};
use super::samples::Pick;
use figures::median::median;
use std::collections::BTreeSet;

/// Probability below which a difference is taken as none of chance.
const CHANCE: f64 = 0.05;
/// Fewest runs in each group that can be distinguished at that probability.
const FEWEST: usize = 4;

const FIGURES: [(&str, Pick); 4] = [
    ("p50", |reported| reported.p50),
    ("p99", |reported| reported.p99),
    ("p99.9", |reported| reported.p999),
    ("max", |reported| reported.max),
];

/// Compares the groups of the runs in the order in which they first appear; runs of one group, or of none, stand each for
/// itself. Nothing with fewer than two runs.
pub(crate) fn compare(runs: &[RunPart]) -> Option<Comparison> {
    let alone = runs.iter().all(|run| run.group == runs[0].group);
    let named = |(place, run): (usize, &RunPart)| match alone {
        true => format!("{place} {}", run.folder),
        false => run.group.clone(),
    };
    let group_of: Vec<String> = runs.iter().enumerate().map(named).collect();
    let mut groups: Vec<String> = Vec::new();
    group_of.iter().for_each(|group| add_new(&mut groups, group.clone()));
    if groups.len() < 2 {
        return None;
    }
    let tags: BTreeSet<&String> = runs.iter().flat_map(|run| run.percentiles_ns.keys()).collect();
    let mut tags: Vec<_> = tags.into_iter().collect();
    tags.sort_by_key(|tag| kinds::place(tag));
    let mut rows = Vec::new();
    for tag in tags {
        for (percentile, of) in FIGURES {
            let values = |group: &String| -> Vec<u64> {
                let members = runs.iter().zip(&group_of).filter(|(_, of_run)| *of_run == group);
                members.filter_map(|(run, _)| of(run.percentiles_ns.get(tag)?)).collect()
            };
            let values: Vec<_> = groups.iter().map(values).collect();
            // A figure that a group lacks compares to nothing.
            if values.iter().all(|values| !values.is_empty()) {
                rows.push(ComparisonRow { figure: format!("{tag} {percentile}"), cells: cells(&values) });
            }
        }
    }
    Some(Comparison { groups, rows })
}

fn cells(values: &[Vec<u64>]) -> Vec<ComparisonCell> {
    let first = &values[0];
    let cell = |(place, group_ns): (usize, &Vec<u64>)| {
        let change = || {
            let (before, after) = (median_ns(first) as f64, median_ns(group_ns) as f64);
            (before > 0.0).then(|| (after / before - 1.0) * 100.0)
        };
        ComparisonCell {
            median_ns: median_ns(group_ns),
            range_ns: (
                group_ns.iter().copied().min().unwrap_or_default(),
                group_ns.iter().copied().max().unwrap_or_default(),
            ),
            change_percent: if place == 0 { None } else { change() },
            beyond_noise: if place == 0 { None } else { beyond_noise(first, group_ns) },
        }
    };
    values.iter().enumerate().map(cell).collect()
}

/// The median in whole ns, half a ns cut off; 0 of no values. Below 2^53 ns, which is 104 days, no digit is lost.
fn median_ns(values_ns: &[u64]) -> u64 {
    median(values_ns.iter().map(|ns| *ns as f64).collect()).map_or(0, |median| median.value as u64)
}

/// Whether two groups differ beyond chance; nothing when there are too few values to tell.
fn beyond_noise(first: &[u64], second: &[u64]) -> Option<bool> {
    if first.len().min(second.len()) < FEWEST {
        return None;
    }
    // How often a value of one is below one of the other; a tie speaks for neither, so that it counts against a difference.
    let below = |a: &[u64], b: &[u64]| a.iter().map(|x| b.iter().filter(|y| x <= y).count()).sum::<usize>();
    let u = below(first, second).min(below(second, first));
    Some(2.0 * probability_up_to(u, first.len(), second.len()) < CHANCE)
}

/// Probability that U of groups of `m` and `n` values without a difference is at most `u`.
fn probability_up_to(u: usize, m: usize, n: usize) -> f64 {
    // The share of orders with each U grows value by value: the largest of all i + j values belongs to the first group with
    // probability i / (i + j), and is then above all j of the second.
    let mut shares = vec![vec![0.0; m * n + 1]; n + 1];
    shares.iter_mut().for_each(|of_j| of_j[0] = 1.0);
    for i in 1..=m {
        let mut next = vec![vec![0.0; m * n + 1]; n + 1];
        next[0][0] = 1.0;
        for j in 1..=n {
            let reach = i * j + 1;
            let before = next[j - 1].clone();
            for (place, share) in next[j][..reach].iter_mut().enumerate() {
                let from_first = place.checked_sub(j).map_or(0.0, |less| shares[j][less]);
                *share = (i as f64 * from_first + j as f64 * before[place]) / (i + j) as f64;
            }
        }
        shares = next;
    }
    shares[n][..=u.min(m * n)].iter().sum::<f64>().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PercentilesNs;
    use crate::{made_up, parts};
    use std::collections::BTreeMap;

    fn run(group: &str, p50: u64) -> RunPart {
        let reported = PercentilesNs { p50: Some(p50), max: Some(9), count: 10, ..PercentilesNs::default() };
        parts::part(
            &made_up::run(10),
            Some(group),
            BTreeMap::from([("emulator-wakeup".to_owned(), reported)]),
        )
    }

    fn runs(before: &[u64], after: &[u64]) -> Vec<RunPart> {
        let before = before.iter().map(|p50| run("before", *p50));
        before.chain(after.iter().map(|p50| run("after", *p50))).collect()
    }

    #[test]
    fn probabilities_are_those_of_the_published_table() {
        // Four and four: 1 of 70 orders has U = 0, 2 have U <= 1, 4 have U <= 2.
        for (u, orders) in [(0, 1.0), (1, 2.0), (2, 4.0), (16, 70.0)] {
            assert!((probability_up_to(u, 4, 4) - orders / 70.0).abs() < 1e-12, "{u}");
        }
        // Ten and ten: the two-sided bound of 5 % is U = 23.
        assert!(2.0 * probability_up_to(23, 10, 10) < 0.05);
        assert!(2.0 * probability_up_to(24, 10, 10) > 0.05);
    }

    #[test]
    fn a_change_is_reported_against_the_first_group_with_whether_it_is_noise() {
        let reported = compare(&runs(&[100, 102, 98, 101], &[150, 149, 152, 151])).unwrap();
        assert_eq!(reported.groups, ["before", "after"]);
        let row = &reported.rows[0];
        assert_eq!((row.figure.as_str(), row.cells[0].change_percent), ("emulator-wakeup p50", None));
        assert_eq!((row.cells[1].median_ns, row.cells[1].range_ns), (150, (149, 152)));
        assert!((row.cells[1].change_percent.unwrap() - 50.0).abs() < 1.0);
        assert_eq!(row.cells[1].beyond_noise, Some(true));
        assert_eq!(reported.rows[1].cells[1].beyond_noise, Some(false), "the maxima are equal");
    }

    #[test]
    fn groups_that_overlap_are_noise_and_small_ones_are_undecided() {
        let noise = compare(&runs(&[100, 120, 110, 130], &[105, 125, 115, 135])).unwrap();
        assert_eq!(noise.rows[0].cells[1].beyond_noise, Some(false));
        let few = compare(&runs(&[100, 101, 102], &[200, 201, 202])).unwrap();
        assert_eq!(few.rows[0].cells[1].beyond_noise, None);
        let each = compare(&runs(&[1, 2], &[])).unwrap();
        assert_eq!(each.groups, ["0 made-up", "1 made-up"], "without groups each run is one");
        assert_eq!((each.rows[0].cells[1].median_ns, each.rows[0].cells[1].beyond_noise), (2, None));
        assert!(compare(&runs(&[1], &[])).is_none());
        assert!(compare(&[]).is_none());
    }
}
