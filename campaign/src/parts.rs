//! Results on disk: files of some runs each, complete or absent.
//!
//! ```text
//! OUT/parts/000012.csv
//!   # airbench campaign 9f2c…, made by 51d0…, part 12 of 250: runs 96 to 103
//!   run,draw,seed,…
//!   96,0,…
//!   # whole: sha256 77ab…
//! ```
//!
//! A part is written to a temporary file, synchronised and renamed, so that a power failure leaves it complete or absent. Its
//! first line identifies the campaign and the program, its last certifies that it is complete. The runs of a part depend on the
//! campaign alone: any number of shards may fill one folder, one after the other or at once, and an existing part is not made
//! again.

use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::{self, File, Permissions};
use std::io::{self, Write};
use std::ops::Range;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Partition of a campaign's runs into files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Parts {
    /// Hash of the campaign's file and of the files that this names.
    pub(crate) campaign: String,
    /// Hash of the executables.
    pub(crate) program: String,
    pub(crate) columns: Vec<String>,
    pub(crate) runs: u64,
    /// Runs of each part but the last.
    pub(crate) runs_per_part: u64,
}

/// What is wrong with an existing part.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum PartError {
    #[error(
        "{path}: belongs to another campaign, or the campaign file or a file it names has changed; give another --out"
    )]
    OtherCampaign { path: String },
    #[error(
        "{path}: was made by another version of the programs ({theirs}, this is {ours}); use that version, or another --out"
    )]
    OtherProgram { path: String, theirs: String, ours: String },
    #[error("{path}: {what}; run the campaign again: it makes this part and the missing ones")]
    Unreadable { path: String, what: String },
}

/// A part that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error(
    "{path}: {error}; finished parts are kept: free disk space and run the same command to make the others"
)]
pub(crate) struct WriteError {
    path: String,
    error: io::Error,
}

/// Default number of parts: enough for a thousand machines.
const DEFAULT_PARTS: u64 = 1024;
/// Bounds of the default number of runs of a part.
const DEFAULT_RUNS: Range<u64> = 8..1001;

pub(crate) fn default_runs_per_part(runs: u64) -> u64 {
    (runs / DEFAULT_PARTS).clamp(DEFAULT_RUNS.start, DEFAULT_RUNS.end - 1)
}

impl Parts {
    pub(crate) fn count(&self) -> u64 {
        self.runs.div_ceil(self.runs_per_part)
    }

    pub(crate) fn runs_of(&self, part: u64) -> Range<u64> {
        part * self.runs_per_part..((part + 1) * self.runs_per_part).min(self.runs)
    }

    pub(crate) fn path(&self, out: &Path, part: u64) -> PathBuf {
        out.join("parts").join(format!("{part:06}.csv"))
    }

    fn head(&self, part: u64) -> String {
        let Range { start, end } = self.runs_of(part);
        let (campaign, program, count, last) = (&self.campaign, &self.program, self.count(), end - 1);
        format!(
            "# airbench campaign {campaign}, made by {program}, part {part} of {count}: runs {start} to {last}\n{}\n",
            self.columns.join(",")
        )
    }

    /// Writes a part; `rows` are its lines.
    ///
    /// # Errors
    /// [`WriteError`]; the part is absent then.
    pub(crate) fn write(&self, out: &Path, part: u64, rows: &str) -> Result<(), WriteError> {
        let path = self.path(out, part);
        let mut text = self.head(part) + rows;
        let hash = hash(text.as_bytes());
        // Writing to a text cannot fail.
        let _ = writeln!(text, "# whole: sha256 {hash}");
        write_whole(&path, text.as_bytes())
            .map_err(|error| WriteError { path: path.display().to_string(), error })
    }

    /// The lines of a part; `None` when it is absent.
    ///
    /// # Errors
    /// [`PartError`] for a part of another campaign or program, and for an incomplete one.
    pub(crate) fn read(&self, out: &Path, part: u64) -> Result<Option<String>, PartError> {
        let path = self.path(out, part);
        let unreadable =
            |what: &str| PartError::Unreadable { path: path.display().to_string(), what: what.to_owned() };
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(unreadable(&format!("cannot be read: {error}"))),
        };
        let head = self.head(part);
        if !text.starts_with(&head) {
            return Err(self
                .foreign(&text, &path)
                .unwrap_or_else(|| unreadable("does not begin as a part does")));
        }
        let cut = text.rfind("# whole: sha256 ").ok_or_else(|| unreadable("its end is missing"))?;
        let (whole, seal) = text.split_at(cut);
        if seal != format!("# whole: sha256 {}\n", hash(whole.as_bytes())) {
            return Err(unreadable("is not as it was written"));
        }
        Ok(Some(whole[head.len()..].to_owned()))
    }

    /// The error for a part with the first line of another campaign or program.
    fn foreign(&self, text: &str, path: &Path) -> Option<PartError> {
        let reported = text.lines().next()?.strip_prefix("# airbench campaign ")?;
        let (campaign, reported) = reported.split_once(", made by ")?;
        let (program, _) = reported.split_once(", part ")?;
        let path = path.display().to_string();
        if campaign != self.campaign {
            Some(PartError::OtherCampaign { path })
        } else if program != self.program {
            Some(PartError::OtherProgram { path, theirs: program.to_owned(), ours: self.program.clone() })
        } else {
            None
        }
    }
}

