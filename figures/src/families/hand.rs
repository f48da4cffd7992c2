//! The load axis moved by hand: what the hand has to push.
//!
//! Unlinked, the load's force sensor reads the hand; beside the carriage it may read the linkage, so there nothing is taken.
//! Whether the axis moves is taken from its position and not from what the controller thinks, so that controllers with and
//! without a distinction of cases are judged alike.

use super::force::NOISE_S;
use super::relieving::AT_WORK;
use super::{Family, Figures};
use crate::record::{Record, common};
use crate::series::{Series, Span};

/// A faster load axis moves.
const MOVES_M_PER_S: f64 = 0.01;
/// Window of the slope that gives its speed.
const SLOPE_S: f64 = 0.02;
/// The first movement has begun when the axis is so far from where it stood.
const AWAY_M: f64 = 0.001;
/// A load eye that is no further from the carriage may be linked to it: the sensor's offset and the linkage's gap are below.
const BESIDE_M: f64 = 0.005;
/// What is looked at in the end.
const END_S: f64 = 0.3;

pub(super) const FAMILY: Family = Family {
    title: "hand (manual mode in the experiment; load sensor smoothed over 5 ms)",
    definitions: definitions! {
        hand_force_mean_n: "N", Largest,
            "mean |force| of the load sensor while the load axis moves faster than 10 mm/s, more than 5 \
             mm from the carriage";
        hand_force_largest_n: "N", Largest, "largest |force| of the same samples";
        hand_force_breakaway_n: "N", Largest,
            "largest |force| until the load axis is 1 mm from where it stood";
        hand_valve_unrest_ratio: "1", Largest,
            "share of the cycles in which the load's valve is moved, in the last 0.3 s of the experiment, \
             the hand being gone";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let by_hand = common(&record.load.in_state("force_chain", AT_WORK), &record.experiments());
    let Some(first) = by_hand.first() else { return };
    let position = record.measured.numbers("load_position_m");
    let force = record.measured.numbers("load_force_N").smoothed(NOISE_S).map(f64::abs);
    let moving: Series =
        position.slope(SLOPE_S).iter().filter(|(_, velocity)| velocity.abs() >= MOVES_M_PER_S).collect();
    let apart = position.minus(record.measured.numbers("drive_position_m"));
    let free = by_hand_alone(&by_hand, &apart);
    let pushing = force.with(&moving, |force, _| force).within_all(&free);
    figures.put("hand_force_mean_n", pushing.mean());
    figures.put("hand_force_largest_n", pushing.most());
    figures.put("hand_valve_unrest_ratio", by_hand.last().and_then(|last| unrest(record, last)));
    let smooth = position.smoothed(SLOPE_S);
    let start = smooth.at(first.from_s);
    let leaves_s = start.and_then(|start| {
        smooth.within_all(&by_hand).first_time(|position| (position - start).abs() >= AWAY_M)
    });
    let until_then = leaves_s.map(|to_s| force.within(&Span { from_s: first.from_s, to_s }));
    figures.put("hand_force_breakaway_n", until_then.and_then(|force| force.most()));
}

fn unrest(record: &Record, by_hand: &Span) -> Option<f64> {
    let valve = record.measured.numbers("load_valve").within(&by_hand.last(END_S));
    let moved = valve.values().windows(2).filter(|pair| pair[0] != pair[1]).count();
    (valve.len() > 1).then(|| moved as f64 / (valve.len() - 1) as f64)
}

/// The stretches in which the load eye is certainly not linked.
fn by_hand_alone(by_hand: &[Span], apart: &Series) -> Vec<Span> {
    if apart.is_empty() {
        by_hand.to_vec()
    } else {
        common(&apart.stretches(|apart| apart.abs() > BESIDE_M), by_hand)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};

    #[test]
    fn a_hand_breaks_the_axis_away_and_then_pushes_less() {
        // Rests until 1 s while the hand grows to 40 N, then moves at 0.1 m/s under 12 N for a second.
        let position = each_ms(0.0, 3.0, |time| 0.3 + 0.1 * (time - 1.0).clamp(0.0, 1.0));
        let force = each_ms(0.0, 3.0, |time| match time {
            _ if time < 1.0 => -40.0 * time,
            _ if time < 2.0 => -12.0,
            _ => 0.0,
        });
        let mut load = Table::default();
        load.set_states("main_chain", chain(&[("settling", 0.0), ("experiment", 0.1), ("", 3.0)]));
        load.set_states(
            "force_chain",
            chain(&[("idle", 0.0), ("standstill", 0.1), ("moving", 1.1), ("", 3.0)]),
        );
        let measured = table(&[("load_position_m", &position), ("load_force_N", &force)]);
        let record = Record { load, measured, ..Record::default() };
        let figures = super::super::of(&record);
        assert!((figures.get("hand_force_mean_n").unwrap() - 12.0).abs() < 0.5, "blurred at both ends");
        assert!((figures.get("hand_force_breakaway_n").unwrap() - 40.0).abs() < 0.5);
        // In the last 4 mm before the carriage the linkage knocks.
        let knock = |time: f64| if (1.96..2.0).contains(&time) { 100.0 } else { 0.0 };
        let force = each_ms(0.0, 3.0, |time| knock(time) - if time < 2.0 { 12.0 } else { 0.0 });
        let carriage = each_ms(0.0, 3.0, |_| 0.4);
        // One value in even cycles, another in odd ones.
        let valve = each_ms(0.0, 3.0, |time| if (time * 500.0).fract() < 0.25 { 0.01 } else { 0.02 });
        let pressed = [
            ("load_position_m", &position),
            ("load_force_N", &force),
            ("drive_position_m", &carriage),
            ("load_valve", &valve),
        ];
        let linked = super::super::of(&Record { measured: table(&pressed), ..record.clone() });
        assert!((linked.get("hand_force_largest_n").unwrap() - 12.0).abs() < 0.5);
        assert!(linked.get("hand_valve_unrest_ratio").unwrap() > 0.9, "changed from each cycle to the next");
        let idle = Record { load: Table::default(), ..record };
        assert_eq!(super::super::of(&idle).get("hand_force_mean_n"), None);
    }

    use crate::tables_read::Table;
}
