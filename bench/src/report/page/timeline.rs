//! The cycles around an event on one time axis: how late and how long each was, when each process waited and ran, and when the
//! probe saw the machine stand still.
//!
//! ```text
//!   µs, log │   •   ▪     lateness (filled) and execution (hollow) of each cycle, at its due time
//!           │ ▫ ▫ ▫ ▫ ▫
//!   emulator    ▭▭▭▮ ▮    waiting (hollow) from due to woke, running (filled) from woke to done
//!   CPU 1       ████      gap of the probe: black when the CPU itself stood still, hatched when another thread ran
//! ```

use super::histograms::scrolling;
use super::markup::none;
use super::svg::{
    Drawing, Look, Place, Scale, bar, legend_entry, line, stroke, text, time_axis, whole_decades,
};
use super::words;
use crate::report::model::{AroundRow, Event, ProbeGap};
use std::collections::BTreeSet;

const WIDTH: f64 = 960.0;
const LEFT: f64 = 132.0;
const RIGHT: f64 = 944.0;
const TOP: f64 = 10.0;
/// Lower end of the upper part.
const UPPER: f64 = 170.0;
const LANE: f64 = 26.0;
/// Shown before the due time, and after the end of the lateness at the least, us.
const BEFORE_US: f64 = 3000.0;
const AFTER_US: f64 = 5000.0;
/// CPUs drawn.
const MOST_LANES: usize = 8;
/// Cycles whose markers do not touch each other.
const MOST_MARKERS: usize = 90;

/// Stretch that is shown, us from the event's due time.
fn window(event: &Event) -> (f64, f64) {
    let length_us = (event.late_ns.saturating_add(event.slow_ns)) as f64 * 1e-3;
    // A long stall is seen in its place: more is shown around it, before it no more than there is.
    let room_us = 0.5 * length_us;
    let starts = event.around.values().flatten().map(|row| row.due_us);
    let first_us = starts.filter(|start| start.is_finite()).fold(0.0, f64::min);
    (first_us.max(-room_us.max(BEFORE_US)) - 0.1 * BEFORE_US, length_us + room_us.max(AFTER_US))
}

/// The rows of each process, the rig's first.
pub(super) fn by_process(event: &Event) -> Vec<(&str, &[AroundRow])> {
    let mut processes: Vec<_> =
        event.around.iter().map(|(process, rows)| (process.as_str(), rows.as_slice())).collect();
    processes.sort_by_key(|(process, _)| *process != "emulator");
    processes
}

/// The CPUs whose gaps are drawn, those with the longest, and how many are left out.
fn lanes(gaps: &[ProbeGap]) -> (BTreeSet<u64>, usize) {
    let mut longest_first: Vec<_> = gaps.iter().collect();
    longest_first.sort_by(|one, other| other.length_us.total_cmp(&one.length_us));
    let mut lanes = BTreeSet::new();
    for gap in longest_first {
        if lanes.len() < MOST_LANES {
            lanes.insert(gap.cpu);
        }
    }
    let all: BTreeSet<_> = gaps.iter().map(|gap| gap.cpu).collect();
    let left_out = all.len() - lanes.len();
    (lanes, left_out)
}

/// Whether all of it can be drawn.
fn is_known(row: &AroundRow) -> bool {
    [row.due_us, row.late_us, row.execution_us].iter().all(|value| value.is_finite())
}

/// The drawing with its legend.
pub(super) fn timeline(event: &Event, place: usize, is_probed: bool) -> String {
    let (from_us, to_us) = window(event);
    let x = Scale::linear((from_us * 1e-3, to_us * 1e-3), (LEFT, RIGHT));
    let processes: Vec<(&str, Vec<&AroundRow>)> = by_process(event)
        .into_iter()
        .map(|(process, rows)| {
            let end_us = |row: &AroundRow| row.due_us + row.late_us + row.execution_us;
            let shown = |row: &&AroundRow| is_known(row) && row.due_us <= to_us && end_us(row) >= from_us;
            (process, rows.iter().filter(shown).collect())
        })
        .collect();
    if processes.iter().all(|(_, rows)| rows.is_empty()) && event.probe.is_empty() {
        return none("No cycles around it were recorded.");
    }
    let (cpus, left_out) = lanes(&event.probe);
    let bottom = UPPER + 12.0 + LANE * (processes.len() + cpus.len()) as f64;
    let mut drawn = time_grid(&x, bottom) + &upper(&processes, &x, from_us);
    let mut y = UPPER + 12.0;
    for (index, (process, rows)) in processes.iter().enumerate() {
        drawn += &lane_name(process, y);
        drawn.extend(rows.iter().map(|row| lane_bars(row, Look::Ours(index), y, &x)));
        y += LANE;
    }
    for cpu in &cpus {
        drawn += &lane_name(&format!("gap, CPU {cpu}"), y);
        for gap in event.probe.iter().filter(|gap| gap.cpu == *cpu) {
            let class = if gap.another_ran { "bar ran" } else { "bar still" };
            let (from, to) = (x.at(gap.from_us * 1e-3), x.at((gap.from_us + gap.length_us) * 1e-3));
            drawn += &bar(class, (from, y + 5.0), (to.max(from + 1.0), y + LANE - 5.0));
        }
        y += LANE;
    }
    drawn += &stroke("edge", (LEFT, bottom), (RIGHT, bottom));
    drawn += &text("middle", (0.5 * (LEFT + RIGHT), bottom + 37.0), "ms from the event's due time");
    let drawing = Drawing {
        identifier: &format!("event-{place}-timeline"),
        size: (WIDTH, bottom + 44.0),
        title: "Cycles around the event",
        description: &event.sentence,
    };
    let watched = if left_out > 0 {
        none(&format!(
            "{} with shorter gaps: in the table below.",
            words::counted(left_out as u64, "CPU", "CPUs")
        ))
    } else if event.probe.is_empty() && is_probed {
        none("The probe saw no gap around it.")
    } else if event.probe.is_empty() {
        none("No probe watched the machine.")
    } else {
        String::new()
    };
    let gaps = event.probe.iter().map(|gap| gap.another_ran).collect();
    format!(
        "<figure>\n{}<ul class=\"legend\">\n{}</ul>\n{watched}</figure>\n",
        scrolling("full", "Cycles around the event", &drawing.with(&drawn)),
        legend(&processes, &gaps)
    )
}

