//! The study: judges a program that names missing effects, on records whose truth it does not get.
//!
//! ```text
//! seed, shape ──► draws ──► records/ (what the program gets)          limits.json, classes.json: computed from the plant alone,
//!                   │  └──► truth/   (what it never gets)             committed before any program is judged
//!                   ▼                                                            │
//!                 run: PROGRAM close … on copies in an empty folder ──► runs/ ───┴──► score: score.json and one page
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`draws`] | effects, amplitudes, places and difficulties: a pure function of seed and shape |
//! | [`folder`] | the files of a study's folder, each written atomically |
//! | [`program`] | one run of the program under study: time limit, wall time, memory |
//! | [`step`] | one draw: records, program, its output |
//! | [`answer`] | the answer to a campaign |
//! | [`report`] | `report.json`, parsed strictly |
//! | `judge` | one case: what was hidden against what was named |
//! | [`ledger`] | which seeds were opened, and which may be drawn |
//! | [`leave_out`] | one case whose effect is left out of the program's catalogue |
//! | [`resolve`] | whether the experiment that a program proposes resolves its ambiguity |
//! | [`interval`] | confidence intervals of a rate |
//! | `target` | the target of a rate, and whether it is reached |
//! | [`score`] | all cases: rates, confusion matrix, parameters, time |
//! | [`page`] | the score as one page |
//! | `probability` | calibration of the probabilities of explanations |
//! | [`worlds`] | exact world and world with a background side by side |
//! | [`compare`] | several scores side by side |
//! | [`curve`] | rates over noise and amplitude |
//! | `trajectory`, `signature` | true states of a record; the change by an effect in windows that start from them |
//! | [`twins`] | two effects that a record does not distinguish, and an experiment does |
//! | [`limits`] | amplitude from which an ideal observer detects an effect |
//! | [`classes`] | which effects leave the same signature in a record |
//! | `nearest`, [`forms`] | the catalogue's law nearest to another form, and what it leaves of each |
//! | [`compute`] | limits and classes for all places and draws |
//! | [`document`] | limits and classes as tables of a page |
//!
//! The commands: `scripts/study --help`; the results: `tests/docs/study.md`; the seeds: `tests/docs/seeds.md`.

pub mod answer;
pub mod classes;
pub mod compare;
pub mod compute;
pub mod curve;
pub mod document;
pub mod draws;
pub mod folder;
pub mod forms;
pub mod interval;
mod judge;
pub mod leave_out;
pub mod ledger;
pub mod limits;
mod nearest;
pub mod page;
mod probability;
pub mod program;
pub mod report;
pub mod resolve;
pub mod score;
mod signature;
pub mod step;
mod target;
mod trajectory;
pub mod twins;
pub mod worlds;

pub(crate) const SCHEMA_VERSION: u32 = 1;
