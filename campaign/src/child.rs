//! A process of a run: waited for, and terminated when the campaign ends or the process exceeds its time limit.

use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Period of the polls for the end of a process.
const POLL_PERIOD: Duration = Duration::from_millis(2);
/// Time between SIGTERM and SIGKILL, in which a process saves its files.
const TERMINATION_TIMEOUT: Duration = Duration::from_secs(5);

/// A child process in a process group of its own; dropping it terminates the group.
#[derive(Debug)]
pub(crate) struct ChildProcess {
    pub child: Child,
}

/// Why a wait ended without an exit status.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WaitError {
    #[error("stopped")]
    Stopped,
    #[error("took longer than {0} s, and was ended")]
    TooLong(f64),
    #[error(transparent)]
    System(#[from] io::Error),
}

impl ChildProcess {
    /// Starts a process in a group of its own, which a Ctrl-C at the terminal does not reach.
    pub(crate) fn start(command: &mut Command) -> io::Result<Self> {
        command.process_group(0).spawn().map(|child| Self { child })
    }

    /// Waits for the exit status.
    ///
    /// # Errors
    /// [`WaitError`] at the time limit, or when the campaign stops; the process still runs then.
    pub(crate) fn wait(&mut self, limit: TimeLimit<'_>) -> Result<ExitStatus, WaitError> {
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            if limit.stop.load(Ordering::Relaxed) {
                return Err(WaitError::Stopped);
            }
            if limit.began.elapsed().as_secs_f64() > limit.longest_s {
                return Err(WaitError::TooLong(limit.longest_s));
            }
            std::thread::sleep(POLL_PERIOD);
        }
    }
}

impl Drop for ChildProcess {
    /// Sends SIGTERM first: the process may have to end others that it started.
    fn drop(&mut self) {
        let process = Pid::from_child(&self.child);
        if matches!(self.child.try_wait(), Ok(None)) {
            // Fails where the process has ended meanwhile.
            let _ = kill_process(process, Signal::TERM);
            let asked = Instant::now();
            while matches!(self.child.try_wait(), Ok(None)) && asked.elapsed() < TERMINATION_TIMEOUT {
                std::thread::sleep(POLL_PERIOD);
            }
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
        let _ = kill_process_group(process, Signal::KILL);
    }
}

/// How long a run may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TimeLimit<'a> {
    pub began: Instant,
    /// Longest time, s of the wall clock.
    pub longest_s: f64,
    /// Set from outside to end the run at once.
    pub stop: &'a AtomicBool,
}

impl<'a> TimeLimit<'a> {
    /// A limit of `longest_s` that begins now.
    pub(crate) fn of(longest_s: f64, stop: &'a AtomicBool) -> Self {
        Self { began: Instant::now(), longest_s, stop }
    }
}
