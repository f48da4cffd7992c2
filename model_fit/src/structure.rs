//! What the records can tell apart, from sensitivities alone, before a suspect is fitted.
//!
//! ```text
//!   d_s = what suspect s, at its first values, changes in the outputs, in units of the model's residual of each
//!   r_s = d_s less what the model's own numbers could do for it (projection off their sensitivities)
//!   seen share = |r_s| / |d_s|          cosine of two suspects = r_s r_t / (|r_s| |r_t|)
//! ```
//! Two suspects are twins where the cosine is above 0.98 and a fit of one in place of the other is predicted to cost less than
//! what tells two suspects apart. With e = what one explains of the model's residual, less the part along the other:
//!
//! ```text
//!   cost = sum over outputs of  n ln(1 + |e|^2 / rss)        rss: residual squares of the best fit, n: independent samples
//! ```
//! A large term is told apart at a cosine at which a small one is not. A suspect that does nothing because a number of it starts
//! at 0 is taken by what it does per unit of that number; of several by the one that the model's own numbers can do least.
//!
//! A parameter without a standard error moves the outputs as others do: the rank of the sensitivities is below their number.
//!
//! Source: discrepancy-notes.md, 3; Brun, Reichert, Künsch 2001, Water Resources Research 37(4) (collinearity).

use super::fit::{Fitting, Point, Unknown, UnknownId};
use super::judge::GAIN_APART;
use super::normal::{Normal, solved, standard_errors};
use super::select::Fitted;
use super::sensors;
use model::{Failure, Parameter, Program, Solver};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Cosine above which two suspects do the same to these records; a choice, below which an interval of 90 % at ten times the noise
/// would still tell them apart.
pub(super) const TWINS: f64 = 0.98;
/// Share below which a suspect looks like the model's own numbers.
const HIDDEN: f64 = 0.05;

/// What the records can tell apart.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Structure {
    /// Numbers of the model that these records do not determine.
    pub undetermined: Vec<String>,
    /// Suspects that look like a change of the model's own numbers.
    pub hidden: Vec<String>,
    /// Numbers and suspects of these two lists that change no output at all.
    pub without_effect: Vec<String>,
    /// Suspects that do the same to these records, with the cosine.
    pub twins: Vec<Twins>,
    /// For each of these what would have to be measured beside; none where all states are.
    pub advice: Vec<Advice>,
}

/// Two suspects with nearly equal responses.
#[derive(Clone, Debug, Serialize)]
pub struct Twins {
    /// Names of both.
    pub suspects: [String; 2],
    pub(crate) cosine: f64,
}

/// What would show a suspect, or tell two apart.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// Name of one that is hidden, or of two twins.
    pub suspects: Vec<String>,
    /// States, of which a sensor of one would do; empty where none does.
    pub measure: Vec<String>,
    /// States of which a sensor shows or tells them apart a little.
    pub(crate) hardly: Vec<WeakSensor>,
}

/// A sensor that is better than none, and a close call.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct WeakSensor {
    pub(crate) state: String,
    /// Of what the suspect does there, or that of two which shows less, the part that the model's own numbers cannot do.
    pub(crate) share: f64,
    /// Of two suspects with that sensor.
    pub(crate) cosine: Option<f64>,
}

impl Advice {
    /// A line of a report.
    pub(crate) fn in_words(&self) -> String {
        let measure = self.measure.join(" or ");
        let hardly = |one: &WeakSensor| match one.cosine {
            Some(cosine) => format!("{} (cosine {cosine:.3})", one.state),
            None => format!("{} ({:.0} % of what it does)", one.state, one.share * 100.0),
        };
        let hardly = self.hardly.iter().map(hardly).collect::<Vec<_>>().join(" or ");
        match (self.suspects.as_slice(), self.measure.is_empty(), self.hardly.is_empty()) {
            ([one, other], false, _) => {
                format!("to tell {one} and {other} apart you would need a sensor of {measure}")
            }
            ([one, other], true, false) => {
                format!("a sensor would tell {one} and {other} apart a little: of {hardly}")
            }
            ([one, other], true, true) => format!("no sensor of a state would tell {one} and {other} apart"),
            (all, false, _) => format!("to see {} you would need a sensor of {measure}", all.join(" and ")),
            (all, true, false) => format!("a sensor would show {} a little: of {hardly}", all.join(" and ")),
            (all, true, true) => format!("no sensor of a state would show {}", all.join(" and ")),
        }
    }
}

