//! The next experiment of an ambiguous report: its explanations, as rigs.

use super::{RigFile, extended, measured, on_shared_axes, open, parts};
use crate::engine::Engine;
use crate::gridded_record::{GriddedRecord, searched_share};
use crate::next::noise::ReadingNoise;
use crate::next::{self, Explanation, Proposal, Question};
use crate::report::{NamedEffect, NextExperiment, Report};
use plant::RigParameters;
use records::ReadOptions;
use std::path::Path;

/// Proposes an experiment for an ambiguous report; `None` when it is not ambiguous.
///
/// Noise and errors of the model are those of the training records, where they can still be read as the report names them;
/// else the noise is the rig file's, and the explanations are taken as exact.
pub(crate) fn proposal(
    rig_file: &RigFile,
    reported: &Report,
    progress: &mut dyn FnMut(&str),
) -> Option<Proposal> {
    let records = training(rig_file, reported).unwrap_or_default();
    let engine = (!records.is_empty()).then(|| Engine::new(&records, &rig_file.rig));
    proposal_for(rig_file, reported, engine.as_ref(), progress)
}

/// The part of the training records that was searched.
fn training(rig_file: &RigFile, reported: &Report) -> Option<Vec<GriddedRecord>> {
    let read = |file: &String| open(Path::new(file), &ReadOptions::default(), &rig_file.rig).ok()?.gridded;
    let mut records: Vec<GriddedRecord> = reported.inputs.train.iter().map(read).collect::<Option<_>>()?;
    on_shared_axes(&mut records).ok()?;
    let share = searched_share(&records);
    Some(if share < 1.0 { parts(&records, share) } else { records })
}

pub(super) fn proposal_for(
    rig_file: &RigFile,
    reported: &Report,
    training: Option<&Engine<'_>>,
    progress: &mut dyn FnMut(&str),
) -> Option<Proposal> {
    let at = reported.named.iter().position(|named| !named.alternatives.is_empty())?;
    let others = &reported.named[at].alternatives;
    let explanations: Vec<Explanation> = std::iter::once(&reported.named[at])
        .chain(others)
        .filter_map(|alternative| {
            let mut with = reported.clone();
            with.named[at] = alternative.clone();
            let rig = RigParameters::from_toml(&extended(rig_file, &with).ok()?, &rig_file.file).ok()?;
            let errors = with.named.iter().chain(&with.small).map(|effect| (name(effect), errors(effect)));
            let errors = errors.collect();
            Some(Explanation { rig, names: with.named.iter().map(name).collect(), errors })
        })
        .collect();
    if explanations.len() < 2 {
        let reason = format!(
            "{} and what explains as much cannot both be written into the rig file beside the rest: nothing can be rehearsed",
            name(&reported.named[at])
        );
        let next = NextExperiment { reason, ..NextExperiment::default() };
        return Some(Proposal { next, experiment_toml: None, rehearsed: Vec::new() });
    }
    let baseline = &rig_file.rig;
    let noise = match training.and_then(|engine| engine.windows.first()) {
        Some(windows) => ReadingNoise::of(windows.record, baseline),
        None => ReadingNoise::specified(baseline),
    };
    let question = Question {
        baseline,
        explanations: &explanations,
        axes_measured: measured(reported),
        noise: &noise,
        training,
    };
    Some(next::propose(question, progress))
}

fn name(effect: &NamedEffect) -> String {
    format!("{} {}", effect.effect, effect.place)
}

fn errors(effect: &NamedEffect) -> Vec<Option<f64>> {
    effect.parameters.iter().map(|number| number.standard_error).collect()
}
