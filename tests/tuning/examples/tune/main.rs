//! Prints, as Markdown, how figures and margins of the shipped programs move with their gain: `scripts/tune`.
#![allow(clippy::print_stdout)] // This is what it is for.

mod force;
mod position;

use std::error::Error;
use tuning::{MASSES_KG, SUPPLIES_BAR, Trial};

fn main() -> Result<(), Box<dyn Error>> {
    position::tables()?;
    force::tables()
}

/// A table over the corners, from one cell for each.
fn corners(cells: &[String]) {
    println!("\n| added mass | {} |", SUPPLIES_BAR.map(|bar| format!("{bar} bar")).join(" | "));
    println!("|---{}|", "|---".repeat(SUPPLIES_BAR.len()));
    for (added_mass_kg, row) in MASSES_KG.iter().zip(cells.chunks(SUPPLIES_BAR.len())) {
        println!("| {added_mass_kg} kg | {} |", row.join(" | "));
    }
}

/// Where the nominal conditions stand among the corners.
fn nominal() -> usize {
    Trial::corners().iter().position(|trial| *trial == Trial::default()).expect("0 kg and 7 bar are a corner")
}

fn mark(text: f64, shipped: bool) -> String {
    if shipped { format!("**{text}**") } else { text.to_string() }
}
