//! The load axis moved by hand: valve shut, P, P with feed-forward, and the manual mode with its distinction of cases.

use crate::sheet::{MeanAndRange, SEEDS};
use plant::Axis;
use plant::scene::{Hand, HandAction, Part};
use rehearsal::RehearsalRow;
use std::error::Error;
use tuning::cases::{Case, CaseSpec, figures};
use tuning::rehearsed::{self, Run};
use tuning::{Trial, TrialError, in_parallel};

const EXPERIMENT: &str = "manual-let-go";
/// A small pull that stays when the hand has let go, as of a cable, N; and until when, s.
const PULL_N: f64 = 3.0;
const PULL_TO_S: f64 = 60.0;

struct LoadVariant {
    name: &'static str,
    load: &'static str,
    set: &'static [&'static str],
}

const VARIANTS: [LoadVariant; 5] = [
    LoadVariant {
        name: "valve shut",
        load: "force-manual",
        set: &["load.giving-way.gain_m_per_n_s=0", "load.giving-way.velocity_feed_forward=0"],
    },
    LoadVariant { name: "P alone", load: "force-plain", set: &["load.giving-way.velocity_feed_forward=0"] },
    LoadVariant { name: "P and feed-forward, no distinction", load: "force-plain", set: &[] },
    // No hand is as fast: as in manual-move-plain.
    LoadVariant {
        name: "always as at standstill, no distinction",
        load: "force-manual",
        set: &["load.force-chain.moving_m_per_s=1"],
    },
    LoadVariant { name: "manual mode, with its distinction", load: "force-manual", set: &[] },
];

pub(crate) fn table() -> Result<(), Box<dyn Error>> {
    println!("\n### {EXPERIMENT} (manual mode)\n");
    println!(
        "| | way of 200 mm, mm | hand force mean, N | largest, N | break-away, N | slides on when let go, mm | drift in the last 2 s, mm | valve open in the last 1 s, % of the time | drift under a pull of {PULL_N} N, mm |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for variant in &VARIANTS {
        let set: Vec<_> = variant.set.iter().map(|set| (*set).to_owned()).collect();
        let case = Case::new(&CaseSpec {
            experiment: EXPERIMENT,
            load: Some(variant.load),
            set: &set,
            drive: None,
        })?;
        let runs = in_parallel(&SEEDS, |seed| reported(&case, *seed))?;
        let scales = [1e3, 1.0, 1.0, 1.0, 1e3, 1e3, 1e2, 1e3];
        let cell = |place: usize| {
            MeanAndRange::cell(MeanAndRange::of(runs.iter().map(|run| run[place])), scales[place])
        };
        println!("| {} | {} |", variant.name, (0..scales.len()).map(cell).collect::<Vec<_>>().join(" | "));
    }
    Ok(())
}

fn reported(case: &Case, seed: u64) -> Result<[Option<f64>; 8], TrialError> {
    let trial = Trial { seed, ..Trial::default() };
    let run = case.run(&trial)?;
    let mut pulled = case.scene.clone();
    let from_s = case.scene.hand[0].to_s;
    let action = HandAction::Push { force_n: PULL_N, ramp_s: 0.0 };
    pulled.hand.push(Hand { on: Part::LoadEye, from_s, to_s: PULL_TO_S, action });
    let pulled = rehearsed::rehearse(&case.inputs, &pulled, &trial)?;
    let figure = figures(&run);
    let let_go = (case.scene.hand[0].to_s * 1e3).round() as usize;
    let position = positions(&run);
    // The last cycles are after the experiment, with the valve shut.
    let end = let_go + 3000;
    let tail = run.rows.get(end - 1000..end);
    let open = |row: &&RehearsalRow| row.cycle.valve[Axis::Load.index()] != 0.0;
    let open = tail.map(|tail| tail.iter().filter(open).count() as f64 / tail.len() as f64);
    let slides = position
        .get(let_go..let_go + 1000)
        .map(|part| part.iter().fold(0.0_f64, |most, place| most.max((place - part[0]).abs())));
    let way = position.first().zip(position.get(let_go)).map(|(from, to)| (to - from).abs());
    Ok([
        way,
        figure("hand_force_mean_n"),
        figure("hand_force_largest_n"),
        figure("hand_force_breakaway_n"),
        slides,
        drift(&position, end),
        open,
        drift(&positions(&pulled), end),
    ])
}

fn positions(run: &Run) -> Vec<f64> {
    let position = |row: &RehearsalRow| row.cycle.truth.axes[Axis::Load.index()].position_m;
    run.rows.iter().map(position).collect()
}

/// How far the axis goes in the two seconds before `end`.
fn drift(position: &[f64], end: usize) -> Option<f64> {
    let part = position.get(end - 2000..end)?;
    Some((part.last()? - part.first()?).abs())
}
