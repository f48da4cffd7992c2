//! The axis controllers behind a CAN bus: position control of the drive, the load held shut.
//!
//! It reads nothing of the process but the bus; of the plant it knows the nominal numbers of the rig file.
//!
//! | file | holds |
//! |---|---|
//! | [`station`] | frames in, commands out |
//! | [`pace`] | what moves it: the rig's frames, or the barrier |
//! | [`rig_view`] | cycle numbers, lost frames |
//! | [`main_chain`] | from a rig at rest through the experiment to done |
//! | [`chains`] | the sequence chains of one axis: main, force, matching, emergency stop |
//! | [`set_point`] | profiles and motion laws |
//! | [`axes`], [`linearisation`] | the axis controllers, the inverse valve characteristic |
//! | [`algorithm`], [`algorithms`], [`parameters`] | what an algorithm is, those shipped, their parameters |
//! | [`plugin`], [`guard`] | algorithms from shared libraries, the watch over every algorithm |
//! | [`figures`] | dynamic and static error |
//! | [`run`], [`recording`], [`experiment`], [`cli`] | around it |

pub mod algorithm;
pub mod algorithms;
pub mod axes;
pub mod chains;
pub mod cli;
pub mod experiment;
pub mod figures;
pub mod guard;
pub mod linearisation;
pub mod main_chain;
pub mod pace;
pub mod parameters;
pub mod plugin;
pub mod post_controller;
pub mod pre_controller;
pub mod program;
pub mod recording;
pub mod rest_zone;
pub mod rig_view;
pub mod run;
pub mod set_point;
pub mod station;
