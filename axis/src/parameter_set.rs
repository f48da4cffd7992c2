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
use settings::{SettingsError, Source};
use std::fmt::Write;
use std::path::Path;

/// A value for a variable, by a parameter set or by the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Axis whose program shall have the variable.
    pub axis: Axis,
    /// Name of the variable, such as `algorithm.gain_per_s`.
    pub name: String,
    /// Its value, not yet checked.
    pub value: f64,
    /// Where it stands, in front of a message: `FILE:LINE: `, or `--set `.
    pub place: String,
}

/// Reads the set in a file. Names and ranges of its variables are checked where it is applied.
///
/// # Errors
/// [`SettingsError`] for a file that cannot be read, and as for [`parse`].
pub fn read(path: &Path) -> Result<Vec<Setting>, SettingsError> {
    let text = std::fs::read_to_string(path).map_err(|error| SettingsError::unreadable(path, &error))?;
    parse(&text, path)
}

/// The set in a text; `file` is for messages.
///
/// # Errors
/// [`SettingsError`] for TOML that does not parse, sections of neither axis, and values that are no finite numbers.
pub fn parse(text: &str, file: &Path) -> Result<Vec<Setting>, SettingsError> {
    let source = Source::parse(text, file)?;
    let mut root = source.root();
    let mut settings = Vec::new();
    for axis in Axis::ALL {
        let mut tasks = root.section_or_empty(axis.name())?;
        for task in tasks.keys() {
            let example = Some("[drive.algorithm]");
            let Some(mut values) = tasks.section_as(&task, example)? else { continue };
            for key in values.keys() {
                let Some(value) = values.finite(&key)? else { continue };
                let place = format!("{}:{}: ", file.display(), values.line_of(&key));
                settings.push(Setting { axis, name: format!("{task}.{key}"), value, place });
            }
        }
    }
    root.finish()?;
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
    use crate::program::file;
    use nominal::RigParameters;

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        let program = file::Source::shut().program(Axis::Load, &RigParameters::baseline(), false).unwrap();
        let mut values = program.values().to_vec();
        values[0] = 1.0 / 3.0;
        values[1] = 1e-7;
        let text = text(Axis::Load, program.variables(), &values);
        let read = parse(&text, Path::new("set.toml")).unwrap();
        assert_eq!(read.len(), values.len());
        for setting in read {
            let place = program.place(&setting.name).unwrap();
            assert_eq!(setting.value.to_bits(), values[place].to_bits(), "{}", setting.name);
            assert_eq!(setting.axis, Axis::Load);
        }
    }

    #[test]
    fn a_bad_set_is_refused_with_file_and_line() {
        for (text, words) in [
            (
                "[drive.algorithm]\ngain_per_s = \"5\"\n",
                ["set.toml:2", "drive.algorithm.gain_per_s = \"5\"", "allowed is a finite number"],
            ),
            ("[middle.algorithm]\ngain_per_s = 5\n", ["set.toml:1", "unknown key middle;", "drive, load"]),
            ("[drive]\ngain_per_s = 5\n", ["set.toml:2", "drive.gain_per_s = 5", "[drive.algorithm]"]),
        ] {
            let problem = parse(text, Path::new("set.toml")).unwrap_err().to_string();
            for word in words {
                assert!(problem.contains(word), "'{word}' is missing in: {problem}");
            }
        }
    }
}
