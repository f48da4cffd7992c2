//! Subsampling of a long record: blocks of windows, spread evenly.
//!
//! ```text
//!   |......|lead|judged judged judged judged judged|............|lead|judged ...
//! ```
//!
//! The first window of a block only fills lags and internal states and counts as a gap ([`GriddedRecord::excluded_periods`]).

use super::GriddedRecord;
use crate::windows::WINDOW_PERIODS;

/// Windows of a block, the first included.
const BLOCK_WINDOWS: usize = 6;

/// Seconds of measured axes in the search; the final fit uses all of the records.
pub(crate) const SEARCHED_S: f64 = 20.0;

pub(crate) fn searched_share(records: &[GriddedRecord]) -> f64 {
    let axes = |record: &GriddedRecord| record.measured.iter().filter(|measured| **measured).count();
    let all_s: f64 =
        records.iter().map(|record| record.len() as f64 * plant::PERIOD_S * axes(record) as f64).sum();
    (SEARCHED_S / all_s).min(1.0)
}

impl GriddedRecord {
    /// About this share of the record; `None` where that is all of it or where it has too few blocks.
    pub(crate) fn thinned(&self, share: f64) -> Option<GriddedRecord> {
        let blocks = self.len() / (BLOCK_WINDOWS * WINDOW_PERIODS);
        let wanted = (share * blocks as f64).round().max(1.0) as usize;
        if share >= 1.0 || wanted >= blocks {
            return None;
        }
        let mut part = GriddedRecord {
            inputs: Vec::new(),
            samples: Vec::new(),
            smoothed_states: Vec::new(),
            memories: Vec::new(),
            excluded_periods: Vec::new(),
            blocks: Vec::new(),
            ..self.clone()
        };
        for chosen in 0..wanted {
            // The middle block of each of `wanted` equal parts.
            let block = (2 * chosen + 1) * blocks / (2 * wanted);
            let places = block * BLOCK_WINDOWS * WINDOW_PERIODS..(block + 1) * BLOCK_WINDOWS * WINDOW_PERIODS;
            part.blocks.push(places.start);
            part.inputs.extend_from_slice(&self.inputs[places.clone()]);
            part.samples.extend_from_slice(&self.samples[places.clone()]);
            part.smoothed_states.extend_from_slice(&self.smoothed_states[places.clone()]);
            part.memories.extend(self.memories.get(places.clone()).into_iter().flatten());
            part.excluded_periods.extend_from_slice(&self.excluded_periods[places]);
            let began = part.excluded_periods.len() - BLOCK_WINDOWS * WINDOW_PERIODS;
            part.excluded_periods[began..began + WINDOW_PERIODS].fill(true);
        }
        Some(part)
    }

    /// Periods from the first row of the whole record to a period of this one.
    pub(crate) fn since_start(&self, period: usize) -> usize {
        let first = self.blocks.get(period / (BLOCK_WINDOWS * WINDOW_PERIODS));
        first.map_or(period, |first| first + period % (BLOCK_WINDOWS * WINDOW_PERIODS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::Inputs;

    fn record(periods: usize) -> GriddedRecord {
        let inputs = |at: usize| Inputs { valve: [at as f64, 0.0], ..Inputs::default() };
        GriddedRecord {
            measured: [true, true],
            inputs: (0..periods).map(inputs).collect(),
            samples: vec![[[None; super::super::CHANNELS]; 2]; periods],
            smoothed_states: vec![[super::super::AxisState::default(); 2]; periods],
            excluded_periods: vec![false; periods],
            ..GriddedRecord::default()
        }
    }

    #[test]
    fn a_part_is_whole_blocks_from_everywhere_each_with_a_lead_in() {
        let all = record(48_000);
        assert_eq!(searched_share(std::slice::from_ref(&all)), 20.0 / 96.0);
        let part = all.thinned(0.2).unwrap();
        assert_eq!(part.len(), 4 * BLOCK_WINDOWS * WINDOW_PERIODS);
        let firsts = part.inputs.iter().step_by(BLOCK_WINDOWS * WINDOW_PERIODS);
        let began: Vec<f64> = firsts.map(|inputs| inputs.valve[0]).collect();
        assert_eq!(began, [4800.0, 16_800.0, 28_800.0, 40_800.0]);
        assert_eq!([0, 2399, 2400, 7201].map(|at| part.since_start(at)), [4800, 7199, 16_800, 40_801]);
        assert_eq!(all.since_start(7201), 7201);
        let lead_in = part.excluded_periods.iter().filter(|gap| **gap).count();
        assert_eq!(lead_in, 4 * WINDOW_PERIODS);
        assert!((0..4).all(|block| part.excluded_periods[block * BLOCK_WINDOWS * WINDOW_PERIODS]
            && !part.excluded_periods[block * BLOCK_WINDOWS * WINDOW_PERIODS + WINDOW_PERIODS]));
    }

    #[test]
    fn a_short_record_is_taken_whole() {
        assert!(record(20_000).thinned(1.0).is_none());
        assert!(record(2_400).thinned(0.5).is_none());
        assert_eq!(searched_share(&[record(10_000)]), 1.0);
    }
}
