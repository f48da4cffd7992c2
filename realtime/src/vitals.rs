//! What the kernel counted of the real-time thread since it was last asked: page faults, switches, time spent waiting for a CPU.
//!
//! A late cycle alone does not say why it was late. Counts of the same cycle do: page faults, another thread that took the
//! CPU, a process that was stopped and continued, or none of it, which leaves the machine itself.
//!
//! | count | from | what it costs |
//! |---|---|---|
//! | page faults, switches | `getrusage(RUSAGE_THREAD)` | one system call |
//! | run delay | `/proc/thread-self/schedstat`, opened once, second number | one `pread` |
//! | CPU | `getcpu`, answered without the kernel | 20 ns |
//! | continued | [`Continued`], an atomic that a signal handler raises | a load |
//!
//! A [`VitalsReader::read`] took 1.1 us (p50, `cargo run --release -p realtime --example vitals`, November 2026), and allocates
//! nothing: the report's buffer is on the stack.
//!
//! # Source
//! `man 2 getrusage`; in the kernel's tree `Documentation/scheduler/sched-stats.rst`, `/proc/<pid>/schedstat`: time on the CPU,
//! time waiting on a run queue, time slices, the first two in ns.

use std::fs::File;
use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

use crate::signals::Continued;

/// Counts of a thread since the last reading, of a loop's thread during one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VitalCounts {
    /// Page faults served without the disk.
    pub minor_faults: u64,
    /// Page faults that had to read from it.
    pub major_faults: u64,
    /// Times the thread gave the CPU away to wait; one a cycle is usual.
    pub voluntary_switches: u64,
    /// Times another thread took the CPU from it.
    pub involuntary_switches: u64,
    /// Time that the thread was ready to run and another one had the CPU, ns; 0 where the kernel does not report it.
    pub run_delay_ns: u64,
    /// Times the process was continued after a stop (SIGCONT). The handler may run on another thread, so that the count may
    /// come a cycle later than the stall.
    pub continued: u64,
    /// CPU on which the thread was when it was read.
    pub cpu: u64,
}

/// Sums over a run, as `summary.json` shows them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct VitalTotals {
    /// Page faults served without the disk.
    pub minor_faults: u64,
    /// Page faults that had to read from it.
    pub major_faults: u64,
    /// Times another thread took the CPU.
    pub involuntary_switches: u64,
    /// Time that the thread was ready to run and another one had the CPU, ns.
    pub run_delay_ns: u64,
    /// Times the process was continued after a stop.
    pub continued: u64,
}

impl VitalTotals {
    /// Adds a cycle. Leave out the first second, in which memory is touched for the first time.
    pub fn add(&mut self, counts: &VitalCounts) {
        self.minor_faults += counts.minor_faults;
        self.major_faults += counts.major_faults;
        self.involuntary_switches += counts.involuntary_switches;
        self.run_delay_ns += counts.run_delay_ns;
        self.continued += counts.continued;
    }
}

/// Reads the counts of the thread that made it. Not to be moved to another thread, which the compiler sees to.
#[derive(Debug)]
pub struct VitalsReader {
    schedstat: Option<File>,
    continued: Continued,
    /// Absolute counts at the last reading.
    last: VitalCounts,
    not_send: PhantomData<*const ()>,
}

impl VitalsReader {
    /// Opens what is to be read, for the calling thread; its counts so far are left out. Where the kernel has no schedstat, the
    /// run delay stays 0.
    #[must_use]
    pub fn new(continued: Continued) -> Self {
        let schedstat = File::open("/proc/thread-self/schedstat").ok();
        let mut reader = Self { schedstat, continued, last: VitalCounts::default(), not_send: PhantomData };
        reader.last = reader.absolute();
        reader
    }

    /// Counts since the last reading, or since [`VitalsReader::new`].
    pub fn read(&mut self) -> VitalCounts {
        let now = self.absolute();
        let before = std::mem::replace(&mut self.last, now);
        VitalCounts {
            minor_faults: now.minor_faults - before.minor_faults,
            major_faults: now.major_faults - before.major_faults,
            voluntary_switches: now.voluntary_switches - before.voluntary_switches,
            involuntary_switches: now.involuntary_switches - before.involuntary_switches,
            // A pread that fails for once would read 0.
            run_delay_ns: now.run_delay_ns.saturating_sub(before.run_delay_ns),
            continued: now.continued - before.continued,
            cpu: now.cpu,
        }
    }

    fn absolute(&self) -> VitalCounts {
        let usage = thread_usage();
        VitalCounts {
            minor_faults: usage.ru_minflt as u64,
            major_faults: usage.ru_majflt as u64,
            voluntary_switches: usage.ru_nvcsw as u64,
            involuntary_switches: usage.ru_nivcsw as u64,
            run_delay_ns: self.schedstat.as_ref().and_then(run_delay_ns).unwrap_or(self.last.run_delay_ns),
            continued: self.continued.count(),
            cpu: rustix::thread::sched_getcpu() as u64,
        }
    }
}

/// Second of the three numbers, read from the beginning again each time.
fn run_delay_ns(schedstat: &File) -> Option<u64> {
    // Three numbers of 20 digits at most.
    let mut text = [0; 64];
    let length = rustix::io::pread(schedstat, &mut text, 0).ok()?;
    let text = std::str::from_utf8(&text[..length]).ok()?;
    text.split_ascii_whitespace().nth(1)?.parse().ok()
}

#[allow(unsafe_code, reason = "rustix has no getrusage")]
fn thread_usage() -> libc::rusage {
    // SAFETY: a struct of whole numbers, for which all bits 0 is a value.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: writes within `usage`, which lives through the call. With a known `who` and a good pointer it cannot fail, and
    // if it did, the zeroes stay.
    unsafe { libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage) };
    usage
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn pages_touched_for_the_first_time_and_waits_are_counted_in_their_reading_alone() {
        const PAGES: usize = 512;
        let mut vitals = VitalsReader::new(Continued::default());
        // An optimising compiler would leave out what nobody reads.
        let fresh = std::hint::black_box(vec![1_u8; PAGES * 4096]);
        std::thread::sleep(Duration::from_millis(2));
        let counts = vitals.read();
        // A kernel with large pages may serve them all with a few faults.
        assert!(counts.minor_faults > 0, "{counts:?} for {} bytes", fresh.len());
        assert!(counts.voluntary_switches > 0, "{counts:?} after a sleep");
        let quiet = vitals.read();
        assert_eq!((quiet.minor_faults, quiet.voluntary_switches, quiet.continued), (0, 0, 0));
    }

    #[test]
    fn totals_are_sums() {
        let counts = VitalCounts { minor_faults: 1, run_delay_ns: 5, continued: 2, ..VitalCounts::default() };
        let mut totals = VitalTotals::default();
        (0..3).for_each(|_| totals.add(&counts));
        let expected =
            VitalTotals { minor_faults: 3, run_delay_ns: 15, continued: 6, ..VitalTotals::default() };
        assert_eq!(totals, expected);
    }

    #[test]
    fn schedstat_is_read_where_the_kernel_has_it() {
        let Ok(file) = File::open("/proc/thread-self/schedstat") else { return };
        assert!(run_delay_ns(&file).is_some());
    }
}
