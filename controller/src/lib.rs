//! The program of the axis controllers: command line, runs on a bus and rehearsals, records.
//!
//! | file | holds |
//! |---|---|
//! | [`cli`], [`listing`] | command line, and the commands that print |
//! | [`run`], [`pace`] | a run: threads, and what moves the node: the rig's frames, or the barrier; [`farewell`]: how it leaves the bus |
//! | [`rehearse`] | the command of a rehearsal |
//! | [`timing`] | when everything of a cycle happened; histograms, timing tables, flight recorder |
//! | [`recording`], [`report`] | tables and report of a run |
//! | [`reload`] | numbers of changed program files, taken over while running |

pub mod cli;
pub mod farewell;
pub mod listing;
pub mod pace;
pub mod recording;
pub mod rehearse;
pub mod reload;
pub mod report;
pub mod run;
pub mod timing;

/// The controllers of a process, each within reach of XCP where that is asked for.
pub type Node = axis_control::node::ControllerNode<xcp::port::Port>;
