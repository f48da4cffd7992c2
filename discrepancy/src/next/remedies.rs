//! Manual measurements that discriminate between effects where no experiment does.
//!
//! Source: effects.md, the column of twins; discrepancy-notes.md, 11 and pipeline 9.

use super::Explanation;
use plant::effects::sheet;
use plant::effects::sheet::ManualMeasurement;

/// Measurements that sheets of effects name, each with parameters that it discriminates too, and in words. The first that
/// discriminates both sides of a pair counts.
const REMEDIES: &[(ManualMeasurement, &[&str], &str)] = &[
    (
        ManualMeasurement::Venting,
        &["parameter:supply-pressure", "parameter:piston-area"],
        "venting both chambers to the atmosphere, where the pressure is known, and a gauge at the supply",
    ),
    (
        ManualMeasurement::Tilting,
        &["parameter:sliding-friction"],
        "tilting the rig by a known angle: gravity along the rod changes with it, offsets of sensors and friction do not",
    ),
    (
        ManualMeasurement::KnownWeight,
        &["parameter:mass"],
        "uncoupling the rods and hanging a known weight on the force sensor",
    ),
    (
        ManualMeasurement::PositionSensor,
        &[],
        "a second position sensor without filter, or samples faster than 1 kHz: at 1 kHz a short lag is a delay",
    ),
    (
        ManualMeasurement::PortPressure,
        &["parameter:flow-lag"],
        "a fast pressure sensor at the chamber's port beside the rig's own",
    ),
    (
        ManualMeasurement::SpoolSignal,
        &["parameter:spool-time-constant", "parameter:flow-lag"],
        "the spool's own position signal, or steps of the valve on a locked piston",
    ),
    (
        ManualMeasurement::LockedHold,
        &[],
        "locking the piston, shutting the supply, and holding for minutes with the valve's ports plugged",
    ),
    (
        ManualMeasurement::ConstantVolume,
        &["parameter:kv-scale", "parameter:supply-pressure"],
        "locking the piston at several places and filling and venting a chamber at constant volume",
    ),
    (
        ManualMeasurement::PressedEnds,
        &[],
        "pressing the piston against both ends by hand: the stroke is known",
    ),
    (ManualMeasurement::Uncoupling, &[], "uncoupling the rods: what stays is not the linkage"),
    (
        ManualMeasurement::Pulling,
        &["parameter:viscous-friction", "parameter:sliding-friction", "parameter:break-away-force"],
        "uncoupling the rods and pulling the vented piston by hand with a force gauge",
    ),
];

/// Fallback.
const ELSE: &str = "a larger amplitude: what differs here lies below the sensors' noise";

/// Measurements for these pairs, each once; `None` without pairs.
pub(crate) fn of_pairs(explanations: &[Explanation], pairs: &[(usize, usize)]) -> Option<String> {
    let mut remedies: Vec<&str> = Vec::new();
    for (one, other) in pairs {
        let what = of_pair(&explanations[*one].names, &explanations[*other].names);
        if !remedies.contains(&what) {
            remedies.push(what);
        }
    }
    (!remedies.is_empty()).then(|| remedies.join("; "))
}

/// Measurement for two explanations.
pub(crate) fn of_pair(one: &[String], other: &[String]) -> &'static str {
    let only = |these: &[String], those: &[String]| -> Vec<String> {
        let effect = |name: &String| name.split(' ').next().unwrap_or_default().to_owned();
        these.iter().filter(|name| !those.contains(name)).map(effect).collect()
    };
    let (left, right) = (only(one, other), only(other, one));
    let knows = |(by, parameters, _): &(ManualMeasurement, &[&str], &str), side: &[String]| {
        let of_sheet = |name: &str| sheet(name).is_some_and(|sheet| sheet.distinguished_by.contains(by));
        !side.is_empty() && side.iter().all(|name| parameters.contains(&name.as_str()) || of_sheet(name))
    };
    let remedy = REMEDIES.iter().find(|remedy| knows(remedy, &left) && knows(remedy, &right));
    remedy.map_or(ELSE, |(.., what)| what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::effects::SHEETS;

    #[test]
    fn every_measurement_of_a_sheet_has_words_and_tells_several_apart() {
        let named = |by| SHEETS.iter().filter(|sheet| sheet.distinguished_by.contains(by)).count();
        for by in SHEETS.iter().flat_map(|sheet| sheet.distinguished_by) {
            assert!(REMEDIES.iter().any(|(measurement, ..)| measurement == by), "{by:?}");
        }
        for (by, parameters, _) in REMEDIES {
            assert!(named(by) + parameters.len() > 1, "{by:?}");
            assert!(parameters.iter().all(|name| name.starts_with("parameter:")), "{by:?}");
        }
    }

    #[test]
    fn what_tells_gravity_from_an_offset_is_tilting() {
        let names = |name: &str| vec![name.to_owned()];
        let what = of_pair(&names("inclination drive"), &names("force-sensor-offset drive"));
        assert!(what.contains("tilting"), "{what}");
        assert_eq!(of_pair(&names("inclination drive"), &names("line-delay drive")), ELSE);
        // What both have tells nothing.
        let both = |name: &str| vec!["line-delay load".to_owned(), name.to_owned()];
        assert_eq!(of_pair(&both("inclination drive"), &both("force-sensor-offset drive")), what);
    }
}
