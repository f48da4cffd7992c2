//! Leave-one-block-out cross-validation: residuals of each block under the fit without it, from normal equations alone.
//!
//! ```text
//!   shared numbers:       the step without the block, within their ranges       (N - N_b) d = g - g_b
//!   numbers of a record:  fitted to all of its rows beside these                N_oo d_o = g_o - N_os d_s
//! ```
//! One linear step says nothing where a number is hardly determined: where the likelihood gains and folds by linear steps lose,
//! each block is left out in truth, and everything fitted again ([`refitted`]).
//!
//! A start belongs to its record, as on a held-out record, where it is fitted, too: without the first block nothing else would
//! determine it, and the fold would ask what the model never claims.

use super::fit::{Fitting, Point, UnknownId};
use super::normal::{Normal, solved};
use super::record::MeasuredRecord;
use super::select::Fitted;
use crate::parallel;
use crate::stats::mean;
use nalgebra::DVector;

/// Squares of folds, output by output.
pub(super) type Folds = Vec<Vec<f64>>;

/// What the fit moves by without each block, by one linear step; the last block is no fold.
pub(super) fn steps(
    normals: &[Vec<Normal>],
    all: &Normal,
    fitting: &Fitting<'_>,
    point: &Point,
) -> Vec<DVector<f64>> {
    let is_of_record: Vec<bool> =
        fitting.unknowns.iter().map(|unknown| !matches!(unknown.id, UnknownId::Shared(_))).collect();
    let without = |block: &Vec<Normal>| {
        let mut rest = all.clone();
        for (output, normal) in block.iter().enumerate() {
            let weight = 1.0 / fitting.variance(output, point.squares[output]);
            rest.matrix -= &normal.matrix * weight;
            rest.right_side -= &normal.right_side * weight;
        }
        let shared = within(
            &rest,
            fitting,
            point,
            &vec![true; is_of_record.len()],
            &DVector::zeros(is_of_record.len()),
        );
        let shared = shared.map_with_location(|place, _, step| if is_of_record[place] { 0.0 } else { step });
        within(all, fitting, point, &is_of_record, &shared)
    };
    normals[..normals.len() - 1].iter().map(without).collect()
}

/// The step of some numbers beside what the others move by; one that would leave its range ends there.
fn within(
    normal: &Normal,
    fitting: &Fitting<'_>,
    point: &Point,
    is_moved: &[bool],
    others: &DVector<f64>,
) -> DVector<f64> {
    let (mut is_free, mut held) = (is_moved.to_vec(), others.clone());
    let ends = |place: usize| {
        let value = point.values_si[place];
        fitting.unknowns[place].range_si.map(|end| end - value)
    };
    for place in (0..is_free.len()).filter(|place| is_moved[*place]) {
        is_free[place] = ends(place).iter().all(|end| *end != 0.0);
    }
    loop {
        let right_side = &normal.right_side - &normal.matrix * &held;
        let rest = Normal { right_side, ..normal.clone() };
        let step = solved(&rest, &is_free, 0.0);
        let leaves = (0..is_free.len()).filter(|place| is_free[*place]).find(|place| {
            let [least, most] = ends(*place);
            step[*place] < least || step[*place] > most
        });
        let Some(place) = leaves else { return step + held };
        let [least, most] = ends(place);
        is_free[place] = false;
        held[place] = step[place].clamp(least, most);
    }
}

/// Squares of each fold under the fit without it.
pub(super) fn folds(normals: &[Vec<Normal>], steps: &[DVector<f64>]) -> Folds {
    let of_block = |(block, step): (&Vec<Normal>, &DVector<f64>)| {
        let squares = |normal: &Normal| {
            let quadratic = step.dot(&(&normal.matrix * step));
            (normal.squares - 2.0 * step.dot(&normal.right_side) + quadratic).max(0.0)
        };
        block.iter().map(squares).collect()
    };
    normals.iter().zip(steps).map(of_block).collect()
}

/// Steps of a fit without a block; it begins at the fit with it.
const STEPS: usize = 10;

/// The same by fits without each block, in place of linear steps; `None` where one cannot be simulated.
pub(super) fn refitted(fitted: &Fitted<'_>) -> Option<Folds> {
    let (fitting, point) = (&fitted.fitting, &fitted.point);
    let cut = fitting.blocks_in_time();
    let without = |block: usize| -> Option<Vec<f64>> {
        let mut rest: Vec<MeasuredRecord> = fitting.records.to_vec();
        for (record, blocks) in rest.iter_mut().zip(&cut.block_of) {
            for (row, _) in blocks.iter().enumerate().filter(|(_, of)| **of == block) {
                record.outputs.iter_mut().for_each(|output| output[row] = None);
            }
        }
        let program = fitting.program.clone();
        let without = Fitting::new(fitting.model, program, &rest, &fitted.suspects);
        let (end, _) = without.fit(point.values_si.clone(), STEPS).ok()?;
        // Numbers of a record by all of its rows.
        let rows = fitting.records.iter().map(|record| record.time_s.len()).max()?;
        let of_records = Fitting::frozen(fitting, &end, fitting.records, &fitted.suspects, rows);
        let start = fitting.unknowns.iter().zip(&end.values_si);
        let start = start.filter(|(unknown, _)| !matches!(unknown.id, UnknownId::Shared(_)));
        let (refitted, _) = of_records.fit(start.map(|(_, value)| *value).collect(), STEPS).ok()?;
        let residuals = of_records.residuals(&refitted.values_si).ok()?;
        let squares = |output: usize| {
            let of_record = residuals.iter().zip(&cut.block_of).map(|(record, blocks)| {
                let rows = record[output][0].iter().zip(blocks);
                rows.filter(|(residual, of)| **of == block && residual.is_finite())
                    .map(|(residual, _)| residual * residual)
                    .sum::<f64>()
            });
            of_record.sum()
        };
        Some((0..fitting.model.outputs.len()).map(squares).collect())
    };
    parallel::map_range(0..cut.blocks, without).into_iter().collect()
}

/// Folds in units of the residual variance of each output under `reference`.
pub(super) fn in_units(folds: &Folds, reference: &Fitted<'_>) -> Vec<f64> {
    let weight = |output: usize| 1.0 / reference.fitting.variance(output, reference.point.squares[output]);
    let fold = |squares: &Vec<f64>| {
        squares.iter().enumerate().map(|(output, squares)| squares * weight(output)).sum()
    };
    folds.iter().map(fold).collect()
}

/// What each fold gains, in units of the residual variance under `reference`.
pub(super) fn gained(before: &Folds, after: &Folds, reference: &Fitted<'_>) -> Vec<f64> {
    let [before, after] = [before, after].map(|folds| in_units(folds, reference));
    before.iter().zip(after).map(|(before, after)| before - after).collect()
}

/// Mean over its standard error, of differences that are one for each fold and taken as independent.
pub(super) fn fold_t(differences: &[f64]) -> f64 {
    let count = differences.len() as f64;
    let mean = mean(differences);
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean / (variance / count).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::fold_t;

    #[test]
    fn blocks_that_differ_are_no_gain_beyond_their_error() {
        let alternating: Vec<f64> = (0..10).map(|at| if at % 2 == 0 { 1.1 } else { -0.9 }).collect();
        // A mean of 0.1, and a standard error of 1 / sqrt(10 - 1).
        assert!((fold_t(&alternating) - 0.3).abs() < 1e-9);
        assert!(fold_t(&[1.0; 10]) > 1e6);
    }
}
