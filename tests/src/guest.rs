//! A virtual machine with real SocketCAN, as `scripts/vcan-vm` makes it, and what came back from it.
//!
//! The script packs the programs, boots the guest, runs a job in it and brings the files back. The guest's time is that of its
//! instructions, so that it never stands still while other tests run. What is tested is that every cycle and every frame is
//! accounted for, never how fast anything was.

use crate::binaries::workspace;
use crate::foreign_python::{light_path, python};
use crate::process::Running;
use crate::records::{count, find, json};
use protocol::can::CanFrame;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::Duration;
use tempfile::TempDir;

/// Limit for one machine, packing and first download of QEMU and kernel included; what else is tested goes first.
const LIMIT: Duration = Duration::from_secs(60 * 60);

/// Lines of what a machine said that a failing test shows: what failed must not drown in them.
const LAST_LINES: usize = 12;

/// The programs may be started a moment before the rig's cycle 0, by this much at most, s.
const BEFORE_CYCLE_ZERO_S: f64 = 1.0;

/// How many machines were started, one at a time: two would stall one another. (Test binaries run one after the other anyway.)
static STARTED: Mutex<u32> = Mutex::new(0);

/// A machine that has run its job and is gone.
#[derive(Debug)]
pub struct Guest {
    folder: TempDir,
    /// What `scripts/vcan-vm` said, the guest's output included.
    pub said: String,
}

impl Guest {
    /// Runs a job in a machine of its own; the job's exit code must be 0.
    #[track_caller]
    pub fn run(arguments: &[&str]) -> Self {
        Self::run_on_two_processors(&[&["--even"], arguments].concat())
    }

    /// The same on two processors, for what one cannot show. Its time goes on while the host does something else.
    #[track_caller]
    pub fn run_on_two_processors(arguments: &[&str]) -> Self {
        // A test that failed leaves no machine behind.
        let mut started = STARTED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut command = Command::new(workspace().join("scripts/vcan-vm"));
        // The guest's programs are built by vcan-vm as it wants them, whatever this test was built with.
        command.env_remove("CARGO_TARGET_DIR").arg("--out").arg(folder.path());
        command.args(["--seconds", "3000"]).args(arguments);
        let ended = Running::start("scripts/vcan-vm", &mut command).wait_within(LIMIT);
        let lines: Vec<&str> = ended.stderr.lines().collect();
        let last = lines[lines.len().saturating_sub(LAST_LINES)..].join("\n");
        let log = workspace().join(format!("target/vm-said-{}-{started}.txt", std::process::id()));
        *started += 1;
        fs::write(&log, &ended.stderr).expect("a log in target");
        eprintln!("the last lines of {}:\n{last}", log.display());
        Self { folder, said: ended.expect_code(0).stderr }
    }

    /// What the job left in `/out`.
    pub fn out(&self) -> PathBuf {
        self.folder.path().join("run")
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn codes(&self) -> BTreeMap<String, i32> {
        let text = fs::read_to_string(self.out().join("codes")).expect("the job's codes");
        text.lines()
            .map(|line| {
                let (name, code) = line.split_once(' ').expect("a name and a code");
                (name.to_owned(), code.parse().expect("a code"))
            })
            .collect()
    }

    /// The lines of one run in a log of candump that holds several: from the rig's cycle 0 of the run in `folder` to that of the
    /// next run of the job, on whatever bus.
    pub fn lines_of_run(&self, log: &str, folder: &Path) -> String {
        let from_s = starts_s(folder)[0];
        let all_s = starts_s(&self.out());
        let until_s = all_s.into_iter().filter(|other_s| *other_s > from_s).fold(f64::INFINITY, f64::min);
        let text = fs::read_to_string(self.file(log)).expect("a log of candump");
        let of_run = text.lines().filter(|line| {
            let stamp = line.strip_prefix('(').and_then(|line| line.split_once(')')).expect("a stamp").0;
            let stamp_s: f64 = stamp.parse().expect("a time");
            (from_s..until_s).contains(&stamp_s)
        });
        of_run.flat_map(|line| [line, "\n"]).collect()
    }
}

/// When the runs in and below `folder` began, in s of the wall clock, with what may have been sent before cycle 0.
fn starts_s(folder: &Path) -> Vec<f64> {
    let mut found = Vec::new();
    let summary = folder.join("summary.json");
    if summary.exists() {
        let zero_s = json(&summary)["bus_log_cycle_zero_s"].as_f64().expect("cycle 0 in s");
        found.push(zero_s - BEFORE_CYCLE_ZERO_S);
    }
    for entry in fs::read_dir(folder).expect("a folder").filter_map(Result::ok) {
        if entry.path().is_dir() {
            found.extend(starts_s(&entry.path()));
        }
    }
    found
}

/// The data frames with 11-bit identifiers in lines of candump -L.
pub fn data_frames(lines: &str) -> Vec<CanFrame> {
    let frame = |line: &str| {
        let (id, hex) = line.rsplit_once(' ')?.1.split_once('#')?;
        let id = u16::from_str_radix(id, 16).ok().filter(|_| id.len() == 3)?;
        let byte = |at: usize| u8::from_str_radix(hex.get(at..at + 2)?, 16).ok();
        let data: Option<Vec<_>> = (0..hex.len()).step_by(2).map(byte).collect();
        Some(CanFrame::new(id, &data?))
    };
    lines.lines().filter_map(frame).collect()
}

/// What an interface counted during a run, from two snapshots of `ip -json -details -statistics link`.
#[derive(Clone, Copy, Debug)]
pub struct InterfaceCounters {
    pub sent: u64,
    /// Frames that the driver took from the card.
    pub received: u64,
    /// Frames, and error frames, that the kernel dropped before the sockets since the interface went down.
    pub dropped: u64,
    /// Times the card reported that its receive FIFO had run over, each for one frame or more.
    pub overruns: u64,
}

impl InterfaceCounters {
    /// What `interface` counted between `links-before.json` and `links-after.json` of `folder`.
    pub fn during(folder: &Path, interface: &str) -> Self {
        let links = ["links-before.json", "links-after.json"].map(|file| json(&folder.join(file)));
        let [before, after] = links.each_ref().map(|links| find(links, "ifname", interface));
        let counted = |pointer: &str| count(after, pointer) - count(before, pointer);
        Self {
            sent: counted("/stats64/tx/packets"),
            received: counted("/stats64/rx/packets"),
            dropped: counted("/stats64/rx/dropped"),
            overruns: counted("/stats64/rx/over_errors"),
        }
    }
}

/// What `compare_candump.py` says of candump's log and a run's folder.
///
/// # Errors
/// Its complaint when they do not agree.
pub fn compare_candump(log: &Path, run: &Path) -> Result<String, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/compare_candump.py");
    let mut command = Command::new(python());
    command
        .env("PYTHONPATH", light_path())
        .args(["-W", "error"])
        .arg(script)
        .arg(workspace().join("protocol/rig.dbc"))
        .arg(log)
        .arg(run);
    let output = command.output().expect("Python starts");
    let [reported, complaint] =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    if output.status.success() { Ok(reported) } else { Err(complaint) }
}
