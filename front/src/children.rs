//! Child processes and signals: a wait ends on either.
//!
//! Ctrl-C reaches the whole process group, a signal to `airbench` only `airbench`, which passes it on as SIGTERM. Children save
//! their files and end by themselves. A child is reaped by its owner alone, so that its process number is not reused before.
//! When this process is killed, the kernel sends the children SIGTERM (`PR_SET_PDEATHSIG`).

#![allow(unsafe_code)] // what a new process does before exec, nothing else

use crate::FrontError;
use protocol::exit::Exit;
use rustix::io::Errno;
use rustix::process::{
    Pid, Signal, WaitId, WaitIdOptions, getpid, getppid, kill_process, kill_process_group,
    set_parent_process_death_signal, waitid,
};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::{flag, iterator::Signals};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Time between SIGTERM and SIGKILL.
const TERMINATION_TIMEOUT: Duration = Duration::from_secs(10);

/// Result of a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// A child ended and was reaped.
    Ended(Pid, ExitStatus),
    /// A signal asked for the end.
    Interrupted,
    TimeUp,
}

enum Message {
    Ended(Pid),
    Signal,
}

struct RunningChild {
    number: Pid,
    child: Child,
    leads_group: bool,
}

/// The children of this process; dropping it ends those that run.
pub(crate) struct Children {
    running: Vec<RunningChild>,
    interrupted: Arc<AtomicBool>,
    messages: Receiver<Message>,
    sender: Sender<Message>,
}

impl Children {
    /// Watches for signals, except those ignored when this process started, as by `nohup`.
    pub(crate) fn watch() -> Result<Self, FrontError> {
        let (sender, messages) = channel();
        let interrupted = Arc::new(AtomicBool::new(false));
        let watched: Vec<_> =
            [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| !is_ignored(*signal)).collect();
        let watching =
            watched.iter().try_for_each(|signal| flag::register(*signal, Arc::clone(&interrupted)).map(drop));
        let signals = watching.and_then(|()| Signals::new(&watched));
        let mut signals =
            signals.map_err(|error| FrontError::Input(format!("cannot watch for Ctrl-C: {error}")))?;
        let signalled = sender.clone();
        std::thread::spawn(move || {
            // When nobody waits for children any longer, as while a run is summed up, a signal ends this process.
            if signals.forever().any(|_| signalled.send(Message::Signal).is_err()) {
                std::process::exit(i32::from(Exit::Interrupted as u8));
            }
        });
        Ok(Self { running: Vec::new(), interrupted, messages, sender })
    }

    /// Whether a signal came.
    pub(crate) fn interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }

    /// Starts a child without standard input.
    pub(crate) fn start(&mut self, command: &mut Command) -> Result<Pid, FrontError> {
        self.spawn(command, false)
    }

    /// Starts a child in a process group of its own, so that its children end with it.
    pub(crate) fn start_group(&mut self, command: &mut Command) -> Result<Pid, FrontError> {
        self.spawn(command, true)
    }

    /// A child that leads a process group takes the group along when it ends.
    fn spawn(&mut self, command: &mut Command, leads_group: bool) -> Result<Pid, FrontError> {
        if leads_group {
            command.process_group(0);
        }
        let program = command.get_program().display().to_string();
        let owner = getpid();
        let end_with_owner = move || {
            set_parent_process_death_signal(Some(Signal::TERM))?;
            // The parent may have ended before.
            if getppid() == Some(owner) { Ok(()) } else { Err(Errno::SRCH.into()) }
        };
        // SAFETY: between fork and exec it makes two system calls, and takes no lock and no memory.
        let child = unsafe { command.stdin(Stdio::null()).pre_exec(end_with_owner) }.spawn();
        let child = child.map_err(|reason| FrontError::Start { program, reason })?;
        let number = Pid::from_child(&child);
        let ended = self.sender.clone();
        std::thread::spawn(move || {
            let look = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
            while matches!(waitid(WaitId::Pid(number), look), Err(Errno::INTR)) {}
            ended.send(Message::Ended(number))
        });
        self.running.push(RunningChild { number, child, leads_group });
        Ok(number)
    }

    pub(crate) fn next(&mut self, deadline: Option<Instant>) -> Event {
        loop {
            let message = match deadline {
                None => self.messages.recv().ok(),
                Some(deadline) => {
                    self.messages.recv_timeout(deadline.saturating_duration_since(Instant::now())).ok()
                }
            };
            match message {
                None => return Event::TimeUp,
                Some(Message::Signal) => return Event::Interrupted,
                Some(Message::Ended(number)) => {
                    let Some(at) = self.running.iter().position(|one| one.number == number) else { continue };
                    let status = self.running.swap_remove(at).child.wait();
                    return Event::Ended(number, status.expect("a child that nobody else reaps"));
                }
            }
        }
    }

    /// Waits until a child has ended; a signal ends all. Returns its exit code, as of [`code`].
    pub(crate) fn finish(&mut self, child: Pid) -> u8 {
        loop {
            match self.next(None) {
                Event::Ended(number, status) if number == child => return code(status),
                Event::Ended(..) | Event::TimeUp => {}
                Event::Interrupted => self.stop_all(),
            }
        }
    }

    /// Starts a child and waits for its end.
    pub(crate) fn call(&mut self, command: &mut Command) -> Result<u8, FrontError> {
        let child = self.start(command)?;
        Ok(self.finish(child))
    }

    /// Number of these that run.
    pub(crate) fn count(&self, of: &[Pid]) -> usize {
        self.running.iter().filter(|one| of.contains(&one.number)).count()
    }

    pub(crate) fn stop(&self, child: Pid) {
        self.running.iter().filter(|one| one.number == child).for_each(|one| one.signal(Signal::TERM));
    }

    pub(crate) fn stop_all(&self) {
        self.running.iter().for_each(|one| one.signal(Signal::TERM));
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.stop_all();
        let deadline = Instant::now() + TERMINATION_TIMEOUT;
        while !self.running.is_empty() {
            if self.next(Some(deadline)) == Event::TimeUp {
                self.running.drain(..).for_each(|mut one| {
                    one.signal(Signal::KILL);
                    let _ = one.child.wait();
                });
            }
        }
    }
}

