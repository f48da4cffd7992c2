//! Panels on a common time axis, as SVG, for pictures of runs and comparisons.
//!
//! Colours are those of Okabe and Ito, which colour-blind people can distinguish; where there are few curves they differ in
//! width too, for black and white. Of the samples in a pixel column the smallest and the largest are drawn: no spike is lost,
//! and the size of the file does not depend on the length. Legends stand above the curves.

use crate::series::{Series, Span};
use plotters::coord::Shift;
use plotters::prelude::*;
pub use plotters::style::BLACK;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colours in the order of their use.
pub const COLOURS: [RGBColor; 7] = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK];
/// Measured values.
pub(crate) const BLUE: RGBColor = RGBColor(0, 114, 178);
/// Set-points.
pub(crate) const VERMILION: RGBColor = RGBColor(213, 94, 0);
/// A second measured value.
pub(crate) const GREEN: RGBColor = RGBColor(0, 158, 115);
/// A third measured value.
pub(crate) const PURPLE: RGBColor = RGBColor(204, 121, 167);
const ORANGE: RGBColor = RGBColor(230, 159, 0);
const SKY: RGBColor = RGBColor(86, 180, 233);

const WIDTH: u32 = 1100;
const LEFT: u32 = 72;
const RIGHT: u32 = 24;
/// Heights, in pixels.
const TITLE: u32 = 28;
const LINE: u32 = 19;
const STRIP: u32 = 58;
const PANEL_HEAD: u32 = 24;
const PANEL_BODY: u32 = 172;
const TIME_LABEL: u32 = 20;
/// Pixel columns of a curve.
const COLUMNS: f64 = (WIDTH - LEFT - RIGHT) as f64;
/// Shortest pause between samples that breaks a line, s.
const GAP_S: f64 = 0.05;
/// Mean width of a letter, relative to the height of its font.
const LETTER: f64 = 0.53;

/// A line of a panel.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Entry of the legend.
    pub name: String,
    /// Line colour.
    pub colour: RGBColor,
    /// Line width, pixels.
    pub width: u32,
    /// Values over time, in the unit of the panel.
    pub samples: Series,
}

/// A pair of axes with its curves.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Quantity and unit.
    pub title: String,
    /// Its curves, drawn in this order.
    pub curves: Vec<Curve>,
}

/// A named interval of the time axis.
#[derive(Clone, Debug)]
pub struct Band {
    /// Text in the strip.
    pub label: String,
    /// Where the interval lies.
    pub span: Span,
    /// Whether the interval is the subject of the picture, which stays white.
    pub is_main: bool,
}

/// Panels one below the other, on one time axis.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Heading.
    pub title: String,
    /// Text below the heading, wrapped.
    pub caption: String,
    /// Name and unit of the time axis.
    pub time_name: String,
    /// Time range of the picture.
    pub range: Span,
    /// Instant of a vertical line, s.
    pub mark_s: Option<f64>,
    /// Intervals of the strip above the panels; no strip when empty.
    pub bands: Vec<Band>,
    /// The panels; those without samples are left out.
    pub panels: Vec<Panel>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure = Box<dyn std::error::Error>;

