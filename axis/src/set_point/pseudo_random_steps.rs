//! Pseudo-random steps: every hold_s at once to one of some levels around where the row stands, and back there at the end.
//!
//! ```text
//!   x_k = x_0 - A + 2 A n_k / (N - 1)      n_k uniform in 0 ... N - 1, from the generator PCG XSL RR 128/64 of the seed
//! ```
//!
//! A: amplitude_m or amplitude_n. N: levels, 2 for a binary signal. The same seed gives the same steps on every machine.
//!
//! Source: O'Neill, PCG, 2014 (generator).

use super::law::{BOTH, Extent, Kind, Law, ProfilePoint, SegmentReader};
use super::step::JUMP_S;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use settings::SettingsError;
use settings::parameters::Parameter;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    name: "pseudo-random-steps",
    about: "every now and then at once to a random level, the same ones for the same seed",
    serves: BOTH,
    read,
};

static HOLD: Parameter = Parameter::new(("hold_s", "s"), [0.001, 3600.0], 0.1, "time between two steps");
static SEED: Parameter = Parameter::new(("seed", ""), [0.0, 4_294_967_295.0], 1.0, "which steps").whole();
static LEVELS: Parameter =
    Parameter::new(("levels", ""), [2.0, 64.0], 2.0, "how many levels there are").whole();
/// Steps that a segment may have; they are drawn when it is read.
const MOST_STEPS: f64 = 1e6;

fn read(reader: &mut SegmentReader<'_, '_>) -> Result<Arc<dyn Law>, SettingsError> {
    let amplitude = reader.amplitude()?;
    let hold_s = reader.number(&HOLD)?;
    let duration_s = reader.duration_s(0.001)?;
    let seed = reader.section.whole_or_default(&SEED)?;
    let levels = reader.section.whole_or_default(&LEVELS)?;
    if duration_s / hold_s > MOST_STEPS {
        let message = format!("hold_s = {hold_s} s; allowed are at most {MOST_STEPS} steps in duration_s");
        return Err(reader.section.wrong_at("hold_s", &message));
    }
    let around = [reader.from, amplitude];
    Ok(Arc::new(PseudoRandomSteps::new(around, [hold_s, duration_s], seed.into(), levels)))
}

#[derive(Debug)]
struct PseudoRandomSteps {
    from: f64,
    amplitude: f64,
    hold_s: f64,
    duration_s: f64,
    values: Box<[f64]>,
}

impl PseudoRandomSteps {
    /// Steps around a value by an amplitude, each held for a time until the duration is over.
    fn new([from, amplitude]: [f64; 2], [hold_s, duration_s]: [f64; 2], seed: u64, levels: u32) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let count = (duration_s / hold_s).ceil().max(1.0) as usize;
        let mut draw = || {
            let level = (u64::from(random.next_u32()) * u64::from(levels)) >> 32;
            from + amplitude * (2.0 * level as f64 / f64::from(levels - 1) - 1.0)
        };
        let values = (0..count).map(|_| draw()).collect();
        Self { from, amplitude, hold_s, duration_s, values }
    }
}

impl Law for PseudoRandomSteps {
    fn at(&self, time_s: f64) -> ProfilePoint {
        // A nanosecond early, as a row does, so that a step never misses its cycle.
        let index = ((time_s + 1e-9) / self.hold_s).floor().max(0.0);
        let since_s = time_s - index * self.hold_s;
        let index = (index as usize).min(self.values.len() - 1);
        let before = if index == 0 { self.from } else { self.values[index - 1] };
        let value = self.values[index];
        ProfilePoint { moving: since_s < JUMP_S && value != before, ..ProfilePoint::at_rest(value) }
    }

    fn extent(&self) -> Extent {
        Extent::around(self.from, self.amplitude, self.duration_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(seed: u64, levels: u32) -> PseudoRandomSteps {
        PseudoRandomSteps::new([0.25, 0.1], [0.05, 50.0], seed, levels)
    }

    #[test]
    fn the_same_seed_gives_the_same_steps_and_another_seed_others() {
        assert_eq!(steps(7, 5).values, steps(7, 5).values);
        assert_ne!(steps(7, 5).values, steps(8, 5).values);
    }

    #[test]
    fn the_first_steps_are_those_of_every_machine() {
        let values: Vec<f64> = (0..8).map(|index| steps(1, 2).at(0.05 * f64::from(index)).value).collect();
        let high: Vec<bool> = values.iter().map(|value| *value > 0.25).collect();
        // As drawn when this was written: recorded experiments depend on it.
        assert_eq!(high, [false, true, false, true, true, false, true, false]);
    }

    #[test]
    fn every_level_comes_as_often_as_the_others() {
        let steps = steps(3, 5);
        for level in 0..5 {
            let value = 0.15 + 0.05 * f64::from(level);
            let count = steps.values.iter().filter(|drawn| (*drawn - value).abs() < 1e-12).count();
            // 1000 draws of 1 in 5: mean 200, standard deviation 13; five of them.
            assert!((135..=265).contains(&count), "{value}: {count}");
        }
    }

    #[test]
    fn a_step_moves_for_one_cycle() {
        let steps = steps(3, 64);
        let moving = (0..500).filter(|cycle| steps.at(f64::from(*cycle) * 1e-3).moving).count();
        assert_eq!(moving, 10);
    }
}
