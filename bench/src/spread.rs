//! Repetitions of one experiment: the spread of each figure.

use crate::runs::{Run, rows};
use pagekit::grid::Grid;
use pagekit::number::{in_use, without_unit};
use serde::Serialize;
use serde_json::{Map, Value, json};

/// A figure over the runs that have it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct FigureStatistics {
    #[serde(rename = "n")]
    count: usize,
    mean: f64,
    /// Sample standard deviation; `None` for a single run.
    standard_deviation: Option<f64>,
    least: f64,
    most: f64,
}

impl FigureStatistics {
    fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        let (least, most) =
            (values.iter().copied().reduce(f64::min)?, values.iter().copied().reduce(f64::max)?);
        // The sum of equal values need not be an exact multiple.
        let mean = if least == most { least } else { values.iter().sum::<f64>() / count as f64 };
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Some(Self {
            count,
            mean,
            standard_deviation: (count > 1).then(|| (squares / (count - 1) as f64).sqrt()),
            least,
            most,
        })
    }
}

fn figure_statistics(runs: &[Run]) -> Vec<(&'static str, &'static str, FigureStatistics)> {
    let statistics = |(name, unit)| {
        let values: Vec<_> = runs.iter().filter_map(|run| run.figure(name)).collect();
        Some((name, unit, FigureStatistics::of(&values)?))
    };
    rows().filter_map(statistics).collect()
}

pub(crate) fn table(runs: &[Run]) -> Grid {
    let head = ["figure", "n", "mean", "standard deviation", "least", "most"];
    let rows = figure_statistics(runs).into_iter().map(|(name, unit, statistics)| {
        let reported = |value: f64| in_use(value, unit);
        let deviation = statistics.standard_deviation.map_or_else(|| "-".to_owned(), reported);
        let count = statistics.count.to_string();
        vec![
            without_unit(name),
            count,
            reported(statistics.mean),
            deviation,
            reported(statistics.least),
            reported(statistics.most),
        ]
    });
    Grid::new(head, rows)
}

/// The spreads as JSON, SI, by the figures' names.
pub(crate) fn json(runs: &[Run]) -> Value {
    let figures: Map<_, _> = figure_statistics(runs)
        .into_iter()
        .map(|(name, _, statistics)| (name.to_owned(), json!(statistics)))
        .collect();
    let names: Vec<_> = runs.iter().map(|run| run.name.as_str()).collect();
    json!({
        "schema_version": runlog::run_folder::SCHEMA_VERSION,
        "experiment": runs.first().map(Run::title),
        "runs": names,
        "figures": figures,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::{self, made};

    #[test]
    fn mean_and_deviation_are_those_of_the_sample() {
        let statistics = FigureStatistics::of(&[1.0, 2.0, 3.0, 6.0]).unwrap();
        assert_eq!(
            (statistics.count, statistics.mean, statistics.least, statistics.most),
            (4, 3.0, 1.0, 6.0)
        );
        assert!((statistics.standard_deviation.unwrap() - (14.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(FigureStatistics::of(&[4.0]).unwrap().standard_deviation, None);
        assert_eq!(FigureStatistics::of(&[]), None);
        let equal = FigureStatistics::of(&[0.1; 3]).unwrap();
        assert_eq!((equal.mean, equal.standard_deviation), (0.1, Some(0.0)));
    }

    #[test]
    fn repetitions_are_summed_up_as_a_table_and_as_json() {
        let parent = tempfile::tempdir().unwrap();
        let folders = [("one", 0.002), ("two", 0.004)]
            .map(|(name, error_m)| made::folder(parent.path(), name, "title = \"ramp\"", error_m));
        let runs = runs::read(&folders).unwrap();
        let reported = json(&runs);
        assert_eq!(reported["runs"], json!(["one", "two"]));
        let figure = &reported["figures"]["position_error_dynamic_m"];
        assert!((figure["mean"].as_f64().unwrap() - 0.003).abs() < 1e-12 && figure["n"] == 2);
        let grid = table(&runs);
        let row = grid.rows.iter().find(|row| row[0] == "position error dynamic").unwrap();
        assert_eq!(row[1..], ["2", "3.000 mm", "1.414 mm", "2.000 mm", "4.000 mm"]);
    }
}
