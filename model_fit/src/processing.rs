//! A record made ready for a model: an even grid where one is asked for, smoothed inputs and their rates, rows behind a filter.
//!
//! ```text
//!   columns ─► even grid ─► inputs: low pass or moving average ─► rates by central differences
//!           ─► outputs: zero-phase Chebyshev I, every n-th sample ─► rows that meet the condition
//! ```
//!
//! Source: Janot, Gautier, Brunot 2019 (processing of EMPS).

use super::filter::LowPass;
use super::look::{HOLE, is_in_hole, usual_period_s};
use super::record::{FEWEST_ROWS, MeasuredRecord, RecordError};
use super::report::significant;
use model::{Hold, Input, Inputs, Model};

/// Places for each row that a record may need at most; one with larger holes is taken row by row.
pub const SPARSEST: usize = 20;
/// Share of the period by which a sample may be beside an even grid.
const BESIDE: f64 = 0.01;

/// Times of the samples that a model is simulated over.
pub(super) struct Grid {
    sampled_s: Vec<f64>,
    /// Distance of an even grid; `None` where the record is taken as it is.
    period_s: Option<f64>,
    /// Whether its samples are the rows of the record.
    is_record: bool,
}

/// File, name and notes of a record.
pub(super) struct RecordInfo {
    pub(super) file: String,
    pub(super) name: String,
    pub(super) notes: Vec<String>,
}

impl Grid {
    pub(super) fn of(model: &Model, file: &str, time_s: &[f64], lines: &[u64]) -> Result<Self, RecordError> {
        let asks = model.rows.every > 1
            || model.inputs.iter().any(|input| {
                let smoothing = input.smoothing;
                input.rate_of.is_some() || smoothing.low_pass_hz > 0.0 || smoothing.moving_average > 1
            });
        let period_s = match model.record.period_s {
            None if !asks => {
                return Ok(Self { sampled_s: time_s.to_vec(), period_s: None, is_record: true });
            }
            Some(period_s) => period_s,
            None => time_s[1] - time_s[0],
        };
        let beside = |pair: &[f64]| (pair[1] - pair[0] - period_s).abs() > BESIDE * period_s;
        let Some(uneven) = time_s.windows(2).position(beside) else {
            return Ok(Self { sampled_s: time_s.to_vec(), period_s: Some(period_s), is_record: true });
        };
        let file = file.to_owned();
        if model.record.period_s.is_none() {
            return Err(RecordError::Uneven { file, line: lines[uneven + 1], time_s: time_s[uneven + 1] });
        }
        let (first_s, last) = (time_s[0], time_s.len() - 1);
        let samples = ((time_s[last] - first_s) / period_s).ceil();
        if samples > (SPARSEST * time_s.len()) as f64 {
            let (line, time_s, rows) = (lines[last], time_s[last], time_s.len());
            return Err(RecordError::Far { file, line, time_s, rows, period_s });
        }
        let sampled_s = (0..samples as usize).map(|at| first_s + at as f64 * period_s).collect();
        Ok(Self { sampled_s, period_s: Some(period_s), is_record: false })
    }

    /// Samples of an input on the grid, its holes by its hold.
    pub(super) fn filled(&self, time_s: &[f64], values: &[Option<f64>], hold: Hold, factor: f64) -> Vec<f64> {
        match self.is_record {
            true => filled(time_s, values, hold, factor),
            false => straight(time_s, values, &self.sampled_s, factor),
        }
    }

    /// Samples of an output: as they were measured, or straight between them on a grid of its own, but in no hole.
    pub(super) fn outputs(&self, time_s: &[f64], values: &[Option<f64>], factor: f64) -> Vec<Option<f64>> {
        match self.is_record {
            true => values.iter().map(|value| value.map(|value| value * factor)).collect(),
            false => {
                let known_s = known_s(time_s, values);
                let farthest_s = HOLE * usual_period_s(&known_s).max(self.period_s.unwrap_or(0.0));
                let all = straight(time_s, values, &self.sampled_s, factor);
                let measured =
                    |(value, at_s): (f64, &f64)| (!is_in_hole(&known_s, *at_s, farthest_s)).then_some(value);
                all.into_iter().zip(&self.sampled_s).map(measured).collect()
            }
        }
    }

