//! History variables of an axis: low-pass and play (hysteresis) states of recorded signals.
//!
//! ```text
//!   low pass     y' = (x - y)/T                                 change = x - y: what x did in the last T
//!   play         y  = min(max(y, x - h), x + h)                 direction = (x - y)/h: which way x moved last
//! ```
//!
//! Half widths of plays are a share of the range of the record, so that noise does not turn them round. Computed on the whole
//! record: a subsample remembers what came before its blocks.
//!
//! Source: Visintin 1994, Differential Models of Hysteresis (play); effects.md (times of valve, lines and heat exchange).

use super::GriddedRecord;
use plant::PERIOD_S;

/// Half width of a play over the range of its variable.
const PLAY: f64 = 0.01;
/// Times of valve and lines, s.
pub(crate) const VALVE_TIMES_S: [f64; 2] = [0.002, 0.01];
/// Times of a chamber's temperature, s.
pub(crate) const CHAMBER_TIMES_S: [f64; 2] = [0.1, 1.0];
/// Time of what was consumed and dissipated, s.
pub(crate) const USE_TIME_S: f64 = 1.0;

/// Memories of an axis in a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    /// Change of the command within [`VALVE_TIMES_S`].
    pub(crate) command_changes: [f64; 2],
    /// Which way the command and the piston moved last, -1 to 1.
    pub(crate) command_direction: f64,
    pub(crate) extension_direction: f64,
    /// Change of the pressures a and b within each of [`CHAMBER_TIMES_S`], Pa.
    pub(crate) pressure_changes_pa: [[f64; 2]; 2],
    /// Mean |v| over [`USE_TIME_S`], m/s.
    pub(crate) mean_speed_m_per_s: f64,
}

impl GriddedRecord {
    /// Fills the memories of an axis.
    pub(super) fn remember(&mut self, axis: usize) {
        let commands: Vec<f64> = self.inputs.iter().map(|inputs| inputs.valve[axis]).collect();
        let of = |value: &dyn Fn(&super::AxisState) -> f64| -> Vec<f64> {
            self.smoothed_states.iter().map(|states| value(&states[axis])).collect()
        };
        let pressures = [0, 1].map(|chamber| of(&|state| state.pressures_pa[chamber]));
        let speeds = of(&|state| state.rod_velocity_m_per_s.abs());
        let command_changes = VALVE_TIMES_S.map(|time_s| changes(&commands, time_s));
        let pressure_changes =
            CHAMBER_TIMES_S.map(|time_s| [0, 1].map(|chamber: usize| changes(&pressures[chamber], time_s)));
        let speed_changes = changes(&speeds, USE_TIME_S);
        let command_directions = directions(&commands);
        let extension_directions = directions(&of(&|state| state.extension_m));
        self.memories.resize(self.inputs.len(), Default::default());
        for (at, memory) in self.memories.iter_mut().enumerate() {
            memory[axis] = Memory {
                command_changes: [0, 1].map(|time: usize| command_changes[time][at]),
                command_direction: command_directions[at],
                extension_direction: extension_directions[at],
                pressure_changes_pa: [0, 1]
                    .map(|time: usize| [0, 1].map(|chamber: usize| pressure_changes[time][chamber][at])),
                mean_speed_m_per_s: speeds[at] - speed_changes[at],
            };
        }
    }
}

/// A variable without its low pass, which starts at its first value.
fn changes(values: &[f64], time_s: f64) -> Vec<f64> {
    let share = -(-PERIOD_S / time_s).exp_m1();
    let mut low = values.first().copied().unwrap_or(0.0);
    let change = |value: &f64| {
        low += share * (value - low);
        value - low
    };
    values.iter().map(change).collect()
}

/// Which way a variable moved last: its distance from a play over the half width.
fn directions(values: &[f64]) -> Vec<f64> {
    let [least, most] = [
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    ];
    let half = PLAY * (most - least);
    let mut play = values.first().copied().unwrap_or(0.0);
    let direction = |value: &f64| {
        play = play.max(value - half).min(value + half);
        if half > 0.0 { (value - play) / half } else { 0.0 }
    };
    values.iter().map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_the_step_at_first_and_fades_with_its_time() {
        let step: Vec<f64> = (0..200).map(|at| if at < 50 { 0.0 } else { 2.0 }).collect();
        let changed = changes(&step, 0.01);
        assert!(changed[..50].iter().all(|change| *change == 0.0));
        let after = |periods: usize| 2.0 * (-(periods as f64) * PERIOD_S / 0.01).exp();
        for periods in [1, 10, 50] {
            assert!((changed[49 + periods] - after(periods)).abs() < 1e-12, "{periods}");
        }
    }

    #[test]
    fn a_direction_stays_at_rest_and_turns_only_beyond_the_play() {
        // Up to 1, a rest with a little noise, down to 0.
        let up = (0..=100).map(|at| 0.01 * f64::from(at));
        let rest = (0..100).map(|at| 1.0 - 0.002 * f64::from(at % 2));
        let down = (0..=100).map(|at| 1.0 - 0.01 * f64::from(at));
        let directed = directions(&up.chain(rest).chain(down).collect::<Vec<_>>());
        assert!(directed[2..201].iter().all(|direction| *direction > 0.5));
        assert!(directed[205..].iter().all(|direction| (direction + 1.0).abs() < 1e-9));
        assert!(directions(&[3.0; 10]).iter().all(|direction| *direction == 0.0));
    }
}
