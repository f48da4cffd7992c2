//! A faulty sensor: what its electronics make of the value that they would have shown.
//!
//! ```text
//! y = gain x + offset + drift t + noise n + spike (every so many samples)      then to the nearest multiple of `step`
//! rounded and clipped as the sound sensor is; then
//! stuck: the reading of the sample in which it stuck      dropout: the low end of the range, flagged as saturated
//! ```
//!
//! x value before the sensor's own rounding, in SI; t since the drift began, s; n Gaussian of variance 1, from a generator
//! of its own, so that the sound sensors' noise is the same with and without. A dropout is drawn for each sample.
//!
//! Properties: the default changes nothing, and draws nothing; a stuck reading stays to the bit.
//!
//! Source: additive and multiplicative sensor faults, Isermann, Fault-Diagnosis Systems, 2006, ch. 7, DOI
//! 10.1007/3-540-30368-5; a wire break as the low end of a range: NAMUR NE 43.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use crate::sensors::{Reading, gaussian_pair};

/// Samples in a second.
const SAMPLES_PER_S: f64 = 1000.0;

/// What is broken in one sensor, in its own unit (m, N, Pa).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFault {
    /// Every sample shows what the first one did.
    pub stuck: bool,
    /// Factor on the value.
    pub gain: f64,
    /// Added.
    pub offset: f64,
    /// Added for each second that it lasts.
    pub drift_per_s: f64,
    /// Standard deviation of noise on top.
    pub noise: f64,
    /// Added to single samples.
    pub spike: f64,
    /// Samples from one spike to the next, from 1 on.
    pub spike_every: u32,
    /// Probability that a sample shows the low end of the range, 0 to 1.
    pub dropout: f64,
    /// Step of a coarser rounding; 0 for none.
    pub step: f64,
}

impl Default for SensorFault {
    fn default() -> Self {
        SensorFault {
            stuck: false,
            gain: 1.0,
            offset: 0.0,
            drift_per_s: 0.0,
            noise: 0.0,
            spike: 0.0,
            spike_every: 1,
            dropout: 0.0,
            step: 0.0,
        }
    }
}

/// One sensor's fault in its state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct SensorFaultState {
    fault: SensorFault,
    drifted: f64,
    since_spike: u32,
    held: Option<Reading>,
}

/// Faults of all sensors: drive and load; position, force, pressure a, pressure b.
#[derive(Debug, Clone)]
pub(crate) struct SensorFaults {
    /// Whether any sensor is faulty.
    pub(crate) any: bool,
    fault_states: [[SensorFaultState; 4]; 2],
    noise: Pcg64,
}

impl SensorFaults {
    /// None; what is random in later ones is given by the seed.
    pub(crate) fn new(seed: u64) -> Self {
        SensorFaults { any: false, fault_states: Default::default(), noise: Pcg64::seed_from_u64(seed) }
    }

    /// Takes faults over; one that goes on keeps its state.
    pub(crate) fn set(&mut self, faults: &[[SensorFault; 4]; 2]) {
        self.any = *faults != <[[SensorFault; 4]; 2]>::default();
        for (fault_states, faults) in self.fault_states.iter_mut().zip(faults) {
            for (state, fault) in fault_states.iter_mut().zip(faults) {
                state.fault = *fault;
                if fault.drift_per_s == 0.0 {
                    state.drifted = 0.0;
                }
                if fault.spike == 0.0 {
                    state.since_spike = 0;
                }
                if !fault.stuck {
                    state.held = None;
                }
            }
        }
    }

