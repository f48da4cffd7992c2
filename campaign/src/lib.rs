//! Campaigns: thousands of simulated runs from one file, on one machine or many.
//!
//! ```text
//!   campaign.toml ──► points.rs: run number ──► values ──► condition.rs: rig, experiment, programs of the run
//!                                                              │
//!        rehearsed.rs (plant and controllers here), processes.rs (lockstep), command.rs (anybody's program)
//!                                                              │ outcome.rs: how it ended, figures
//!                                                              ▼
//!   engine.rs: parts that are missing, on all cores ──► parts.rs: OUT/parts/000012.csv ──► merge.rs: runs.csv
//!                                                                                      └─► page.rs: report.html
//! ```
//!
//! A run follows from the campaign and its number, a part from the campaign and its own: shards, machines and their order change
//! nothing. Time is simulated throughout; runs that measure latencies share no cores and are none of a campaign's.
//!
//! | file | holds |
//! |---|---|
//! | [`mod@file`] | the campaign file |
//! | [`factor`] | what is varied |
//! | [`points`] | which runs there are |
//! | [`inputs`] | the files that a campaign names |
//! | [`edits`] | numbers put into the texts of files |
//! | [`condition`] | what a run is made with |
//! | [`rehearsed`], [`processes`], [`command`] | the three ways in which a run is made |
//! | [`child`] | processes that end when they have to |
//! | [`outcome`] | what a run comes to |
//! | [`campaign`] | all of it together |
//! | [`shard`], [`parts`], [`engine`] | who does what, on disk, on all cores |
//! | [`merge`], [`page`] | results |
//! | [`cli`], [`commands`] | the program |

mod campaign;
mod child;
pub mod cli;
pub mod command;
pub mod commands;
mod condition;
mod edits;
mod engine;
mod factor;
mod file;
mod inputs;
mod merge;
mod outcome;
mod page;
pub mod parts;
mod points;
mod processes;
mod rehearsed;
mod shard;
