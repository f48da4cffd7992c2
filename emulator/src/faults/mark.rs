//! That a fault began or ended, as every log of a run has it.

use super::Fault;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};

pub const COLUMNS: &str = "time_s,number,what,fault,at,numbers,cause";

/// Who asked for a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    Script {
        /// Line, from 1.
        line: u32,
    },
    Console,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    Begins,
    Ends,
    /// Its time passed, and its condition never held.
    NeverBegan,
    /// It could not be put into the run: too many at once, or the bus's host takes no order.
    Refused,
}

/// A fault that began, ended, or did not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Its number in this run; the script's are those of the file, from 1.
    pub number: u16,
    pub what: What,
    pub fault: Fault,
    /// Who asked for it.
    pub cause: Cause,
}

impl What {
    /// As in `faults.csv`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Begins => "begins",
            Self::Ends => "ends",
            Self::NeverBegan => "never-began",
            Self::Refused => "refused",
        }
    }
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
    pub fn write(&self, out: &mut impl Write, cycle: u64) -> io::Result<()> {
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

impl Serialize for Mark {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut mark = serializer.serialize_struct("Mark", 6)?;
        mark.serialize_field("number", &self.number)?;
        mark.serialize_field("what", self.what.name())?;
        mark.serialize_field("fault", self.fault.spec.name)?;
        mark.serialize_field("at", &self.fault.place())?;
        mark.serialize_field("numbers", &self.fault.numbers().collect::<BTreeMap<_, _>>())?;
        mark.serialize_field("cause", &self.cause.to_string())?;
        mark.end()
    }
}
