//! The latency report: what runs left behind, joined on one clock, its worst events explained, a reference beside it.
//!
//! | file | holds |
//! |---|---|
//! | [`model`] | what a report says: `report.json` |

pub mod model;