    /// Inputs in the order of the model, smoothed, and the rates among them.
    pub(super) fn inputs(
        &self,
        model: &Model,
        file: &str,
        samples: Vec<Vec<f64>>,
    ) -> Result<Vec<Vec<f64>>, RecordError> {
        let Some(period_s) = self.period_s else { return Ok(samples) };
        let mut samples = samples.into_iter();
        let mut all: Vec<Vec<f64>> = Vec::with_capacity(model.inputs.len());
        for input in &model.inputs {
            let raw = match input.rate_of {
                Some(of) => gradient(&all[of], period_s),
                None => samples.next().expect("a column for each input that is no rate"),
            };
            let smoothing = input.smoothing;
            let smooth = if smoothing.low_pass_hz > 0.0 {
                let edge = smoothing.low_pass_hz * 2.0 * period_s;
                if edge >= 1.0 {
                    let (file, name) = (file.to_owned(), input.name.clone());
                    let (edge_hz, sampling_hz) = (smoothing.low_pass_hz, period_s.recip());
                    return Err(RecordError::Edge { file, name, edge_hz, sampling_hz });
                }
                LowPass::butterworth(smoothing.low_pass_order, edge).zero_phase(&raw)
            } else {
                raw
            };
            all.push(moving_average(&smooth, smoothing.moving_average));
        }
        Ok(all)
    }

    /// The record with its rows.
    pub(super) fn compared(
        self,
        model: &Model,
        RecordInfo { file, name, notes }: RecordInfo,
        inputs: Vec<Vec<f64>>,
        outputs: Vec<Vec<Option<f64>>>,
    ) -> Result<MeasuredRecord, RecordError> {
        let of_model = &model.rows;
        let thinning = (of_model.every > 1).then(|| {
            let edge = of_model.edge / of_model.every as f64;
            LowPass::chebyshev(of_model.order, of_model.ripple_decibel, edge)
        });
        let sampled_s = self.sampled_s;
        let samples = Inputs { time_s: &sampled_s, samples_si: &inputs };
        let condition = of_model.condition.as_ref().map(|condition| model.at_samples(condition, &samples));
        let counts = |row: &usize| condition.as_ref().is_none_or(|values| values[*row] != 0.0);
        let rows: Vec<usize> = (0..sampled_s.len()).step_by(of_model.every).filter(counts).collect();
        if rows.len() < FEWEST_ROWS {
            return Err(RecordError::FewMeet { file, rows: rows.len(), why: few(model, &samples) });
        }
        let of_rows = |values: &[f64]| -> Vec<f64> { rows.iter().map(|row| values[*row]).collect() };
        let folds = of_model.folds.iter().map(|fold| of_rows(&model.at_samples(fold, &samples))).collect();
        let outputs = outputs.into_iter().map(|values| match &thinning {
            None => rows.iter().map(|row| values[*row]).collect(),
            Some(filter) => {
                let whole = straight(&sampled_s, &values, &sampled_s, 1.0);
                let filtered = of_rows(&filter.zero_phase(&whole));
                let known_s = known_s(&sampled_s, &values);
                let farthest_s = HOLE * usual_period_s(&sampled_s);
                let measured = |(value, row): (f64, &usize)| {
                    (!is_in_hole(&known_s, sampled_s[*row], farthest_s)).then_some(value)
                };
                filtered.into_iter().zip(&rows).map(measured).collect()
            }
        });
        let outputs = outputs.collect();
        let time_s = of_rows(&sampled_s);
        let (first_s, last_s) = (sampled_s[0], sampled_s[sampled_s.len() - 1]);
        let inside = |at_s: &f64| at_s - first_s >= of_model.ends_s && last_s - at_s >= of_model.ends_s;
        let is_judged = time_s.iter().map(inside).collect();
        let file = file.into();
        Ok(MeasuredRecord {
            file,
            name,
            sampled_s,
            inputs,
            rows,
            time_s,
            outputs,
            thinning,
            is_judged,
            folds,
            notes,
        })
    }
}

impl MeasuredRecord {
    /// Samples that are simulated so that the first of its rows are reached; all of them before a filter.
    pub(super) fn samples_of(&self, rows: usize) -> usize {
        match self.thinning {
            None => rows.checked_sub(1).map_or(0, |last| self.rows[last] + 1),
            Some(_) => self.sampled_s.len(),
        }
    }
}

