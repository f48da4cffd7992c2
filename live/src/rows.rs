//! Data of the charts: a row every 10 ms with the controllers' set-points of the same instant, and the last minute of rows.
//!
//! Cycles come by the telemetry, ChainValues by the bus every ten cycles, at different cycles. A row waits for the ChainValues
//! after it and interpolates; without values on both sides the cell is empty, since a set-point beside a sensor of another
//! cycle would show a false error.

use super::columns::{COLUMNS, ControllerSignal, Source};
use super::state::NewestRow;
use crate::push_newest;
use protocol::frames::ChainValues;
use serde_json::{Map, Value, json};
use std::collections::VecDeque;

/// Cycles from row to row.
pub(crate) const SPACING_CYCLES: u64 = 10;
/// Rows that are kept: a minute.
const KEPT: usize = 6000;
/// Longest time that a row waits for the controllers, cycles.
const LONGEST_WAIT_CYCLES: u64 = 30;
/// Longest gap between two values of a controller that is interpolated, cycles: one of them may be lost.
const BRIDGED_CYCLES: u64 = 20;
const VALUES_KEPT: usize = 32;

/// A row of the charts; values have seven digits, as the page gets them.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    cycle: u64,
    values: Vec<Option<f32>>,
}

#[derive(Debug, Default)]
pub(crate) struct Rows {
    /// Rows that wait for the controllers.
    waiting: VecDeque<Row>,
    chain_values: [VecDeque<(u64, ChainValues)>; 2],
    kept: VecDeque<Row>,
    /// Rows at the end of `kept` that were not sent.
    fresh: usize,
}

impl Rows {
    /// Adds the values that the controller of an axis sent for `cycle`.
    pub(crate) fn add_chain_values(&mut self, axis: usize, cycle: u64, values: ChainValues) {
        push_newest(&mut self.chain_values[axis], VALUES_KEPT, (cycle, values));
    }

    /// Adds a row, without values of controllers.
    pub(crate) fn add(&mut self, cycle: u64, values: &[Option<f64>]) {
        let values = values.iter().map(|value| value.map(|value| value as f32)).collect();
        self.waiting.push_back(Row { cycle, values });
        self.complete_rows(cycle);
    }

    /// Completes the rows that need not wait longer; `newest` is the newest cycle.
    fn complete_rows(&mut self, newest: u64) {
        while let Some(row) = self.waiting.front() {
            let received = |chain_values: &VecDeque<(u64, ChainValues)>| {
                chain_values.back().is_some_and(|(cycle, _)| *cycle >= row.cycle)
            };
            if !self.chain_values.iter().all(received) && newest < row.cycle + LONGEST_WAIT_CYCLES {
                return;
            }
            let Some(mut row) = self.waiting.pop_front() else { return };
            for (value, column) in row.values.iter_mut().zip(COLUMNS.iter()) {
                if let Source::Controller(axis, signal) = column.source {
                    *value = between(&self.chain_values[axis], row.cycle, signal).map(|value| value as f32);
                }
            }
            push_newest(&mut self.kept, KEPT, row);
            self.fresh = (self.fresh + 1).min(self.kept.len());
        }
    }

    /// The rows since the last call; `None` without any.
    pub(crate) fn take_fresh(&mut self) -> Option<Value> {
        let fresh = std::mem::take(&mut self.fresh);
        (fresh > 0).then(|| table(self.kept.range(self.kept.len() - fresh..)))
    }

    /// The rows of the last `seconds`.
    pub(crate) fn last(&self, seconds: f64) -> Value {
        let rows = (seconds * 1000.0 / SPACING_CYCLES as f64) as usize;
        table(self.kept.range(self.kept.len().saturating_sub(rows)..))
    }

    /// The newest row by column; empty before the first.
    pub(crate) fn newest(&self) -> NewestRow {
        let Some(row) = self.kept.back() else { return NewestRow::new() };
        let values = row.values.iter().map(|value| value.map(short));
        COLUMNS.iter().zip(values).map(|(column, value)| (column.name.clone(), value)).collect()
    }
}

