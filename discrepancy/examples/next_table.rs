//! Prints the tables of `discrepancy/docs/next.md`: T of pairs of twins in every entry of the menu.
//!
//! Pairs are those that the study calls twins (tests/study/classes.json, tests/docs/study.md) and those of effects.md; each
//! with numbers that make the two about as large: those of the middle of what is drawn.

use discrepancy::next::menu::MENU;
use discrepancy::next::{Explanation, propose};
use plant::RigParameters;
use std::io::Write;

/// An effect with its place and its numbers, or a parameter with its path and its value.
type Given = (&'static str, &'static str, &'static [(&'static str, f64)]);

/// Twins.
const PAIRS: &[(Given, Given)] = &[
    (
        ("spool-second-order", "drive", &[("natural_frequency_hz", 90.0)]),
        ("command-dead-time", "drive", &[("delay_ms", 1.0)]),
    ),
    (("line-delay", "drive", &[("length_m", 1.0)]), ("command-dead-time", "drive", &[("delay_ms", 2.9)])),
    (
        ("position-sensor-lag", "drive", &[("time_constant_ms", 2.0)]),
        ("time-skew", "drive.position", &[("delay_ms", 2.0)]),
    ),
    (
        ("pressure-sensor-lag", "drive.a", &[("time_constant_ms", 2.0)]),
        ("time-skew", "drive.a", &[("delay_ms", 2.0)]),
    ),
    (
        ("pressure-sensor-offset", "drive.a", &[("offset_mbar", 50.0)]),
        ("pressure-sensor-gain", "drive.a", &[("gain_percent", 1.0)]),
    ),
    (
        ("force-sensor-offset", "drive", &[("offset_n", 5.0)]),
        ("force-sensor-gain", "drive", &[("gain_percent", 3.0)]),
    ),
    (
        ("inclination", "drive", &[("force_n", 10.0)]),
        ("friction-asymmetry", "drive", &[("asymmetry_percent", 30.0)]),
    ),
    (
        ("inclination", "drive", &[("force_n", 10.0)]),
        ("pressure-sensor-offset", "drive.a", &[("offset_mbar", 50.0)]),
    ),
    (
        ("piston-leakage", "drive", &[("leakage_nl_per_min", 1.0)]),
        ("valve-null-leakage", "drive", &[("leakage_percent", 0.5)]),
    ),
    (
        ("valve-offset", "drive", &[("offset_percent", 1.0)]),
        ("rod-leakage", "drive.a", &[("leakage_nl_per_min", 1.0)]),
    ),
    (
        ("valve-dead-zone", "drive", &[("dead_zone_percent", 1.0)]),
        ("valve-hysteresis", "drive", &[("half_width_percent", 1.0)]),
    ),
    (
        ("valve-dead-zone", "drive", &[("dead_zone_percent", 1.0)]),
        ("valve-characteristic", "drive", &[("bend_percent", 10.0)]),
    ),
    (
        ("dead-volume", "drive", &[("volume_cm3", 30.0)]),
        ("heat-exchange", "drive", &[("coefficient_w_per_m2_k", 50.0)]),
    ),
    (
        ("dead-volume", "drive", &[("volume_cm3", 30.0)]),
        ("position-sensor-offset", "drive", &[("offset_mm", 1.0)]),
    ),
    (
        ("critical-pressure-ratio", "drive", &[("critical_ratio", 0.3)]),
        ("line-resistance", "drive", &[("drop_bar", 0.2)]),
    ),
    (
        ("silencer-back-pressure", "drive", &[("silencer_kv_ratio", 1.0)]),
        ("check-valve-restriction", "drive", &[("cracking_pressure_bar", 0.1)]),
    ),
    (
        ("spool-rate-limit", "drive", &[("rate_per_s", 80.0)]),
        ("spool-second-order", "drive", &[("natural_frequency_hz", 80.0)]),
    ),
    (
        ("stribeck-friction", "drive", &[("velocity_mm_per_s", 10.0)]),
        ("presliding", "drive", &[("stiffness_n_per_m", 1e6)]),
    ),
    (
        ("rest-time-dependent-break-away", "drive", &[("growth_percent", 30.0)]),
        ("stribeck-friction", "drive", &[("velocity_mm_per_s", 10.0)]),
    ),
    (
        ("pressure-dependent-friction", "drive", &[("slope_n_per_bar", 2.0)]),
        ("friction-asymmetry", "drive", &[("asymmetry_percent", 20.0)]),
    ),
    (
        ("coupling-backlash", "linkage", &[("gap_mm", 0.5)]),
        ("coupling-compliance", "linkage", &[("stiffness_n_per_m", 1e6)]),
    ),
    (
        ("force-sensor-gain", "drive", &[("gain_percent", 4.0)]),
        ("parameter:mass", "mass.drive_kg", &[("", 5.2)]),
    ),
    (
        ("pressure-dependent-friction", "drive", &[("slope_n_per_bar", 2.0)]),
        ("parameter:viscous-friction", "friction.viscous_n_per_mm_per_s", &[("", 1.2)]),
    ),
    (
        ("line-delay", "drive", &[("length_m", 1.0)]),
        ("parameter:flow-lag", "valve.flow_lag_time_constant_ms", &[("", 11.0)]),
    ),
    (("supply-droop", "supply", &[("droop_bar", 0.3)]), ("line-resistance", "drive", &[("drop_bar", 0.2)])),
];

fn explanation((name, place, numbers): &Given) -> Result<Explanation, String> {
    let is_parameter = name.starts_with("parameter:");
    let rig = if is_parameter {
        RigParameters::baseline().with(place, &[numbers[0].1])
    } else {
        RigParameters::baseline().with_effect(name, place, numbers)
    };
    let rig = rig.map_err(|error| format!("{name} {place}: {error}"))?;
    let title = if is_parameter { (*name).to_owned() } else { format!("{name} {place}") };
    Ok(Explanation { rig, names: vec![title] })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let baseline = RigParameters::baseline();
    let mut out = std::io::stdout().lock();
    let names: Vec<_> = MENU.iter().map(|entry| entry.name).collect();
    writeln!(out, "\n| pair | {} | proposed |", names.join(" | "))?;
    writeln!(out, "|---|{}---|", "---:|".repeat(names.len()))?;
    for (one, other) in PAIRS {
        let both = [explanation(one)?, explanation(other)?];
        let proposal = propose(&baseline, &both, [true, true], &mut |_| {});
        let of = |name: &str| proposal.table.iter().find(|judged| judged.name == name);
        let cells: Vec<_> = names
            .iter()
            .map(|name| of(name).map_or_else(|| "-".to_owned(), |judged| shown(judged.least())))
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
