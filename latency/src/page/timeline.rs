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
use crate::files::EMULATOR;
use crate::model::{Event, NearbyCycle, ProbeGap};
use pagekit::markup::none;
use pagekit::number;
use pagekit::svg::{
    CurveStyle, Drawing, Point, Scale, bar, legend_entry, line, stroke, text, time_axis, whole_decades,
};
use protocol::periods::CYCLE_NS;
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
/// The rig's cycle, us.
const CYCLE_US: f64 = CYCLE_NS as f64 / 1000.0;
const MOST_LANES: usize = 8;
/// Cycles whose markers do not touch each other.
const MOST_MARKERS: usize = 90;

const FALLING: &str = "The falling line: cycles that were missed, each late against its own scheduled time.";

/// Stretch that is shown, us from the event's due time.
fn window(event: &Event) -> (f64, f64) {
    let length_us = (event.late_ns.saturating_add(event.slow_ns)) as f64 * 1e-3;
    // A long stall is seen in its place: more is shown around it, before it no more than there is.
    let room_us = 0.5 * length_us;
    let starts = event.nearby_cycles.values().flatten().map(|row| row.due_us);
    let first_us = starts.filter(|start| start.is_finite()).fold(0.0, f64::min);
    let gap_ends = event.probe.iter().map(|gap| gap.from_us + gap.length_us);
    let ends = event.nearby_cycles.values().flatten().map(end_us).chain(gap_ends);
    let last_us = ends.filter(|end| end.is_finite()).fold(length_us, f64::max);
    let rim_us = 0.1 * BEFORE_US + 0.02 * length_us;
    let to_us = last_us.min(length_us + room_us.max(AFTER_US)) + rim_us;
    (first_us.max(-room_us.max(BEFORE_US)) - rim_us, to_us)
}

fn end_us(row: &NearbyCycle) -> f64 {
    row.due_us + row.late_us + row.execution_us
}

/// Lateness of the event's own cycles, each at its due time: the rig writes no row for a cycle that it missed, only for the
/// one that it woke in. Nothing when the first of them has its row.
fn missed(event: &Event) -> Vec<(f64, f64)> {
    let rows = event.nearby_cycles.get(&event.process).map_or(&[][..], Vec::as_slice);
    if event.late_ns == 0 || rows.iter().any(|row| row.cycle == event.cycle) {
        return Vec::new();
    }
    let late_us = event.late_ns as f64 * 1e-3;
    let step = event.skipped as usize / MOST_MARKERS + 1;
    let dues = (0..=event.skipped).step_by(step).map(|cycle| cycle as f64 * CYCLE_US);
    dues.map(|due_us| (due_us, late_us - due_us)).take_while(|(_, late_us)| *late_us > 0.0).collect()
}

