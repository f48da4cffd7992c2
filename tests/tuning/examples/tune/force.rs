//! The force programs, linked, in the experiment of Fig. 9.

use crate::{corners, mark};
use std::error::Error;
use tuning::cases::{Case, CaseSpec, figures};
use tuning::rehearsed::{gain_margin, worst_gain_margin};
use tuning::{Trial, TrialError, in_parallel, rounded};

struct GainLadder {
    load: &'static str,
    gain: &'static str,
    unit: &'static str,
    gains: &'static [f64],
}

const LADDERS: [GainLadder; 2] = [
    GainLadder {
        load: "force-p",
        gain: "algorithm.gain_m_per_n_s",
        unit: "m/(N s)",
        gains: &[0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.01, 0.012, 0.015],
    },
    GainLadder {
        load: "force-pid-map",
        gain: "algorithm.gain_per_s",
        unit: "1/s",
        gains: &[50.0, 75.0, 100.0, 125.0, 150.0, 200.0, 250.0, 300.0],
    },
];
const DRIVE: &str = "position-linked";
/// The paper's structure alone, load and drive, as it keeps the bounds of Fig. 9.
const PAPER: (&str, &str) = ("force-paper-linked", "position-paper-linked");
/// Numbers of the paper's force program that are tried together.
const GAINS: [f64; 5] = [0.008, 0.01, 0.012, 0.015, 0.02];
const SHARES: [f64; 4] = [0.3, 0.5, 0.65, 0.8];
/// Seeds of the sensors' noise that figures are taken over.
const SEEDS: [u64; 3] = [1, 2, 3];

/// Programs of the drive that are tried beside each other.
const DRIVES: [&str; 5] = [DRIVE, "position-paper-linked", "position-p", "position-pid", "position-cascade"];

pub(crate) fn tables() -> Result<(), Box<dyn Error>> {
    for ladder in &LADDERS {
        println!("\n### {}, drive: {DRIVE}\n", ladder.load);
        by_gain(ladder)?;
        by_corner(&ladder.case(None)?)?;
    }
    println!("\n### force-p, gain and velocity feed-forward: settling / overshoot / worst margin\n");
    by_feed_forward()?;
    println!("\n### Drives of a linked rig\n");
    by_drive()
}

impl GainLadder {
    fn case(&self, gain: Option<f64>) -> Result<Case, Box<dyn Error>> {
        let set: Vec<_> = gain.map(|gain| format!("load.{}={gain}", self.gain)).into_iter().collect();
        Case::new(&CaseSpec { experiment: "load-step", drive: Some(DRIVE), load: Some(self.load), set: &set })
    }
}

/// Figures of a step and of rests.
const FIGURES: [&str; 7] = [
    "force_settling_s",
    "force_overshoot_ratio",
    "drive_speed_ratio_least",
    "position_error_peak_after_step_m",
    "force_error_motion_rms_n",
    "position_rest_peak_to_peak_smoothed_m",
    "force_rest_peak_to_peak_n",
];
type Figures = [f64; FIGURES.len()];

fn figures_of(case: &Case, trial: &Trial) -> Result<Figures, TrialError> {
    let figure = figures(&case.run(trial)?);
    // What is absent never came about.
    Ok(FIGURES.map(|name| figure(name).unwrap_or(f64::INFINITY)))
}

fn worst(one: Figures, other: Figures) -> Figures {
    std::array::from_fn(|place| one[place].max(other[place]))
}

const HEAD: &str = "settling 5 % 0 kg / worst corner, ms | overshoot 0 kg / worst corner, % | speed ratio | peak error, mm | in motion, N | rest p-p, mm / N | margin 0 kg | margin, worst corner |";

/// Figures of a case: at 0 kg and 7 bar the worst of some kinds of noise, in the corners that of one.
struct CaseFigures {
    nominal: Figures,
    corners: Figures,
    margin: f64,
    worst_margin: f64,
}

impl CaseFigures {
    fn of(case: &Case) -> Result<Self, TrialError> {
        let worst_of = |trials: &[Trial]| {
            let runs = in_parallel(trials, |trial| figures_of(case, trial))?;
            Ok::<_, TrialError>(runs.into_iter().reduce(worst).unwrap_or_default())
        };
        Ok(Self {
            nominal: worst_of(&SEEDS.map(|seed| Trial { seed, ..Trial::default() }))?,
            corners: worst_of(&Trial::corners())?,
            margin: gain_margin(&case.inputs, &case.scene, &Trial::default())?,
            worst_margin: worst_gain_margin(&case.inputs, &case.scene)?,
        })
    }

