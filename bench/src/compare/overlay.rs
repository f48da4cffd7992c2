//! The curves of several runs on the same axes: over the whole experiment, and around its step.

use crate::runs::Run;
use figures::drawing::{BLACK, COLOURS, Curve, Panel, Picture};
use figures::picture::{self, METRE_IN_MM, PER_CENT};
use figures::record::Record;
use figures::series::{Series, Span};

/// Range of the picture around a step, s.
const AROUND: Span = Span { from_s: -0.2, to_s: 0.6 };

struct Quantity {
    title: &'static str,
    of: fn(&Record) -> Series,
    /// Its set-point in the first run.
    set_point: Option<fn(&Record) -> Series>,
}

const QUANTITIES: &[Quantity] = &[
    Quantity {
        title: "drive position, mm",
        of: |record| record.measured.numbers("drive_position_m").map(|value| value * METRE_IN_MM),
        set_point: Some(|record| record.drive.numbers("set_position_m").map(|value| value * METRE_IN_MM)),
    },
    Quantity {
        title: "drive set-point - position, mm",
        of: |record| record.position_error().map(|value| value * METRE_IN_MM),
        set_point: None,
    },
    Quantity {
        title: "load force, N",
        of: |record| {
            if record.load_acts() {
                record.measured.numbers("load_force_N").clone()
            } else {
                Series::default()
            }
        },
        set_point: Some(|record| record.load.numbers("set_force_N").clone()),
    },
    Quantity {
        title: "drive valve opening, %",
        of: |record| record.measured.numbers("drive_valve").map(|value| value * PER_CENT),
        set_point: None,
    },
    Quantity {
        title: "load valve opening, %",
        of: |record| {
            let valve = record.measured.numbers("load_valve").map(|value| value * PER_CENT);
            if record.load_acts() { valve } else { Series::default() }
        },
        set_point: None,
    },
];

/// Pictures of the whole experiment, and around its step if it has one.
pub(crate) fn pictures(runs: &[Run]) -> Vec<Picture> {
    let Some(first) = runs.first() else { return Vec::new() };
    let whole = whole(first.title(), runs, panels(runs, Run::start_s));
    let Some((what, _)) = picture::step(&first.record) else { return vec![whole] };
    let at_s = |run: &Run| picture::step(&run.record).map_or(run.start_s(), |(_, at_s)| at_s);
    let step = Picture {
        title: format!("{}: {what}", first.title()),
        time_name: "time since the step, s".into(),
        range: AROUND,
        mark_s: Some(0.0),
        panels: panels(runs, at_s),
        ..whole.clone()
    };
    vec![whole, step]
}

/// A picture over the length of the longest experiment.
pub(super) fn whole(title: String, runs: &[Run], panels: Vec<Panel>) -> Picture {
    let length = |run: &Run| run.record.experiments().last().map(|span| span.to_s - run.start_s());
    Picture {
        title,
        caption: String::new(),
        time_name: "time since the experiment's begin, s".into(),
        range: Span { from_s: 0.0, to_s: runs.iter().filter_map(length).fold(1e-3, f64::max) },
        mark_s: None,
        bands: Vec::new(),
        panels,
    }
}

/// A panel for each quantity; time 0 of each run is its `zero_s`.
fn panels(runs: &[Run], zero_s: impl Fn(&Run) -> f64) -> Vec<Panel> {
    let panel = |quantity: &Quantity| {
        let set_point = quantity.set_point.zip(runs.first()).map(|(set_point, first)| Curve {
            name: "set-point".into(),
            colour: BLACK,
            width: 1,
            samples: set_point(&first.record).shifted(-zero_s(first)),
        });
        let curves = runs.iter().enumerate().map(|(place, run)| Curve {
            name: run.name.clone(),
            colour: COLOURS[place % (COLOURS.len() - 1)], // the last one, black, is the set-point's
            width: if place == 0 { 2 } else { 1 },
            samples: (quantity.of)(&run.record).shifted(-zero_s(run)),
        });
        Panel { title: quantity.title.into(), curves: set_point.into_iter().chain(curves).collect() }
    };
    QUANTITIES.iter().map(panel).collect()
}
