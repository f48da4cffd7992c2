//! What effects remember from step to step: small copyable states, and histories of what is delayed.
//!
//! A substep may be discarded and made again in parts; so the copyable half ([`EffectStates`]) goes through a step by value, and
//! histories grow only when a substep counts. All room is taken at construction: a step allocates nothing.

use super::AxisEffects;
use super::declared::TermInputs;
use super::tabulated::AxisConditions;
use crate::integrator::{Integrator, Lanes, PERIOD_S};
use crate::lanes::{Axes, Pair};
use crate::state::State;

/// Commands that a dead time can look back to, periods; the longest allowed is 10 ms.
const COMMANDS: usize = 12;

/// The copyable half of the memory: states of effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EffectStates {
    pub(crate) axes: [AxisEffectStates; 2],
    /// What the supply node lacks against the baseline's, Pa.
    pub(crate) droop_pa: f64,
    /// Its last rate, Pa/s: half a step ahead of it is where a midpoint is.
    pub(crate) droop_pa_per_s: f64,
}

/// The copyable half of the memory of one axis; chambers as a, b.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct AxisEffectStates {
    /// Spool at the end of the step.
    pub(crate) spool: f64,
    /// Output of the play between command and spool.
    pub(crate) play: f64,
    /// Rate of the spool, 1/s, where it is a state.
    pub(crate) spool_rate_per_s: f64,
    /// What the exhausts' common volume has above the baseline's exhaust, Pa.
    pub(crate) silencer_pa: f64,
    /// Its last rate, Pa/s.
    pub(crate) silencer_pa_per_s: f64,
    /// Air in each chamber as its normal volume, m^3.
    pub(crate) normal_volume_m3: [f64; 2],
    /// Last rate of each chamber's stored air beside p_N q and the piston's work, W.
    pub(crate) air_rate_w: [f64; 2],
    /// Flow that left the valve for each chamber in the midpoint of the step, m^3/s.
    pub(crate) port_flow_m3_per_s: [f64; 2],
    /// Deflection of the bristles, m.
    pub(crate) deflection_m: f64,
    pub(crate) rest_s: f64,
    /// Outputs of lagging sensors: position, pressure a, pressure b.
    pub(crate) lag_output: [f64; 3],
    /// Their last inputs.
    pub(crate) lag_input: [f64; 3],
}

/// The commands of the last periods, the newest first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Commands([f64; COMMANDS]);

/// Values at even steps of time, as far back as a delay reaches.
#[derive(Debug, Clone)]
pub(crate) struct History {
    values: Vec<f64>,
    newest: usize,
}

impl Commands {
    pub(crate) fn new(command: f64) -> Self {
        Commands([command; COMMANDS])
    }

    pub(crate) fn begin_period(&mut self, command: f64) {
        self.0.copy_within(..COMMANDS - 1, 1);
        self.0[0] = command;
    }

    /// The command that acts.
    pub(crate) fn newest(&self) -> f64 {
        self.0[0]
    }

    /// The command that was sent `back_s` before the period's beginning, or after it if negative.
    pub(crate) fn before(&self, back_s: f64) -> f64 {
        // Exactly on an edge the newer command counts.
        let periods = (back_s / PERIOD_S).ceil().max(0.0) as usize;
        self.0[periods.min(COMMANDS - 1)]
    }
}

impl History {
    /// Room for a delay of so many steps, all of one value.
    pub(crate) fn new(value: f64, steps: f64) -> Self {
        History { values: vec![value; steps.ceil() as usize + 2], newest: 0 }
    }

    /// Adds a value to all that is remembered.
    fn shift(&mut self, by: f64) {
        self.values.iter_mut().for_each(|value| *value += by);
    }

    /// Forgets all for one value.
    pub(crate) fn fill(&mut self, value: f64) {
        self.values.fill(value);
    }

    /// Adds the newest value.
    pub(crate) fn push(&mut self, value: f64) {
        self.newest = (self.newest + 1) % self.values.len();
        self.values[self.newest] = value;
    }

    /// The value `steps` steps before the newest, in a straight line between two; the oldest beyond the room.
    pub(crate) fn before(&self, steps: f64) -> f64 {
        let steps = steps.clamp(0.0, (self.values.len() - 1) as f64);
        let whole = steps as usize;
        let (newer, older) = (self.at(whole), self.at((whole + 1).min(self.values.len() - 1)));
        newer + (older - newer) * (steps - whole as f64)
    }

    fn at(&self, steps: usize) -> f64 {
        self.values[(self.newest + self.values.len() - steps) % self.values.len()]
    }
}

/// Conditions of an axis at the end of a step.
pub(super) fn axis_conditions_at(of: &Integrator, lanes: &Lanes, axis: usize) -> AxisConditions {
    let lane = |pair: Pair| pair.to_array()[axis];
    let volumes = [of.chambers.volume_a(lanes.extension), of.chambers.volume_b(lanes.extension)];
    AxisConditions {
        extension_m: lane(lanes.extension),
        velocity_m_per_s: lane(lanes.velocity),
        spool: lane(lanes.spool),
        pressure_pa: [0, 1].map(|chamber: usize| lane(lanes.air()[chamber].stored) / lane(volumes[chamber])),
    }
}

