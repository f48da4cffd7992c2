//! A hand on the carriage or on the load's eye: a push, or an arm that guides the part to a place.
//!
//! ```text
//! push     F = F_0 min(1, (t - from) / ramp, (to - t) / ramp)
//! guide    F = k (x_target - x) - d v, at most F_most to either side
//!          x_target = x_from + (x_to - x_from) s(z)    z = (t - from) / travel, at most 1
//!          s(z) = z - sin(2 pi z) / (2 pi)             Bestehorn sinoid, VDI 2143 part 1
//! ```
//!
//! t: start of the cycle, s. x, v: of the part, in +x, m and m/s; x_from: where it was at `from`. F acts in +x over the whole
//! cycle, N. Beyond [from, to) a hand is off the part. A guiding hand has no integral part: against F_stat of 35 N or
//! against trapped air it stops where k (x_target - x) is what it meets, as an arm does that is not asked to push harder.

use std::f64::consts::TAU;
use std::ops::Add;

use serde::Serialize;
use settings::parameters::declare;

use super::cycle_of;
use crate::plant::Plant;
use crate::state::Inputs;

/// Strongest push, N: what the bus can ask of a hand.
pub(super) const STRONGEST_N: f64 = 2000.0;

settings::parameters! {
    /// How a hand guides. Held over a cycle of 1 ms on at least half a kilogram, both ends of the ranges of stiffness and
    /// damping are stable. All defaults are guesses: some 7 cm of give at the full force, a damping that is little beside the
    /// pistons' own 1100 N s/m, the force of one arm of a standing person.
    #[derive(Serialize)]
    pub struct Guidance {
        travel_s: declare("s", [0.01, 3600.0], 1.0, "how long a guiding hand travels; if absent no longer than it acts"),
        stiffness_n_per_m: declare("N/m", [1.0, 20_000.0], 2000.0, "stiffness of a guiding arm"),
        damping_n_s_per_m: declare("N s/m", [0.0, 500.0], 60.0, "damping of a guiding arm"),
        most_n: declare("N", [1.0, STRONGEST_N], 150.0, "most that a guiding arm pulls to either side"),
    }
}

/// What a hand can be put on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Carriage on the rod of the drive.
    Carriage,
    /// The eye at the end of the load's rod.
    LoadEye,
}

/// A hand that is on a part for a while.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Hand {
    /// Part that is pushed or guided.
    pub on: Part,
    /// When it is put on, s of the rig's time.
    pub from_s: f64,
    /// When it lets go, s.
    pub to_s: f64,
    /// What it does meanwhile.
    #[serde(flatten)]
    pub action: HandAction,
}

/// What a hand does while it is on a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum HandAction {
    /// Pushes with a constant force.
    Push {
        /// Force in +x, N.
        force_n: f64,
        /// Time to the full force and back, s.
        ramp_s: f64,
    },
    /// Pulls the part towards a target that travels.
    Guide {
        /// Where the target ends, m in rig coordinates.
        guide_to_m: f64,
        /// How it is pulled there.
        #[serde(flatten)]
        guidance: Guidance,
    },
}

/// What hands push with, in +x.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HandForces {
    /// On the carriage, N.
    pub carriage_n: f64,
    /// On the load's eye, N.
    pub load_eye_n: f64,
}

impl HandForces {
    /// Makes them the hands of a plant's inputs.
    pub fn put_into(self, inputs: &mut Inputs) {
        inputs.hand_force_carriage_n = self.carriage_n;
        inputs.hand_force_load_n = self.load_eye_n;
    }

    /// The force on a part, N.
    pub fn on(&mut self, part: Part) -> &mut f64 {
        match part {
            Part::Carriage => &mut self.carriage_n,
            Part::LoadEye => &mut self.load_eye_n,
        }
    }
}

impl Add for HandForces {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        HandForces {
            carriage_n: self.carriage_n + other.carriage_n,
            load_eye_n: self.load_eye_n + other.load_eye_n,
        }
    }
}

/// State of a hand during a run.
#[derive(Debug, Clone)]
pub(super) struct ActiveHand {
    hand: Hand,
    from: u64,
    to: u64,
    /// Where a guided part was when the hand was put on.
    x_from_m: Option<f64>,
}

impl ActiveHand {
    pub(super) fn new(hand: Hand) -> Self {
        ActiveHand { hand, from: cycle_of(hand.from_s), to: cycle_of(hand.to_s), x_from_m: None }
    }

    pub(super) fn part(&self) -> Part {
        self.hand.on
    }

    /// Force in +x over `cycle`, N.
    pub(super) fn force_n(&mut self, cycle: u64, plant: &Plant) -> f64 {
        if cycle < self.from || cycle >= self.to {
            return 0.0;
        }
        let since_s = (cycle - self.from) as f64 / 1000.0;
        match self.hand.action {
            HandAction::Push { force_n, ramp_s } => {
                let left_s = (self.to - cycle) as f64 / 1000.0;
                let nearest_s = since_s.min(left_s);
                if nearest_s < ramp_s { force_n * (nearest_s / ramp_s) } else { force_n }
            }
            HandAction::Guide { guide_to_m, guidance } => {
                let Guidance { travel_s, stiffness_n_per_m, damping_n_s_per_m, most_n } = guidance;
                let (x_m, v_m_per_s) = self.hand.on.motion(plant);
                let x_from_m = *self.x_from_m.get_or_insert(x_m);
                let z = (since_s / travel_s).min(1.0);
                let way = z - libm::sin(TAU * z) / TAU;
                let target_m = x_from_m + (guide_to_m - x_from_m) * way;
                let pull_n = stiffness_n_per_m * (target_m - x_m) - damping_n_s_per_m * v_m_per_s;
                pull_n.clamp(-most_n, most_n)
            }
        }
    }
}