/// Why few rows meet `[rows]`: what its condition reads, from least to most, or how far the record reaches.
fn few(model: &Model, Inputs { time_s, samples_si }: &Inputs<'_>) -> String {
    let length_s = significant(time_s[time_s.len() - 1] - time_s[0]);
    let whole = format!("{} samples over {length_s} s, one of {} is a row", time_s.len(), model.rows.every);
    let Some(condition) = &model.rows.condition else {
        return format!("{whole}: is unit of the time right, and period_s, under [record]?");
    };
    let is_of_name = |character: char| character.is_alphanumeric() || character == '_';
    let words: Vec<&str> = condition.text.split(|character| !is_of_name(character)).collect();
    let read = model.inputs.iter().zip(*samples_si).filter(|(input, _)| words.contains(&input.name.as_str()));
    let range = |(input, values): (&Input, &Vec<f64>)| {
        let of = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).unwrap_or(f64::NAN);
        let [least, most] = [of(f64::min), of(f64::max)].map(|end| significant(end / input.unit.factor));
        format!("{} is {least} to {most} {}", input.name, input.unit.text)
    };
    let ranges: Vec<String> = read.map(range).collect();
    format!(
        "where {}, and {}; {whole}: are the units of these inputs, their columns and that of the time right?",
        condition.text,
        ranges.join(", ")
    )
}

/// Missing samples by the hold of their input: the last value, or straight between neighbours.
fn filled(time_s: &[f64], values: &[Option<f64>], hold: Hold, factor: f64) -> Vec<f64> {
    let known: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_some()).collect();
    let value = |place: usize| values[known[place]].expect("it is known") * factor;
    (0..values.len())
        .map(|row| {
            let right = known.partition_point(|known| *known <= row);
            match (right, hold) {
                (0, _) => value(0),
                (right, Hold::Linear) if right < known.len() => {
                    let [from_s, to_s] = [time_s[known[right - 1]], time_s[known[right]]];
                    let share = (time_s[row] - from_s) / (to_s - from_s);
                    value(right - 1) + share * (value(right) - value(right - 1))
                }
                (right, _) => value(right - 1),
            }
        })
        .collect()
}

fn known_s(time_s: &[f64], values: &[Option<f64>]) -> Vec<f64> {
    time_s.iter().zip(values).filter(|(_, value)| value.is_some()).map(|(time_s, _)| *time_s).collect()
}

/// Straight lines between what is known; level beyond. Nothing known is 0.
fn straight(time_s: &[f64], values: &[Option<f64>], at_s: &[f64], factor: f64) -> Vec<f64> {
    let known: Vec<(f64, f64)> =
        time_s.iter().zip(values).filter_map(|(time, value)| Some((*time, (*value)? * factor))).collect();
    let mut next = 0;
    let value = |at: &f64| {
        while next < known.len() && known[next].0 < *at {
            next += 1;
        }
        match (next.checked_sub(1).map(|before| known[before]), known.get(next)) {
            (Some((t0, y0)), Some((t1, y1))) => y0 + (y1 - y0) * (at - t0) / (t1 - t0),
            (Some((_, y)), None) => y,
            (None, Some((_, y))) => *y,
            (None, None) => 0.0,
        }
    };
    at_s.iter().map(value).collect()
}

/// Differences over two periods, over one at the ends; per second.
fn gradient(samples: &[f64], period_s: f64) -> Vec<f64> {
    let last = samples.len() - 1;
    (0..samples.len())
        .map(|at| {
            let (from, to) = (at.saturating_sub(1), (at + 1).min(last));
            (samples[to] - samples[from]) / ((to - from) as f64 * period_s)
        })
        .collect()
}

/// Mean of `width` samples around each, of those that are there at the ends.
fn moving_average(samples: &[f64], width: usize) -> Vec<f64> {
    let reach = width / 2;
    (0..samples.len())
        .map(|at| {
            let part = &samples[at.saturating_sub(reach)..(at + reach + 1).min(samples.len())];
            part.iter().sum::<f64>() / part.len() as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_has_its_slope_everywhere() {
        let line: Vec<f64> = (0..20).map(|at| 0.5 * f64::from(at)).collect();
        assert!(gradient(&line, 0.01).iter().all(|slope| (slope - 50.0).abs() < 1e-9));
        let smooth = moving_average(&line, 5);
        assert!((smooth[10] - line[10]).abs() < 1e-12);
        // At an end the mean of the three that are there.
        assert_eq!(smooth[0], 0.5);
    }
}
