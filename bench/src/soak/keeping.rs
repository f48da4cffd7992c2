//! The files of a soak: read at the start, written after every segment, so that a killed soak leaves the results of all
//! segments before.
//!
//! `soak.json` is the one that the others are made of, and the one that a soak goes on from. Each appears by being renamed.

use super::SoakError;
use super::merged::MergedHistograms;
use super::model::{SOAK_SCHEMA_VERSION, Segment, Settings, Soak, Totals};
use super::{junit, procfs, verdict};
use runlog::run_folder::{FileError, SOAK_JSON, read_json, write_json, write_whole};
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

pub(super) struct SoakFolder {
    pub soak: Soak,
    pub merged: MergedHistograms,
    pub out: PathBuf,
    /// Lock on the folder, held for the life of the process.
    _lock: File,
}

impl SoakFolder {
    /// Opens the soak in `out`, new or existing.
    ///
    /// # Errors
    /// [`SoakError`]: another soak runs in this folder, files cannot be read or written, or the settings differ without
    /// `anyway`.
    pub(super) fn open(
        out: &Path,
        settings: Settings,
        planned_s: f64,
        anyway: bool,
    ) -> Result<Self, SoakError> {
        std::fs::create_dir_all(out.join("segments")).map_err(|error| SoakError::output(out, &error))?;
        let lock_path = out.join("soak.lock");
        let lock = File::create(&lock_path).map_err(|error| SoakError::output(&lock_path, &error))?;
        flock(&lock, FlockOperation::NonBlockingLockExclusive).map_err(|_| SoakError::Busy(out.into()))?;
        let path = out.join(SOAK_JSON);
        let mut soak = if path.exists() {
            let soak: Soak = read_json(&path)?;
            if soak.schema_version != SOAK_SCHEMA_VERSION {
                let version = soak.schema_version;
                let known = format!("schema version {version}, {SOAK_SCHEMA_VERSION} is known here");
                return Err(FileError::read(&path, known).into());
            }
            soak
        } else {
            let now_s = unix_s();
            Soak {
                schema_version: SOAK_SCHEMA_VERSION,
                started_unix_s: now_s,
                settings: settings.clone(),
                ..Soak::default()
            }
        };
        let differences = soak.settings.differences(&settings);
        if !differences.is_empty() && !anyway {
            return Err(SoakError::OtherSettings { out: out.into(), differences: differences.join("; ") });
        }
        let merged = MergedHistograms::from_kept(&soak.distributions)
            .map_err(|error| FileError::read(&path, error))?;
        (soak.settings, soak.planned_s, soak.ended_because) = (settings, planned_s, None);
        let mut keeping = Self { soak, merged, out: out.into(), _lock: lock };
        keeping.find_cut_off()?;
        Ok(keeping)
    }

    /// Finds segments outside the account: the soak was killed while they ran.
    fn find_cut_off(&mut self) -> Result<(), SoakError> {
        let folder = self.out.join("segments");
        let entries = std::fs::read_dir(&folder).map_err(|error| SoakError::output(&folder, &error))?;
        let mut names: Vec<_> =
            entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
        names.sort();
        for name in names {
            let known = self.soak.segments.iter().any(|segment| segment.folder == name);
            let number = name
                .split_once('-')
                .and_then(|(number, experiment)| Some((number.parse().ok()?, experiment)));
            if let (false, Some((number, experiment))) = (known, number) {
                self.soak.segments.push(Segment::cut_off(number, experiment, &name));
            }
        }
        self.soak.segments.sort_by_key(|segment| segment.spec.number);
        Ok(())
    }

    pub(super) fn next_number(&self) -> u32 {
        self.soak.segments.iter().map(|segment| segment.spec.number).max().unwrap_or(0) + 1
    }

    /// Computes the totals and writes all files.
    pub(super) fn write(&mut self) -> Result<(), SoakError> {
        let failed = |path: &Path, error: &io::Error| SoakError::output(path, error);
        let soak = &mut self.soak;
        soak.totals = Totals::of(&soak.segments);
        soak.updated_unix_s = unix_s();
        soak.folder_bytes = procfs::folder_bytes(&self.out);
        soak.own_rss_kib = procfs::memory(std::process::id(), 0.0, false).map_or(0, |sample| sample.rss_kib);
        soak.distributions = self.merged.keep().map_err(|error| failed(&self.out, &error))?;
        (soak.trusted, soak.verdict) = verdict::of(soak);
        let path = self.out.join(SOAK_JSON);
        write_json(&path, soak).map_err(|error| failed(&path, &error))?;
        for (name, text) in [("soak-junit.xml", junit::text(soak)), ("soak.md", verdict::page(soak))] {
            let path = self.out.join(name);
            write_whole(&path, &text).map_err(|error| failed(&path, &error))?;
        }
        let path = self.out.join("soak.hlog");
        let length = Duration::try_from_secs_f64(soak.elapsed_s).unwrap_or_default();
        self.merged.write(&path, soak.started_unix_s, length).map_err(|error| failed(&path, &error))
    }
}

/// Seconds since 1970.
pub(super) fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::super::model::CheckResult;
    use super::super::tests::segment;
    use super::*;

    fn settings(segment_s: f64) -> Settings {
        Settings { bus: "unix:///b".into(), segment_s, ..Settings::default() }
    }

    #[test]
    fn a_soak_goes_on_with_its_numbers_and_its_sums() {
        let out = tempfile::tempdir().unwrap();
        let mut keeping = SoakFolder::open(out.path(), settings(10.0), 60.0, false).unwrap();
        assert_eq!(keeping.next_number(), 1);
        keeping.soak.segments.push(segment(1, &[("account", CheckResult::Passed)]));
        keeping.soak.elapsed_s = 20.0;
        keeping.write().unwrap();
        let before = keeping.soak.clone();
        drop(keeping);
        // Killed while the second one ran.
        std::fs::create_dir(out.path().join("segments/0002-soak")).unwrap();
        let mut keeping = SoakFolder::open(out.path(), settings(10.0), 60.0, false).unwrap();
        assert_eq!(keeping.soak.segments[0], before.segments[0]);
        assert_eq!((keeping.soak.elapsed_s, keeping.next_number()), (20.0, 3));
        keeping.write().unwrap();
        assert_eq!((keeping.soak.totals.segments, keeping.soak.totals.unfinished), (1, 1));
        assert!(keeping.soak.trusted);
    }

    #[test]
    fn other_settings_and_a_second_soak_are_refused() {
        let out = tempfile::tempdir().unwrap();
        let mut first = SoakFolder::open(out.path(), settings(10.0), 60.0, false).unwrap();
        first.write().unwrap();
        let refused = SoakFolder::open(out.path(), settings(10.0), 60.0, false).err().unwrap().to_string();
        assert!(refused.contains("another soak"), "{refused}");
        drop(first);
        let refused = SoakFolder::open(out.path(), settings(12.0), 60.0, false).err().unwrap().to_string();
        assert!(refused.contains("segment_s was 10.0, is 12.0") && refused.contains("--anyway"), "{refused}");
        let again = SoakFolder::open(out.path(), settings(12.0), 60.0, true).unwrap();
        assert_eq!(again.soak.settings.segment_s, 12.0);
    }

    #[test]
    fn a_file_that_is_no_soak_is_named() {
        let out = tempfile::tempdir().unwrap();
        std::fs::write(out.path().join("soak.json"), "{}").unwrap();
        let refused = SoakFolder::open(out.path(), settings(10.0), 60.0, false).err().unwrap().to_string();
        assert!(refused.contains("soak.json"), "{refused}");
    }
}
