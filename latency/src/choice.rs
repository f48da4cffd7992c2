//! Which runs a report is of: folders of runs, folders that hold such folders, and groups with a name.

use super::ReportError;
use super::files;
use runlog::run_folder::FileError;
use std::path::{Path, PathBuf};

/// A run's folder and the group it was put in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SelectedRun {
    /// The run's folder.
    pub folder: PathBuf,
    /// Its group; nothing when its conditions.json says which.
    pub group: Option<String>,
}

/// The runs in `folders`, then those of `groups`, each NAME=FOLDER. A folder that is no run stands for the runs in it, by name.
///
/// # Errors
/// [`ReportError`]: a folder that cannot be read or holds no run, a group that is not written so.
pub fn select_runs(folders: &[PathBuf], groups: &[String]) -> Result<Vec<SelectedRun>, ReportError> {
    let mut selected = Vec::new();
    for folder in folders {
        selected.extend(runs_in(folder)?.into_iter().map(|folder| SelectedRun { folder, group: None }));
    }
    for group in groups {
        let parted = group.split_once('=').filter(|(name, folder)| !name.is_empty() && !folder.is_empty());
        let (name, folder) = parted.ok_or_else(|| ReportError::Group(group.clone()))?;
        let group = Some(name.to_owned());
        let of_group = runs_in(Path::new(folder))?.into_iter();
        selected.extend(of_group.map(|folder| SelectedRun { folder, group: group.clone() }));
    }
    Ok(selected)
}

fn runs_in(folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
    if files::is_run(folder) {
        return Ok(vec![folder.to_path_buf()]);
    }
    let entries = std::fs::read_dir(folder).map_err(|error| FileError::read(folder, error))?;
    let mut runs: Vec<_> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| files::is_run(path)).collect();
    runs.sort();
    if runs.is_empty() { Err(ReportError::NoRun(folder.into())) } else { Ok(runs) }
}

/// Where a report goes that was given no folder: into its run's, or for several into `report` in the folder that holds them all.
pub fn default_out(selected: &[SelectedRun]) -> PathBuf {
    let [first, others @ ..] = selected else { return PathBuf::from("report") };
    if others.is_empty() {
        return first.folder.clone();
    }
    // Whole paths, so that runs named from different places have something in common.
    let whole =
        |selected: &SelectedRun| selected.folder.canonicalize().unwrap_or_else(|_| selected.folder.clone());
    let mut common = whole(first).parent().map(Path::to_path_buf).unwrap_or_default();
    for other in others {
        let other = whole(other);
        while !other.starts_with(&common) && common.pop() {}
    }
    common.join("report")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join("summary.json"), "{}").unwrap();
    }

    #[test]
    fn folders_of_runs_are_opened_and_groups_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        ["a/2", "a/1", "b/1"].iter().for_each(|name| run(&at(name)));
        std::fs::create_dir_all(at("a/report")).unwrap();
        let selected = select_runs(&[at("a")], &[format!("new={}", at("b/1").display())]).unwrap();
        let reported: Vec<_> =
            selected.iter().map(|one| (one.folder.clone(), one.group.as_deref())).collect();
        assert_eq!(reported, [(at("a/1"), None), (at("a/2"), None), (at("b/1"), Some("new"))]);
        let whole = |path: PathBuf| path.canonicalize().unwrap();
        assert_eq!(default_out(&selected), whole(folder.path().into()).join("report"));
        assert_eq!(default_out(&selected[..2]), whole(at("a")).join("report"));
        assert_eq!(default_out(&selected[..1]), at("a/1"));
    }

    #[test]
    fn what_holds_no_run_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let reported = select_runs(&[folder.path().into()], &[]).unwrap_err();
        assert!(reported.to_string().contains("holds no run"), "{reported}");
        assert!(matches!(
            select_runs(&[folder.path().join("none")], &[]),
            Err(ReportError::File(FileError::Read { .. }))
        ));
        assert!(matches!(select_runs(&[], &["new".into()]), Err(ReportError::Group(_))));
    }
}
