//! Files of a run's folder, written so that whoever reads them never meets half a fact.
//!
//! Tables grow by whole lines; JSON appears at once by being renamed. A process that is killed leaves files that read
//! to their last line.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Version of the JSON files; goes up when a key changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// Lines are written together up to this many bytes.
const BATCH_BYTES: usize = 256 << 10;

/// A file that grows by whole lines.
pub struct LineFile {
    file: File,
    path: PathBuf,
    buffer: Vec<u8>,
}

impl LineFile {
    /// Makes the file, replacing one that is there.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create(path).map_err(|error| named(path, &error))?;
        Ok(Self { file, path: path.into(), buffer: Vec::with_capacity(2 * BATCH_BYTES) })
    }

    /// Where whole lines are appended; [`LineFile::write_when_full`] follows each.
    pub fn lines(&mut self) -> &mut Vec<u8> {
        &mut self.buffer
    }

    /// Writes the lines out when there are many.
    ///
    /// # Errors
    /// As [`LineFile::write_out`].
    pub fn write_when_full(&mut self) -> io::Result<()> {
        if self.buffer.len() >= BATCH_BYTES { self.write_out() } else { Ok(()) }
    }

    /// Writes all lines out.
    ///
    /// # Errors
    /// What the system says, with the file's name; the lines of this batch are gone then.
    pub fn write_out(&mut self) -> io::Result<()> {
        let result = self.file.write_all(&self.buffer).map_err(|error| named(&self.path, &error));
        self.buffer.clear();
        result
    }
}

/// Writes `value` as pretty JSON under a temporary name and renames it.
///
/// # Errors
/// What the system says, with the file's name.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> io::Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    let temporary = path.with_extension("json.part");
    let written = std::fs::write(&temporary, text).and_then(|()| std::fs::rename(&temporary, path));
    written.map_err(|error| named(path, &error))
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}
