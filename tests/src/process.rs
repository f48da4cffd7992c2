//! A program while it runs, and once it has ended: exit code and all its output.

use crate::process_table::ProcessStat;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, kill_process_group, pidfd_open};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long anything may take that should take a moment: a protection against hanging, no measure.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// Number of limits that a program may take while it writes something in each of them: it is slow, and does not hang.
const LIMITS_WHILE_IT_WRITES: u32 = 6;

const POLL: Duration = Duration::from_millis(5);

#[must_use]
pub struct Running {
    name: String,
    child: Child,
    input: Option<ChildStdin>,
    output: [CapturedOutput; 2],
}

/// What a program wrote to a stream, captured as it comes.
struct CapturedOutput {
    text: Arc<Mutex<String>>,
    reader: Option<JoinHandle<()>>,
}

#[derive(Debug)]
pub struct CompletedProcess {
    pub name: String,
    /// Exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    pub signal: Option<i32>,
    pub stderr: String,
    pub stdout: String,
}

impl Running {
    pub fn start(name: &str, command: &mut Command) -> Self {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
        let mut child = command.spawn().unwrap_or_else(|error| panic!("{name} does not start: {error}"));
        let stderr = CapturedOutput::capture(child.stderr.take().expect("stderr is piped"));
        let stdout = CapturedOutput::capture(child.stdout.take().expect("stdout is piped"));
        let input = child.stdin.take();
        Self { name: name.into(), child, input, output: [stderr, stdout] }
    }

    /// Sends a signal to the program, which must still be there: else the test is about something else than it says.
    pub fn signal(&self, signal: Signal) {
        if let Err(error) = kill_process(self.pid(), signal) {
            panic!("{} cannot be sent {signal:?}: {error}\n{}", self.name, self.stderr());
        }
    }

    /// Stops the program as a debugger does, and returns once all its threads stand still.
    pub fn stop(&self) {
        self.signal(Signal::STOP);
        let tasks = format!("/proc/{}/task", self.number());
        wait_until("all threads to stand still", || {
            let mut threads = std::fs::read_dir(&tasks).into_iter().flatten().flatten();
            threads.all(|thread| ProcessStat::read(&thread.path()).is_some_and(|stat| stat.state == 'T'))
        });
    }

    pub fn type_line(&mut self, line: &str) {
        let input = self.input.as_mut().expect("the input is open");
        writeln!(input, "{line}").unwrap_or_else(|error| panic!("{} takes no '{line}': {error}", self.name));
    }

    pub fn end_input(&mut self) {
        self.input = None;
    }

    pub fn stderr(&self) -> String {
        self.output[0].so_far()
    }

    pub fn stdout(&self) -> String {
        self.output[1].so_far()
    }

    fn output_bytes(&self) -> usize {
        self.output.iter().map(CapturedOutput::bytes).sum()
    }

    pub fn number(&self) -> u32 {
        self.child.id()
    }

    pub fn wait_for(&mut self, text: &str) {
        self.wait_for_times(text, 1);
    }

    /// Waits until standard error holds `text` so many times.
    pub fn wait_for_times(&mut self, text: &str, times: usize) {
        let until = Instant::now() + PATIENCE;
        while self.stderr().matches(text).count() < times {
            if self.child.try_wait().expect("a child can be waited for").is_some() {
                self.output.iter_mut().for_each(CapturedOutput::finish);
                let output = self.stderr();
                assert!(
                    output.matches(text).count() >= times,
                    "{} ended without '{text}':\n{output}",
                    self.name
                );
                return;
            }
            assert!(Instant::now() < until, "{} does not say '{text}':\n{}", self.name, self.stderr());
            std::thread::sleep(POLL);
        }
    }

    pub fn wait(self) -> CompletedProcess {
        self.wait_within(PATIENCE)
    }

