//! Paths of the programs and of the files of the rig.
//!
//! | | programs | files of the rig |
//! |---|---|---|
//! | requested | `$AIRBENCH_BIN`, or `$AIRBENCH_BIN_DIR` of scripts | `$AIRBENCH_SHARE` |
//! | checkout | beside `airbench` | the checkout above `airbench` |
//! | package of Debian | beside it, or `PREFIX/lib/airbench` | `PREFIX/share/airbench` |
//! | wheel | beside it | `data`, beside the folder of `airbench` |

use crate::FrontError;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Files of the rig: the name in an installed folder, and the path in a checkout.
const FILES: [(&str, &str); 7] = [
    ("rig.toml", "plant/rig.toml"),
    ("rig.dbc", "protocol/rig.dbc"),
    ("experiments", "controller/experiments"),
    ("programs", "controller/programs"),
    ("held-out.toml", "discrepancy/experiments/held-out.toml"),
    ("latency-bounds.toml", "latency/bounds.toml"),
    ("latency-bounds-spin.toml", "latency/bounds-spin.toml"),
];

/// Folders in the order of the search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Places {
    programs: Vec<PathBuf>,
    data: Vec<PathBuf>,
}

impl Places {
    /// Places by the path of the running program and the variables AIRBENCH_BIN and AIRBENCH_SHARE.
    pub(crate) fn find() -> Result<Self, String> {
        let program_path =
            std::env::current_exe().map_err(|error| format!("cannot find where it lies: {error}"))?;
        Ok(Self::of(&program_path, |name| std::env::var_os(name).filter(|value| !value.is_empty())))
    }

    fn of(program_path: &Path, variable: impl Fn(&str) -> Option<OsString>) -> Self {
        let folder = program_path.parent().unwrap_or(program_path);
        let prefix = folder.parent().unwrap_or(folder);
        let asked = variable("AIRBENCH_BIN").or_else(|| variable("AIRBENCH_BIN_DIR"));
        let programs = match asked {
            Some(asked) => vec![asked.into()],
            None => vec![folder.into(), prefix.join("lib/airbench")],
        };
        let data = match variable("AIRBENCH_SHARE") {
            Some(asked) => vec![asked.into()],
            None => {
                let checkout = folder.ancestors().find(|above| is_checkout(above)).map(Path::to_owned);
                [prefix.join("share/airbench"), prefix.join("data")].into_iter().chain(checkout).collect()
            }
        };
        Self { programs, data }
    }

    pub(crate) fn program(&self, name: &str) -> Result<PathBuf, FrontError> {
        let paths: Vec<_> = self.programs.iter().map(|folder| folder.join(name)).collect();
        paths.iter().find(|path| path.is_file()).cloned().ok_or_else(|| {
            let looked = written(&paths);
            FrontError::Input(format!(
                "the program '{name}' is not there; looked for {looked}; AIRBENCH_BIN=DIR names the folder of the programs"
            ))
        })
    }

    /// A file or folder of the rig, by its name in [`FILES`].
    pub(crate) fn data(&self, name: &str) -> Result<PathBuf, FrontError> {
        let (_, in_checkout) = FILES.iter().find(|(file, _)| *file == name).expect("a name of FILES");
        let paths = self.data.iter().flat_map(|folder| [folder.join(name), folder.join(in_checkout)]);
        paths.clone().find(|path| path.exists()).ok_or_else(|| {
            let looked = written(&paths.collect::<Vec<_>>());
            FrontError::Input(format!(
                "{name} is not there; looked for {looked}; AIRBENCH_SHARE=DIR names a checkout, or the folder of installed files"
            ))
        })
    }

    /// The source tree of the files; `None` where airbench is installed.
    pub(crate) fn checkout(&self) -> Option<&Path> {
        self.data.iter().map(PathBuf::as_path).find(|folder| is_checkout(folder))
    }

    /// Parent of new run folders: in the checkout, else below the working directory.
    pub(crate) fn runs(&self) -> PathBuf {
        self.checkout().unwrap_or(Path::new("")).join("runs")
    }
}

fn is_checkout(folder: &Path) -> bool {
    folder.join("protocol/rig.dbc").is_file() && folder.join("scripts/run").is_file()
}

fn written(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(folder: &Path, files: &[&str]) {
        for file in files {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
    }

    #[test]
    fn installed_files_and_programs_are_found_from_the_prefix() {
        let prefix = tempfile::tempdir().unwrap();
        made(prefix.path(), &["lib/airbench/bench", "share/airbench/rig.toml"]);
        let places = Places::of(&prefix.path().join("bin/airbench"), |_| None);
        assert_eq!(places.program("bench").unwrap(), prefix.path().join("lib/airbench/bench"));
        assert_eq!(places.data("rig.toml").unwrap(), prefix.path().join("share/airbench/rig.toml"));
        assert_eq!((places.checkout(), places.runs()), (None, PathBuf::from("runs")));
    }

    #[test]
    fn a_wheel_has_its_files_beside_the_folder_of_programs() {
        let package = tempfile::tempdir().unwrap();
        made(package.path(), &["bin/emulator", "data/experiments/a.toml"]);
        let places = Places::of(&package.path().join("bin/airbench"), |_| None);
        assert_eq!(places.program("emulator").unwrap(), package.path().join("bin/emulator"));
        assert_eq!(places.data("experiments").unwrap(), package.path().join("data/experiments"));
    }

    #[test]
    fn a_checkout_is_found_above_the_program_that_was_built_in_it() {
        let root = tempfile::tempdir().unwrap();
        made(root.path(), &["protocol/rig.dbc", "scripts/run", "plant/rig.toml"]);
        let places = Places::of(&root.path().join("target/release/airbench"), |_| None);
        assert_eq!(places.data("rig.toml").unwrap(), root.path().join("plant/rig.toml"));
        assert_eq!(places.runs(), root.path().join("runs"));
    }

    #[test]
    fn what_the_environment_names_is_the_only_place_and_messages_name_it() {
        let places = Places::of(Path::new("/usr/bin/airbench"), |name| Some(format!("/{name}").into()));
        let message = places.program("bench").unwrap_err().to_string();
        assert!(message.contains("looked for /AIRBENCH_BIN/bench;"), "{message}");
        let message = places.data("rig.dbc").unwrap_err().to_string();
        assert!(message.contains("/AIRBENCH_SHARE/rig.dbc, /AIRBENCH_SHARE/protocol/rig.dbc;"), "{message}");
    }
}
