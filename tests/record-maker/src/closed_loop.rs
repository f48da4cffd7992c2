//! The rig of a recipe under the real controllers, and the record of the run.

use super::axis::{AIR, FLOW, NORMAL, SPOOL, V, X};
use super::noise::Stream;
use super::numbers::Numbers;
use super::rig::{Derivatives, Rig, STEPS_PER_MS, State};
use super::sensing::Sensing;
use super::{Experiment, MakeError, ROWS, Recipe, Record, Row, TrueAxis, hidden};
use axis_control::axis::AxisController;
use axis_control::setup::FileArguments;
use axis_control::setup::{Inputs, Mode};
use plant::scene::{Outcome, RigCall, StopHolder};
use plant::{Axis, AxisReadings, RigParameters, Scene};
use rehearsal::Rehearsal;
use rig_node::{RigCondition, SimulatedRig};
use std::path::{Path, PathBuf};

/// Rms and largest error of a sampling instant, s.
const JITTER_S: f64 = 1e-4;
const MOST_JITTER_S: f64 = 4e-4;
/// Limits of standstill and error wide enough for the experiment to begin right after the initial positioning, whatever the
/// hidden effect: all records of an experiment then have the same timing.
const EARLY_START: [&str; 3] = ["still_m=0.1", "position_error_m=0.5", "force_error_n=2000"];
/// Longest run of a proposed experiment, rows of 1 ms: six repetitions of half a minute.
const MOST_ROWS: usize = 180_000;
/// Stream of random numbers; streams 0 to 7 are those of the sensors.
const JITTER_STREAM: u64 = 8;

/// Simulates a record: the recipe's rig under the controllers of its experiment, [`ROWS`] rows.
///
/// `rig` holds the numbers that the controllers and the reader of the record assume; effects in it are ignored.
///
/// # Errors
/// [`MakeError`] when the recipe is not valid, or the run fails.
pub fn simulate(recipe: &Recipe, rig: &RigParameters) -> Result<Record, MakeError> {
    run(recipe, rig, [ROWS, STEPS_PER_MS])
}

/// The first `rows` of a record, simulated with `steps_per_ms`.
pub(super) fn run(
    recipe: &Recipe,
    rig: &RigParameters,
    [rows, steps_per_ms]: [usize; 2],
) -> Result<Record, MakeError> {
    let (inputs, scene) = read(recipe, rig)?;
    let made = RecordedRig::new(recipe, rig, &scene, steps_per_ms)?;
    let mut rehearsal = Rehearsal::with_rig(made, controllers(&inputs)?);
    let mut record = record(recipe, &scene, rows);
    for _ in 0..rows {
        record.rows.push(next_row(&mut rehearsal)?);
    }
    Ok(record)
}

/// Simulates a record of a proposed experiment, given as the name and text of its file, from start to end.
///
/// Both axes move as the experiment says, linked or not. The recipe's axes are recorded, and both where the rods are linked,
/// since one axis alone does not determine the motion. The experiment of the recipe is ignored.
///
/// # Errors
/// [`MakeError`] when recipe or experiment are not valid, or the run does not reach its end.
pub fn simulate_proposed(
    recipe: &Recipe,
    rig: &RigParameters,
    (file, toml): (&str, &str),
) -> Result<Record, MakeError> {
    let nominal = rig.without_effects();
    let experiment = Inputs::of_texts(&nominal, (file, toml), program, &[])?.experiment;
    let driven = [experiment.drive.is_some(), experiment.load.is_some()];
    let set = early_start(Axis::ALL.into_iter().filter(|axis| driven[axis.index()]));
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let inputs = Inputs::of_texts(&nominal, (file, toml), program, &set)?;
    let scene = scene(toml, file, rig)?;
    let moved = Recipe { both_axes: true, unlinked: false, ..recipe.clone() };
    let made = RecordedRig::new(&moved, rig, &scene, STEPS_PER_MS)?;
    let mut rehearsal = Rehearsal::with_rig(made, controllers(&inputs)?);
    let recorded = Recipe { both_axes: recipe.both_axes || scene.linked, ..recipe.clone() };
    let mut record = record(&recorded, &scene, ROWS);
    while !rehearsal.ended() && record.rows.len() < MOST_ROWS {
        record.rows.push(next_row(&mut rehearsal)?);
    }
    if rehearsal.node().done() {
        Ok(record)
    } else {
        Err(MakeError::Unfinished { file: file.to_owned(), length_s: record.rows.len() as f64 / 1000.0 })
    }
}

