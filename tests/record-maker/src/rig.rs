//! Both axes of the record maker, integrated by explicit midpoint steps that are short beside every time constant of the rig.
//!
//! ```text
//!   stage 1   rates at t          true values for the sensors; break-away is decided here
//!   stage 2   rates at t + h/2    from the state half a step on; bristles by their exact exponential
//!   end       y + h rates         then stick if the velocity changed sign, ends of the stroke, bounds of the lagged flow
//! ```
//!
//! It shares neither code nor integration scheme with the plant, which uses exact exponentials over 100 us and locates events.
//! Here an event costs an error of the length of a step. Both implement rig-model.md. Their difference:
//! `tests/docs/record-maker.md`.

use super::axis::{AIR, Air, Axis, EXHAUST, FLOW, LINE_LAG_SHARE, LINES_DIFFER, NORMAL, SPOOL, V, X, Y};
use super::coupling::Coupling;
use super::port::Node;
use super::sensing::{CHANNELS, Sensing};
use super::valve::PlayState;
use super::{Form, TrueAxis};

/// Steps in a millisecond: 10 us, a tenth of the plant's substep. The docs have a table of convergence.
pub(super) const STEPS_PER_MS: usize = 100;

/// Commands kept for late execution: the current one, and those of as many periods as a command may be late.
const KEPT_COMMANDS: usize = 16;
/// Below this speed a piston on bristles is at rest, m/s.
const CREEP_M_PER_S: f64 = 1e-5;
/// Share of the near form's dead time that is a first-order lag.
const LATE_LAG_SHARE: f64 = 0.2;
/// The far form's dead time is a sawtooth about its mean, as between two clocks that are not synchronised: relative amplitude,
/// and period, s.
const LATE_SLIDES: f64 = 0.66;
const LATE_BEAT_S: f64 = 0.37;
/// Relative drift of the far form's null as the valve warms up.
const NULL_DRIFTS: f64 = 0.7;

#[derive(Debug, Clone)]
pub(super) struct Rig {
    pub(super) axes: [Axis; 2],
    /// Axes that move; the other one rests.
    pub(super) active: [bool; 2],
    pub(super) coupling: Option<Coupling>,
    pub(super) supply: Option<Node>,
    /// Command dead time of each axis, s.
    pub(super) late_s: [f64; 2],
    pub(super) form: Form,
    /// Euler's method instead of the midpoint's.
    pub(super) first_order: bool,
    pub(super) steps_per_ms: usize,
}

#[derive(Debug, Clone, Default)]
pub(super) struct State {
    pub(super) y: [Y; 2],
    /// Deflection of the bristles, m.
    pub(super) bristles: [f64; 2],
    /// Direction of sliding; 0 for a piston that sticks.
    pub(super) direction: [f64; 2],
    pub(super) rest_since_s: [f64; 2],
    /// Rest before the last break-away, s, and the extension at which it happened, m.
    last_break_away: [[f64; 2]; 2],
    pub(super) supply_pa: f64,
    play: [PlayState; 2],
    late: [f64; 2],
    commands: [[f64; KEPT_COMMANDS]; 2],
    lines: [LineDelay; 2],
    pub(super) steps: u64,
}

/// Flow through the valve at the middle of each of the last steps.
#[derive(Debug, Clone, Default)]
struct LineDelay {
    ring: Vec<[f64; 2]>,
    leaves: [f64; 2],
}

/// Rates and forces of both axes; those of the default are of axes at rest.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Derivatives {
    pub(super) rates: [Y; 2],
    pub(super) air: [Air; 2],
    pub(super) contact_n: f64,
    pub(super) friction_n: [f64; 2],
    supply_rate: f64,
}

