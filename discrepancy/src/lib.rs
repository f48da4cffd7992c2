//! Model discrepancy: where a measurement and its simulation disagree, and which effect is missing. Records are read by the crate
//! [`records`]; estimator, statistics of columns and the workflow for any other plant are the crate [`model_fit`].
//!
//! | file | holds |
//! |---|---|
//! | [`check`] | fitness of a record, and its noise |
//! | [`gridded_record`] | a record on the grid of the simulation, with smoothed states |
//! | `sensor_inverse` | from readings to states, by the sensor models of a rig |
//! | [`windows`] | truncated simulation error: whitened residuals of windows |
//! | [`engine`] | training records with their simulations and sensitivities |
//! | `fit` | linear robust least squares over windows: the step of a fit, standard errors |
//! | [`candidates`] | effects at places, and the scaling of their numbers |
//! | [`suspects`] | candidates that the user declares in a file |
//! | [`parameters`] | baseline parameters as nuisance parameters |
//! | [`calibrate`] | calibration of these parameters |
//! | [`screen`] | linear screening of candidates |
//! | [`refit`] | nonlinear fit of effects in the simulator, by Gauss-Newton |
//! | [`name`](mod@name) | selection, elimination, explanations with their probabilities, decision, test of the name |
//! | [`extend`] | the extended rig file |
//! | [`locate`] | unknown inputs of each balance |
//! | `unknown_inputs` | a force on an axis, a flow into a chamber |
//! | [`discrepancy_term`] | the discrepancy term of a model: its balance and variables, by evidence |
//! | [`outside`] | terms outside the catalogue: dependence, curve, formula |
//! | `tabulate` | such terms as tables of the rig file |
//! | [`next`] | experiment design for ambiguous explanations |
//! | `verify` | both models on the held-out record |
//! | [`report`], `page` | results as data and as a page |
//! | [`workflow`] | the steps in order |
//! | [`commands`], [`cli`], `folder` | the program |

#![warn(missing_docs)] // an interface of other crates

pub mod calibrate;
pub mod candidates;
pub mod check;
pub mod cli;
pub mod commands;
pub mod discrepancy_term;
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
pub mod refit;
pub mod report;
pub(crate) mod screen;
pub(crate) mod sensor_inverse;
pub mod suspects;
pub(crate) mod tabulate;
pub(crate) mod unknown_inputs;
pub(crate) mod verify;
pub mod windows;
pub mod workflow;
