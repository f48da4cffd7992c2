//! Programs that a soak starts: in process groups of their own, so that Ctrl-C at the terminal reaches the soak alone, and with
//! a parent-death signal, so that none survives it.

use super::cli::ChildArguments;
use rustix::process::{
    Pid, Signal, getppid, kill_process, kill_process_group, set_parent_process_death_signal,
};
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

const POLL: Duration = Duration::from_millis(20);

/// A program that a soak started.
pub(crate) struct RunningProgram {
    pub name: String,
    child: Child,
    ended: Option<ExitStatus>,
}

impl RunningProgram {
    /// Starts a program with its output in a file.
    pub(crate) fn start(name: &str, program: &Path, arguments: &[OsString], said: &Path) -> io::Result<Self> {
        let file = File::create(said)?;
        // Through this program, which sets the parent-death signal and executes the other: the same process.
        let child = Command::new(std::env::current_exe()?)
            .arg("soak-child")
            .arg(std::process::id().to_string())
            .arg("--")
            .arg(program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(file.try_clone()?)
            .stderr(file)
            .process_group(0)
            .spawn()?;
        Ok(Self { name: name.into(), child, ended: None })
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn is_running(&mut self) -> bool {
        if self.ended.is_none() {
            self.ended = self.child.try_wait().ok().flatten();
        }
        self.ended.is_none()
    }

    pub(crate) fn interrupt(&mut self) {
        self.signal(Signal::INT);
    }

    fn signal(&mut self, signal: Signal) {
        // Fails where the process has ended.
        if self.is_running()
            && let Some(pid) = Pid::from_raw(self.pid() as i32)
        {
            let _ = kill_process(pid, signal);
        }
    }

    /// Waits for its end, at most until `until`; true when it has ended.
    pub(crate) fn wait_until(&mut self, until: Instant) -> bool {
        while self.is_running() {
            if Instant::now() >= until {
                return false;
            }
            std::thread::sleep(POLL);
        }
        true
    }

    /// Ensures its end: waits for `patience`, then kills its process group.
    pub(crate) fn end(&mut self, patience: Duration) -> Option<ExitStatus> {
        if !self.wait_until(Instant::now() + patience) {
            self.signal(Signal::KILL);
            self.wait_until(Instant::now() + patience);
        }
        if let Some(group) = Pid::from_raw(self.pid() as i32) {
            // Usually the group is empty already.
            let _ = kill_process_group(group, Signal::KILL);
        }
        self.ended
    }
}

impl Drop for RunningProgram {
    fn drop(&mut self) {
        self.interrupt();
        self.end(Duration::from_secs(2));
    }
}

pub(crate) fn end_in_words(status: Option<ExitStatus>) -> String {
    match status.map(|status| (status.code(), status.signal())) {
        Some((Some(code), _)) => format!("exit code {code}"),
        Some((_, Some(9))) => "killed by SIGKILL".into(),
        Some((_, Some(signal))) => format!("ended by signal {signal}"),
        _ => "could not be waited for".into(),
    }
}

/// Executes the program, after requesting SIGTERM at the end of `parent`. Returns only on failure.
pub(crate) fn become_child(arguments: &ChildArguments) -> io::Error {
    if let Err(error) = set_parent_process_death_signal(Some(Signal::TERM)) {
        return error.into();
    }
    // The parent may have ended before the request.
    if getppid().map(Pid::as_raw_pid) != Some(arguments.parent) {
        return io::Error::other("the soak that started this has gone");
    }
    Command::new(&arguments.command[0]).args(&arguments.command[1..]).exec()
}
