//! Differences of runs from the first, as pictures and as rms values, for a measured rig and its simulations.
//!
//! Differences are of means over 20 ms, which keep the differences of models and reduce the noise of the sensors to a fifth;
//! time begins with the experiment. Differences between runs with equal models (noise, the interplay of two controllers) are
//! not subtracted.

use super::{change, overlay};
use crate::runs::Run;
use figures::drawing::{COLOURS, Curve, Panel, Picture};
use figures::series::Series;
use pagekit::grid::Grid;
use pagekit::number::in_use;
use runlog::cycle_tables::MEASURED;

/// Length of the means, s.
const MEAN_S: f64 = 0.02;

/// Ends of the columns, with their units, the sizes in SI of the units in which they are drawn, and these.
const UNITS: [(&str, &str, f64, &str); 4] =
    [("_m", "m", 1e-3, "mm"), ("_Pa", "Pa", 1e2, "mbar"), ("_N", "N", 1.0, "N"), ("", "1", 1e-2, "%")];

struct ComparedSignal {
    /// Column of `measurement.csv`.
    column: &'static str,
    name: String,
    unit: &'static str,
    unit_in_si: f64,
    drawn: &'static str,
}

fn shown() -> impl Iterator<Item = ComparedSignal> {
    MEASURED.iter().flat_map(|column| {
        UNITS.into_iter().find_map(|(end, unit, unit_in_si, drawn)| {
            let name = column.strip_suffix(end)?.replace('_', " ");
            Some(ComparedSignal { column, name, unit, unit_in_si, drawn })
        })
    })
}

/// Difference of a run from the first, in SI, over the time since the start of the experiment.
fn difference(first: &Run, run: &Run, column: &str) -> Series {
    let of = |run: &Run| {
        let spans = run.record.experiments();
        run.record.measured.numbers(column).smoothed(MEAN_S).within_all(&spans).shifted(-run.start_s())
    };
    of(run).minus(&of(first))
}

/// The rms of each signal's difference from the first run; changes are against the second.
pub(crate) fn table(runs: &[Run]) -> Grid {
    let Some((first, others)) = runs.split_first() else { return Grid::default() };
    let mut head = vec![format!("rms difference from {}", first.name)];
    for (place, run) in others.iter().enumerate() {
        head.push(run.name.clone());
        if place > 0 {
            head.push("change".to_owned());
        }
    }
    let rows = shown().map(|quantity| {
        let rms: Vec<_> = others.iter().map(|run| difference(first, run, quantity.column).rms()).collect();
        let mut row = vec![quantity.name];
        for (place, value) in rms.iter().enumerate() {
            row.push(value.map_or_else(|| "-".to_owned(), |value| in_use(value, quantity.unit)));
            if place > 0 {
                row.push(change(rms[0], *value));
            }
        }
        row
    });
    Grid { head, rows: rows.collect() }
}

/// The picture: a panel for each signal, a curve for each run but the first.
pub(crate) fn pictures(runs: &[Run]) -> Vec<Picture> {
    let Some((first, others)) = runs.split_first() else { return Vec::new() };
    let panels = shown().map(|quantity| {
        let curves = others.iter().enumerate().map(|(place, run)| Curve {
            name: format!("{} - {}", run.name, first.name),
            // The second run would cover the first, so it gets another colour.
            colour: COLOURS[(place + 1) % COLOURS.len()],
            width: if place == 0 { 2 } else { 1 },
            samples: difference(first, run, quantity.column).map(|value| value / quantity.unit_in_si),
        });
        Panel { title: format!("{}, {}", quantity.name, quantity.drawn), curves: curves.collect() }
    });
    let title = format!("{}: differences from {}", first.title(), first.name);
    vec![overlay::whole(title, runs, panels.collect())]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::{self, made};

    #[test]
    fn a_run_differs_from_itself_by_nothing_and_each_other_has_its_curve() {
        let parent = tempfile::tempdir().unwrap();
        let folders = [("measured", 0.002), ("before", 0.001), ("after", 0.002)]
            .map(|(name, error_m)| made::folder(parent.path(), name, "title = \"ramp\"", error_m));
        let runs = runs::read(&folders).unwrap();
        let grid = table(&runs);
        assert_eq!(grid.head, ["rms difference from measured", "before", "after", "change"]);
        let row = grid.rows.iter().find(|row| row[0] == "drive position").unwrap();
        assert_eq!(row[1..], ["1.0000 mm", "0 mm", "-100.0 %"]);
        let [picture] = &pictures(&runs)[..] else { panic!("one picture") };
        let panel = picture.panels.iter().find(|panel| panel.title == "drive position, mm").unwrap();
        let names: Vec<_> = panel.curves.iter().map(|curve| curve.name.as_str()).collect();
        assert_eq!(names, ["before - measured", "after - measured"]);
    }
}