impl Rig {
    /// The state at rest at these extensions, m.
    pub(super) fn start(&self, extension_m: [f64; 2]) -> State {
        let y = [0, 1].map(|i| self.axes[i].start(extension_m[i]));
        let line = |i: usize| {
            let longest = self.delay_steps(i).map(|[a, b]| a.max(b));
            let steps = longest.map_or(0, |steps| (steps.ceil() as usize + 2).next_power_of_two());
            LineDelay { ring: vec![[0.0; 2]; steps], leaves: [0.0; 2] }
        };
        State { y, supply_pa: self.axes[0].numbers.supply_pa, lines: [line(0), line(1)], ..State::default() }
    }

    /// Sets the smooth states of the baseline to those of a record.
    pub(super) fn set(&self, state: &mut State, axes: &[TrueAxis; 2]) {
        for (i, axis) in axes.iter().enumerate() {
            let y = &mut state.y[i];
            [y[X], y[V], y[SPOOL]] = [axis.extension_m, axis.rod_velocity_m_per_s, axis.spool];
            y[AIR..AIR + 2].copy_from_slice(&axis.stored_air_j);
            y[NORMAL..NORMAL + 2].copy_from_slice(&axis.stored_air_j);
            y[FLOW..FLOW + 2].copy_from_slice(&axis.flow_m3_per_s);
            state.direction[i] = if y[V] == 0.0 { 0.0 } else { y[V].signum() };
        }
    }

    /// Delays of both chambers' lines, in steps; `None` without the effect.
    fn delay_steps(&self, axis: usize) -> Option<[f64; 2]> {
        let laws = &self.axes[axis].laws;
        let pure = laws.form.of([1.0, 1.0 - LINE_LAG_SHARE, 1.0]);
        let of = |chamber| laws.form.side(chamber == 0, LINES_DIFFER) * pure * laws.line_delay_s;
        (laws.line_delay_s > 0.0).then(|| [of(0), of(1)].map(|delay_s| delay_s / self.step_s()))
    }

    pub(super) fn step_s(&self) -> f64 {
        1e-3 / self.steps_per_ms as f64
    }

    pub(super) fn time_s(&self, state: &State) -> f64 {
        state.steps as f64 * self.step_s()
    }

    /// Advances by one period under these commands. The sensors get the true values of each step, `at_start` those of the
    /// first.
    pub(super) fn advance(
        &self,
        state: &mut State,
        commands: [f64; 2],
        sensing: &mut [Sensing; 2],
        mut at_start: impl FnMut(&State, &Derivatives),
    ) {
        for (past, command) in state.commands.iter_mut().zip(commands) {
            past.rotate_right(1);
            past[0] = command;
        }
        for step in 0..self.steps_per_ms {
            let targets = self.targets(state, step);
            let first = self.evaluate_first(state, targets);
            for (i, sensing) in sensing.iter_mut().enumerate().filter(|(i, _)| self.active[*i]) {
                sensing.store(self.sensed(state, &first, i));
            }
            if step == 0 {
                at_start(state, &first);
            }
            self.step(state, targets, &first);
        }
    }

    /// True values of position, force and pressures of an axis, in rig coordinates.
    pub(super) fn sensed(&self, state: &State, derivatives: &Derivatives, i: usize) -> [f64; CHANNELS] {
        let axis = &self.axes[i];
        let x = state.y[i][X];
        let position = if i == 0 { x } else { axis.numbers.stroke_m - x };
        let force = axis.numbers.behind_kg[i] * derivatives.rates[i][V] - derivatives.contact_n;
        let [a, b] = derivatives.air[i].pressure_pa;
        [position, force, a, b]
    }

