//! Panels side by side: rates with their intervals over a logarithmic axis.

use super::Curve;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

pub(super) struct Panel<'a> {
    pub(super) title: &'a str,
    /// Labelled positions of the axis; the outermost ones define its range.
    pub(super) ticks: Vec<(f64, String)>,
    pub(super) curves: &'a [Curve],
}

/// Colours of Okabe and Ito, distinguished by colour-blind people.
const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
];
const WIDTH: u32 = 1100;
const HEIGHT: u32 = 440;
/// Margins around the axes of a panel, in pixels.
const LEFT: i32 = 60;
const RIGHT: i32 = 20;
const BOTTOM: i32 = 34;
const TITLE: i32 = 30;
const LEGEND: i32 = 18;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure = Box<dyn std::error::Error>;

pub(super) fn svg(panels: [Panel<'_>; 2]) -> Result<String, String> {
    let mut text = String::new();
    draw(&mut text, &panels).map_err(|error| error.to_string())?;
    Ok(text)
}

fn draw(text: &mut String, panels: &[Panel<'_>; 2]) -> Result<(), Failure> {
    let root = SVGBackend::with_string(text, (WIDTH, HEIGHT)).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(WIDTH / 2);
    draw_panel(&left, &panels[0])?;
    draw_panel(&right, &panels[1])?;
    root.present()?;
    Ok(())
}

fn draw_panel(area: &Area<'_>, panel: &Panel<'_>) -> Result<(), Failure> {
    let font = |size: f64| ("sans-serif", size).into_text_style(area);
    let (width, height) = area.dim_in_pixel();
    let (width, height) = (width as i32 - RIGHT, height as i32 - BOTTOM);
    let top = TITLE + LEGEND * panel.curves.len() as i32 + 8;
    area.draw_text(panel.title, &font(16.0), (LEFT, 8))?;

    let places = || panel.ticks.iter().map(|(place, _)| place.log10());
    let [least, most] = [places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max)];
    // Half a tick beyond the outermost; a single one is in the middle.
    let margin = ((most - least) / panel.ticks.len() as f64 / 2.0).max(0.1);
    let x = |place: f64| {
        let share = (place.log10() - least + margin) / (most - least + 2.0 * margin);
        LEFT + (share * f64::from(width - LEFT)).round() as i32
    };
    let y = |share: f64| height - (share * f64::from(height - top)).round() as i32;

    let faint = BLACK.mix(0.15);
    for percent in [0, 20, 40, 60, 80, 100] {
        let at = y(f64::from(percent) / 100.0);
        area.draw(&PathElement::new(vec![(LEFT, at), (width, at)], faint))?;
        let style = font(13.0).pos(Pos::new(HPos::Right, VPos::Center));
        area.draw_text(&format!("{percent} %"), &style, (LEFT - 6, at))?;
    }
    for (place, name) in &panel.ticks {
        area.draw(&PathElement::new(vec![(x(*place), top), (x(*place), height)], faint))?;
        let style = font(12.0).pos(Pos::new(HPos::Center, VPos::Top));
        area.draw_text(name, &style, (x(*place), height + 8))?;
    }
    for (at, curve) in panel.curves.iter().enumerate() {
        let colour = COLOURS[at % COLOURS.len()];
        // Curves are offset where their intervals would hide each other.
        let aside = 4 * at as i32 - 2 * (panel.curves.len() as i32 - 1);
        let reported =
            || curve.points.iter().filter_map(|(place, rate)| Some((*place, rate.share?, rate.interval)));
        let line: Vec<_> = reported().map(|(place, share, _)| (x(place) + aside, y(share))).collect();
        area.draw(&PathElement::new(line.clone(), colour.stroke_width(2)))?;
        for ((place, _, [low, high]), point) in reported().zip(line) {
            let bar = [low, high].map(|end| (x(place) + aside, y(end)));
            area.draw(&PathElement::new(bar.to_vec(), colour))?;
            area.draw(&Circle::new(point, 4, colour.filled()))?;
        }
        let middle = TITLE + LEGEND * at as i32 + 8;
        area.draw(&PathElement::new(vec![(LEFT, middle), (LEFT + 22, middle)], colour.stroke_width(2)))?;
        let style = font(13.0).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw_text(&curve.name, &style, (LEFT + 28, middle))?;
    }
    Ok(())
}
