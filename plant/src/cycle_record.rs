//! What one cycle of the plant leaves: the values of a row of `measurement.csv` and of `truth.csv`.

use crate::effects::Terms;
use crate::sensors::AxisReadings;
use crate::truth::Truth;

/// One cycle, as it is recorded.
#[derive(Clone, Debug)]
pub struct CycleRecord {
    /// Cycle number; the row's time is this many milliseconds.
    pub cycle: u64,
    /// Valve openings acting over the cycle, drive and load, -1 to 1.
    pub valve: [f64; 2],
    /// Sensors sampled at the cycle's start, drive and load.
    pub readings: [AxisReadings; 2],
    /// What only a simulation knows.
    pub truth: Truth,
    /// What each switched-on effect adds to its balance: room for all of them, so that a record is copied and not allocated.
    pub terms: Terms,
}

impl CycleRecord {
    /// What sensors and valves show: of each axis valve, position, force, pressure a, pressure b.
    pub fn measured(&self) -> impl Iterator<Item = f64> {
        self.valve.iter().zip(&self.readings).flat_map(|(valve, axis)| {
            let readings = [&axis.position, &axis.force, &axis.pressure_a, &axis.pressure_b];
            std::iter::once(*valve).chain(readings.map(|reading| reading.value))
        })
    }

    /// What only a simulation knows: the values of [`Truth::COLUMNS`], then of [`crate::Plant::term_names`].
    pub fn known_to_simulation(&self) -> impl Iterator<Item = f64> {
        self.truth.values().into_iter().chain(self.terms.values().iter().copied())
    }
}
