//! Why a library is refused: what is wrong and what to do about it.

use crate::interface::{Descriptor, INTERFACE_VERSION, LONGEST_TEXT, MOST_PARAMETERS};
use settings::parameters::OutOfRange;
use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

/// A library that is refused.
#[derive(Debug, thiserror::Error)]
#[error("library '{}': {reason}", library.display())]
pub struct PluginError {
    /// File of the library.
    pub library: PathBuf,
    /// Why it is refused.
    pub reason: RefusalReason,
}

const REBUILD: &str = "build it again with this airbench's airbench_algorithm.h";

/// Reason for which a library, or its trial, is refused.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum RefusalReason {
    #[error("cannot be opened: {0}; give the path of a shared library")]
    File(#[source] io::Error),
    #[error("the system does not load it: {0}; build a shared library, with -fPIC -shared")]
    NotLoaded(String),
    #[error(
        "it exports no symbol airbench_algorithm_entry; define that function as airbench_algorithm.h declares it"
    )]
    NoEntry,
    #[error(
        "airbench_algorithm_entry({INTERFACE_VERSION}) returned NULL: it does not speak version {INTERFACE_VERSION} \
         of the interface; {REBUILD}"
    )]
    NoDescriptor,
    #[error(
        "its {0} stands at an address that no such structure can have; return the address of a static structure"
    )]
    BadAddress(&'static str),
    #[error("it speaks version {0} of the interface, this airbench version {INTERFACE_VERSION}; {REBUILD}")]
    Version(u32),
    #[error(
        "its descriptor says a struct_size of {0} bytes, {right} are right; set it to sizeof(struct airbench_algorithm) \
         and {REBUILD}", right = size_of::<Descriptor>()
    )]
    Size(u32),
    #[error("{0} is NULL; set it in the descriptor")]
    Null(String),
    #[error("{what} {why}")]
    Text { what: String, why: &'static str },
    #[error("controls = {0}; set it to AIRBENCH_POSITION or AIRBENCH_FORCE")]
    Controls(u32),
    #[error("it has {0} parameters; at most {MOST_PARAMETERS} are allowed")]
    TooMany(u32),
    #[error("it has two parameters '{0}'; give each a name of its own")]
    DuplicateParameter(String),
    #[error(
        "parameter '{name}' has the range {least} to {most}; both must be finite, the first below the second"
    )]
    Range { name: String, least: f64, most: f64 },
    #[error("a parameter's default lies outside its range: {0}; change one of them")]
    Default(#[from] OutOfRange),
    #[error(
        "loading it changes how the whole process rounds numbers; build it without -ffast-math and -Ofast, \
         and leave the floating-point modes alone"
    )]
    Arithmetic,
    #[error("create returned NULL for this rig; an algorithm without state returns any other pointer")]
    NotCreated,
    #[error(
        "step {step} of the trial returned {result}; the result must be a finite number, whatever the input"
    )]
    NotFinite { step: u32, result: f64 },
    #[error(
        "it crashed the process that tried it, {status}, during: {during}; \
         look with: gdb --args controller probe-library FILE"
    )]
    Crashed { status: ExitStatus, during: String },
    #[error(
        "it ended the process that tried it, {status}, during: {during}; a library must return from every function"
    )]
    Ended { status: ExitStatus, during: String },
    #[error(
        "it did not return within {limit:?}, during: {during}; a library must neither wait nor loop without end"
    )]
    Hung { limit: Duration, during: String },
    #[error("{0}")]
    Reported(String),
    #[error("no controller program was found to try it, at {0}; build it with cargo build -p controller")]
    NoTrialRunner(String),
    #[error("'{}' cannot try libraries; build it with cargo build -p controller", .0.display())]
    NotATrialRunner(PathBuf),
    #[error("the process that tries it cannot be started: {0}")]
    NoChild(#[source] io::Error),
}

impl RefusalReason {
    pub(super) fn text(what: impl Into<String>, why: &'static str) -> Self {
        Self::Text { what: what.into(), why }
    }

    pub(super) fn too_long(what: &str) -> Self {
        const { assert!(LONGEST_TEXT == 255, "the sentence below says it") };
        Self::text(what, "is longer than 255 bytes, or has no closing zero")
    }
}
