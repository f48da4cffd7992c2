//! Histograms of the families, both axes logarithmic: ours as lines, the reference as a grey area behind them.
//!
//! Markers stand on a curve at its p50, p99, p99.9 and maximum. Bins are those of the report, of equal width on the logarithmic
//! axis; an empty one brings the curve down to the axis, so that a gap before a late outlier is seen as one.

use super::families::Family;
use crate::model::{Bin, Distribution};
use pagekit::markup::none;
use pagekit::number;
use pagekit::page::escaped;
use pagekit::svg::{
    CurveStyle, Drawing, Point, Scale, curve_sample, legend_entry, line, stroke, text, time_axis,
    whole_decades,
};

/// Shorter lengths stand on the left end of the axis: below, it is the clock that is measured.
const SHORTEST_NS: f64 = 10.0;
/// Where a curve of nothing lies: below one, so that a single sample is seen.
const NO_SAMPLE: f64 = 0.5;

pub(super) struct Size {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) class: &'static str,
}

/// Over the whole page.
const FULL: Size = Size { width: 960.0, height: 340.0, class: "full" };
/// Two beside each other.
const HALF: Size = Size { width: 560.0, height: 320.0, class: "half" };

/// Room for labels, in pixels.
pub(super) const LEFT: f64 = 74.0;
pub(super) const RIGHT: f64 = 30.0;
const TOP: f64 = 12.0;
pub(super) const FOOT: f64 = 46.0;

