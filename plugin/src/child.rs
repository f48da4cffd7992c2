//! A child process that tries a library before it is let into this one.
//!
//! ```text
//!   load ──► controller probe-library FILE          writes, each on a line of its own, after [`MARK`]:
//!              loading, entry, create, reset, steps    at STAGE          before each, so that a crash has a place
//!              destroy                                 good | refused WHY    at the end
//!   verdict ◄── exit status and the last lines; after [`TRIAL_LIMIT`] the child is killed
//! ```
//!
//! The child has no real-time priority as long as libraries are loaded before the thread asks for one.

use crate::refusal::RefusalReason;
use crate::{PluginError, probe_with_stages};
use protocol::exit::Exit;
use std::env;
use std::io::{self, PipeReader, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// How long a trial may take.
pub const TRIAL_LIMIT: Duration = Duration::from_secs(5);

/// The name of the hidden command.
const COMMAND: &str = "probe-library";
/// Begins each line of the child that is not the library's.
const MARK: &str = "airbench-trial: ";
/// How often the parent looks whether the child has ended.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// How much of what a library prints is kept, bytes.
const MOST_TEXT: usize = 1 << 16;

/// Runs the trial of a library in a child process.
#[derive(Clone, Debug)]
pub struct TrialRunner {
    /// The controller program, which is started as `controller probe-library FILE`.
    pub program: PathBuf,
    /// How long it may take.
    pub limit: Duration,
}

impl TrialRunner {
    /// This program if it is the controller, else the one in its folder or in the folder around that (as for test programs).
    ///
    /// # Errors
    /// [`RefusalReason::NoTrialRunner`] with the places that were looked at.
    pub fn find() -> Result<Self, RefusalReason> {
        const NAME: &str = "controller";
        let executable = env::current_exe().map_err(RefusalReason::NoChild)?;
        let around = executable.ancestors().skip(1).take(2).map(|folder| folder.join(NAME));
        let places: Vec<_> = if executable.file_name().is_some_and(|name| name == NAME) {
            vec![executable]
        } else {
            around.collect()
        };
        let found = places.iter().find(|place| place.is_file()).cloned();
        let program = found.ok_or_else(|| {
            RefusalReason::NoTrialRunner(
                places.iter().map(|place| place.display().to_string()).collect::<Vec<_>>().join(", "),
            )
        })?;
        Ok(Self { program, limit: TRIAL_LIMIT })
    }

    /// Has a child open, ask and run the library.
    pub(super) fn try_out(&self, library: &Path) -> Result<(), RefusalReason> {
        let (reader, writer) = io::pipe().map_err(RefusalReason::NoChild)?;
        let mut command = Command::new(&self.program);
        command.args([COMMAND, "--"]).arg(library).stdin(Stdio::null());
        command.stdout(writer.try_clone().map_err(RefusalReason::NoChild)?).stderr(writer);
        let started = command.spawn();
        // The command holds the pipe's other end; its text ends only when nobody does.
        drop(command);
        let mut child = started.map_err(RefusalReason::NoChild)?;
        let output = read_aside(reader);
        let status = wait(&mut child, self.limit).map_err(RefusalReason::NoChild)?;
        judge(self, status, &collect(&output))
    }
}

/// The child's side: tries the library in this process, which may not survive it, and writes the verdict to standard output.
pub fn run(library: &Path) -> Exit {
    // A line feed first: the library may have printed half a line.
    let say = |text: &str| {
        let mut out = io::stdout().lock();
        // Nobody reads: then nobody wants to know.
        let _ = writeln!(out, "\n{MARK}{text}").and_then(|()| out.flush());
    };
    match probe_with_stages(library, &mut |stage| say(&format!("at {stage}"))) {
        Ok(_) => {
            say("good");
            Exit::Good
        }
        Err(PluginError { reason, .. }) => {
            say(&format!("refused {}", reason.to_string().replace('\n', " ")));
            Exit::BadInput
        }
    }
}

struct ChildOutput {
    tail: Arc<Mutex<Vec<u8>>>,
    /// Signalled when the pipe has ended.
    ended: Receiver<()>,
}

/// Reads in a thread of its own, so that a library that prints much does not block on a full pipe.
fn read_aside(mut reader: PipeReader) -> ChildOutput {
    let (sender, ended) = mpsc::channel();
    let tail = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&tail);
    thread::spawn(move || {
        let mut piece = [0; 4096];
        while let Ok(length @ 1..) = reader.read(&mut piece) {
            let mut kept = kept.lock().expect("the other side does not panic with it");
            kept.extend_from_slice(&piece[..length]);
            if kept.len() > 2 * MOST_TEXT {
                let too_much = kept.len() - MOST_TEXT;
                kept.drain(..too_much);
            }
        }
        // Nobody waits any more: then nobody wants to know.
        let _ = sender.send(());
    });
    ChildOutput { tail, ended }
}

