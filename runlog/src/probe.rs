//! `probe.csv`: moments in which a thread that does nothing but look at the clock did not get to look at it.
//!
//! ```text
//!   cpu,from_ns,to_ns,another_ran
//!   0,81000000,81000000,0            the probe watches CPU 0 from here on
//!   0,81250000,81900000,1            for 0.65 ms another thread had it
//! ```
//! A gap in which another thread ran on that CPU says little. One in which none ran says that the CPU itself stood still: the
//! host of a virtual machine took it away, or its firmware did. A row without length says that the probe watches that CPU
//! from there on; older tables have none: whether a CPU without gaps was watched is unknown there.

use std::io::{self, Write};

/// Columns of the table, in its order.
const COLUMNS: [&str; 4] = ["cpu", "from_ns", "to_ns", "another_ran"];

/// A gap on one CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Number of the CPU, as the kernel counts.
    pub cpu: u64,
    /// Last look before, ns of CLOCK_MONOTONIC.
    pub from_ns: u64,
    /// First look after, ns of CLOCK_MONOTONIC.
    pub to_ns: u64,
    /// Whether another thread had the CPU, or the probe was stopped.
    pub another_ran: bool,
}

impl Gap {
    /// The row without length: the probe watches this CPU from now on.
    #[must_use]
    pub fn beginning(cpu: u64, now_ns: u64) -> Self {
        Self { cpu, from_ns: now_ns, to_ns: now_ns, another_ran: false }
    }

    /// Length of what the gap has in common with a stretch of time, ns.
    #[must_use]
    pub fn within_ns(&self, from_ns: u64, to_ns: u64) -> u64 {
        self.to_ns.min(to_ns).saturating_sub(self.from_ns.max(from_ns))
    }
}

/// Writes the head line.
///
/// # Errors
/// What `out` says.
pub fn write_head(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", COLUMNS.join(","))
}

/// Writes a row.
///
/// # Errors
/// What `out` says.
pub fn write_row(out: &mut impl Write, gap: &Gap) -> io::Result<()> {
    let Gap { cpu, from_ns, to_ns, another_ran } = gap;
    writeln!(out, "{cpu},{from_ns},{to_ns},{}", u8::from(*another_ran))
}

/// What a table has wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct ProbeError {
    /// Line in the file, from 1.
    line: usize,
    /// What is wrong there.
    reason: String,
}

/// Reads a table; a last line without its end is left out. Columns may follow that are not known here.
///
/// # Errors
/// [`ProbeError`] with the line.
pub fn read(text: &str) -> Result<Vec<Gap>, ProbeError> {
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut lines = (1..).zip(whole.lines());
    let head: Vec<_> = lines.next().map_or("", |(_, head)| head).split(',').collect();
    if !head.starts_with(&COLUMNS) {
        return Err(ProbeError {
            line: 1,
            reason: format!("columns do not begin with {}", COLUMNS.join(",")),
        });
    }
    let row = |(line, text): (usize, &str)| {
        let failed = |reason: String| ProbeError { line, reason };
        let mut cells = text.split(',');
        let mut number = |name: &str| {
            let cell = cells.next().ok_or_else(|| failed(format!("no {name}")))?;
            cell.parse::<u64>().map_err(|error| failed(format!("{name}: {error}")))
        };
        let [cpu, from_ns, to_ns, another] =
            [number("cpu")?, number("from_ns")?, number("to_ns")?, number("another_ran")?];
        Ok(Gap { cpu, from_ns, to_ns, another_ran: another != 0 })
    };
    lines.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_reads_what_was_written() {
        let gaps = [Gap::beginning(1, 100), Gap { cpu: 0, from_ns: 300, to_ns: 400, another_ran: true }];
        let mut text = Vec::new();
        write_head(&mut text).unwrap();
        gaps.iter().for_each(|gap| write_row(&mut text, gap).unwrap());
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text, "cpu,from_ns,to_ns,another_ran\n1,100,100,0\n0,300,400,1\n");
        assert_eq!(read(&text).unwrap(), gaps);
    }

    #[test]
    fn gaps_are_read_and_what_is_wrong_is_named_with_its_line() {
        let gaps = read("cpu,from_ns,to_ns,another_ran\n1,100,250,0\n0,300,400,1\n1,5").unwrap();
        assert_eq!(gaps[0], Gap { cpu: 1, from_ns: 100, to_ns: 250, another_ran: false });
        assert_eq!(gaps.len(), 2);
        assert_eq!([gaps[0].within_ns(200, 900), gaps[0].within_ns(300, 900)], [50, 0]);
        assert_eq!(read("a\n").unwrap_err().line, 1);
        assert!(
            read("cpu,from_ns,to_ns,another_ran\n1,x,3,0\n")
                .unwrap_err()
                .to_string()
                .starts_with("line 2: from_ns")
        );
    }
}
