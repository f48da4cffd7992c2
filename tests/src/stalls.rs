//! Whether the machine kept a program from running: what the kernel counts of its threads' waiting for a processor.
//!
//! A test in real time may fail since the machine stood still, and may be tried again for that reason alone. A thread reads
//! each 5 ms how long the threads have waited so far (`/proc/PID/task/TID/schedstat`); if it is late itself, that is a stall too.

use crate::process_table::with_command_line;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Programs are looked for so often, in looks.
const FIND_EVERY: u32 = 20;

/// Measures until its result is asked for.
#[must_use]
pub struct StallDetector {
    stop: Arc<AtomicBool>,
    measuring: JoinHandle<Duration>,
}

impl StallDetector {
    /// Of the programs with this word on their command line, which may start later.
    pub fn of(word: &str) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (stopped, word) = (Arc::clone(&stop), word.to_owned());
        Self { stop, measuring: std::thread::spawn(move || measure(&word, &stopped)) }
    }

    /// The longest that a thread waited for a processor in one go, or the measuring thread.
    pub fn longest(self) -> Duration {
        self.stop.store(true, Ordering::Relaxed);
        self.measuring.join().expect("the measuring thread does not panic")
    }
}

fn measure(word: &str, stop: &AtomicBool) -> Duration {
    let mut longest = Duration::ZERO;
    let mut programs = Vec::new();
    let mut waited: BTreeMap<PathBuf, Duration> = BTreeMap::new();
    let mut looks = 0_u32;
    while !stop.load(Ordering::Relaxed) {
        if looks.is_multiple_of(FIND_EVERY) {
            programs = programs_with(word);
        }
        looks += 1;
        let threads = programs.iter().filter_map(|program| fs::read_dir(program.join("task")).ok());
        for thread in threads.flatten().flatten() {
            let Some(now) = waited_so_far(&thread.path()) else { continue };
            if let Some(before) = waited.insert(thread.path(), now) {
                longest = longest.max(now.saturating_sub(before));
            }
        }
        let due = Instant::now() + LOOK_EVERY;
        std::thread::sleep(LOOK_EVERY);
        longest = longest.max(due.elapsed());
    }
    longest
}

/// Folders below `/proc`.
fn programs_with(word: &str) -> Vec<PathBuf> {
    with_command_line(word).map(|(folder, _)| folder).collect()
}

/// How long a thread has waited for a processor since it began: the second number, in ns.
fn waited_so_far(thread: &std::path::Path) -> Option<Duration> {
    let numbers = fs::read_to_string(thread.join("schedstat")).ok()?;
    numbers.split_whitespace().nth(1)?.parse().ok().map(Duration::from_nanos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::{Running, wait_until};
    use std::process::Command;

    #[test]
    fn a_program_is_found_by_its_command_line_and_how_long_it_waited_is_counted() {
        let script = "echo ready >&2; while read line && [ \"$line\" != end ]; do :; done";
        let mut sleeper = Running::start("sh", Command::new("sh").args(["-c", script, "word-of-stalls"]));
        sleeper.wait_for("ready");
        let found = programs_with("word-of-stalls");
        let thread = format!("/proc/{0}/task/{0}", sleeper.number());
        assert!(found.contains(&format!("/proc/{}", sleeper.number()).into()), "{found:?}");
        // At its start it may have found a processor free; whoever is woken waits for its turn.
        wait_until("the program has waited for a processor", || {
            sleeper.type_line("");
            waited_so_far(thread.as_ref()).expect("the kernel counts it") > Duration::ZERO
        });
        sleeper.type_line("end");
        sleeper.wait().expect_code(0);
        assert!(programs_with("word-of-stalls").is_empty());
    }
}
