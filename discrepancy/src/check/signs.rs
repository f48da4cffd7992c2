//! Swapped pressures and wrong signs, by balances that hold whatever effect is missing.
//!
//! ```text
//!   flow balance     d(p V)/dt / p_N  against  q(u, p)                            valve  - pressures
//!   force balance    p_a A_a - p_b A_b  against  m a + b v + F sign(v) [+ F_s]    pressures - position
//!   force sensor     F_s  against  m_carriage a, linked against p_a A_a - p_b A_b
//! ```
//!
//! Each balance is tested by the sign of a correlation, which gains, offsets, lags and the effects of the catalogue do not
//! change. A swap inverts both of the first two, the sign of the valve the flows, the sign of the position the forces. A change
//! is reported when the balances hold with it and not without it. A record without motion has no finding.
//!
//! Source: rig-model.md, One axis, and Masses and linkage; effects.md, Which pairs look alike, r_a and r_F.

use super::grid::Grid;
use super::notes::Notes;
use model_fit::stats::{means, slopes};
use plant::{Axis, RigParameters, StaticValve};
use records::{Channel, Signal};

/// Places to each side of a mean, and of a slope: 15 ms together keep noise down and edges in.
const REACH: usize = 7;
/// Speed above which friction has the sign of the motion, m/s.
const MOVING_M_PER_S: f64 = 0.01;
/// Fewest samples.
const FEWEST: usize = 300;
/// Least gain in the sum of two correlations.
const CLEARLY: f64 = 0.6;
/// Correlation from which a balance holds.
const HOLDS: f64 = 0.4;
/// Least standard deviation of the expected force, in specified noise, for a test of the sensor's sign.
const FORCE_SHOWS: f64 = 4.0;
/// Units of force, N each.
const FORCES: [(&str, f64); 4] = [("kN", 1e3), ("mN", 1e-3), ("kgf", 9.80665), ("lbf", 4.448_222)];

/// A reading of an axis' columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ColumnReading {
    AsIs,
    Swapped,
    ValveSign,
    PositionSign,
}

/// Smooth series of an axis, along its extension.
struct Motion {
    opening: Vec<Option<f64>>,
    extension_m: Vec<Option<f64>>,
    pressures_pa: [Vec<Option<f64>>; 2],
    force_n: Vec<Option<f64>>,
}

pub(super) fn check(notes: &mut Notes, rig: &RigParameters, grid: &Grid) {
    // Slopes over a few places mean nothing at another period.
    if !(0.5e-3..=2.5e-3).contains(&grid.period_s) {
        return;
    }
    for axis in Axis::ALL {
        let needed = [Signal::Valve, Signal::Position, Signal::PressureA, Signal::PressureB];
        if needed.into_iter().all(|signal| notes.record.channel(Channel::Of(axis, signal)).is_some()) {
            axis_signs(notes, rig, grid, axis);
        }
    }
}

fn axis_signs(notes: &mut Notes, rig: &RigParameters, grid: &Grid, axis: Axis) {
    let fits = |reading| {
        let motion = motion(notes, rig, grid, axis, reading);
        let (flow, forces) = (flows(&motion, rig, grid.period_s), forces(&motion, rig, axis, grid.period_s));
        (motion, flow, forces)
    };
    let (as_is, flow, force) = fits(ColumnReading::AsIs);
    let (Some(flow), Some(force)) = (flow, force) else { return };
    let unswapped = flow.correlation() + force.correlation();
    let best = [ColumnReading::Swapped, ColumnReading::ValveSign, ColumnReading::PositionSign]
        .into_iter()
        .filter_map(|reading| {
            let (_, flow, force) = fits(reading);
            let (flow, force) = (flow?.correlation(), force?.correlation());
            (flow > HOLDS && force > HOLDS).then_some((reading, flow + force))
        })
        .max_by(|one, other| one.1.total_cmp(&other.1));
    let worse = flow.correlation().min(force.correlation()) < HOLDS;
    if let Some((reading, sum)) = best
        && worse
        && sum > unswapped + CLEARLY
    {
        let row = flow.worst.or(force.worst).and_then(|place| grid.rows[place]);
        return add_finding(notes, axis, reading, row, [flow.correlation(), force.correlation()]);
    }
    force_sign(notes, rig, grid, axis, &as_is);
}

fn add_finding(
    notes: &mut Notes,
    axis: Axis,
    reading: ColumnReading,
    row: Option<usize>,
    balances: [f64; 2],
) {
    let (kind, signal, text) = match reading {
        ColumnReading::Swapped => (
            "swapped-pressures",
            Signal::PressureA,
            "pressures a and b are swapped: change the two columns (or the two hoses)",
        ),
        ColumnReading::ValveSign => {
            ("valve-sign", Signal::Valve, "the command has the wrong sign: positive extends the rod")
        }
        _ => (
            "position-sign",
            Signal::Position,
            "the position counts the wrong way: it grows as the drive's rod extends",
        ),
    };
    let text = format!(
        "{text}; flow and force balance correlate by {:.2} and {:.2} as the columns stand, and hold when that is changed",
        balances[0], balances[1]
    );
    notes.add(kind, Channel::Of(axis, signal), row, true, &text);
}