/// What can be told apart beside the model alone; `best` is the fit with the least residual.
pub(crate) fn structure(baseline: &Fitted<'_>, best: &Fitted<'_>) -> Structure {
    let (fitting, point) = (&baseline.fitting, &baseline.point);
    let model = fitting.model;
    let errors = standard_errors(&baseline.normal);
    let undetermined = fitting.unknowns.iter().zip(errors).filter(|(_, error)| error.is_none());
    let undetermined = undetermined.map(|(unknown, _)| fitting.name_of(unknown)).collect();
    let scale = scale(fitting, point);
    let is_asked = |suspect: &model::Suspect| !suspect.is_decoy && !suspect.is_term;
    let asked: Vec<usize> = (0..model.suspects.len()).filter(|one| is_asked(&model.suspects[*one])).collect();
    let base =
        ReferenceModel { fitting, accepted: &baseline.suspects, values_si: &point.values_si, scale: &scale };
    let Ok((responses, base, moved)) = base.responses(&asked) else {
        return Structure { undetermined, ..Structure::default() };
    };
    let name = |suspect: usize| model.suspects[suspect].name.clone();
    let idle = fitting.unknowns.iter().zip(&moved).filter(|(_, moved)| **moved == 0.0);
    let numbers = idle.map(|(unknown, _)| fitting.name_of(unknown));
    let suspects = responses.iter().filter(|one| one.change == 0.0).map(|one| name(one.suspect));
    let without_effect = numbers.chain(suspects).collect();
    let hidden: Vec<usize> = responses.iter().filter(|one| one.is_hidden()).map(|one| one.suspect).collect();
    let residual = DVector::from_vec(fitting.measured(&scale)) - base;
    let cost = |one: &SuspectResponse, other: &SuspectResponse| {
        let along = one.direction.dot(&residual);
        let apart = (&one.direction - &other.direction * one.direction.dot(&other.direction)) * along;
        let mut squares = vec![0.0; scale.len()];
        for (output, value) in fitting.outputs_of_samples().into_iter().zip(apart.iter()) {
            squares[output] += (value / scale[output]).powi(2);
        }
        let of_output = |output: usize| {
            let rest = best.fitting.variance(output, best.point.squares[output]) * fitting.count(output);
            best.effective[output] * (1.0 + squares[output] / rest.max(f64::MIN_POSITIVE)).ln()
        };
        (along.abs(), (0..scale.len()).map(of_output).sum::<f64>())
    };
    // At the size of the one that explains more.
    let predicted = |one: &SuspectResponse, other: &SuspectResponse| {
        let [first, second] = [cost(one, other), cost(other, one)];
        if first.0 >= second.0 { first.1 } else { second.1 }
    };
    let twins = twins(&responses, predicted);
    let confused: Vec<Vec<usize>> =
        hidden.iter().map(|one| vec![*one]).chain(twins.iter().map(|(pair, _)| pair.to_vec())).collect();
    // A number that moves nothing measured stands where its fit happened to begin.
    let values_si = fitting.unknowns.iter().zip(&point.values_si).zip(&moved);
    let values_si: Vec<f64> = values_si
        .map(|((unknown, value), moved)| if *moved == 0.0 { unknown.start_si } else { *value })
        .collect();
    let advice = sensors::advice((baseline, &values_si), &scale, &confused);
    Structure {
        undetermined,
        hidden: hidden.into_iter().map(name).collect(),
        without_effect,
        twins: twins.into_iter().map(|(pair, cosine)| Twins { suspects: pair.map(name), cosine }).collect(),
        advice,
    }
}

/// Change of the outputs by a suspect, projected off the sensitivities to the model's own numbers.
pub(super) struct SuspectResponse {
    pub(super) suspect: usize,
    /// Share of the change that the projection leaves, and its direction.
    pub(super) share: f64,
    /// Size of its change, in units of the model's residual.
    change: f64,
    direction: DVector<f64>,
}

impl SuspectResponse {
    pub(super) fn is_hidden(&self) -> bool {
        self.share <= HIDDEN
    }
}

/// Cosine of the projected responses of two suspects.
pub(super) fn cosine(one: &SuspectResponse, other: &SuspectResponse) -> f64 {
    one.direction.dot(&other.direction).abs()
}