fn lane_name(name: &str, y: f64) -> String {
    text("name end", (LEFT - 10.0, y + 0.5 * LANE + 4.5), name)
}

fn time_grid(x: &Scale, bottom: f64) -> String {
    let mut drawn = String::new();
    for value in x.round_values(12.0) {
        let at = x.at(value);
        drawn += &stroke(if value == 0.0 { "cut" } else { "grid" }, (at, TOP), (at, bottom));
        drawn += &text("middle", (at, bottom + 18.0), &short(value));
    }
    drawn
}

/// Whole milliseconds without a point.
fn short(value: f64) -> String {
    words::decimal(value, if value.fract() == 0.0 { 0 } else { 1 })
}

/// Lateness and execution of each cycle.
fn upper(processes: &[(&str, Vec<&AroundRow>)], x: &Scale, from_us: f64) -> String {
    let values =
        || processes.iter().flat_map(|(_, rows)| rows.iter().flat_map(|row| [row.late_us, row.execution_us]));
    let low = values().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
    let high = values().fold(1.0, f64::max);
    let low = if low.is_finite() { low } else { 1.0 };
    // In ns, as the other axes of time.
    let y = Scale::logarithmic(whole_decades((low * 1e3).max(100.0), high * 1e3), (UPPER, TOP));
    let mut drawn = time_axis(&y, false, (RIGHT, LEFT));
    drawn += &stroke("edge", (LEFT, UPPER), (RIGHT, UPPER));
    drawn += &stroke("edge", (LEFT, TOP), (LEFT, UPPER));
    for (index, (_, rows)) in processes.iter().enumerate() {
        let look = Look::Ours(index);
        // Cycles that were missed have no row: no line leads over them.
        let in_sight = rows.iter().copied().filter(|row| row.due_us >= from_us).collect::<Vec<_>>();
        for piece in in_sight.chunk_by(|one, other| one.cycle + 1 == other.cycle) {
            let places = |value: fn(&AroundRow) -> f64| -> Vec<Place> {
                piece.iter().map(|row| (x.at(row.due_us * 1e-3), y.at(value(row) * 1e3))).collect()
            };
            let (late, execution) = (places(|row| row.late_us), places(|row| row.execution_us));
            drawn += &line(&format!("line thin {}", look.class()), &execution);
            drawn += &line(&format!("line {}", look.class()), &late);
            // Where markers would touch, the lines say it all.
            if in_sight.len() <= MOST_MARKERS || piece.len() == 1 {
                drawn.extend(execution.iter().map(|place| look.marker(*place, true)));
                drawn.extend(late.iter().map(|place| look.marker(*place, false)));
            }
        }
        drawn.push('\n');
    }
    drawn
}

/// When a cycle waited and ran.
fn lane_bars(row: &AroundRow, look: Look, y: f64, x: &Scale) -> String {
    let class = look.class();
    let at = |us: f64| x.at(us * 1e-3);
    let (due, woke) = (at(row.due_us), at(row.due_us + row.late_us));
    let done = at(row.due_us + row.late_us + row.execution_us).max(woke + 1.2);
    let waiting = if woke - due > 1.5 {
        bar(&format!("bar wait {class}"), (due, y + 8.0), (woke, y + LANE - 8.0))
    } else {
        String::new()
    };
    waiting + &bar(&format!("bar {class}"), (woke, y + 5.0), (done, y + LANE - 5.0))
}

fn legend(processes: &[(&str, Vec<&AroundRow>)], gaps: &BTreeSet<bool>) -> String {
    let mut entries = String::new();
    for (index, (process, _)) in processes.iter().enumerate() {
        let look = Look::Ours(index);
        let class = look.class();
        for (line_class, is_hollow, what) in [("line", false, "lateness"), ("line thin", true, "execution")] {
            let sample = line(&format!("{line_class} {class}"), &[(1.0, 7.0), (37.0, 7.0)]);
            let sample = sample + &look.marker((19.0, 7.0), is_hollow);
            entries += &legend_entry(&sample, &format!("{process}: {what}"));
        }
    }
    if !processes.is_empty() {
        let sample = bar("bar wait s0", (1.0, 4.5), (24.0, 9.5)) + &bar("bar s0", (24.0, 2.0), (37.0, 12.0));
        entries += &legend_entry(&sample, "lanes: waiting, then running");
    }
    for another_ran in gaps {
        let (class, what) = if *another_ran {
            ("bar ran", "gap: another thread ran")
        } else {
            ("bar still", "gap: the CPU stood still")
        };
        entries += &legend_entry(&bar(class, (2.0, 2.0), (36.0, 12.0)), what);
    }
    entries
}
