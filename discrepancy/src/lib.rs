//! Where a measurement and its simulation disagree, and what is missing.
//!
//! | file | holds |
//! |---|---|
//! | [`records`] | one reader of records, whatever their form: `measurement.csv`, `bus.log`, foreign CSV with a mapping |
//! | [`single_equation`] | a model that is one balance alone, and the real records |
//! | [`check`] | whether a record can be used, and its noise |
//! | [`gridded_record`] | a record on the simulation's grid |
//! | [`sensor_inverse`] | where the pistons were, by sensors that lie |
//! | [`windows`] | a record in windows, each simulated from its own start |
//! | [`engine`] | all records with everything that is simulated of them |
//! | [`fit`] | what some columns explain of the windows |
//! | [`candidates`] | every effect at every place, and how its numbers are moved |
//! | [`parameters`] | numbers of the baseline that may merely be wrong |
//! | [`calibrate`] | these numbers from records |
//! | [`screen`] | how much each candidate would explain |
//! | [`refit`] | effects fitted in the simulator itself |
//! | [`name`](mod@name) | which effects are missing |
//! | [`extend`] | the rig file with what was found |
//! | [`locate`] | unknown inputs of each balance: where model and records disagree |
//! | [`outside`] | what the catalogue does not have: dependence, curve, formula |
//! | `stats` | order statistics and means |
//! | [`tabulate`] | the same added to the rig as a table |
//! | [`next`] | the experiment that would tell apart what a record does not |
//! | [`verify`] | the held-out record: both models, frozen |
//! | [`report`] | what was found, as data |
//! | [`workflow`] | all of it in order |
//! | [`commands`], [`cli`] | the program |
//! | [`page`] | the same as one page for people |

pub mod calibrate;
pub mod candidates;
pub mod check;
pub mod cli;
pub mod commands;
pub mod engine;
pub mod extend;
pub(crate) mod fit;
pub(crate) mod folder;
pub mod gridded_record;
pub mod locate;
pub mod name;
pub mod next;
pub mod outside;
pub(crate) mod page;
pub mod parameters;
pub mod records;
pub mod refit;
pub mod report;
pub(crate) mod screen;
pub(crate) mod sensor_inverse;
pub mod single_equation;
pub(crate) mod stats;
pub(crate) mod tabulate;
pub(crate) mod verify;
pub mod windows;
pub mod workflow;
