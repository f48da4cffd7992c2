//! Faults of the rig: what breaks in a valve, a hose, a guide, the supply or a sensor, as an overlay on the baseline's laws.
//!
//! An overlay says what is broken now; whoever decides when something breaks sets it anew ([`Plant::set_faults`],
//! [`crate::Sensors::set_faults`]) whenever that changes. Nothing is broken in the default, and then the plant's step and the
//! sensors' sample are the baseline's to the bit.
//!
//! ```text
//!   command ── lag ── offset ── limit ── dead ── stuck ──► spool        faults/valve.rs, once a period
//!   chamber ── leak, burst hose ──► atmosphere                          faults/hose.rs
//!   friction levels times a factor, mass on top, another supply target  this file
//!   true value ── gain, offset, drift, noise, spike, step ── stuck, dropout ──► reading   faults/reading.rs
//! ```
//!
//! | symbol | unit, domain | what |
//! |---|---|---|
//! | friction_factor | 1, >= 0 | all friction of an axis times this, the product of all such faults; 1 changes nothing |
//! | added_mass_kg | kg, >= 0 | moves with an axis, beside the weights that people put on |
//! | supply | Pa absolute, s | where the node goes, and how fast |
//!
//! Names, ranges and descriptions of faults are the emulator's table, which keeps the numbers of each fault in their range.
//!
//! Source: kinds of faults: Isermann, Fault-Diagnosis Systems, 2006, ch. 2 and 7, DOI 10.1007/3-540-30368-5; laws: as named in
//! each file; ranges: guesses, wide enough for what a test plan asks for.

mod hose;
mod reading;
mod valve;

pub(crate) use hose::Outlet;
pub use reading::SensorFault;
pub(crate) use reading::SensorFaults;
pub use valve::ValveFault;

use crate::plant::Plant;

/// What is broken in the rig, but for its sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Faults {
    /// Drive and load.
    pub axes: [AxisFaults; 2],
    /// The supply, where it is not as set.
    pub supply: Option<SupplyFault>,
}

/// What is broken in one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisFaults {
    /// Faults of the proportional valve.
    pub valve: ValveFault,
    /// All its friction times this; the product of all such faults.
    pub friction_factor: f64,
    /// Mass that moves with it, kg, on top of everything else.
    pub added_mass_kg: f64,
    /// Normal flow out of chambers a and b from 6 to 1 bar absolute through a gap, m^3/s.
    pub leakage_m3_per_s: [f64; 2],
    /// K_V of a hole in the hose of chambers a and b, m^3/h.
    pub burst_kv_m3_per_h: [f64; 2],
}

/// Where the supply's node goes instead of the set pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupplyFault {
    /// Absolute pressure that it approaches, Pa.
    pub pressure_pa: f64,
    /// Time constant, s, above 0.
    pub time_constant_s: f64,
}

impl Default for AxisFaults {
    fn default() -> Self {
        AxisFaults {
            valve: ValveFault::default(),
            friction_factor: 1.0,
            added_mass_kg: 0.0,
            leakage_m3_per_s: [0.0; 2],
            burst_kv_m3_per_h: [0.0; 2],
        }
    }
}

impl AxisFaults {
    /// Whether it changes a law of air or friction, which the baseline's step does not know.
    pub(crate) fn changes_laws(&self) -> bool {
        self.friction_factor != 1.0 || self.outlets().iter().any(Outlet::is_open)
    }

    /// Ways out of chambers a and b.
    pub(crate) fn outlets(&self) -> [Outlet; 2] {
        [0, 1].map(|chamber| Outlet::new(self.leakage_m3_per_s[chamber], self.burst_kv_m3_per_h[chamber]))
    }
}

/// Active valve faults, and the command that a slow valve has reached.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ActiveValveFaults {
    faults: [ValveFault; 2],
    /// Whether any valve is faulty.
    pub(crate) any: bool,
    arrived: [f64; 2],
}

impl ActiveValveFaults {
    /// Takes faults over; a valve that was quick so far starts from its spool.
    pub(crate) fn set(&mut self, faults: &Faults, spools: [f64; 2]) {
        let was_slow = self.faults.map(|fault| fault.lag_s > 0.0);
        self.faults = [0, 1].map(|axis: usize| faults.axes[axis].valve);
        self.any = self.faults.iter().any(|fault| *fault != ValveFault::default());
        for axis in (0..2).filter(|axis| !was_slow[*axis]) {
            self.arrived[axis] = spools[axis];
        }
    }

    /// Commands that reach the spools over a period, and which spools do not move.
    #[cold]
    pub(crate) fn pass(&mut self, commands: [f64; 2], spools: [f64; 2]) -> ([f64; 2], [bool; 2]) {
        let mut pass = |axis: usize| {
            let fault = &self.faults[axis];
            self.arrived[axis] = fault.arrive(self.arrived[axis], commands[axis]);
            fault.pass(self.arrived[axis], spools[axis])
        };
        ([pass(0), pass(1)], self.faults.map(|fault| fault.stuck))
    }
}

impl Plant {
    /// Whether the piston of an axis stands at an end of its stroke.
    #[must_use]
    pub fn at_an_end(&self, axis: crate::Axis) -> bool {
        let extension_m = self.state().axis(axis).extension_m;
        extension_m <= 0.0 || extension_m >= self.rig().cylinder().stroke_m
    }
}