/// Pairs that do the same, with their cosines; of suspects that are seen at all.
fn twins(
    responses: &[SuspectResponse],
    predicted: impl Fn(&SuspectResponse, &SuspectResponse) -> f64,
) -> Vec<([usize; 2], f64)> {
    let responses: Vec<&SuspectResponse> = responses.iter().filter(|one| !one.is_hidden()).collect();
    let mut twins = Vec::new();
    for (place, one) in responses.iter().enumerate() {
        for other in &responses[place + 1..] {
            let cosine = cosine(one, other);
            if cosine > TWINS && predicted(one, other) < GAIN_APART {
                twins.push(([one.suspect, other.suspect], cosine));
            }
        }
    }
    twins
}

/// Responses of suspects, predictions of the model, and the norm of their sensitivity to each of its numbers.
type SuspectResponses = (Vec<SuspectResponse>, DVector<f64>, Vec<f64>);

/// The model at which responses of suspects are computed, with the suspects that it has, and the scale of each output.
#[derive(Clone, Copy)]
pub(super) struct ReferenceModel<'a> {
    pub(super) fitting: &'a Fitting<'a>,
    pub(super) accepted: &'a [usize],
    pub(super) values_si: &'a [f64],
    pub(super) scale: &'a [f64],
}

impl<'a> ReferenceModel<'a> {
    /// Responses of these suspects; one that cannot be simulated is left out.
    pub(super) fn responses(self, asked: &[usize]) -> Result<SuspectResponses, Failure> {
        let (columns, base) = columns(self.fitting, self.values_si, self.scale)?;
        // Other steps of the integration move outputs, too, by no more than this.
        let least = match self.fitting.model.solver {
            Solver::Adaptive { relative_tolerance } => 10.0 * relative_tolerance * base.norm(),
            Solver::Fixed { .. } => 0.0,
        };
        let of = |suspect: &usize| {
            let change = self.outputs_with(*suspect, &[]).ok()? - &base;
            let response = |change: DVector<f64>| {
                let (rest, size) = (&change - &columns * projected(&columns, &change), change.norm());
                let share = if size > 0.0 { rest.norm() / size } else { 0.0 };
                SuspectResponse { suspect: *suspect, share, change: size, direction: rest.normalize() }
            };
            if change.norm() > least {
                return Some(response(change));
            }
            let slopes = self.slopes_at_zero(*suspect).into_iter().map(response);
            let most = slopes.max_by(|one, other| one.share.total_cmp(&other.share));
            Some(most.unwrap_or_else(|| response(change * 0.0)))
        };
        let all = asked.iter().filter_map(of).collect();
        let moved = columns.column_iter().map(|column| column.norm()).collect();
        Ok((all, base, moved))
    }

    /// What a suspect that does nothing at its first values does per unit of each of its numbers that starts at 0; of those alone
    /// that move an output.
    fn slopes_at_zero(self, suspect: usize) -> Vec<DVector<f64>> {
        let (extended, values_si) = self.with_suspect(suspect, &[]);
        let parameters = &self.fitting.model.parameters;
        let at_0 = |index: usize| {
            let Parameter { suspect: owner, values_si, is_fixed, .. } = &parameters[index];
            *owner == Some(suspect) && !is_fixed && values_si[0] == 0.0
        };
        let numbers: Vec<usize> = (0..parameters.len()).filter(|index| at_0(*index)).collect();
        if numbers.is_empty() {
            return Vec::new();
        }
        let Ok((columns, _)) = columns(&extended, &values_si, self.scale) else { return Vec::new() };
        let of_number = |index: &usize| {
            let is_it = |id: UnknownId| match id {
                UnknownId::Shared(of) | UnknownId::PerRecord(of, _) => of == *index,
                UnknownId::Start(..) => false,
            };
            let of_number = extended.unknowns.iter().zip(columns.column_iter());
            of_number
                .filter(|(unknown, _)| is_it(unknown.id))
                .map(|(_, column)| column)
                .fold(DVector::zeros(columns.nrows()), |sum, column| sum + column)
        };
        numbers.iter().map(of_number).filter(|change| change.norm() > 0.0).collect()
    }

    /// Scaled outputs with a suspect at these values, or its first; all other numbers as they are.
    pub(super) fn outputs_with(
        self,
        suspect: usize,
        of_suspect: &[(UnknownId, f64)],
    ) -> Result<DVector<f64>, Failure> {
        let (extended, values_si) = self.with_suspect(suspect, of_suspect);
        Ok(DVector::from_vec(extended.predictions(&values_si, self.scale)?))
    }

