//! Makes the tables of `plant/docs/effects-accuracy.md`: the plant with smooth effects against an independent solver.
//!
//! `scripts/effects-tables` prints them, and puts them into the page with `--write`. What is compared, and in which motions:
//! `tests/independent/tests/independent/mod.rs`.

#![allow(clippy::print_stdout)]

use std::fmt::Write;

use plant::effects::SHEETS;

#[path = "../../tests/independent/mod.rs"]
mod independent;

use independent::{Difference, MOTIONS, Window, all_smooth, alone, is_smooth, motion_of};

/// Substeps of a period: the plant's own, halved, quartered.
const SUBSTEPS: [u32; 3] = [10, 20, 40];

const HEAD: &str = "x | F | p | shown x | shown F | shown p | v, mm/s | behind edges | bristles | worst at 50 us \
                    | at 25 us | changes by";

fn main() {
    println!("{}", tables());
}

fn tables() -> String {
    let rule = "---|".repeat(HEAD.matches('|').count() + 1);
    let mut out =
        format!("All smooth effects at once, at all their places:\n\n| motion | {HEAD} |\n|---|{rule}\n");
    for motion in &MOTIONS {
        row(&mut out, motion.name, &Window::new(all_smooth(motion), motion));
    }
    let _ = write!(
        out,
        "\nEach smooth effect alone, at all its places:\n\n| effect, motion | {HEAD} |\n|---|{rule}\n"
    );
    for sheet in SHEETS.iter().filter(|sheet| is_smooth(sheet)) {
        let motion = motion_of(sheet);
        row(&mut out, &format!("{}, {}", sheet.name, motion.name), &Window::new(alone(sheet), &motion));
    }
    out.trim_end().to_owned()
}

fn row(out: &mut String, name: &str, window: &Window) {
    let [whole, half, quarter] = SUBSTEPS.map(|substeps| window.difference(substeps));
    let Difference { truth, shown, velocity, behind, bristles, .. } = whole;
    let numbers = truth.into_iter().chain(shown).chain([velocity, behind, bristles]);
    let finer = [half.worst(), quarter.worst()];
    let cells: Vec<String> = numbers.chain(finer).map(|number| format!("{number:.5}")).collect();
    let _ = writeln!(out, "| {name} | {} | {:.1} |", cells.join(" | "), window.change().worst_shown());
}
