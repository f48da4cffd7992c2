//! The linkage: what the load's eye and the carriage pass to each other across the gap.
//!
//! ```text
//! d = x_load - x_drive                      e = d -+ gap/2 outside the gap, 0 inside
//! F_c = k e + c dd/dt, never pulling against its contact        [rig-model.md, Masses and linkage]
//! ```
//!
//! F_c acts on the carriage in +x and on the load rod in -x: on both pistons in the direction of their own extension.
//!
//! The contact is the stiffest mode of the rig (210 Hz with both axes sliding), so a step solves it implicitly. With the
//! midpoint rule, `r = k h/2 + c` and the mobility Y (speed gained by half a step per newton, both axes together):
//!
//! ```text
//! F = k (e + h/2 w) + c w       w = w_free - Y F        =>       F = (k e + r w_free) / (1 + r Y)
//! ```
//!
//! where w is the relative speed at the midpoint. A sticking axis adds nothing to Y.

use crate::effects;
use crate::lanes::Form;
use crate::parameters::RigParameters;

/// Gap and contact.
#[derive(Debug, Clone)]
pub(crate) struct Linkage {
    pub(crate) half_gap_m: f64,
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
}

/// Relative position and motion of the two rods in a step, and their response to a contact force.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ContactKinematics {
    /// d, m.
    pub(crate) distance_m: f64,
    /// dd/dt at the step's midpoint without contact, m/s.
    pub(crate) free_speed_m_per_s: f64,
    /// Relative speed lost by half a step of 1 N, m/(s N).
    pub(crate) mobility: f64,
    /// Half the step, s.
    pub(crate) half_span_s: f64,
}

impl Linkage {
    /// The linkage of a rig, with the numbers that its effects put in place of the file's.
    pub(crate) fn of(rig: &RigParameters) -> Self {
        let parameters = effects::linkage(rig);
        Linkage {
            half_gap_m: parameters.gap_m / 2.0,
            stiffness_n_per_m: parameters.stiffness_n_per_m,
            damping_n_s_per_m: parameters.damping_n_s_per_m,
        }
    }

    #[inline(always)]
    pub(crate) fn formed<P>(&self, form: &mut impl Form<P>) -> Self {
        Linkage {
            half_gap_m: form.one(self.half_gap_m),
            stiffness_n_per_m: form.one(self.stiffness_n_per_m),
            damping_n_s_per_m: form.one(self.damping_n_s_per_m),
        }
    }

    /// Whether the eye lies in the gap, so that it can be linked.
    pub(crate) fn in_gap(&self, distance_m: f64) -> bool {
        distance_m.abs() <= self.half_gap_m
    }

    /// e: how far beyond the gap, m, with the side as its sign; 0 inside.
    #[inline(always)]
    pub(crate) fn overlap(&self, distance_m: f64) -> f64 {
        distance_m - distance_m.max(-self.half_gap_m).min(self.half_gap_m)
    }

    /// F_c at an instant, N.
    pub(crate) fn force(&self, distance_m: f64, speed_m_per_s: f64) -> f64 {
        let overlap = self.overlap(distance_m);
        if overlap == 0.0 {
            return 0.0;
        }
        pushing(overlap, self.stiffness_n_per_m * overlap + self.damping_n_s_per_m * speed_m_per_s)
    }

    /// F_c at the midpoint of a step that starts in contact, N; 0 if it starts in the gap.
    #[inline(always)]
    pub(crate) fn midpoint_force(&self, kinematics: ContactKinematics) -> f64 {
        let overlap = self.overlap(kinematics.distance_m);
        if overlap == 0.0 {
            return 0.0;
        }
        let reach = self.stiffness_n_per_m * kinematics.half_span_s + self.damping_n_s_per_m;
        let free = self.stiffness_n_per_m * overlap + reach * kinematics.free_speed_m_per_s;
        pushing(overlap, free / (1.0 + reach * kinematics.mobility))
    }

