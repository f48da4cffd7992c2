//! The plant: both axes, the linkage and the supply, moved by one period at a time.
//!
//! It has no clock, no input or output, no thread and no log, and its step allocates nothing: whoever owns one decides
//! what time is. Two plants with the same rig, setup and inputs are equal to the bit on every x86-64 machine.

use std::sync::Arc;

use crate::effects::tabulated::AxisConditions;
use crate::effects::{Effects, Term, Terms};
use crate::faults::{ActiveValveFaults, AxisFaults, Faults};
use crate::integrator::laws::Baseline;
use crate::integrator::{HeldInputs, Integrator, Lanes, SUBSTEPS};
use crate::lanes::{Axes, Pair};
use crate::parameters::RigParameters;
use crate::setup::{Setup, SetupError, check_added_mass, check_state, start_state};
use crate::state::{Inputs, State};
use crate::truth::{Truth, hand_forces, supply_pressure_pa};

/// The simulated rig; constant model and moving state.
#[derive(Debug, Clone)]
pub struct Plant {
    rig: Arc<RigParameters>,
    pub(crate) integrator: Integrator,
    /// `None` for a rig that has none switched on.
    effects: Option<Box<Effects>>,
    state: State,
    faults: Faults,
    valves: ActiveValveFaults,
    /// Effects of a rig without any, ready for faults that change laws.
    spare: Option<Box<Effects>>,
}

/// Why linking is refused: the eye does not lie in the carriage's gap.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the load's eye is {distance_m} m from the carriage; linking needs it within {half_gap_m} m to either side"
)]
pub struct LinkRefused {
    /// x_load - x_drive, m.
    pub distance_m: f64,
    /// Half of the gap, m.
    pub half_gap_m: f64,
}

impl Plant {
    /// A plant of this rig at the start of this setup.
    ///
    /// # Errors
    /// [`SetupError`] if the carriage lies outside the stroke or the weights outside the rig's limit.
    pub fn new(rig: &RigParameters, setup: &Setup) -> Result<Self, SetupError> {
        Ok(Self::assemble(rig, start_state(rig, setup)?, SUBSTEPS))
    }

    /// A plant of this rig in a given state, as for a window of a record.
    ///
    /// # Errors
    /// [`SetupError`] if the state is none that the rig can be in.
    pub fn in_state(rig: &RigParameters, state: &State) -> Result<Self, SetupError> {
        check_state(rig, state)?;
        Ok(Self::assemble(rig, *state, SUBSTEPS))
    }

    /// Goes on in another state, as in the next window of a record; what effects remember stays.
    ///
    /// Delays, lags, plays, bristles and times at rest go on from the state before; what sensors saw until now moves along by
    /// what they see otherwise now, so that none shows the jump later. A chamber keeps its temperature, so that its mass follows
    /// the new pressure and volume.
    ///
    /// # Errors
    /// [`SetupError`] if the state is none that the rig can be in; the plant is as before.
    pub fn go_on_in(&mut self, state: &State) -> Result<(), SetupError> {
        check_state(&self.rig, state)?;
        let before = self.effects.is_some().then(|| sensor_inputs(&self.truth(&Inputs::default())));
        if let Some(effects) = &mut self.effects {
            effects.memory.keep_temperatures(&self.state, state);
        }
        let added_mass_kg = self.state.added_mass_kg;
        self.state = State { added_mass_kg, ..*state };
        if added_mass_kg != state.added_mass_kg {
            self.set_added_mass_kg(state.added_mass_kg)?;
        }
        if let Some(before) = before {
            let now = sensor_inputs(&self.truth(&Inputs::default()));
            let effects = self.effects.as_mut().expect("there were some before");
            effects.memory.shift_sensor_histories(before, now);
            effects.memory.sensor_force_n = now.map(|[_, force_n, ..]| force_n);
        }
        Ok(())
    }

    /// The same plant with another number of substeps in a period, 1 to 1000: for studies of accuracy.
    ///
    /// # Panics
    /// If the number lies outside its range.
    pub fn with_substeps(self, substeps: u32) -> Self {
        assert!((1..=1000).contains(&substeps), "1 to 1000 substeps, not {substeps}");
        Self::assemble(&self.rig.clone(), self.state, substeps)
    }

    fn assemble(rig: &RigParameters, state: State, substeps: u32) -> Self {
        let faults = Faults::default();
        let integrator = Integrator::new(rig, state.added_mass_kg, substeps, &faults);
        let effects = Effects::of(rig, &integrator, &state);
        let (valves, spare) = (ActiveValveFaults::default(), None);
        Plant { rig: Arc::new(rig.clone()), integrator, effects, state, faults, valves, spare }
    }

