//! `modelDescription.xml` of a rig, from its variables.
//!
//! Source: FMI 2.0.4, section 2.2, and 4.3.1 on co-simulation.

use crate::MODEL_IDENTIFIER;
use crate::variables::{self, Causality, Kind, Variable};
use crc::{CRC_64_XZ, Crc};
use pagekit::page::escaped;
use plant::{RigParameters, SetupError};
use std::collections::BTreeSet;
use std::fmt::Write;

const IDENTITY: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

/// A model description and its identifier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// The text of `modelDescription.xml`.
    pub xml: String,
    /// `guid`: a checksum of rig file, tables and version.
    pub guid: String,
}

/// The description of a rig whose file is `rig_toml`.
pub(crate) fn of(rig: &RigParameters, rig_toml: &str) -> Result<Description, SetupError> {
    let list = variables::of(rig)?;
    let mut digest = IDENTITY.digest();
    digest.update(rig_toml.as_bytes());
    digest.update(text(&list, "").as_bytes());
    let guid = format!("{{airbench-{:016x}}}", digest.finalize());
    Ok(Description { xml: text(&list, &guid), guid })
}

/// The description of the rig of a rig file; `rig_toml` is its text, `file` its name in messages.
///
/// # Errors
/// Message of the rig file's reader, or why the plant cannot be set up.
pub fn of_file(rig_toml: &str, file: &str) -> Result<Description, String> {
    let rig = RigParameters::from_toml(rig_toml, file).map_err(|error| error.to_string())?;
    of(&rig, rig_toml).map_err(|error| format!("{file}: {error}"))
}

fn text(list: &[Variable], guid: &str) -> String {
    let mut out = String::with_capacity(64 << 10);
    let version = env!("CARGO_PKG_VERSION");
    // Writing to a string cannot fail.
    let _ = write!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"airbench plant\" guid=\"{guid}\" version=\"{version}\"\n  \
         description=\"Servo-pneumatic rig: two cylinders with proportional valves, linkage and sensors\"\n  \
         generationTool=\"airbench {version}\" variableNamingConvention=\"flat\" numberOfEventIndicators=\"0\">\n  \
         <CoSimulation modelIdentifier=\"{MODEL_IDENTIFIER}\" canHandleVariableCommunicationStepSize=\"true\"\n    \
         canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\"/>\n  <UnitDefinitions>\n"
    );
    let units: BTreeSet<_> =
        list.iter().map(|instance| instance.unit).filter(|unit| !unit.is_empty()).collect();
    for unit in units {
        let _ = writeln!(out, "    <Unit name=\"{}\"/>", escaped(unit));
    }
    out += "  </UnitDefinitions>\n  <LogCategories>\n    <Category name=\"logStatusWarning\"/>\n    \
            <Category name=\"logStatusError\"/>\n    <Category name=\"logStatusFatal\"/>\n  </LogCategories>\n  \
            <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"0.001\"/>\n  <ModelVariables>\n";
    list.iter().enumerate().for_each(|(place, instance)| variable(&mut out, place, instance));
    out += "  </ModelVariables>\n  <ModelStructure>\n";
    for part in ["Outputs", "InitialUnknowns"] {
        let _ = writeln!(out, "    <{part}>");
        for (place, _) in
            list.iter().enumerate().filter(|(_, instance)| instance.causality == Causality::Output)
        {
            let _ = writeln!(out, "      <Unknown index=\"{}\"/>", place + 1);
        }
        let _ = writeln!(out, "    </{part}>");
    }
    out += "  </ModelStructure>\n</fmiModelDescription>\n";
    out
}

fn variable(out: &mut String, place: usize, instance: &Variable) {
    let (causality, variability) = match instance.causality {
        Causality::Parameter => ("parameter", "fixed"),
        Causality::Input if instance.discrete => ("input", "discrete"),
        Causality::Input => ("input", "continuous"),
        Causality::Output if instance.discrete => ("output", "discrete"),
        Causality::Output => ("output", "continuous"),
    };
    let (name, about) = (escaped(&instance.name), escaped(&instance.about));
    let _ = writeln!(
        out,
        "    <ScalarVariable name=\"{name}\" valueReference=\"{place}\" causality=\"{causality}\" \
         variability=\"{variability}\" description=\"{about}\">"
    );
    let (kind, start) = match instance.kind {
        Kind::Real(start) => ("Real", start.map(|start| start.to_string())),
        Kind::Integer(start) => ("Integer", start.map(|start| start.to_string())),
        Kind::Boolean(start) => ("Boolean", start.map(|start| start.to_string())),
    };
    let _ = write!(out, "      <{kind}");
    if let Some(start) = start {
        let _ = write!(out, " start=\"{start}\"");
    }
    if let Some((least, most)) = instance.range {
        let _ = write!(out, " min=\"{least}\" max=\"{most}\"");
    }
    if !instance.unit.is_empty() {
        let _ = write!(out, " unit=\"{}\"", escaped(instance.unit));
    }
    *out += "/>\n    </ScalarVariable>\n";
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::variables::Role;

    #[test]
    fn another_rig_file_has_another_identity_and_the_same_one_the_same() {
        let text = RigParameters::BASELINE_TOML;
        let described = |text: &str| of(&RigParameters::from_toml(text, "rig.toml").unwrap(), text).unwrap();
        assert_eq!(described(text), described(text));
        let other = text.replacen("pressure_bar = 7.0", "pressure_bar = 6.0", 1);
        assert_ne!(described(text).guid, described(&other).guid);
        assert!(described(text).xml.contains(&described(text).guid));
    }

    #[test]
    fn what_xml_keeps_for_itself_is_escaped() {
        assert_eq!(escaped("a<b & \"c\">"), "a&lt;b &amp; &quot;c&quot;&gt;");
    }

    #[test]
    fn a_control_character_in_a_name_is_none_in_the_description() {
        let instance = Variable {
            name: "leak\u{1}<\u{1b}".into(),
            role: Role::Linked,
            kind: Kind::Boolean(None),
            causality: Causality::Output,
            discrete: false,
            unit: "",
            range: None,
            about: "a bell \u{7} and a null \u{0}".into(),
        };
        let mut out = String::new();
        variable(&mut out, 0, &instance);
        assert!(out.contains("name=\"leak\u{fffd}&lt;\u{fffd}\""), "{out:?}");
        assert!(!out.contains(|letter: char| letter.is_control() && letter != '\n'), "{out:?}");
    }
}
