//! Manual measurements that discriminate between effects where no experiment does.
//!
//! Source: effects.md, the column of twins; discrepancy-notes.md, 11 and pipeline 9.

use super::Explanation;

/// Effects that a measurement discriminates, and the measurement.
struct Remedy {
    among: &'static [&'static str],
    what: &'static str,
}

/// The first entry that contains both sides of a pair counts.
const REMEDIES: &[Remedy] = &[
    Remedy {
        among: &[
            "pressure-sensor-offset",
            "pressure-sensor-gain",
            "parameter:supply-pressure",
            "parameter:piston-area",
        ],
        what: "venting both chambers to the atmosphere, where the pressure is known, and a gauge at the supply",
    },
    Remedy {
        among: &[
            "inclination",
            "friction-asymmetry",
            "pressure-sensor-offset",
            "pressure-sensor-gain",
            "force-sensor-offset",
            "position-dependent-force",
            "parameter:sliding-friction",
        ],
        what: "tilting the rig by a known angle: gravity along the rod changes with it, offsets of sensors and friction do not",
    },
    Remedy {
        among: &["force-sensor-gain", "force-sensor-offset", "parameter:mass", "inclination"],
        what: "uncoupling the rods and hanging a known weight on the force sensor",
    },
    Remedy {
        among: &["position-sensor-lag", "time-skew"],
        what: "a second position sensor without filter, or samples faster than 1 kHz: at 1 kHz a short lag is a delay",
    },
    Remedy {
        among: &["pressure-sensor-lag", "time-skew", "line-delay", "parameter:flow-lag", "line-resistance"],
        what: "a fast pressure sensor at the chamber's port beside the rig's own",
    },
    Remedy {
        among: &[
            "spool-second-order",
            "spool-rate-limit",
            "command-dead-time",
            "line-delay",
            "valve-hysteresis",
            "parameter:spool-time-constant",
            "parameter:flow-lag",
        ],
        what: "the spool's own position signal, or steps of the valve on a locked piston",
    },
    Remedy {
        among: &["piston-leakage", "rod-leakage", "valve-null-leakage", "valve-offset", "heat-exchange"],
        what: "locking the piston, shutting the supply, and holding for minutes with the valve's ports plugged",
    },
    Remedy {
        among: &[
            "critical-pressure-ratio",
            "valve-characteristic",
            "valve-dead-zone",
            "heat-exchange",
            "dead-volume",
            "parameter:kv-scale",
            "line-resistance",
            "check-valve-restriction",
            "silencer-back-pressure",
            "supply-droop",
            "parameter:supply-pressure",
        ],
        what: "locking the piston at several places and filling and venting a chamber at constant volume",
    },
    Remedy {
        among: &["dead-volume", "position-sensor-offset", "position-sensor-gain", "end-cushion"],
        what: "pressing the piston against both ends by hand: the stroke is known",
    },
    Remedy {
        among: &[
            "coupling-backlash",
            "coupling-compliance",
            "time-skew",
            "position-sensor-offset",
            "presliding",
        ],
        what: "uncoupling the rods: what stays is not the linkage",
    },
    Remedy {
        among: &[
            "stribeck-friction",
            "presliding",
            "friction-asymmetry",
            "pressure-dependent-friction",
            "position-dependent-friction",
            "position-dependent-force",
            "rest-time-dependent-break-away",
            "parameter:viscous-friction",
            "parameter:sliding-friction",
            "parameter:break-away-force",
        ],
        what: "uncoupling the rods and pulling the vented piston by hand with a force gauge",
    },
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
    let knows = |remedy: &&Remedy, side: &[String]| {
        !side.is_empty() && side.iter().all(|effect| remedy.among.contains(&effect.as_str()))
    };
    let remedy = REMEDIES.iter().find(|remedy| knows(remedy, &left) && knows(remedy, &right));
    remedy.map_or(ELSE, |remedy| remedy.what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::effects::SHEETS;

    #[test]
    fn every_effect_of_a_remedy_is_one_of_the_catalogue() {
        for name in REMEDIES.iter().flat_map(|remedy| remedy.among) {
            let known = name.starts_with("parameter:") || SHEETS.iter().any(|sheet| sheet.name == *name);
            assert!(known, "{name}");
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
