//! Makes `docs/effects-responses.md` and its pictures: what each effect of the catalogue is, and what it changes in a step and
//! a slow stroke.
//!
//! `cargo run --release -p plant --example effects_page`
//!
//! The laws, keys, ranges and sources are the effects' own sheets; the numbers are measured by running the rig with and without.

#![allow(clippy::print_stdout)]

mod experiment;
mod picture;

use std::fmt::Write;
use std::fs;
use std::path::Path;

use experiment::{Experiment, Kind, differences, lasting_peak};
use picture::{Column, Panel, number, svg};
use plant::RigParameters;
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Group, PlaceKind, Sheet};

/// The four signals of a picture, in the order of [`differences`].
const SIGNALS: [&str; 4] = ["p_a/&#963;", "p_b/&#963;", "x/&#963;", "F/&#963;"];

/// What stands above the page's table.
const HEAD: &str = "\
# Responses to effects

This page compares each effect of the catalogue, alone on the drive at the geometric middle of the range that sealed rigs
and studies draw from, with the baseline. Laws, keys and ranges are those of `plant/src/effects/`; the page and its
pictures are made by

    cargo run --release -p plant --example effects_page

**Step**: 1 s of rest, then both valves open to 0.6 for 250 ms and shut again; the same commands with and without the
effect, so that no controller hides the difference. The piston coasts and stays where the trapped air holds it. **Slow
stroke**: 300 mm there and back at 60 mm/s with rests, followed by a proportional controller (8 openings per metre) on what
the position sensor shows, as in a run of the rig. Effects of the linkage and the force sensor's gain are run
linked, with the load alternately pressing and pulling with 150 N for 1.1 s each.

Differences are those of the drive's sensors without noise, in units of the sensor's noise with its rounding: SIGMA.

The upper panel of a picture is the baseline's position. Below it are the differences of pressure a, pressure b, position
and force over time, each on a separate scale with its limits at the left; the grey band is the noise.
";

/// What the table's numbers are.
const TABLE_HEAD: &str = "\
The figures are the largest means over 10 ms, so that a break-away a few milliseconds earlier or later does not count as a force
of 6 N. Most pictures have a spike of that size: the friction falls from 35 to 26 N as the piston breaks away.
";

fn main() -> std::io::Result<()> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let pictures = docs.join("effects");
    fs::create_dir_all(&pictures)?;
    let rig = RigParameters::baseline();
    let sensors = rig.sensors();
    // A uniform rounding error of one step has a twelfth of its square as variance.
    let noise = [
        (sensors.position_noise_m, sensors.position_step_m()),
        (sensors.force_noise_n, sensors.force_step_n()),
        (sensors.pressure_noise_pa, sensors.pressure_step_pa()),
        (sensors.pressure_noise_pa, sensors.pressure_step_pa()),
    ]
    .map(|(noise, step)| noise.hypot(step / 12.0_f64.sqrt()));
    let sigma = format!("{:.2} um, {:.1} Pa and {:.3} N", noise[0] * 1e6, noise[2], noise[1]);

    let mut table = String::from(
        "| effect | here | step: p_a | p_b | x | F | slow stroke: p_a | p_b | x | F |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut sections = String::new();
    let mut group = None;
    for sheet in SHEETS {
        let shown = show(sheet, &rig, noise);
        fs::write(pictures.join(format!("{}.svg", sheet.name)), &shown.svg)?;
        println!("{}: {} bytes", sheet.name, shown.svg.len());
        let peaks = shown.peaks.map(rounded).join(" | ");
        let _ = writeln!(table, "| [{0}](#{0}) | {1} | {peaks} |", sheet.name, amplitude(&sheet.keys[0]));
        if group != Some(sheet.group) {
            group = Some(sheet.group);
            let _ = writeln!(sections, "\n## {}", title(sheet.group));
        }
        section(&mut sections, sheet, &shown);
    }
    let page = format!(
        "{}\n## Largest differences, in units of noise\n\n{TABLE_HEAD}\n{table}{sections}",
        HEAD.replace("SIGMA", &sigma)
    );
    fs::write(docs.join("effects-responses.md"), page)
}

/// What was measured of an effect.
struct MeasuredEffect {
    places: Vec<String>,
    conditions: [String; 2],
    /// Largest sizes of the four signals in the step, then in the slow stroke, in units of noise.
    peaks: [f64; 8],
    svg: String,
}

