//! Where a measurement and its simulation disagree, and what is missing.
//!
//! | file | holds |
//! |---|---|
//! | [`records`] | one reader of records, whatever their form: `measurement.csv`, `bus.log`, foreign CSV with a mapping |
//! | [`check`] | whether a record can be used, and its noise |
//! | [`course`] | a record on the simulation's grid |
//! | [`next`] | the experiment that would tell apart what a record does not |
//! | [`report`] | what was found, as data |

pub mod check;
pub mod course;
pub mod next;
pub mod records;
pub mod report;
