//! Nuisance parameters of the design: signatures count only outside their span.
//!
//! ```text
//! <a, b> = a.b - (N'a).(1 + N'N)^-1 (N'b)          N: change of the readings with one prior standard deviation of each parameter
//! ```
//!
//! Each parameter is known to its prior's 3 %, a guess of what data sheets and a calibration leave; the product is that of the
//! readings whitened by noise and parameters together. Source: Kay 1998, Fundamentals of Statistical Signal Processing II, 7.8
//! (nuisance with a prior); the names are those of effects.md.

use crate::parameters::{PARAMETERS, Parameter};
use crate::windows::dot;
use nalgebra::{DMatrix, DVector};
use plant::{ParameterError, RigParameters};

/// One prior standard deviation of a parameter, relative.
const PRIOR_STD: f64 = 0.03;

/// All but the area, which is known from the drawing.
pub(crate) fn nuisance_parameters() -> impl Iterator<Item = &'static Parameter> {
    PARAMETERS.iter().filter(|parameter| parameter.name != "parameter:piston-area")
}

/// The rig with a parameter larger by one standard deviation.
pub(crate) fn perturbed(rig: &RigParameters, parameter: &Parameter) -> Result<RigParameters, ParameterError> {
    parameter.scaled(rig, 1.0 + PRIOR_STD)
}

/// Inner product of signatures with nuisance parameters marginalised.
#[derive(Debug)]
pub(crate) struct MarginalProduct<'a> {
    sensitivities: &'a [Vec<f64>],
    inverse: DMatrix<f64>,
}

impl<'a> MarginalProduct<'a> {
    /// The product for these changes of the readings.
    pub(crate) fn new(sensitivities: &'a [Vec<f64>]) -> Self {
        let count = sensitivities.len();
        let gram = DMatrix::from_fn(count, count, |row, column| {
            f64::from(u8::from(row == column)) + dot(&sensitivities[row], &sensitivities[column])
        });
        // One more than positive semidefinite in every direction.
        let inverse = gram.cholesky().map_or_else(|| DMatrix::zeros(count, count), |factor| factor.inverse());
        MarginalProduct { sensitivities, inverse }
    }

    /// The product of two signatures.
    pub(crate) fn of(&self, left: &[f64], right: &[f64]) -> f64 {
        let along = |signature: &[f64]| {
            DVector::from_iterator(
                self.sensitivities.len(),
                self.sensitivities.iter().map(|column| dot(column, signature)),
            )
        };
        dot(left, right) - along(left).dot(&(&self.inverse * along(right)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_number_explains_counts_by_no_more_than_its_prior() {
        let sensitivities = [vec![10.0, 0.0, 0.0]];
        let product = MarginalProduct::new(&sensitivities);
        // Along the parameter: 1 / (1 + 100) of its square is left; across it, all.
        assert!((product.of(&[1.0, 0.0, 0.0], &[1.0, 0.0, 0.0]) - 1.0 / 101.0).abs() < 1e-12);
        assert_eq!(product.of(&[0.0, 2.0, 0.0], &[0.0, 2.0, 0.0]), 4.0);
        assert_eq!(MarginalProduct::new(&[]).of(&[3.0], &[3.0]), 9.0);
    }

    #[test]
    fn every_number_can_be_off() {
        let rig = RigParameters::baseline();
        for parameter in nuisance_parameters() {
            assert_ne!(perturbed(&rig, parameter).expect(parameter.name), rig, "{}", parameter.name);
        }
    }
}
