//! The simulated rig that a node moves, and the plant with people around it.

use plant::scene::{Action, HandForces, Outcome, RigCall, StopHolder};
use plant::{AxisReadings, CycleRecord, Inputs, People, Plant, Sensors};

/// A rig that is simulated, with what people do to it: what a node moves by one period at a time.
pub trait SimulatedRig {
    /// Record of a cycle: readings and truth.
    type Cycle;
    /// An event at the rig.
    type Event;

    /// The valve openings of drive and load over the coming cycle, unless an emergency stop comes in it: for a rig that has to
    /// know them when its sensors are sampled, from a caller that does.
    fn expect_valves(&mut self, _valve: [f64; 2]) {}

    /// Begins a cycle: people act, then the sensors are sampled.
    fn sample(&mut self, cycle: u64, on_event: &mut dyn FnMut(Self::Event)) -> [AxisReadings; 2];

    /// Announcement of the rig's own emergency stop due in `cycle`; what is returned counts as sent.
    fn rig_call(&mut self, cycle: u64) -> Option<RigCall>;

    /// Takes note of a stop or a release by a controller or the console.
    fn emergency_stop(&mut self, holder: StopHolder, release: bool) -> Option<Self::Event>;

    /// State of the rig that its status reports.
    fn condition(&self) -> RigCondition;

    /// Ends the cycle: moves by one period under these valve openings of drive and load.
    fn step(&mut self, cycle: u64, valve: [f64; 2]) -> Self::Cycle;
}

/// State of the rig that its status reports, apart from its sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigCondition {
    /// Absolute pressure of the supply node, Pa.
    pub supply_pressure_pa: f64,
    /// Whether the load's eye sits in the carriage.
    pub linked: bool,
    /// Whether the emergency stop is tripped.
    pub emergency_stop: bool,
    /// Whether the non-return valves at the chambers are shut.
    pub check_valves_shut: bool,
}

/// Source of the hand forces on the rig; the sum of all sources acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HandForceSource {
    /// Of the scene's script.
    Script,
    /// By frames of the bench.
    Bus,
    /// By the emulator's console.
    Console,
    /// Of faults.
    Faults,
}

/// The plant with its sensors, and the people around it.
pub struct PeopledPlant {
    plant: Plant,
    people: People,
    sensors: Sensors,
    inputs: Inputs,
    hands: [HandForces; 4],
    readings: [AxisReadings; 2],
}

impl PeopledPlant {
    /// Before cycle 0.
    #[must_use]
    pub fn new(plant: Plant, mut sensors: Sensors, people: People) -> Self {
        let inputs = Inputs::default();
        // Replaced by the first cycle's own sample; the draw of noise belongs to what a seed means.
        let readings = sensors.sample(&plant, &inputs);
        Self { plant, people, sensors, inputs, hands: Default::default(), readings }
    }

    /// Plant that people act on.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Plant and sensors to break, and what acted on them so far.
    pub fn parts(&mut self) -> (&mut Plant, &mut Sensors, &Inputs) {
        (&mut self.plant, &mut self.sensors, &self.inputs)
    }

    /// Hands that push from now on.
    pub fn hand_forces(&mut self, source: HandForceSource) -> &mut HandForces {
        &mut self.hands[source as usize]
    }

    /// Does something that the scene does not hold.
    pub fn act(&mut self, action: Action, on_event: impl FnMut(Outcome)) {
        self.people.act(action, &mut self.plant, on_event);
    }

    /// Lets people do what is due in `cycle`.
    pub fn let_people_act(&mut self, cycle: u64, on_event: impl FnMut(Outcome)) {
        *self.hand_forces(HandForceSource::Script) =
            self.people.begin_cycle(cycle, &mut self.plant, on_event);
    }

    /// Samples the sensors under the hands that push now.
    pub fn sample_sensors(&mut self) -> [AxisReadings; 2] {
        self.hold_hands();
        self.readings = self.sensors.sample(&self.plant, &self.inputs);
        self.readings
    }

    fn hold_hands(&mut self) {
        let [script, bus, console, faults] = self.hands;
        (script + bus + console + faults).put_into(&mut self.inputs);
    }
}

impl SimulatedRig for PeopledPlant {
    type Cycle = CycleRecord;
    type Event = Outcome;

    fn sample(&mut self, cycle: u64, on_event: &mut dyn FnMut(Outcome)) -> [AxisReadings; 2] {
        self.let_people_act(cycle, on_event);
        self.sample_sensors()
    }

    fn rig_call(&mut self, cycle: u64) -> Option<RigCall> {
        self.people.rig_call(cycle)
    }

    fn emergency_stop(&mut self, holder: StopHolder, release: bool) -> Option<Outcome> {
        self.people.emergency_stop(holder, release, &mut self.plant)
    }

    fn condition(&self) -> RigCondition {
        RigCondition {
            supply_pressure_pa: self.plant.supply_pressure_pa(),
            linked: self.plant.linked(),
            emergency_stop: self.plant.emergency_stop(),
            check_valves_shut: self.plant.check_valves_shut(),
        }
    }

    fn step(&mut self, cycle: u64, valve: [f64; 2]) -> CycleRecord {
        self.hold_hands();
        self.inputs.valve = valve;
        let truth = self.plant.truth(&self.inputs);
        let terms = self.plant.terms(&self.inputs);
        self.plant.step(&self.inputs);
        CycleRecord { cycle, valve, readings: self.readings, truth, terms }
    }
}
