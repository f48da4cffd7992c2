//! Makes the tables of `plant/docs/effects-accuracy.md`: the plant with smooth effects against an independent solver.
//!
//! `cargo run --release -p independent-solver --example effects_accuracy -- --write` puts them into the page; without
//! `--write` they are printed. What is compared, and in which motions: `tests/independent/tests/independent/mod.rs`.

#![allow(clippy::print_stdout)]

use std::fmt::Write;
use std::process::ExitCode;

use plant::effects::SHEETS;

#[path = "../../tests/independent/mod.rs"]
mod independent;

use independent::{Difference, MOTIONS, Window, all_smooth, alone, is_smooth, motion_of};

/// The page, and the marks between which the tables stand.
const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../plant/docs/effects-accuracy.md");
const MARKS: [&str; 2] = ["<!-- effects-accuracy: begin -->", "<!-- effects-accuracy: end -->"];

/// Substeps of a period: the plant's own, halved, quartered.
const SUBSTEPS: [u32; 3] = [10, 20, 40];

const HEAD: &str = "x | F | p | shown x | shown F | shown p | v, mm/s | behind edges | bristles | worst at 50 us \
                    | at 25 us | changes by";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        [] => {
            println!("{}", tables());
            ExitCode::SUCCESS
        }
        ["--write"] => write(&tables()),
        _ => {
            eprintln!("usage: effects_accuracy [--write]");
            ExitCode::from(2)
        }
    }
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
    let [own, half, quarter] = SUBSTEPS.map(|substeps| window.difference(substeps));
    let Difference { truth, shown, velocity, behind, bristles, .. } = own;
    let numbers = truth.into_iter().chain(shown).chain([velocity, behind, bristles]);
    let finer = [half.worst(), quarter.worst()];
    let cells: Vec<String> = numbers.chain(finer).map(|number| format!("{number:.5}")).collect();
    let _ = writeln!(out, "| {name} | {} | {:.1} |", cells.join(" | "), window.change().worst_shown());
}

/// Puts the tables between the marks of the page.
fn write(tables: &str) -> ExitCode {
    let page = std::fs::read_to_string(PAGE).unwrap_or_default();
    let parts = page.split_once(MARKS[0]).and_then(|(head, rest)| Some((head, rest.split_once(MARKS[1])?.1)));
    let Some((head, tail)) = parts else {
        eprintln!(
            "{PAGE}: not written, the marks '{}' and '{}' do not stand there once each",
            MARKS[0], MARKS[1]
        );
        return ExitCode::from(2);
    };
    match std::fs::write(PAGE, format!("{head}{}\n{tables}\n\n{}{tail}", MARKS[0], MARKS[1])) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{PAGE}: {error}: make the file writable");
            ExitCode::FAILURE
        }
    }
}
