//! Which state, measured, would show a suspect that hides, or tell two apart that do the same.
//!
//! Each state that no output reports is added as one, with a sensor that is as good as those there are: its noise over the
//! variation of the state is the least ratio of an output's residual to that output's variation. The sensitivities are those of
//! the model at its fit, so that nothing is fitted.

use super::fit::Fitting;
use super::record::MeasuredRecord;
use super::select::Fitted;
use super::structure::{Advice, ReferenceModel, SuspectResponse, TWINS, WeakSensor, cosine};
use crate::stats::mean_and_variance;
use model::{Model, Part, Program};

/// Variance over the square of the mean of a state that rests, up to rounding.
const RESTS: f64 = 1e-20;

/// A sensor that helps is no close call: cosine of two suspects at most, and share of a suspect that is seen at least. Choices,
/// well beyond the bounds of what counts as a twin (0.98) and as hidden (0.05). One between these and those helps a little.
const APART: f64 = 0.9;
const SHOWN: f64 = 0.2;

/// For each of `confused`, one suspect that hides or two that are twins, the states that would help; nothing where all states are
/// measured.
pub(super) fn advice(
    (baseline, values_si): (&Fitted<'_>, &[f64]),
    scale: &[f64],
    confused: &[Vec<usize>],
) -> Vec<Advice> {
    let model = baseline.fitting.model;
    let is_measured = |name: &str| model.outputs.iter().any(|output| output.value.text == name);
    let states = model.states.iter().enumerate();
    let unmeasured = states.filter(|(_, state)| state.suspect.is_none() && !is_measured(&state.name));
    let unmeasured: Vec<usize> = unmeasured.map(|(index, _)| index).collect();
    if confused.is_empty() || unmeasured.is_empty() {
        return Vec::new();
    }
    let name = |suspect: &usize| model.suspects[*suspect].name.clone();
    let mut advice: Vec<Advice> = confused
        .iter()
        .map(|suspects| Advice {
            suspects: suspects.iter().map(name).collect(),
            measure: Vec::new(),
            hardly: Vec::new(),
        })
        .collect();
    for state in unmeasured {
        let Some(responses) = with_sensor((baseline, values_si), scale, state, confused) else { continue };
        for (suspects, advice) in confused.iter().zip(&mut advice) {
            let state = model.states[state].name.clone();
            match identifiability(&responses, suspects) {
                Some(Identifiability { share, cosine })
                    if share > SHOWN && cosine.is_none_or(|cosine| cosine < APART) =>
                {
                    advice.measure.push(state);
                }
                Some(Identifiability { share, cosine }) => {
                    advice.hardly.push(WeakSensor { state, share, cosine })
                }
                None => {}
            }
        }
    }
    advice
}

/// How well a sensor identifies suspects: the least share of their responses, and the cosine of two.
struct Identifiability {
    share: f64,
    cosine: Option<f64>,
}

/// Identifiability of these suspects with a sensor; `None` where one of them stays hidden, or two stay twins.
fn identifiability(responses: &[SuspectResponse], suspects: &[usize]) -> Option<Identifiability> {
    let of = |suspect: &usize| responses.iter().find(|one| one.suspect == *suspect && !one.is_hidden());
    let all: Vec<&SuspectResponse> = suspects.iter().map(of).collect::<Option<_>>()?;
    let share = all.iter().map(|one| one.share).fold(f64::INFINITY, f64::min);
    let cosine = (all.len() == 2).then(|| cosine(all[0], all[1]));
    cosine.is_none_or(|cosine| cosine <= TWINS).then_some(Identifiability { share, cosine })
}

/// What the suspects in question do to the outputs and to a state; `None` where it cannot be computed, or the state rests.
fn with_sensor(
    (baseline, values_si): (&Fitted<'_>, &[f64]),
    scale: &[f64],
    state: usize,
    confused: &[Vec<usize>],
) -> Option<Vec<SuspectResponse>> {
    let measuring: Model = baseline.fitting.model.measuring(Part::State(state))?;
    let records: Vec<MeasuredRecord> = baseline.fitting.records.iter().map(with_extra_output).collect();
    let accepted = &baseline.suspects;
    let program = Program::new(&measuring, accepted).ok()?;
    let fitting = Fitting::new(&measuring, program, &records, accepted);
    let predicted = fitting.residuals(values_si).ok()?;
    let state: Vec<f64> =
        predicted.into_iter().filter_map(|mut record| record.pop()).flat_map(|[_, x]| x).collect();
    let (mean, variance) = mean_and_variance(&state);
    if variance.is_nan() || variance <= RESTS * mean * mean {
        return None;
    }
    let noise = least_noise(baseline, scale) * variance.sqrt();
    let scale: Vec<f64> = scale.iter().copied().chain([1.0 / noise]).collect();
    let mut asked: Vec<usize> = confused.iter().flatten().copied().collect();
    asked.sort_unstable();
    asked.dedup();
    let base = ReferenceModel { fitting: &fitting, accepted, values_si, scale: &scale };
    base.responses(&asked).ok().map(|(responses, ..)| responses)
}

/// The least ratio of an output's residual to its variation.
fn least_noise(baseline: &Fitted<'_>, scale: &[f64]) -> f64 {
    let records = baseline.fitting.records;
    let of = |(output, scale): (usize, &f64)| {
        let measured = records.iter().flat_map(|record| record.outputs[output].iter().flatten().copied());
        1.0 / (scale * mean_and_variance(&measured.collect::<Vec<f64>>()).1.sqrt())
    };
    scale.iter().enumerate().map(of).fold(1.0, f64::min)
}

/// A part of a fitted model at the rows of its records, SI; `None` where it cannot be computed.
pub(super) fn part_values(fitted: &Fitted<'_>, part: Part) -> Option<Vec<f64>> {
    let measuring = fitted.fitting.model.measuring(part)?;
    let records: Vec<MeasuredRecord> = fitted.fitting.records.iter().map(with_extra_output).collect();
    let program = Program::new(&measuring, &fitted.suspects).ok()?;
    let fitting = Fitting::new(&measuring, program, &records, &fitted.suspects);
    let predicted = fitting.residuals(&fitted.point.values_si).ok()?;
    Some(
        predicted
            .into_iter()
            .filter_map(|mut record| record.pop())
            .flat_map(|[_, predicted]| predicted)
            .collect(),
    )
}

/// A record with a further output, measured at each row.
pub(super) fn with_extra_output(record: &MeasuredRecord) -> MeasuredRecord {
    let mut record = record.clone();
    record.outputs.push(vec![Some(0.0); record.time_s.len()]);
    record
}
