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
//! watched by [`algorithms::guard`], as for every algorithm.
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
//! | `wrong.rs` | the refusals |

#![warn(missing_docs)] // an interface of other crates

mod check;
mod child;
pub mod command;
mod foreign;
mod interface;
mod wrong;

use algorithms::algorithm::{Algorithm, Quantity, Ready};
use nominal::RigParameters;
use settings::parameters::Parameter;
use std::fs;
use std::path::{Path, PathBuf};

pub use child::{TRIAL_LIMIT, TrialRunner};
pub use interface::INTERFACE_VERSION;
pub use wrong::{PluginError, Wrong};

/// Called with what comes next.
type Tell<'a> = &'a mut dyn FnMut(&str);

/// What a library offers.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Its name for people and records; a program file names the library by its path.
    pub name: String,
    /// What it does, for people.
    pub about: String,
    /// What it controls: a position or a force.
    pub controls: Quantity,
    /// Its parameters, in the order of the slices.
    pub parameters: Vec<Parameter>,
}

/// An algorithm of a shared library.
pub struct Plugin {
    /// What its library says of it.
    pub description: Description,
    instance: foreign::Instance,
}

impl Algorithm for Plugin {
    fn reset(&mut self, ready: &Ready, parameters: &[f64]) {
        self.instance.reset(ready, parameters);
    }

    fn step(&mut self, ready: &Ready, parameters: &[f64]) -> f64 {
        self.instance.step(ready, parameters)
    }
}

/// Loads the library of `path` for a rig of these nominal numbers, after a trial in a child process.
///
/// # Errors
/// [`PluginError`] when there is no program to try it with, when it fails the trial or when it cannot be loaded.
pub fn load(path: &Path, rig: &RigParameters) -> Result<Plugin, PluginError> {
    let trier = TrialRunner::find().map_err(|wrong| PluginError { library: path.to_owned(), wrong })?;
    load_tried_by(&trier, path, rig)
}

/// [`load`] with a trier that is named.
///
/// # Errors
/// Those of [`load`], but for the missing program.
pub fn load_tried_by(trier: &TrialRunner, path: &Path, rig: &RigParameters) -> Result<Plugin, PluginError> {
    let made = || {
        let offer = tried_out(trier, path)?;
        let instance = foreign::Instance::create(&offer, &rig.into())?;
        Ok(Plugin { description: offer.description, instance })
    };
    made().map_err(|wrong| PluginError { library: path.to_owned(), wrong })
}

/// What the library of `path` offers, after a trial in a child process.
///
/// # Errors
/// [`PluginError`] when it fails the trial or cannot be opened.
pub fn describe(trier: &TrialRunner, path: &Path) -> Result<Description, PluginError> {
    let offer = tried_out(trier, path).map_err(|wrong| PluginError { library: path.to_owned(), wrong })?;
    Ok(offer.description)
}

fn tried_out(trier: &TrialRunner, path: &Path) -> Result<foreign::Offer, Wrong> {
    let file = absolute(path)?;
    trier.try_out(&file)?;
    foreign::open(&file, &mut |_| ())
}

/// The trial itself, in this process: opens, asks and runs the library with the shipped rig's numbers, every parameter
/// at its default. A bad library may end the process.
///
/// # Errors
/// [`PluginError`] for a library that is refused.
pub fn probe(path: &Path) -> Result<Description, PluginError> {
    probe_telling(path, &mut |_| ())
}

fn probe_telling(path: &Path, tell: Tell<'_>) -> Result<Description, PluginError> {
    let tried = |tell: Tell<'_>| {
        let file = absolute(path)?;
        let offer = foreign::open(&file, tell)?;
        let values: Vec<_> = offer.description.parameters.iter().map(|parameter| parameter.default).collect();
        tell("create");
        let mut instance = foreign::Instance::create(&offer, &(&RigParameters::baseline()).into())?;
        tell("reset");
        instance.reset(&check::plausible(0.0), &values);
        check::trial(|number, ready| {
            tell(&format!("step {number}"));
            instance.step(ready, &values)
        })?;
        check::arithmetic()?;
        tell("destroy");
        drop(instance);
        tell("its clean-up at the end of the process");
        Ok(offer.description)
    };
    tried(tell).map_err(|wrong| PluginError { library: path.to_owned(), wrong })
}

/// With a `/` in it, so that the system looks at this file and not through its folders of libraries.
fn absolute(path: &Path) -> Result<PathBuf, Wrong> {
    fs::canonicalize(path).map_err(Wrong::File)
}
