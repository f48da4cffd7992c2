//! Makes single records of the study, and the tables of docs/record-maker.md; without arguments it prints its usage.
#![allow(clippy::print_stdout)] // This is what it is for.

use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Sheet};
use plant::{Axis, RigParameters};
use record_maker::{Experiment, Form, Hidden, ROWS, Recipe, comparison, simulate, simulate_proposed, write};
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

const USAGE: &str =
    "record-maker make --out FOLDER --truth FOLDER [--seed N] [--axis drive|load] [--both-axes [--unlinked]]
    [--effect NAME --place PLACE --value V[,V...]]... [--foreign-form | --far-form] [--wrong parameter:NAME=FACTOR]...
    [--coloured-noise] [--jitter] [--noise N] [--experiment train|held-out-0|held-out-1 | --proposed FILE]
record-maker list
record-maker compare
record-maker forms
record-maker steps
record-maker agree";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    match arguments.next().as_deref() {
        Some("make") => make(arguments),
        Some("list") => {
            for sheet in SHEETS {
                let keys: Vec<_> =
                    sheet.keys.iter().map(|key| format!("{} {}", key.name, key.range())).collect();
                println!("{} at {}: {}", sheet.name, sheet.place.names().join(", "), keys.join(", "));
            }
            Ok(())
        }
        Some("compare") => compare(),
        Some("forms") => forms(),
        Some("steps") => steps(),
        Some("agree") => agree(),
        _ => Err(USAGE.into()),
    }
}

/// An effect at its first place, each key at the lower (0) or upper (1) end of its drawn range.
fn at_end(sheet: &Sheet, end: usize) -> Recipe {
    let numbers = sheet.keys.iter().map(|key| key.drawn[end]).collect();
    let hidden = vec![Hidden { name: sheet.name, place: sheet.place.places()[0], numbers }];
    Recipe { hidden, both_axes: sheet.name.starts_with("coupling"), ..Recipe::default() }
}

/// Prints each effect in the record maker against the same effect in the plant, as Markdown: free runs, in units of the noise.
fn agree() -> Result<(), Box<dyn Error>> {
    const ROWS_COMPARED: [usize; 3] = [2000, 6000, 10_000];
    let rig = RigParameters::baseline();
    println!(
        "| effect | end | without it, 10 s: x, F, p_a, p_b | with it, 2 s | 6 s | 10 s |\n|---|---|---|---|---|---|"
    );
    for sheet in SHEETS {
        for end in [0, 1] {
            let recipe = at_end(sheet, end);
            let keys: Vec<_> = sheet.keys.iter().map(|key| (key.name, key.drawn[end])).collect();
            let with_it = rig.with_effect(sheet.name, &recipe.hidden[0].place.to_string(), &keys)?;
            let record = simulate(&recipe, &rig)?;
            let cell = |rig: &RigParameters, rows: usize| {
                let rms = comparison::with_effects(&record, rig, rows);
                rms.map_or_else(
                    |error| error.to_string(),
                    |rms| rms[0].map(|rms| format!("{rms:.2}")).join(", "),
                )
            };
            let without = cell(&rig, ROWS_COMPARED[2]);
            let with = ROWS_COMPARED.map(|rows| cell(&with_it, rows)).join(" | ");
            println!("| {} | {end} | {without} | {with} |", sheet.name);
        }
    }
    Ok(())
}

fn steps() -> Result<(), Box<dyn Error>> {
    let rig = RigParameters::baseline();
    println!("| step | record | position | force | pressure a | pressure b |\n|---|---|---|---|---|---|");
    for (axis, both_axes) in [(Axis::Drive, false), (Axis::Drive, true)] {
        for steps_per_ms in [12, 25, 50, 100, 200] {
            let recipe = Recipe { axis, both_axes, ..Recipe::default() };
            let halved = comparison::of_halved_step(&recipe, &rig, [ROWS, steps_per_ms])?;
            let cells = halved[0].map(|rms| format!("{rms:.4}")).join(" | ");
            let name = if both_axes { "linked, drive" } else { "drive" };
            println!("| {:.1} us | {name} | {cells} |", 1000.0 / steps_per_ms as f64);
        }
    }
    Ok(())
}

/// Prints all forms of all effects at both ends of their ranges, as Markdown.
fn forms() -> Result<(), Box<dyn Error>> {
    let rig = RigParameters::baseline();
    let null = [false, true]
        .map(|both_axes| simulate(&Recipe { both_axes, ..Recipe::default() }, &rig).expect("null"));
    println!("| effect | end | form | catalogue | form | cosine |\n|---|---|---|---|---|---|");
    for sheet in SHEETS {
        for (end, form) in [0, 1].into_iter().flat_map(|end| [(end, Form::Near), (end, Form::Far)]) {
            let recipe = at_end(sheet, end);
            let null = &null[usize::from(recipe.both_axes)];
            let made = simulate(&recipe, &rig);
            let other = simulate(&Recipe { form, ..recipe }, &rig);
            let name = format!("{} | {end} | {}", sheet.name, form.name());
            match (made, other) {
                (Ok(made), Ok(other)) => {
                    let [made, other, cosine] = comparison::from_null(null, &made, &other, 1);
                    println!("| {name} | {made:.2} | {other:.2} | {cosine:.2} |");
                }
                (made, other) => println!("| {name} | {:?} | {:?} |", made.err(), other.err()),
            }
        }
    }
    Ok(())
}

