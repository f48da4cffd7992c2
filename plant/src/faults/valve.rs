//! A faulty valve: what becomes of a command on its way to the spool, once a period.
//!
//! ```text
//! c' = c + (u - c) (1 - e^(-T/tau))        slow: a lag before the spool's own, tau = 0 passes u
//! u' = clamp(c' + offset, -limit, limit)
//! u' = 0 when dead                         the springs centre the spool
//! u' = s when stuck                        and the spool does not move
//! ```
//!
//! u the command that acts, -1 to 1 (0 during an emergency stop); c what has arrived; s the spool; T = 1 ms. A stuck valve
//! heeds no emergency stop: the supply does. Valid for any command; smooth but for the clamps.
//!
//! Properties: the default passes every command to the bit; a stuck spool stays; nothing leaves [-1, 1].
//!
//! Source: first-order lag and limits of proportional valves, Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7.

use crate::integrator::PERIOD_S;

/// What is broken in a valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveFault {
    /// The spool stays where it is.
    pub stuck: bool,
    /// No command reaches the spool, which its springs centre.
    pub dead: bool,
    /// Added to the command, opening, -1 to 1.
    pub offset: f64,
    /// Most opening to either side, 0 to 1.
    pub limit: f64,
    /// Time constant of a further lag, s; 0 for none.
    pub lag_s: f64,
}

impl Default for ValveFault {
    fn default() -> Self {
        ValveFault { stuck: false, dead: false, offset: 0.0, limit: 1.0, lag_s: 0.0 }
    }
}

impl ValveFault {
    /// What has arrived a period after `arrived`, with the command held.
    pub(super) fn arrive(&self, arrived: f64, command: f64) -> f64 {
        if self.lag_s > 0.0 {
            arrived + (command - arrived) * -libm::expm1(-PERIOD_S / self.lag_s)
        } else {
            command
        }
    }

    /// What the spool is sent to, given what has arrived.
    pub(super) fn pass(&self, arrived: f64, spool: f64) -> f64 {
        if self.stuck {
            spool
        } else if self.dead {
            0.0
        } else {
            (arrived + self.offset).clamp(-self.limit, self.limit)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_slow_valve_is_short_by_one_e_th_after_its_time_constant() {
        let fault = ValveFault { lag_s: 0.05, ..ValveFault::default() };
        let arrived = (0..50).fold(0.0, |arrived, _| fault.arrive(arrived, 1.0));
        // Fifty exact steps of a lag: fifty roundings.
        assert!((arrived - (1.0 - (-1.0_f64).exp())).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn no_fault_passes_every_command_and_none_leaves_the_range(
            command in -1.0..=1.0_f64,
            spool in -1.0..=1.0_f64,
            offset in -1.0..=1.0_f64,
            limit in 0.0..=1.0_f64,
        ) {
            let sound = ValveFault::default();
            prop_assert_eq!(sound.pass(sound.arrive(spool, command), spool).to_bits(), command.to_bits());
            let faulty = ValveFault { offset, limit, ..sound };
            prop_assert!(faulty.pass(command, spool).abs() <= limit);
            prop_assert_eq!(ValveFault { stuck: true, ..faulty }.pass(command, spool), spool);
            prop_assert_eq!(ValveFault { dead: true, ..faulty }.pass(command, spool), 0.0);
        }
    }
}