    /// Target positions of both spools in a step of the period.
    fn targets(&self, state: &mut State, step: usize) -> [f64; 2] {
        let mut targets = [0.0; 2];
        for (i, target) in targets.iter_mut().enumerate() {
            if !self.active[i] {
                continue;
            }
            let past = &state.commands[i];
            let pure = match self.form {
                Form::Catalogue => 1.0,
                Form::Near => 1.0 - LATE_LAG_SHARE,
                Form::Far => {
                    let beats = self.time_s(state) / LATE_BEAT_S;
                    1.0 + LATE_SLIDES * (2.0 * (beats - beats.floor()) - 1.0)
                }
            };
            let late_s = self.late_s[i];
            let mut command = past[0];
            if late_s > 0.0 {
                // Mean over the step, in which the command changes at most once.
                let end_ms = (step + 1) as f64 / self.steps_per_ms as f64 - pure * late_s * 1e3;
                let begin_ms = end_ms - 1.0 / self.steps_per_ms as f64;
                let at = |ms: f64| past[((-ms.floor()).max(0.0) as usize).min(KEPT_COMMANDS - 1)];
                let before_edge = (end_ms.ceil() - 1.0 - begin_ms).max(0.0) * self.steps_per_ms as f64;
                let share = before_edge.min(1.0);
                command = share * at(begin_ms) + (1.0 - share) * at(end_ms - 1e-9);
                if self.form == Form::Near {
                    let kept = libm::exp(-self.step_s() / (LATE_LAG_SHARE * late_s));
                    let before = state.late[i];
                    state.late[i] = command + (before - command) * kept;
                    command = (before + state.late[i]) / 2.0;
                }
            }
            let drift = self.form.drift(state.steps as f64 * 1e-3 / self.steps_per_ms as f64, NULL_DRIFTS);
            *target = self.axes[i].valve.target(command, &mut state.play[i], drift);
        }
        targets
    }

    /// Evaluates the laws at the start of a step, and starts the motion of pistons that break away.
    fn evaluate_first(&self, state: &mut State, targets: [f64; 2]) -> Derivatives {
        let lines = [0, 1].map(|i| self.delay_steps(i).map(|_| state.lines[i].leaves));
        let time_s = self.time_s(state);
        let rest_s = [0, 1].map(|i| time_s - state.rest_since_s[i]);
        let mut direction = state.direction;
        let at = StageState {
            y: &state.y,
            bristles: state.bristles,
            supply_pa: state.supply_pa,
            rest_s,
            last_break_away: state.last_break_away,
        };
        let derivatives = self.evaluate(&at, &mut direction, targets, lines, true);
        for i in 0..2 {
            if state.direction[i] == 0.0 && direction[i] != 0.0 {
                state.last_break_away[i] = [rest_s[i], state.y[i][X]];
            }
        }
        state.direction = direction;
        derivatives
    }

    fn evaluate(
        &self,
        at: &StageState<'_>,
        direction: &mut [f64; 2],
        targets: [f64; 2],
        lines: [Option<[f64; 2]>; 2],
        may_break_away: bool,
    ) -> Derivatives {
        let mut derivatives = Derivatives::default();
        let mut drawn = 0.0;
        for i in 0..2 {
            if !self.active[i] {
                continue;
            }
            let (axis, y) = (&self.axes[i], &at.y[i]);
            let air = axis.air(y, at.supply_pa);
            drawn += air.drawn;
            let line = lines[i].unwrap_or(air.edge_flow);
            derivatives.rates[i] = axis.rates(y, &air, at.supply_pa, targets[i], line);
            derivatives.air[i] = air;
        }
        if let Some(node) = &self.supply {
            let normal_pa = self.axes[0].numbers.normal_pa;
            derivatives.supply_rate = normal_pa * (node.inflow(at.supply_pa) - drawn) / node.volume_m3;
        }
        if let Some(coupling) = &self.coupling {
            let stroke_m = self.axes[0].numbers.stroke_m;
            let [drive, load] = at.y;
            derivatives.contact_n = coupling.force(stroke_m - drive[X] - load[X], -drive[V] - load[V]);
        }
        for i in 0..2 {
            if self.active[i] {
                self.move_axis(i, at, direction, &mut derivatives, may_break_away);
            }
        }
        derivatives
    }

