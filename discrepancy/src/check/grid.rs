//! Rows on a regular grid of the record's period, so that lags and differences stay right where rows are missing.

use super::notes::Notes;
use model_fit::SPARSEST;
use model_fit::stats::median;
use records::{Channel, Record};

/// Indices of a record's rows in units of its period.
#[derive(Debug)]
pub(super) struct Grid {
    /// Usual time from row to row, s.
    pub(super) period_s: f64,
    /// The row of each place, if there is one.
    pub(super) rows: Vec<Option<usize>>,
}

impl Grid {
    /// The grid of the rows whose time was found good.
    pub(super) fn of(record: &Record, notes: &Notes) -> Grid {
        let times = record.time_s();
        let period_s = period_s(times).unwrap_or(1e-3);
        let any = record.channels().next();
        let bad = |row: &usize| any.is_some_and(|any| notes.is_left_out(any, *row));
        let good: Vec<usize> = (0..times.len()).filter(|row| !bad(row)).collect();
        let [Some(first), Some(last)] = [good.first().copied(), good.last().copied()] else {
            return Grid { period_s, rows: Vec::new() };
        };
        let place = |row: usize| ((times[row] - times[first]) / period_s).round();
        let most = (SPARSEST * good.len()) as f64;
        if !place(last).is_finite() || place(last) > most {
            return Grid { period_s, rows: good.into_iter().map(Some).collect() };
        }
        let mut rows = vec![None; place(last).max(0.0) as usize + 1];
        for row in good {
            rows[place(row).max(0.0) as usize] = Some(row);
        }
        Grid { period_s, rows }
    }

    /// A channel's good samples on the grid.
    pub(super) fn series(&self, notes: &Notes, channel: Channel) -> Vec<Option<f64>> {
        self.rows.iter().map(|row| row.and_then(|row| notes.value(channel, row))).collect()
    }
}

/// Step of time where it goes forward, s: the mean of the usual ones, so that neither holes nor jitter count; `None` when it
/// never does.
pub(super) fn period_s(times_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        times_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let middle = median(&mut steps)?;
    let usual = steps.iter().filter(|step| (0.5 * middle..1.5 * middle).contains(*step));
    let (sum_s, count) = usual.fold((0.0, 0_usize), |(sum_s, count), step| (sum_s + step, count + 1));
    Some(if count == 0 { middle } else { sum_s / count as f64 })
}
