//! Campaigns: thousands of simulated runs from one file, on one machine or many.
//!
//! ```text
//!   campaign.toml ──► points.rs: run number ──► values ──► condition.rs: rig, experiment, programs of the run
//!                                                              │
//!        rehearsed.rs (plant and controllers here), processes.rs (lockstep), command.rs (an external program)
//!                                                              │ outcome.rs: how it ended, figures
//!                                                              ▼
//!   engine.rs: parts that are missing, on all cores ──► parts.rs: OUT/parts/000012.csv ──► merge.rs: runs.csv
//!                                                                                      └─► page.rs: report.html
//! ```
//!
//! A run depends on the campaign and its number alone, and so does a part: shards, machines and their order do not matter. Time
//! is simulated throughout; runs that measure latencies must not share cores and do not belong in a campaign.
//!
//! | file | holds |
//! |---|---|
//! | [`mod@file`] | the campaign file |
//! | [`factor`] | factors: what is varied |
//! | [`points`] | the list of runs |
//! | [`inputs`] | the files that a campaign names |
//! | [`edits`] | numbers set in the texts of files |
//! | [`condition`] | inputs of a run |
//! | [`rehearsed`], [`processes`], [`command`] | the three ways to make a run |
//! | [`child`] | child processes with a time limit |
//! | [`outcome`] | result of a run |
//! | [`campaign`] | the campaign with all its inputs |
//! | [`shard`], [`parts`], [`engine`] | share of a start, results on disk, execution on all cores |
//! | [`merge`], [`page`] | table and page of the results |
//! | [`cli`], [`commands`] | the program |

#![warn(missing_docs)] // an interface of other crates

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