    fn cells(&self) -> String {
        let Self { nominal, corners, margin, worst_margin } = self;
        let [_, _, speed_ratio, peak_m, motion_n, rest_m, rest_n] = *nominal;
        [
            [nominal, corners].map(|[settling_s, ..]| ms(*settling_s)).join(" / "),
            [nominal, corners].map(|[_, overshoot, ..]| number(overshoot * 1e2, 1)).join(" / "),
            number(speed_ratio, 2),
            number(peak_m * 1e3, 1),
            number(motion_n, 1),
            [number(rest_m * 1e3, 2), number(rest_n, 1)].join(" / "),
            margin.to_string(),
            worst_margin.to_string(),
        ]
        .join(" | ")
            + " |"
    }
}

fn by_gain(ladder: &GainLadder) -> Result<(), Box<dyn Error>> {
    println!("| gain, {} | {HEAD}", ladder.unit);
    println!("|---|---|---|---|---|---|---|---|---|");
    let shipped_gain = shipped(&ladder.case(None)?, ladder.gain).ok_or("no gain")?;
    for &gain in ladder.gains {
        println!(
            "| {} | {}",
            mark(gain, shipped_gain == gain),
            CaseFigures::of(&ladder.case(Some(gain))?)?.cells()
        );
    }
    Ok(())
}

fn by_feed_forward() -> Result<(), Box<dyn Error>> {
    println!("| gain, m/(N s) | {} |", SHARES.map(|share| format!("feed-forward {share}")).join(" | "));
    println!("|---{}|", "|---".repeat(SHARES.len()));
    for gain in GAINS {
        let mut cells = Vec::new();
        for share in SHARES {
            let set = [
                format!("load.algorithm.gain_m_per_n_s={gain}"),
                format!("load.algorithm.velocity_feed_forward={share}"),
            ];
            let spec =
                CaseSpec { experiment: "load-step", drive: Some(DRIVE), load: Some("force-p"), set: &set };
            let case = Case::new(&spec)?;
            let [settling_s, overshoot, ..] = figures_of(&case, &Trial::default())?;
            let margin = worst_gain_margin(&case.inputs, &case.scene)?;
            cells.push(format!("{} ms / {} % / {margin}", ms(settling_s), number(overshoot * 1e2, 1)));
        }
        println!("| {gain} | {} |", cells.join(" | "));
    }
    Ok(())
}

fn by_drive() -> Result<(), Box<dyn Error>> {
    println!("| load, drive | {HEAD}");
    println!("|---|---|---|---|---|---|---|---|---|");
    let loads = LADDERS.iter().map(|ladder| ladder.load);
    let pairs = loads.flat_map(|load| DRIVES.map(|drive| (load, drive))).chain([PAPER]);
    for (load, drive) in pairs {
        let spec = CaseSpec { experiment: "load-step", drive: Some(drive), load: Some(load), set: &[] };
        println!("| {load}, {drive} | {}", CaseFigures::of(&Case::new(&spec)?)?.cells());
    }
    Ok(())
}

/// Margin of the shipped gain in each corner, and the step's settling and overshoot there.
fn by_corner(case: &Case) -> Result<(), TrialError> {
    let cells = in_parallel(&Trial::corners(), |trial| {
        let [settling_s, overshoot, ..] = figures_of(case, trial)?;
        let margin = gain_margin(&case.inputs, &case.scene, trial)?;
        Ok(format!("{margin} / {} ms / {} %", ms(settling_s), number(overshoot * 1e2, 1)))
    })?;
    corners(&cells);
    Ok(())
}

/// A time in ms; a dash for what never settled.
fn ms(time_s: f64) -> String {
    number(time_s * 1e3, 0)
}

/// A dash for what never came about.
fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { rounded(value, decimals) } else { "-".into() }
}

fn shipped(case: &Case, name: &str) -> Option<f64> {
    let mode = axis_control::setup::Mode { partner_needed: true, real_time: false, forever: false };
    let controller = case.inputs.controller(plant::Axis::Load, mode).ok()?;
    let program = &controller.program;
    program.place(name).map(|place| program.values()[place])
}
