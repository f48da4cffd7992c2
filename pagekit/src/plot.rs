//! Axes, lines, bands and bars as inline SVG, in the colours and dashes of the stylesheet.
//!
//! Every drawing is [`WIDTH`] wide and stands in a column of at most twice a telephone's width, so that its letters are about as
//! large as the text's on any screen. Drawings have a title and a description for who does not see them.

mod decimate;

pub use decimate::{COLUMNS, Column, columns};

use crate::page::escaped;
use crate::significant;
use crate::svg::{Drawing, Scale, legend_entry, stroke, text};
use std::fmt::Write as _;

/// Width of all drawings, in user units.
pub const WIDTH: f64 = 420.0;
const LEFT: f64 = 54.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 24.0;
const FOOT: f64 = 40.0;
/// Height of what is inside the axes.
const BODY: f64 = 176.0;

/// Round values of an axis, about as many as asked for, as they are written.
fn ticks(scale: &Scale, about: f64) -> Vec<(f64, String)> {
    let values = scale.round_values(about);
    let [first, second, ..] = values[..] else { return Vec::new() };
    let digits = (-(second - first).log10().floor()).clamp(0.0, 9.0) as usize;
    let large = values.iter().fold(0.0_f64, |large, value| large.max(value.abs()));
    let written = |value: f64| {
        if (1e-4..1e5).contains(&large) {
            significant::fixed(value, digits)
        } else {
            significant::short(value)
        }
    };
    values.iter().map(|value| (*value, written(*value))).collect()
}

/// Smallest and largest finite value; `None` without any.
pub fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold(start, |(low, high), value| (low.min(value), high.max(value)));
    (low <= high).then_some((low, high))
}

/// A pair of axes with what is drawn between them.
pub struct Plot {
    x: Scale,
    y: Scale,
    body: String,
}

impl Plot {
    /// Empty axes over these ranges; a range without length gets some. The labels have their units.
    pub fn new(x: (f64, f64), y: (f64, f64), x_label: &str, y_label: &str) -> Self {
        let wide = |(low, high): (f64, f64), room: f64| {
            let more = if high > low { (high - low) * room } else { low.abs().max(1.0) * 0.5 };
            (low - more, high + more)
        };
        let (y_low, y_high) = wide(y, 0.06);
        let (x_low, x_high) = if x.1 > x.0 { x } else { wide(x, 0.0) };
        let mut plot = Plot {
            x: Scale::linear((x_low, x_high), (LEFT, WIDTH - RIGHT)),
            y: Scale::linear((y_low, y_high), (TOP + BODY, TOP)),
            body: String::new(),
        };
        for (value, label) in ticks(&plot.y, 5.0) {
            let at = plot.y.at(value);
            plot.body += &stroke("grid", (LEFT, at), (WIDTH - RIGHT, at));
            plot.body += &text("end", (LEFT - 6.0, at + 4.5), &label);
        }
        for (value, label) in ticks(&plot.x, 6.0) {
            let at = plot.x.at(value);
            plot.body += &stroke("edge", (at, TOP + BODY), (at, TOP + BODY + 4.0));
            plot.body += &text("middle", (at, TOP + BODY + 18.0), &label);
        }
        plot.body += &stroke("edge", (LEFT, TOP + BODY), (WIDTH - RIGHT, TOP + BODY));
        plot.body += &text("", (4.0, 14.0), y_label);
        plot.body += &text("end", (WIDTH - RIGHT, TOP + BODY + 34.0), x_label);
        plot
    }

    /// A stretch of the horizontal axis that is marked.
    pub fn stretch(&mut self, from: f64, to: f64) {
        let (from, to) = (self.x.at(from), self.x.at(to));
        let _ = writeln!(
            self.body,
            "<rect x=\"{from:.1}\" y=\"{TOP}\" width=\"{:.1}\" height=\"{BODY}\" style=\"fill:var(--mark)\"/>",
            (to - from).max(3.0)
        );
    }

