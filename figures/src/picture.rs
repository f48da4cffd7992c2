//! The pictures of a run: `picture.svg` of the whole, `step.svg` around the largest step, `stop.svg` around an emergency stop.
//!
//! Panels are drawn for existing data: an idle load axis has none. The strip on top shows the states of the main chain.

use crate::SummaryError;
use crate::drawing::{BLUE, Band, Curve, GREEN, PURPLE, Panel, Picture, VERMILION};
use crate::emergency_stop;
use crate::record::{Record, largest_step};
use crate::series::{Series, Span};
use plotters::style::RGBColor;
use runlog::Axis;
use runlog::run_folder::{FileError, PICTURE_SVG, STEP_SVG, STOP_SVG};
use std::path::Path;

/// Millimetres in a metre.
pub const METRE_IN_MM: f64 = 1e3;
const PASCAL_IN_BAR: f64 = 1e-5;
/// Per cent in one.
pub const PER_CENT: f64 = 100.0;
/// Time before and after the instant of a zoom.
const BEFORE_S: f64 = 0.2;
const AFTER_S: f64 = 0.6;
/// A load axis at least this far from the carriage moves independently, and is shown.
const APART_M: f64 = 0.002;

/// Draws the pictures of a run into `folder`; returns their names.
///
/// # Errors
///
/// A picture that cannot be drawn or written.
pub fn draw(folder: &Path, record: &Record) -> Result<Vec<&'static str>, SummaryError> {
    let whole = whole(record);
    let mut pictures = vec![(PICTURE_SVG, whole.clone())];
    if let Some((what, at_s)) = step(record) {
        pictures.push((STEP_SVG, zoom(&whole, &what, at_s)));
    }
    if let Some(at_s) = emergency_stop::first_trip_s(record) {
        pictures.push((STOP_SVG, zoom(&whole, "emergency stop", at_s)));
    }
    // An earlier summary may have drawn a picture that this one does not.
    for name in [STEP_SVG, STOP_SVG] {
        let _ = std::fs::remove_file(folder.join(name));
    }
    for (name, picture) in &pictures {
        let path = folder.join(name);
        let svg = picture.svg().map_err(|error| FileError::write(&path, error))?;
        std::fs::write(&path, svg).map_err(|error| FileError::write(&path, error))?;
    }
    Ok(pictures.into_iter().map(|(name, _)| name).collect())
}

/// Name and time of the largest step of a run: of the force, else of the position.
pub fn step(record: &Record) -> Option<(String, f64)> {
    let spans = record.experiments();
    let force = largest_step(record.load.numbers("set_force_N"), &spans, 10.0)
        .map(|step| (format!("step of the force by {:.0} N", step.height_value()), step.at_s));
    force.or_else(|| {
        let step = largest_step(record.drive.numbers("set_position_m"), &spans, 0.002)?;
        Some((format!("step of the position by {:.0} mm", step.height_value() * METRE_IN_MM), step.at_s))
    })
}

fn whole(record: &Record) -> Picture {
    let span = record.measured.numbers("drive_position_m").span();
    let range = span.unwrap_or(Span { from_s: 0.0, to_s: 1e-3 });
    Picture {
        title: record.experiment.title().unwrap_or("a run").to_owned(),
        caption: caption(record),
        time_name: "time, s".into(),
        range,
        mark_s: None,
        bands: bands(record),
        panels: panels(record),
    }
}

/// A zoom around `at_s`, which becomes time 0.
fn zoom(whole: &Picture, what: &str, at_s: f64) -> Picture {
    let moved = |span: &Span| Span { from_s: span.from_s - at_s, to_s: span.to_s - at_s };
    let mut zoom = whole.clone();
    zoom.title = format!("{}: {what} at {at_s:.3} s", whole.title);
    zoom.time_name = "time since then, s".into();
    zoom.range = Span { from_s: -BEFORE_S, to_s: AFTER_S };
    zoom.mark_s = Some(0.0);
    zoom.bands.iter_mut().for_each(|band| band.span = moved(&band.span));
    for curve in zoom.panels.iter_mut().flat_map(|panel| &mut panel.curves) {
        curve.samples = curve.samples.shifted(-at_s);
    }
    zoom
}

/// The programs that the experiment names, each behind its axis.
pub fn programs(record: &Record) -> Vec<String> {
    let program = |axis: Axis| Some(format!("{}: {}", axis.name(), record.experiment.program(axis)?));
    Axis::ALL.into_iter().filter_map(program).collect()
}

/// The experiment's description of itself, and the programs of both axes.
fn caption(record: &Record) -> String {
    let about = record.experiment.about().map(str::to_owned);
    let programs = programs(record);
    let programs = (!programs.is_empty()).then(|| programs.join("   "));
    about.into_iter().chain(programs).collect::<Vec<_>>().join("\n")
}

/// Intervals of the states of the main chain.
fn bands(record: &Record) -> Vec<Band> {
    let states = record.leader().states("main_chain").iter();
    let band = |entry: &crate::tables_read::StateSpan| Band {
        label: entry.state.replace('-', " "),
        span: entry.span,
        is_main: entry.state == "experiment",
    };
    states.map(band).collect()
}

fn curve(name: &str, colour: RGBColor, width: u32, samples: Series) -> Curve {
    Curve { name: name.into(), colour, width, samples }
}

