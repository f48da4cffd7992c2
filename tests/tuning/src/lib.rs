//! Tuning: what a program does, and how far it is from oscillating, over load masses and supply pressures.
//!
//! | file | holds |
//! |---|---|
//! | [`cases`] | shipped experiments rehearsed, and their figures |
//! | [`position`] | a position program alone on moves: errors, steps, margins of gain and delay |
//! | [`rehearsed`] | a whole experiment, both axes with their chains: its rows, and the margin of a linked rig |
//!
//! The programs are the real ones, made for the nominal rig. The loop's factor multiplies the K_V tables of the plant and not
//! those of the programs: what the valves pass is what every loop goes through, so a factor of 2 without oscillation is a gain
//! margin of 2, whatever the algorithm. Linked, both axes' loops are multiplied at once.

pub mod cases;
pub mod position;
pub mod rehearsed;

use algorithms::guard::AlgorithmFault;
use axis_control::setup::InputError;
use plant::{ParameterError, RigParameters};
use rayon::prelude::*;

/// Factors that a gain margin is looked for in.
pub const FACTORS: [f64; 8] = [1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0];
pub const MASSES_KG: [f64; 4] = [0.0, 5.0, 10.0, 20.0];
pub const SUPPLIES_BAR: [f64; 4] = [5.0, 6.0, 7.0, 8.0];

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    pub added_mass_kg: f64,
    pub supply_bar: f64,
    /// What the valves pass more than their table says.
    pub loop_factor: f64,
    /// Of the sensors' noise.
    pub seed: u64,
}

impl Default for Trial {
    fn default() -> Self {
        Self { added_mass_kg: 0.0, supply_bar: 7.0, loop_factor: 1.0, seed: 1 }
    }
}

impl Trial {
    pub fn corners() -> Vec<Self> {
        let corner = |added_mass_kg, supply_bar| Self { added_mass_kg, supply_bar, ..Self::default() };
        let row = |mass_kg| SUPPLIES_BAR.map(|supply_bar| corner(mass_kg, supply_bar));
        MASSES_KG.into_iter().flat_map(row).collect()
    }

    /// The rig of these conditions.
    ///
    /// # Errors
    /// [`ParameterError`] when they are none of the rig's.
    pub fn rig(&self, nominal: &RigParameters) -> Result<RigParameters, ParameterError> {
        let scaled = |kv: &[f64]| kv.iter().map(|kv| kv * self.loop_factor).collect::<Vec<_>>();
        let valve = nominal.valve();
        nominal
            .with("supply.pressure_bar", &[self.supply_bar])?
            .with("valve.kv_supply_m3_per_h", &scaled(&valve.kv_supply_m3_per_h))?
            .with("valve.kv_exhaust_m3_per_h", &scaled(&valve.kv_exhaust_m3_per_h))
    }
}

#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    #[error(transparent)]
    Rig(#[from] ParameterError),
    #[error(transparent)]
    Setup(#[from] plant::SetupError),
    #[error(transparent)]
    Algorithm(#[from] AlgorithmFault),
    #[error(transparent)]
    Run(#[from] InputError),
}

/// Largest of [`FACTORS`] up to which `is_still`; 0 if it is not even as it is.
pub fn largest_factor(
    trial: &Trial,
    mut is_still: impl FnMut(&Trial) -> Result<bool, TrialError>,
) -> Result<f64, TrialError> {
    let mut margin = 0.0;
    for loop_factor in FACTORS {
        if !is_still(&Trial { loop_factor, ..*trial })? {
            break;
        }
        margin = loop_factor;
    }
    Ok(margin)
}

/// `work` on each of `items` on all processors; the results in the order of the items.
///
/// # Errors
/// One of those of `work`.
///
/// # Panics
/// When `work` does.
pub fn in_parallel<T: Sync, R: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, TrialError> + Sync + Send,
) -> Result<Vec<R>, TrialError> {
    items.par_iter().map(work).collect()
}

/// Means of all windows of so many values.
fn means(values: &[f64], window: usize) -> Vec<f64> {
    values.windows(window).map(|part| part.iter().sum::<f64>() / window as f64).collect()
}

/// A number in decimals, without the sign of a zero.
pub fn rounded(value: f64, decimals: usize) -> String {
    let unit = 10_f64.powi(decimals as i32);
    format!("{:.decimals$}", (value * unit).round() / unit + 0.0)
}

/// Largest less least; 0 of nothing.
fn peak_to_peak(values: &[f64]) -> f64 {
    let ends = values
        .iter()
        .fold([f64::MAX, f64::MIN], |[least, most], value| [least.min(*value), most.max(*value)]);
    (ends[1] - ends[0]).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_all_threads_stand_in_the_order_of_the_items() {
        let items: Vec<u32> = (0..100).collect();
        let doubled: Vec<u32> = items.iter().map(|item| item * 2).collect();
        assert_eq!(in_parallel(&items, |item| Ok(item * 2)).unwrap(), doubled);
    }

    #[test]
    fn a_margin_is_the_last_factor_before_the_first_that_oscillates() {
        let margin = |still: fn(f64) -> bool| {
            largest_factor(&Trial::default(), |trial| Ok(still(trial.loop_factor))).unwrap()
        };
        assert_eq!(margin(|_| true), 4.0);
        assert_eq!(margin(|_| false), 0.0);
        // Quiet again beyond is no margin.
        assert_eq!(margin(|factor| factor != 2.0), 1.75);
    }
}