pub(super) fn histograms(families: &[Family<'_>]) -> String {
    charts(families, chart, "No histogram: no length of time was measured.")
}

/// A chart for each family; `without` says why there is none.
pub(super) fn charts(
    families: &[Family<'_>],
    chart: impl Fn(&Family<'_>, &Size) -> String,
    without: &str,
) -> String {
    // What comes first is looked at first.
    let sizes = std::iter::once(&FULL).chain(std::iter::repeat(&HALF));
    let charts: String = families.iter().zip(sizes).map(|(family, size)| chart(family, size)).collect();
    if charts.is_empty() { none(without) } else { format!("<div class=\"charts\">\n{charts}</div>\n") }
}

/// A figure: heading, drawing, and its legend if it needs one. The legend stands below: drawings side by side stand level.
pub(super) fn figure(size: &Size, heading: (&str, &str), legend: &str, drawing: &str) -> String {
    let wide = if size.class == FULL.class { " class=\"wide\"" } else { "" };
    let legend =
        if legend.is_empty() { String::new() } else { format!("<ul class=\"legend\">\n{legend}</ul>\n") };
    format!(
        "<figure{wide}>\n<figcaption>{} <span class=\"soft\">{}</span></figcaption>\n{}{legend}</figure>\n",
        escaped(heading.0),
        escaped(heading.1),
        scrolling(size.class, heading.0, drawing)
    )
}

/// The box in which a drawing scrolls, by keyboard too, where the page is narrower than what can be read.
pub(super) fn scrolling(class: &str, name: &str, drawing: &str) -> String {
    let name = escaped(name);
    format!(
        "<div class=\"chart {class}\" tabindex=\"0\" role=\"group\" aria-label=\"{name}\">\n{drawing}</div>\n"
    )
}

fn chart(family: &Family<'_>, size: &Size) -> String {
    let members: Vec<_> = family.members.iter().filter(|(_, one)| !one.bins.is_empty()).collect();
    let bins = || members.iter().flat_map(|(_, one)| &one.bins);
    let (Some(low), Some(high)) = (bins().map(|bin| bin.from_ns).min(), bins().map(|bin| bin.to_ns).max())
    else {
        return String::new();
    };
    let most = bins().map(|bin| bin.count).max().unwrap_or(1);
    let bottom = size.height - FOOT;
    // Much shorter than the shortest half is a rare oddity, not worth decades of the axis: it stands on its end.
    let medians = members.iter().filter_map(|(_, one)| one.percentiles_ns.p50);
    let shortest_ns = medians.min().map_or(SHORTEST_NS, |p50| (0.1 * p50 as f64).max(SHORTEST_NS));
    let times = whole_decades((low as f64).max(shortest_ns), high as f64);
    let is_cut = (low as f64) < times.0;
    let x = Scale::logarithmic(times, (LEFT, size.width - RIGHT));
    let y = Scale::logarithmic((NO_SAMPLE, whole_decades(1.0, most as f64).1), (bottom, TOP));
    let mut drawn = axes(&x, &y, size);
    if is_cut {
        drawn += &text("end", (LEFT - 24.0, bottom + 18.0), "≤");
    }
    // The grey area lies behind, the first of ours in front.
    let (area, lines): (Vec<_>, Vec<_>) =
        members.iter().copied().rev().partition(|(style, _)| *style == CurveStyle::Reference(0));
    drawn.extend(area.into_iter().chain(lines).map(|(style, one)| curve(style, one, &x, &y)));
    let legend: String = members
        .iter()
        .map(|(style, one)| {
            let samples = number::count(one.percentiles_ns.count);
            legend_entry(&curve_sample(*style), &format!("{}, {samples} samples", one.shown_name()))
        })
        .collect();
    let description = description(family);
    let drawing = Drawing {
        identifier: &format!("{}-histogram", family.identifier),
        size: (size.width, size.height),
        title: &format!("Histogram: {}", family.title),
        description: &description,
    };
    figure(size, (&family.title, family.about), &legend, &drawing.with(&drawn))
}

fn axes(x: &Scale, y: &Scale, size: &Size) -> String {
    let (right, bottom) = (size.width - RIGHT, size.height - FOOT);
    let mut drawn = time_axis(x, true, (TOP, bottom));
    for value in y.decades() {
        let at = y.at(value);
        drawn += &stroke("grid", (LEFT, at), (right, at));
        drawn += &text("end", (LEFT - 7.0, at + 4.5), &number::count(value as u64));
    }
    drawn += &stroke("edge", (LEFT, bottom), (right, bottom));
    drawn += &stroke("edge", (LEFT, TOP), (LEFT, bottom));
    drawn += &text("middle", (0.5 * (LEFT + right), size.height - 6.0), "length of time, logarithmic");
    drawn + &upright_label("samples in a bin, logarithmic", (TOP, bottom))
}

fn upright_label(label: &str, across: (f64, f64)) -> String {
    let middle = 0.5 * (across.0 + across.1);
    format!(
        "<text class=\"middle\" transform=\"translate(13 {middle:.1}) rotate(-90)\">{}</text>\n",
        escaped(label)
    )
}

fn curve(style: CurveStyle, distribution: &Distribution, x: &Scale, y: &Scale) -> String {
    let steps = steps(&distribution.bins, x, y);
    let class = style.class();
    let area = match style {
        CurveStyle::Reference(0) => line("area", &steps),
        _ => String::new(),
    };
    let markers: String = marked(distribution)
        .into_iter()
        .map(|(ns, count)| style.marker((x.at(ns), y.at(count)), false))
        .collect();
    format!("{area}{}{markers}\n", line(&format!("line {class}"), &steps))
}

/// The outline of the bins, down to the axis where there is none.
fn steps(bins: &[Bin], x: &Scale, y: &Scale) -> Vec<Point> {
    let base = y.at(NO_SAMPLE);
    let mut steps: Vec<Point> = Vec::with_capacity(2 * bins.len() + 2);
    let mut end_ns = None;
    for bin in bins {
        let (from, to, height) = (x.at(bin.from_ns as f64), x.at(bin.to_ns as f64), y.at(bin.count as f64));
        if end_ns != Some(bin.from_ns) {
            steps.extend(steps.last().map(|(end, _)| (*end, base)));
            steps.push((from, base));
        }
        steps.extend([(from, height), (to, height)]);
        end_ns = Some(bin.to_ns);
    }
    steps.extend(steps.last().map(|(end, _)| (*end, base)));
    steps
}

/// p50, p99, p99.9 and maximum, each with the count of its bin.
fn marked(distribution: &Distribution) -> Vec<(f64, f64)> {
    let of = &distribution.percentiles_ns;
    let mut lengths: Vec<u64> = [of.p50, of.p99, of.p999, of.max].into_iter().flatten().collect();
    lengths.dedup();
    let place = |ns: u64| {
        let bin = distribution.bins.iter().find(|bin| (bin.from_ns..bin.to_ns).contains(&ns));
        (ns as f64, bin.map_or(1.0, |bin| bin.count as f64))
    };
    lengths.into_iter().map(place).collect()
}

fn description(family: &Family<'_>) -> String {
    let reported = family.members.iter().map(|(_, one)| {
        let of = &one.percentiles_ns;
        let length = |ns: Option<u64>| ns.map_or_else(|| "not measured".to_owned(), number::length);
        format!(
            "{}: half below {}, 99 % below {}, longest {}.",
            one.shown_name(),
            length(of.p50),
            length(of.p99),
            length(of.max)
        )
    });
    reported.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_bin_brings_the_curve_down() {
        let x = Scale::logarithmic((10.0, 1e5), (0.0, 400.0));
        let y = Scale::logarithmic((NO_SAMPLE, 50.0), (200.0, 0.0));
        let bin = |from_ns, to_ns, count| Bin { from_ns, to_ns, count };
        let steps = steps(&[bin(10, 100, 50), bin(100, 1000, 5), bin(10_000, 100_000, 5)], &x, &y);
        let at = [
            (0.0, 200.0),
            (0.0, 0.0),
            (100.0, 0.0),
            (100.0, 100.0),
            (200.0, 100.0),
            (200.0, 200.0),
            (300.0, 200.0),
            (300.0, 100.0),
            (400.0, 100.0),
            (400.0, 200.0),
        ];
        assert_eq!(steps.len(), at.len());
        for ((x, y), (wanted_x, wanted_y)) in steps.iter().zip(at) {
            assert!(
                (x - wanted_x).abs() < 0.1 && (y - wanted_y).abs() < 0.1,
                "{x} {y}, not {wanted_x} {wanted_y}"
            );
        }
    }
}