/// All that effects remember.
#[derive(Debug, Clone)]
pub(crate) struct Memory {
    pub(crate) states: EffectStates,
    pub(crate) commands: [Commands; 2],
    /// Substeps since the plant began.
    pub(crate) substeps: u64,
    /// What left the valve for each chamber, at the midpoints of substeps.
    pub(super) lines: [[Option<History>; 2]; 2],
    /// What the channels position, force, a, b would have shown, at the ends of substeps.
    pub(super) channels: [[Option<History>; 4]; 2],
    /// What declared terms keep, SI.
    pub(super) declared: [Vec<f64>; 2],
    /// What the force sensors should show at the end of the last substep, N; renewed where a declared term is over it in a step.
    pub(crate) sensor_force_n: [f64; 2],
}

impl Memory {
    pub(super) fn at_rest(on: &[AxisEffects; 2], of: &Integrator, state: &State) -> Self {
        let lanes = Lanes::load(state);
        let volume_m3 = [of.chambers.volume_a(lanes.extension), of.chambers.volume_b(lanes.extension)];
        let stored_j = lanes.air().map(|air| air.stored);
        let axis = |i: usize| {
            let lane = |pair: Pair| pair.to_array()[i];
            let pressure_pa = [0, 1].map(|chamber| lane(stored_j[chamber]) / lane(volume_m3[chamber]));
            let position_m =
                if i == 0 { lane(lanes.extension) } else { of.motion.stroke_m - lane(lanes.extension) };
            let truths = [position_m, pressure_pa[0], pressure_pa[1]];
            AxisEffectStates {
                spool: lane(lanes.spool),
                play: lane(lanes.spool),
                normal_volume_m3: stored_j.map(|stored| lane(stored) / of.chambers.normal_pa),
                port_flow_m3_per_s: lanes.air().map(|air| lane(air.flow)),
                lag_output: truths,
                lag_input: truths,
                ..AxisEffectStates::default()
            }
        };
        let axes = [axis(0), axis(1)];
        let steps = |delay_s: f64| delay_s / of.substep_s();
        let lines = [0, 1].map(|i| {
            let axis: &AxisEffectStates = &axes[i];
            axis.port_flow_m3_per_s
                .map(|flow| on[i].line_delay.map(|effect| History::new(flow, steps(effect.delay_s()) + 2.0)))
        });
        let channels = [0, 1].map(|i| {
            let axis: &AxisEffectStates = &axes[i];
            let values = [axis.lag_input[0], 0.0, axis.lag_input[1], axis.lag_input[2]];
            [0, 1, 2, 3].map(|channel: usize| {
                on[i].time_skew[channel]
                    .map(|effect| History::new(values[channel], steps(effect.delay_s) + 1.0))
            })
        });
        let commands = [0, 1].map(|i: usize| Commands::new(axes[i].spool));
        let declared = [0, 1].map(|i: usize| {
            let (conditions, command) = (axis_conditions_at(of, &lanes, i), axes[i].spool);
            let at =
                TermInputs { conditions: &conditions, command, time_s: 0.0, sensor_force_n: 0.0, kept: &[] };
            on[i].declared.begin(&at.values())
        });
        Memory {
            states: EffectStates { axes, droop_pa: 0.0, droop_pa_per_s: 0.0 },
            commands,
            substeps: 0,
            lines,
            channels,
            declared,
            sensor_force_n: [0.0; 2],
        }
    }

    /// Shifts the inputs that sensors remember (position, force, pressures of each axis) by the jump of their inputs.
    pub(crate) fn shift_sensor_histories(&mut self, before: [[f64; 4]; 2], now: [[f64; 4]; 2]) {
        for (axis, axis_states) in self.states.axes.iter_mut().enumerate() {
            let by: [f64; 4] = std::array::from_fn(|channel| now[axis][channel] - before[axis][channel]);
            let [position, _, a, b] = by;
            for (i, by) in [position, a, b].into_iter().enumerate() {
                axis_states.lag_output[i] += by;
                axis_states.lag_input[i] += by;
            }
            for (history, by) in self.channels[axis].iter_mut().zip(by) {
                history.iter_mut().for_each(|history| history.shift(by));
            }
        }
    }

    /// The masses that have, in the new state, the temperatures of the old one.
    pub(crate) fn keep_temperatures(&mut self, old: &State, new: &State) {
        for ((axis_states, old), new) in self.states.axes.iter_mut().zip(&old.axes).zip(&new.axes) {
            axis_states.normal_volume_m3[0] *= new.stored_air_a_j / old.stored_air_a_j;
            axis_states.normal_volume_m3[1] *= new.stored_air_b_j / old.stored_air_b_j;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_gives_back_what_was_pushed_and_lines_between() {
        let mut history = History::new(0.0, 3.5);
        (1..=10).for_each(|value| history.push(f64::from(value)));
        assert_eq!([0.0, 1.0, 3.0, 1.25].map(|steps| history.before(steps)), [10.0, 9.0, 7.0, 8.75]);
    }

    #[test]
    fn commands_change_at_the_edges_of_their_periods() {
        let mut commands = Commands::new(0.0);
        (1..=3).for_each(|k| commands.begin_period(f64::from(k)));
        let back = [-0.5e-3, 0.0, 0.1e-3, 1.0e-3, 1.5e-3, 99.0];
        assert_eq!(back.map(|back_s| commands.before(back_s)), [3.0, 3.0, 2.0, 2.0, 1.0, 0.0]);
    }
}
