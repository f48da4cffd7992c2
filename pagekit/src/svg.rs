//! Axes, lines and markers as inline SVG, in the colours of the stylesheet.
//!
//! Lines are distinguished by colour, dashes (both in the stylesheet, by class) and the shape of their markers; the reference is
//! a grey area. Drawings have a title and a description for who does not see them.

use crate::number;
use crate::page::escaped;
use std::fmt::Write as _;

/// A point of the drawing, in its own pixels.
pub type Point = (f64, f64);

/// From values to pixels.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    values: (f64, f64),
    pixels: (f64, f64),
    is_logarithmic: bool,
}

impl Scale {
    /// Equal steps for equal differences.
    pub fn linear(values: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { values, pixels, is_logarithmic: false }
    }

    /// Equal steps for equal ratios; both values are above zero.
    pub fn logarithmic(values: (f64, f64), pixels: (f64, f64)) -> Self {
        debug_assert!(values.0 > 0.0 && values.1 > 0.0, "a logarithm of nothing");
        Self { values, pixels, is_logarithmic: true }
    }

    /// Where a value stands; at the end of the axis when it is beyond it.
    pub fn at(&self, value: f64) -> f64 {
        let (low, high) = self.values;
        let value = if value.is_nan() { low } else { value.clamp(low, high) };
        let share = if self.is_logarithmic {
            (value / low).log10() / (high / low).log10()
        } else {
            (value - low) / (high - low)
        };
        let share = if share.is_finite() { share } else { 0.0 };
        self.pixels.0 + share * (self.pixels.1 - self.pixels.0)
    }

    /// Powers of ten on the axis.
    pub fn decades(&self) -> Vec<f64> {
        let (low, high) = self.values;
        let powers = low.log10().ceil() as i32..=high.log10().floor() as i32;
        powers.map(|power| 10f64.powi(power)).collect()
    }

    /// Values between the powers of ten, for faint lines.
    fn between_decades(&self) -> Vec<f64> {
        let (low, high) = self.values;
        let powers = low.log10().floor() as i32..=high.log10().floor() as i32;
        let steps = powers.flat_map(|power| (2..10).map(move |step| f64::from(step) * 10f64.powi(power)));
        steps.filter(|value| (low..=high).contains(value)).collect()
    }

    /// Round values on a linear axis, about as many as asked for.
    pub fn round_values(&self, about: f64) -> Vec<f64> {
        let (low, high) = self.values;
        let rough = (high - low) / about;
        if !rough.is_finite() || rough <= 0.0 {
            return vec![low];
        }
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= rough);
        let step = step.unwrap_or(10.0 * power);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        (first..=last).map(|index| index as f64 * step).collect()
    }
}

/// Decades that hold both values, above zero and one at least.
pub fn whole_decades(low: f64, high: f64) -> (f64, f64) {
    let low = 10f64.powf(low.max(1e-9).log10().floor());
    let high = 10f64.powf(high.max(low).log10().ceil());
    (low, high.max(10.0 * low))
}

/// Style of a curve, by its index in its chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveStyle {
    /// A distribution of airbench, with the colour of this index.
    Ours(usize),
    /// A distribution of a reference, with the style of this index.
    Reference(usize),
}

/// Styles that differ by colour and dashes.
const OURS: usize = 6;
const REFERENCES: usize = 2;

impl CurveStyle {
    /// Its class in the stylesheet.
    pub fn class(self) -> String {
        match self {
            Self::Ours(place) => format!("s{}", place % OURS),
            Self::Reference(place) => format!("r{}", place % REFERENCES),
        }
    }

    /// Its marker at a place.
    pub fn marker(self, place: Point, is_hollow: bool) -> String {
        let (x, y) = place;
        let hollow = if is_hollow { " hollow" } else { "" };
        let class = format!("class=\"marker{hollow} {}\"", self.class());
        let polygon = |corners: &[Point]| {
            let corners = corners.iter().map(|(dx, dy)| format!("{:.1},{:.1}", x + dx, y + dy));
            format!("<polygon {class} points=\"{}\"/>", corners.collect::<Vec<_>>().join(" "))
        };
        match self {
            Self::Ours(place) => match place % OURS {
                0 => format!("<circle {class} cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.2\"/>"),
                1 => polygon(&[(-3.9, -3.9), (3.9, -3.9), (3.9, 3.9), (-3.9, 3.9)]),
                2 => polygon(&[(0.0, -5.2), (4.8, 3.6), (-4.8, 3.6)]),
                3 => polygon(&[(0.0, -5.6), (5.0, 0.0), (0.0, 5.6), (-5.0, 0.0)]),
                4 => polygon(&[(0.0, 5.2), (4.8, -3.6), (-4.8, -3.6)]),
                _ => polygon(&[(5.0, 0.0), (2.5, 4.4), (-2.5, 4.4), (-5.0, 0.0), (-2.5, -4.4), (2.5, -4.4)]),
            },
            Self::Reference(0) => polygon(&[(-1.5, -5.5), (1.5, -5.5), (1.5, 5.5), (-1.5, 5.5)]),
            Self::Reference(_) => polygon(&[(-5.5, -1.5), (5.5, -1.5), (5.5, 1.5), (-5.5, 1.5)]),
        }
    }
}

