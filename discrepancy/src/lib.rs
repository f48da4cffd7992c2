//! Where a measurement and its simulation disagree, and what is missing.
//!
//! | file | holds |
//! |---|---|
//! | [`records`] | one reader of records, whatever their form: `measurement.csv`, `bus.log`, foreign CSV with a mapping |
//! | [`check`] | whether a record can be used, and its noise |
//! | [`course`] | a record on the simulation's grid |
//! | [`report`] | what was found, as data |

pub mod calibrate;
pub mod candidates;
pub mod check;
pub mod course;
pub mod engine;
pub mod fit;
pub mod name;
pub mod parameters;
pub mod records;
pub mod refit;
pub mod report;
pub mod screen;
pub mod windows;
