//! The folder of results: nothing that was read is written over, a file is there whole or not at all, and nothing of an earlier
//! result stays beside a new one.

use crate::next::menu::MENU;
use model_fit::ModelReport;
use runlog::run_folder::{REPORT_HTML, REPORT_JSON, write_whole};
use serde::Serialize;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Why a result cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("{}: {why}: choose another folder, or make room", file.display())]
    Write { file: PathBuf, why: io::Error },
    #[error("{} is read here and would be written over: choose another --out", file.display())]
    Input { file: PathBuf },
}

/// A folder that takes the results of one run.
#[derive(Debug)]
pub(crate) struct Folder {
    pub(crate) path: PathBuf,
    /// Files that are read, as the file system knows them.
    inputs: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder if it is missing.
    pub(crate) fn open<'a>(
        path: &Path,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<Self, FolderError> {
        fs::create_dir_all(path).map_err(|why| FolderError::Write { file: path.to_owned(), why })?;
        // Missing inputs are reported by their reader.
        let inputs = inputs.into_iter().filter_map(|file| fs::canonicalize(file).ok()).collect();
        Ok(Self { path: path.to_owned(), inputs })
    }

    /// A file of results that may be written.
    pub(crate) fn file(&self, name: impl AsRef<Path>) -> Result<PathBuf, FolderError> {
        let file = self.path.join(name);
        let known = fs::canonicalize(&file).is_ok_and(|path| self.inputs.contains(&path));
        if known { Err(FolderError::Input { file }) } else { Ok(file) }
    }

    /// Removes the results of an earlier close; `model` is the name of its model.
    pub(crate) fn clear(&self, model: &Path) -> Result<(), FolderError> {
        if !self.path.join(REPORT_JSON).exists() {
            return Ok(());
        }
        if let Some(earlier) = self.earlier_model().filter(|earlier| self.file(earlier).is_ok()) {
            self.remove(&earlier)?;
        }
        let proposed = MENU.iter().map(|entry| PathBuf::from(entry.file()));
        for name in [REPORT_JSON, REPORT_HTML].map(PathBuf::from).into_iter().chain(proposed) {
            self.remove(&name)?;
        }
        self.remove(model)
    }

    /// The file of a model of any plant that an earlier close wrote here.
    fn earlier_model(&self) -> Option<PathBuf> {
        let text = fs::read_to_string(self.path.join(REPORT_JSON)).ok()?;
        let ModelReport { model, named, discovered, .. } = serde_json::from_str(&text).ok()?;
        let name = Path::new(&model).file_name()?;
        (!named.is_empty() || !discovered.is_empty()).then(|| PathBuf::from(name))
    }

    fn remove(&self, name: &Path) -> Result<(), FolderError> {
        let file = self.file(name)?;
        match fs::remove_file(&file) {
            Err(why) if why.kind() != io::ErrorKind::NotFound => Err(FolderError::Write { file, why }),
            _ => Ok(()),
        }
    }

    pub(crate) fn write(&self, name: impl AsRef<Path>, text: &str) -> Result<(), FolderError> {
        write(&self.file(name)?, text)
    }

    pub(crate) fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), FolderError> {
        let mut text = serde_json::to_string_pretty(value).expect("reports hold nothing that JSON does not");
        text.push('\n');
        self.write(name, &text)
    }
}

pub(crate) fn write(file: &Path, text: &str) -> Result<(), FolderError> {
    write_whole(file, text).map_err(|why| FolderError::Write { file: file.to_owned(), why })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_not_written_over_under_any_name() {
        let scratch = tempfile::tempdir().unwrap();
        let rig = scratch.path().join("rig.toml");
        fs::write(&rig, "a").unwrap();
        let folder = Folder::open(&scratch.path().join("."), [&rig]).unwrap();
        let error = folder.write("rig.toml", "b").unwrap_err();
        assert!(error.to_string().contains("would be written over"), "{error}");
        assert_eq!(fs::read_to_string(&rig).unwrap(), "a");
        folder.write("report.json", "{}").unwrap();
        assert!(matches!(folder.clear(Path::new("rig.toml")), Err(FolderError::Input { .. })));
        assert!(rig.exists());
    }

    #[test]
    fn an_earlier_result_goes_and_foreign_files_stay() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = Folder::open(scratch.path(), []).unwrap();
        folder.write("rig.toml", "of somebody").unwrap();
        folder.clear(Path::new("rig.toml")).unwrap();
        assert!(scratch.path().join("rig.toml").exists(), "no report.json: nothing of ours");
        for name in ["report.json", "next-chirps.toml", "notes.txt"] {
            folder.write(name, "x").unwrap();
        }
        folder.clear(Path::new("rig.toml")).unwrap();
        let left: Vec<_> =
            fs::read_dir(scratch.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["notes.txt"]);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_reported_with_what_to_do() {
        let scratch = tempfile::tempdir().unwrap();
        fs::create_dir(scratch.path().join("report.json.part")).unwrap();
        let error = write(&scratch.path().join("report.json"), "after").unwrap_err().to_string();
        assert!(error.contains("report.json") && error.contains("choose another folder"), "{error}");
    }

    #[test]
    fn the_extended_model_of_an_earlier_close_goes_with_its_report() {
        let scratch = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(scratch.path().join(name), text).unwrap();
        write("tanks.toml", "extended");
        write("mine.toml", "of the user");
        write("report.json", r#"{"model": "../models/tanks.toml", "named": [{"suspect": "leak"}]}"#);
        let folder = Folder::open(scratch.path(), []).unwrap();
        folder.clear(Path::new("ball.toml")).unwrap();
        let is_there = |name: &str| scratch.path().join(name).exists();
        assert_eq!(["tanks.toml", "report.json", "mine.toml"].map(is_there), [false, false, true]);
        // A close that named nothing wrote none.
        write("report.json", r#"{"model": "mine.toml", "named": [], "discovered": []}"#);
        folder.clear(Path::new("ball.toml")).unwrap();
        assert!(is_there("mine.toml"));
    }
}
