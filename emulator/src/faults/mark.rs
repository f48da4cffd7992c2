//! The record of the begin or end of a fault, for every log of a run.

use super::Fault;
use runlog::event::{FaultChange, FaultMark};
use std::fmt;
use std::io::{self, Write};

pub(crate) const COLUMNS: &str = "time_s,number,what,fault,at,numbers,cause";

/// Origin of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cause {
    Script {
        /// Line, from 1.
        line: u32,
    },
    Console,
}

/// A fault that began, ended, or could not; serialised as the [`FaultMark`] that others read.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(into = "FaultMark")]
pub(crate) struct Mark {
    /// Its number in this run; the script's are those of the file, from 1.
    pub number: u16,
    pub what: FaultChange,
    pub fault: Fault,
    /// Who asked for it.
    pub cause: Cause,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Script { line } => write!(f, "script line {line}"),
            Self::Console => f.write_str("console"),
        }
    }
}

impl Mark {
    /// Its numbers as `key=value`, separated.
    fn numbers(&self, separator: &str) -> String {
        let pairs: Vec<_> = self.fault.numbers().map(|(key, value)| format!("{key}={value}")).collect();
        pairs.join(separator)
    }

    /// Writes a row of `faults.csv`.
    pub(crate) fn write(&self, out: &mut impl Write, cycle: u64) -> io::Result<()> {
        let Self { number, what, fault, cause } = self;
        let (name, at, numbers) = (fault.spec.name, fault.place(), self.numbers(";"));
        let (s, ms) = (cycle / 1000, cycle % 1000);
        writeln!(out, "{s}.{ms:03},{number},{},{name},{at},{numbers},{cause}", what.name())
    }
}

impl fmt::Display for Mark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { number, what, fault, cause } = self;
        write!(
            f,
            "fault {number} {}: {} at {}",
            what.name().replace('-', " "),
            fault.spec.name,
            fault.place()
        )?;
        let numbers = self.numbers(", ");
        if numbers.is_empty() { write!(f, " ({cause})") } else { write!(f, ", {numbers} ({cause})") }
    }
}

impl From<Mark> for FaultMark {
    fn from(Mark { number, what, fault, cause }: Mark) -> Self {
        Self {
            number,
            what,
            fault: fault.spec.name.to_owned(),
            at: fault.place(),
            numbers: fault.numbers().map(|(key, value)| (key.to_owned(), value)).collect(),
            cause: cause.to_string(),
        }
    }
}
