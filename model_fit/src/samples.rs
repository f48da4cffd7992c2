//! All measured samples of all records, row after row, each times the scale of its output: what was measured, what the model
//! says, and its derivatives.

use super::fit::{Fitting, OutputSeries};
use super::record::MeasuredRecord;
use model::Failure;

impl Fitting<'_> {
    /// Residuals and predictions, record by record, output by output; a residual is NaN where nothing was measured.
    pub(crate) fn residuals(&self, values_si: &[f64]) -> Result<Vec<OutputSeries>, Failure> {
        let mut all = Vec::new();
        for (record, measured) in self.records.iter().enumerate() {
            let mut of_record =
                vec![
                    [vec![f64::NAN; measured.time_s.len()], vec![f64::NAN; measured.time_s.len()]];
                    measured.outputs.len()
                ];
            self.simulate(record, values_si, false, |row, output, value, _| {
                of_record[output][1][row] = value;
                of_record[output][0][row] = measured.outputs[output][row].map_or(f64::NAN, |y| y - value);
            })?;
            all.push(of_record);
        }
        Ok(all)
    }

    /// All measured samples that a model is held against, row after row, times the scale of their output.
    pub(crate) fn measured(&self, scale: &[f64]) -> Vec<f64> {
        let of_record = |record: &MeasuredRecord| -> Vec<f64> {
            let row = |row: usize| {
                let outputs = record.outputs.iter().zip(scale);
                outputs.filter_map(move |(output, scale)| Some(scale * output[row]?)).collect::<Vec<f64>>()
            };
            (0..record.time_s.len()).flat_map(row).collect()
        };
        self.records.iter().flat_map(of_record).collect()
    }

    /// Of which output each of these is.
    pub(crate) fn outputs_of_samples(&self) -> Vec<usize> {
        let mut all = Vec::new();
        for record in self.records {
            for row in 0..record.time_s.len() {
                all.extend((0..record.outputs.len()).filter(|output| record.outputs[*output][row].is_some()));
            }
        }
        all
    }

    /// What the model says of these.
    pub(crate) fn predictions(&self, values_si: &[f64], scale: &[f64]) -> Result<Vec<f64>, Failure> {
        let mut values = Vec::new();
        for record in 0..self.records.len() {
            let measured = &self.records[record].outputs;
            self.simulate(record, values_si, false, |row, output, value, _| {
                if measured[output][row].is_some() {
                    values.push(scale[output] * value);
                }
            })?;
        }
        Ok(values)
    }

    /// Derivatives and values of all measured samples, row after row, times the scale of their output.
    pub(crate) fn sensitivities(
        &self,
        values_si: &[f64],
        scale: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let (mut slopes, mut values) = (Vec::new(), Vec::new());
        for record in 0..self.records.len() {
            let (measured, mine) = (&self.records[record].outputs, self.of_record(record));
            self.simulate(record, values_si, true, |row, output, value, slope| {
                if measured[output][row].is_none() {
                    return;
                }
                values.push(scale[output] * value);
                let first = slopes.len();
                slopes.resize(first + self.unknowns.len(), 0.0);
                for (place, slope) in mine.iter().zip(slope) {
                    slopes[first + place] = scale[output] * slope;
                }
            })?;
        }
        Ok((slopes, values))
    }
}