fn panels(record: &Record) -> Vec<Panel> {
    let Record { drive, load, measured, truth, .. } = record;
    let load_acts = record.load_acts();
    let scaled = |series: &Series, factor: f64| series.map(|value| value * factor);
    let apart = measured.numbers("load_position_m").minus(measured.numbers("drive_position_m"));
    let load_apart = load_acts && apart.largest().is_some_and(|apart| apart > APART_M);
    let panel = |title: &str, curves: Vec<Curve>| Panel { title: title.into(), curves };
    let millimetres = |series: &Series| scaled(series, METRE_IN_MM);

    let mut position = vec![
        curve("position", BLUE, 3, millimetres(measured.numbers("drive_position_m"))),
        curve("set-point", VERMILION, 1, millimetres(drive.numbers("set_position_m"))),
    ];
    let mut velocity = vec![
        curve("filtered", BLUE, 2, drive.numbers("velocity_m_per_s").clone()),
        curve("set-point", VERMILION, 1, drive.numbers("set_velocity_m_per_s").clone()),
    ];
    if load_apart {
        position.push(curve("load", GREEN, 1, millimetres(measured.numbers("load_position_m"))));
        velocity.push(curve("load", GREEN, 1, load.numbers("velocity_m_per_s").clone()));
    }
    let mut valves = vec![curve("drive", BLUE, 1, scaled(measured.numbers("drive_valve"), PER_CENT))];
    let pressures = |axis: [&str; 2]| {
        vec![
            curve("a, cap side", BLUE, 2, scaled(measured.numbers(axis[0]), PASCAL_IN_BAR)),
            curve("b, rod side", GREEN, 1, scaled(measured.numbers(axis[1]), PASCAL_IN_BAR)),
        ]
    };
    let mut drive_pressures = pressures(["drive_pressure_a_Pa", "drive_pressure_b_Pa"]);
    let supply = truth.numbers("supply_pressure_Pa");
    if supply.least().zip(supply.most()).is_some_and(|(least, most)| least < 0.9 * most) {
        drive_pressures.push(curve("supply", PURPLE, 2, scaled(supply, PASCAL_IN_BAR)));
    }
    let mut load_panels = Vec::new();
    let mut force = Vec::new();
    if load_acts {
        valves.push(curve("load", VERMILION, 1, scaled(measured.numbers("load_valve"), PER_CENT)));
        force.push(panel(
            "load force, N, compression positive",
            vec![
                curve("force", BLUE, 1, measured.numbers("load_force_N").clone()),
                curve("set-point", VERMILION, 1, load.numbers("set_force_N").clone()),
            ],
        ));
        load_panels.push(panel(
            "load pressures, bar absolute",
            pressures(["load_pressure_a_Pa", "load_pressure_b_Pa"]),
        ));
    }
    let mut panels = vec![
        panel("drive position, mm", position),
        panel(
            "drive set-point - position, mm",
            vec![curve("error", BLUE, 1, millimetres(&record.position_error()))],
        ),
    ];
    panels.extend(force);
    panels.push(panel("velocity, m/s", velocity));
    panels.push(panel("valve opening, %", valves));
    panels.push(panel("drive pressures, bar absolute", drive_pressures));
    panels.extend(load_panels);
    panels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};

    fn record() -> Record {
        let measured = table(&[
            ("drive_position_m", &each_ms(0.0, 2.0, |time| 0.1 * time)),
            ("drive_pressure_a_Pa", &each_ms(0.0, 2.0, |_| 3e5)),
            ("load_force_N", &each_ms(0.0, 2.0, |_| 1.0)),
        ]);
        Record { measured, ..Record::default() }
    }

    fn drawn(record: &Record) -> (tempfile::TempDir, Vec<&'static str>, String) {
        let folder = tempfile::tempdir().unwrap();
        let names = draw(folder.path(), record).unwrap();
        let picture = std::fs::read_to_string(folder.path().join("picture.svg")).unwrap();
        (folder, names, picture)
    }

    #[test]
    fn a_run_without_a_controller_is_drawn_too() {
        let (_folder, names, picture) = drawn(&record());
        assert_eq!(names, ["picture.svg"]);
        assert!(picture.contains("drive pressures") && !picture.contains("load force"));
    }

    #[test]
    fn a_step_of_the_load_gets_its_panels_and_a_picture_of_its_own() {
        let plain = record();
        let mut record = plain.clone();
        record.load =
            table(&[("set_force_N", &each_ms(0.0, 2.0, |time| if time < 1.0 { 100.0 } else { 300.0 }))]);
        record.load.set_states("main_chain", chain(&[("settling", 0.0), ("experiment", 0.5), ("", 2.0)]));
        record.experiment = "title = \"load-step\"\nabout = \"Fig. 9\"".parse().unwrap();
        let (folder, names, picture) = drawn(&record);
        assert_eq!(names, ["picture.svg", "step.svg"]);
        for part in ["load force", "load-step", "Fig. 9", "settling"] {
            assert!(picture.contains(part), "{part}");
        }
        let step = std::fs::read_to_string(folder.path().join("step.svg")).unwrap();
        assert!(step.contains("step of the force by 200 N at 1.000 s"));
        assert!(draw(folder.path(), &plain).is_ok());
        assert!(!folder.path().join("step.svg").exists(), "of an earlier summary");
    }
}
