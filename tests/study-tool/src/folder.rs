//! The files of a study's folder, each written atomically, so that a study can be killed at any time and resumed.
//!
//! ```text
//! OUT/draws.json               schema version, seed, shape, all recipes
//! OUT/records/0007/            train, held-out-0, held-out-1: each with measurement.csv
//! OUT/truth/0007/              the same folders with truth.json (and truth.csv, if it is kept)
//! OUT/runs/LABEL/0007/         result.json, report.json, stderr.txt of the program with this label, and next-*.toml
//! OUT/runs/LABEL-resolve/0007/ resolution.json, and the same of the program that was given that experiment's record
//! OUT/classes/0007.json        which effects leave the same signature
//! OUT/score-LABEL.json, .html  the score
//! OUT/resolve-LABEL.json, .md  what the proposed experiments resolve
//! OUT/twins.json               twins in place of draws.json; OUT/twins-LABEL.json what became of them
//! ```
//!
//! `draws.json` is for people and other programs. Its draws are not read back, since they follow from seed and shape: the file
//! has to equal what this program would write, else it is of another version and is refused.

use crate::SCHEMA_VERSION;
use crate::draws::{Draw, Shape, draws};
use campaign::parts;
use record_maker::{Form, Hidden, Recipe};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

#[derive(Debug, Clone)]
pub struct Study {
    pub root: PathBuf,
    pub(crate) plan: Plan,
    /// All draws, in the order of their numbers.
    pub draws: Vec<Draw>,
}

/// Seed and shape of a study, which determine its draws.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    pub(crate) schema_version: u32,
    /// Seed of all random numbers; below 2^53, so that JSON holds it exactly.
    pub(crate) seed: u64,
    pub(crate) shape: Shape,
}

impl Plan {
    /// The plan of a study in the current schema version; `seed` below 2^53.
    pub fn new(seed: u64, shape: Shape) -> Self {
        Plan { schema_version: SCHEMA_VERSION, seed, shape }
    }

    pub(crate) fn draws(&self) -> Vec<Draw> {
        draws(self.seed, &self.shape)
    }

    fn text(&self) -> String {
        let mut file = json!(self);
        file["draws"] = self.draws().iter().map(draw_as_json).collect();
        format!("{file:#}\n")
    }
}

#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("{path}: {error}")]
    File { path: String, error: io::Error },
    #[error("{path}: {what}")]
    Content { path: String, what: String },
}

impl FolderError {
    fn file(path: &Path) -> impl Fn(io::Error) -> Self {
        move |error| FolderError::File { path: path.display().to_string(), error }
    }

    pub(crate) fn content(path: &Path, what: impl ToString) -> Self {
        FolderError::Content { path: path.display().to_string(), what: what.to_string() }
    }
}

impl Study {
    /// Begins a study in a folder, or opens the same one.
    ///
    /// # Errors
    /// [`FolderError`] when the folder holds another study, or cannot be written.
    pub fn begin(root: &Path, plan: &Plan) -> Result<Self, FolderError> {
        let path = root.join("draws.json");
        if path.exists() {
            let study = Study::open(root)?;
            if study.plan != *plan {
                let what = format!("holds another study ({:?}): give another folder", study.plan);
                return Err(FolderError::content(&path, what));
            }
            return Ok(study);
        }
        fs::create_dir_all(root).map_err(FolderError::file(root))?;
        write_whole(&path, plan.text().as_bytes())?;
        Ok(Study { root: root.to_owned(), plan: *plan, draws: plan.draws() })
    }

    /// Opens the study of a folder.
    ///
    /// # Errors
    /// [`FolderError`] when there is none, or it is of another version of this program.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let path = root.join("draws.json");
        let text = read(&path)?;
        let plan: Plan = serde_json::from_str(&text)
            .map_err(|error| FolderError::content(&path, format!("is no list of draws: {error}")))?;
        if plan.schema_version != SCHEMA_VERSION || plan.text() != text {
            let what =
                "is not what this program draws from the same seed: use the version that began this study";
            return Err(FolderError::content(&path, what));
        }
        Ok(Study { root: root.to_owned(), plan, draws: plan.draws() })
    }

    pub(crate) fn records(&self, number: usize) -> PathBuf {
        self.root.join("records").join(name(number))
    }

    pub(crate) fn truth(&self, number: usize) -> PathBuf {
        self.root.join("truth").join(name(number))
    }

    /// Folder of the results of a draw under a label.
    pub fn run(&self, label: &str, number: usize) -> PathBuf {
        self.root.join("runs").join(label).join(name(number))
    }

    pub fn class(&self, number: usize) -> PathBuf {
        self.root.join("classes").join(format!("{}.json", name(number)))
    }
}

fn name(number: usize) -> String {
    format!("{number:04}")
}

/// A draw as `draws.json` and `score.json` hold it.
pub(crate) fn draw_as_json(draw: &Draw) -> Value {
    let Recipe { seed, axis, both_axes, hidden, form, wrong_parameters, background, .. } = &draw.recipe;
    let wrong = |(name, factor): &(String, f64)| json!({"name": name, "factor": factor});
    let mut draw_json = json!({
        "number": draw.number,
        "kind": draw.kind,
        "seed": seed,
        "axis": axis.name(),
        "both_axes": both_axes,
        "hidden": hidden.iter().map(hidden_as_json).collect::<Vec<_>>(),
        "foreign_form": form.is_foreign(),
        "wrong_parameters": wrong_parameters.iter().map(wrong).collect::<Vec<_>>(),
        "coloured_noise": draw.recipe.coloured_noise,
        "jitter": draw.recipe.jitter,
        "noise_factor": draw.recipe.noise,
    });
    // Added later: written only when set, so that older studies keep their bytes.
    if *form == Form::Far {
        draw_json["far_form"] = json!(true);
    }
    if draw.recipe.unlinked {
        draw_json["unlinked"] = json!(true);
    }
    if let Some(background) = background {
        let effects = background.effects.iter().map(hidden_as_json).collect();
        draw_json["background"] = background.as_json(effects);
    }
    draw_json
}

