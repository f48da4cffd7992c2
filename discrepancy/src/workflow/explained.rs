//! The search for what is missing, alone.

use super::{RigFile, Task, WorkflowError, findings, on_shared_axes, open_all, parts};
use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::gridded_record::{GriddedRecord, searched_share};
use crate::name::{SelectionResult, name, weigh_by_marginal_likelihood};
use crate::report;

/// The explanations of the training records alone, with their evidence: the search without what follows it. Empty where a record
/// cannot be used.
///
/// # Errors
/// [`WorkflowError`] as of [`super::close`].
pub fn explained(
    task: &Task,
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<report::Explanation>, WorkflowError> {
    let rig_file = RigFile::read(&task.rig)?;
    let opened = open_all(task, &rig_file.rig, progress)?;
    let mut records: Vec<GriddedRecord> = opened.into_iter().filter_map(|opened| opened.gridded).collect();
    if records.len() < task.train.len() {
        return Ok(Vec::new());
    }
    on_shared_axes(&mut records)?;
    let searched = parts(&records, searched_share(&records));
    let engine = Engine::for_search(&searched, &rig_file.rig);
    Ok(findings::explanations(&searched_for(&engine, &records, task, progress)))
}

/// Searches records, or parts of them, for what is missing.
pub(super) fn searched_for(
    engine: &Engine<'_>,
    records: &[GriddedRecord],
    task: &Task,
    progress: &mut dyn FnMut(&str),
) -> SelectionResult {
    let linked = records.iter().any(|record| record.linked);
    let (rig, measured) = (&engine.rig, records[0].measured);
    let mut candidates = Candidate::all(rig, measured, linked, &task.without);
    candidates.extend(Candidate::of_suspects(rig, measured, &task.suspects));
    let mut found = name(engine, candidates, progress);
    if task.marginal_likelihoods {
        progress("marginal likelihoods");
        weigh_by_marginal_likelihood(engine, &mut found);
    }
    found
}
