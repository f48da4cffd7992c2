//! The files of a run, read and written again.

mod formats;
