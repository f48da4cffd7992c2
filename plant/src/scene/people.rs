//! What people do in a cycle, and the same done to a plant: one code for the emulator and for a plant inside a controller.
//!
//! ```text
//!   t_k  begin_cycle(k) ──► sensors sampled ──► … commands latched ──► step to t_k+1
//!        buttons and pin first, then the hands' forces over [t_k, t_k+1)
//! ```
//!
//! It is called once for every cycle, in order, also for those that a late loop makes up for. Nothing here allocates.

use super::hand::ActiveHand;
use super::stop::{RigCall, StopHolder, StopHolders};
use super::{Action, Event, HandForces, Scene, cycle_of};
use crate::plant::Plant;

/// State of a scene during a run: forces and actions of each cycle, not yet applied to any plant.
#[derive(Debug, Clone)]
pub struct Script {
    hands: Vec<ActiveHand>,
    /// In the order of their times; those of one time in the order of the file.
    events: Vec<Event>,
    next: usize,
}

impl Script {
    /// The script of a scene, before cycle 0.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let mut events = scene.event.clone();
        events.sort_by_key(|event| cycle_of(event.at_s));
        Script { hands: scene.hand.iter().copied().map(ActiveHand::new).collect(), events, next: 0 }
    }

    /// The next event that is due by `cycle`; to be asked until there is none.
    pub fn due(&mut self, cycle: u64) -> Option<Event> {
        let event = self.events.get(self.next).filter(|event| cycle_of(event.at_s) <= cycle)?;
        self.next += 1;
        Some(*event)
    }

    /// What all hands push with over `cycle`; the plant stands at its start.
    pub fn hands(&mut self, cycle: u64, plant: &Plant) -> HandForces {
        let mut forces = HandForces::default();
        for hand in &mut self.hands {
            *forces.on(hand.part()) += hand.force_n(cycle, plant);
        }
        forces
    }
}

/// What came of an action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// The emergency stop was tripped.
    Stopped,
    /// Nobody holds it any more: it was released.
    Released,
    /// The rig released its own, and somebody else holds it still.
    StillHeld,
    /// The rods were linked.
    Linked,
    /// The one try at linking failed: the eye is not within the gap.
    LinkRefused,
    /// No try succeeded before the time was up, or before the rods were to be parted again.
    LinkGivenUp,
    /// The rods were parted.
    Unlinked,
    /// Weights were put on the carriage or taken off.
    Weights {
        /// Weights in all, kg.
        added_mass_kg: f64,
    },
    /// The rig does not take these weights.
    WeightsRefused,
}

/// Everybody who can do something to the rig by hand, whether scripted, at its console, or on the bus.
#[derive(Debug, Clone)]
pub struct People {
    script: Script,
    holders: StopHolders,
    /// Last cycle of the attempts to link; `None` without one.
    linking_until: Option<u64>,
    /// What is done when the carriage passes a place; has room for all events.
    triggers: Vec<PositionTrigger>,
}

/// What is done when the carriage passes a place.
#[derive(Debug, Clone, Copy)]
struct PositionTrigger {
    position_m: f64,
    /// The carriage was short of it when the trigger was set.
    short: bool,
    action: Action,
}

fn is_short_of(position_m: f64, plant: &Plant) -> bool {
    plant.state().axes[0].extension_m < position_m
}

impl People {
    /// Those of a scene, before cycle 0.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let triggers = Vec::with_capacity(scene.event.len());
        People { script: Script::new(scene), holders: StopHolders::default(), linking_until: None, triggers }
    }

    /// Does what is due in `cycle` to the plant, reports the outcome, and gives the scripted hands' forces over the
    /// cycle. To be called before the sensors are sampled, which then see these forces.
    pub fn begin_cycle(
        &mut self,
        cycle: u64,
        plant: &mut Plant,
        mut tell: impl FnMut(Outcome),
    ) -> HandForces {
        while let Some(Event { at_position_m, action, .. }) = self.script.due(cycle) {
            match at_position_m {
                None => self.act(action, plant, &mut tell),
                Some(position_m) => {
                    let short = is_short_of(position_m, plant);
                    self.triggers.push(PositionTrigger { position_m, short, action });
                }
            }
        }
        let passed = |trigger: &PositionTrigger, plant: &Plant| {
            is_short_of(trigger.position_m, plant) != trigger.short
        };
        while let Some(place) = self.triggers.iter().position(|trigger| passed(trigger, plant)) {
            let PositionTrigger { action, .. } = self.triggers.remove(place);
            self.act(action, plant, &mut tell);
        }
        if let Some(until) = self.linking_until {
            if plant.link().is_ok() {
                self.linking_until = None;
                tell(Outcome::Linked);
            } else if cycle >= until {
                self.linking_until = None;
                tell(Outcome::LinkGivenUp);
            }
        }
        self.script.hands(cycle, plant)
    }

    /// Does one action to the plant and returns the outcome; the emergency stop is the rig's own.
    pub fn act(&mut self, action: Action, plant: &mut Plant, mut tell: impl FnMut(Outcome)) {
        match action {
            Action::EmergencyStop => {
                self.emergency_stop(StopHolder::Rig, false, plant).into_iter().for_each(tell);
            }
            Action::Release => {
                let change = self.emergency_stop(StopHolder::Rig, true, plant);
                let held = plant.emergency_stop().then_some(Outcome::StillHeld);
                change.or(held).into_iter().for_each(tell);
            }
            // The first try is made in the cycle that begins.
            Action::Link { until_s: Some(until_s) } => self.linking_until = Some(cycle_of(until_s)),
            Action::Link { until_s: None } => {
                tell(if plant.link().is_ok() { Outcome::Linked } else { Outcome::LinkRefused });
            }
            Action::Unlink => {
                if self.linking_until.take().is_some() {
                    tell(Outcome::LinkGivenUp);
                }
                plant.unlink();
                tell(Outcome::Unlinked);
            }
            Action::Weights { added_mass_kg } => {
                let taken = plant.set_added_mass_kg(added_mass_kg).is_ok();
                tell(if taken { Outcome::Weights { added_mass_kg } } else { Outcome::WeightsRefused });
            }
        }
    }

    /// Takes note of a stop or a release by one of those who can; returns what changed at the plant.
    pub fn emergency_stop(
        &mut self,
        holder: StopHolder,
        release: bool,
        plant: &mut Plant,
    ) -> Option<Outcome> {
        let tripped = self.holders.take(holder, release, plant)?;
        Some(if tripped { Outcome::Stopped } else { Outcome::Released })
    }

    /// What the rig has to say about its own emergency stop in `cycle`, if anything; what is given counts as said.
    pub fn rig_call(&mut self, cycle: u64) -> Option<RigCall> {
        self.holders.rig_call(cycle)
    }
}
