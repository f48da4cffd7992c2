//! The picture of a run: set-point and position, error, valve, pressures, one above the other on one time axis.
//!
//! Drawn from `measurement.csv` and `controller.csv` alone. Colours are those of Okabe and Ito, told apart by colour-blind
//! people; the second curve of a panel is thinner, so that black and white does. Of the samples that fall into one
//! pixel column the smallest and the largest are drawn: no spike is lost, and a minute is as small as a second.

use crate::{SummaryError, tables_read};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::path::Path;

const SIZE: (u32, u32) = (1100, 1000);
const BLUE: RGBColor = RGBColor(0, 114, 178);
const VERMILION: RGBColor = RGBColor(213, 94, 0);
const GREEN: RGBColor = RGBColor(0, 158, 115);
/// Columns of pixels that a curve is thinned to.
const COLUMNS: usize = 1000;
/// Rows of pixels in a panel, and some for the width of a line.
const ROWS: f64 = 100.0;

const METRE_IN_MM: f64 = 1e3;
const PASCAL_IN_BAR: f64 = 1e-5;
const PER_CENT: f64 = 100.0;

type Samples = Vec<(f64, f64)>;
type Failure = Box<dyn std::error::Error>;

struct Curve {
    name: &'static str,
    colour: RGBColor,
    width: u32,
    samples: Samples,
}

struct Panel {
    title: &'static str,
    curves: Vec<Curve>,
}

/// Draws `picture.svg` of the run in `folder`.
///
/// # Errors
/// [`SummaryError`] when a table cannot be read or the picture cannot be written.
pub fn draw(folder: &Path, has_controller: bool) -> Result<(), SummaryError> {
    let panels = panels(folder, has_controller)?;
    let path = folder.join("picture.svg");
    draw_panels(&path, &panels).map_err(|error| SummaryError::write(&path, error))
}

fn panels(folder: &Path, has_controller: bool) -> Result<Vec<Panel>, SummaryError> {
    let names = ["drive_position_m", "drive_valve", "drive_pressure_a_Pa", "drive_pressure_b_Pa"];
    let measured = tables_read::columns(&folder.join("measurement.csv"), &names)?;
    let set_point = if has_controller {
        tables_read::columns(&folder.join("controller.csv"), &["drive_set_point_m"])?.remove(0)
    } else {
        Samples::new()
    };
    let [position, valve, cap, rod] = <[Samples; 4]>::try_from(measured)
        .unwrap_or_else(|columns| unreachable!("asked for four columns, got {}", columns.len()));
    let error = difference(&set_point, &position);
    let curve = |name, colour, width, samples: Samples, factor: f64| Curve {
        name,
        colour,
        width,
        samples: samples.into_iter().map(|(time, value)| (time, value * factor)).collect(),
    };
    Ok(vec![
        Panel {
            title: "drive position, mm",
            curves: vec![
                curve("position", BLUE, 3, position, METRE_IN_MM),
                curve("set-point", VERMILION, 1, set_point, METRE_IN_MM),
            ],
        },
        Panel {
            title: "set-point - position, mm",
            curves: vec![curve("error", BLUE, 1, error, METRE_IN_MM)],
        },
        Panel { title: "drive valve opening, %", curves: vec![curve("valve", BLUE, 1, valve, PER_CENT)] },
        Panel {
            title: "drive pressures, bar absolute",
            curves: vec![
                curve("a, cap side", BLUE, 2, cap, PASCAL_IN_BAR),
                curve("b, rod side", GREEN, 1, rod, PASCAL_IN_BAR),
            ],
        },
    ])
}

/// Set-point less position where both have a sample of the same time; both grow in time.
fn difference(set_point: &Samples, position: &Samples) -> Samples {
    let mut positions = position.iter().peekable();
    let mut result = Samples::new();
    for (time, wanted) in set_point {
        while positions.next_if(|(earlier, _)| earlier < time).is_some() {}
        if let Some((_, is)) = positions.next_if(|(same, _)| same == time) {
            result.push((*time, wanted - is));
        }
    }
    result
}