/// Output until the pipe's end; a grandchild that holds it open is not waited for.
fn collect(output: &ChildOutput) -> String {
    let _ = output.ended.recv_timeout(Duration::from_secs(1));
    String::from_utf8_lossy(&output.tail.lock().expect("the reader does not panic with it")).into_owned()
}

/// The exit status, or None when the child had to be killed.
fn wait(child: &mut Child, limit: Duration) -> io::Result<Option<ExitStatus>> {
    let until = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= until {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(LOOK_EVERY);
    }
}

/// Verdict from the exit status (`None`: killed) and the output of a child.
fn judge(runner: &TrialRunner, status: Option<ExitStatus>, text: &str) -> Result<(), RefusalReason> {
    let (mut stage, mut verdict, mut last) = (None, None, "");
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        match line.strip_prefix(MARK).map(|reported| reported.split_once(' ').unwrap_or((reported, ""))) {
            Some(("at", place)) => stage = Some(place.to_owned()),
            Some(reported) => verdict = Some(reported),
            None => last = line,
        }
    }
    let output = if last.is_empty() { String::new() } else { format!(" (it said: {last})") };
    let during = format!("{}{output}", stage.as_deref().unwrap_or("an unknown step"));
    match (status, verdict) {
        (None, _) => Err(RefusalReason::Hung { limit: runner.limit, during }),
        (Some(status), _) if status.signal().is_some() => Err(RefusalReason::Crashed { status, during }),
        // It reported no stage: another program, or an older one.
        _ if stage.is_none() => Err(RefusalReason::NotATrialRunner(runner.program.clone())),
        (Some(status), Some(("good", _))) if status.success() => Ok(()),
        (Some(_), Some(("refused", why))) => Err(RefusalReason::Reported(why.to_owned())),
        (Some(status), _) => Err(RefusalReason::Ended { status, during }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(status: Option<i32>, text: &str) -> String {
        let runner = TrialRunner { program: "controller".into(), limit: TRIAL_LIMIT };
        let verdict = judge(&runner, status.map(ExitStatus::from_raw), text);
        verdict.map_or_else(|reason| reason.to_string(), |()| "good".to_owned())
    }

    #[test]
    fn a_verdict_needs_the_word_and_the_status() {
        let text = "\nairbench-trial: at loading it\nhello\n\nairbench-trial: good\n";
        assert_eq!(judged(Some(0), text), "good");
        // Its clean-up crashed, or ended the process otherwise, after the verdict.
        assert!(judged(Some(11), text).contains("SIGSEGV"));
        assert!(judged(Some(3 << 8), text).contains("exit status: 3"));
        // exit(0) from inside the library.
        let ended = judged(Some(0), "airbench-trial: at create\nno licence\n");
        assert!(ended.contains("during: create (it said: no licence)"), "{ended}");
    }

    #[test]
    fn a_refusal_comes_in_the_childs_words_and_a_silent_child_is_no_trier() {
        assert_eq!(judged(Some(2 << 8), "airbench-trial: at x\nairbench-trial: refused because"), "because");
        assert!(judged(Some(0), "running 0 tests").contains("cannot try libraries"));
        assert!(judged(None, "airbench-trial: at step 7").contains("during: step 7"));
    }
}