    /// Mean F_c over a step that starts in the gap and may make contact before its end, N.
    ///
    /// The contact lasts for the share of the step that is left when the free motion reaches the gap's edge.
    pub(crate) fn closing_force(&self, kinematics: ContactKinematics) -> f64 {
        let span_s = 2.0 * kinematics.half_span_s;
        let beyond = self.overlap(kinematics.distance_m + span_s * kinematics.free_speed_m_per_s);
        if beyond == 0.0 {
            return 0.0;
        }
        let share = (beyond / (span_s * kinematics.free_speed_m_per_s)).min(1.0);
        let reach = self.stiffness_n_per_m * share * kinematics.half_span_s + self.damping_n_s_per_m;
        share * reach * kinematics.free_speed_m_per_s / (1.0 + share * share * reach * kinematics.mobility)
    }

    /// Whether a step from one distance to another made contact, on the other side too.
    #[inline(always)]
    pub(crate) fn made_contact(&self, before_m: f64, after_m: f64) -> bool {
        let after = self.overlap(after_m);
        after != 0.0 && self.overlap(before_m) * after <= 0.0
    }
}

/// The force where it pushes the two apart, 0 where it would pull them together.
#[inline(always)]
fn pushing(overlap: f64, force: f64) -> f64 {
    if overlap * force > 0.0 { force } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linkage() -> Linkage {
        Linkage::of(&RigParameters::baseline())
    }

    #[test]
    fn the_gap_is_free_to_each_side() {
        for distance_m in [0.0, 1e-4, -1e-4, 0.99e-4] {
            assert_eq!(linkage().force(distance_m, 0.3), 0.0);
        }
        assert!(linkage().in_gap(1e-4) && !linkage().in_gap(1.0001e-4));
    }

    #[test]
    fn contact_is_a_spring_and_a_damper_beyond_the_gap() {
        // 10 um beyond: 20 N; closing at 1 mm/s: 2 N more. Two roundings of 22.
        assert!((linkage().force(1.1e-4, 1e-3) - 22.0).abs() < 1e-9);
        assert!((linkage().force(-1.1e-4, -1e-3) + 22.0).abs() < 1e-9);
    }

    #[test]
    fn contact_never_pulls() {
        assert_eq!(linkage().force(1.1e-4, -1.0), 0.0);
        assert_eq!(linkage().force(-1.1e-4, 1.0), 0.0);
        let parting = ContactKinematics {
            distance_m: 1.1e-4,
            free_speed_m_per_s: -1.0,
            mobility: 1e-5,
            half_span_s: 5e-5,
        };
        assert_eq!(linkage().midpoint_force(parting), 0.0);
    }

    #[test]
    fn the_midpoint_force_satisfies_its_own_equation() {
        let kinematics = ContactKinematics {
            distance_m: -1.2e-4,
            free_speed_m_per_s: -0.05,
            mobility: 4e-5,
            half_span_s: 5e-5,
        };
        let force = linkage().midpoint_force(kinematics);
        let speed = kinematics.free_speed_m_per_s - kinematics.mobility * force;
        let implied = 2e6 * (-0.2e-4 + kinematics.half_span_s * speed) + 2e3 * speed;
        // Sums of some hundred newton, few roundings.
        assert!((implied - force).abs() < 1e-9, "{implied} {force}");
    }

    #[test]
    fn closing_in_the_last_instant_of_a_step_is_felt_for_that_instant() {
        let speed = 0.1;
        let at = |distance_m| {
            let kinematics =
                ContactKinematics { distance_m, free_speed_m_per_s: speed, mobility: 0.0, half_span_s: 5e-6 };
            linkage().closing_force(kinematics)
        };
        assert_eq!(at(0.98e-4), 0.0, "2 um are more than 10 us at 0.1 m/s");
        // Half of the step in contact: half of 200 N, and 0.25 um of mean overlap for half of the time.
        assert!((at(1e-4 - 0.5e-6) - (100.0 + 0.25)).abs() < 1e-6);
    }
}
