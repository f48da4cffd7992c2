//! A process that a run is made of: waited for, and ended when the campaign is or when it takes too long.

use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two looks at whether a process has ended.
const LOOK: Duration = Duration::from_millis(2);
/// How long a process that was asked to end may take to save what it has.
const PATIENCE: Duration = Duration::from_secs(5);

/// A process that ends with its owner, and with it all that it started.
#[derive(Debug)]
pub(crate) struct Own {
    child: Child,
}

/// Why a process did not come to its own end.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Cut {
    #[error("stopped")]
    Stopped,
    #[error("took longer than {0} s, and was ended")]
    TooLong(f64),
    #[error(transparent)]
    System(#[from] io::Error),
}

impl Own {
    /// Starts it as a group of its own, which a Ctrl-C at the terminal does not reach: what that does to a run is for its owner
    /// to say.
    pub(crate) fn start(command: &mut Command) -> io::Result<Self> {
        command.process_group(0).spawn().map(|child| Self { child })
    }

    pub(crate) fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// Waits for its end, until `deadline` at most.
    ///
    /// # Errors
    /// [`Cut`] when it was ended instead.
    pub(crate) fn wait(&mut self, limit: Limit<'_>) -> Result<ExitStatus, Cut> {
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            if limit.stop.load(Ordering::Relaxed) {
                return Err(Cut::Stopped);
            }
            if limit.began.elapsed().as_secs_f64() > limit.longest_s {
                return Err(Cut::TooLong(limit.longest_s));
            }
            std::thread::sleep(LOOK);
        }
    }
}

impl Drop for Own {
    /// Asks it to end first: it may have started others that it has to end itself.
    fn drop(&mut self) {
        let process = Pid::from_child(&self.child);
        if matches!(self.child.try_wait(), Ok(None)) {
            // What has ended meanwhile needs no signal.
            let _ = kill_process(process, Signal::TERM);
            let asked = Instant::now();
            while matches!(self.child.try_wait(), Ok(None)) && asked.elapsed() < PATIENCE {
                std::thread::sleep(LOOK);
            }
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
        let _ = kill_process_group(process, Signal::KILL);
    }
}

/// How long a run may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit<'a> {
    pub began: Instant,
    /// Longest time, s of the wall clock.
    pub longest_s: f64,
    /// Set from outside to end the run at once.
    pub stop: &'a AtomicBool,
}

impl<'a> Limit<'a> {
    /// A limit of `longest_s` that begins now.
    #[must_use]
    pub(crate) fn of(longest_s: f64, stop: &'a AtomicBool) -> Self {
        Self { began: Instant::now(), longest_s, stop }
    }
}
