//! Post-controller: from the wanted rod velocity to a valve opening, with everything that limits it.
//!
//! ```text
//!   wanted velocity ──► dead zone ──► linearisation ──► limit ──► opening        manual mode overrides all of it
//! ```
//!
//! The dead zone shuts the valve for wanted velocities below it and opens it again from one and a half times of it on, so
//! that noise at its edge does not let the valve chatter.

use algorithms::algorithm::AlgorithmInput;
use algorithms::linearisation::Linearisation;
use settings::parameters::declare;

settings::parameters! {
    /// Period, limit, dead zone and manual mode of the post-controller.
    pub struct Parameters {
        every_cycles: crate::program::EVERY_CYCLES,
        opening_limit: declare("", [0.0, 1.0], 1.0, "largest opening in either direction"),
        dead_zone_m_per_s: declare("m/s", [0.0, 0.1], 0.0, "wanted velocities below it shut the valve"),
        manual: declare("", [0.0, 1.0], 0.0, "from 0.5 on, manual mode: manual_opening instead of the algorithm"),
        manual_opening: declare("", [-1.0, 1.0], 0.0, "opening in manual mode"),
    }
}

/// Share of the dead zone by which the wanted velocity must exceed it to open the valve again.
const HYSTERESIS: f64 = 0.5;

/// Result of a step; the default is a shut valve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// Opening of the valve, -1 to 1; above 0 the axis's rod extends.
    pub opening: f64,
    /// The rod velocity that it stands for, m/s.
    pub(crate) applied_velocity_m_per_s: f64,
}

/// Task that turns a wanted velocity into an opening, with the state of its dead zone.
#[derive(Clone, Debug)]
pub(crate) struct PostController {
    linearisation: Linearisation,
    shut: bool,
}

impl PostController {
    /// A task whose dead zone holds the valve shut.
    pub(crate) fn new(linearisation: Linearisation) -> Self {
        Self { linearisation, shut: true }
    }

    /// Forgets what it did, as after [`PostController::new`].
    pub(crate) fn restart(&mut self) {
        self.shut = true;
    }

    /// Turns a finite wanted velocity into an opening.
    pub(crate) fn step(
        &mut self,
        wanted_m_per_s: f64,
        input: &AlgorithmInput,
        parameters: &Parameters,
    ) -> Output {
        if parameters.manual >= 0.5 {
            return self.output(parameters.manual_opening, input);
        }
        let dead_zone = parameters.dead_zone_m_per_s * if self.shut { 1.0 + HYSTERESIS } else { 1.0 };
        self.shut = wanted_m_per_s.abs() < dead_zone;
        if self.shut {
            return Output::default();
        }
        let limit = parameters.opening_limit;
        let opening = self.linearisation.opening(wanted_m_per_s, input);
        if opening.abs() <= limit {
            let most = self.linearisation.velocity(opening, input).abs();
            return Output { opening, applied_velocity_m_per_s: wanted_m_per_s.clamp(-most, most) };
        }
        self.output(opening.clamp(-limit, limit), input)
    }

    fn output(&self, opening: f64, input: &AlgorithmInput) -> Output {
        Output { opening, applied_velocity_m_per_s: self.linearisation.velocity(opening, input) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use algorithms::linearisation::Law;
    use nominal::RigParameters;
    use proptest::prelude::*;

    fn post() -> PostController {
        PostController::new(Linearisation::new(&RigParameters::baseline(), Law::ChokedExhaust))
    }

    #[test]
    fn the_dead_zone_shuts_and_opens_with_hysteresis() {
        let mut post = post();
        let parameters = Parameters { dead_zone_m_per_s: 0.01, ..Parameters::default() };
        for (wanted, open) in
            [(0.009, false), (0.014, false), (0.016, true), (0.011, true), (0.009, false), (0.011, false)]
        {
            assert_eq!(
                post.step(wanted, &AlgorithmInput::default(), &parameters).opening != 0.0,
                open,
                "{wanted}"
            );
        }
    }

    #[test]
    fn manual_mode_overrides() {
        let parameters = Parameters { manual: 1.0, manual_opening: 0.25, ..Parameters::default() };
        let output = post().step(-3.0, &AlgorithmInput::default(), &parameters);
        assert!(output.opening == 0.25 && output.applied_velocity_m_per_s > 0.0);
    }

    proptest! {
        #[test]
        fn the_opening_keeps_its_limit_and_what_is_applied_never_exceeds_what_was_wanted(
            wanted in -20.0..20.0_f64, limit in 0.0..1.0_f64, dead_zone in 0.0..0.1_f64,
        ) {
            let parameters =
                Parameters { opening_limit: limit, dead_zone_m_per_s: dead_zone, ..Parameters::default() };
            let output = post().step(wanted, &AlgorithmInput::default(), &parameters);
            prop_assert!(output.opening.abs() <= limit);
            prop_assert!(output.applied_velocity_m_per_s.abs() <= wanted.abs() + 1e-12);
            prop_assert!(output.opening * wanted >= 0.0);
        }
    }
}