fn hidden_as_json(hidden: &Hidden) -> Value {
    let sheet = plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn");
    let numbers: serde_json::Map<_, _> = sheet
        .keys
        .iter()
        .zip(&hidden.numbers)
        .map(|(key, number)| (key.name.to_owned(), json!(number)))
        .collect();
    json!({"effect": hidden.name, "where": hidden.place.to_string(), "numbers": numbers})
}

pub fn read(path: &Path) -> Result<String, FolderError> {
    fs::read_to_string(path).map_err(FolderError::file(path))
}

/// Reads a JSON file `what` of the current schema version.
pub(crate) fn read_versioned<T: DeserializeOwned>(
    path: &Path,
    what: &str,
    version: impl Fn(&T) -> u32,
) -> Result<T, FolderError> {
    let refuse = |why: String| FolderError::content(path, format!("is no {what} of this version: {why}"));
    let left: T = serde_json::from_str(&read(path)?).map_err(|error| refuse(error.to_string()))?;
    match version(&left) {
        SCHEMA_VERSION => Ok(left),
        other => Err(refuse(format!("schema version {other}"))),
    }
}

/// Writes a file atomically.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FolderError> {
    parts::write_whole(path, bytes).map_err(FolderError::file(path))
}

/// Makes a folder atomically: `fill` fills a temporary folder, which is then renamed. When two processes make the same folder,
/// that of the first to finish stays.
pub(crate) fn make_whole<T, E: From<FolderError>>(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    let is_made_again = path.exists();
    let unfinished = unfinished_folder(path).map_err(FolderError::file(path))?;
    let filled = fill(unfinished.path())?;
    if is_made_again {
        fs::remove_dir_all(path).map_err(FolderError::file(path))?;
    }
    match fs::rename(unfinished.path(), path) {
        Ok(()) => {
            let _ = unfinished.keep();
            Ok(filled)
        }
        Err(_) if !is_made_again && path.exists() => Ok(filled),
        Err(error) => Err(FolderError::file(path)(error).into()),
    }
}

/// A temporary folder beside `path`: hidden, with a name of its own for each process.
fn unfinished_folder(path: &Path) -> io::Result<TempDir> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let readable = fs::Permissions::from_mode(0o777); // less what the umask takes
    tempfile::Builder::new()
        .prefix(&format!(".{name}."))
        .suffix(".unfinished")
        .permissions(readable)
        .tempdir_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_study_opens_as_it_was_begun_and_no_other_begins_in_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let plan = Plan::new(7, Shape::SMALL);
        let begun = Study::begin(folder.path(), &plan).unwrap();
        assert_eq!(Study::open(folder.path()).unwrap().draws, begun.draws);
        assert_eq!(Study::begin(folder.path(), &plan).unwrap().draws, begun.draws);
        let other = Study::begin(folder.path(), &Plan::new(8, Shape::SMALL)).unwrap_err();
        assert!(other.to_string().contains("another folder"), "{other}");
    }

    #[test]
    fn draws_that_this_program_does_not_draw_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        Study::begin(folder.path(), &Plan::new(7, Shape::SMALL)).unwrap();
        let path = folder.path().join("draws.json");
        let text =
            fs::read_to_string(&path).unwrap().replace("\"foreign_form\": false", "\"foreign_form\": true");
        fs::write(&path, text).unwrap();
        let error = Study::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("use the version that began this study"), "{error}");
    }

    #[test]
    fn far_forms_are_said_where_they_are_drawn_and_change_nothing_else() {
        let near = Plan::new(7, Shape { each: 8, ..Shape::SMALL });
        let far = Plan::new(7, Shape { far_forms: true, ..near.shape });
        assert!(!near.text().contains("far_form"));
        let mut foreign = 0;
        for (near, far) in near.draws().iter().zip(far.draws()) {
            foreign += usize::from(near.recipe.form == Form::Near);
            let form = if near.recipe.form == Form::Near { Form::Far } else { Form::Catalogue };
            assert_eq!(far.recipe, Recipe { form, ..near.recipe.clone() });
            let (near, mut far) = (draw_as_json(near), draw_as_json(&far));
            let said = far.as_object_mut().unwrap().remove("far_form");
            assert_eq!(said.is_some(), form == Form::Far);
            assert_eq!(near, far);
        }
        assert!(foreign > 0);
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(
            Study::begin(folder.path(), &far).unwrap().draws,
            Study::open(folder.path()).unwrap().draws
        );
    }

    #[test]
    fn a_folder_whose_making_fails_is_absent() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0001");
        let full = make_whole(&path, |folder| {
            fs::write(folder.join("half"), "x").unwrap();
            Err::<(), _>(FolderError::content(folder, "full"))
        });
        assert!(full.is_err() && !path.exists());
        make_whole(&path, |_| Ok::<_, FolderError>(())).unwrap();
        assert!(path.exists() && !path.join("half").exists());
    }
}
