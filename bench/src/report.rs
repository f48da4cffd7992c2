//! The latency report: what runs left behind, joined on one clock, its worst events explained, a reference beside it.
//!
//! | file | holds |
//! |---|---|
//! | [`model`] | what a report says: `report.json` |
//! | [`page`] | the report as one page |

pub mod model;
pub mod page;
