//! Axis controllers: drive and load, each with its program, its sequence chains and its place on the bus.
//!
//! They read nothing but frames; of the plant they know the nominal numbers of the rig file.
//!
//! | file | holds |
//! |---|---|
//! | [`node`] | frames in, commands out, for the axes of a process |
//! | [`rig_view`] | cycle numbers, lost, late and duplicate frames |
//! | [`axis`] | one axis controller: chains, work, program put together |
//! | [`chains`] | the sequence chains: main, force, matching, emergency stop |
//! | [`program`] | tasks of an axis, composed in a file; [`pre_controller`], [`post_controller`] |
//! | [`set_point`] | motion laws, forces, loads |
//! | [`experiment`], [`setup`] | experiment files, and controllers made of them |
//! | [`parameter_set`] | parameter sets as files |
//! | [`figures`] | dynamic and static error |

#![warn(missing_docs)] // an interface of other crates

pub mod axis;
pub mod chains;
pub mod experiment;
pub mod figures;
pub mod node;
pub mod parameter_set;
pub mod post_controller;
pub mod pre_controller;
pub mod program;
pub mod rig_view;
pub mod set_point;
pub mod setup;