impl RunningChild {
    fn signal(&self, signal: Signal) {
        // Fails where the child has just ended.
        let _ = if self.leads_group {
            kill_process_group(self.number, signal)
        } else {
            kill_process(self.number, signal)
        };
    }
}

/// The exit code as in a shell: 128 and the number of the signal that ended a process.
pub(crate) fn code(status: ExitStatus) -> u8 {
    let code = status.code().or_else(|| status.signal().map(|signal| 128 + signal));
    code.and_then(|code| code.try_into().ok()).unwrap_or(u8::MAX)
}

/// Whether this process was started with the signal ignored.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(text: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", text]);
        command
    }

    /// Waits, with a limit that protects against hanging.
    fn eventually(mut condition: impl FnMut() -> bool) {
        let limit = Instant::now() + Duration::from_secs(300);
        while !condition() {
            assert!(Instant::now() < limit, "waited in vain");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Whether a process is gone, or only waits for whoever reaps it.
    fn has_ended(number: &str) -> bool {
        std::fs::read_to_string(format!("/proc/{number}/stat")).map_or(true, |stat| stat.contains(") Z"))
    }

    #[test]
    fn exit_codes_are_those_of_a_shell() {
        let mut children = Children::watch().unwrap();
        assert_eq!(children.call(&mut shell("exit 7")).unwrap(), 7);
        assert_eq!(children.call(&mut shell("kill -KILL $$")).unwrap(), 137);
        let message = children.call(&mut Command::new("/nowhere/program")).unwrap_err().to_string();
        assert!(message.contains("cannot start /nowhere/program"), "{message}");
    }

    #[test]
    fn children_that_run_end_with_their_owner_and_take_their_group_along() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("number");
        let mut children = Children::watch().unwrap();
        let leader = format!("sleep 1000 & echo $! >{0}.new; mv {0}.new {0}; wait", file.display());
        let _ = children.start_group(&mut shell(&leader)).unwrap();
        eventually(|| file.exists());
        let number = std::fs::read_to_string(&file).unwrap();
        drop(children);
        eventually(|| has_ended(number.trim()));
    }

    /// The kernel takes the end of the thread that started a child for that of the process.
    #[test]
    fn children_end_when_their_owner_is_gone_without_a_word() {
        let start = || {
            let mut children = Children::watch().unwrap();
            let child = children.start(Command::new("sleep").arg("1000")).unwrap();
            std::mem::forget(children);
            child
        };
        let child = std::thread::spawn(start).join().unwrap();
        eventually(|| has_ended(&child.as_raw_pid().to_string()));
    }
}
