//! What all pages share, so that a page of any program looks and reads like the others.
//!
//! | file | holds |
//! |---|---|
//! | [`page`] | stylesheet, frame of a document, escaped text |
//! | [`markup`] | tables, lists, sections |
//! | [`grid`] | a table of words, in Markdown and HTML |
//! | [`svg`] | scales, lines, markers, drawings |
//! | [`plot`] | a pair of axes, bars, figures with a caption |
//! | [`number`] | numbers, lengths of time and dates as a person reads them |
//! | [`significant`] | numbers with three digits that count |

#![warn(missing_docs)] // an interface of other crates

pub mod grid;
pub mod markup;
pub mod number;
pub mod page;
pub mod plot;
pub mod significant;
pub mod svg;
