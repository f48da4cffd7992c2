//! Where a measurement and its simulation disagree, and what is missing.
//!
//! | file | holds |
//! |---|---|
//! | [`records`] | one reader of records, whatever their form: `measurement.csv`, `bus.log`, foreign CSV with a mapping |

pub mod records;
