//! Sequential Monte Carlo test: is an observed figure larger than those of draws under a null hypothesis?
//!
//! ```text
//!   second draw that reaches it (Besag, Clifford)               ──► no: p = 2 / draws
//!   far above all draws, were their tail exponential            ──► yes
//!   all draws spent                                             ──► p = (draws that reach it + 1) / (draws + 1)
//! ```
//!
//! *Far above*, where the tail is light: of n draws from a shifted exponential distribution, a further one exceeds the smallest
//! by r times their range with probability n / (n + 1) prod_(i < n) i / (i + r), since what exceeds the smallest is exponential
//! again. The largest of many chi2-like gains has a tail like that; one window in which the piston breaks away at another moment
//! gives a heavier one, so that the rule needs gains without the best windows. With r = 1 it is 1 / (n + 1), the p-value of plain
//! Monte Carlo.
//!
//! Source: Besag, Clifford 1991, Biometrika 78(2): sequential Monte Carlo p-values.

use crate::report::StoppingReason;

/// Level of the test.
const LEVEL: f64 = 0.05;
/// Draws that reach the observed figure at which it is not significant: of 39 draws, one may at the level of a twentieth.
const MOST_EXCEEDANCES: usize = 2;
/// Draws before an observed figure can be far above them.
const FEWEST: usize = 5;
/// Probability of a further draw beyond the observed figure, below which it is far above. So small that the test holds its level,
/// the many looks included: [`tests::where_the_tail_is_light_few_draws_hold_the_level`].
const FAR: f64 = 0.005;

/// A test that goes on, with what was drawn.
#[derive(Clone, Debug)]
pub(super) struct Sequential {
    observed: f64,
    /// Whether the tail of the draws is one of many windows, so that few draws tell where it ends.
    has_light_tail: bool,
    pub(super) drawn: Vec<f64>,
    pub(super) exceedances: usize,
}

impl Sequential {
    pub(super) fn new(observed: f64, has_light_tail: bool) -> Self {
        Sequential { observed, has_light_tail, drawn: Vec::new(), exceedances: 0 }
    }

    /// Takes a draw; how the test ended, where it does with it.
    pub(super) fn take(&mut self, draw: f64) -> Option<StoppingReason> {
        self.drawn.push(draw);
        self.exceedances += usize::from(draw >= self.observed);
        if self.exceedances >= MOST_EXCEEDANCES {
            Some(StoppingReason::Reached)
        } else if self.has_light_tail && self.drawn.len() >= FEWEST && self.tail() <= FAR {
            Some(StoppingReason::FarAbove)
        } else {
            None
        }
    }

    pub(super) fn is_significant(&self, ended: StoppingReason) -> bool {
        ended != StoppingReason::Reached
            && (ended == StoppingReason::FarAbove || self.p_value(ended) <= LEVEL)
    }

    /// Bound of the p-value after these draws.
    pub(super) fn p_value(&self, ended: StoppingReason) -> f64 {
        let (reached, drawn) = (self.exceedances as f64, self.drawn.len() as f64);
        match ended {
            StoppingReason::Reached => reached / drawn,
            StoppingReason::FarAbove => self.tail(),
            StoppingReason::AllDrawn => (reached + 1.0) / (drawn + 1.0),
        }
    }

    /// Probability of a further draw beyond the observed figure, were the draws exponential beyond an unknown origin.
    fn tail(&self) -> f64 {
        let ends = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
        let (low, high) = self.drawn.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        let ratio = (self.observed - low) / (high - low).max(f64::MIN_POSITIVE);
        let count = self.drawn.len();
        let factors = (1..count).map(|at| at as f64 / (at as f64 + ratio.max(0.0)));
        count as f64 / (count as f64 + 1.0) * factors.product::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    const DRAWS: usize = 39;

    /// Whether it is significant, and the draws that it took.
    fn test(observed: f64, has_light_tail: bool, mut draw: impl FnMut() -> f64) -> (bool, usize) {
        let mut test = Sequential::new(observed, has_light_tail);
        let ended = (0..DRAWS).find_map(|_| test.take(draw())).unwrap_or(StoppingReason::AllDrawn);
        (test.is_significant(ended), test.drawn.len())
    }

    fn uniform(random: &mut Pcg64) -> f64 {
        ((random.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    type Law = (&'static str, fn(f64) -> f64);
    const LIGHT: [Law; 3] = [
        ("uniform", |share| share),
        ("exponential", |share| -share.ln()),
        // The largest of a hundred chi2 of one degree of freedom, about.
        ("largest of many", |share| -2.0 * (-share.powf(0.01)).ln_1p()),
    ];
    const HEAVY: [Law; 2] = [("Pareto, index 2", |share| share.powf(-0.5)), ("Pareto, index 1", f64::recip)];

    /// Share of tests that are significant though the observed figure is a draw itself, and draws a test.
    fn size((_, law): Law, has_light_tail: bool) -> (f64, f64) {
        const TESTS: usize = 20_000;
        let mut random = Pcg64::seed_from_u64(11);
        let (mut significant, mut draws) = (0, 0);
        for _ in 0..TESTS {
            let observed = law(uniform(&mut random));
            let (is_significant, drawn) = test(observed, has_light_tail, || law(uniform(&mut random)));
            significant += usize::from(is_significant);
            draws += drawn;
        }
        (significant as f64 / TESTS as f64, draws as f64 / TESTS as f64)
    }

    #[test]
    fn where_the_tail_is_light_few_draws_hold_the_level() {
        for law in LIGHT {
            let (size, draws) = size(law, true);
            // Two of forty ranks; the far rule adds little. Three standard errors are 0.005.
            assert!((0.045..0.06).contains(&size), "{}: {size}", law.0);
            assert!(draws < 12.0, "{}: {draws}", law.0);
        }
    }

    #[test]
    fn where_the_tail_is_heavy_ranks_alone_hold_the_level() {
        for law in LIGHT.into_iter().chain(HEAVY) {
            let (size, _) = size(law, false);
            assert!((0.045..0.055).contains(&size), "{}: {size}", law.0);
        }
        let (with_far_rule, _) = size(HEAVY[1], true);
        assert!(with_far_rule > 0.055, "the far rule would not: {with_far_rule}");
    }

    #[test]
    fn what_is_far_above_costs_five_draws_and_what_is_reached_twice_two() {
        let drawn = [7.0, 9.0, 6.0, 11.0, 8.0];
        let mut next = drawn.iter().copied().cycle();
        assert_eq!(test(60.0, true, || next.next().unwrap()), (true, 5));
        let mut next = drawn.iter().copied().cycle();
        assert_eq!(test(6.0, true, || next.next().unwrap()), (false, 2));
        // Above all of them, and not far.
        let mut next = drawn.iter().copied().cycle();
        let (is_significant, draws) = test(12.0, true, || next.next().unwrap());
        assert!(is_significant && draws > 20, "{draws}");
        let mut next = drawn.iter().copied().cycle();
        assert_eq!(test(60.0, false, || next.next().unwrap()), (true, DRAWS));
    }

    #[test]
    fn at_the_largest_draw_the_tail_is_the_p_value_of_monte_carlo() {
        let mut test = Sequential::new(9.0, true);
        for draw in [3.0, 9.0 - 1e-9, 5.0, 4.0] {
            assert_eq!(test.take(draw), None);
        }
        assert!((test.tail() - 0.2).abs() < 1e-6 && test.p_value(StoppingReason::AllDrawn) == 0.2);
    }
}