impl Picture {
    /// The picture as SVG.
    ///
    /// # Errors
    ///
    /// The plotting library's own words, if it cannot draw.
    pub fn svg(&self) -> Result<String, String> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|error| error.to_string())?;
        Ok(text)
    }

    fn draw(&self, text: &mut String) -> Result<(), Failure> {
        let lines = wrapped(&self.caption, ((WIDTH - 2 * RIGHT) as f64 / (14.0 * LETTER)) as usize);
        let panels: Vec<_> = self.panels.iter().filter_map(|panel| self.cut(panel)).collect();
        let bands: Vec<_> =
            self.bands.iter().filter(|band| band.span.common(&self.range).is_some()).collect();
        let strip = if bands.is_empty() { 8 } else { STRIP };
        let head = TITLE + LINE * lines.len() as u32 + 4;
        let height = |panel: &Panel| head_height(panel) + PANEL_BODY;
        let body = panels.iter().map(height).sum::<u32>() + TIME_LABEL;
        let root = SVGBackend::with_string(text, (WIDTH, head + strip + body)).into_drawing_area();
        root.fill(&WHITE)?;
        let font = |size: f64| ("sans-serif", size).into_text_style(&root);
        root.draw_text(&self.title, &font(20.0), (RIGHT as i32, 8))?;
        for (place, line) in lines.iter().enumerate() {
            root.draw_text(
                line,
                &font(14.0).color(&BLACK.mix(0.75)),
                (RIGHT as i32, (TITLE + 4 + LINE * place as u32) as i32),
            )?;
        }
        let (_, rest) = root.split_vertically(head);
        let (strip, rest) = rest.split_vertically(strip);
        self.draw_strip(&strip, &bands)?;
        let mut foot = rest;
        for panel in &panels {
            let (area, below) = foot.split_vertically(height(panel));
            self.draw_panel(&area, panel, &bands)?;
            foot = below;
        }
        let centred = font(14.0).pos(Pos::new(HPos::Center, VPos::Top));
        foot.draw_text(&self.time_name, &centred, ((LEFT + (WIDTH - LEFT - RIGHT) / 2) as i32, 0))?;
        root.present()?;
        Ok(())
    }

    /// The panel within the range; `None` without samples in it.
    fn cut(&self, panel: &Panel) -> Option<Panel> {
        let cut = |curve: &Curve| Curve { samples: curve.samples.within(&self.range), ..curve.clone() };
        let curves: Vec<_> = panel.curves.iter().map(cut).filter(|curve| !curve.samples.is_empty()).collect();
        (!curves.is_empty()).then(|| Panel { title: panel.title.clone(), curves })
    }

    fn column(&self, time_s: f64) -> f64 {
        ((time_s - self.range.from_s) / self.range.length_s()).clamp(0.0, 1.0) * COLUMNS
    }

    /// Names of the intervals: inside where they fit, else below where there is room.
    fn draw_strip(&self, area: &Area<'_>, bands: &[&Band]) -> Result<(), Failure> {
        const FONT: f64 = 13.0;
        let mut free_below = [0.0; 2];
        for (place, band) in bands.iter().enumerate() {
            let (from, to) = (self.column(band.span.from_s), self.column(band.span.to_s));
            let (left, right) = (LEFT as f64 + from, LEFT as f64 + to);
            let fill = if band.is_main {
                SKY.mix(0.35)
            } else {
                BLACK.mix(if place % 2 == 0 { 0.06 } else { 0.13 })
            };
            area.draw(&Rectangle::new([(left as i32, 2), (right as i32, 20)], fill.filled()))?;
            let width = band.label.chars().count() as f64 * FONT * LETTER;
            let style = ("sans-serif", FONT).into_text_style(area);
            if width + 4.0 < right - left {
                let style = style.pos(Pos::new(HPos::Center, VPos::Center));
                area.draw_text(&band.label, &style, ((0.5 * (left + right)) as i32, 11))?;
            } else if let Some(row) = free_below.iter().position(|free| left >= *free) {
                let start = left.min(WIDTH as f64 - width - 4.0);
                let y = 24 + 16 * row as i32;
                area.draw(&PathElement::new([(left as i32, 20), (left as i32, y + 12)], BLACK.mix(0.5)))?;
                area.draw_text(&band.label, &style, (start as i32 + 3, y))?;
                free_below[row] = start + width + 10.0;
            }
        }
        Ok(())
    }

    fn draw_panel(&self, area: &Area<'_>, panel: &Panel, bands: &[&Band]) -> Result<(), Failure> {
        let (head, body) = area.split_vertically(head_height(panel));
        draw_legend(&head, panel)?;
        let (low, high) = value_range(panel);
        let mut chart = ChartBuilder::on(&body)
            .margin_right(RIGHT)
            .x_label_area_size(22)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(self.range.from_s..self.range.to_s, low..high)?;
        for (place, band) in bands.iter().enumerate().filter(|(_, band)| !band.is_main) {
            if let Some(shown) = band.span.common(&self.range) {
                let fill = BLACK.mix(if place % 2 == 0 { 0.04 } else { 0.08 }).filled();
                chart.draw_series([Rectangle::new([(shown.from_s, low), (shown.to_s, high)], fill)])?;
            }
        }
        chart
            .configure_mesh()
            .x_labels(14)
            .y_labels(6)
            .x_label_formatter(&|time| tick(*time, self.range.length_s()))
            .y_label_formatter(&|value| tick(*value, high - low))
            .label_style(("sans-serif", 13))
            .max_light_lines(0)
            .bold_line_style(BLACK.mix(0.15))
            .draw()?;
        if let Some(mark) = self.mark_s.filter(|mark| self.range.holds(*mark)) {
            chart.draw_series([PathElement::new([(mark, low), (mark, high)], BLACK.mix(0.6))])?;
        }
        let pixel = (high - low) / f64::from(PANEL_BODY);
        for curve in &panel.curves {
            let style =
                ShapeStyle { color: curve.colour.to_rgba(), filled: false, stroke_width: curve.width };
            for piece in pieces(&curve.samples) {
                let samples = thinned(&piece, |time| self.column(time) as usize, pixel);
                chart.draw_series(LineSeries::new(samples, style))?;
            }
        }
        Ok(())
    }
}

