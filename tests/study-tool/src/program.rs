//! One run of the program under study: its command line, its limits, and how it ended.
//!
//! The program runs in a new process group, in a folder that contains only `rig.toml`, `train.csv` and `test.csv`:
//!
//! ```text
//! PROGRAM close --rig rig.toml --train train.csv [next.csv] --test test.csv --out out [ARGUMENTS] [--without EFFECT ...]
//! ```
//!
//! `--without` is given when effects are left out of its catalogue ([`super::leave_out`]), `next.csv` when it gets the record
//! of the experiment that it proposed ([`super::resolve`]).
//!
//! When the program has ended or its time is over, the rest of the group is killed. Memory is the kernel's largest resident set
//! of the program and of the children it waited for; it is at least the resident set of the study at the time of the start.

use crc::{CRC_32_ISO_HDLC, Crc};
use rustix::process::{Pid, Signal, kill_process_group};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};
use wait4::Wait4;

const POLL: Duration = Duration::from_millis(20);

/// The program under study, with its arguments and its time limit.
#[derive(Debug, Clone)]
pub struct Program {
    /// The executable, absolute.
    pub(crate) path: PathBuf,
    pub(crate) arguments: Vec<String>,
    pub(crate) limit: Duration,
    pub(crate) identity: Identity,
}

/// Identity of a program: results of different ones are never mixed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    pub(crate) name: String,
    /// CRC-32 of its bytes.
    pub(crate) crc32: u32,
    pub(crate) arguments: Vec<String>,
    /// Whether the hidden effects were left out of its catalogue; absent in a file when not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) leave_out: bool,
}

impl Identity {
    /// Name and checksum for the cell of a table.
    pub(crate) fn reported(&self) -> String {
        format!("{} {:08x}", self.name, self.crc32)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ProgramEnd {
    Exited(i32),
    Signalled(i32),
    TimedOut,
    NotStarted,
}

/// How a run of the program ended, and what it used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Execution {
    pub(crate) ended: ProgramEnd,
    /// Wall time, s.
    pub(crate) wall_s: f64,
    pub(crate) memory_kib: u64,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct ProgramInputs<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) train: &'a [&'a str],
    /// Arguments after those of every run.
    pub(crate) arguments: &'a [String],
}

/// The study was interrupted while the program ran; the program was killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Interrupted;

impl Program {
    /// Identifies an executable by the checksum of its bytes; `limit` is the longest wall time of a run.
    pub fn new(path: &Path, arguments: Vec<String>, limit: Duration) -> io::Result<Self> {
        let path = path.canonicalize()?;
        let crc32 = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&fs::read(&path)?);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let identity = Identity { name, crc32, arguments: arguments.clone(), leave_out: false };
        Ok(Program { path, arguments, limit, identity })
    }

    /// Runs the program once; its standard error goes to a file.
    ///
    /// # Errors
    /// [`Interrupted`] when `stop` is set before it has ended.
    pub(crate) fn run(
        &self,
        start: &ProgramInputs<'_>,
        said: File,
        stop: &AtomicBool,
    ) -> Result<Execution, Interrupted> {
        let began = Instant::now();
        let taken =
            |ended, memory_kib| Execution { ended, wall_s: began.elapsed().as_secs_f64(), memory_kib };
        let started = Command::new(&self.path)
            .args(["close", "--rig", "rig.toml", "--train"])
            .args(start.train)
            .args(["--test", "test.csv", "--out", "out"])
            .args(&self.arguments)
            .args(start.arguments)
            .current_dir(start.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(said)
            .process_group(0)
            .spawn();
        let Ok(child) = started else { return Ok(taken(ProgramEnd::NotStarted, 0)) };
        let group = Pid::from_child(&child);
        let kill = || {
            // The group may be gone already.
            let _ = kill_process_group(group, Signal::KILL);
        };
        let (tell, reported) = mpsc::channel();
        let waiter = std::thread::spawn(move || tell.send(child.wait4()));
        let mut end = None;
        let used = loop {
            match reported.recv_timeout(POLL) {
                Ok(used) => break used.ok(),
                Err(RecvTimeoutError::Disconnected) => break None,
                Err(RecvTimeoutError::Timeout) if stop.load(Ordering::Relaxed) => {
                    end = Some(Err(Interrupted));
                    kill();
                }
                Err(RecvTimeoutError::Timeout) if began.elapsed() > self.limit && end.is_none() => {
                    end = Some(Ok(ProgramEnd::TimedOut));
                    kill();
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        };
        kill();
        let _ = waiter.join();
        let memory_kib = used.map_or(0, |used| used.rusage.maxrss >> 10);
        let ended_by_itself = |status: ExitStatus| {
            status.code().map_or(ProgramEnd::Signalled(status.signal().unwrap_or(0)), ProgramEnd::Exited)
        };
        let ended =
            end.unwrap_or(Ok(used.map_or(ProgramEnd::NotStarted, |used| ended_by_itself(used.status))))?;
        Ok(taken(ended, memory_kib))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A shell script as the program under study.
    pub(crate) fn script(folder: &Path, text: &str, arguments: &[&str], limit: Duration) -> Program {
        let (source, path) = (folder.join("program.sh"), folder.join("program"));
        fs::write(&source, format!("#!/bin/sh\n{text}\n")).unwrap();
        // Copied by another process: a child started by another thread meanwhile would inherit a file open for writing, and the
        // kernel executes no program that is open for writing (ETXTBSY).
        let copied = Command::new("install").args(["-m", "755"]).args([&source, &path]).status();
        assert!(copied.expect("install of coreutils").success());
        Program::new(&path, arguments.iter().map(|word| (*word).to_owned()).collect(), limit).unwrap()
    }

    fn run(text: &str, limit: Duration, stop: bool) -> Result<Execution, Interrupted> {
        let folder = tempfile::tempdir().unwrap();
        let program = script(folder.path(), text, &[], limit);
        let said = File::create(folder.path().join("said")).unwrap();
        let start = ProgramInputs { folder: folder.path(), train: &["train.csv"], arguments: &[] };
        program.run(&start, said, &AtomicBool::new(stop))
    }

    const PATIENCE: Duration = Duration::from_secs(60);

    #[test]
    fn a_program_ends_by_itself_by_a_signal_or_at_its_limit() {
        assert_eq!(run("exit 3", PATIENCE, false).unwrap().ended, ProgramEnd::Exited(3));
        assert_eq!(run("kill -SEGV $$", PATIENCE, false).unwrap().ended, ProgramEnd::Signalled(11));
        let hung = run("sleep 1000 & sleep 1000", Duration::from_millis(50), false).unwrap();
        assert_eq!(hung.ended, ProgramEnd::TimedOut);
        assert!(hung.wall_s < 60.0, "{hung:?}");
    }

    #[test]
    fn an_interrupted_study_kills_its_program() {
        assert_eq!(run("sleep 1000", PATIENCE, true), Err(Interrupted));
    }

    #[test]
    fn memory_is_that_of_the_program() {
        // The shell needs some memory; the resident set of the study is the lower bound that the kernel reports.
        assert!(run("true", PATIENCE, false).unwrap().memory_kib > 100);
    }

    #[test]
    fn another_executable_is_another_program() {
        let folder = tempfile::tempdir().unwrap();
        let one = script(folder.path(), "exit 0", &[], PATIENCE).identity;
        assert_ne!(one, script(folder.path(), "exit 1", &[], PATIENCE).identity);
    }
}