/// The rows of each process, the rig's first.
pub(super) fn by_process(event: &Event) -> Vec<(&str, &[NearbyCycle])> {
    let mut processes: Vec<_> =
        event.nearby_cycles.iter().map(|(process, rows)| (process.as_str(), rows.as_slice())).collect();
    processes.sort_by_key(|(process, _)| *process != EMULATOR);
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
fn is_known(row: &NearbyCycle) -> bool {
    [row.due_us, row.late_us, row.execution_us].iter().all(|value| value.is_finite())
}

pub(super) fn timeline(event: &Event, place: usize, is_probed: bool) -> String {
    let (from_us, to_us) = window(event);
    let x = Scale::linear((from_us * 1e-3, to_us * 1e-3), (LEFT, RIGHT));
    let processes: Vec<(&str, Vec<&NearbyCycle>)> = by_process(event)
        .into_iter()
        .map(|(process, rows)| {
            let shown = |row: &&NearbyCycle| is_known(row) && row.due_us <= to_us && end_us(row) >= from_us;
            (process, rows.iter().filter(shown).collect())
        })
        .collect();
    let missed = missed(event);
    if processes.iter().all(|(_, rows)| rows.is_empty()) && event.probe.is_empty() {
        return none("No cycles around it were recorded.");
    }
    let (cpus, left_out) = lanes(&event.probe);
    let bottom = UPPER + 12.0 + LANE * (processes.len() + cpus.len()) as f64;
    let mut drawn = time_grid(&x, bottom) + &upper(&processes, (&event.process, &missed), &x, from_us);
    let mut y = UPPER + 12.0;
    for (index, (process, rows)) in processes.iter().enumerate() {
        drawn += &lane_name(process, y);
        drawn.extend(rows.iter().map(|row| lane_bars(row, CurveStyle::Ours(index), y, &x)));
        if let Some((due_us, late_us)) = missed.first().filter(|_| *process == event.process) {
            drawn += &waiting_bar((*due_us, due_us + late_us), CurveStyle::Ours(index), y, &x);
        }
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
            number::counted(left_out as u64, "CPU", "CPUs")
        ))
    } else if event.probe.is_empty() && is_probed {
        none("The probe saw no gap around it.")
    } else if event.probe.is_empty() {
        none("No probe watched the machine.")
    } else {
        String::new()
    };
    let falling = if missed.len() > 1 { none(FALLING) } else { String::new() };
    format!(
        "<figure>\n{}<ul class=\"legend\">\n{}</ul>\n{falling}{watched}</figure>\n",
        scrolling("full", "Cycles around the event", &drawing.with(&drawn)),
        legend(&processes, &event.probe)
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
        // Whole milliseconds without a point.
        let places = if value.fract() == 0.0 { 0 } else { 1 };
        drawn += &text("middle", (at, bottom + 18.0), &number::decimal(value, places));
    }
    drawn
}

/// Lateness and execution of each cycle.
fn upper(
    processes: &[(&str, Vec<&NearbyCycle>)],
    (late_process, missed): (&str, &[(f64, f64)]),
    x: &Scale,
    from_us: f64,
) -> String {
    let values =
        || processes.iter().flat_map(|(_, rows)| rows.iter().flat_map(|row| [row.late_us, row.execution_us]));
    let low = values().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
    let high = values().chain(missed.iter().map(|(_, late_us)| *late_us)).fold(1.0, f64::max);
    let low = if low.is_finite() { low } else { 1.0 };
    // In ns, as the other axes of time.
    let y = Scale::logarithmic(whole_decades((low * 1e3).max(100.0), high * 1e3), (UPPER, TOP));
    let mut drawn = time_axis(&y, false, (RIGHT, LEFT));
    drawn += &stroke("edge", (LEFT, UPPER), (RIGHT, UPPER));
    drawn += &stroke("edge", (LEFT, TOP), (LEFT, UPPER));
    for (index, (process, rows)) in processes.iter().enumerate() {
        let style = CurveStyle::Ours(index);
        if *process == late_process {
            let places = missed.iter().map(|(due_us, late_us)| (x.at(due_us * 1e-3), y.at(late_us * 1e3)));
            let places: Vec<Point> = places.collect();
            drawn += &line(&format!("line {}", style.class()), &places);
            drawn.extend(places.iter().map(|place| style.marker(*place, false)));
        }
        // Cycles that were missed have no row: no line leads over them.
        let in_sight = rows.iter().copied().filter(|row| row.due_us >= from_us).collect::<Vec<_>>();
        for piece in in_sight.chunk_by(|one, other| one.cycle + 1 == other.cycle) {
            let places = |value: fn(&NearbyCycle) -> f64| -> Vec<Point> {
                piece.iter().map(|row| (x.at(row.due_us * 1e-3), y.at(value(row) * 1e3))).collect()
            };
            let (late, execution) = (places(|row| row.late_us), places(|row| row.execution_us));
            drawn += &line(&format!("line thin {}", style.class()), &execution);
            drawn += &line(&format!("line {}", style.class()), &late);
            // Where markers would touch, the lines say it all.
            if in_sight.len() <= MOST_MARKERS || piece.len() == 1 {
                drawn.extend(execution.iter().map(|place| style.marker(*place, true)));
                drawn.extend(late.iter().map(|place| style.marker(*place, false)));
            }
        }
        drawn.push('\n');
    }
    drawn
}

