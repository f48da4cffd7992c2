//! `probe.csv`: moments in which a thread that does nothing but look at the clock did not get to look at it.
//!
//! A gap in which another thread ran on that CPU says little. One in which none ran says that the CPU itself stood still: the
//! host of a virtual machine took it away, or its firmware did. A row without length says that the probe watches that CPU
//! from there on; older tables have none, and do not tell of a CPU without gaps whether it was watched.

/// Columns of the table, in its order.
pub const COLUMNS: [&str; 4] = ["cpu", "from_ns", "to_ns", "another_ran"];

/// A gap on one CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Gap {
    pub cpu: u64,
    /// Last look before, ns of CLOCK_MONOTONIC.
    pub from_ns: u64,
    /// First look after, ns of CLOCK_MONOTONIC.
    pub to_ns: u64,
    /// Whether another thread had the CPU.
    pub another_ran: bool,
}

impl Gap {
    /// Length of what the gap has in common with a stretch of time, ns.
    pub(crate) fn within_ns(&self, from_ns: u64, to_ns: u64) -> u64 {
        self.to_ns.min(to_ns).saturating_sub(self.from_ns.max(from_ns))
    }
}

/// Whether a probe watched a CPU at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProbeCoverage {
    Watched,
    Unwatched,
    /// Its table does not say.
    NotReported,
}

/// Whether a CPU was watched at a time, by the rows of a table.
pub(crate) fn watched(gaps: Option<&[Gap]>, cpu: u64, at_ns: u64) -> ProbeCoverage {
    let Some(gaps) = gaps else { return ProbeCoverage::Unwatched };
    if gaps.iter().any(|gap| gap.cpu == cpu && gap.from_ns <= at_ns) {
        return ProbeCoverage::Watched;
    }
    // A table that names the CPUs names them all.
    if gaps.iter().any(|gap| gap.from_ns == gap.to_ns) {
        ProbeCoverage::Unwatched
    } else {
        ProbeCoverage::NotReported
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub(crate) struct ProbeError {
    line: usize,
    reason: String,
}

/// Reads a table; a last line without its end is left out. Columns may follow that are not known here.
pub(crate) fn read(text: &str) -> Result<Vec<Gap>, ProbeError> {
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
    fn a_cpu_without_gaps_was_watched_when_the_table_says_so() {
        let row = |cpu, from_ns, to_ns| Gap { cpu, from_ns, to_ns, another_ran: false };
        let table = [row(0, 100, 100), row(1, 100, 100), row(0, 150, 250)];
        assert_eq!(watched(Some(&table), 1, 500), ProbeCoverage::Watched);
        assert_eq!(watched(Some(&table), 2, 500), ProbeCoverage::Unwatched);
        assert_eq!(watched(Some(&table), 1, 50), ProbeCoverage::Unwatched, "it began later");
        assert_eq!(watched(Some(&table[2..]), 1, 500), ProbeCoverage::NotReported);
        assert_eq!(watched(None, 1, 500), ProbeCoverage::Unwatched);
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
