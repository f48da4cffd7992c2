//! A rig driven through an experiment of the menu in closed loop, by the rehearsal of the controller.
//!
//! ```text
//!   experiment ──► controllers with the baseline's numbers ──► rehearsal of the explanation's rig ──► commands, true points
//! ```
//!
//! The run is the experiment if the explanation were true, closed loop and sensor noise included.

use super::menu::{Entry, program};
use crate::gridded_record::{AxisState, CHANNELS};
use axis_control::axis::AxisRecord;
use axis_control::setup::{InputError, Inputs as Files, Mode};
use plant::{Axis, Inputs, RigParameters, Scene, SceneError, SetupError, State, Truth};
use protocol::frames::MainChainState;
use rehearsal::{Rehearsal, RehearsalParts};

/// Longest run, periods.
const LONGEST: usize = 30_000;
/// Range of a rod that rests, m.
const PARKED_M: f64 = 1e-3;
/// Nearest to an end of the stroke, m: the menu keeps 5 mm with the baseline, a sensor may be off by 2.
const NEAR_M: f64 = 2e-3;
/// Seed of the sensor noise in the loop where one run stands for all.
pub const SEED: u64 = 1;
/// Loose criteria of standstill, so that an effect does not keep the experiment from starting.
const UNSETTLED: [&str; 6] = [
    "drive.settled.still_m=0.1",
    "drive.settled.position_error_m=0.5",
    "drive.settled.force_error_n=2000",
    "load.settled.still_m=0.1",
    "load.settled.position_error_m=0.5",
    "load.settled.force_error_n=2000",
];

/// Why an experiment cannot be rehearsed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum ClosedLoopError {
    #[error(transparent)]
    Files(#[from] InputError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Setup(#[from] SetupError),
}

/// A rehearsed run, period by period of 1 ms.
#[derive(Clone, Debug)]
pub struct ClosedLoopRun {
    pub(crate) linked: bool,
    /// Weights on the carriage, kg.
    pub(crate) added_mass_kg: f64,
    /// True state of the plant at the start of the first period.
    pub start: State,
    /// Valve commands of each period, -1 to 1.
    pub inputs: Vec<Inputs>,
    /// True mechanical state and pressures at the start of each period.
    pub points: Vec<[AxisState; 2]>,
    /// Readings without noise at the start of each period: position, force, pressures a and b, the load's offset taken off.
    pub(crate) readings: Vec<[[f64; CHANNELS]; 2]>,
    /// Period in which the experiment began, behind the initial positioning; `None` when it never did.
    pub began: Option<usize>,
    pub(crate) done: bool,
}

impl ClosedLoopRun {
    /// Whether the experiment suits this rig: it begins, it ends, and no moved rod comes near an end of its stroke.
    pub fn ends_well(&self, stroke_m: f64) -> bool {
        self.done && self.clearance_m(stroke_m).is_some_and(|clearance_m| clearance_m > NEAR_M)
    }

    /// Least distance of a moved rod from the ends of its stroke, m; `None` when the experiment never began.
    pub(crate) fn clearance_m(&self, stroke_m: f64) -> Option<f64> {
        let began = self.began?;
        let of_axis = |axis: usize| {
            let of = |point: &[AxisState; 2]| point[axis].extension_m;
            let least = self.points[began..].iter().map(of).fold(f64::INFINITY, f64::min);
            let most = self.points[began..].iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            if most - least < PARKED_M { f64::INFINITY } else { least.min(stroke_m - most) }
        };
        Some(of_axis(0).min(of_axis(1)))
    }
}

/// Drives `rig` through an experiment; the controllers have the baseline's numbers, and `seed` gives the sensors' noise.
///
/// # Errors
/// [`ClosedLoopError`]
pub fn drive(
    entry: &Entry,
    baseline: &RigParameters,
    rig: &RigParameters,
    seed: u64,
) -> Result<ClosedLoopRun, ClosedLoopError> {
    let file = format!("{}.toml", entry.name);
    let nominal = baseline.without_effects();
    let files = Files::of_texts(&nominal, (&file, entry.toml), program, &UNSETTLED)?;
    let scene = Scene::from_toml(entry.toml, &file, &nominal)?;
    let mode = Mode { partner_needed: true, real_time: false, forever: false };
    let controllers =
        Axis::ALL.into_iter().map(|axis| files.controller(axis, mode)).collect::<Result<_, _>>()?;
    let mut rehearsal = Rehearsal::new(RehearsalParts { rig, scene: &scene, seed, controllers })?;
    let start = *rehearsal.plant().state();
    let (mut inputs, mut points, mut readings, mut began) = (Vec::new(), Vec::new(), Vec::new(), None);
    let stroke_m = rig.cylinder().stroke_m;
    while inputs.len() < LONGEST && !rehearsal.ended() {
        let plant = rehearsal.plant();
        readings.push(plant.noise_free_readings(&plant.truth(&Inputs::default())));
        let rehearsed = rehearsal.step(|_, _| {});
        let in_experiment = |record: &AxisRecord| record.main == MainChainState::Experiment;
        if began.is_none() && rehearsed.axes.iter().flatten().any(in_experiment) {
            began = Some(inputs.len());
        }
        let cycle = rehearsed.cycle;
        inputs.push(Inputs { valve: cycle.valve, ..Inputs::default() });
        points.push(points_of(&cycle.truth, stroke_m));
    }
    let done = rehearsal.node().done();
    let (linked, added_mass_kg) = (scene.linked, scene.added_mass_kg);
    Ok(ClosedLoopRun { linked, added_mass_kg, start, inputs, points, readings, began, done })
}

fn points_of(truth: &Truth, stroke_m: f64) -> [AxisState; 2] {
    std::array::from_fn(|i| {
        let axis = &truth.axes[i];
        let extension_m = if i == 0 { axis.position_m } else { stroke_m - axis.position_m };
        AxisState {
            extension_m: extension_m.clamp(0.0, stroke_m),
            rod_velocity_m_per_s: axis.rod_velocity_m_per_s,
            alternative_velocity_m_per_s: None,
            pressures_pa: [axis.pressure_a_pa, axis.pressure_b_pa],
        }
    })
}
