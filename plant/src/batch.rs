//! Many rigs at once: a period of each costs a quarter to three quarters of what it costs alone, and has the same bits.
//!
//! A batch holds plants and moves all of them by one period, each with inputs of its own. Eight neighbours make a group, whose
//! numbers stand in columns (`batch/columns.rs`), and the compiler turns the loop over them into wide instructions
//! (`batch/substep.rs`). Rigs of a group may differ in everything: parameters, states, linked or not, stopped or not.
//!
//! ```text
//!   plants ──► columns ──► ten substeps of all lanes ──► plants
//!                 ▲                │
//!                 └── a lane with a corner: made again in parts by its own rig, the others go on
//! ```
//!
//! Every operation rounds the same in any width, and nothing is fused or reordered: the result of each rig is that of
//! [`Plant::step`] to the bit, whatever its neighbours and the machine.
//!
//! What does not run in lanes runs by itself and costs what it always does: a rig with effects, tables or terms that act
//! in a step, one with a fault that changes laws, and one with another number of substeps than the first of its group; and all
//! rigs of a group of which too few are left. A caller need not care, but rigs that can run in lanes are cheapest side by side.
//!
//! Measured cost: `docs/integration.md`.

mod columns;
mod substep;

use crate::integrator::Lanes;
use crate::integrator::laws::Baseline;
use crate::lanes::Pair;
use crate::plant::Plant;
use crate::state::Inputs;
use columns::{HeldColumns, StateColumns, WIDTH};
pub use substep::Registers;

/// Plants that are moved together.
///
/// ```
/// use plant::{Batch, Inputs, Plant, RigParameters, Setup};
///
/// let rig = RigParameters::baseline();
/// let plant = Plant::new(&rig, &Setup::default())?;
/// let mut batch = Batch::new(vec![plant; 20]);
/// let inputs: Vec<Inputs> =
///     (0..20).map(|i| Inputs { valve: [f64::from(i) / 20.0, 0.0], ..Inputs::default() }).collect();
/// for _ in 0..200 {
///     batch.step(&inputs);
/// }
/// batch.plant_mut(3).trip_emergency_stop();
/// assert!(batch.plants()[19].state().axes[0].extension_m > 0.2);
/// # Ok::<(), plant::SetupError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Batch {
    plants: Vec<Plant>,
    groups: Vec<Group>,
    registers: Registers,
}

/// Neighbours whose numbers stand in the same columns; rig i of a group has lane i.
#[derive(Debug, Clone)]
struct Group {
    /// Somebody may have changed a rig: who runs in lanes, and by which laws, is to be seen anew.
    stale: bool,
    in_lanes: [bool; WIDTH],
    fixed: Box<HeldColumns>,
    /// The state before a substep, and after it.
    states: [Box<StateColumns>; 2],
}

impl Batch {
    /// Neighbours that move together.
    pub const GROUP: usize = WIDTH;

    /// A batch of these plants, in this order.
    #[must_use]
    pub fn new(plants: Vec<Plant>) -> Self {
        let groups = plants.chunks(WIDTH).map(|_| Group::new()).collect();
        Batch { plants, groups, registers: Registers::widest() }
    }

    /// The same with other registers: for studies of cost, the result is the same.
    ///
    /// # Panics
    /// If the machine does not have them.
    #[must_use]
    pub fn with_registers(mut self, registers: Registers) -> Self {
        assert!(registers.are_there(), "this machine has no registers for {registers:?}");
        self.registers = registers;
        self.groups.iter_mut().for_each(|group| group.stale = true);
        self
    }

    /// The plants, each as it would be on its own: states, truths and sensors are asked of them.
    #[must_use]
    pub fn plants(&self) -> &[Plant] {
        &self.plants
    }

    /// A plant to be changed: linked, stopped, given another state, broken, or replaced.
    ///
    /// The laws of its group are taken over anew in the next step, which costs some 0.3 us.
    ///
    /// # Panics
    /// If there is no such plant.
    pub fn plant_mut(&mut self, at: usize) -> &mut Plant {
        self.groups[at / WIDTH].stale = true;
        &mut self.plants[at]
    }

    /// The plants, moved to where they are.
    #[must_use]
    pub fn into_plants(self) -> Vec<Plant> {
        self.plants
    }

