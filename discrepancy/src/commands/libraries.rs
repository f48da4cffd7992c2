//! `suspects`: what the libraries of suspects hold.

use super::{CommandError, Exit, print};
use model::{Change, Entry, EntryParameter, Library};
use std::fmt::Write as _;
use std::path::Path;

pub(super) fn suspects_command(name: Option<&str>) -> Result<Exit, CommandError> {
    let text = match name {
        None => Library::all().iter().map(lines).collect::<Vec<_>>().join("\n"),
        Some(name) if name.contains(".toml") => of_user(name).map_err(CommandError::BadData)?,
        Some(name) => listed(name).ok_or_else(|| unknown(name))?,
    };
    print(&text)?;
    Ok(Exit::Good)
}

/// A library that a user keeps in a file, or one suspect of it.
fn of_user(name: &str) -> Result<String, String> {
    if !name.ends_with(".toml") {
        let found = Library::find(name, Path::new(""))?;
        return Ok(in_words(&found.library, found.entry()));
    }
    let library = Library::of_user(name, Path::new(name))?;
    let all = library.entries.iter().map(|entry| in_words(&library, entry));
    Ok(format!("{name}: {}\n\n{}", library.about, all.collect::<Vec<_>>().join("\n")))
}

fn listed(name: &str) -> Option<String> {
    if let Some((library, entry)) = Library::entry(name) {
        return Some(in_words(library, entry));
    }
    let library = Library::all().iter().find(|library| library.name == name)?;
    let all = library.entries.iter().map(|entry| in_words(library, entry));
    Some(format!("{}: {}\n\n{}", library.name, library.about, all.collect::<Vec<_>>().join("\n")))
}

fn unknown(name: &str) -> CommandError {
    let library = name.split('/').next().and_then(|name| Library::all().iter().find(|one| one.name == name));
    let known: Vec<String> = match library {
        Some(library) => {
            library.entries.iter().map(|entry| format!("{}/{}", library.name, entry.name)).collect()
        }
        None => Library::all().iter().map(|library| library.name.clone()).collect(),
    };
    CommandError::BadData(format!(
        "{name}: no library of suspects and none of theirs; known are {}",
        known.join(", ")
    ))
}

/// A library with a line for each suspect.
fn lines(library: &Library) -> String {
    let mut text = format!("{}: {}\n", library.name, library.about);
    let names: Vec<String> =
        library.entries.iter().map(|entry| format!("{}/{}", library.name, entry.name)).collect();
    let width = names.iter().map(String::len).max().unwrap_or(0);
    for (entry, name) in library.entries.iter().zip(&names) {
        let _ = writeln!(text, "  {name:<width$}  {}", law(entry));
    }
    text
}

fn law(entry: &Entry) -> String {
    match entry.change {
        Change::Add => format!("place + {}", entry.expression),
        Change::Multiply => format!("place * ({})", entry.expression),
        Change::Replace => format!("place becomes {}", entry.expression),
    }
}

/// A suspect with all that a model file may say of it.
fn in_words(library: &Library, entry: &Entry) -> String {
    let mut text = format!("{}/{}: {}\n  {}\n", library.name, entry.name, entry.about, law(entry));
    for state in &entry.states {
        let start = if state.is_zero_at_start { "0" } else { "the first sample of the place" };
        let _ = writeln!(text, "  d{}/dt = {}, from {start}", state.name, state.derivative);
    }
    for memory in &entry.memories {
        let _ = writeln!(text, "  {} becomes {} after each step, from 0", memory.name, memory.update);
    }
    for friction in &entry.frictions {
        let (name, held) = (&friction.name, &friction.velocity);
        let _ = writeln!(
            text,
            "  {name} = {} against {held}, which it holds at rest up to {}",
            friction.sliding, friction.breakaway
        );
    }
    for variable in library.variables_of(entry) {
        let default =
            variable.default.as_ref().map_or(String::new(), |default| format!("; {default} if not given"));
        let unit = &variable.unit.text;
        let _ = writeln!(text, "  with {} [{unit}]: {}{default}", variable.name, variable.about);
    }
    for parameter in &entry.parameters {
        let _ = writeln!(text, "  {}", number(parameter));
    }
    if entry.is_local {
        text += "  local: bands do not judge it\n";
    }
    if let Some(effect) = &entry.effect {
        let _ = writeln!(text, "  a form of {effect}");
    }
    text
}

fn number(parameter: &EntryParameter) -> String {
    let unit = &parameter.quantity.unit;
    // As it was written, without rounding by the conversion to SI and back.
    let shown = |value: &f64| format!("{:.9e}", value / unit.factor).parse().unwrap_or(*value).to_string();
    let mut text = format!("{} [{}]", parameter.name, unit.text);
    if let Some(dimension) = &parameter.quantity.dimension {
        let _ = write!(text, ", of dimension {dimension}");
    }
    match parameter.values_si.as_slice() {
        [] => text += ": give its value",
        values => {
            let _ = write!(text, ": {}", values.iter().map(shown).collect::<Vec<_>>().join(", "));
        }
    }
    if parameter.is_fixed {
        text += ", not fitted";
    }
    let [least, most] = &parameter.range_si;
    if least.is_finite() {
        let _ = write!(text, " within {} to {}", shown(least), shown(most));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspect_is_listed_with_its_law_its_variables_and_its_numbers() {
        let text = listed("friction/stribeck").unwrap();
        for line in [
            "  place + excess*direction*exp(-abs(v)/velocity)\n",
            "  with v [m/s]: sliding speed\n",
            "; sign(v) if not given\n",
            "  velocity [mm/s], of dimension v: 2, 5, 10, 20, 50 within 1 to 200\n",
        ] {
            assert!(text.contains(line), "{line}{text}");
        }
        let said = "step [V], of dimension place: give its value, not fitted";
        assert!(listed("sensor").unwrap().contains(said));
        let all: Vec<String> = Library::all().iter().map(lines).collect();
        assert!(all.iter().all(|library| library.lines().all(|line| !line.ends_with(' '))), "{all:?}");
    }

    #[test]
    fn a_library_of_a_user_is_listed_by_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("seals.toml");
        let text = "about = \"seals\"\nunit = \"N\"\n[variables]\nv = { unit = \"m/s\", about = \"speed\" }\n\
                    [[suspects]]\nname = \"lip\"\nabout = \"a lip\"\nadd = \"k*v\"\n\
                    parameters.k = { unit = \"N s/m\", dimension = \"place/v\", value = 0 }\n";
        std::fs::write(&file, text).unwrap();
        let path = file.display().to_string();
        let one = of_user(&format!("{path}/lip")).unwrap();
        assert!(one.contains("seals.toml/lip: a lip\n  place + k*v\n  with v [m/s]: speed\n"), "{one}");
        assert!(of_user(&path).unwrap().ends_with(&one));
        assert!(of_user(&format!("{path}/lap")).unwrap_err().contains("'lap' is not in"));
        std::fs::write(&file, text.replace("k*v", "k*w")).unwrap();
        let why = of_user(&path).unwrap_err();
        let said = "seals.toml:6: lip: 'w' is no variable of the library and no number of the suspect";
        assert!(why.contains(said), "{why}");
    }

    #[test]
    fn a_name_that_is_none_is_refused_with_those_that_are() {
        let message = |name: &str| {
            assert_eq!(listed(name), None);
            unknown(name).to_string()
        };
        assert!(message("frictions").contains("known are friction, stiffness, damping"));
        assert!(message("friction/stribek").contains("friction/coulomb, friction/viscous"));
    }
}
