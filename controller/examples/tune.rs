//! Prints, as Markdown, how figures and margins of the shipped position programs move with their gain: `scripts/tune`.
#![allow(clippy::print_stdout)] // This is what it is for.

use controller::program::Program;
use controller::program::file::Source;
use controller::tune::{
    MASSES_KG, POINT_TO_POINT, STEP, SUPPLIES_BAR, Trial, attempt, delay_margin, gain_margin,
};
use plant::{Axis, RigParameters};
use std::error::Error;
use std::path::Path;

const PROGRAMS: [(&str, &[f64]); 3] = [
    ("position-p", &[5.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0, 30.0, 40.0]),
    ("position-pid", &[10.0, 15.0, 20.0, 25.0, 30.0, 40.0]),
    ("position-cascade", &[5.0, 10.0, 15.0, 20.0, 25.0, 30.0]),
];

fn main() -> Result<(), Box<dyn Error>> {
    let rig = RigParameters::baseline();
    for (name, gains) in PROGRAMS {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("programs/{name}.toml"));
        let source = Source::read(&path)?;
        let fresh = |gain: Option<f64>| -> Result<Program, Box<dyn Error>> {
            let mut program = source.program(Axis::Drive, &rig, false)?;
            let place = program.place("algorithm.gain_per_s").ok_or("no gain")?;
            if let Some(gain) = gain {
                program.set(place, gain)?;
            }
            Ok(program)
        };
        let shipped = {
            let program = fresh(None)?;
            program.place("algorithm.gain_per_s").map(|place| program.values()[place])
        };
        println!("\n### {name}\n");
        by_gain(gains, shipped, &fresh)?;
        println!();
        corners(&fresh)?;
    }
    Ok(())
}

type Fresh<'a> = &'a dyn Fn(Option<f64>) -> Result<Program, Box<dyn Error>>;

/// Figures and margins over the gain.
fn by_gain(gains: &[f64], shipped: Option<f64>, fresh: Fresh) -> Result<(), Box<dyn Error>> {
    println!(
        "| gain, 1/s | dynamic, mm | static, mm | rest p-p, mm | step overshoot 0 kg / worst corner, mm | margin 0 kg | margin, worst corner |"
    );
    println!("|---|---|---|---|---|---|---|");
    for &gain in gains {
        let make = || fresh(Some(gain));
        let (moved, stepped) = (
            attempt(make()?, POINT_TO_POINT, &Trial::default())?,
            attempt(make()?, STEP, &Trial::default())?,
        );
        let margin = |trial: &Trial| gain_margin(|| make().expect("made before"), trial);
        let (mut worst, mut worst_step_m) = (f64::MAX, 0.0_f64);
        for trial in all_corners() {
            worst = margin(&trial)?.min(worst);
            worst_step_m = attempt(make()?, STEP, &trial)?.overshoot_m.max(worst_step_m);
        }
        let mark = if shipped == Some(gain) { "**" } else { "" };
        println!(
            "| {mark}{gain}{mark} | {:.2} | {:.2} | {:.2} | {:.1} / {:.1} | {} | {} |",
            moved.dynamic_m * 1e3,
            moved.static_m * 1e3,
            moved.rest_peak_to_peak_m * 1e3,
            stepped.overshoot_m * 1e3,
            worst_step_m * 1e3,
            margin(&Trial::default())?,
            worst
        );
    }
    Ok(())
}

/// Margins of the shipped gain in each corner: factor / cycles of delay, and the dynamic error there.
fn corners(fresh: Fresh) -> Result<(), Box<dyn Error>> {
    println!("| added mass | {} |", SUPPLIES_BAR.map(|bar| format!("{bar} bar")).join(" | "));
    println!("|---{}|", "|---".repeat(SUPPLIES_BAR.len()));
    for added_mass_kg in MASSES_KG {
        print!("| {added_mass_kg} kg");
        for supply_bar in SUPPLIES_BAR {
            let trial = Trial { added_mass_kg, supply_bar, ..Trial::default() };
            let make = || fresh(None).expect("made before");
            let factor = gain_margin(make, &trial)?;
            let late = delay_margin(make, &trial)?.map_or("-".to_owned(), |cycles| format!("{cycles} ms"));
            let moved = attempt(make(), POINT_TO_POINT, &trial)?;
            print!(" | {factor} / {late} / {:.2} mm", moved.dynamic_m * 1e3);
        }
        println!(" |");
    }
    Ok(())
}

fn all_corners() -> impl Iterator<Item = Trial> {
    MASSES_KG.into_iter().flat_map(|added_mass_kg| {
        SUPPLIES_BAR.map(move |supply_bar| Trial { added_mass_kg, supply_bar, ..Trial::default() })
    })
}
