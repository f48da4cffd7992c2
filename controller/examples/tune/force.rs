//! The force programs, linked, in the experiment of Fig. 9.

use crate::cases::{Case, Made, figures};
use crate::{corners, mark, nominal};
use controller::tune::rehearsed::gain_margin;
use controller::tune::{Trial, TrialError, in_parallel};
use std::error::Error;

struct Ladder {
    load: &'static str,
    gain: &'static str,
    unit: &'static str,
    gains: &'static [f64],
}

const LADDERS: [Ladder; 2] = [
    Ladder {
        load: "force-p",
        gain: "algorithm.gain_m_per_n_s",
        unit: "m/(N s)",
        gains: &[0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.01, 0.012, 0.015],
    },
    Ladder {
        load: "force-pid-map",
        gain: "algorithm.gain_per_s",
        unit: "1/s",
        gains: &[50.0, 75.0, 100.0, 125.0, 150.0, 200.0, 250.0, 300.0],
    },
];
const DRIVE: &str = "position-linked";
/// Seeds of the sensors' noise that figures are taken over.
const SEEDS: [u64; 3] = [1, 2, 3];

/// Prints them all.
pub(crate) fn tables() -> Result<(), Box<dyn Error>> {
    for ladder in LADDERS {
        println!("\n### {}, drive: {DRIVE}\n", ladder.load);
        by_gain(&ladder)?;
        by_corner(&ladder.case(None)?)?;
    }
    Ok(())
}

impl Ladder {
    fn case(&self, gain: Option<f64>) -> Result<Case, Box<dyn Error>> {
        let set: Vec<_> = gain.map(|gain| format!("load.{}={gain}", self.gain)).into_iter().collect();
        Case::new(&Made { experiment: "load-step", drive: Some(DRIVE), load: Some(self.load), set: &set })
    }
}

/// Figures of a step and of rests; the worst of some runs.
#[derive(Clone, Copy, Default)]
struct Figures {
    settling_s: f64,
    overshoot: f64,
    speed_ratio: f64,
    peak_m: f64,
    motion_n: f64,
    rest_m: f64,
    rest_n: f64,
}

impl Figures {
    fn of(case: &Case, trial: &Trial) -> Result<Self, TrialError> {
        let figure = figures(&case.run(trial)?);
        // What is absent never came about.
        let figure = |name: &str| figure(name).unwrap_or(f64::INFINITY);
        Ok(Self {
            settling_s: figure("force_settling_s"),
            overshoot: figure("force_overshoot_ratio"),
            speed_ratio: figure("drive_speed_ratio_least"),
            peak_m: figure("position_error_peak_after_step_m"),
            motion_n: figure("force_error_motion_rms_n"),
            rest_m: figure("position_rest_peak_to_peak_smoothed_m"),
            rest_n: figure("force_rest_peak_to_peak_n"),
        })
    }

    fn worst(self, other: Self) -> Self {
        Self {
            settling_s: self.settling_s.max(other.settling_s),
            overshoot: self.overshoot.max(other.overshoot),
            speed_ratio: self.speed_ratio.max(other.speed_ratio),
            peak_m: self.peak_m.max(other.peak_m),
            motion_n: self.motion_n.max(other.motion_n),
            rest_m: self.rest_m.max(other.rest_m),
            rest_n: self.rest_n.max(other.rest_n),
        }
    }
}

/// Figures and margins over the gain.
fn by_gain(ladder: &Ladder) -> Result<(), Box<dyn Error>> {
    println!(
        "| gain, {} | settling 5 %, ms | overshoot, % | speed ratio | peak error, mm | in motion, N | rest p-p, mm / N | margin 0 kg | margin, worst corner |",
        ladder.unit
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let own: f64 = shipped(&ladder.case(None)?, ladder.gain).ok_or("no gain")?;
    for &gain in ladder.gains {
        let case = ladder.case(Some(gain))?;
        let runs = in_parallel(&SEEDS, |seed| Figures::of(&case, &Trial { seed: *seed, ..Trial::default() }));
        let runs = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
        let figures = runs.into_iter().reduce(Figures::worst).unwrap_or_default();
        let margins = in_parallel(&Trial::corners(), |trial| gain_margin(&case.inputs, &case.scene, trial));
        let margins = margins.into_iter().collect::<Result<Vec<_>, _>>()?;
        println!(
            "| {} | {} | {:.1} | {:.2} | {:.1} | {:.1} | {:.2} / {:.1} | {} | {} |",
            mark(gain, own == gain),
            ms(figures.settling_s),
            figures.overshoot * 1e2,
            figures.speed_ratio + 0.0,
            figures.peak_m * 1e3,
            figures.motion_n,
            figures.rest_m * 1e3,
            figures.rest_n,
            margins[nominal()],
            margins.iter().copied().fold(f64::MAX, f64::min)
        );
    }
    Ok(())
}

/// Margin of the shipped gain in each corner, and the step's settling and overshoot there.
fn by_corner(case: &Case) -> Result<(), TrialError> {
    let cells = in_parallel(&Trial::corners(), |trial| {
        let figures = Figures::of(case, trial)?;
        let margin = gain_margin(&case.inputs, &case.scene, trial)?;
        Ok(format!("{margin} / {} ms / {:.1} %", ms(figures.settling_s), figures.overshoot * 1e2))
    });
    corners(&cells.into_iter().collect::<Result<Vec<_>, TrialError>>()?);
    Ok(())
}

/// A time in ms; a dash for what never settled.
fn ms(time_s: f64) -> String {
    if time_s.is_finite() { format!("{:.0}", time_s * 1e3) } else { "-".into() }
}

/// The number in the load's program.
fn shipped(case: &Case, name: &str) -> Option<f64> {
    let mode = controller::setup::Mode { partner_needed: true, real_time: false, forever: false };
    let controller = case.inputs.controller(plant::Axis::Load, mode).ok()?;
    let program = controller.program();
    program.place(name).map(|place| program.values()[place])
}
