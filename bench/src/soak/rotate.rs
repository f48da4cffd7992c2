//! Removes large files of older segments, so that a soak of any length needs a known space: the newest and the failed ones keep
//! theirs.

use super::model::Segment;
use runlog::process::{HLOG_END, TIMING_END};
use runlog::run_folder::{BUS_LOG, MEASUREMENT_CSV, PROBE_CSV, TRUTH_CSV, controller_csv};
use runlog::{Axis, flight_dump};
use std::io;
use std::path::Path;

/// Removes the large files of older segments and marks the segments.
pub(super) fn rotate(out: &Path, segments: &mut [Segment], keep: u64, keep_failed: u64) -> io::Result<()> {
    let (mut newest, mut failed) = (0, 0);
    for segment in segments.iter_mut().rev() {
        newest += 1;
        let is_failed = segment.failed() || !segment.finished;
        failed += u64::from(is_failed);
        if newest > keep && !(is_failed && failed <= keep_failed) && !segment.rotated {
            remove_big(&out.join("segments").join(&segment.folder))?;
            segment.rotated = true;
        }
    }
    Ok(())
}

fn remove_big(folder: &Path) -> io::Result<()> {
    // Removed by hand already.
    let gone = |result: io::Result<()>| match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        result => result,
    };
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let name = entry?.file_name();
        let name = name.to_string_lossy();
        let path = folder.join(&*name);
        if name == flight_dump::FOLDER {
            gone(std::fs::remove_dir_all(&path))?;
        } else if is_big(&name) {
            gone(std::fs::remove_file(&path))?;
        }
    }
    Ok(())
}

/// Whether a file grows with the segment's length. Sums of such tables and logs are in `soak.json` and `soak.hlog`.
fn is_big(name: &str) -> bool {
    [BUS_LOG, MEASUREMENT_CSV, TRUTH_CSV, PROBE_CSV].contains(&name)
        || Axis::ALL.into_iter().any(|axis| controller_csv(axis) == name)
        || [TIMING_END, HLOG_END].iter().any(|end| name.ends_with(end))
}

#[cfg(test)]
mod tests {
    use super::super::model::CheckResult;
    use super::super::tests::segment;
    use super::*;

    #[test]
    fn the_newest_and_the_failed_keep_their_big_files() {
        let out = tempfile::tempdir().unwrap();
        let mut segments: Vec<_> = (1..=6)
            .map(|number| {
                let failed = matches!(number, 1 | 2);
                segment(
                    number,
                    &[("account", if failed { CheckResult::Failed } else { CheckResult::Passed })],
                )
            })
            .collect();
        for segment in &segments {
            let folder = out.path().join("segments").join(&segment.folder);
            std::fs::create_dir_all(folder.join("flight/emulator-1-late")).unwrap();
            for name in ["bus.log", "emulator-timing.csv", "emulator.hlog", "summary.json"] {
                std::fs::write(folder.join(name), "x").unwrap();
            }
        }
        rotate(out.path(), &mut segments, 2, 1).unwrap();
        let left = |name: &str| {
            let has =
                |segment: &&Segment| out.path().join("segments").join(&segment.folder).join(name).exists();
            segments.iter().filter(has).map(|segment| segment.spec.number).collect::<Vec<_>>()
        };
        for name in ["bus.log", "emulator-timing.csv", "emulator.hlog", "flight"] {
            assert_eq!(left(name), [2, 5, 6], "{name}");
        }
        assert_eq!(left("summary.json").len(), 6);
        assert!(segments[0].rotated && !segments[5].rotated);
        // Again, with a folder that somebody removed.
        std::fs::remove_dir_all(out.path().join("segments/0005-e")).unwrap();
        rotate(out.path(), &mut segments, 1, 0).unwrap();
    }
}
