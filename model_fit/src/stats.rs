//! Order statistics, means and slopes.
//!
//! statrs interpolates quantiles and updates means recursively; thresholds of reports need values of the list and plain sums, to
//! the bit.

/// The value at a rank from 0; `None` beyond the last.
pub fn order_statistic(values: &mut [f64], rank: usize) -> Option<f64> {
    (rank < values.len()).then(|| *values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

/// The value at the rank nearest to a share of the last rank; `None` for an empty list.
pub fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    order_statistic(values, (values.len().saturating_sub(1) as f64 * share).round() as usize)
}

/// The median, the upper one of two; `None` for an empty list.
pub fn median(values: &mut [f64]) -> Option<f64> {
    order_statistic(values, values.len() / 2)
}

/// Arithmetic mean; NaN for an empty list.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean and sample variance.
pub fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let mean = mean(values);
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, squares / (values.len() as f64 - 1.0))
}

/// Mean over `reach` places to each side; `None` where fewer than half of them are there.
pub fn means(values: &[Option<f64>], reach: usize) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0_usize)];
    for value in values {
        let (sum, count) = sums[sums.len() - 1];
        sums.push(value.map_or((sum, count), |value| (sum + value, count + 1)));
    }
    (0..values.len())
        .map(|place| {
            let from = sums[place.saturating_sub(reach)];
            let to = sums[(place + reach + 1).min(values.len())];
            let count = to.1 - from.1;
            (count > reach).then(|| (to.0 - from.0) / count as f64)
        })
        .collect()
}

/// Change per place, from `reach` places before to `reach` after.
pub fn slopes(values: &[Option<f64>], reach: usize) -> Vec<Option<f64>> {
    (0..values.len())
        .map(|place| {
            let before = values[place.checked_sub(reach)?]?;
            let after = (*values.get(place + reach)?)?;
            Some((after - before) / (2 * reach) as f64)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_slopes_of_a_line_are_the_line_and_its_slope() {
        let line: Vec<_> = (0..40).map(|at| (at != 20).then_some(3.0 + 2.0 * f64::from(at))).collect();
        assert_eq!(means(&line, 2)[10], Some(23.0));
        let slope = slopes(&means(&line, 2), 4)[10].unwrap();
        assert!((slope - 2.0).abs() < 1e-12, "{slope}");
        assert_eq!(slopes(&line, 4)[2], None);
    }

    #[test]
    fn a_quantile_is_a_value_of_the_list() {
        assert_eq!(quantile(&mut [3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(&mut [3.0, 1.0, 2.0], 1.0), Some(3.0));
        assert_eq!(median(&mut []), None);
    }
}