fn controllers(inputs: &Inputs) -> Result<Vec<AxisController>, MakeError> {
    let mode = Mode { partner_needed: true, real_time: false, forever: false };
    Ok(Axis::ALL.into_iter().map(|axis| inputs.controller(axis, mode)).collect::<Result<_, _>>()?)
}

fn next_row(rehearsal: &mut Rehearsal<RecordedRig>) -> Result<Row, MakeError> {
    let row = rehearsal.step(|_, _| {}).cycle;
    if rehearsal.rig().stopped {
        return Err(MakeError::Stopped { at_s: row.time_s });
    }
    check(&row)?;
    Ok(row)
}

/// Simulates the recipe's rig under given valve commands of drive and load, one pair for each row: the record of other hidden
/// effects under the same inputs. The valve of a resting axis stays closed.
///
/// # Errors
/// [`MakeError`] when the recipe is not valid, or a state is not finite.
pub fn replay(recipe: &Recipe, rig: &RigParameters, valves: &[[f64; 2]]) -> Result<Record, MakeError> {
    replay_with(recipe, rig, valves, STEPS_PER_MS)
}

/// [`replay`] with another number of steps in a millisecond.
pub(super) fn replay_with(
    recipe: &Recipe,
    rig: &RigParameters,
    valves: &[[f64; 2]],
    steps_per_ms: usize,
) -> Result<Record, MakeError> {
    let (_, scene) = read(recipe, rig)?;
    let mut made = RecordedRig::new(recipe, rig, &scene, steps_per_ms)?;
    let mut record = record(recipe, &scene, valves.len());
    for (cycle, valve) in valves.iter().enumerate() {
        let valve = [0, 1].map(|i| if made.rig.active[i] { valve[i] } else { 0.0 });
        made.expect_valves(valve);
        made.sample(cycle as u64, &mut |_| {});
        let row = made.step(cycle as u64, valve);
        check(&row)?;
        record.rows.push(row);
    }
    Ok(record)
}

/// Replays the commands of a null record with another number of steps in a millisecond, in windows of so many rows; each window
/// starts from the true state.
pub(super) fn replay_windows(
    record: &Record,
    rig: &RigParameters,
    [window, steps_per_ms]: [usize; 2],
) -> Result<Vec<Row>, MakeError> {
    let (_, scene) = read(&record.recipe, rig)?;
    let mut made = RecordedRig::new(&record.recipe, rig, &scene, steps_per_ms)?;
    let mut rows = Vec::with_capacity(record.rows.len());
    for (cycle, row) in record.rows.iter().enumerate() {
        if cycle % window == 0 {
            made.rig.set(&mut made.state, &row.axes);
        }
        made.expect_valves(row.valve);
        made.sample(cycle as u64, &mut |_| {});
        rows.push(made.step(cycle as u64, row.valve));
    }
    Ok(rows)
}

fn record(recipe: &Recipe, scene: &Scene, rows: usize) -> Record {
    let (linked, added_mass_kg) = (scene.linked, scene.added_mass_kg);
    Record { recipe: recipe.clone(), linked, added_mass_kg, rows: Vec::with_capacity(rows) }
}

fn check(row: &Row) -> Result<(), MakeError> {
    for (axis, name) in row.axes.iter().zip(Axis::ALL.map(Axis::name)) {
        let [a, b] = axis.pressure_pa;
        let finite = axis.extension_m.is_finite() && axis.rod_velocity_m_per_s.is_finite();
        if !(finite && a > 0.0 && b > 0.0 && a.is_finite() && b.is_finite() && axis.spool.is_finite()) {
            return Err(MakeError::NoState { axis: name, at_s: row.time_s });
        }
    }
    Ok(())
}

/// The checkout with the experiments and programs.
fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("two folders below the checkout")
}

/// The file of an experiment of `axes`: drive, load, or linked.
fn experiment_file(recipe: &Recipe, axes: &str) -> Result<PathBuf, MakeError> {
    let name = match recipe.experiment {
        Experiment::Train => "train",
        Experiment::HeldOut(0) => "point-to-point",
        Experiment::HeldOut(1) => "random-steps",
        Experiment::HeldOut(number) => return Err(MakeError::Experiment { number }),
    };
    Ok(workspace().join(format!("tests/experiments-study/{name}-{axes}.toml")))
}

