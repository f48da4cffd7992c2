//! The sensors: what the electronics make of the true values, once per millisecond.
//!
//! ```text
//! counts = round((true value + offset + noise) / step)    clipped to the range, value = counts * step
//! ```
//!
//! The noise is Gaussian by Box and Muller's transform on a seeded PCG-64, with libm's functions, and is always drawn in
//! the same order (drive then load; position, force, pressure a, pressure b), so a run is the same to the bit on
//! every machine and a reading does not depend on which others are looked at. A noise of 0 still draws.
//!
//! Source: rig-model.md, Sensors. Box, Muller 1958, Ann. Math. Stat. 29(2), eq. 1.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use crate::faults::{SensorFault, SensorFaults};
use crate::parameters::{RigParameters, SensorParameters};
use crate::plant::Plant;
use crate::state::Inputs;

/// The sensors of both axes with the state of their noise.
#[derive(Debug, Clone)]
pub struct Sensors {
    parameters: SensorParameters,
    noise: Pcg64,
    faults: SensorFaults,
}

/// One sample of one sensor, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Rounded to the sensor's step and clipped to its range.
    pub value: f64,
    /// Whether the value was clipped.
    pub saturated: bool,
}

/// One sample of the sensors of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisReadings {
    /// Rig coordinate of the carriage or of the load's eye, m.
    pub position: Reading,
    /// Force between rod and carriage, N, compression positive.
    pub force: Reading,
    /// Absolute pressure of chamber a, Pa.
    pub pressure_a: Reading,
    /// Absolute pressure of chamber b, Pa.
    pub pressure_b: Reading,
}

impl Sensors {
    /// Sensors of this rig whose noise is given by the seed.
    pub fn new(rig: &RigParameters, seed: u64) -> Self {
        let faults = SensorFaults::new(0);
        Sensors { parameters: *rig.sensors(), noise: Pcg64::seed_from_u64(seed), faults }
    }

    /// Gives the seed of what is random in faults; 0 without this.
    pub fn seed_faults(&mut self, seed: u64) {
        self.faults = SensorFaults::new(seed);
    }

    /// What is broken in the sensors from the next sample on: of drive and load; position, force, pressure a, pressure b.
    pub fn set_faults(&mut self, faults: &[[SensorFault; 4]; 2]) {
        self.faults.set(faults);
    }

    /// Samples all sensors at this instant, drive and load; to be taken before the period's step.
    pub fn sample(&mut self, plant: &Plant, inputs: &Inputs) -> [AxisReadings; 2] {
        let shown = plant.noise_free_readings(&plant.truth(inputs));
        let parameters = self.parameters;
        let offsets_m = [0.0, parameters.load_position_offset_m];
        std::array::from_fn(|i| {
            let [position_m, force_n, a_pa, b_pa] = shown[i];
            let [position, force] = gaussian_pair(&mut self.noise);
            let [pressure_a, pressure_b] = gaussian_pair(&mut self.noise);
            let mut position_m = position_m + offsets_m[i] + parameters.position_noise_m * position;
            let mut force_n = force_n + parameters.force_noise_n * force;
            let mut a_pa = a_pa + parameters.pressure_noise_pa * pressure_a;
            let mut b_pa = b_pa + parameters.pressure_noise_pa * pressure_b;
            if self.faults.any {
                let values = [&mut position_m, &mut force_n, &mut a_pa, &mut b_pa];
                values.into_iter().enumerate().for_each(|(channel, value)| {
                    *value = self.faults.disturb(i, channel, *value);
                });
            }
            let pressure =
                |pa| quantise(pa, parameters.pressure_step_pa(), 0.0, parameters.pressure_counts());
            let most_force = parameters.force_counts();
            let mut readings = AxisReadings {
                position: quantise(
                    position_m,
                    parameters.position_step_m(),
                    0.0,
                    parameters.position_counts(),
                ),
                force: quantise(force_n, parameters.force_step_n(), -most_force, most_force),
                pressure_a: pressure(a_pa),
                pressure_b: pressure(b_pa),
            };
            if self.faults.any {
                let least_n = -most_force * parameters.force_step_n();
                let AxisReadings { position, force, pressure_a, pressure_b } = &mut readings;
                let shown = [(position, 0.0), (force, least_n), (pressure_a, 0.0), (pressure_b, 0.0)];
                shown.into_iter().enumerate().for_each(|(channel, (reading, least))| {
                    *reading = self.faults.show(i, channel, *reading, least);
                });
            }
            readings
        })
    }
}

/// Two independent numbers of mean 0 and variance 1 [Box, Muller 1958, eq. 1].
pub(crate) fn gaussian_pair(noise: &mut Pcg64) -> [f64; 2] {
    // 53 random bits: (0, 1] for the logarithm, [0, 1) for the angle.
    const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
    let never_zero = ((noise.next_u64() >> 11) + 1) as f64 * STEP;
    let turn = (noise.next_u64() >> 11) as f64 * STEP;
    let radius = (-2.0 * libm::log(never_zero)).sqrt();
    let (sine, cosine) = libm::sincos(std::f64::consts::TAU * turn);
    [radius * cosine, radius * sine]
}

/// Nearest step within the range of counts; a clipped value says so.
fn quantise(value: f64, step: f64, least: f64, most: f64) -> Reading {
    let counts = (value / step).round();
    let clipped = counts.clamp(least, most);
    Reading { value: clipped * step, saturated: clipped != counts }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_rounded_to_the_nearest_step() {
        let step = 0.5 / 65535.0;
        assert_eq!(
            quantise(100.4 * step, step, 0.0, 65535.0),
            Reading { value: 100.0 * step, saturated: false }
        );
        assert_eq!(
            quantise(100.6 * step, step, 0.0, 65535.0),
            Reading { value: 101.0 * step, saturated: false }
        );
    }

    #[test]
    fn a_value_beyond_the_range_is_clipped_and_flagged() {
        let step = 2000.0 / 32767.0;
        let read = |force| quantise(force, step, -32767.0, 32767.0);
        assert_eq!(read(2000.0), Reading { value: 32767.0 * step, saturated: false });
        assert_eq!(read(2001.0), Reading { value: 32767.0 * step, saturated: true });
        assert_eq!(read(-1e9), Reading { value: -32767.0 * step, saturated: true });
    }

    #[test]
    fn the_noise_is_gaussian() {
        let mut sensors = Sensors::new(&RigParameters::baseline(), 7);
        let draws: Vec<f64> = (0..100_000).flat_map(|_| gaussian_pair(&mut sensors.noise)).collect();
        let moment = |power| draws.iter().map(|x: &f64| x.powi(power)).sum::<f64>() / draws.len() as f64;
        // Standard errors of the moments of 2e5 draws: 0.0022, 0.0032, 0.0087, 0.022; five of each.
        assert!(moment(1).abs() < 0.011, "{}", moment(1));
        assert!((moment(2) - 1.0).abs() < 0.016, "{}", moment(2));
        assert!(moment(3).abs() < 0.044, "{}", moment(3));
        assert!((moment(4) - 3.0).abs() < 0.11, "{}", moment(4));
        let product = draws.chunks(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / 1e5;
        assert!(product.abs() < 0.016, "the two of a pair are independent: {product}");
    }
}
