//! Where a measurement and its simulation disagree, and what is missing.
//!
//! | file | holds |
//! |---|---|
//! | [`records`] | one reader of records, whatever their form: `measurement.csv`, `bus.log`, foreign CSV with a mapping |
//! | [`balance`] | a model that is one balance alone, and the real records |
//! | [`check`] | whether a record can be used, and its noise |
//! | [`course`] | a record on the simulation's grid |
//! | [`report`] | what was found, as data |

pub mod balance;
pub mod check;
pub mod course;
pub mod records;
pub mod report;
