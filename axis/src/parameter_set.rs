//! A parameter set as a file: the values of variables, by axis and task.
//!
//! ```toml
//! [drive.algorithm]
//! gain_per_s = 25.0                # 1/s, 0 to 200: velocity for each error
//! [drive.post-controller]
//! opening_limit = 0.8
//! ```
//!
//! It holds numbers and nothing else: algorithms, libraries and linearisations stand in program files, and a set is for a
//! program that has its variables. `controller parameters` and a client of XCP write one; `--parameters` loads it, before
//! `--set`.

use crate::program::Variable;
use nominal::Axis;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use toml::Spanned;

/// A set that cannot be used: file, line, key, value and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ParameterSetError(String);

#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    pub axis: Axis,
    /// Name of the variable, such as `algorithm.gain_per_s`.
    pub name: String,
    /// Its value, not yet checked.
    pub value: f64,
    /// Where it stands, for messages: `FILE:LINE: `.
    pub place: String,
}

type Sections = BTreeMap<String, BTreeMap<String, BTreeMap<String, Spanned<toml::Value>>>>;

pub fn read(path: &Path) -> Result<Vec<Setting>, ParameterSetError> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| ParameterSetError(format!("cannot read {}: {error}", path.display())))?;
    parse(&text, &path.display().to_string())
}

/// The set in a text; `file` is for messages.
pub fn parse(text: &str, file: &str) -> Result<Vec<Setting>, ParameterSetError> {
    let sections: Sections = toml::from_str(text).map_err(|error| {
        ParameterSetError(format!("{file}: {error}expected are tables such as [drive.algorithm]"))
    })?;
    let mut settings = Vec::new();
    for (axis_name, tasks) in sections {
        let axis = Axis::ALL.into_iter().find(|axis| axis.name() == axis_name).ok_or_else(|| {
            ParameterSetError(format!("{file}: [{axis_name}]: no such axis; there are drive and load"))
        })?;
        for (task, values) in tasks {
            for (key, value) in values {
                let line = settings::line_of(text, value.span().start);
                let place = format!("{file}:{line}: ");
                let name = format!("{task}.{key}");
                let number = settings::number_of(value.as_ref());
                let value = number.ok_or_else(|| {
                    ParameterSetError(format!("{place}{axis_name}.{name} = {}: not a number", value.as_ref()))
                })?;
                settings.push(Setting { axis, name, value, place });
            }
        }
    }
    Ok(settings)
}

/// Writes a set: the values of an axis's variables, with unit, range and meaning.
pub fn text(axis: Axis, variables: &[Variable], values: &[f64]) -> String {
    let mut text = String::new();
    let mut last = "";
    for (Variable { name, parameter }, value) in variables.iter().zip(values) {
        let (task, key) = name.split_once('.').unwrap_or(("", name));
        // Writing to a text cannot fail.
        if task != last {
            let _ = writeln!(text, "{}[{}.{task}]", if last.is_empty() { "" } else { "\n" }, axis.name());
            last = task;
        }
        let unit = if parameter.unit.is_empty() { String::new() } else { format!("{}, ", parameter.unit) };
        let _ = writeln!(
            text,
            "{key} = {value:?}  # {unit}{} to {}: {}",
            parameter.least,
            parameter.most,
            // A comment ends with its line.
            parameter.meaning.replace(|c: char| c.is_control(), " ")
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::file::Source;
    use nominal::RigParameters;

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        let program = Source::shut().program(Axis::Load, &RigParameters::baseline(), false).unwrap();
        let mut values = program.values().to_vec();
        values[0] = 1.0 / 3.0;
        values[1] = 1e-7;
        let text = text(Axis::Load, program.variables(), &values);
        let read = parse(&text, "set.toml").unwrap();
        assert_eq!(read.len(), values.len());
        for setting in read {
            let place = program.place(&setting.name).unwrap();
            assert_eq!(setting.value.to_bits(), values[place].to_bits(), "{}", setting.name);
            assert_eq!(setting.axis, Axis::Load);
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_file_and_line() {
        for (text, words) in [
            (
                "[drive.algorithm]\ngain_per_s = \"5\"\n",
                ["set.toml:2", "drive.algorithm.gain_per_s", "not a number"],
            ),
            ("[middle.algorithm]\ngain_per_s = 5\n", ["set.toml", "[middle]", "drive and load"]),
            ("[drive]\ngain_per_s = 5\n", ["set.toml", "gain_per_s", "[drive.algorithm]"]),
        ] {
            let problem = parse(text, "set.toml").unwrap_err().to_string();
            for word in words {
                assert!(problem.contains(word), "'{word}' is missing in: {problem}");
            }
        }
    }
}
