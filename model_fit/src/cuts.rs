//! Rows in blocks: of time, and in bands of what a model's folds go over.
//!
//! A record that repeats its path repeats an error of the model in every block of time; bands ask whether a term holds at places
//! and speeds that it was not fitted on.
//!
//! Source: Roberts et al. 2017, Ecography 40(8) (blocked folds).

use super::fit::Fitting;
use super::record::MeasuredRecord;

/// Blocks of time of each record.
const BLOCKS_PER_RECORD: usize = 10;
/// Bands of what folds go over beside the time.
const BANDS: usize = 5;

/// Partition of the rows of all records into blocks; rows of the last block are not judged.
#[derive(Clone, Debug)]
pub(crate) struct RowBlocks {
    pub(crate) blocks: usize,
    /// Block of each record and row.
    pub(super) block_of: Vec<Vec<usize>>,
}

impl Fitting<'_> {
    /// Each record in blocks of time.
    pub(crate) fn blocks_in_time(&self) -> RowBlocks {
        let blocks = BLOCKS_PER_RECORD * self.records.len();
        let of_record = |(record, measured): (usize, &MeasuredRecord)| {
            let rows = self.rows(record);
            let block = |row: usize| match measured.is_judged[row] && rows.contains(&row) {
                true => record * BLOCKS_PER_RECORD + (row - rows.start) * BLOCKS_PER_RECORD / rows.len(),
                false => blocks,
            };
            (0..measured.time_s.len()).map(block).collect()
        };
        RowBlocks { blocks, block_of: self.records.iter().enumerate().map(of_record).collect() }
    }

    /// Bands of what folds go over, by its number in the model, each with as many rows of all records.
    pub(crate) fn blocks_in_bands(&self, fold: usize) -> RowBlocks {
        let places = self.records.iter().enumerate();
        let mut order: Vec<(f64, usize, usize)> = places
            .flat_map(|(record, measured)| {
                let judged = (0..measured.time_s.len()).filter(|row| measured.is_judged[*row]);
                judged.map(move |row| (measured.folds[fold][row], record, row))
            })
            .collect();
        order.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut block_of: Vec<Vec<usize>> =
            self.records.iter().map(|measured| vec![BANDS; measured.time_s.len()]).collect();
        for (place, (_, record, row)) in order.iter().enumerate() {
            block_of[*record][*row] = place * BANDS / order.len();
        }
        RowBlocks { blocks: BANDS, block_of }
    }
}