fn motion(notes: &Notes, rig: &RigParameters, grid: &Grid, axis: Axis, reading: ColumnReading) -> Motion {
    let series = |signal| grid.series(notes, Channel::Of(axis, signal));
    let stroke = rig.cylinder().stroke_m;
    let sign = if reading == ColumnReading::ValveSign { -1.0 } else { 1.0 };
    let opening = hold_last(&series(Signal::Valve), sign);
    let mut position = series(Signal::Position);
    if reading == ColumnReading::PositionSign {
        let negative = position.iter().flatten().filter(|value| **value < 0.0).count() * 2 > position.len();
        let whole = if negative { 0.0 } else { stroke };
        position.iter_mut().flatten().for_each(|value| *value = whole - *value);
    }
    if axis == Axis::Load {
        let offset = rig.sensors().load_position_offset_m;
        position.iter_mut().flatten().for_each(|value| *value = stroke - (*value - offset));
    }
    let mut pressures_pa = [series(Signal::PressureA), series(Signal::PressureB)];
    if reading == ColumnReading::Swapped {
        pressures_pa.swap(0, 1);
    }
    let force_n = means(&series(Signal::Force), REACH);
    let extension_m = means(&position, REACH);
    let pressures_pa = pressures_pa.map(|pressure| means(&pressure, REACH));
    Motion { opening, extension_m, pressures_pa, force_n }
}

/// The command, its last value held where samples are missing.
fn hold_last(values: &[Option<f64>], sign: f64) -> Vec<Option<f64>> {
    let mut last = None;
    values
        .iter()
        .map(|value| {
            last = value.map(|value| sign * value).or(last);
            last
        })
        .collect()
}

/// Sums of a correlation, and the place that speaks against it most.
#[derive(Debug)]
struct Pairs {
    products: [f64; 3],
    worst: Option<usize>,
}

