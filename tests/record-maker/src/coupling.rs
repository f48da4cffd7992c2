//! Contact between the rod eye of the load and the carriage in the record maker.
//!
//! ```text
//!   F_c = k e + c dd/dt beyond the gap, clamped so that the contact never pulls; d = x_load - x_drive
//! ```

use super::Form;

/// Gap and contact, SI; changed parameters are already in the numbers.
#[derive(Debug, Clone)]
pub(super) struct Coupling {
    pub(super) gap_m: f64,
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_n_s_per_m: f64,
    /// The gap's edges are rounded.
    pub(super) worn: bool,
    /// The contact stiffens with its load.
    pub(super) hertz: bool,
    pub(super) form: Form,
}

/// Half-width of a worn edge as a share of the gap, for the three forms.
const WORN: [f64; 3] = [0.0, 0.05, 0.5];
/// Force at which all forms of the contact have the same deflection, N, and the exponents of the forms.
const AGREES_N: f64 = 200.0;
const HERTZ: [f64; 3] = [1.0, 1.15, 1.5];

impl Coupling {
    /// F_c, N, positive in +x on the carriage.
    #[inline(always)]
    pub(super) fn force(&self, distance_m: f64, speed_m_per_s: f64) -> f64 {
        let over = distance_m.abs() - self.gap_m / 2.0;
        let width = if self.worn { self.form.of(WORN) * self.gap_m } else { 0.0 };
        let overlap = if over <= -width {
            return 0.0;
        } else if over < width {
            (over + width) * (over + width) / (4.0 * width)
        } else {
            over
        };
        let elastic = if self.hertz {
            AGREES_N * libm::pow(overlap * self.stiffness_n_per_m / AGREES_N, self.form.of(HERTZ))
        } else {
            self.stiffness_n_per_m * overlap
        };
        let side = distance_m.signum();
        side * (elastic + self.damping_n_s_per_m * side * speed_m_per_s).max(0.0)
    }
}
