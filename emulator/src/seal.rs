//! `emulator seal`: draws effects and writes them into a file that only a rig should read.
//!
//! The file appears complete, readable by its owner alone, and never replaces another: a sealed rig of earlier runs cannot be
//! drawn again by accident. Neither the drawn effects nor the seed, which determines them, are printed.

use crate::cli::{SealArguments, SealedAxis};
use crate::run::RunError;
use plant::effects::draw::{AxisSelection, as_toml, draw};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// Mode of the sealed file: readable and writable by its owner alone.
const MODE: u32 = 0o600;

/// Draws effects and writes the file; returns its path.
///
/// # Errors
/// [`RunError::Input`] when there are not so many effects, or the file exists; [`RunError::Output`] when it cannot be written.
pub(crate) fn seal(arguments: &SealArguments) -> Result<String, RunError> {
    let SealArguments { seed, effects, axis, out } = arguments;
    let drawn = draw(*seed, usize::from(*effects), among(*axis))
        .map_err(|error| RunError::Input(format!("--effects {effects}: {error}")))?;
    let text = format!("{}{}", head(arguments), as_toml(&drawn));
    let file = out.display().to_string();
    match write_new(out, text.as_bytes()) {
        Ok(()) => Ok(file),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(RunError::Input(format!(
            "--out {file}: the file is there already; move it away or choose another name"
        ))),
        Err(error) => Err(RunError::output(out, &error)),
    }
}

fn among(axis: SealedAxis) -> AxisSelection {
    match axis {
        SealedAxis::Drive => AxisSelection::Drive,
        SealedAxis::Load => AxisSelection::Load,
        SealedAxis::Both => AxisSelection::Both,
    }
}

fn head(arguments: &SealArguments) -> String {
    let SealArguments { seed, effects, axis, .. } = arguments;
    let axis = format!("{axis:?}").to_lowercase();
    let version = env!("CARGO_PKG_VERSION");
    format!(
        "# SEALED: do not read on. This file lists effects of a rig that are hidden until they are identified from a run:\n\
         #     emulator run --sealed FILE …\n\
         # Compare what you found with it afterwards, or with truth.csv of the run.\n\
         # Made by 'emulator seal --seed {seed} --effects {effects} --axis {axis}' of airbench {version}.\n\n"
    )
}

/// Writes to a temporary file in the same folder, then links it to the name unless that exists.
fn write_new(path: &Path, text: &[u8]) -> io::Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let temporary = path.with_file_name(name);
    let mut file = OpenOptions::new().write(true).create_new(true).mode(MODE).open(&temporary)?;
    let written = file
        .write_all(text)
        .and_then(|()| file.sync_all())
        // Unlike a rename, a link replaces no file.
        .and_then(|()| std::fs::hard_link(&temporary, path));
    let _ = std::fs::remove_file(&temporary);
    written
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::RigParameters;
    use plant::effects::SHEETS;
    use protocol::exit::Exit;
    use std::os::unix::fs::PermissionsExt;
    use std::path::PathBuf;

    fn arguments(out: PathBuf, seed: u64) -> SealArguments {
        SealArguments { seed, effects: 3, axis: SealedAxis::Both, out }
    }

    #[test]
    fn a_seal_is_for_its_owner_alone_and_a_rig_takes_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        assert!(seal(&arguments(path.clone(), 7)).is_ok());
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, MODE);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("# SEALED: do not read on."), "{text}");
        let rig = RigParameters::baseline().with_effects_of(&text, "a.toml").unwrap();
        assert_eq!(rig.effects(), draw(7, 3, AxisSelection::Both).unwrap());
        // Nothing else is left in the folder.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_seal_that_is_there_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "mine").unwrap();
        let error = seal(&arguments(path.clone(), 7)).unwrap_err();
        assert!(error.to_string().contains("is there already; move it away"), "{error}");
        assert_eq!(error.exit(), Exit::BadInput);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_cannot_be_had_is_refused_with_what_can() {
        let folder = tempfile::tempdir().unwrap();
        let asked = u8::try_from(SHEETS.len() + 1).unwrap();
        let too_many = SealArguments { effects: asked, ..arguments(folder.path().join("a.toml"), 7) };
        let error = seal(&too_many).unwrap_err().to_string();
        let most = SHEETS.len();
        assert_eq!(
            error,
            format!(
                "--effects {asked}: {asked} different effects were asked for; allowed are 0 to {most} here"
            )
        );
        let nowhere = seal(&arguments(folder.path().join("no/folder/a.toml"), 7)).unwrap_err();
        assert!(matches!(nowhere, RunError::Output { .. }), "{nowhere}");
    }
}
