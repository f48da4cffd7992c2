//! The study: judges a program that names missing effects, on records whose truth it never sees.
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
//! | [`draws`] | which effects, how strong, where, under which difficulties: a pure function of seed and shape |
//! | [`folder`] | the files of a study's folder; each is whole or absent |
//! | [`program`] | one start of the program under study: time limit, wall time, memory |
//! | [`step`] | one draw: records, program, what it wrote |
//! | [`answer`] | what a campaign is given of it |
//! | [`report`] | `report.json`, read as strictly as it is promised |
//! | [`judge`] | one case: what was hidden against what was named |
//! | [`ledger`] | which seeds were opened, and which may be drawn |
//! | [`leave_out`] | one case whose effect is left out of the program's catalogue |
//! | [`resolve`] | whether the experiment that a program proposes resolves what it could not tell apart |
//! | [`interval`] | what so many of so many prove |
//! | [`target`] | what is wanted of a rate, and whether it is reached |
//! | [`score`] | all cases: rates, confusion matrix, parameters, time |
//! | [`page`] | the score as one page |
//! | [`probability`] | whether the probabilities of explanations keep what they promise |
//! | [`worlds`] | exact world and world with a background side by side |
//! | [`compare`] | several scores side by side |
//! | [`curve`] | how rates fall with noise and amplitude |
//! | [`trajectory`], [`signature`] | true states of a record; what an effect changes in windows that start from them |
//! | [`twins`] | two effects that a record leaves alike, and an experiment tells apart |
//! | [`limits`] | amplitude from which an ideal observer sees an effect |
//! | [`classes`] | which effects leave the same signature in a record |
//! | [`nearest`], [`forms`] | the catalogue's law nearest to another form, and what it leaves of each |
//! | [`compute`] | both, for all places and draws |
//! | [`document`] | both as tables of a page |
//!
//! The commands: `scripts/study --help`; what they found: `tests/docs/study.md`; on which seeds: `tests/docs/seeds.md`.

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
pub mod judge;
pub mod leave_out;
pub mod ledger;
pub mod limits;
pub mod nearest;
pub mod page;
pub mod probability;
pub mod program;
pub mod report;
pub mod resolve;
pub mod score;
pub mod signature;
pub mod step;
pub mod target;
pub mod trajectory;
pub mod twins;
pub mod worlds;

pub const SCHEMA_VERSION: u32 = 1;
