//! Several runs: their folders, whether their experiments agree, their figures side by side.

use figures::SummaryError;
use figures::join;
use figures::record::{self, Record};
use figures::top::TOP;
use runlog::run_folder::{FileError, in_order};
use std::path::{Path, PathBuf};

/// Why runs cannot be compared.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunsError {
    /// A folder that cannot be read, or a page that cannot be written.
    #[error(transparent)]
    Summary(#[from] SummaryError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(
        "{one} is of '{title_one}' and {other} of '{title_other}', which are different experiments; \
         --anyway compares them all the same"
    )]
    DifferentExperiments { one: PathBuf, title_one: String, other: PathBuf, title_other: String },
}

/// A run in a comparison.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub folder: PathBuf,
    /// Its name in tables and legends.
    pub name: String,
    pub record: Record,
    /// Its known figures in the order of [`rows`].
    figures: Vec<(&'static str, f64)>,
}

impl Run {
    pub(crate) fn title(&self) -> String {
        self.record.experiment.title().unwrap_or("no experiment").to_owned()
    }

    pub(crate) fn figure(&self, name: &str) -> Option<f64> {
        self.figures.iter().find(|(figure, _)| *figure == name).map(|(_, value)| *value)
    }

    /// Start of the experiment, s: time 0 of comparisons.
    pub(crate) fn start_s(&self) -> f64 {
        self.record.experiments().first().map_or(0.0, |span| span.from_s)
    }
}

/// Reads the runs in `folders`; equal names get the names of their parents.
pub(crate) fn read(folders: &[PathBuf]) -> Result<Vec<Run>, SummaryError> {
    let mut runs = folders.iter().map(|folder| read_one(folder)).collect::<Result<Vec<_>, _>>()?;
    let names: Vec<_> = runs.iter().map(|run| run.name.clone()).collect();
    for run in &mut runs {
        if names.iter().filter(|name| **name == run.name).count() > 1 {
            run.name = run.folder.display().to_string();
        }
    }
    Ok(runs)
}

fn read_one(folder: &Path) -> Result<Run, SummaryError> {
    let (mut summary, run) = join::read(folder)?;
    let record = record::read(folder, join::experiment(&run)?)?;
    // Computed again: an older summary may lack figures.
    let computed = figures::of(&record);
    join::make_up_errors(&mut summary, &record);
    let summary = in_order(&summary);
    let top =
        |name: &str| summary.get(name).and_then(serde_json::Value::as_f64).or_else(|| computed.get(name));
    let figures = rows().filter_map(|(name, _)| Some((name, top(name)?))).collect();
    let real = folder.canonicalize().unwrap_or_else(|_| folder.into());
    let name =
        real.file_name().map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into());
    Ok(Run { folder: folder.into(), name, record, figures })
}

/// Names and units of all figures of a comparison.
pub(crate) fn rows() -> impl Iterator<Item = (&'static str, &'static str)> {
    let top = TOP.iter().filter(|figure| figure.is_compared).map(|figure| (figure.name, figure.unit));
    top.chain(figures::definitions().map(|definition| (definition.name, definition.unit)))
}

/// Refuses runs with different demands on the rig. Programs, their parameters, recording and bounds may differ, since
/// controllers are compared.
pub(crate) fn expect_one_experiment(runs: &[Run]) -> Result<(), RunsError> {
    let Some((first, others)) = runs.split_first() else { return Ok(()) };
    let asked_first = first.record.experiment.demands();
    match others.iter().find(|other| other.record.experiment.demands() != asked_first) {
        None => Ok(()),
        Some(other) => Err(RunsError::DifferentExperiments {
            one: first.folder.clone(),
            title_one: first.title(),
            other: other.folder.clone(),
            title_other: other.title(),
        }),
    }
}

#[cfg(test)]
pub(crate) mod made {
    use super::*;
    use std::fs;