fn read(recipe: &Recipe, rig: &RigParameters) -> Result<(Inputs, Scene), MakeError> {
    let moved = Axis::ALL.into_iter().filter(|axis| recipe.both_axes || *axis == recipe.axis);
    let set = early_start(moved);
    if recipe.both_axes && recipe.unlinked {
        return read_apart(recipe, rig, &set);
    }
    let experiment = experiment_file(recipe, if recipe.both_axes { "linked" } else { recipe.axis.name() })?;
    let file = experiment.display().to_string();
    let files = FileArguments {
        rig: workspace().join("plant/rig.toml"),
        experiment,
        programs: Some(workspace().join("controller/programs")),
        set,
        ..FileArguments::default()
    };
    let mut inputs = Inputs::read(&files)?;
    inputs.rig = rig.without_effects();
    let scene = scene(&inputs.experiment_toml, &file, rig)?;
    Ok((inputs, scene))
}

/// Both axes, each under its experiment, at the same time.
fn read_apart(recipe: &Recipe, rig: &RigParameters, set: &[String]) -> Result<(Inputs, Scene), MakeError> {
    let [drive, load] = Axis::ALL.map(|axis| experiment_file(recipe, axis.name()));
    let (drive, load) = (drive?, load?);
    let [drive_toml, load_toml] = [&drive, &load].map(|file| {
        std::fs::read_to_string(file)
            .map_err(|error| MakeError::File { path: file.display().to_string(), error })
    });
    let load_toml = load_toml?;
    let section = load_toml.find("[load]").expect("an experiment of the load has its section");
    let toml = format!("{}\n{}", drive_toml?, &load_toml[section..]);
    let file = drive.display().to_string();
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let inputs = Inputs::of_texts(&rig.without_effects(), (&file, &toml), program, &set)?;
    let scene = scene(&toml, &file, rig)?;
    Ok((inputs, scene))
}

/// The text of a shipped program.
fn program(name: &str) -> Option<String> {
    std::fs::read_to_string(workspace().join(format!("controller/programs/{name}.toml"))).ok()
}

fn early_start(axes: impl Iterator<Item = Axis>) -> Vec<String> {
    axes.flat_map(|axis| EARLY_START.map(|what| format!("{}.settled.{what}", axis.name()))).collect()
}

fn scene(experiment_toml: &str, file: &str, rig: &RigParameters) -> Result<Scene, MakeError> {
    let scene = Scene::from_toml(experiment_toml, file, rig)?;
    if scene.hand.is_empty() && scene.event.is_empty() {
        Ok(scene)
    } else {
        Err(MakeError::People { file: file.to_owned() })
    }
}

pub(super) struct RecordedRig {
    pub(super) rig: Rig,
    pub(super) state: State,
    pub(super) sensing: [Sensing; 2],
    jitter: Option<Stream>,
    linked: bool,
    /// Valve openings of the cycle that is sampled.
    expected: [f64; 2],
    row: Option<Row>,
    stopped: bool,
}

impl RecordedRig {
    pub(super) fn new(
        recipe: &Recipe,
        rig: &RigParameters,
        scene: &Scene,
        steps_per_ms: usize,
    ) -> Result<Self, MakeError> {
        let background = recipe.background.as_ref();
        let numbers = Numbers::new(rig, scene.added_mass_kg, &recipe.wrong_parameters, background)?;
        let stroke_m = numbers.stroke_m;
        let (mut made, laws) = hidden::rig(recipe, numbers, steps_per_ms)?;
        // Both axes may move without being linked.
        made.coupling = made.coupling.filter(|_| scene.linked);
        let slow_noise_ratio = background.map(|background| background.slow_noise_ratio);
        let noise = (recipe.noise, recipe.coloured_noise, slow_noise_ratio);
        let mut sensing = [0, 1].map(|axis| {
            let streams = |channel| Stream::new(recipe.seed, (4 * axis + channel) as u64);
            Sensing::new(laws[axis].clone(), rig.sensors(), axis, made.step_s(), streams, noise)
        });
        let carriage_m = scene.carriage_position_m;
        let load_m = if scene.linked { stroke_m - carriage_m } else { 0.0 };
        let mut extension_m = [carriage_m, load_m];
        for (extension_m, axis) in extension_m.iter_mut().zip(&made.axes) {
            *extension_m = axis.motion.beside_the_stops(*extension_m);
        }
        let state = made.start(extension_m);
        for (i, sensing) in sensing.iter_mut().enumerate().filter(|(i, _)| !made.active[*i]) {
            // A resting axis is sampled once.
            let mut derivatives = Derivatives::default();
            derivatives.air[i] = made.axes[i].air(&state.y[i], state.supply_pa);
            sensing.store(made.sensed(&state, &derivatives, i));
        }
        Ok(RecordedRig {
            rig: made,
            state,
            sensing,
            jitter: recipe.jitter.then(|| Stream::new(recipe.seed, JITTER_STREAM)),
            linked: scene.linked,
            expected: [0.0; 2],
            row: None,
            stopped: false,
        })
    }
}

