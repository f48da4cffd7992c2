//! Normal equations: what they determine, the step that they ask for, and standard errors.

use nalgebra::{DMatrix, DVector};

/// Smallest eigenvalue of the scaled normal matrix, over its largest, of a direction that the records determine.
const DETERMINED: f64 = 1e-10;

/// Normal equations of rows: J sensitivities, e residual. Blocks of a fit are unweighted; their sum has the inverse variances as
/// weights.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    /// J'J.
    pub(crate) matrix: DMatrix<f64>,
    /// J'e, right side of the normal equations.
    pub(crate) right_side: DVector<f64>,
    /// e'e.
    pub(crate) squares: f64,
}

impl Normal {
    pub(crate) fn zero(count: usize) -> Self {
        Self { matrix: DMatrix::zeros(count, count), right_side: DVector::zeros(count), squares: 0.0 }
    }

    pub(crate) fn add(&mut self, other: &Self, weight: f64) {
        self.matrix += &other.matrix * weight;
        self.right_side += &other.right_side * weight;
        self.squares += weight * other.squares;
    }
}

/// Solves scaled normal equations in the directions that they determine.
pub(crate) fn solved(normal: &Normal, is_free: &[bool], damping: f64) -> DVector<f64> {
    let places: Vec<usize> =
        (0..is_free.len()).filter(|place| is_free[*place] && normal.matrix[(*place, *place)] > 0.0).collect();
    let mut step = DVector::zeros(is_free.len());
    let (vectors, values, scale) = eigen(normal, &places);
    let right_side = DVector::from_iterator(
        places.len(),
        places.iter().zip(&scale).map(|(place, scale)| normal.right_side[*place] / scale),
    );
    let largest = values.iter().copied().fold(0.0, f64::max);
    for (column, value) in values.iter().enumerate().filter(|(_, value)| **value > DETERMINED * largest) {
        let direction = vectors.column(column);
        let along = direction.dot(&right_side) / (value + damping);
        for (row, place) in places.iter().enumerate() {
            step[*place] += along * direction[row] / scale[row];
        }
    }
    step
}

/// Eigenvectors, eigenvalues and scales of the normal matrix with a diagonal of ones.
fn eigen(normal: &Normal, places: &[usize]) -> (DMatrix<f64>, Vec<f64>, Vec<f64>) {
    let scale: Vec<f64> = places.iter().map(|place| normal.matrix[(*place, *place)].sqrt()).collect();
    if places.is_empty() {
        return (DMatrix::zeros(0, 0), Vec::new(), scale);
    }
    let scaled = DMatrix::from_fn(places.len(), places.len(), |row, column| {
        normal.matrix[(places[row], places[column])] / (scale[row] * scale[column])
    });
    let decomposed = scaled.symmetric_eigen();
    (decomposed.eigenvectors, decomposed.eigenvalues.iter().copied().collect(), scale)
}

/// Standard errors; `None` for a number that the records do not determine.
pub(crate) fn standard_errors(normal: &Normal) -> Vec<Option<f64>> {
    let places: Vec<usize> =
        (0..normal.right_side.len()).filter(|place| normal.matrix[(*place, *place)] > 0.0).collect();
    let (vectors, values, scale) = eigen(normal, &places);
    let largest = values.iter().copied().fold(0.0, f64::max);
    let mut errors = vec![None; normal.right_side.len()];
    for (row, place) in places.iter().enumerate() {
        let mut variance = 0.0;
        let mut is_determined = true;
        for (column, value) in values.iter().enumerate() {
            let share = vectors[(row, column)];
            if *value > DETERMINED * largest {
                variance += share * share / value;
            } else if share.abs() > 1e-3 {
                is_determined = false;
            }
        }
        errors[*place] = is_determined.then(|| variance.sqrt() / scale[row]);
    }
    errors
}

/// Correlations of what errors of the measured samples do to the numbers, in the directions that the records determine; 0 beside
/// a number that none determines.
pub(crate) fn correlations(normal: &Normal) -> DMatrix<f64> {
    let count = normal.right_side.len();
    let places: Vec<usize> = (0..count).filter(|place| normal.matrix[(*place, *place)] > 0.0).collect();
    let (vectors, values, _) = eigen(normal, &places);
    let largest = values.iter().copied().fold(0.0, f64::max);
    let mut inverse = DMatrix::zeros(places.len(), places.len());
    for (column, value) in values.iter().enumerate().filter(|(_, value)| **value > DETERMINED * largest) {
        let direction = vectors.column(column);
        inverse += direction * direction.transpose() / *value;
    }
    let mut correlations = DMatrix::identity(count, count);
    for (row, place) in places.iter().enumerate() {
        for (column, other) in places.iter().enumerate().filter(|(column, _)| *column != row) {
            let scale = (inverse[(row, row)] * inverse[(column, column)]).sqrt();
            correlations[(*place, *other)] = if scale > 0.0 { inverse[(row, column)] / scale } else { 0.0 };
        }
    }
    correlations
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_those_of_the_inverse() {
        // The inverse of [[4, 2], [2, 9]] is [[9, -2], [-2, 4]]/32: -2/sqrt(36).
        let matrix = DMatrix::from_row_slice(3, 3, &[4.0, 2.0, 0.0, 2.0, 9.0, 0.0, 0.0, 0.0, 0.0]);
        let found = correlations(&Normal { matrix, right_side: DVector::zeros(3), squares: 1.0 });
        let expected =
            DMatrix::from_row_slice(3, 3, &[1.0, -1.0 / 3.0, 0.0, -1.0 / 3.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        assert!((&found - expected).amax() < 1e-12, "{found}");
    }
}