/// Prints null records of all experiments against the plant, as Markdown.
fn compare() -> Result<(), Box<dyn Error>> {
    let rig = RigParameters::baseline();
    println!("| record | signal | rms | window 50 % | 90 % | 99 % | worst | left out | free run |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for (axis, both_axes) in [(Axis::Drive, false), (Axis::Load, false), (Axis::Drive, true)] {
        for experiment in [Experiment::Train, Experiment::HeldOut(0), Experiment::HeldOut(1)] {
            let record = simulate(&Recipe { axis, both_axes, experiment, ..Recipe::default() }, &rig)?;
            let windows = comparison::against_plant(&record, &rig, comparison::WINDOW)?;
            let free = comparison::against_plant(&record, &rig, record.rows.len())?;
            for axis in Axis::ALL.into_iter().filter(|shown| both_axes || *shown == axis) {
                let linked = if both_axes { "linked, " } else { "" };
                for (signal, name) in comparison::SIGNALS.iter().enumerate() {
                    let difference = &windows[axis.index()][signal];
                    let [half, most, nearly, worst] =
                        [50.0, 90.0, 99.0, 100.0].map(|p| difference.percentile(p));
                    let [left_out, all] = difference.left_out;
                    println!(
                        "| {linked}{} {experiment:?} | {name} | {:.3} | {half:.4} | {most:.3} | {nearly:.3} | {worst:.2} | \
                         {left_out} of {all} | {:.2} |",
                        axis.name(),
                        difference.rms(),
                        free[axis.index()][signal].rms(),
                    );
                }
            }
        }
    }
    Ok(())
}

fn make(mut arguments: impl Iterator<Item = String>) -> Result<(), Box<dyn Error>> {
    let (mut recipe, mut out, mut truth) = (Recipe::default(), None, None);
    let (mut name, mut place, mut proposed) = (None, None, None);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value\n{USAGE}"));
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value()?)),
            "--truth" => truth = Some(PathBuf::from(value()?)),
            "--seed" => recipe.seed = value()?.parse()?,
            "--axis" => recipe.axis = if value()? == "load" { Axis::Load } else { Axis::Drive },
            "--both-axes" => recipe.both_axes = true,
            "--unlinked" => recipe.unlinked = true,
            "--foreign-form" => recipe.form = Form::Near,
            "--far-form" => recipe.form = Form::Far,
            "--coloured-noise" => recipe.coloured_noise = true,
            "--jitter" => recipe.jitter = true,
            "--noise" => recipe.noise = value()?.parse()?,
            "--experiment" => {
                recipe.experiment = match value()?.as_str() {
                    "train" => Experiment::Train,
                    "held-out-0" => Experiment::HeldOut(0),
                    "held-out-1" => Experiment::HeldOut(1),
                    other => return Err(format!("--experiment {other}\n{USAGE}").into()),
                }
            }
            "--proposed" => proposed = Some(value()?),
            "--wrong" => {
                let text = value()?;
                let (name, factor) = text.split_once('=').ok_or(USAGE)?;
                recipe.wrong_parameters.push((name.to_owned(), factor.parse()?));
            }
            "--effect" => name = Some(value()?),
            "--place" => place = Some(value()?),
            "--value" => {
                let (name, place) = (name.take().ok_or(USAGE)?, place.take().ok_or(USAGE)?);
                recipe.hidden.push(hidden(&name, &place, &value()?)?);
            }
            other => return Err(format!("{other}?\n{USAGE}").into()),
        }
    }
    let (out, truth) = (out.ok_or(USAGE)?, truth.ok_or(USAGE)?);
    let began = Instant::now();
    let rig = RigParameters::baseline();
    let record = match proposed {
        Some(file) => simulate_proposed(&recipe, &rig, (&file, &std::fs::read_to_string(&file)?))?,
        None => simulate(&recipe, &rig)?,
    };
    println!("{} rows in {:.2} s", record.rows.len(), began.elapsed().as_secs_f64());
    write(&record, &out, &truth)?;
    Ok(())
}

/// An effect at the named place; keys without a value have their defaults.
fn hidden(name: &str, place: &str, values: &str) -> Result<Hidden, Box<dyn Error>> {
    let sheet = plant::effects::sheet(name).ok_or_else(|| format!("no effect {name}; see `list`"))?;
    let place = sheet.place_named(place).ok_or_else(|| format!("{name} is not at {place}; see `list`"))?;
    let given = values.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let number = |(index, key): (usize, &EffectKey)| {
        given.get(index).copied().or(key.default).ok_or_else(|| format!("{name}: {} is missing", key.name))
    };
    let numbers = sheet.keys.iter().enumerate().map(number).collect::<Result<_, _>>()?;
    Ok(Hidden { name: sheet.name, place, numbers })
}
