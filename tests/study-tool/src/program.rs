//! One start of the program under study: its command line, its limits, and how it ended.
//!
//! The program runs in a process group of its own in a folder that holds nothing but `rig.toml`, `train.csv` and `test.csv`:
//!
//! ```text
//! PROGRAM close --rig rig.toml --train train.csv [next.csv] --test test.csv --out out [ARGUMENTS] [--without EFFECT ...]
//! ```
//!
//! The last ones stand there when effects are left out of its catalogue ([`super::leave_out`]), `next.csv` when it is given the
//! record of the experiment that it proposed ([`super::resolve`]).
//!
//! When it has ended, or has used up its time, what is left of the group is killed. Memory is the kernel's largest resident set
//! of the program and of the children it waited for; the kernel starts counting at what the study itself had at the time.

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

#[derive(Debug, Clone)]
pub struct Program {
    /// The executable, absolute.
    pub path: PathBuf,
    pub arguments: Vec<String>,
    pub limit: Duration,
    identity: Identity,
}

/// Which program it was: results of different ones are never mixed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    pub name: String,
    /// CRC-32 of its bytes.
    pub crc32: u32,
    pub arguments: Vec<String>,
    /// Whether it had to do without what was hidden; absent in a file when it had not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub leave_out: bool,
}

impl Identity {
    /// Name and checksum in a table's cell.
    pub fn reported(&self) -> String {
        format!("{} {:08x}", self.name, self.crc32)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    Exited(i32),
    Signalled(i32),
    TimedOut,
    NotStarted,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    pub ended: Ended,
    /// Wall time, s.
    pub wall_s: f64,
    pub memory_kib: u64,
}

#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    pub folder: &'a Path,
    pub train: &'a [&'a str],
    /// Arguments behind those of every start.
    pub own: &'a [String],
}

/// The study was asked to stop while the program ran; it was killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

impl Program {
    /// A program that exists.
    pub fn new(path: &Path, arguments: Vec<String>, limit: Duration) -> io::Result<Self> {
        let path = path.canonicalize()?;
        let crc32 = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&fs::read(&path)?);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let identity = Identity { name, crc32, arguments: arguments.clone(), leave_out: false };
        Ok(Program { path, arguments, limit, identity })
    }

    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Runs it once; what it says goes to a file.
    ///
    /// # Errors
    /// [`Interrupted`] when `stop` is set before it has ended.
    pub fn run(&self, start: &Start<'_>, said: File, stop: &AtomicBool) -> Result<Taken, Interrupted> {
        let began = Instant::now();
        let taken = |ended, memory_kib| Taken { ended, wall_s: began.elapsed().as_secs_f64(), memory_kib };
        let started = Command::new(&self.path)
            .args(["close", "--rig", "rig.toml", "--train"])
            .args(start.train)
            .args(["--test", "test.csv", "--out", "out"])
            .args(&self.arguments)
            .args(start.own)
            .current_dir(start.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(said)
            .process_group(0)
            .spawn();
        let Ok(child) = started else { return Ok(taken(Ended::NotStarted, 0)) };
        let group = Pid::from_child(&child);
        let kill = || {
            // Nobody left to kill is what is wanted.
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
                    end = Some(Ok(Ended::TimedOut));
                    kill();
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        };
        kill();
        let _ = waiter.join();
        let memory_kib = used.map_or(0, |used| used.rusage.maxrss >> 10);
        let ended = end.unwrap_or_else(|| Ok(used.map_or(Ended::NotStarted, |used| how(used.status))))?;
        Ok(taken(ended, memory_kib))
    }
}

fn how(status: ExitStatus) -> Ended {
    status.code().map_or_else(|| Ended::Signalled(status.signal().unwrap_or(0)), Ended::Exited)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A shell script as the program under study.
    pub(crate) fn script(folder: &Path, text: &str, arguments: &[&str], limit: Duration) -> Program {
        let (source, path) = (folder.join("program.sh"), folder.join("program"));
        fs::write(&source, format!("#!/bin/sh\n{text}\n")).unwrap();
        // Copied by another process: a child that another thread starts meanwhile would inherit a file that is open for writing
        // here, and the system starts no program that somebody has open for writing (ETXTBSY).
        let copied = Command::new("install").args(["-m", "755"]).args([&source, &path]).status();
        assert!(copied.expect("install of coreutils").success());
        Program::new(&path, arguments.iter().map(|word| (*word).to_owned()).collect(), limit).unwrap()
    }

    fn run(text: &str, limit: Duration, stop: bool) -> Result<Taken, Interrupted> {
        let folder = tempfile::tempdir().unwrap();
        let program = script(folder.path(), text, &[], limit);
        let said = File::create(folder.path().join("said")).unwrap();
        let start = Start { folder: folder.path(), train: &["train.csv"], own: &[] };
        program.run(&start, said, &AtomicBool::new(stop))
    }

    const PATIENCE: Duration = Duration::from_secs(60);

    #[test]
    fn a_program_ends_by_itself_by_a_signal_or_at_its_limit() {
        assert_eq!(run("exit 3", PATIENCE, false).unwrap().ended, Ended::Exited(3));
        assert_eq!(run("kill -SEGV $$", PATIENCE, false).unwrap().ended, Ended::Signalled(11));
        let hung = run("sleep 1000 & sleep 1000", Duration::from_millis(50), false).unwrap();
        assert_eq!(hung.ended, Ended::TimedOut);
        assert!(hung.wall_s < 60.0, "{hung:?}");
    }

    #[test]
    fn a_study_that_is_told_to_stop_kills_its_program() {
        assert_eq!(run("sleep 1000", PATIENCE, true), Err(Interrupted));
    }

    #[test]
    fn memory_is_that_of_the_program() {
        // The shell alone is larger than nothing; what the study had is the least the kernel tells.
        assert!(run("true", PATIENCE, false).unwrap().memory_kib > 100);
    }

    #[test]
    fn another_executable_is_another_program() {
        let folder = tempfile::tempdir().unwrap();
        let one = script(folder.path(), "exit 0", &[], PATIENCE).identity().clone();
        let two = script(folder.path(), "exit 1", &[], PATIENCE).identity().clone();
        assert_ne!(one, two);
    }
}
