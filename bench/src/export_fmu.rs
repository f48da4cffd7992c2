//! Exports the plant as an FMU: description, shared library, rig file and a page, in one archive.
//!
//! The shared library `libplant_fmu.so` is built with the bench (`cargo build --release -p bench -p plant-fmu`) and expected
//! beside it. The same files give the same archive, to the byte.

use crate::export::part_of;
use crate::say;
use clap::Args;
use plant_fmu::{MODEL_IDENTIFIER, RIG_FILE, description};
use protocol::exit::Exit;
use runlog::run_folder::FileError;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const PAGE: &str = include_str!("../../fmu/docs/index.html");

/// What becomes an FMU.
#[derive(Args, Debug)]
pub(crate) struct ExportFmuArguments {
    /// The rig file, with its effects.
    #[arg(long, value_name = "FILE")]
    pub rig: PathBuf,
    /// The FMU to write.
    #[arg(long, value_name = "FILE.fmu")]
    pub out: PathBuf,
    /// The shared library of the plant [default: libplant_fmu.so beside this program].
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum ExportFmuError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{0}")]
    Rig(String),
    #[error(
        "no {name} beside {program}: build it with 'cargo build --release -p plant-fmu', or name it with --library",
        name = library_name()
    )]
    NoLibrary { program: PathBuf },
}

/// Writes the FMU and prints its path.
///
/// # Errors
/// [`ExportFmuError`]; the file is unchanged or absent then.
pub(crate) fn run(arguments: &ExportFmuArguments) -> Result<Exit, ExportFmuError> {
    let ExportFmuArguments { rig, out, library } = arguments;
    let rig_toml = String::from_utf8(read(rig)?).map_err(|error| FileError::read(rig, error.utf8_error()))?;
    let described =
        description::of_file(&rig_toml, &rig.display().to_string()).map_err(ExportFmuError::Rig)?;
    let library = match library {
        Some(library) => read(library)?,
        None => read(&shipped_library()?)?,
    };
    let part = part_of(out);
    let written =
        write(&part, &described.xml, &library, &rig_toml).and_then(|()| std::fs::rename(&part, out));
    written.map_err(|error| {
        // An incomplete file is of no use; a failure to remove it changes nothing.
        let _ = std::fs::remove_file(&part);
        FileError::write(out, error)
    })?;
    say(&format!("{}: FMI 2.0 co-simulation, linux64, guid {}", out.display(), described.guid));
    Ok(Exit::Good)
}

fn library_name() -> String {
    format!("lib{MODEL_IDENTIFIER}.so")
}

/// The library in the folder of this program, where cargo puts it as a target of its own or as a dependency.
fn shipped_library() -> Result<PathBuf, ExportFmuError> {
    let program = std::env::current_exe().unwrap_or_default();
    let folder = program.parent().unwrap_or(Path::new("."));
    let places = [folder.join(library_name()), folder.join("deps").join(library_name())];
    places.into_iter().find(|place| place.is_file()).ok_or(ExportFmuError::NoLibrary { program })
}

fn write(file: &Path, description: &str, library: &[u8], rig_toml: &str) -> io::Result<()> {
    let mut archive = ZipWriter::new(File::create(file)?);
    // No time of day, so that equal content gives equal files.
    let plain =
        SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).unix_permissions(0o644);
    for (name, content) in [
        ("modelDescription.xml".to_owned(), description.as_bytes()),
        (format!("binaries/linux64/{MODEL_IDENTIFIER}.so"), library),
        (format!("resources/{RIG_FILE}"), rig_toml.as_bytes()),
        ("documentation/index.html".to_owned(), PAGE.as_bytes()),
    ] {
        archive.start_file(name, plain)?;
        archive.write_all(content)?;
    }
    archive.finish()?.sync_all()
}

fn read(file: &Path) -> Result<Vec<u8>, FileError> {
    std::fs::read(file).map_err(|error| FileError::read(file, error))
}