fn show(sheet: &Sheet, baseline: &RigParameters, noise: [f64; 4]) -> MeasuredEffect {
    let places: Vec<String> =
        sheet.place.names().into_iter().filter(|place| is_shown(sheet, place)).collect();
    let numbers: Vec<(&str, f64)> = sheet.keys.iter().map(|key| (key.name, middle(key))).collect();
    let rig = places.iter().fold(baseline.clone(), |rig, place| {
        rig.with_effect(sheet.name, place, &numbers).expect("the middle is allowed")
    });
    let mut peaks = [0.0; 8];
    let runs = [Kind::Step, Kind::SlowStroke].map(|kind| {
        let experiment = Experiment::of(sheet, kind);
        let before = experiment.run(baseline, None);
        let after = experiment.run(&rig, Some(&before.inputs));
        let curves = differences(&before, &after, noise);
        let position: Vec<f64> = before.rows.iter().map(|row| row[0] * 1e3).collect();
        (experiment, position, curves)
    });
    for (i, (_, _, curves)) in runs.iter().enumerate() {
        for (j, curve) in curves.iter().enumerate() {
            peaks[4 * i + j] = lasting_peak(curve);
        }
    }
    let columns = [("valve step", 0), ("slow stroke", 1)].map(|(name, i)| {
        let (experiment, position, curves) = &runs[i];
        let mut panels = vec![Panel { name: "x, mm", curve: position, noise_band: false }];
        panels.extend(SIGNALS.iter().zip(curves).map(|(name, curve)| Panel {
            name,
            curve,
            noise_band: true,
        }));
        Column {
            title: format!("{name}, {}", experiment.conditions()),
            length_s: position.len() as f64 * 1e-3,
            panels,
        }
    });
    let conditions = [&runs[0].0, &runs[1].0].map(Experiment::conditions);
    MeasuredEffect {
        places,
        conditions,
        peaks,
        svg: svg(&format!("{}: difference to the baseline", sheet.name), &columns),
    }
}

/// The drive's places; of the two seals of rod-leakage the rod's.
fn is_shown(sheet: &Sheet, place: &str) -> bool {
    !(place.starts_with("load") || sheet.name == "rod-leakage" && place == "drive.a")
}

/// The geometric middle of what is drawn, positive.
fn middle(key: &EffectKey) -> f64 {
    (key.drawn[0] * key.drawn[1]).sqrt()
}

fn amplitude(key: &EffectKey) -> String {
    format!("{} {}", number(middle(key)), key.unit.name()).trim_end().to_owned()
}

/// A size in units of noise; what no reading could show is 0.
fn rounded(size: f64) -> String {
    if size < 0.05 { "0".to_owned() } else { number((size * 10.0).round() / 10.0) }
}

fn title(group: Group) -> &'static str {
    match group {
        Group::Flow => "Flow and valve",
        Group::Chamber => "Chambers",
        Group::Motion => "Motion",
        Group::Sensor => "Sensors",
    }
}

fn section(out: &mut String, sheet: &Sheet, shown: &MeasuredEffect) {
    let named = match sheet.place {
        PlaceKind::Linkage | PlaceKind::Supply => sheet.place.names().join(", "),
        _ => shown.places.join(", "),
    };
    let _ = write!(
        out,
        "\n### {}\n\n{}.\n\nSource: {}.\n\n| key | what | allowed | drawn from | here |\n|---|---|---|---|---|\n",
        sheet.name,
        capital(sheet.law),
        sheet.source
    );
    for key in sheet.keys {
        let sign = if key.signed { "+-" } else { "" };
        let drawn = format!("{sign}{} to {} {}", number(key.drawn[0]), number(key.drawn[1]), key.unit.name());
        let _ = writeln!(
            out,
            "| `{}` | {} | {} | {} | {} |",
            key.name,
            key.meaning,
            key.range(),
            drawn.trim_end(),
            amplitude(key)
        );
    }
    let [step, slow] = &shown.conditions;
    let _ = writeln!(
        out,
        "\nOn at {named}; step {step}, slow stroke {slow}.\n\n![{0}: difference to the baseline](effects/{0}.svg)",
        sheet.name
    );
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
