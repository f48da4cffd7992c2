//! The smallest step between a channel's values.
//!
//! Distinct values of a rounded channel lie whole steps apart, most neighbours exactly one. The step is taken from the small
//! end of these distances, refined over all of them, and accepted only when nearly all are whole multiples.

use crate::stats::quantile;

/// Share of the distances that must be whole multiples.
const NEARLY_ALL: f64 = 0.97;
/// How far a distance may be from a whole multiple, in steps.
const TOLERANCE: f64 = 0.1;
/// Largest distance in steps: beyond, the error of the step accumulates.
const FARTHEST: f64 = 30.0;

/// Step of the values; `None` for values without one and for fewer than three distinct ones.
pub fn of(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let largest = sorted.first()?.abs().max(sorted.last()?.abs());
    // Two roundings of the same count differ by the last bits, and by no more.
    let mut distances: Vec<f64> = sorted
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|distance| *distance > 1e-10 * largest)
        .collect();
    if distances.len() < 2 {
        return None;
    }
    let smallest = quantile(&mut distances, 0.02)?;
    // A step that all distances are multiples of, but none is: halves and thirds of the smallest.
    (1..=3).map(f64::from).find_map(|part| accepted(&distances, smallest / part))
}

fn accepted(distances: &[f64], guess: f64) -> Option<f64> {
    let mut step = guess;
    for _ in 0..3 {
        let near = distances.iter().filter(|distance| **distance < FARTHEST * step);
        let (counts, lengths) = near.fold((0.0, 0.0), |(counts, lengths), distance| {
            let count = (distance / step).round().max(1.0);
            (counts + count, lengths + distance)
        });
        step = lengths / counts;
    }
    let near: Vec<f64> =
        distances.iter().map(|distance| distance / step).filter(|count| *count < FARTHEST).collect();
    let whole = near.iter().filter(|count| (*count - count.round()).abs() < TOLERANCE).count();
    (near.len() >= 2 && whole as f64 >= NEARLY_ALL * near.len() as f64).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};

    /// Numbers from 0 to 1.
    fn wobbles(count: usize) -> impl Iterator<Item = f64> {
        let mut stream = rand_pcg::Pcg64::seed_from_u64(7);
        (0..count).map(move |_| (stream.next_u64() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    #[test]
    fn a_rounded_channel_has_its_step() {
        let step = 0.5 / 65535.0;
        let values: Vec<f64> = wobbles(5000).map(|wobble| (wobble * 300.0).round() * step).collect();
        let found = of(&values).unwrap();
        assert!((found / step - 1.0).abs() < 1e-6, "{found}");
    }

    #[test]
    fn sparse_values_have_it_too_and_smooth_ones_have_none() {
        let sparse: Vec<f64> = wobbles(400).map(|wobble| (wobble * 4000.0).round() * 61.0).collect();
        assert!((of(&sparse).unwrap() - 61.0).abs() < 1e-6);
        let smooth: Vec<f64> = wobbles(4000).collect();
        assert_eq!(of(&smooth), None);
        assert_eq!((of(&[1.0; 9]), of(&[])), (None, None));
    }
}