    /// The folder of a run with this experiment, whose position lags a ramp by `error_m`.
    pub(crate) fn folder(parent: &Path, name: &str, experiment: &str, error_m: f64) -> PathBuf {
        let folder = parent.join(name);
        fs::create_dir(&folder).unwrap();
        let run = serde_json::json!({ "experiment_toml": experiment });
        fs::write(folder.join("run.json"), run.to_string()).unwrap();
        fs::write(folder.join("summary.json"), r#"{ "passed": true, "frames_lost": 0 }"#).unwrap();
        let mut controller = "time_s,main_chain,set_position_m,position_m,moving\n".to_owned();
        let mut measured = "time_s,drive_position_m,drive_valve\n".to_owned();
        for ms in 0..500_u32 {
            let time = f64::from(ms) * 1e-3;
            let state = if ms < 100 { "settling" } else { "experiment" };
            let (set, is) = (0.1 + 0.1 * time, 0.1 + 0.1 * time - error_m);
            controller += &format!("{time:.3},{state},{set},{is},{}\n", u8::from(ms >= 100));
            measured += &format!("{time:.3},{is},0.1\n");
        }
        fs::write(folder.join("controller-drive.csv"), controller).unwrap();
        fs::write(folder.join("controller-drive.json"), r#"{ "axes": { "drive": {} } }"#).unwrap();
        fs::write(folder.join("measurement.csv"), measured).unwrap();
        folder
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(experiments: &[&str]) -> (tempfile::TempDir, Vec<Run>) {
        let parent = tempfile::tempdir().unwrap();
        let folders: Vec<_> = experiments
            .iter()
            .enumerate()
            .map(|(place, text)| made::folder(parent.path(), &format!("run-{place}"), text, 0.002))
            .collect();
        let runs = read(&folders).unwrap();
        (parent, runs)
    }

    #[test]
    fn programs_may_differ_and_set_points_may_not() {
        let with = |program: &str, to: f64| {
            format!("title = \"a\"\n[drive]\nprogram = \"{program}\"\n[[drive.set-point]]\nto_m = {to}\n")
        };
        let (_parent, same) = runs(&[&with("p", 0.4), &with("cascade", 0.4)]);
        assert!(expect_one_experiment(&same).is_ok());
        let (_parent, other) = runs(&[&with("p", 0.4), &with("p", 0.3)]);
        let message = expect_one_experiment(&other).unwrap_err().to_string();
        assert!(message.contains("--anyway") && message.contains("run-1"), "{message}");
    }

    #[test]
    fn how_an_experiment_is_run_counts_and_who_starts_it_does_not() {
        let with = |run: &str| format!("title = \"a\"\n[run]\nsettling_s = 0.5\n{run}\n");
        let (_parent, same) = runs(&[&with(""), &with("start = \"on-start\"")]);
        assert!(expect_one_experiment(&same).is_ok());
        for other in ["repetitions = 2", "after_emergency_stop = \"restart\""] {
            let (_parent, runs) = runs(&[&with(""), &with(other)]);
            assert!(expect_one_experiment(&runs).is_err(), "{other}");
        }
        let (_parent, runs) = runs(&[&with(""), &with("").replace("0.5", "0.2")]);
        assert!(expect_one_experiment(&runs).is_err());
    }

    #[test]
    fn figures_are_computed_where_the_summary_has_none() {
        let (_parent, runs) = runs(&["title = \"a\""]);
        assert!((runs[0].figure("position_error_dynamic_m").unwrap() - 0.002).abs() < 1e-12);
        assert_eq!((runs[0].figure("frames_lost"), runs[0].figure("force_rise_s")), (Some(0.0), None));
        assert!((runs[0].start_s() - 0.1).abs() < 1e-12);
    }

    #[test]
    fn runs_of_one_name_are_distinguished_by_their_folders() {
        let parent = tempfile::tempdir().unwrap();
        let folders = ["a", "b"].map(|sub| {
            std::fs::create_dir(parent.path().join(sub)).unwrap();
            made::folder(&parent.path().join(sub), "run", "", 0.0)
        });
        let runs = read(&folders).unwrap();
        assert_ne!(runs[0].name, runs[1].name);
    }
}