    /// The fit with one suspect more, and its numbers.
    fn with_suspect(self, suspect: usize, of_suspect: &[(UnknownId, f64)]) -> (Fitting<'a>, Vec<f64>) {
        let ReferenceModel { fitting, accepted, values_si, .. } = self;
        let mut suspects = accepted.to_vec();
        suspects.push(suspect);
        let program = Program::new(fitting.model, &suspects).expect("all suspects together were compiled");
        let extended = Fitting::new(fitting.model, program, fitting.records, &suspects);
        let known = |id| fitting.unknowns.iter().position(|unknown| unknown.id == id);
        let value = |unknown: &Unknown| {
            let of_it = of_suspect.iter().find(|(id, _)| *id == unknown.id).map(|(_, value)| *value);
            of_it.or_else(|| known(unknown.id).map(|place| values_si[place])).unwrap_or(unknown.start_si)
        };
        let values_si = extended.unknowns.iter().map(value).collect();
        (extended, values_si)
    }
}

/// Reciprocal of the residual's standard deviation, output by output.
fn scale(fitting: &Fitting<'_>, point: &Point) -> Vec<f64> {
    let variance = |output: usize| fitting.variance(output, point.squares[output]);
    (0..fitting.model.outputs.len()).map(|output| variance(output).sqrt().recip()).collect()
}

/// Coefficients of the columns that come nearest to a change.
pub(super) fn projected(columns: &DMatrix<f64>, change: &DVector<f64>) -> DVector<f64> {
    let normal = Normal { matrix: columns.tr_mul(columns), right_side: columns.tr_mul(change), squares: 0.0 };
    solved(&normal, &vec![true; columns.ncols()], 0.0)
}

/// Scaled sensitivities and scaled outputs of the model.
pub(super) fn columns(
    fitting: &Fitting<'_>,
    values_si: &[f64],
    scale: &[f64],
) -> Result<(DMatrix<f64>, DVector<f64>), Failure> {
    let (slopes, values) = fitting.sensitivities(values_si, scale)?;
    let rows = values.len();
    Ok((DMatrix::from_row_slice(rows, fitting.unknowns.len(), &slopes), DVector::from_vec(values)))
}

/// A fit with its sensitivities, in units of the residual of each output; `residual` is projected off them.
pub(super) struct LinearisedFit {
    pub(super) scale: Vec<f64>,
    pub(super) predictions: DVector<f64>,
    pub(super) residual: DVector<f64>,
    columns: DMatrix<f64>,
}

impl LinearisedFit {
    /// `None` where it cannot be simulated.
    pub(super) fn new(fitting: &Fitting<'_>, point: &Point) -> Option<Self> {
        let scale = scale(fitting, point);
        let (columns, predictions) = columns(fitting, &point.values_si, &scale).ok()?;
        let residual = DVector::from_vec(fitting.measured(&scale)) - &predictions;
        let beside = Self { scale, predictions, residual: DVector::zeros(0), columns };
        Some(Self { residual: beside.project_off(residual), ..beside })
    }

    /// A change, projected off the sensitivities to the fit's own numbers.
    pub(super) fn project_off(&self, change: DVector<f64>) -> DVector<f64> {
        let taken = &self.columns * projected(&self.columns, &change);
        change - taken
    }
}

#[cfg(test)]
mod tests {
    use super::{Advice, WeakSensor};

    #[test]
    fn a_sensor_that_helps_a_little_is_not_said_to_be_none() {
        let words = |suspects: &[&str], measure: &[&str], cosine: Option<Option<f64>>| {
            let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
            let hardly = |cosine| WeakSensor { state: "z".into(), share: 0.124, cosine };
            let hardly = cosine.map(hardly).into_iter().collect();
            Advice { suspects: owned(suspects), measure: owned(measure), hardly }.in_words()
        };
        let said = [
            words(&["leak"], &[], None),
            words(&["leak"], &[], Some(None)),
            words(&["leak"], &["x"], Some(None)),
            words(&["leak", "gain"], &[], None),
            words(&["leak", "gain"], &[], Some(Some(0.95))),
        ];
        let expected = [
            "no sensor of a state would show leak",
            "a sensor would show leak a little: of z (12 % of what it does)",
            "to see leak you would need a sensor of x",
            "no sensor of a state would tell leak and gain apart",
            "a sensor would tell leak and gain apart a little: of z (cosine 0.950)",
        ];
        assert_eq!(said, expected);
    }
}