    /// Waits without polling, which would disturb runs in real time beside it. A program hangs that has written nothing in a
    /// whole `limit`, or has not ended after [`LIMITS_WHILE_IT_WRITES`].
    pub(crate) fn wait_within(mut self, limit: Duration) -> CompletedProcess {
        let last = Instant::now() + limit * LIMITS_WHILE_IT_WRITES;
        let (mut until, mut previous_bytes) = (Instant::now() + limit, self.output_bytes());
        // Whoever waited for a word may have met its end, and then there is no process any more.
        while self.child.try_wait().expect("a child can be waited for").is_none() {
            let now = Instant::now();
            if now >= until {
                let bytes = self.output_bytes();
                let hangs = bytes == previous_bytes || now >= last;
                assert!(!hangs, "{} hangs; it said:\n{}\n{}", self.name, self.stdout(), self.stderr());
                (until, previous_bytes) = (now + limit, bytes);
            }
            let left = until.saturating_duration_since(now);
            let left = Timespec::try_from(left).expect("a limit of hours at most");
            let child = pidfd_open(self.pid(), PidfdFlags::empty()).expect("it was not waited for");
            let ended = poll(&mut [PollFd::new(&child, PollFlags::IN)], Some(&left));
            assert!(matches!(ended, Ok(_) | Err(Errno::INTR)), "waiting for {}: {ended:?}", self.name);
        }
        let status = self.child.wait().expect("a child can be waited for");
        self.output.iter_mut().for_each(CapturedOutput::finish);
        CompletedProcess {
            name: self.name.clone(),
            code: status.code(),
            signal: status.signal(),
            stderr: self.output[0].so_far(),
            stdout: self.output[1].so_far(),
        }
    }

    /// Kills it at once, as a crash would, and waits until it is gone.
    pub fn kill(self) -> CompletedProcess {
        self.signal(Signal::KILL);
        self.wait()
    }

    /// Presses Ctrl-C, and waits for the end that follows.
    pub fn interrupt(self) -> CompletedProcess {
        self.signal(Signal::INT);
        self.wait().expect_code(130)
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A group that is gone already is what is wanted.
        let _ = kill_process_group(self.pid(), Signal::KILL);
        let _ = self.child.wait();
    }
}

impl CapturedOutput {
    fn capture(stream: impl Read + Send + 'static) -> Self {
        let text = Arc::new(Mutex::new(String::new()));
        let gathered = Arc::clone(&text);
        let reader = std::thread::spawn(move || {
            for line in BufReader::new(stream).split(b'\n').map_while(Result::ok) {
                let mut text = gathered.lock().expect("only whole lines are added under the lock");
                text.push_str(&String::from_utf8_lossy(&line));
                text.push('\n');
            }
        });
        Self { text, reader: Some(reader) }
    }

    fn so_far(&self) -> String {
        self.text.lock().expect("only whole lines are added under the lock").clone()
    }

    fn bytes(&self) -> usize {
        self.text.lock().expect("only whole lines are added under the lock").len()
    }

    fn finish(&mut self) {
        if let Some(reader) = self.reader.take() {
            reader.join().expect("the reader does not panic");
        }
    }
}

impl CompletedProcess {
    #[track_caller]
    pub fn expect_code(self, code: i32) -> Self {
        let Self { name, stderr, signal, .. } = &self;
        assert_eq!(self.code, Some(code), "exit code of {name} (signal {signal:?}); it said:\n{stderr}");
        self
    }

    /// Checks that standard error contains each of `parts`.
    #[track_caller]
    pub fn expect_stderr(self, parts: &[&str]) -> Self {
        for part in parts {
            assert!(self.stderr.contains(part), "{} does not say '{part}' but:\n{}", self.name, self.stderr);
        }
        self
    }

    #[track_caller]
    pub fn expect_stdout(&self, parts: &[&str]) {
        for part in parts {
            let Self { name, stdout, stderr, .. } = self;
            assert!(stdout.contains(part), "{name} does not print '{part}' but:\n{stdout}\n{stderr}");
        }
    }
}

/// Waits until `condition` holds; `what` names what was waited for.
#[track_caller]
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let until = Instant::now() + PATIENCE;
    while !condition() {
        assert!(Instant::now() < until, "waited in vain for: {what}");
        std::thread::sleep(POLL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_ended_already_is_waited_for_all_the_same() {
        let mut running = Running::start("sh", Command::new("sh").args(["-c", "echo word >&2; exit 3"]));
        running.wait_for_times("word", 1);
        let _ = running.child.wait().expect("it ends");
        assert_eq!(running.wait().expect_code(3).stderr, "word\n");
    }

    #[test]
    fn a_slow_one_that_says_something_is_waited_for_and_a_silent_one_hangs() {
        let start = |script: &str| Running::start("sh", Command::new("sh").args(["-c", script]));
        let limit = Duration::from_secs(2);
        let slow = start("for i in 1 2 3 4 5 6; do echo $i; sleep 0.5; done").wait_within(limit);
        assert_eq!(slow.expect_code(0).stdout.lines().count(), 6);
        let silent = || start("echo word; exec sleep 1000").wait_within(Duration::from_millis(300));
        let panic = std::panic::catch_unwind(silent).expect_err("it hangs");
        let message = panic.downcast_ref::<String>().expect("a message");
        assert!(message.contains("sh hangs"), "{message}");
    }
}