/// Label of a tick, with as many digits as neighbouring ticks need.
fn tick(value: f64, length_value: f64) -> String {
    let digits = (1.0 - length_value.log10()).ceil().clamp(0.0, 9.0) as usize;
    let text = format!("{value:.digits$}");
    // Rounding may leave a negative zero.
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        text.replace('-', "")
    } else {
        text
    }
}

const LEGEND_FONT: f64 = 14.0;

/// Position of each entry of the legend, in pixels from the left and in rows; entries start after the title if they fit.
fn legend_places(panel: &Panel) -> Vec<(i32, i32)> {
    let width = |text: &str| text.chars().count() as f64 * LEGEND_FONT * LETTER;
    let start = f64::from(LEFT) + width(&panel.title) + 28.0;
    let (mut x, mut row) = (start, 0);
    let place = |curve: &Curve| {
        let length = 28.0 + width(&curve.name);
        if x > start && x + length > f64::from(WIDTH - RIGHT) {
            (x, row) = (start, row + 1);
        }
        let place = (x as i32, row);
        x += length + 20.0;
        place
    };
    panel.curves.iter().map(place).collect()
}

fn head_height(panel: &Panel) -> u32 {
    let rows = legend_places(panel).last().map_or(0, |(_, row)| *row);
    PANEL_HEAD + LINE * rows.unsigned_abs()
}

/// The title of a panel on the left, the names of its curves after it.
fn draw_legend(area: &Area<'_>, panel: &Panel) -> Result<(), Failure> {
    let style = ("sans-serif", LEGEND_FONT).into_text_style(area).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw_text(&panel.title, &style, (LEFT as i32, 14))?;
    for (curve, (x, row)) in panel.curves.iter().zip(legend_places(panel)) {
        let y = 14 + LINE as i32 * row;
        let line =
            ShapeStyle { color: curve.colour.to_rgba(), filled: false, stroke_width: curve.width.max(2) };
        area.draw(&PathElement::new([(x, y), (x + 22, y)], line))?;
        area.draw_text(&curve.name, &style, (x + 28, y))?;
    }
    Ok(())
}

/// The samples split at pauses.
fn pieces(samples: &Series) -> Vec<Vec<(f64, f64)>> {
    let gap_s = GAP_S.max(3.0 * samples.period_s());
    let all: Vec<_> = samples.iter().collect();
    all.chunk_by(|one, other| other.0 - one.0 < gap_s).map(<[_]>::to_vec).collect()
}

/// Smallest and largest value of each pixel column, in their order; one value where they differ by less than `pixel`, which
/// avoids artefacts of the line joins.
fn thinned(samples: &[(f64, f64)], column: impl Fn(f64) -> usize, pixel: f64) -> Vec<(f64, f64)> {
    samples
        .chunk_by(|(one, _), (other, _)| column(*one) == column(*other))
        .flat_map(|chunk| {
            let by_value = |one: &&(f64, f64), other: &&(f64, f64)| one.1.total_cmp(&other.1);
            let extremes = chunk.iter().min_by(by_value).into_iter().chain(chunk.iter().max_by(by_value));
            let mut extremes: Vec<_> = extremes.copied().collect();
            if extremes[1].1 - extremes[0].1 < pixel {
                extremes.pop();
            }
            extremes.sort_by(|one, other| one.0.total_cmp(&other.0));
            extremes
        })
        .collect()
}

