//! Prints the tables of `discrepancy/docs/next.md`: T of pairs of twins in every entry of the menu, and what
//! is proposed.
//!
//! Pairs are those that the study calls twins (tests/study/classes.json, tests/docs/study.md) and those of effects.md; each
//! with numbers that make the two about as large: those of the middle of what is drawn.

use discrepancy::next::menu::MENU;
use discrepancy::next::noise::ReadingNoise;
use discrepancy::next::{Explanation, Question, judge, propose};
use plant::RigParameters;
use plant::effects::sheet;
use std::io::Write;

/// An effect with its place and its amplitude, or a parameter with its path and its value.
type EffectSetting = (&'static str, &'static str, f64);

/// Twins.
const PAIRS: &[(EffectSetting, EffectSetting)] = &[
    (("spool-second-order", "drive", 90.0), ("command-dead-time", "drive", 1.0)),
    (("line-delay", "drive", 1.0), ("command-dead-time", "drive", 2.9)),
    (("position-sensor-lag", "drive", 2.0), ("time-skew", "drive.position", 2.0)),
    (("pressure-sensor-lag", "drive.a", 2.0), ("time-skew", "drive.a", 2.0)),
    (("pressure-sensor-offset", "drive.a", 50.0), ("pressure-sensor-gain", "drive.a", 1.0)),
    (("force-sensor-offset", "drive", 5.0), ("force-sensor-gain", "drive", 3.0)),
    (("inclination", "drive", 10.0), ("friction-asymmetry", "drive", 30.0)),
    (("inclination", "drive", 10.0), ("pressure-sensor-offset", "drive.a", 50.0)),
    (("piston-leakage", "drive", 1.0), ("valve-null-leakage", "drive", 0.5)),
    (("valve-offset", "drive", 1.0), ("rod-leakage", "drive.a", 1.0)),
    (("valve-dead-zone", "drive", 1.0), ("valve-hysteresis", "drive", 1.0)),
    (("valve-dead-zone", "drive", 1.0), ("valve-characteristic", "drive", 10.0)),
    (("dead-volume", "drive", 30.0), ("heat-exchange", "drive", 50.0)),
    (("dead-volume", "drive", 30.0), ("position-sensor-offset", "drive", 1.0)),
    (("critical-pressure-ratio", "drive", 0.3), ("line-resistance", "drive", 0.2)),
    (("silencer-back-pressure", "drive", 1.0), ("check-valve-restriction", "drive", 0.1)),
    (("spool-rate-limit", "drive", 80.0), ("spool-second-order", "drive", 80.0)),
    (("stribeck-friction", "drive", 10.0), ("presliding", "drive", 1e6)),
    (("rest-time-dependent-break-away", "drive", 30.0), ("stribeck-friction", "drive", 10.0)),
    (("pressure-dependent-friction", "drive", 2.0), ("friction-asymmetry", "drive", 20.0)),
    (("coupling-backlash", "linkage", 0.5), ("coupling-compliance", "linkage", 1e6)),
    (("force-sensor-gain", "drive", 4.0), ("parameter:mass", "mass.drive_kg", 5.2)),
    (
        ("pressure-dependent-friction", "drive", 2.0),
        ("parameter:viscous-friction", "friction.viscous_n_per_mm_per_s", 1.2),
    ),
    (("line-delay", "drive", 1.0), ("parameter:flow-lag", "valve.flow_lag_time_constant_ms", 11.0)),
    (("supply-droop", "supply", 0.3), ("line-resistance", "drive", 0.2)),
];

fn explanation((name, place, number): &EffectSetting) -> Result<Explanation, Box<dyn std::error::Error>> {
    let baseline = RigParameters::baseline();
    if name.starts_with("parameter:") {
        return Ok(Explanation {
            rig: baseline.with(place, &[*number])?,
            names: vec![(*name).to_owned()],
            errors: Vec::new(),
        });
    }
    let amplitude = sheet(name).ok_or_else(|| format!("no effect {name}"))?.keys[0].name;
    let rig = baseline.with_effect(name, place, &[(amplitude, *number)])?;
    Ok(Explanation { rig, names: vec![format!("{name} {place}")], errors: Vec::new() })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let baseline = RigParameters::baseline();
    let mut out = std::io::stdout().lock();
    let names: Vec<_> = MENU.iter().map(|entry| entry.name).collect();
    writeln!(out, "\n| pair | {} | proposed |", names.join(" | "))?;
    writeln!(out, "|---|{}---|", "---:|".repeat(names.len()))?;
    for (one, other) in PAIRS {
        let both = [explanation(one)?, explanation(other)?];
        let noise = ReadingNoise::specified(&baseline);
        let question = Question {
            baseline: &baseline,
            explanations: &both,
            axes_measured: [true, true],
            noise: &noise,
            training: None,
        };
        let proposal = propose(question, &mut |_| {});
        let cells: Vec<_> = MENU
            .iter()
            .map(|entry| judge(entry, &baseline, &both, [true, true]))
            .map(|judged| judged.map_or_else(|| "-".to_owned(), |judged| shown(judged.least())))
            .collect();
        let proposed = proposal.next.experiment.or(proposal.next.otherwise).unwrap_or_default();
        let pair = format!("{}, {}", both[0].names[0], both[1].names[0]);
        writeln!(out, "| {pair} | {} | {proposed} |", cells.join(" | "))?;
        out.flush()?;
    }
    Ok(())
}

/// Three digits at most.
fn shown(value: f64) -> String {
    if value < 10.0 { format!("{value:.1}") } else { format!("{value:.0}") }
}