    /// Advances every plant by exactly 1 ms, each with its inputs held, as [`Plant::step`] does; allocates nothing.
    ///
    /// # Panics
    /// If there are not as many inputs as plants; in debug builds as [`Plant::step`].
    pub fn step(&mut self, inputs: &[Inputs]) {
        assert_eq!(inputs.len(), self.plants.len(), "inputs for each plant");
        let groups = self.groups.iter_mut().zip(self.plants.chunks_mut(WIDTH));
        for ((group, plants), inputs) in groups.zip(inputs.chunks(WIDTH)) {
            group.step(self.registers, plants, inputs);
        }
    }

    /// The same with equal inputs for all, as where one record is held against many rigs.
    ///
    /// # Panics
    /// In debug builds as [`Plant::step`].
    pub fn step_alike(&mut self, inputs: &Inputs) {
        let inputs = [*inputs; WIDTH];
        for (group, plants) in self.groups.iter_mut().zip(self.plants.chunks_mut(WIDTH)) {
            group.step(self.registers, plants, &inputs[..plants.len()]);
        }
    }
}

impl Group {
    fn new() -> Self {
        let states = [StateColumns::new(), StateColumns::new()];
        Group { stale: true, in_lanes: [false; WIDTH], fixed: HeldColumns::new(), states }
    }

    fn step(&mut self, registers: Registers, plants: &mut [Plant], inputs: &[Inputs]) {
        if self.stale {
            self.assign_lanes(registers, plants);
        }
        if let Some(first) = self.in_lanes.iter().position(|in_lane| *in_lane) {
            self.load(first, plants, inputs);
            self.advance(registers, first, plants);
            for (lane, plant) in plants.iter_mut().enumerate().filter(|(lane, _)| self.in_lanes[*lane]) {
                let (lanes, supply_pa) = self.states[0].get(lane);
                plant.go_to(&lanes, supply_pa);
            }
        }
        for (lane, (plant, inputs)) in plants.iter_mut().zip(inputs).enumerate() {
            if !self.in_lanes[lane] {
                plant.step(inputs);
            }
        }
    }

    /// Assigns the plants with baseline laws to lanes and copies their laws; an unused lane repeats the first of them.
    fn assign_lanes(&mut self, registers: Registers, plants: &[Plant]) {
        self.stale = false;
        self.in_lanes = [false; WIDTH];
        let Some(first) = plants.iter().find(|plant| plant.is_baseline()) else { return };
        let substeps = first.integrator.substeps;
        for (in_lane, plant) in self.in_lanes.iter_mut().zip(plants) {
            *in_lane = plant.is_baseline() && plant.integrator.substeps == substeps;
        }
        if self.in_lanes.iter().filter(|in_lane| **in_lane).count() < registers.worthwhile() {
            self.in_lanes = [false; WIDTH];
            return;
        }
        for (lane, in_lane) in self.in_lanes.iter().enumerate() {
            let plant = if *in_lane { &plants[lane] } else { first };
            self.fixed.set_laws(lane, &plant.integrator);
        }
    }

    /// States and inputs into the columns.
    fn load(&mut self, first: usize, plants: &mut [Plant], inputs: &[Inputs]) {
        let from = &mut self.states[0];
        for (lane, (plant, inputs)) in plants.iter_mut().zip(inputs).enumerate() {
            if self.in_lanes[lane] {
                self.fixed.set_held(lane, &plant.held_inputs(inputs));
                let state = plant.state();
                from.set(lane, &Lanes::load(state), state.supply_pressure_pa);
            }
        }
        for lane in (0..WIDTH).filter(|lane| !self.in_lanes[*lane]) {
            self.fixed.shadow(first, lane);
            from.shadow(first, lane);
        }
    }

    /// Moves the columns by one period.
    fn advance(&mut self, registers: Registers, first: usize, plants: &[Plant]) {
        let like = &plants[first].integrator;
        for number in 0..like.substeps {
            let [from, to] = &mut self.states;
            substep::substep(registers, like, &self.fixed, from, to);
            if to.has_corners() {
                self.locate_corners(number, plants);
            }
            self.states.swap(0, 1);
        }
    }

    /// Makes the substep of lanes that have a corner again, in parts, by their own rigs.
    #[cold]
    fn locate_corners(&mut self, substep: u32, plants: &[Plant]) {
        let [from, to] = &mut self.states;
        for (lane, plant) in plants.iter().enumerate() {
            if self.in_lanes[lane] && to.corner(lane) {
                let (lanes, held): ((Lanes<Pair>, f64), _) = (from.get(lane), self.fixed.held(lane));
                let (lanes, supply_pa) = plant.integrator.in_parts(&Baseline, lanes, held, substep, &mut ());
                to.set(lane, &lanes, supply_pa);
            }
        }
    }
}
