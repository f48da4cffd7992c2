//! One picture of an effect: two columns of small multiples, step and slow stroke, as a plain SVG.
//!
//! Black lines on white; what lies within the noise is a grey band. Each panel has its own scale, written at its left: the
//! largest difference in units of noise. A pixel's column shows the least and the largest value in it, so that no peak is
//! lost.

use std::fmt::Write;

/// One panel: a name, a curve, and whether it is in units of noise.
pub(crate) struct Panel<'a> {
    pub(crate) name: &'a str,
    pub(crate) curve: &'a [f64],
    pub(crate) noise_band: bool,
}

/// One column: its title, its length in seconds and its panels from top to bottom.
pub(crate) struct Column<'a> {
    pub(crate) title: String,
    pub(crate) length_s: f64,
    pub(crate) panels: Vec<Panel<'a>>,
}

const LEFT: f64 = 92.0;
const WIDTH: f64 = 300.0;
const HEIGHT: f64 = 54.0;
const GAP: f64 = 10.0;
/// Between the ends of a scale and the frame.
const MARGIN: f64 = 3.0;
const TOP: f64 = 22.0;
const BOTTOM: f64 = 20.0;
/// Least end of the scale of a difference, in units of noise.
const LEAST: f64 = 1.2;
/// Columns of pixels that a curve is drawn in.
const BINS: usize = 150;

/// The picture of all columns side by side.
pub(crate) fn svg(title: &str, columns: &[Column<'_>]) -> String {
    let rows = columns.iter().map(|column| column.panels.len()).max().unwrap_or(0);
    let full_width = columns.len() as f64 * (LEFT + WIDTH) + GAP;
    let full_height = TOP + rows as f64 * (HEIGHT + GAP) + BOTTOM;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {full_width} {full_height}\" width=\"{full_width}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<title>{title}</title>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (i, column) in columns.iter().enumerate() {
        let left = i as f64 * (LEFT + WIDTH) + LEFT;
        text(&mut out, left, TOP - 8.0, "start", &column.title);
        for (j, panel) in column.panels.iter().enumerate() {
            draw(&mut out, left, TOP + j as f64 * (HEIGHT + GAP), panel);
        }
        let below = TOP + column.panels.len() as f64 * (HEIGHT + GAP) + 6.0;
        text(&mut out, left, below, "start", "0");
        text(&mut out, left + WIDTH, below, "end", &format!("{} s", number(column.length_s)));
    }
    out.push_str("</svg>\n");
    out
}

fn text(out: &mut String, x: f64, y: f64, anchor: &str, what: &str) {
    let _ = writeln!(out, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{what}</text>");
}

fn draw(out: &mut String, left: f64, top: f64, panel: &Panel<'_>) {
    let (low, high) = range(panel);
    let y = |value: f64| top + MARGIN + (HEIGHT - 2.0 * MARGIN) * (high - value) / (high - low);
    if panel.noise_band {
        let (above, below) = (y(1.0), y(-1.0));
        let _ = writeln!(
            out,
            "<rect x=\"{left}\" y=\"{above:.1}\" width=\"{WIDTH}\" height=\"{:.1}\" fill=\"#ddd\"/>",
            below - above
        );
    }
    let _ = writeln!(
        out,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"#999\" \
         stroke-width=\".5\"/>"
    );
    text(out, left - 6.0, top + 9.0, "end", &number(high));
    text(out, left - 6.0, top + HEIGHT, "end", &number(low));
    text(out, left - 6.0, top + HEIGHT / 2.0 + 4.0, "end", panel.name);
    let _ = writeln!(
        out,
        "<path fill=\"none\" stroke=\"black\" stroke-linejoin=\"round\" d=\"{}\"/>",
        path(panel.curve, left, y)
    );
}

/// Ends of a panel's scale; that of a difference always holds the noise.
fn range(panel: &Panel<'_>) -> (f64, f64) {
    let low = panel.curve.iter().copied().fold(f64::INFINITY, f64::min);
    let high = panel.curve.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if panel.noise_band {
        return (low.min(-LEAST), high.max(LEAST));
    }
    if high > low { (low, high) } else { (low - 1.0, high + 1.0) }
}

/// Three digits, without an exponent.
pub(crate) fn number(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).clamp(0, 4) };
    let rounded = format!("{value:.0$}", digits as usize);
    if digits == 0 {
        return rounded;
    }
    rounded.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The least and the largest value of each column of pixels, in the order in which they come, as relative lines.
fn path(curve: &[f64], left: f64, y: impl Fn(f64) -> f64) -> String {
    let mut points: Vec<[i64; 2]> = Vec::new();
    let tenth = |value: f64| (value * 10.0).round() as i64;
    let mut add = |i: usize| {
        let x = left + WIDTH * i as f64 / (curve.len() - 1) as f64;
        points.push([tenth(x), tenth(y(curve[i]))]);
    };
    let bins = BINS.min(curve.len());
    add(0);
    for bin in 0..bins {
        let (begin, end) = (bin * curve.len() / bins, (bin + 1) * curve.len() / bins);
        let least = (begin..end).min_by(|&i, &j| curve[i].total_cmp(&curve[j])).expect("no bin is empty");
        let most = (begin..end).max_by(|&i, &j| curve[i].total_cmp(&curve[j])).expect("no bin is empty");
        add(least.min(most));
        if least != most {
            add(least.max(most));
        }
    }
    add(curve.len() - 1);
    points.dedup();
    let mut d = format!("M{},{}", points[0][0] as f64 / 10.0, points[0][1] as f64 / 10.0);
    let mut straight: Option<[i64; 2]> = None;
    let mut line = |step: [i64; 2]| {
        let _ = write!(d, "l{},{}", step[0] as f64 / 10.0, step[1] as f64 / 10.0);
    };
    for pair in points.windows(2) {
        let step = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        // Level stretches are one line.
        match straight {
            Some(level) if step[1] == 0 => straight = Some([level[0] + step[0], 0]),
            Some(level) => {
                line(level);
                line(step);
                straight = None;
            }
            None if step[1] == 0 => straight = Some(step),
            None => line(step),
        }
    }
    if let Some(level) = straight {
        line(level);
    }
    d
}
