//! Whether the probe of `probe.csv` watched a CPU at a time.

use runlog::probe::Gap;

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
}
