//! The equations under a window's commands, solved by ode_solvers: Dormand and Prince's explicit pair of orders 5 and 4 with its
//! own control of the step, from edge to edge of the commands, across which nothing is smooth.

use ode_solvers::{DVector, Dopri5, OutputType};

use super::equations::{
    AXIS, BRISTLE, GAS_MASS, P, P_NODE, P_SILENCER, Q, SHOWN, SPOOL, STATES, System, V, X,
};
use super::numbers::{CARRIAGE, GAS, Numbers, P_EXHAUST, STROKE, T_WALL};
use plant::{Inputs, State};

/// Relative tolerance of the solver; ten times stricter moves no result by more than 1e-4 of the noise.
const RELATIVE: f64 = 1e-9;

/// Absolute tolerances: extension, velocity, spool and its rate, pressures, masses, flows, silencer, bristles, what sensors show.
const ABSOLUTE: [f64; AXIS] =
    [1e-11, 1e-9, 1e-10, 1e-7, 1e-3, 1e-3, 1e-13, 1e-13, 1e-12, 1e-12, 1e-3, 1e-13, 1e-11, 1e-3, 1e-3];

/// The compared quantities of one axis at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisSample {
    pub(crate) velocity: f64,
    pub(crate) spool: f64,
    /// Position, force, pressure a, pressure b.
    pub(crate) truth: [f64; 4],
    /// The same as the sensors show it, without noise.
    pub(crate) shown: [f64; 4],
    pub(crate) silencer: f64,
    pub(crate) bristles: f64,
    /// Of the supply node, the same for both axes.
    pub(crate) node: f64,
}

type Y = [f64; STATES];

/// What the sensors would show at each millisecond of a window, for both axes.
pub(crate) fn solve(numbers: &Numbers, start: &State, inputs: &[Inputs]) -> Vec<[AxisSample; 2]> {
    let mut system =
        System { numbers, target: [0.0; 2], linked: start.linked, added_mass: start.added_mass_kg };
    let end = inputs.len() as f64 * 1e-3;
    let mut edges: Vec<f64> = vec![0.0, end];
    let mut requested: Vec<f64> = Vec::new();
    for k in 0..=inputs.len() {
        let t = k as f64 * 1e-3;
        edges.extend(numbers.axes.iter().map(|axis| t + axis.dead_time));
        let skews = numbers.axes.iter().flat_map(|axis| axis.skew);
        requested.extend(skews.map(|skew| t - skew).filter(|&t| t >= 0.0));
        requested.push(t);
    }
    for times in [&mut edges, &mut requested] {
        times.retain(|&t| (0.0..=end).contains(&t));
        times.sort_by(f64::total_cmp);
        times.dedup_by(|b, a| *b - *a < 1e-12);
    }

    let mut y = initial_state(&system, start);
    let mut solved: Vec<(f64, Y)> = vec![(0.0, y)];
    let mut play = start.axes.map(|axis| axis.spool);
    for leg in edges.windows(2) {
        let middle = 0.5 * (leg[0] + leg[1]);
        for axis in [0, 1] {
            let n = &numbers.axes[axis];
            let sent_at = middle - n.dead_time;
            let command = if sent_at < 0.0 {
                start.axes[axis].spool
            } else {
                inputs[(sent_at / 1e-3) as usize].valve[axis]
            };
            let arriving = command + n.null_offset;
            play[axis] = play[axis].clamp(arriving - n.play, arriving + n.play);
            system.target[axis] = play[axis].clamp(-1.0, 1.0);
        }
        let inside = |t: f64| t > leg[0] + 1e-12 && t < leg[1] - 1e-12;
        let mut times: Vec<f64> = requested.iter().copied().filter(|&t| inside(t)).collect();
        times.push(leg[1]);
        for (t, state) in times.iter().zip(states_at(&system, &y, leg[0], &times)) {
            solved.push((*t, state));
            y = state;
        }
    }
    let at = |t: f64| -> &Y {
        let near = |(s, _): &&(f64, Y)| (s - t).abs() < 1e-9;
        &solved.iter().find(near).expect("this time was asked for").1
    };
    (1..=inputs.len()).map(|k| [0, 1].map(|axis| sample(&system, axis, k as f64 * 1e-3, at))).collect()
}

/// The equations in units of the absolute tolerances, since the solver takes one tolerance for all states.
struct Scaled<'s> {
    system: &'s System<'s>,
    units: Y,
}