/// Value of a controller at `cycle`, interpolated if necessary.
fn between(chain_values: &VecDeque<(u64, ChainValues)>, cycle: u64, signal: ControllerSignal) -> Option<f64> {
    let value = |values: &ChainValues| match signal {
        ControllerSignal::Position => values.position_set_point_m,
        ControllerSignal::Force => values.force_set_point_n,
        ControllerSignal::Error => values.control_error_m,
    };
    let after = chain_values.iter().find(|(at, _)| *at >= cycle);
    let before = chain_values.iter().rev().find(|(at, _)| *at <= cycle);
    match (before, after) {
        (Some((at, values)), _) if *at == cycle => Some(value(values)),
        (Some((from, first)), Some((to, second))) if to - from <= BRIDGED_CYCLES => {
            let share = (cycle - from) as f64 / (to - from) as f64;
            Some(value(first) + share * (value(second) - value(first)))
        }
        _ => None,
    }
}

/// The decimal number with the digits of the f32: a conversion to f64 would add digits to the JSON.
fn short(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

fn table<'a>(rows: impl Iterator<Item = &'a Row> + Clone) -> Value {
    let time_s: Vec<f64> = rows.clone().map(|row| row.cycle as f64 / 1000.0).collect();
    let column = |place: usize| rows.clone().map(|row| row.values[place].map(short)).collect::<Vec<_>>();
    let columns: Map<_, _> =
        COLUMNS.iter().enumerate().map(|(place, known)| (known.name.clone(), json!(column(place)))).collect();
    json!({ "t_s": time_s, "columns": columns })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(position_set_point_m: f64) -> ChainValues {
        ChainValues {
            averaged_position_m: 0.0,
            position_set_point_m,
            force_set_point_n: 0.0,
            control_error_m: 0.0,
        }
    }

    fn set_points(rows: &mut Rows) -> Vec<Value> {
        let fresh = rows.take_fresh();
        fresh.map_or(Vec::new(), |rows| rows["columns"]["drive_set_point_m"].as_array().unwrap().clone())
    }

    #[test]
    fn a_set_point_is_that_of_the_rows_own_cycle() {
        let mut rows = Rows::default();
        let row = vec![Some(0.5); COLUMNS.len()];
        (0..2).for_each(|axis| rows.add_chain_values(axis, 3, values(0.25)));
        rows.add(0, &row);
        rows.add(10, &row);
        assert_eq!(set_points(&mut rows), [Value::Null], "of cycle 0 nothing is known, and 10 waits");
        (0..2).for_each(|axis| rows.add_chain_values(axis, 13, values(0.5)));
        rows.add(20, &row);
        // 7 of the 10 cycles between 3 and 13: 0.25 + 0.7 0.25.
        assert_eq!(set_points(&mut rows), [json!(0.425)]);
    }

    #[test]
    fn a_controller_that_is_silent_holds_nobody_up_for_long() {
        let mut rows = Rows::default();
        let row = vec![None; COLUMNS.len()];
        rows.add_chain_values(0, 0, values(0.25));
        (0..=60).step_by(10).for_each(|cycle| rows.add(cycle, &row));
        assert_eq!(set_points(&mut rows), [json!(0.25), Value::Null, Value::Null, Value::Null]);
    }

    #[test]
    fn one_lost_word_is_bridged_and_two_are_not() {
        for (after, expected) in [(20, json!(0.375)), (30, Value::Null)] {
            let mut rows = Rows::default();
            let row = vec![None; COLUMNS.len()];
            (0..2).for_each(|axis| rows.add_chain_values(axis, 0, values(0.25)));
            (0..2).for_each(|axis| rows.add_chain_values(axis, after, values(0.5)));
            [0, 10].into_iter().for_each(|cycle| rows.add(cycle, &row));
            assert_eq!(set_points(&mut rows), [json!(0.25), expected]);
        }
    }

    #[test]
    fn a_minute_is_kept_and_no_more() {
        let mut rows = Rows::default();
        let row = vec![None; COLUMNS.len()];
        (0..KEPT as u64 + 50).for_each(|place| rows.add(place * SPACING_CYCLES, &row));
        let last = rows.last(100.0);
        assert_eq!(last["t_s"].as_array().unwrap().len(), KEPT);
        assert_eq!(rows.last(0.5)["t_s"].as_array().unwrap().len(), 50);
    }
}
