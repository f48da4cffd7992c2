//! The position programs, unlinked.

use crate::{corners, mark, nominal};
use axis_control::program::Program;
use axis_control::program::file::Source;
use plant::{Axis, RigParameters};
use std::error::Error;
use std::path::Path;
use tuning::position::{POINT_TO_POINT, STEP, attempt, delay_margin, gain_margin, positioning};
use tuning::{Trial, TrialError, in_parallel};

const GAIN: &str = "algorithm.gain_per_s";
const FEED_FORWARD: &str = "algorithm.velocity_feed_forward";
/// Numbers of the paper's program that are tried together.
const GAINS: [f64; 6] = [20.0, 22.0, 24.0, 26.0, 28.0, 30.0];
const SHARES: [f64; 5] = [1.0, 1.05, 1.1, 1.15, 1.2];
const PROGRAMS: [(&str, &[f64]); 3] = [
    ("position-p", &[5.0, 8.0, 10.0, 12.0, 15.0, 20.0, 24.0, 26.0, 28.0, 30.0, 40.0]),
    ("position-pid", &[10.0, 15.0, 20.0, 25.0, 30.0, 40.0]),
    ("position-cascade", &[5.0, 10.0, 15.0, 20.0, 25.0, 30.0]),
];

pub(crate) fn tables() -> Result<(), Box<dyn Error>> {
    for (name, gains) in PROGRAMS {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../controller/programs/{name}.toml"));
        let shipped = ShippedProgram { source: Source::read(&path)?, rig: RigParameters::baseline() };
        println!("\n### {name}\n");
        shipped.by_gain(gains)?;
        shipped.by_corner()?;
        if name == "position-p" {
            shipped.by_feed_forward()?;
        }
    }
    Ok(())
}

struct ShippedProgram {
    source: Source,
    rig: RigParameters,
}

impl ShippedProgram {
    fn program(&self, gain: Option<f64>) -> Result<Program, Box<dyn Error>> {
        let mut program = self.source.program(Axis::Drive, &self.rig, false)?;
        if let (Some(place), Some(gain)) = (program.place(GAIN), gain) {
            program.set(place, gain).expect("the ladder is within the range");
        }
        Ok(program)
    }

    fn by_gain(&self, gains: &[f64]) -> Result<(), Box<dyn Error>> {
        println!(
            "| gain, 1/s | dynamic, mm | static, mm | rest p-p, mm | step overshoot 0 kg / worst corner, mm | margin 0 kg | margin, worst corner |"
        );
        println!("|---|---|---|---|---|---|---|");
        let shipped_gain = self.program(None)?;
        let shipped_gain = shipped_gain.place(GAIN).map(|place| shipped_gain.values()[place]);
        for &gain in gains {
            let make = || self.program(Some(gain)).expect("made before");
            let moved = positioning(make)?;
            let tried = in_parallel(&Trial::corners(), |trial| {
                Ok((gain_margin(make, trial)?, attempt(make(), STEP, trial)?.overshoot_m))
            })?;
            let (margin, overshoot_m) = tried[nominal()];
            let worst = tried.iter().fold((f64::MAX, 0.0_f64), |(least, most), (margin, overshoot)| {
                (least.min(*margin), most.max(*overshoot))
            });
            println!(
                "| {} | {:.2} | {:.2} | {:.2} | {:.1} / {:.1} | {margin} | {} |",
                mark(gain, shipped_gain == Some(gain)),
                moved.dynamic_m * 1e3,
                moved.static_m * 1e3,
                moved.rest_peak_to_peak_m * 1e3,
                overshoot_m * 1e3,
                worst.1 * 1e3,
                worst.0
            );
        }
        Ok(())
    }

    /// Gain and feed-forward together: dynamic and static error, and the margin at 0 kg and 7 bar.
    fn by_feed_forward(&self) -> Result<(), Box<dyn Error>> {
        println!("\n| gain, 1/s | {} |", SHARES.map(|share| format!("feed-forward {share}")).join(" | "));
        println!("|---{}|", "|---".repeat(SHARES.len()));
        for gain in GAINS {
            let cells = in_parallel(&SHARES, |&share| {
                let make = || {
                    let mut program = self.program(Some(gain)).expect("made before");
                    let place = program.place(FEED_FORWARD).expect("the paper's program feeds forward");
                    program.set(place, share).expect("the shares are within the range");
                    program
                };
                let figures = positioning(make)?;
                let margin = gain_margin(make, &Trial::default())?;
                let (dynamic_mm, static_mm) = (figures.dynamic_m * 1e3, figures.static_m * 1e3);
                Ok(format!("{dynamic_mm:.2} mm / {static_mm:.2} mm / {margin}"))
            })?;
            println!("| {gain} | {} |", cells.join(" | "));
        }
        Ok(())
    }

    /// Margins of the shipped gain in each corner: factor / cycles of delay, and the dynamic error there.
    fn by_corner(&self) -> Result<(), TrialError> {
        let make = || self.program(None).expect("made before");
        let cells = in_parallel(&Trial::corners(), |trial| {
            let late = delay_margin(make, trial)?.map_or("-".to_owned(), |cycles| format!("{cycles} ms"));
            let moved = attempt(make(), POINT_TO_POINT, trial)?;
            let margin = gain_margin(make, trial)?;
            Ok(format!("{margin} / {late} / {:.2} mm", moved.dynamic_m * 1e3))
        })?;
        corners(&cells);
        Ok(())
    }
}