    /// The value that a sensor rounds.
    #[cold]
    pub(crate) fn disturb(&mut self, axis: usize, channel: usize, value: f64) -> f64 {
        let SensorFaultState { fault, drifted, since_spike, .. } = &mut self.fault_states[axis][channel];
        let mut value = fault.gain * value + fault.offset + *drifted;
        *drifted += fault.drift_per_s / SAMPLES_PER_S;
        if fault.noise > 0.0 {
            value += fault.noise * gaussian_pair(&mut self.noise)[0];
        }
        if fault.spike != 0.0 {
            if *since_spike == 0 {
                value += fault.spike;
            }
            *since_spike = (*since_spike + 1) % fault.spike_every.max(1);
        }
        if fault.step > 0.0 { (value / fault.step).round() * fault.step } else { value }
    }

    /// What a sensor shows in the end, given its rounded reading and the low end of its range.
    #[cold]
    pub(crate) fn show(&mut self, axis: usize, channel: usize, reading: Reading, least: f64) -> Reading {
        let SensorFaultState { fault, held, .. } = &mut self.fault_states[axis][channel];
        let reading = if fault.stuck { *held.get_or_insert(reading) } else { reading };
        if fault.dropout > 0.0 {
            // 53 random bits in [0, 1): a probability of 1 is always met.
            let drawn = (self.noise.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            if drawn < fault.dropout {
                return Reading { value: least, saturated: true };
            }
        }
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(fault: SensorFault) -> SensorFaults {
        let mut faults = SensorFaults::new(3);
        let mut all = <[[SensorFault; 4]; 2]>::default();
        all[1][2] = fault;
        faults.set(&all);
        assert!(faults.any);
        faults
    }

    #[test]
    fn the_default_changes_nothing() {
        let mut faults = SensorFaults::new(3);
        assert!(!faults.any);
        assert_eq!(faults.disturb(1, 2, 0.1).to_bits(), 0.1_f64.to_bits());
        let reading = Reading { value: 0.1, saturated: false };
        assert_eq!(faults.show(1, 2, reading, 0.0), reading);
    }

    #[test]
    fn each_number_has_its_own_effect_and_other_sensors_have_none() {
        let sound = SensorFault::default();
        let shown = |fault: SensorFault| {
            let mut faults = with(fault);
            [0, 1, 2, 3].map(|_| faults.disturb(1, 2, 2.0))
        };
        assert_eq!(shown(SensorFault { gain: 1.5, offset: -1.0, ..sound }), [2.0; 4]);
        assert_eq!(shown(SensorFault { gain: 0.5, ..sound }), [1.0; 4]);
        assert_eq!(shown(SensorFault { spike: 8.0, spike_every: 3, ..sound }), [10.0, 2.0, 2.0, 10.0]);
        assert_eq!(shown(SensorFault { step: 1.5, ..sound }), [1.5; 4]);
        assert_eq!(shown(SensorFault { drift_per_s: 500.0, ..sound }), [2.0, 2.5, 3.0, 3.5]);
        assert_eq!(with(SensorFault { gain: 9.0, ..sound }).disturb(0, 2, 2.0), 2.0);
    }

    #[test]
    fn a_stuck_reading_stays_and_a_dropout_is_the_low_end() {
        let reading = |value| Reading { value, saturated: false };
        let mut stuck = with(SensorFault { stuck: true, ..SensorFault::default() });
        assert_eq!([5.0, 6.0].map(|value| stuck.show(1, 2, reading(value), 0.0).value), [5.0, 5.0]);
        let mut lost = with(SensorFault { dropout: 1.0, ..SensorFault::default() });
        assert_eq!(lost.show(1, 2, reading(5.0), -7.0), Reading { value: -7.0, saturated: true });
    }

    #[test]
    fn noise_has_its_standard_deviation() {
        let mut noisy = with(SensorFault { noise: 2.0, ..SensorFault::default() });
        let square: f64 = (0..10_000).map(|_| noisy.disturb(1, 2, 0.0).powi(2)).sum::<f64>() / 1e4;
        // Variance 4 with a standard error of 4 sqrt(2 / 1e4) = 0.057; five of them.
        assert!((square - 4.0).abs() < 0.29, "{square}");
    }
}
