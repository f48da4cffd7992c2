//! What a node moves: a simulated rig, and the plant with people around it.

use plant::scene::{Action, HandForces, Holder, Outcome, RigCall};
use plant::tables::CycleRecord;
use plant::{AxisReadings, Inputs, People, Plant, Sensors};

/// A rig that is simulated, with what people do to it: what a node moves by one period at a time.
pub trait SimulatedRig {
    /// What a cycle leaves: what the rig shows, and what only a simulation knows.
    type Cycle;
    /// What happened to the rig.
    type Event;

    /// The valve openings of drive and load over the coming cycle, unless an emergency stop comes in it: for a rig that has to
    /// know them when its sensors are sampled, from a caller that does.
    fn expect_valves(&mut self, _valve: [f64; 2]) {}

    /// Begins a cycle: people act, then the sensors are sampled.
    fn sample(&mut self, cycle: u64, tell: &mut dyn FnMut(Self::Event)) -> [AxisReadings; 2];

    /// What the rig has to say about its own emergency stop in `cycle`; what is given counts as said.
    fn rig_call(&mut self, cycle: u64) -> Option<RigCall>;

    /// Takes note of a stop or a release by a controller or the console.
    fn emergency_stop(&mut self, holder: Holder, release: bool) -> Option<Self::Event>;

    /// What the rig reports of itself beside its sensors.
    fn standing(&self) -> Standing;

    /// Ends the cycle: moves by one period under these valve openings of drive and load.
    fn step(&mut self, cycle: u64, valve: [f64; 2]) -> Self::Cycle;
}

/// What a rig reports of itself beside its sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Absolute pressure of the supply node, Pa.
    pub supply_pressure_pa: f64,
    /// Whether the load's eye sits in the carriage.
    pub linked: bool,
    /// Whether the emergency stop is tripped.
    pub emergency_stop: bool,
    /// Whether the non-return valves at the chambers are shut.
    pub check_valves_shut: bool,
}

/// Whose hands push the rig; the sum of all acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hand {
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
    pub fn hand(&mut self, whose: Hand) -> &mut HandForces {
        &mut self.hands[whose as usize]
    }

    /// Does something that the scene does not hold.
    pub fn act(&mut self, action: Action, tell: impl FnMut(Outcome)) {
        self.people.act(action, &mut self.plant, tell);
    }

    /// Lets people do what is due in `cycle`.
    pub fn let_people_act(&mut self, cycle: u64, tell: impl FnMut(Outcome)) {
        *self.hand(Hand::Script) = self.people.begin_cycle(cycle, &mut self.plant, tell);
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

    fn sample(&mut self, cycle: u64, tell: &mut dyn FnMut(Outcome)) -> [AxisReadings; 2] {
        self.let_people_act(cycle, tell);
        self.sample_sensors()
    }

    fn rig_call(&mut self, cycle: u64) -> Option<RigCall> {
        self.people.rig_call(cycle)
    }

    fn emergency_stop(&mut self, holder: Holder, release: bool) -> Option<Outcome> {
        self.people.emergency_stop(holder, release, &mut self.plant)
    }

    fn standing(&self) -> Standing {
        Standing {
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