/// Writes a file atomically: to a temporary file in the same folder, which is synchronised and renamed. Readers see all of
/// `bytes`, or the file as it was before.
///
/// # Errors
/// The error of the system; `path` is unchanged then.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    // Processes that make the same part use different temporary files with the same bytes.
    let mut temporary = temporary_file_in(folder)?;
    temporary.write_all(bytes)?;
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|error| error.error)?;
    // Synchronising the folder makes the rename durable.
    File::open(folder)?.sync_all()
}

/// A temporary file in `folder` with the usual permissions, to be renamed when it is complete.
pub(crate) fn temporary_file_in(folder: &Path) -> io::Result<NamedTempFile> {
    let readable = Permissions::from_mode(0o666); // less what the umask takes
    tempfile::Builder::new().prefix(".part-").suffix(".tmp").permissions(readable).tempfile_in(folder)
}

/// SHA-256 in hexadecimal.
pub(crate) fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(campaign: &str, program: &str) -> Parts {
        let columns = vec!["run".to_owned(), "x".to_owned()];
        Parts { campaign: campaign.into(), program: program.into(), columns, runs: 20, runs_per_part: 8 }
    }

    #[test]
    fn every_run_is_of_one_part() {
        let parts = parts("c", "p");
        assert_eq!(parts.count(), 3);
        let runs: Vec<_> = (0..3).flat_map(|part| parts.runs_of(part)).collect();
        assert_eq!(runs, (0..20).collect::<Vec<_>>());
    }

    #[test]
    fn parts_are_enough_for_many_machines_and_not_too_many_files() {
        assert_eq!([30, 2000, 1_000_000, 1_000_000_000].map(default_runs_per_part), [8, 8, 976, 1000]);
    }

    #[test]
    fn a_part_is_read_as_it_was_written_and_leaves_nothing_beside_it() {
        let out = tempfile::tempdir().unwrap();
        let parts = parts("c", "p");
        assert_eq!(parts.read(out.path(), 1), Ok(None));
        parts.write(out.path(), 1, "8,1\n9,2\n").unwrap();
        assert_eq!(parts.read(out.path(), 1), Ok(Some("8,1\n9,2\n".to_owned())));
        assert_eq!(fs::read_dir(out.path().join("parts")).unwrap().count(), 1);
    }

    #[test]
    fn a_truncated_changed_or_foreign_part_is_refused() {
        let out = tempfile::tempdir().unwrap();
        let ours = parts("c", "p");
        ours.write(out.path(), 0, "0,1\n").unwrap();
        let path = ours.path(out.path(), 0);
        let text = fs::read_to_string(&path).unwrap();
        for (bad, words) in [
            (text[..text.len() - 1].to_owned(), "not as it was written"),
            (text[..text.find("# whole").unwrap()].to_owned(), "end is missing"),
            (text.replace("0,1\n", "0,2\n"), "not as it was written"),
            (String::new(), "does not begin"),
            ("hello\n".to_owned(), "does not begin"),
        ] {
            fs::write(&path, &bad).unwrap();
            let reported = ours.read(out.path(), 0).unwrap_err().to_string();
            assert!(reported.contains(words) && reported.contains("makes this part"), "{bad}: {reported}");
        }
        fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(ours.read(out.path(), 0).unwrap_err().to_string().contains("cannot be read"));
        parts("other", "p").write(out.path(), 0, "0,1\n").unwrap();
        assert!(matches!(ours.read(out.path(), 0), Err(PartError::OtherCampaign { .. })));
        parts("c", "other").write(out.path(), 0, "0,1\n").unwrap();
        assert!(matches!(ours.read(out.path(), 0), Err(PartError::OtherProgram { .. })));
    }
}
