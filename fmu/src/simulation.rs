//! The FMU behind its C interface: modes, time, inputs and their effect on the plant. No unsafe code, and no clock.
//!
//! ```text
//!   Instantiated ──enter──► Initialising ──exit──► Stepping ──terminate──► Terminated
//!        ▲                                            │ the state is no longer finite
//!        └───────────────── reset ◄───────────────────┴► Failed
//! ```
//!
//! A step is a whole number of milliseconds, the plant's period. A valve command that is set at t_k is latched at t_k+1 and acts
//! over [t_k+1, t_k+2), as on the bus [bus.md, Time]; hands, emergency stop and linkage act from t_k on, as people do.

mod refusal;

use crate::variables::{self, Causality, Kind, Role, Variable};
use plant::parameters::table::KEYS;
use plant::{AxisReadings, Inputs, PERIOD_S, Plant, RigParameters, Sensors, Setup, SetupError};
use std::collections::BTreeMap;
use std::sync::Arc;

pub(crate) use refusal::Refusal;

/// Largest rounding error of an importer's communication point, s.
const TOLERANCE_S: f64 = 1e-6;
/// Most periods of one step, some 11 days.
const MOST_PERIODS: f64 = 1e9;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Instantiated,
    Initialising,
    Stepping,
    Terminated,
    Failed,
}

#[derive(Clone, Debug)]
struct RunningPlant {
    plant: Plant,
    sensors: Sensors,
    readings: [AxisReadings; 2],
    /// Valve commands in effect.
    acting: [f64; 2],
    /// Periods since the start.
    period: u64,
    /// The linkage was requested and refused, and the warning was given.
    reported: bool,
}

/// Values that an importer may set, except the parameters of the rig.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Settings {
    valve: [f64; 2],
    hand_n: [f64; 2],
    emergency_stop: bool,
    link: bool,
    setup: Setup,
    seed: i32,
}

/// One instance; a clone is a saved state.
#[derive(Clone, Debug)]
pub(crate) struct Simulation {
    variables: Arc<Vec<Variable>>,
    rig: Arc<RigParameters>,
    /// Parameters of the rig that were set, by key, in the units of the rig file.
    numbers: BTreeMap<usize, Vec<f64>>,
    settings: Settings,
    start_s: f64,
    mode: Mode,
    /// `Some` from the initialisation on.
    running: Option<Box<RunningPlant>>,
}

impl Simulation {
    /// An instance of a rig, with all parameters at their start values.
    ///
    /// # Errors
    /// [`SetupError`]: the rig does not allow the default set-up.
    pub(crate) fn new(rig: RigParameters) -> Result<Self, SetupError> {
        let variables = Arc::new(variables::of(&rig)?);
        let settings = Settings { setup: variables::start_setup(&rig), seed: 1, ..Settings::default() };
        let (rig, numbers) = (Arc::new(rig), BTreeMap::new());
        let (mode, running) = (Mode::Instantiated, None);
        Ok(Self { variables, rig, numbers, settings, start_s: 0.0, mode, running })
    }

    /// Resets to the state after instantiation, with all values at their start.
    pub(crate) fn reset(&mut self) -> Result<(), Refusal> {
        *self = Self::new(self.rig.as_ref().clone())?;
        Ok(())
    }