    #[inline(always)]
    fn move_axis(
        &self,
        i: usize,
        at: &StageState<'_>,
        direction: &mut [f64; 2],
        derivatives: &mut Derivatives,
        may_break_away: bool,
    ) {
        let (axis, y) = (&self.axes[i], &at.y[i]);
        let motion = &axis.motion;
        let place = axis.at(y, &derivatives.air[i], at.rest_s[i], at.last_break_away[i]);
        let pushed_n = derivatives.air[i].force_n + motion.pushes(y[X]) + derivatives.contact_n;
        let stroke_m = axis.numbers.stroke_m;
        let pressed = |force: f64| y[X] <= 0.0 && force < 0.0 || y[X] >= stroke_m && force > 0.0;
        if motion.laws.presliding.is_some() {
            let friction_n = motion.bristles(place, y[V], at.bristles[i]);
            let sum = pushed_n + friction_n;
            let held = y[V] == 0.0 && pressed(sum);
            derivatives.friction_n[i] = friction_n;
            derivatives.rates[i][X] = if held { 0.0 } else { y[V] };
            derivatives.rates[i][V] = if held { 0.0 } else { sum / motion.mass_kg };
            return;
        }
        if direction[i] == 0.0 && may_break_away && !pressed(pushed_n) {
            let way = if pushed_n < 0.0 { -1.0 } else { 1.0 };
            if pushed_n.abs() > motion.break_away(place, way) {
                direction[i] = way;
            }
        }
        if direction[i] == 0.0 {
            derivatives.friction_n[i] = -pushed_n;
            return;
        }
        let friction_n = motion.sliding(place, y[V], direction[i]);
        derivatives.friction_n[i] = friction_n;
        derivatives.rates[i][X] = y[V];
        derivatives.rates[i][V] = (pushed_n + friction_n) / motion.mass_kg;
    }

    /// Advances by one step from the evaluation at its start.
    fn step(&self, state: &mut State, targets: [f64; 2], first: &Derivatives) {
        let h = self.step_s();
        let rest_s = [0, 1].map(|i| self.time_s(state) - state.rest_since_s[i]);
        let mut y = state.y;
        let mut bristles = state.bristles;
        for i in 0..2 {
            if self.active[i] {
                add(&mut y[i], &first.rates[i], h / 2.0);
                if self.axes[i].motion.laws.presliding.is_some() {
                    let place =
                        self.axes[i].at(&state.y[i], &first.air[i], rest_s[i], state.last_break_away[i]);
                    bristles[i] = self.axes[i].motion.deflect(place, state.y[i][V], bristles[i], h / 2.0);
                }
            }
        }
        let supply_pa = state.supply_pa + h / 2.0 * first.supply_rate;
        let lines = [0, 1].map(|i| self.line_outflow(state, i, &y[i], supply_pa));
        let mut direction = state.direction;
        let at = StageState { y: &y, bristles, supply_pa, rest_s, last_break_away: state.last_break_away };
        let middle =
            if self.first_order { *first } else { self.evaluate(&at, &mut direction, targets, lines, false) };
        for i in 0..2 {
            if !self.active[i] {
                continue;
            }
            let from = state.y[i];
            add(&mut state.y[i], &middle.rates[i], h);
            if state.y[i][SPOOL].abs() > 1.0 {
                // The spool reaches its stop.
                (state.y[i][SPOOL], state.y[i][SPOOL + 1]) = (state.y[i][SPOOL].signum(), 0.0);
            }
            let axis = &self.axes[i];
            if axis.motion.laws.presliding.is_some() {
                let place = axis.at(&y[i], &middle.air[i], rest_s[i], state.last_break_away[i]);
                state.bristles[i] = axis.motion.deflect(place, y[i][V], state.bristles[i], h);
            }
            self.stick_or_stop(state, i, &from);
            let after_pa = state.supply_pa + h * middle.supply_rate;
            bound(axis, &mut state.y[i], &from, [state.supply_pa, after_pa]);
        }
        state.supply_pa += h * middle.supply_rate;
        state.steps += 1;
    }

