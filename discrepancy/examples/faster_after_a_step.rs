//! Which effects make a rig faster than its simulation right after a step, as a Markdown table.
//!
//! The paper's rig was: pressures and velocity rose sooner than its simulation said. Each effect of the catalogue, at
//! half of the strongest change that occurs, and each number that may be wrong, is driven through the closed-loop step of
//! Fig. 7 by the controller's rehearsal without sensor noise, its numbers the baseline's. What the sensors show in the
//! first 50 ms after the valve's edge is compared with the baseline's, each as a change since the edge, counted in the
//! direction in which the baseline goes: positive is faster.
//!
//! `cargo run --release -p discrepancy --example faster_after_a_step`; document: `docs/faster-after-a-step.md`.

#![allow(clippy::print_stdout)]

use discrepancy::candidates::Candidate;
use discrepancy::next::closed_loop::{ClosedLoopRun, SEED, drive};
use discrepancy::next::menu::Entry;
use discrepancy::parameters::PARAMETERS;
use plant::{Plant, RigParameters};
use rayon::prelude::*;

const STEP: Entry =
    Entry { name: "step", purpose: "", toml: include_str!("../../controller/experiments/step.toml") };
/// Periods that are compared.
const COMPARED: usize = 50;
/// Jump of the valve's command that is an edge.
const EDGE: f64 = 0.3;
/// Standard deviations from which on a difference counts.
const SEEN: f64 = 3.0;

/// What is compared: velocity in mm/s, pressures in kPa, since the edge.
type Changes = Vec<[f64; 3]>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let baseline = RigParameters::baseline();
    let sensors = baseline.sensors();
    // A local parabola over 21 samples: the slope's standard error is sigma sqrt(3 / (n (n + 1) (2 n + 1))), n = 10.
    let noise = [
        1e3 * sensors.position_noise_m / 1e-3 * (3.0_f64 / (10.0 * 11.0 * 21.0)).sqrt(),
        1e-3 * sensors.pressure_noise_pa,
        1e-3 * sensors.pressure_noise_pa,
    ];
    let quiet = ["sensors.position_noise_um", "sensors.force_noise_n", "sensors.pressure_noise_pa"]
        .iter()
        .try_fold(baseline, |rig, key| rig.with(key, &[0.0]))?;
    let quiet = &quiet;
    let driven = drive(&STEP, quiet, quiet, SEED)?;
    let began = driven.began.ok_or("the baseline does not come to its step")?;
    let edge = edge(&driven, began).ok_or("no edge of the valve")?;
    let hidden = changes(quiet, &driven, edge)?;
    let last = hidden[COMPARED - 1];
    println!(
        "Baseline after 50 ms: {:.0} mm/s, p_a {:+.0} kPa, p_b {:+.0} kPa.\n",
        last[0], last[1], last[2]
    );
    println!(
        "| effect | place | amplitude | v, mm/s (noise) | p_a, kPa (noise) | p_b, kPa (noise) | valve the same for | v | pressures |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");

    let effects = Candidate::all(&RigParameters::baseline(), [true, false], false, &[]).into_iter().flat_map(
        |candidate| {
            let sizes: &[f64] = match (candidate.vanishes_at_zero_amplitude(), candidate.is_two_sided()) {
                (false, _) => &[0.7],
                (true, false) => &[0.5],
                (true, true) => &[0.5, -0.5],
            };
            sizes.iter().map(move |size| {
                let mut at = candidate.origin();
                at[0] = *size;
                let key = &candidate.sheet.keys[0];
                let amplitude = short(candidate.effect_parameters(&at)[0], key.unit.name());
                let head = format!("| {} | {} | {amplitude} |", candidate.sheet.name, candidate.place);
                candidate.rig(quiet, &at).map(|rig| (head, rig))
            })
        },
    );
    // Numbers that are merely wrong, by twice their tolerance.
    let parameters = PARAMETERS.iter().flat_map(|parameter| {
        [1.0 - 2.0 * parameter.prior_std, 1.0 + 2.0 * parameter.prior_std].map(|factor| {
            let head = format!("| {} | | times {factor} |", parameter.name);
            parameter.scaled(quiet, factor).map(|rig| (head, rig))
        })
    });
    let cases: Vec<(String, RigParameters)> = effects.chain(parameters).collect::<Result<_, _>>()?;
    let mut rows: Vec<(f64, String)> = cases
        .par_iter()
        .map(|(head, rig)| row(quiet, head, rig, (&driven, edge), &hidden, &noise))
        .collect::<Result<_, _>>()?;
    rows.sort_by(|left, right| right.0.total_cmp(&left.0));
    rows.iter().for_each(|(_, row)| println!("{row}"));
    Ok(())
}