/// Range of the values with a margin; a constant curve gets a range of one.
fn value_range(panel: &Panel) -> (f64, f64) {
    let values = panel.curves.iter().flat_map(|curve| curve.samples.values());
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    if low > high {
        return (0.0, 1.0);
    }
    let room = if high > low { (high - low) * 0.06 } else { 0.5 };
    (low - room, high + room)
}

/// The text in lines of at most `letters`, broken between words.
fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for paragraph in text.lines() {
        lines.push(String::new());
        for word in paragraph.split_whitespace() {
            match lines.last_mut() {
                Some(line) if line.is_empty() => line.push_str(word),
                Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                    line.push(' ');
                    line.push_str(word);
                }
                _ => lines.push(word.to_owned()),
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_every_spike() {
        let mut samples: Vec<_> = (0..60_000).map(|ms| (f64::from(ms) * 1e-3, 0.0)).collect();
        samples[31_416].1 = 7.0;
        let thin = thinned(&samples, |time| (time / 60.0 * COLUMNS) as usize, 0.1);
        assert!(thin.len() <= 2 * (COLUMNS as usize + 1));
        assert!(thin.contains(&(31.416, 7.0)));
        assert!(thin.is_sorted_by(|one, other| one.0 <= other.0));
    }

    #[test]
    fn ticks_have_the_digits_that_tell_them_apart() {
        for (value, length, expected) in [
            (400.0, 330.0, "400"),
            (-1e-17, 0.4, "0.00"),
            (4.65, 0.6, "4.65"),
            (5.0, 9.5, "5.0"),
            (-20.0, 90.0, "-20"),
        ] {
            assert_eq!(tick(value, length), expected);
        }
    }

    #[test]
    fn a_pause_breaks_the_line() {
        let samples: Series = [(0.0, 1.0), (0.001, 1.0), (0.5, 2.0), (0.501, 2.0)].into_iter().collect();
        assert_eq!(pieces(&samples).len(), 2);
    }

    #[test]
    fn a_long_legend_goes_on_in_the_next_row() {
        let curve =
            |name: &str| Curve { name: name.into(), colour: BLUE, width: 1, samples: Series::default() };
        let panel = |count: usize| Panel {
            title: "force".into(),
            curves: vec![curve("20261120-074233-load-step"); count],
        };
        let rows = |count| legend_places(&panel(count)).iter().map(|(_, row)| *row).collect::<Vec<_>>();
        assert_eq!((rows(4), rows(5)), (vec![0; 4], vec![0, 0, 0, 0, 1]));
        let in_the_picture = |(x, _): &(i32, i32)| *x + 213 <= WIDTH as i32;
        assert!(legend_places(&panel(9)).iter().all(in_the_picture));
    }

    #[test]
    fn a_caption_is_broken_between_words() {
        assert_eq!(wrapped("a bb ccc dddd\ne", 6), ["a bb", "ccc", "dddd", "e"]);
        assert!(wrapped("", 6).is_empty());
    }

    #[test]
    fn a_picture_holds_what_it_was_given_and_no_empty_panel() {
        let curve = |samples: &[(f64, f64)]| Curve {
            name: "bold & <plain>".into(),
            colour: BLUE,
            width: 1,
            samples: samples.iter().copied().collect(),
        };
        let panel =
            |title: &str, samples: &[(f64, f64)]| Panel { title: title.into(), curves: vec![curve(samples)] };
        let picture = Picture {
            title: "of a test".into(),
            caption: String::new(),
            time_name: "time, s".into(),
            range: Span { from_s: 0.0, to_s: 1.0 },
            mark_s: Some(0.5),
            bands: vec![Band {
                label: "experiment".into(),
                span: Span { from_s: 0.0, to_s: 1.0 },
                is_main: true,
            }],
            panels: vec![panel("shown", &[(0.0, 1.0), (0.5, 1.0)]), panel("later", &[(2.0, 1.0)])],
        };
        let svg = picture.svg().unwrap();
        for part in ["<svg", "of a test", "experiment", "shown", "&lt;plain&gt;"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("later"));
    }
}