/// A line through these places.
pub fn line(class: &str, places: &[Point]) -> String {
    let mut path = String::with_capacity(12 * places.len());
    for (place, (x, y)) in places.iter().enumerate() {
        let _ = write!(path, "{}{x:.1} {y:.1}", if place == 0 { 'M' } else { 'L' });
    }
    if path.is_empty() { path } else { format!("<path class=\"{class}\" d=\"{path}\"/>\n") }
}

/// A straight line.
pub fn stroke(class: &str, from: Point, to: Point) -> String {
    format!(
        "<line class=\"{class}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>\n",
        from.0, from.1, to.0, to.1
    )
}

/// Text at a place; the class says which end of it stands there.
pub fn text(class: &str, place: Point, words: &str) -> String {
    format!("<text class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n", place.0, place.1, escaped(words))
}

/// Rectangle between two corners; empty where they are the wrong way round.
pub fn bar(class: &str, from: Point, to: Point) -> String {
    format!(
        "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>\n",
        from.0,
        from.1,
        (to.0 - from.0).max(0.0),
        (to.1 - from.1).max(0.0)
    )
}

/// Ticks of a logarithmic axis of lengths of time: lines and labels, upright when it is the horizontal one.
pub fn time_axis(scale: &Scale, is_horizontal: bool, across: (f64, f64)) -> String {
    let mut drawn = String::new();
    let decades = scale.decades();
    for value in scale.decades().into_iter().chain(scale.between_decades()) {
        let at = scale.at(value);
        let is_decade = decades.contains(&value);
        let start = if is_decade { across.0 } else { across.1 + 0.02 * (across.0 - across.1) };
        let (from, to) =
            if is_horizontal { ((at, start), (at, across.1)) } else { ((start, at), (across.1, at)) };
        drawn += &stroke("grid", from, to);
        if is_decade {
            let label = number::tick_ns(value);
            drawn += &if is_horizontal {
                text("middle", (at, across.1 + 18.0), &label)
            } else {
                text("end", (across.1 - 7.0, at + 4.5), &label)
            };
        }
    }
    drawn
}

/// A whole drawing.
pub struct Drawing<'a> {
    /// Unique on the page.
    pub identifier: &'a str,
    /// Width and height.
    pub size: (f64, f64),
    /// What it is.
    pub title: &'a str,
    /// What is to be seen on it, in words.
    pub description: &'a str,
}

impl Drawing<'_> {
    /// The drawing with this inside.
    pub fn with(&self, markup: &str) -> String {
        let (id, (width, height)) = (self.identifier, self.size);
        format!(
            "<svg class=\"plot\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-labelledby=\"{id}-t {id}-d\">\n\
             <title id=\"{id}-t\">{}</title>\n<desc id=\"{id}-d\">{}</desc>\n{markup}</svg>\n",
            escaped(self.title),
            escaped(self.description)
        )
    }
}

/// An entry of a legend: a piece of the line with its marker, and its name.
pub fn legend_entry(sample: &str, name: &str) -> String {
    format!(
        "<li><svg viewBox=\"0 0 38 14\" aria-hidden=\"true\">{sample}</svg><span>{}</span></li>\n",
        escaped(name)
    )
}

/// The piece of a legend that shows a curve.
pub fn curve_sample(style: CurveStyle) -> String {
    let area = match style {
        CurveStyle::Reference(0) => bar("area", (1.0, 4.0), (37.0, 13.0)),
        _ => String::new(),
    };
    let line = line(&format!("line {}", style.class()), &[(1.0, 7.0), (37.0, 7.0)]);
    format!("{area}{line}{}", style.marker((19.0, 7.0), false))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_keeps_what_is_beyond_it_on_its_ends() {
        let scale = Scale::logarithmic((10.0, 1000.0), (0.0, 200.0));
        assert_eq!([1.0, 10.0, 100.0, 1e9].map(|value| scale.at(value)), [0.0, 0.0, 100.0, 200.0]);
        assert_eq!(scale.at(f64::NAN), 0.0);
        assert_eq!(scale.decades(), [10.0, 100.0, 1000.0]);
        assert_eq!(Scale::linear((5.0, 5.0), (0.0, 9.0)).at(5.0), 0.0, "no length is no trouble");
    }

    #[test]
    fn round_values_are_round() {
        let scale = Scale::linear((-3.0, 61.0), (0.0, 100.0));
        assert_eq!(scale.round_values(7.0), [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0]);
        assert_eq!(scale.round_values(40.0)[..3], [-2.0, 0.0, 2.0]);
        assert_eq!(whole_decades(13.0, 99.0), (10.0, 100.0));
        assert_eq!(whole_decades(10.0, 10.0), (10.0, 100.0));
    }
}
