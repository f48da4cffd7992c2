//! Algorithms from shared libraries: `include/airbench_algorithm.h` seen from this side.
//!
//! ```text
//!   program file: library = "FILE" ──► load ──► child process: open, look, create, reset, 100 steps, destroy
//!                                        │           └── refused: named reason, nothing foreign was in this process
//!                                        └──► open and look here ──► create ──► Plugin (an Algorithm)
//! ```
//!
//! Everything that a library says is looked at once, when it is loaded: version, size, functions, texts, ranges. After that a
//! step is one call through a pointer: no allocation, no lock. That its results are numbers and that it returns in time is
//! checked by [`algorithms::guard`], as for every algorithm.
//!
//! A library runs with all rights of the controller. The trial keeps mistakes out, not malice. Libraries are loaded
//! before the thread asks for real-time priority, since the trial takes tens of milliseconds.
//!
//! | file | holds |
//! |---|---|
//! | `interface.rs` | the header's structures |
//! | `foreign.rs` | opening, reading, calling: all unsafe code |
//! | `check.rs` | what texts and numbers must be, the trial's inputs |
//! | `child.rs` | the trial in a process of its own |
//! | `command.rs` | `controller check-library FILE` |
//! | `refusal.rs` | the refusals |

#![warn(missing_docs)] // an interface of other crates

mod check;
mod child;
pub mod command;
mod foreign;
mod interface;
mod refusal;

use algorithms::algorithm::{Algorithm, AlgorithmInput, Quantity};
use nominal::RigParameters;
use settings::parameters::Parameter;
use std::fs;
use std::path::{Path, PathBuf};

pub use child::{TRIAL_LIMIT, TrialRunner};
pub use interface::INTERFACE_VERSION;
pub use refusal::{PluginError, RefusalReason};

/// Called with the name of each stage of the trial before it begins.
type StageReport<'a> = &'a mut dyn FnMut(&str);

/// Description of the algorithm in a library.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Its name for people and records; a program file names the library by its path.
    pub name: String,
    /// One sentence for people.
    pub about: String,
    /// Controlled quantity: a position or a force.
    pub controls: Quantity,
    /// Its parameters, in the order of the slices.
    pub parameters: Vec<Parameter>,
}

/// An algorithm of a shared library.
pub struct Plugin {
    /// Description by its library.
    pub description: Description,
    instance: foreign::Instance,
}

impl Algorithm for Plugin {
    fn reset(&mut self, input: &AlgorithmInput, parameters: &[f64]) {
        self.instance.reset(input, parameters);
    }

    fn step(&mut self, input: &AlgorithmInput, parameters: &[f64]) -> f64 {
        self.instance.step(input, parameters)
    }
}

/// Loads the library of `path` for a rig of these nominal numbers, after a trial in a child process.
///
/// # Errors
/// [`PluginError`] when there is no program to try it with, when it fails the trial or when it cannot be loaded.
pub fn load(path: &Path, rig: &RigParameters) -> Result<Plugin, PluginError> {
    let runner = TrialRunner::find().map_err(|reason| PluginError { library: path.to_owned(), reason })?;
    load_tried_by(&runner, path, rig)
}

/// [`load`] with a named trial runner.
///
/// # Errors
/// Those of [`load`], but for the missing program.
pub fn load_tried_by(runner: &TrialRunner, path: &Path, rig: &RigParameters) -> Result<Plugin, PluginError> {
    let load = || {
        let library = try_and_open(runner, path)?;
        let instance = foreign::Instance::create(&library, &rig.into())?;
        Ok(Plugin { description: library.description, instance })
    };
    load().map_err(|reason| PluginError { library: path.to_owned(), reason })
}

/// Description of the library at `path`, after a trial in a child process.
///
/// # Errors
/// [`PluginError`] when it fails the trial or cannot be opened.
pub fn describe(runner: &TrialRunner, path: &Path) -> Result<Description, PluginError> {
    let library =
        try_and_open(runner, path).map_err(|reason| PluginError { library: path.to_owned(), reason })?;
    Ok(library.description)
}

fn try_and_open(runner: &TrialRunner, path: &Path) -> Result<foreign::CheckedLibrary, RefusalReason> {
    let file = absolute(path)?;
    runner.try_out(&file)?;
    foreign::open(&file, &mut |_| ())
}

/// The trial itself, in this process: opens, asks and runs the library with the shipped rig's numbers, every parameter
/// at its default. A bad library may end the process.
///
/// # Errors
/// [`PluginError`] for a library that is refused.
pub fn probe(path: &Path) -> Result<Description, PluginError> {
    probe_with_stages(path, &mut |_| ())
}

fn probe_with_stages(path: &Path, report_stage: StageReport<'_>) -> Result<Description, PluginError> {
    let probe = |report_stage: StageReport<'_>| {
        let file = absolute(path)?;
        let library = foreign::open(&file, report_stage)?;
        let values: Vec<_> =
            library.description.parameters.iter().map(|parameter| parameter.default).collect();
        report_stage("create");
        let mut instance = foreign::Instance::create(&library, &(&RigParameters::baseline()).into())?;
        report_stage("reset");
        instance.reset(&check::plausible(0.0), &values);
        check::trial(|number, input| {
            report_stage(&format!("step {number}"));
            instance.step(input, &values)
        })?;
        check::arithmetic()?;
        report_stage("destroy");
        drop(instance);
        report_stage("its clean-up at the end of the process");
        Ok(library.description)
    };
    probe(report_stage).map_err(|reason| PluginError { library: path.to_owned(), reason })
}

/// With a `/` in it, so that the system looks at this file and not through its folders of libraries.
fn absolute(path: &Path) -> Result<PathBuf, RefusalReason> {
    fs::canonicalize(path).map_err(RefusalReason::File)
}