    /// All between two levels.
    pub fn between(&mut self, low: f64, high: f64) {
        let (top, bottom) = (self.y.at(high), self.y.at(low));
        let _ = writeln!(
            self.body,
            "<rect class=\"area\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            WIDTH - RIGHT - LEFT,
            (bottom - top).max(1.0)
        );
    }

    /// A dashed level with its name.
    pub fn level(&mut self, value: f64) {
        let at = self.y.at(value);
        self.body += &stroke("cut", (LEFT, at), (WIDTH - RIGHT, at));
    }

    /// A band around a curve.
    pub fn band(&mut self, at: &[f64], low: &[f64], high: &[f64]) {
        let there = at.iter().zip(high).chain(at.iter().zip(low).rev());
        self.path("area", there.map(|(x, y)| (*x, *y)), true);
    }

    /// A line, broken where a value is missing.
    pub fn line(&mut self, class: &str, points: impl Iterator<Item = (f64, f64)>) {
        let points: Vec<_> = points.collect();
        for piece in points.split(|(x, y)| !x.is_finite() || !y.is_finite()) {
            self.path(class, piece.iter().copied(), false);
        }
    }

    /// A long series: a line where each column has one value, else the area between smallest and largest.
    pub fn series(&mut self, line: &str, area: &str, pieces: &[Vec<Column>]) {
        for piece in pieces {
            let is_line = piece.iter().all(|column| column.low == column.high);
            let upper = piece.iter().map(|column| (column.time_s, column.high));
            if is_line {
                self.path(line, upper, false);
            } else {
                let lower = piece.iter().rev().map(|column| (column.time_s, column.low));
                self.path(area, upper.chain(lower), true);
            }
        }
    }

    fn path(&mut self, class: &str, points: impl Iterator<Item = (f64, f64)>, is_closed: bool) {
        let mut path = String::new();
        for (place, (x, y)) in points.filter(|(x, y)| x.is_finite() && y.is_finite()).enumerate() {
            let letter = if place == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{letter}{:.1} {:.1}", self.x.at(x), self.y.at(y));
        }
        if !path.is_empty() {
            let end = if is_closed { "Z" } else { "" };
            let _ = writeln!(self.body, "<path class=\"{class}\" d=\"{path}{end}\"/>");
        }
    }

    /// The drawing, with a title and a description for who does not see it.
    #[must_use]
    pub fn drawn(self, identifier: &str, title: &str, description: &str) -> String {
        svg(identifier, TOP + BODY + FOOT, title, description, &self.body)
    }
}

/// A bar of [`bars`] or [`share_bars`].
pub struct Bar {
    /// Its name, above it.
    pub label: String,
    /// Its length, over the line at 1.
    pub value: f64,
    /// What stands behind it.
    pub text: String,
    /// Whether it counts; else it is hollow.
    pub is_full: bool,
}

/// Height of a bar with its words.
const BAR_ROW: f64 = 36.0;

/// Bars over a logarithmic axis with a line at 1, which they start from: to the right of it is more than noise or chance.
pub fn bars(identifier: &str, title: &str, bars: &[Bar]) -> String {
    let largest = bars.iter().map(|bar| bar.value).filter(|value| value.is_finite()).fold(3.0, f64::max);
    let scale = Scale::logarithmic((0.3, largest), (8.0, WIDTH - 14.0));
    let place = |value: f64| scale.at(if value.is_nan() { 1.0 } else { value });
    let decades = (1..=(largest.log10().floor() as i32)).map(|power| 10f64.powi(power));
    let ticks: Vec<(f64, String)> = decades.map(|at| (at, significant::round(at))).collect();
    bars_from((identifier, title), bars, place, (1.0, "1"), &ticks)
}

/// Bars of shares, from 0 to 1.
pub fn share_bars(identifier: &str, title: &str, bars: &[Bar]) -> String {
    let scale = Scale::linear((0.0, 1.0), (8.0, WIDTH - 14.0));
    let ticks: Vec<(f64, String)> = [0.5, 0.9].map(|at| (at, significant::percent(at))).into();
    bars_from((identifier, title), bars, |value| scale.at(value.clamp(0.0, 1.0)), (0.0, "0"), &ticks)
}