impl ode_solvers::System<f64, DVector<f64>> for Scaled<'_> {
    fn system(&self, _: f64, scaled: &DVector<f64>, rate: &mut DVector<f64>) {
        let y: Y = std::array::from_fn(|i| scaled[i] * self.units[i]);
        let mut rates = [0.0; STATES];
        self.system.rates(&y, &mut rates);
        (0..STATES).for_each(|i| rate[i] = rates[i] / self.units[i]);
    }
}

/// The states at these times, of which the last ends the leg.
fn states_at(system: &System<'_>, from: &Y, begin: f64, times: &[f64]) -> Vec<Y> {
    let units: Y = std::array::from_fn(|i| if i == P_NODE { 1e-3 } else { ABSOLUTE[i % AXIS] });
    let (mut t, mut y) = (begin, *from);
    let step_to = |&end: &f64| {
        let scaled = DVector::from_iterator(STATES, (0..STATES).map(|i| y[i] / units[i]));
        // Safety factor, beta, smallest and largest change of the step, and limits of steps are the solver's defaults; h = 0
        // is chosen.
        let mut solver = Dopri5::from_param(
            Scaled { system, units },
            t,
            end,
            end - t,
            scaled,
            RELATIVE,
            1.0,
            0.9,
            0.04,
            0.2,
            10.0,
            end - t,
            0.0,
            100_000,
            1000,
            OutputType::Sparse,
        );
        solver.integrate().expect("the window is smooth");
        let last = solver.y_out().last().expect("a step was made");
        (t, y) = (end, std::array::from_fn(|i| last[i] * units[i]));
        y
    };
    times.iter().map(step_to).collect()
}

/// The start of a window, with all that effects remember at rest, as the plant has it.
fn initial_state(system: &System<'_>, start: &State) -> Y {
    let mut y = [0.0; STATES];
    for (axis, axis_state) in start.axes.iter().enumerate() {
        let row = &mut y[AXIS * axis..AXIS * (axis + 1)];
        row[X] = axis_state.extension_m;
        row[V] = axis_state.rod_velocity_m_per_s;
        row[SPOOL] = axis_state.spool;
        row[P_SILENCER] = P_EXHAUST;
        row[BRISTLE] = 0.0;
        let stored = [axis_state.stored_air_a_j, axis_state.stored_air_b_j];
        let flow = [axis_state.flow_a_m3_per_s, axis_state.flow_b_m3_per_s];
        for chamber in 0..2 {
            row[P[chamber]] = stored[chamber] / system.volume(axis, chamber, axis_state.extension_m);
            row[GAS_MASS[chamber]] = stored[chamber] / (GAS * T_WALL);
            row[Q[chamber]] = flow[chamber];
        }
        let position = [axis_state.extension_m, STROKE - axis_state.extension_m][axis];
        (row[SHOWN[0]], row[SHOWN[1]], row[SHOWN[2]]) = (position, row[P[0]], row[P[1]]);
    }
    y[P_NODE] = start.supply_pressure_pa;
    y
}

/// Position, force, pressures of an axis by rig-model.md.
fn truths(system: &System<'_>, axis: usize, y: &Y) -> [f64; 4] {
    let axis_state = &y[AXIS * axis..AXIS * (axis + 1)];
    let contact = system.contact(y);
    let behind = CARRIAGE + system.added_mass;
    let force = [behind * system.acceleration(0, y) - contact, -contact][axis];
    [[axis_state[X], STROKE - axis_state[X]][axis], force, axis_state[P[0]], axis_state[P[1]]]
}

fn sample<'y>(system: &System<'_>, axis: usize, t: f64, at: impl Fn(f64) -> &'y Y) -> AxisSample {
    let (y, n) = (at(t), &system.numbers.axes[axis]);
    let axis_state = &y[AXIS * axis..AXIS * (axis + 1)];
    let truth = truths(system, axis, y);
    let lagged = [axis_state[SHOWN[0]], truth[1], axis_state[SHOWN[1]], axis_state[SHOWN[2]]];
    let shown = [0, 1, 2, 3].map(|i: usize| {
        let lag = if n.lag[i] > 0.0 { lagged[i] - truth[i] } else { 0.0 };
        let old = truths(system, axis, at((t - n.skew[i]).max(0.0)))[i];
        truth[i] + lag + n.gain[i] * truth[i] + n.offset[i] + (old - truth[i])
    });
    AxisSample {
        velocity: axis_state[V],
        spool: axis_state[SPOOL],
        truth,
        shown,
        silencer: axis_state[P_SILENCER],
        bristles: -system.bristles(axis, axis_state)[0],
        node: y[P_NODE],
    }
}