    /// Sets the time that declared terms read as `t`, in periods; nothing else changes. A plant begins at 0.
    pub fn set_time(&mut self, periods: u64) {
        let substeps = u64::from(self.integrator.substeps);
        if let Some(effects) = &mut self.effects {
            effects.memory.substeps = periods * substeps;
        }
    }

    /// Advances by exactly 1 ms with the inputs held.
    ///
    /// The caller has rounded the commands to what the wire can carry ([`crate::quantise_valve`]) and refused NaN. While
    /// the emergency stop holds, they count as 0.
    ///
    /// # Panics
    /// In debug builds, if a command is not in [-1, 1] or a hand's force not finite: a bug of the caller.
    pub fn step(&mut self, inputs: &Inputs) {
        let held = self.held_inputs(inputs);
        match &mut self.effects {
            Some(effects) if !effects.baseline_laws => {
                effects.begin_period(held.command.to_array());
                self.integrator.advance(effects.as_mut(), &mut self.state, held);
            }
            _ => self.integrator.advance(&mut Baseline, &mut self.state, held),
        }
    }

    /// What is held over a period with these inputs; a slow valve goes on by that period.
    #[inline(always)]
    pub(crate) fn held_inputs(&mut self, inputs: &Inputs) -> HeldInputs {
        debug_assert!(inputs.valve.iter().all(|u| (-1.0..=1.0).contains(u)), "{inputs:?}");
        debug_assert!(
            inputs.hand_force_carriage_n.is_finite() && inputs.hand_force_load_n.is_finite(),
            "{inputs:?}"
        );
        let mut command = if self.state.emergency_stop {
            Pair::both(0.0)
        } else {
            Pair::new(inputs.valve[0], inputs.valve[1])
        };
        let mut stuck = [false; 2];
        if self.valves.any {
            let spools = self.state.axes.map(|axis| axis.spool);
            let passed;
            (passed, stuck) = self.valves.pass(command.to_array(), spools);
            command = Pair::new(passed[0], passed[1]);
        }
        HeldInputs {
            command,
            hand: hand_forces(inputs),
            stopped: self.state.emergency_stop,
            linked: self.state.linked,
            stuck,
        }
    }

    /// Whether the baseline's laws move it, which many rigs can be moved by at once.
    pub(crate) fn is_baseline(&self) -> bool {
        self.effects.as_ref().is_none_or(|effects| effects.baseline_laws)
    }

    /// Goes to where a batch has moved it.
    pub(crate) fn go_to(&mut self, lanes: &Lanes, supply_pa: f64) {
        lanes.store(&mut self.state);
        self.state.supply_pressure_pa = supply_pa;
    }

    /// True states and terms at this instant; of the inputs only the hand forces matter, since a spool lags.
    pub fn truth(&self, inputs: &Inputs) -> Truth {
        Truth::at(&self.integrator, self.effects.as_deref(), &self.state, inputs)
    }

    /// Noise-free readings of the sensors, not rounded: position, force, pressure a, pressure b of each axis.
    pub fn noise_free_readings(&self, truth: &Truth) -> [[f64; 4]; 2] {
        let Some(effects) = &self.effects else {
            return sensor_inputs(truth);
        };
        std::array::from_fn(|i| {
            let axis = &truth.axes[i];
            let conditions = AxisConditions {
                extension_m: self.state.axes[i].extension_m,
                velocity_m_per_s: axis.rod_velocity_m_per_s,
                spool: axis.spool,
                pressure_pa: [axis.pressure_a_pa, axis.pressure_b_pa],
            };
            let at = effects.declared_at(i, &conditions, axis.sensor_force_n);
            let pressure = |chamber, truth| effects.pressure_reading(i, chamber, truth, &at).sum(truth);
            [
                effects.position_reading(i, axis.position_m, &at).sum(axis.position_m),
                effects.force_reading(i, axis.sensor_force_n, &at).sum(axis.sensor_force_n),
                pressure(0, axis.pressure_a_pa),
                pressure(1, axis.pressure_b_pa),
            ]
        })
    }

    /// Name and unit of each value of [`Plant::terms`], as columns of `truth.csv`.
    pub fn term_names(&self) -> Vec<String> {
        let mut names = Vec::new();
        self.each_term(&Inputs::default(), &mut |term| names.push(term.column()));
        names
    }

    /// What each switched-on effect adds to its balance at this instant; none without effects.
    pub fn terms(&self, inputs: &Inputs) -> Terms {
        let mut terms = Terms::default();
        self.each_term(inputs, &mut |term| terms.push(term.value));
        terms
    }

