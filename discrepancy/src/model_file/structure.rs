//! What the records can tell apart, from sensitivities alone, before a suspect is fitted.
//!
//! ```text
//!   d_s = what suspect s, at its first values, changes in the outputs, in units of what the model leaves of each
//!   r_s = d_s less what the model's own numbers could do for it (projection off their sensitivities)
//!   seen share = |r_s| / |d_s|          cosine of two suspects = r_s r_t / (|r_s| |r_t|)
//! ```
//! A parameter without a standard error moves the outputs as others do: the rank of the sensitivities is below their number.
//!
//! Source: discrepancy-notes.md, 3; Brun, Reichert, Künsch 2001, Water Resources Research 37(4) (collinearity).

use super::fit::Fitting;
use super::normal::{Normal, solved, standard_errors};
use super::select::Fitted;
use model::{Failure, Program};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Cosine above which two suspects do the same to these records; a choice, below which an interval of 90 % at ten times the noise
/// would still tell them apart.
const TWINS: f64 = 0.98;
/// Share below which a suspect looks like the model's own numbers.
const HIDDEN: f64 = 0.05;

/// What the records can tell apart.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Structure {
    /// Numbers of the model that these records do not determine.
    pub undetermined: Vec<String>,
    /// Suspects that look like a change of the model's own numbers.
    pub hidden: Vec<String>,
    /// Suspects that do the same to these records, with the cosine.
    pub twins: Vec<Twins>,
}

/// Two suspects that do the same.
#[derive(Clone, Debug, Serialize)]
pub struct Twins {
    pub suspects: [String; 2],
    pub cosine: f64,
}

pub(crate) fn structure(baseline: &Fitted<'_>) -> Structure {
    let (fitting, point) = (&baseline.fitting, &baseline.point);
    let model = fitting.model;
    let errors = standard_errors(&baseline.normal);
    let undetermined = fitting.unknowns.iter().zip(errors).filter(|(_, error)| error.is_none());
    let undetermined = undetermined.map(|(unknown, _)| fitting.name_of(unknown)).collect();
    let (mut hidden, mut seen) = (Vec::new(), Vec::new());
    let scale: Vec<f64> = (0..model.outputs.len())
        .map(|output| fitting.variance(output, point.squares[output]).sqrt().recip())
        .collect();
    let Ok((columns, base)) = columns(fitting, &point.values_si, &scale) else { return Structure::default() };
    for (index, suspect) in
        model.suspects.iter().enumerate().filter(|(_, suspect)| !suspect.is_decoy && !suspect.is_term)
    {
        let Ok(changed) = changed(baseline, index, &scale) else { continue };
        let change: DVector<f64> = changed - &base;
        let rest = &change - &columns * projected(&columns, &change);
        if rest.norm() <= HIDDEN * change.norm() {
            hidden.push(suspect.name.clone());
        } else {
            seen.push((suspect.name.clone(), rest.normalize()));
        }
    }
    let mut twins = Vec::new();
    for (place, (name, one)) in seen.iter().enumerate() {
        for (other_name, other) in &seen[place + 1..] {
            let cosine = one.dot(other).abs();
            if cosine > TWINS {
                twins.push(Twins { suspects: [name.clone(), other_name.clone()], cosine });
            }
        }
    }
    Structure { undetermined, hidden, twins }
}

/// Coefficients of the columns that come nearest to a change.
fn projected(columns: &DMatrix<f64>, change: &DVector<f64>) -> DVector<f64> {
    let normal = Normal { matrix: columns.tr_mul(columns), slope: columns.tr_mul(change), squares: 0.0 };
    solved(&normal, &vec![true; columns.ncols()], 0.0)
}

/// Scaled sensitivities and scaled outputs of the model.
fn columns(
    fitting: &Fitting<'_>,
    values_si: &[f64],
    scale: &[f64],
) -> Result<(DMatrix<f64>, DVector<f64>), Failure> {
    let (slopes, values) = fitting.sensitivities(values_si, scale)?;
    let rows = values.len();
    Ok((DMatrix::from_row_slice(rows, fitting.unknowns.len(), &slopes), DVector::from_vec(values)))
}

/// Scaled outputs with a suspect at its first values, all other numbers as they are.
fn changed(baseline: &Fitted<'_>, suspect: usize, scale: &[f64]) -> Result<DVector<f64>, Failure> {
    let fitting = &baseline.fitting;
    let mut suspects = baseline.suspects.clone();
    suspects.push(suspect);
    let program = Program::new(fitting.model, &suspects).expect("all suspects together were compiled");
    let extended = Fitting::new(fitting.model, program, fitting.records, &suspects);
    let known = |what| fitting.unknowns.iter().position(|unknown| unknown.what == what);
    let values: Vec<f64> = extended
        .unknowns
        .iter()
        .map(|unknown| known(unknown.what).map_or(unknown.start_si, |place| baseline.point.values_si[place]))
        .collect();
    Ok(DVector::from_vec(extended.sensitivities(&values, scale)?.1))
}
