//! Claims of the record maker.