/// Bars that start at a line; the grid has a line at each tick.
fn bars_from(
    (identifier, title): (&str, &str),
    bars: &[Bar],
    place: impl Fn(f64) -> f64,
    (start, start_label): (f64, &str),
    ticks: &[(f64, String)],
) -> String {
    let bottom = 6.0 + BAR_ROW * bars.len() as f64;
    let edge = place(start);
    let mut body = String::new();
    for (value, label) in ticks {
        let at = place(*value);
        body += &stroke("grid", (at, 4.0), (at, bottom));
        body += &text("middle", (at, bottom + 16.0), label);
    }
    body += &stroke("edge", (edge, 4.0), (edge, bottom + 4.0));
    body += &text("middle", (edge, bottom + 16.0), start_label);
    for (row, bar) in bars.iter().enumerate() {
        let top = 6.0 + BAR_ROW * row as f64;
        let at = place(bar.value);
        let class = if bar.is_full { "bar s1" } else { "bar wait s1" };
        let _ = writeln!(
            body,
            "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"11\"/>",
            at.min(edge),
            top + 19.0,
            (at - edge).abs().max(1.0)
        );
        body += &text("name", (8.0, top + 14.0), &bar.label);
        body += &text("end name", (WIDTH - 8.0, top + 14.0), &bar.text);
    }
    let described: Vec<String> = bars.iter().map(|bar| format!("{}: {}.", bar.label, bar.text)).collect();
    svg(identifier, bottom + 24.0, title, &described.join(" "), &body)
}

fn svg(identifier: &str, height: f64, title: &str, description: &str, body: &str) -> String {
    Drawing { identifier, size: (WIDTH, height), title, description }.with(body)
}

/// How an entry of a legend is drawn.
#[derive(Clone, Copy)]
pub enum Sample {
    /// A line of this class.
    Line(&'static str),
    /// An area of this class.
    Area(&'static str),
}

/// A drawing with its caption, what is said below it, and the names of its curves.
pub fn figure(caption: &str, about: &str, legend: &[(Sample, &str)], drawing: &str) -> String {
    let entry = |(sample, name): &(Sample, &str)| {
        let inside = match sample {
            Sample::Line(class) => format!("<path class=\"{class}\" d=\"M1 7L37 7\"/>"),
            Sample::Area(class) => {
                format!("<rect class=\"{class}\" x=\"1\" y=\"2\" width=\"36\" height=\"10\"/>")
            }
        };
        legend_entry(&inside, name)
    };
    let legend: String = legend.iter().map(entry).collect();
    let legend = if legend.is_empty() { legend } else { format!("<ul class=\"legend\">\n{legend}</ul>\n") };
    let about = if about.is_empty() {
        String::new()
    } else {
        format!("<br/><span class=\"soft\">{}</span>", escaped(about))
    };
    format!(
        "<figure style=\"max-width:36rem\">\n<figcaption>{}{about}</figcaption>\n{legend}{drawing}</figure>\n",
        escaped(caption)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_distinct() {
        let of = |low, high| ticks(&Scale::linear((low, high), (0.0, 1.0)), 7.0);
        let texts = of(-3.0, 61.0).into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(texts, ["0", "10", "20", "30", "40", "50", "60"]);
        assert_eq!(of(0.0, 0.05)[1].1, "0.01");
        assert!(of(1.0, 1.0).is_empty());
        assert_eq!(Scale::linear((-3.0, 61.0), (0.0, 1.0)).at(1e9), 1.0);
    }

    #[test]
    fn a_series_with_a_hole_is_two_paths() {
        let mut plot = Plot::new((0.0, 3.0), (0.0, 1.0), "s", "m");
        plot.line("line s0", [(0.0, 1.0), (1.0, f64::NAN), (2.0, 1.0), (3.0, 0.0)].into_iter());
        assert_eq!(plot.drawn("a", "b", "c").matches("<path").count(), 2);
    }
}
