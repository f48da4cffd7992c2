//! What the load's eye and the carriage pass to each other in the record maker.
//!
//! ```text
//!   F_c = k e + c dd/dt beyond the gap, never pulling against its contact; d = x_load - x_drive
//! ```

/// Gap and contact, SI; what of it differs from the file is already in the numbers.
#[derive(Debug, Clone)]
pub(super) struct Coupling {
    pub(super) gap_m: f64,
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_n_s_per_m: f64,
    /// The gap's edges are rounded.
    pub(super) worn: bool,
    /// The contact stiffens with its load.
    pub(super) hertz: bool,
}

/// Width of a worn edge, of the gap.
const WORN: f64 = 0.05;
/// Force at which both forms of the contact agree, N, and the exponent of the foreign one.
const AGREES_N: f64 = 200.0;
const HERTZ: f64 = 1.15;

impl Coupling {
    /// F_c, N, positive in +x on the carriage.
    #[inline(always)]
    pub(super) fn force(&self, distance_m: f64, speed_m_per_s: f64) -> f64 {
        let over = distance_m.abs() - self.gap_m / 2.0;
        let width = if self.worn { WORN * self.gap_m } else { 0.0 };
        let overlap = if over <= -width {
            return 0.0;
        } else if over < width {
            (over + width) * (over + width) / (4.0 * width)
        } else {
            over
        };
        let elastic = if self.hertz {
            AGREES_N * libm::pow(overlap * self.stiffness_n_per_m / AGREES_N, HERTZ)
        } else {
            self.stiffness_n_per_m * overlap
        };
        let side = distance_m.signum();
        side * (elastic + self.damping_n_s_per_m * side * speed_m_per_s).max(0.0)
    }
}
