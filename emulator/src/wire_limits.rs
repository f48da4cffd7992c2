//! Whether the rig of a rig file fits the wire: `rig.dbc` defines ranges and steps of all signals.
//!
//! Sensors that differ from the signals of the wire would be rounded twice, or could not be encoded; both are reported before
//! the run, with the key to change.

use plant::RigParameters;
use protocol::frames::{DRIVE_SENSORS, MessageSpec, RIG_STATUS, SignalSpec};

/// Steps of sensors and signals are decimal texts of one ratio; they may differ by rounding of the last of 17 digits.
const ROUNDING: f64 = 1e-12;

/// A parameter of the rig file that does not fit the wire.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{table}.{key}: {problem}")]
pub(crate) struct WireMisfit {
    /// Table of the rig file.
    pub table: &'static str,
    pub key: &'static str,
    /// The misfit, and the range that the wire can carry.
    pub problem: String,
}

/// Checks the rig against the wire.
///
/// # Errors
/// The first parameter that does not fit.
pub(crate) fn check(rig: &RigParameters) -> Result<(), WireMisfit> {
    let sensors = rig.sensors();
    let position = signal(DRIVE_SENSORS, "position");
    let force = signal(DRIVE_SENSORS, "force");
    let pressure = signal(DRIVE_SENSORS, "pressure_a");
    same(
        "position_range_mm",
        "position_bits",
        sensors.position_range_m,
        sensors.position_step_m(),
        position,
    )?;
    same("force_range_n", "force_bits", sensors.force_range_n, sensors.force_step_n(), force)?;
    same(
        "pressure_range_bar",
        "pressure_bits",
        sensors.pressure_range_pa,
        sensors.pressure_step_pa(),
        pressure,
    )?;
    at_most("supply", "pressure_bar", rig.supply().pressure_pa, signal(RIG_STATUS, "supply_pressure"))?;
    at_most("cylinder", "stroke_mm", rig.cylinder().stroke_m, position)
}

fn same(
    range_key: &'static str,
    bits_key: &'static str,
    range: f64,
    step: f64,
    signal: &SignalSpec,
) -> Result<(), WireMisfit> {
    let differs = |one: f64, other: f64| (one / other - 1.0).abs() > ROUNDING;
    let problem = |what: &str, is: f64, wire: f64| {
        let unit = signal.unit;
        format!("a {what} of {is} {unit}; rig.dbc carries {wire} {unit}, and both must agree")
    };
    if differs(range, signal.max) {
        let problem = problem("range", range, signal.max);
        return Err(WireMisfit { table: "sensors", key: range_key, problem });
    }
    if differs(step, signal.factor) {
        let problem = problem("step", step, signal.factor);
        return Err(WireMisfit { table: "sensors", key: bits_key, problem });
    }
    Ok(())
}

fn at_most(
    table: &'static str,
    key: &'static str,
    value: f64,
    signal: &SignalSpec,
) -> Result<(), WireMisfit> {
    if value <= signal.max {
        return Ok(());
    }
    let (unit, most) = (signal.unit, signal.max);
    Err(WireMisfit { table, key, problem: format!("{value} {unit}; rig.dbc carries at most {most} {unit}") })
}

/// A signal of rig.dbc.
pub(crate) fn signal(message: &'static MessageSpec, name: &str) -> &'static SignalSpec {
    let found = message.signals.iter().find(|signal| signal.name == name);
    found.unwrap_or_else(|| {
        unreachable!("{}.{name} is in rig.dbc, from which the frames are generated", message.name)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_rig_fits_the_wire() {
        assert_eq!(check(&RigParameters::baseline()), Ok(()));
    }

    #[test]
    fn a_rig_that_does_not_fit_is_refused_with_its_key() {
        for (key, number, hint) in [
            ("supply.pressure_bar", 10.5, ": 1050000 Pa; rig.dbc carries at most 1000000 Pa"),
            ("sensors.position_range_mm", 800.0, ": a range of 0.8 m"),
            ("sensors.position_bits", 15.0, ": a step of"),
            ("sensors.force_range_n", 2500.0, ""),
            ("sensors.pressure_range_bar", 12.0, ""),
            ("cylinder.stroke_mm", 800.0, ": 0.8 m"),
        ] {
            let rig = RigParameters::baseline().with(key, &[number]).unwrap();
            let message = check(&rig).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{key}{hint}")), "{message}");
        }
    }
}