    pub(crate) fn set_start(&mut self, start_s: f64) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Instantiated], "fmi2SetupExperiment", "fmi2Instantiate or fmi2Reset")?;
        if !start_s.is_finite() {
            return Err(Refusal::Time(format!("startTime = {start_s}: give a finite number of seconds")));
        }
        self.start_s = start_s;
        Ok(())
    }

    pub(crate) fn enter_initialisation(&mut self) -> Result<(), Refusal> {
        self.check_mode(
            &[Mode::Instantiated],
            "fmi2EnterInitializationMode",
            "fmi2Instantiate or fmi2Reset",
        )?;
        self.mode = Mode::Initialising;
        Ok(())
    }

    /// Sets up the plant and leaves the initialisation.
    pub(crate) fn exit_initialisation(&mut self) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Initialising], "fmi2ExitInitializationMode", "fmi2EnterInitializationMode")?;
        self.set_up()?;
        self.mode = Mode::Stepping;
        Ok(())
    }

    /// Ends the simulation; values can still be read.
    pub(crate) fn terminate(&mut self) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Stepping, Mode::Failed], "fmi2Terminate", "fmi2ExitInitializationMode")?;
        self.mode = Mode::Terminated;
        Ok(())
    }

    /// Steps from the communication point `at_s` by `step_s`; returns a warning where the rods could not be linked.
    pub(crate) fn step(&mut self, at_s: f64, step_s: f64) -> Result<Option<String>, Refusal> {
        if self.mode == Mode::Failed {
            return Err(Refusal::NotFinite { at_s: self.time_s() });
        }
        self.check_mode(&[Mode::Stepping], "fmi2DoStep", "fmi2ExitInitializationMode")?;
        let stands_s = self.time_s();
        // In this form NaN is refused too.
        let follows = (at_s - stands_s).abs() <= TOLERANCE_S;
        if !follows {
            let text = format!("a step from {at_s} s, but the plant stands at {stands_s} s");
            return Err(Refusal::Time(format!("{text}: steps follow each other, or restore a state before")));
        }
        let periods = (step_s / PERIOD_S).round();
        let whole = (step_s - periods * PERIOD_S).abs() <= TOLERANCE_S;
        if !(whole && (1.0..=MOST_PERIODS).contains(&periods)) {
            let text =
                format!("a step of {step_s} s: the plant moves by whole milliseconds, from 0.001 s on");
            return Err(Refusal::Time(text));
        }
        let settings = self.settings;
        let running = self.running.as_mut().expect("there from the initialisation on");
        let warning = running.act(&settings);
        for _ in 0..periods as u64 {
            running.period(&settings);
        }
        if !running.plant.state().is_finite() {
            self.mode = Mode::Failed;
            return Err(Refusal::NotFinite { at_s: self.time_s() });
        }
        Ok(warning)
    }

    pub(crate) fn time_s(&self) -> f64 {
        self.start_s + self.running.as_ref().map_or(0, |running| running.period) as f64 * PERIOD_S
    }

    /// The values of Real variables, in the units of the description.
    ///
    /// # Errors
    /// [`Refusal::Reference`], and errors of the set-up during the initialisation.
    pub(crate) fn reals(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Refusal> {
        let variables = Arc::clone(&self.variables);
        let list = find(&variables, references, "Real", |kind| matches!(kind, Kind::Real(_)))?;
        let outputs = list.iter().any(|instance| instance.causality == Causality::Output);
        if outputs {
            self.ensure_set_up()?;
        }
        let running = self.running.as_deref();
        let inputs = inputs(&self.settings, running.map_or([0.0; 2], |running| running.acting));
        let truth = running.filter(|_| outputs).map(|running| running.plant.truth(&inputs).values());
        let terms = running
            .filter(|_| list.iter().any(|instance| matches!(instance.role, Role::Term(_))))
            .map(|running| running.plant.terms(&inputs));
        for (instance, value) in list.iter().zip(values) {
            *value = match instance.role {
                Role::Valve(axis) => self.settings.valve[axis],
                Role::Hand(place) => self.settings.hand_n[place],
                Role::CarriagePosition => self.settings.setup.carriage_position_m,
                Role::AddedMass => self.settings.setup.added_mass_kg,
                Role::Rig(key, place) => self.number(key)[place],
                Role::Truth(place) => truth.map_or(0.0, |truth| truth[place]),
                Role::Term(place) => terms.map_or(0.0, |terms| terms.values()[place]),
                Role::Measured(axis, channel) => {
                    running.map_or(0.0, |running| reading(&running.readings[axis], channel))
                }
                Role::Acting(axis) => inputs.valve[axis],
                Role::EmergencyStop | Role::Link | Role::Linked | Role::Seed => 0.0,
            };
        }
        Ok(())
    }

    pub(crate) fn booleans(&mut self, references: &[u32], values: &mut [bool]) -> Result<(), Refusal> {
        let variables = Arc::clone(&self.variables);
        let list = find(&variables, references, "Boolean", |kind| matches!(kind, Kind::Boolean(_)))?;
        if list.iter().any(|instance| instance.causality == Causality::Output) {
            self.ensure_set_up()?;
        }
        let plant = self.running.as_ref().map(|running| &running.plant);
        for (instance, value) in list.iter().zip(values) {
            *value = match instance.role {
                Role::EmergencyStop => self.settings.emergency_stop,
                Role::Link => self.settings.link,
                Role::Linked => plant.is_some_and(Plant::linked),
                _ => plant.is_some_and(Plant::check_valves_shut),
            };
        }
        Ok(())
    }

    pub(crate) fn integers(&self, references: &[u32], values: &mut [i32]) -> Result<(), Refusal> {
        find(&self.variables, references, "Integer", |kind| matches!(kind, Kind::Integer(_)))?;
        values.fill(self.settings.seed);
        Ok(())
    }

    /// Sets Real variables, all or none.
    pub(crate) fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Result<(), Refusal> {
        let variables = Arc::clone(&self.variables);
        let list = find(&variables, references, "Real", |kind| matches!(kind, Kind::Real(_)))?;
        for (instance, value) in list.iter().zip(values) {
            self.settable(instance)?;
            in_range(instance, *value)?;
        }
        for (instance, value) in list.iter().zip(values) {
            match instance.role {
                Role::Valve(axis) => self.settings.valve[axis] = *value,
                Role::Hand(place) => self.settings.hand_n[place] = *value,
                Role::CarriagePosition => self.settings.setup.carriage_position_m = *value,
                Role::AddedMass => self.settings.setup.added_mass_kg = *value,
                Role::Rig(key, place) => {
                    let mut numbers = self.number(key).to_vec();
                    numbers[place] = *value;
                    self.numbers.insert(key, numbers);
                }
                _ => {}
            }
        }
        self.discard_start();
        Ok(())
    }

    /// Sets Boolean variables, all or none.
    pub(crate) fn set_booleans(&mut self, references: &[u32], values: &[bool]) -> Result<(), Refusal> {
        let variables = Arc::clone(&self.variables);
        let list = find(&variables, references, "Boolean", |kind| matches!(kind, Kind::Boolean(_)))?;
        list.iter().try_for_each(|instance| self.settable(instance))?;
        for (instance, value) in list.iter().zip(values) {
            match instance.role {
                Role::EmergencyStop => self.settings.emergency_stop = *value,
                _ => self.settings.link = *value,
            }
        }
        self.discard_start();
        Ok(())
    }

    /// Sets Integer variables, all or none.
    pub(crate) fn set_integers(&mut self, references: &[u32], values: &[i32]) -> Result<(), Refusal> {
        let variables = Arc::clone(&self.variables);
        let list = find(&variables, references, "Integer", |kind| matches!(kind, Kind::Integer(_)))?;
        for (instance, value) in list.iter().zip(values) {
            self.settable(instance)?;
            in_range(instance, f64::from(*value))?;
        }
        if let Some(value) = values.last() {
            self.settings.seed = *value;
        }
        self.discard_start();
        Ok(())
    }

    fn check_mode(&self, modes: &[Mode], call: &'static str, after: &'static str) -> Result<(), Refusal> {
        if modes.contains(&self.mode) { Ok(()) } else { Err(Refusal::Mode { call, after }) }
    }

    fn settable(&self, instance: &Variable) -> Result<(), Refusal> {
        let before = matches!(self.mode, Mode::Instantiated | Mode::Initialising);
        let refused = |when| Err(Refusal::NotSettable(instance.name.clone(), when));
        match instance.causality {
            Causality::Output => refused("at all: it is an output"),
            Causality::Parameter if !before => refused("after the initialisation: it is a fixed parameter"),
            _ => Ok(()),
        }
    }

    /// Discards the plant of the initialisation, since a start value has changed.
    fn discard_start(&mut self) {
        if self.mode == Mode::Initialising {
            self.running = None;
        }
    }

    /// The values of a key, as set or as in the rig file.
    fn number(&self, key: usize) -> &[f64] {
        self.numbers.get(&key).map_or_else(|| self.rig.numbers(&KEYS[key].path()), Vec::as_slice)
    }

    /// Sets up the plant if necessary: outputs are defined from the initialisation on.
    fn ensure_set_up(&mut self) -> Result<(), Refusal> {
        if self.mode == Mode::Instantiated {
            return Err(Refusal::Mode { call: "reading an output", after: "fmi2EnterInitializationMode" });
        }
        self.set_up()
    }

    fn set_up(&mut self) -> Result<(), Refusal> {
        if self.running.is_some() {
            return Ok(());
        }
        let paths: Vec<_> =
            self.numbers.iter().map(|(key, numbers)| (KEYS[*key].path(), numbers.as_slice())).collect();
        let rig = self.rig.with_all(paths.iter().map(|(path, numbers)| (path.as_str(), *numbers)))?;
        let setup = Setup { linked: self.settings.link, ..self.settings.setup };
        let mut plant = Plant::new(&rig, &setup)?;
        if self.settings.emergency_stop {
            plant.trip_emergency_stop();
        }
        let mut sensors = Sensors::new(&rig, u64::from(self.settings.seed.cast_unsigned()));
        let inputs = inputs(&self.settings, [0.0; 2]);
        // The emulator draws once before its first cycle; equal draws give equal noise.
        sensors.sample(&plant, &inputs);
        let readings = sensors.sample(&plant, &inputs);
        let (acting, period, reported) = ([0.0; 2], 0, false);
        self.running = Some(Box::new(RunningPlant { plant, sensors, readings, acting, period, reported }));
        Ok(())
    }
}