    #[cfg(test)]
    pub(crate) fn effects(&self) -> Option<&Effects> {
        self.effects.as_deref()
    }

    fn each_term(&self, inputs: &Inputs, tell: &mut dyn FnMut(Term)) {
        if let Some(effects) = &self.effects {
            effects.each_term(&self.integrator, &self.state, inputs, tell);
        }
    }

    /// All that changes in the plant.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The numbers the plant was made from.
    pub fn rig(&self) -> &RigParameters {
        &self.rig
    }

    /// Absolute pressure of the supply node, Pa.
    pub fn supply_pressure_pa(&self) -> f64 {
        supply_pressure_pa(self.effects.as_deref(), &self.state)
    }

    /// Discharges the supply; valve commands count as 0 until the release [rig-model.md, Emergency stop].
    pub fn trip_emergency_stop(&mut self) {
        self.state.emergency_stop = true;
    }

    /// Lets the supply recover; commands act again at once, air flows once the check valves are open.
    pub fn release_emergency_stop(&mut self) {
        self.state.emergency_stop = false;
    }

    /// Whether the emergency stop is tripped.
    pub fn emergency_stop(&self) -> bool {
        self.state.emergency_stop
    }

    /// Whether the non-return valves at the chambers are shut.
    pub fn check_valves_shut(&self) -> bool {
        self.integrator.supply.check_valves_shut(self.state.supply_pressure_pa)
    }

    /// Whether the load's eye sits in the carriage.
    pub fn linked(&self) -> bool {
        self.state.linked
    }

    /// Puts the load's eye into the carriage; linking what is linked changes nothing.
    ///
    /// # Errors
    /// [`LinkRefused`] unless the eye lies in the gap [rig-model.md, Masses and linkage].
    pub fn link(&mut self) -> Result<(), LinkRefused> {
        let [drive, load] = &self.state.axes;
        let distance_m = self.integrator.distance(Pair::new(drive.extension_m, load.extension_m));
        if self.state.linked || self.integrator.linkage.in_gap(distance_m) {
            self.state.linked = true;
            Ok(())
        } else {
            Err(LinkRefused { distance_m, half_gap_m: self.integrator.linkage.half_gap_m })
        }
    }

    /// Takes the load's eye out of the carriage; always possible.
    pub fn unlink(&mut self) {
        self.state.linked = false;
    }

    /// Takes the room that faults may need, so that [`Plant::set_faults`] allocates nothing; until then it does at its first
    /// call.
    pub fn expect_faults(&mut self) {
        if !self.rig.has_effects() && self.effects.is_none() && self.spare.is_none() {
            self.spare = Some(Effects::new(&self.rig, &self.integrator, &self.state));
        }
    }

    /// What is broken from now on, in place of what was; nothing in the default.
    pub fn set_faults(&mut self, faults: &Faults) {
        self.expect_faults();
        self.faults = *faults;
        self.valves.set(faults, self.state.axes.map(|axis| axis.spool));
        self.integrator = self.integrator.rebuilt(&self.rig, self.state.added_mass_kg, faults);
        if !self.rig.has_effects() {
            if !faults.axes.iter().any(AxisFaults::changes_laws) {
                // The baseline's own step goes on.
                self.spare = self.effects.take().or(self.spare.take());
            } else if let Some(mut effects) = self.spare.take() {
                effects.begin(&self.integrator, &self.state);
                self.effects = Some(effects);
            }
        }
        if let Some(effects) = &mut self.effects {
            effects.set_faults(faults);
            effects.move_with(&self.integrator);
        }
    }

    /// Puts weights on the carriage or takes them off, kg in all; the velocity stays.
    ///
    /// # Errors
    /// [`SetupError::AddedMass`] if they are negative or more than the rig takes.
    pub fn set_added_mass_kg(&mut self, kg: f64) -> Result<(), SetupError> {
        self.state.added_mass_kg = check_added_mass(&self.rig, kg)?;
        self.integrator = self.integrator.rebuilt(&self.rig, kg, &self.faults);
        if let Some(effects) = &mut self.effects {
            effects.move_with(&self.integrator);
        }
        Ok(())
    }
}

/// What flawless sensors see: position, force, pressure a, pressure b of each axis.
fn sensor_inputs(truth: &Truth) -> [[f64; 4]; 2] {
    truth.axes.map(|axis| [axis.position_m, axis.sensor_force_n, axis.pressure_a_pa, axis.pressure_b_pa])
}