    /// Flow out of the lines of an axis at the middle of this step; stores what enters them.
    fn line_outflow(&self, state: &mut State, i: usize, y: &Y, supply_pa: f64) -> Option<[f64; 2]> {
        let delay = self.delay_steps(i).filter(|_| self.active[i])?;
        let enters = self.axes[i].air(y, supply_pa).edge_flow;
        let now = state.steps as usize;
        let line = &mut state.lines[i];
        let mask = line.ring.len() - 1;
        line.ring[now & mask] = enters;
        let past = |back: usize, chamber: usize| {
            if back > now { 0.0 } else { line.ring[(now - back) & mask][chamber] }
        };
        let leaves = [0, 1].map(|chamber| {
            let back = delay[chamber].floor() as usize;
            let share = delay[chamber] - delay[chamber].floor();
            past(back, chamber) * (1.0 - share) + past(back + 1, chamber) * share
        });
        line.leaves = leaves;
        Some(leaves)
    }

    /// Sticks a piston whose velocity changed sign within the step, and stops one at the ends.
    #[inline(always)]
    fn stick_or_stop(&self, state: &mut State, i: usize, from: &Y) {
        let axis = &self.axes[i];
        let end_s = (state.steps + 1) as f64 * self.step_s();
        let y = &mut state.y[i];
        let sticks = axis.motion.laws.presliding.is_none();
        if sticks && state.direction[i] != 0.0 && y[V] * state.direction[i] <= 0.0 {
            // It moves on to where the straight line of the velocity crosses zero.
            let share = if from[V] == y[V] { 0.0 } else { (from[V] / (from[V] - y[V])).clamp(0.0, 1.0) };
            y[X] = from[X] + from[V] * share * self.step_s() / 2.0;
            y[V] = 0.0;
            state.direction[i] = 0.0;
            state.rest_since_s[i] = end_s;
        }
        if !sticks && y[V].abs() > CREEP_M_PER_S {
            state.rest_since_s[i] = end_s;
        }
        let stroke_m = axis.numbers.stroke_m;
        if y[X] < 0.0 && y[V] <= 0.0 || y[X] > stroke_m && y[V] >= 0.0 {
            y[X] = y[X].clamp(0.0, stroke_m);
            if y[V] != 0.0 {
                y[V] = 0.0;
                state.direction[i] = 0.0;
                state.rest_since_s[i] = end_s;
            }
        }
    }
}

struct StageState<'a> {
    y: &'a [Y; 2],
    bristles: [f64; 2],
    supply_pa: f64,
    rest_s: [f64; 2],
    last_break_away: [[f64; 2]; 2],
}

#[inline(always)]
fn add(y: &mut Y, rates: &Y, span_s: f64) {
    for (y, rate) in y.iter_mut().zip(rates) {
        *y += rate * span_s;
    }
}

/// A lagged flow neither fills a chamber beyond its supply nor empties it below its exhaust: it becomes zero, and the air stays
/// at the bound that it has just passed.
#[inline(always)]
fn bound(axis: &Axis, y: &mut Y, from: &Y, supply_pa: [f64; 2]) {
    let volumes = axis.volumes(y[X]);
    let silenced = axis.silencer.is_some();
    let exhaust = |y: &Y| if silenced { y[EXHAUST] } else { axis.numbers.exhaust_pa };
    for chamber in 0..2 {
        let flow = y[FLOW + chamber];
        let pressure = y[AIR + chamber] / volumes[chamber];
        let (passed, bounds) = if flow > 0.0 && pressure >= supply_pa[1] {
            (1.0, supply_pa)
        } else if flow < 0.0 && pressure <= exhaust(y) {
            (-1.0, [exhaust(from), exhaust(y)])
        } else {
            continue;
        };
        y[FLOW + chamber] = 0.0;
        let before = from[AIR + chamber] / axis.volumes(from[X])[chamber];
        if (bounds[0] - before) * passed > 0.0 {
            let beyond = y[AIR + chamber] - bounds[1] * volumes[chamber];
            y[AIR + chamber] -= beyond;
            y[NORMAL + chamber] -= beyond;
        }
    }
}