fn draw_panels(path: &Path, panels: &[Panel]) -> Result<(), Failure> {
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let end = panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| curve.samples.last());
    let end_s = end.map(|(time, _)| *time).fold(1e-3, f64::max);
    for (area, panel) in root.split_evenly((panels.len(), 1)).iter().zip(panels) {
        draw_panel(area, panel, end_s)?;
    }
    root.present()?;
    Ok(())
}

fn draw_panel(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    panel: &Panel,
    end_s: f64,
) -> Result<(), Failure> {
    let (low, high) = value_range(panel);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24)
        .caption(panel.title, ("sans-serif", 17))
        .x_label_area_size(28)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..end_s, low..high)?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .label_style(("sans-serif", 13))
        .max_light_lines(0)
        .bold_line_style(BLACK.mix(0.18))
        .draw()?;
    for curve in &panel.curves {
        draw_curve(&mut chart, thinned(&curve.samples, end_s, (high - low) / ROWS), curve)?;
    }
    if panel.curves.len() > 1 {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .label_font(("sans-serif", 13))
            .draw()?;
    }
    Ok(())
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn draw_curve(chart: &mut Chart<'_, '_>, thin: Samples, curve: &Curve) -> Result<(), Failure> {
    let style = ShapeStyle { color: curve.colour.to_rgba(), filled: false, stroke_width: curve.width };
    chart
        .draw_series(LineSeries::new(thin, style))?
        .label(curve.name)
        .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    Ok(())
}

/// Smallest and largest value of each pixel column, in the order in which they came; one where they differ by less than
/// `pixel`, since a line that goes up and down within a pixel draws spikes at its corners.
fn thinned(samples: &Samples, end_s: f64, pixel: f64) -> Samples {
    let column = |time: f64| (time / end_s * COLUMNS as f64) as usize;
    samples
        .chunk_by(|(one, _), (other, _)| column(*one) == column(*other))
        .flat_map(|chunk| {
            let by_value = |one: &&(f64, f64), other: &&(f64, f64)| one.1.total_cmp(&other.1);
            let extremes = chunk.iter().min_by(by_value).into_iter().chain(chunk.iter().max_by(by_value));
            let mut extremes: Samples = extremes.copied().collect();
            if extremes[1].1 - extremes[0].1 < pixel {
                extremes.pop();
            }
            extremes.sort_by(|one, other| one.0.total_cmp(&other.0));
            extremes
        })
        .collect()
}

/// The values of a panel with a little room; a flat line gets room of one.
fn value_range(panel: &Panel) -> (f64, f64) {
    let values = panel.curves.iter().flat_map(|curve| &curve.samples).map(|(_, value)| *value);
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return (0.0, 1.0);
    }
    let room = if high > low { (high - low) * 0.06 } else { 0.5 };
    (low - room, high + room)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_every_spike() {
        let mut samples: Samples = (0..60_000).map(|ms| (f64::from(ms) * 1e-3, 0.0)).collect();
        samples[31_416].1 = 7.0;
        let thin = thinned(&samples, 60.0, 0.1);
        assert!(thin.len() <= 2 * (COLUMNS + 1));
        assert!(thin.contains(&(31.416, 7.0)));
        assert!(thin.is_sorted_by(|one, other| one.0 <= other.0));
    }

    #[test]
    fn the_error_is_taken_where_both_have_a_sample() {
        let set_point = vec![(0.002, 1.0), (0.003, 2.0), (0.005, 3.0)];
        let position = vec![(0.0, 9.0), (0.001, 9.0), (0.002, 0.5), (0.003, 0.5), (0.004, 0.5)];
        assert_eq!(difference(&set_point, &position), [(0.002, 0.5), (0.003, 1.5)]);
    }

    #[test]
    fn a_run_without_a_controller_is_drawn_too() {
        let folder = tempfile::tempdir().unwrap();
        let head = "time_s,drive_valve,drive_position_m,drive_pressure_a_Pa,drive_pressure_b_Pa";
        std::fs::write(folder.path().join("measurement.csv"), format!("{head}\n0.000,0,0.1,3e5,3e5\n"))
            .unwrap();
        draw(folder.path(), false).unwrap();
        let picture = std::fs::read_to_string(folder.path().join("picture.svg")).unwrap();
        assert!(picture.starts_with("<svg") && picture.contains("drive pressures"));
    }
}