impl RunningPlant {
    /// Applies the actions of people at the start of a step.
    fn act(&mut self, settings: &Settings) -> Option<String> {
        if settings.emergency_stop && !self.plant.emergency_stop() {
            self.plant.trip_emergency_stop();
        } else if !settings.emergency_stop && self.plant.emergency_stop() {
            self.plant.release_emergency_stop();
        }
        if !settings.link {
            self.reported = false;
            self.plant.unlink();
            return None;
        }
        let refused = self.plant.link().err()?;
        let first = !std::mem::replace(&mut self.reported, true);
        first.then(|| format!("{refused}; the rods stay apart until it does"))
    }

    /// One period: steps the plant with the inputs in effect, latches the command for the next period, and samples the sensors
    /// at its start.
    fn period(&mut self, settings: &Settings) {
        self.plant.step(&inputs(settings, self.acting));
        self.acting = settings.valve.map(plant::quantise_valve);
        self.readings = self.sensors.sample(&self.plant, &inputs(settings, self.acting));
        self.period += 1;
    }
}

fn inputs(settings: &Settings, valve: [f64; 2]) -> Inputs {
    let [hand_force_carriage_n, hand_force_load_n] = settings.hand_n;
    Inputs { valve, hand_force_carriage_n, hand_force_load_n }
}

fn reading(readings: &AxisReadings, channel: usize) -> f64 {
    [readings.position, readings.force, readings.pressure_a, readings.pressure_b][channel].value
}

/// The variables of these references, all of one type.
fn find<'v>(
    variables: &'v [Variable],
    references: &[u32],
    kind: &'static str,
    is: impl Fn(Kind) -> bool,
) -> Result<Vec<&'v Variable>, Refusal> {
    let one = |reference: &u32| {
        let instance = variables.get(*reference as usize).filter(|instance| is(instance.kind));
        instance.ok_or(Refusal::Reference(*reference, kind))
    };
    references.iter().map(one).collect()
}

fn in_range(instance: &Variable, value: f64) -> Result<(), Refusal> {
    let (least, most) = instance.range.unwrap_or((f64::MIN, f64::MAX));
    // NaN is in no range.
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Refusal::OutOfRange { name: instance.name.clone(), value, least, most, unit: instance.unit })
}

#[cfg(test)]
mod tests;
