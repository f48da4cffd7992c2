//! Where a measurement and its simulation disagree, and what is missing.
//!
//! | file | holds |
//! |---|---|
//! | [`records`] | one reader of records, whatever their form: `measurement.csv`, `bus.log`, foreign CSV with a mapping |
//! | [`check`] | whether a record can be used, and its noise |
//! | [`course`] | a record on the simulation's grid |
//! | [`extend`] | the rig file with what was found |
//! | [`page`] | what was found, for a person |
//! | [`report`] | what was found, as data |

pub mod check;
pub mod course;
pub mod extend;
pub mod page;
pub mod records;
pub mod report;