impl Pairs {
    /// Pairs with their places; `None` when there are too few of them, or they do not change.
    fn of(pairs: &[(usize, f64, f64)]) -> Option<Pairs> {
        if pairs.len() < FEWEST {
            return None;
        }
        let count = pairs.len() as f64;
        let mean = |of: fn(&(usize, f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        let (mean_x, mean_y) = (mean(|pair| pair.1), mean(|pair| pair.2));
        let mut products = [0.0; 3];
        let mut worst = (0.0, None);
        for (place, x, y) in pairs {
            let (x, y) = (x - mean_x, y - mean_y);
            products = [products[0] + x * x, products[1] + y * y, products[2] + x * y];
            if x * y < worst.0 {
                worst = (x * y, Some(*place));
            }
        }
        (products[0] > 0.0 && products[1] > 0.0).then_some(Pairs { products, worst: worst.1 })
    }

    fn correlation(&self) -> f64 {
        self.products[2] / (self.products[0] * self.products[1]).sqrt()
    }

    /// How much of y comes with one of x.
    fn slope(&self) -> f64 {
        self.products[2] / self.products[0]
    }
}

/// Flow balance of both chambers: what the valve should pass against what the chambers take.
fn flows(motion: &Motion, rig: &RigParameters, period_s: f64) -> Option<Pairs> {
    let (cylinder, through) = (rig.cylinder(), StaticValve::new(rig));
    let mut pairs = Vec::new();
    for chamber in 0..2 {
        let contents: Vec<Option<f64>> = (motion.extension_m.iter().zip(&motion.pressures_pa[chamber]))
            .map(|(x, p)| {
                let x = (*x)?.clamp(0.0, cylinder.stroke_m);
                let swept = [cylinder.piston_area_m2 * x, cylinder.annulus_area_m2 * (cylinder.stroke_m - x)];
                Some((*p)? * (cylinder.dead_volume_m3 + swept[chamber]))
            })
            .collect();
        let taken = slopes(&contents, REACH);
        let (mut spool, mut lagged) = (0.0, 0.0);
        let passed: Vec<Option<f64>> = (motion.opening.iter().zip(&motion.pressures_pa[chamber]))
            .map(|(opening, p)| {
                let valve = rig.valve();
                let toward = |time_constant_s: f64| 1.0 - (-period_s / time_constant_s).exp();
                spool += toward(valve.spool_time_constant_s) * ((*opening)? - spool);
                let opening = if chamber == 0 { spool } else { -spool };
                let flow_m3_per_s = through.flow_m3_per_s(opening, (*p)?.max(0.0));
                lagged += toward(valve.flow_lag_time_constant_s) * (flow_m3_per_s - lagged);
                Some(lagged)
            })
            .collect();
        let passed = means(&passed, REACH);
        for (place, (passed, taken)) in passed.iter().zip(&taken).enumerate() {
            if let (Some(passed), Some(taken)) = (passed, taken) {
                pairs.push((place, *passed, taken / period_s / rig.gas().normal_pressure_pa));
            }
        }
    }
    Pairs::of(&pairs)
}

/// Force of the gas, N, without its constant part.
fn gas_n(motion: &Motion, rig: &RigParameters, place: usize) -> Option<f64> {
    let cylinder = rig.cylinder();
    let [a, b] = [motion.pressures_pa[0][place]?, motion.pressures_pa[1][place]?];
    Some(a * cylinder.piston_area_m2 - b * cylinder.annulus_area_m2)
}

/// Friction of a moving rod, N; none below the speed from which its sign is known.
fn friction_n(rig: &RigParameters, speed_m_per_s: f64) -> f64 {
    let friction = rig.friction();
    let sliding = if speed_m_per_s.abs() > MOVING_M_PER_S {
        friction.sliding_force_n * speed_m_per_s.signum()
    } else {
        0.0
    };
    friction.viscous_n_s_per_m * speed_m_per_s + sliding
}

/// Force balance while the rod moves: inertia and friction against the gas, the force sensor's part taken off both.
fn forces(motion: &Motion, rig: &RigParameters, axis: Axis, period_s: f64) -> Option<Pairs> {
    let mass = rig.mass();
    let moved_kg = if axis == Axis::Drive { mass.drive_kg } else { mass.load_kg };
    let speeds = slopes(&motion.extension_m, REACH);
    let rates = slopes(&speeds, REACH);
    let mut rows = Vec::new();
    for place in 0..speeds.len() {
        let (Some(speed), Some(rate), Some(gas)) = (speeds[place], rates[place], gas_n(motion, rig, place))
        else {
            continue;
        };
        let speed = speed / period_s;
        if speed.abs() > MOVING_M_PER_S {
            let needed = moved_kg * rate / (period_s * period_s) + friction_n(rig, speed);
            rows.push((place, needed, gas, motion.force_n[place].unwrap_or(0.0)));
        }
    }
    let sensor: Vec<_> = rows.iter().map(|row| (row.0, row.3, row.2)).collect();
    let of_needed: Vec<_> = rows.iter().map(|row| (row.0, row.3, row.1)).collect();
    let slopes = [&of_needed, &sensor].map(|pairs| Pairs::of(pairs).map_or(0.0, |pairs| pairs.slope()));
    let residuals: Vec<_> = rows
        .iter()
        .map(|(place, needed, gas, force)| (*place, needed - slopes[0] * force, gas - slopes[1] * force))
        .collect();
    Pairs::of(&residuals)
}

/// Sign and unit of the force sensor.
fn force_sign(notes: &mut Notes, rig: &RigParameters, grid: &Grid, axis: Axis, motion: &Motion) {
    let linked = notes.record.setup.linked;
    let mass = rig.mass();
    // The unlinked load passes nothing to anybody: its sensor shows its noise.
    if axis == Axis::Load && !linked {
        return;
    }
    let moved_kg = mass.carriage_kg + notes.record.setup.added_mass_kg;
    // What lies before the sensor: piston and rod, with all of the axis' friction.
    let moving_kg = if axis == Axis::Drive { mass.drive_kg - mass.carriage_kg } else { mass.load_kg };
    let speeds = slopes(&motion.extension_m, REACH);
    let rates = slopes(&speeds, REACH);
    // Twice the smoothing for the force, as for the acceleration.
    let force = means(&means(&motion.force_n, REACH), REACH);
    let pairs: Vec<(usize, f64, f64)> = (0..force.len())
        .filter_map(|place| {
            let expected = if linked {
                let (speed, acceleration) =
                    (speeds[place]? / grid.period_s, rates[place]? / (grid.period_s * grid.period_s));
                gas_n(motion, rig, place)? - moving_kg * acceleration - friction_n(rig, speed)
            } else {
                moved_kg * rates[place]? / (grid.period_s * grid.period_s)
            };
            Some((place, expected, force[place]?))
        })
        .collect();
    let Some(pairs) = Pairs::of(&pairs) else { return };
    let expected_std_n = (pairs.products[0] / force.len() as f64).sqrt();
    if expected_std_n < FORCE_SHOWS * rig.sensors().force_noise_n || pairs.correlation().abs() < HOLDS {
        return;
    }
    let channel = Channel::Of(axis, Signal::Force);
    let row = pairs.worst.and_then(|place| grid.rows[place]);
    let by = if linked { "the pressures" } else { "the acceleration" };
    if pairs.correlation() < 0.0 {
        let text = format!(
            "the force has the wrong sign, it correlates by {:.2} with what {by} would have it be: compression is positive; \
             multiply the column by -1",
            pairs.correlation()
        );
        return notes.add("force-sign", channel, row, true, &text);
    }
    let conversion = FORCES.into_iter().find(|(_, factor)| (0.8..1.25).contains(&(pairs.slope() * factor)));
    if let Some((unit, factor)) = conversion.filter(|_| !linked) {
        let text = format!(
            "a share of {:.4} of what {by} would have it be: it reads as {unit}: multiply the column by {factor}",
            pairs.slope()
        );
        notes.add("wrong-unit", channel, row, true, &text);
    }
}