/// True states at the start of a period.
fn truth(rig: &Rig, state: &State, derivatives: &Derivatives) -> [TrueAxis; 2] {
    [0, 1].map(|i| {
        let (axis, y) = (&rig.axes[i], &state.y[i]);
        let air = if rig.active[i] { derivatives.air[i] } else { axis.air(y, state.supply_pa) };
        let temperature = |chamber: usize| {
            let nominal_k = axis.numbers.temperature_k;
            let exchanges_heat = axis.laws.heat_w_per_m2_k.is_some();
            if exchanges_heat { nominal_k * y[AIR + chamber] / y[NORMAL + chamber] } else { nominal_k }
        };
        TrueAxis {
            extension_m: y[X],
            rod_velocity_m_per_s: y[V],
            rod_acceleration_m_per_s2: derivatives.rates[i][V],
            spool: y[SPOOL],
            pressure_pa: air.pressure_pa,
            stored_air_j: [y[AIR], y[AIR + 1]],
            temperature_k: [temperature(0), temperature(1)],
            flow_m3_per_s: [y[FLOW], y[FLOW + 1]],
            edge_flow_m3_per_s: air.edge_flow,
            exhaust_pressure_pa: air.exhaust_pa,
            pneumatic_force_n: air.force_n,
            friction_n: derivatives.friction_n[i],
        }
    })
}

impl SimulatedRig for RecordedRig {
    type Cycle = Row;
    type Event = Outcome;

    fn expect_valves(&mut self, valve: [f64; 2]) {
        self.expected = valve;
    }

    fn sample(&mut self, cycle: u64, _tell: &mut dyn FnMut(Outcome)) -> [AxisReadings; 2] {
        let acting = self.expected;
        let at = cycle as usize * self.rig.steps_per_ms;
        let time_s = cycle as f64 / 1000.0;
        let (rig, sensing) = (&self.rig, &mut self.sensing);
        let mut start = None;
        rig.advance(&mut self.state, acting, sensing, |state, derivatives| {
            start = Some((truth(rig, state, derivatives), state.supply_pa, derivatives.contact_n));
        });
        let (axes, supply_pressure_pa, contact_force_n) = start.expect("a period has a first step");
        let jitter_s = self
            .jitter
            .as_mut()
            .map_or(0.0, |jitter| (JITTER_S * jitter.normal()).clamp(-MOST_JITTER_S, MOST_JITTER_S));
        let without_noise = [0, 1].map(|i| sensing[i].without_noise(at, 0.0, time_s));
        let readings = [0, 1].map(|i| {
            let values = sensing[i].without_noise(at, jitter_s, time_s);
            sensing[i].read(values)
        });
        let row =
            Row { time_s, valve: acting, readings, without_noise, axes, supply_pressure_pa, contact_force_n };
        self.row = Some(row);
        readings
    }

    fn rig_call(&mut self, _cycle: u64) -> Option<RigCall> {
        None
    }

    /// The record maker has no emergency stop: a trip makes the record fail.
    fn emergency_stop(&mut self, _holder: StopHolder, release: bool) -> Option<Outcome> {
        self.stopped |= !release;
        None
    }

    fn condition(&self) -> RigCondition {
        RigCondition {
            supply_pressure_pa: self.state.supply_pa,
            linked: self.linked,
            emergency_stop: false,
            check_valves_shut: false,
        }
    }

    /// The rig has already moved under the commands when its sensors were sampled.
    fn step(&mut self, _cycle: u64, _valve: [f64; 2]) -> Row {
        self.row.take().expect("sampled before")
    }
}
