//! What is computed before any program is judged: limits and classes, from records with known truth.

use crate::SCHEMA_VERSION;
use crate::classes::{Classes, DrawClasses, classes_of, read_draw};
use crate::draws::Draw;
use crate::folder::{FolderError, Study, write_whole};
use crate::limits::{Limits, limits_in};
use crate::nearest::nearest_law;
use crate::signature::Observer;
use crate::trajectory::{Point, TrueTrajectory, WINDOW};
use plant::{Axis, AxisState, Inputs, ParameterError, RigParameters, State};
use rayon::prelude::*;
use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};
use record_maker::{MakeError, Recipe, Record, simulate};
use serde_json::json;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

#[derive(Debug, thiserror::Error)]
pub enum ComputeError {
    #[error("draw {number}: {error}")]
    Make { number: usize, error: MakeError },
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("no threads: {0}")]
    Threads(#[from] ThreadPoolBuildError),
    #[error("{count} draws have no classes yet: run the command to its end")]
    Missing { count: usize },
}

/// Computes the limits of all effects at all places, from train records of `seed` with nothing hidden; `say` gets a line for
/// each.
pub fn limits(seed: u64, say: &(dyn Fn(&str) + Sync)) -> Result<Limits, ComputeError> {
    let rig = RigParameters::baseline();
    let mut limits = Vec::new();
    for measured in [Some(Axis::Drive), Some(Axis::Load), None] {
        let axis = measured.unwrap_or(Axis::Drive);
        let recipe = Recipe { seed, axis, both_axes: measured.is_none(), ..Recipe::default() };
        let record = simulate(&recipe, &rig).map_err(|error| ComputeError::Make { number: 0, error })?;
        limits.extend(limits_in(&Observer::new(trajectory(&record, &rig)), measured, say)?);
    }
    Ok(Limits { schema_version: SCHEMA_VERSION, window_ms: WINDOW as u32, seed, limits })
}

/// The true trajectory of a record for an observer with this rig file.
pub(crate) fn trajectory(record: &Record, rig: &RigParameters) -> TrueTrajectory {
    let (both, axis) = (record.recipe.both_axes, record.recipe.axis);
    let row = &record.rows[0];
    let state_of = |i: usize| {
        let true_axis = &row.axes[i];
        let volume = |area_m2: f64, way_m: f64| rig.cylinder().dead_volume_m3 + area_m2 * way_m;
        let cylinder = rig.cylinder();
        AxisState {
            extension_m: true_axis.extension_m.clamp(0.0, cylinder.stroke_m),
            rod_velocity_m_per_s: 0.0,
            spool: 0.0,
            stored_air_a_j: true_axis.pressure_pa[0] * volume(cylinder.piston_area_m2, true_axis.extension_m),
            stored_air_b_j: true_axis.pressure_pa[1]
                * volume(cylinder.annulus_area_m2, cylinder.stroke_m - true_axis.extension_m),
            flow_a_m3_per_s: 0.0,
            flow_b_m3_per_s: 0.0,
        }
    };
    let point = |axis: record_maker::TrueAxis| Point {
        extension_m: axis.extension_m,
        rod_velocity_m_per_s: axis.rod_velocity_m_per_s,
        pressures_pa: axis.pressure_pa,
    };
    TrueTrajectory {
        rig: rig.clone(),
        measured: Axis::ALL.map(|each| both || each == axis),
        start: State {
            axes: [state_of(0), state_of(1)],
            supply_pressure_pa: rig.supply().pressure_pa,
            emergency_stop: false,
            linked: record.linked,
            added_mass_kg: record.added_mass_kg,
        },
        settling: 1,
        inputs: record.rows.iter().map(|row| Inputs { valve: row.valve, ..Inputs::default() }).collect(),
        points: record.rows.iter().map(|row| row.axes.map(point)).collect(),
    }
}

/// Computes and writes the classes of all draws with hidden effects that have none yet, `jobs` at a time, until `stop` is set.
/// With a label `done`, only those of draws that have a result under it. `say` gets a line for each.
pub fn classes(
    study: &Study,
    done: Option<&str>,
    jobs: usize,
    stop: &AtomicBool,
    say: &(dyn Fn(&str) + Sync),
) -> Result<(), ComputeError> {
    let is_done = |number| done.is_none_or(|label| study.run(label, number).join("result.json").exists());
    let is_missing = |draw: &&Draw| !study.class(draw.number).exists() && is_done(draw.number);
    let missing: Vec<&Draw> = draws_with_effects(study).filter(is_missing).collect();
    let pool = ThreadPoolBuilder::new().num_threads(jobs.max(1)).build()?;
    let computed = AtomicUsize::new(0);
    let all = missing.len();
    pool.install(|| {
        missing.into_par_iter().with_max_len(1).try_for_each(|draw| {
            if stop.load(Ordering::Relaxed) {
                return Ok(());
            }
            compute_classes(study, draw)?;
            say(&format!("classes {} of {all}", computed.fetch_add(1, Ordering::Relaxed) + 1));
            Ok(())
        })
    })
}

fn draws_with_effects(study: &Study) -> impl Iterator<Item = &Draw> {
    study.draws.iter().filter(|draw| !draw.recipe.hidden.is_empty())
}

fn compute_classes(study: &Study, draw: &Draw) -> Result<(), ComputeError> {
    let (number, rig) = (draw.number, RigParameters::baseline());
    let record = simulate(&draw.recipe, &rig).map_err(|error| ComputeError::Make { number, error })?;
    let mut classes = classes_of(draw, trajectory(&record, &rig))?;
    if draw.recipe.form.is_foreign() {
        for (class, hidden) in classes.hidden.iter_mut().zip(&draw.recipe.hidden) {
            class.nearest = nearest_law(draw, hidden)?;
        }
    }
    write_whole(&study.class(number), format!("{:#}\n", json!(classes)).as_bytes())?;
    Ok(())
}

/// The classes of all draws of a study.
///
/// # Errors
/// [`ComputeError::Missing`] when draws have no classes yet, [`ComputeError::Folder`] when a file cannot be read.
pub fn collected(study: &Study) -> Result<Classes, ComputeError> {
    let count = draws_with_effects(study).filter(|draw| !study.class(draw.number).exists()).count();
    if count > 0 {
        return Err(ComputeError::Missing { count });
    }
    let read = |draw: &Draw| read_draw(&study.class(draw.number), draw.number);
    let draws = draws_with_effects(study).map(read).collect::<Result<Vec<DrawClasses>, _>>()?;
    Ok(Classes { plan: study.plan, draws })
}

/// Text of the committed classes: JSON with a line for each draw, so that a diff shows which draws changed.
pub fn classes_text(classes: &Classes) -> String {
    let draws: Vec<_> = classes.draws.iter().map(|draw| json!(draw).to_string()).collect();
    format!("{{\"plan\": {},\n\"draws\": [\n{}\n]}}\n", json!(classes.plan), draws.join(",\n"))
}