/// When a cycle waited and ran.
fn lane_bars(row: &NearbyCycle, style: CurveStyle, y: f64, x: &Scale) -> String {
    let class = style.class();
    let at = |us: f64| x.at(us * 1e-3);
    let (due, woke) = (at(row.due_us), at(row.due_us + row.late_us));
    let done = at(row.due_us + row.late_us + row.execution_us).max(woke + 1.2);
    let waiting = if woke - due > 1.5 {
        waiting_bar((row.due_us, row.due_us + row.late_us), style, y, x)
    } else {
        String::new()
    };
    waiting + &bar(&format!("bar {class}"), (woke, y + 5.0), (done, y + LANE - 5.0))
}

/// From due to woke, us.
fn waiting_bar((due_us, woke_us): (f64, f64), style: CurveStyle, y: f64, x: &Scale) -> String {
    let class = format!("bar wait {}", style.class());
    bar(&class, (x.at(due_us * 1e-3), y + 8.0), (x.at(woke_us * 1e-3), y + LANE - 8.0))
}

fn legend(processes: &[(&str, Vec<&NearbyCycle>)], gaps: &[ProbeGap]) -> String {
    let mut entries = String::new();
    for (index, (process, _)) in processes.iter().enumerate() {
        let style = CurveStyle::Ours(index);
        let class = style.class();
        for (line_class, is_hollow, what) in [("line", false, "lateness"), ("line thin", true, "execution")] {
            let sample = line(&format!("{line_class} {class}"), &[(1.0, 7.0), (37.0, 7.0)]);
            let sample = sample + &style.marker((19.0, 7.0), is_hollow);
            entries += &legend_entry(&sample, &format!("{process}: {what}"));
        }
    }
    if !processes.is_empty() {
        let sample = bar("bar wait s0", (1.0, 4.5), (24.0, 9.5)) + &bar("bar s0", (24.0, 2.0), (37.0, 12.0));
        entries += &legend_entry(&sample, "lanes: waiting, then running");
    }
    for (another_ran, class, what) in
        [(false, "bar still", "gap: the CPU stood still"), (true, "bar ran", "gap: another thread ran")]
    {
        if gaps.iter().any(|gap| gap.another_ran == another_ran) {
            entries += &legend_entry(&bar(class, (2.0, 2.0), (36.0, 12.0)), what);
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn event(skipped: u64, cycles: &[u64]) -> Event {
        let row = |cycle: &u64| NearbyCycle {
            cycle: *cycle,
            due_us: (*cycle as f64 - 100.0) * CYCLE_US,
            late_us: 9.0,
            execution_us: 20.0,
            ..NearbyCycle::default()
        };
        Event {
            process: "emulator".into(),
            cycle: 100,
            late_ns: skipped * 1_000_000 + 9000,
            skipped,
            nearby_cycles: BTreeMap::from([("emulator".into(), cycles.iter().map(row).collect())]),
            ..Event::default()
        }
    }

    #[test]
    fn every_missed_cycle_is_late_against_its_own_time() {
        let reported = missed(&event(3, &[98, 99, 103]));
        assert_eq!(reported, [(0.0, 3009.0), (1000.0, 2009.0), (2000.0, 1009.0), (3000.0, 9.0)]);
        assert!(missed(&event(0, &[99, 100])).is_empty(), "its row is there");
        assert!(missed(&event(50_000, &[])).len() <= MOST_MARKERS + 1);
    }

    #[test]
    fn all_of_a_long_stall_is_in_sight_and_not_much_else() {
        let (from_us, to_us) = window(&event(98, &[95, 96, 97, 98, 99, 198, 199]));
        assert!((-8000.0..-5000.0).contains(&from_us), "{from_us}");
        assert!((99_000.0..102_000.0).contains(&to_us), "{to_us}");
    }
}
