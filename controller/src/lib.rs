//! The axis controllers behind a CAN bus: drive and load, each with its program, its chains and its place on the bus.
//!
//! It reads nothing of the process but the bus, save for the rehearsal, which runs the plant inside the controller; of
//! the plant it knows the nominal numbers of the rig file.
//!
//! | file | holds |
//! |---|---|
//! | [`station`] | frames in, commands out, for the axes of a process |
//! | [`pace`] | what moves it: the rig's frames, or the barrier; [`farewell`]: how it takes leave |
//! | [`rig_view`] | cycle numbers, lost, late and duplicate frames |
//! | [`timing`] | when everything of a cycle happened; histograms, timing tables, flight recorder |
//! | [`axis`] | one axis controller: chains, work, program put together |
//! | [`chains`] | the sequence chains: main, force, matching, emergency stop |
//! | [`program`] | tasks of an axis, composed in a file; [`pre_controller`], [`post_controller`], [`linearisation`] |
//! | [`algorithm`], [`algorithms`], [`parameters`] | what an algorithm is, those shipped, their parameters |
//! | [`rest_zone`] | when a rod is left alone |
//! | [`plugin`], [`guard`] | algorithms from shared libraries, the watch over every algorithm |
//! | [`set_point`] | motion laws, forces, loads |
//! | [`experiment`], [`setup`] | experiment files, and controllers made of them |
//! | [`rehearsal`], [`rehearse`] | the plant inside the controller, and its command |
//! | [`figures`] | dynamic and static error |
//! | [`xcp`], [`parameter_set`] | measuring and tuning by XCP on CAN, parameter sets as files |
//! | [`run`], [`recording`], [`report`], [`watch`], [`listing`], [`cli`] | around it |

pub mod algorithm;
pub mod algorithms;
pub mod axis;
pub mod chains;
pub mod cli;
pub mod experiment;
pub mod farewell;
pub mod figures;
pub mod guard;
pub mod linearisation;
pub mod listing;
pub mod pace;
pub mod parameter_set;
pub mod parameters;
pub mod plugin;
pub mod post_controller;
pub mod pre_controller;
pub mod program;
pub mod recording;
pub mod rehearsal;
pub mod rehearse;
pub mod report;
pub mod rest_zone;
pub mod rig_view;
pub mod run;
pub mod set_point;
pub mod setup;
pub mod station;
pub mod timing;
pub mod watch;
pub mod xcp;