/// The first edge of the drive's valve in the experiment.
fn edge(driven: &ClosedLoopRun, began: usize) -> Option<usize> {
    let valve = |at: usize| driven.inputs[at].valve[0];
    (began.max(1)..driven.inputs.len() - COMPARED).find(|at| (valve(*at) - valve(at - 1)).abs() > EDGE)
}

/// What the drive's sensors show from an edge on: a run is repeated by its commands.
fn changes(rig: &RigParameters, driven: &ClosedLoopRun, edge: usize) -> Result<Changes, String> {
    let mut plant = Plant::in_state(rig, &driven.start).map_err(|error| error.to_string())?;
    let mut shown = Vec::new();
    for inputs in &driven.inputs[..=edge + COMPARED] {
        shown.push(plant.noise_free_readings(&plant.truth(inputs))[0]);
        plant.step(inputs);
    }
    let start = shown[edge];
    Ok((edge..edge + COMPARED)
        .map(|at| {
            let v = (shown[at + 1][0] - shown[at - 1][0]) / 2e-3;
            [1e3 * v, 1e-3 * (shown[at][2] - start[2]), 1e-3 * (shown[at][3] - start[3])]
        })
        .collect())
}

/// A number with three digits and its unit.
fn short(value: f64, unit: &str) -> String {
    let digits = (2 - value.abs().log10().floor().clamp(-4.0, 2.0) as i32) as usize;
    format!("{value:.digits$} {unit}").trim_end().to_owned()
}

/// How much faster a rig's slowest signal is, and its row of the table.
fn row(
    quiet: &RigParameters,
    head: &str,
    rig: &RigParameters,
    (baseline, baseline_edge): (&ClosedLoopRun, usize),
    hidden: &Changes,
    noise: &[f64; 3],
) -> Result<(f64, String), String> {
    let driven = drive(&STEP, quiet, rig, SEED).map_err(|error| error.to_string())?;
    let Some(edge) = driven.began.and_then(|began| edge(&driven, began)) else {
        return Ok((f64::NEG_INFINITY, format!("{head} the step was not reached | | | | | |")));
    };
    let changed = changes(rig, &driven, edge)?;
    let alike = (0..COMPARED)
        .take_while(|at| {
            (driven.inputs[edge + at].valve[0] - baseline.inputs[baseline_edge + at].valve[0]).abs() < 1e-3
        })
        .count();
    let extremes: Vec<(f64, f64, String)> = (0..3)
        .map(|what| {
            let towards = hidden[COMPARED - 1][what].signum();
            let differs =
                changed.iter().zip(hidden).map(|(changed, hidden)| towards * (changed[what] - hidden[what]));
            let (most, least) = differs
                .fold((0.0_f64, 0.0_f64), |(most, least), change| (most.max(change), least.min(change)));
            let peak = if most >= -least { most } else { least };
            (most / noise[what], least / noise[what], format!("{peak:+.1} ({:+.0})", peak / noise[what]))
        })
        .collect();
    let said = |most: f64, least: f64| match (most > SEEN, least < -SEEN) {
        (true, true) if most > -3.0 * least => "faster",
        (true, true) if -least > 3.0 * most => "slower",
        (true, true) => "first one, then the other",
        (true, false) => "faster",
        (false, true) => "slower",
        (false, false) => "alike",
    };
    let [v, a, b] = [0, 1, 2].map(|what| said(extremes[what].0, extremes[what].1));
    let pressures = if a == b { a.to_owned() } else { format!("a {a}, b {b}") };
    // Sorted by how much faster the slowest of the three is.
    let order = extremes.iter().map(|(most, least, _)| if *most >= -*least { *most } else { *least });
    Ok((
        order.fold(f64::INFINITY, f64::min),
        format!(
            "{head} {} | {} | {} | {alike} ms | {v} | {pressures} |",
            extremes[0].2, extremes[1].2, extremes[2].2
        ),
    ))
}
