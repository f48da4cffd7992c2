//! Both models on records that were not used: shared numbers frozen, the record's own fitted on its first samples, which are not
//! scored.

use super::fit::{Fitting, OPTIONS, OutputSeries, UnknownId};
use super::record::MeasuredRecord;
use super::select::{Fitted, Rival, SearchResult};
use super::starts;
use model::{Failure, Model, Program};

/// Largest ratio of a signal's rms after to before.
pub const WORSE: f64 = 1.02;

/// Residual rms of an output on a record under both models, the baseline's first.
#[derive(Clone, Debug)]
pub(crate) struct HeldOutResidual {
    pub(crate) record: usize,
    pub(crate) output: usize,
    pub(crate) rms_si: [f64; 2],
    pub(crate) scored_rows: usize,
}

/// A record with what both models say.
#[derive(Clone, Debug, Default)]
pub(crate) struct Traces {
    pub(crate) record: String,
    pub(crate) time_s: Vec<f64>,
    /// Of each output: measured, baseline, extended; NaN where there is none.
    pub(crate) outputs: Vec<[Vec<f64>; 3]>,
    /// First row that is scored.
    pub(crate) first_row: usize,
}

/// Why held-out records are not judged.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum JudgeError {
    #[error(
        "held_out.start_samples of the model is 0, and a held-out record has numbers of its own (fitted starts, per_record): \
         say on how many of its first samples they are fitted"
    )]
    NoStart,
    #[error("{record}: {rows} samples, of which the first {start} are for its start: none is left to judge")]
    Short { record: String, rows: usize, start: usize },
    #[error("{record}: {why}")]
    Failure { record: String, why: Failure },
}

/// Whether records have enough samples for the numbers that the model itself has of each record, before anything is fitted.
pub(crate) fn check(model: &Model, records: &[MeasuredRecord]) -> Result<(), JudgeError> {
    let program = Program::new(model, &[]).expect("it was compiled when the file was read");
    for record in records {
        let one = std::slice::from_ref(record);
        let fitting = Fitting::new(model, program.clone(), one, &[]);
        if fitting.unknowns.iter().any(|unknown| !matches!(unknown.id, UnknownId::Shared(_))) {
            has_start(model.start_samples, record)?;
        }
    }
    Ok(())
}

/// Whether a record has samples for its start, and others.
fn has_start(start: usize, record: &MeasuredRecord) -> Result<(), JudgeError> {
    let (name, rows) = (&record.name, record.time_s.len());
    match start {
        0 => Err(JudgeError::NoStart),
        start if start >= rows => Err(JudgeError::Short { record: name.clone(), rows, start }),
        _ => Ok(()),
    }
}

/// Rms and traces of both models on each held-out record.
pub(crate) fn judge(
    found: &SearchResult<'_>,
    records: &[MeasuredRecord],
) -> Result<(Vec<HeldOutResidual>, Vec<Traces>), JudgeError> {
    let (mut judged, mut traces) = (Vec::new(), Vec::new());
    for (index, record) in records.iter().enumerate() {
        let one = std::slice::from_ref(record);
        let (before, first_row) = residuals(&found.baseline, one)?;
        let (after, _) = residuals(&found.extended, one)?;
        let outputs = before.into_iter().zip(after).enumerate().map(
            |(output, ([residual, predicted], [residual_after, extended]))| {
                let scored_rows = residual[first_row..].iter().filter(|value| value.is_finite()).count();
                let rms_si = [&residual, &residual_after].map(|residual| rms_of(residual, first_row));
                judged.push(HeldOutResidual { record: index, output, rms_si, scored_rows });
                [
                    residual
                        .iter()
                        .zip(&predicted)
                        .map(|(residual, predicted)| residual + predicted)
                        .collect(),
                    predicted,
                    extended,
                ]
            },
        );
        let (outputs, record, time_s) = (outputs.collect(), record.name.clone(), record.time_s.clone());
        traces.push(Traces { record, time_s, outputs, first_row });
    }
    Ok((judged, traces))
}

/// A suspect that explains the training records as well as a named one, in its place.
#[derive(Clone, Debug)]
pub(crate) struct Alternative {
    pub(crate) suspect: usize,
    pub(crate) instead_of: usize,
    /// Residuals under the model alone and with it.
    pub(crate) judged: Vec<HeldOutResidual>,
}

/// Residuals of the same records under the extended model with each alternative that is as good.
pub(crate) fn alternatives(
    rivals: &[Rival<'_>],
    records: &[MeasuredRecord],
    judged: &[HeldOutResidual],
) -> Result<Vec<Alternative>, JudgeError> {
    let of_rival = |rival: &Rival<'_>| {
        let Rival { suspect, instead_of, .. } = *rival;
        let failed = |why: &Failure| JudgeError::Failure { record: "training".into(), why: why.clone() };
        let fit = rival.fit.as_ref().map_err(failed)?;
        let of_record = |one: &HeldOutResidual| {
            let record = std::slice::from_ref(&records[one.record]);
            let (residuals, first_row) = residuals(fit, record)?;
            let rms_si = [one.rms_si[0], rms_of(&residuals[one.output][0], first_row)];
            Ok(HeldOutResidual { rms_si, ..one.clone() })
        };
        let judged = judged.iter().map(of_record).collect::<Result<_, JudgeError>>()?;
        Ok(Alternative { suspect, instead_of, judged })
    };
    rivals.iter().filter(|rival| !rival.is_near).map(of_rival).collect()
}

fn rms_of(residual: &[f64], first_row: usize) -> f64 {
    let scored = residual[first_row..].iter().filter(|value| value.is_finite());
    let (count, squares) =
        scored.fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (squares / count.max(1) as f64).sqrt()
}

/// Residuals of a record under a fitted model, and the first row that is scored.
fn residuals(fitted: &Fitted<'_>, record: &[MeasuredRecord]) -> Result<(OutputSeries, usize), JudgeError> {
    let rows = fitted.fitting.model.start_samples;
    let name = || record[0].name.clone();
    let frozen = Fitting::frozen(&fitted.fitting, &fitted.point, record, &fitted.suspects, rows);
    let failed = |why| JudgeError::Failure { record: name(), why };
    if frozen.unknowns.is_empty() {
        let residuals = frozen.with_all_rows().residuals(&[]).map_err(failed)?;
        return Ok((residuals.into_iter().next().expect("one record"), 0));
    }
    has_start(rows, &record[0])?;
    let (point, _) = frozen.fit_from(starts::starts(&frozen, &[], None), OPTIONS.steps).map_err(failed)?;
    let residuals = frozen.with_all_rows().residuals(&point.values_si).map_err(failed)?;
    Ok((residuals.into_iter().next().expect("one record"), rows))
}

/// What both models say of the training records.
pub(crate) fn trained(found: &SearchResult<'_>) -> Result<Vec<Traces>, Failure> {
    let residuals = |fitted: &Fitted<'_>| fitted.fitting.residuals(&fitted.point.values_si);
    let (before, after) = (residuals(&found.baseline)?, residuals(&found.extended)?);
    let records = found.baseline.fitting.records.iter().zip(before.into_iter().zip(after));
    let traces = records.map(|(record, (before, after))| {
        let outputs = before.into_iter().zip(after).map(|([residual, predicted], [_, extended])| {
            let measured =
                residual.iter().zip(&predicted).map(|(residual, predicted)| residual + predicted).collect();
            [measured, predicted, extended]
        });
        let (outputs, record, time_s) = (outputs.collect(), record.name.clone(), record.time_s.clone());
        Traces { record, time_s, outputs, first_row: 0 }
    });
    Ok(traces.collect())
}
