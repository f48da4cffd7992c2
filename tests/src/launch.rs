//! The command line of a program in a scene.

use crate::binaries::{Build, Program, executable, workspace};
use crate::process::{CompletedProcess, Running};
use crate::scene::Scene;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How time passes, as `--pace` says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// One cycle each millisecond.
    Real,
    /// As fast as the barrier allows.
    Lockstep,
}

/// Runs emulator and controller until both have ended well.
pub fn run_both(emulator: &Launch, controller: &Launch) -> [CompletedProcess; 2] {
    both_good(emulator.start(), controller.start())
}

/// Waits until both have ended well, the emulator first.
#[track_caller]
pub fn both_good(emulator: Running, other: Running) -> [CompletedProcess; 2] {
    [emulator.wait().expect_code(0), other.wait().expect_code(0)]
}

/// A program about to be started; each method changes one thing and hands it back.
#[derive(Clone)]
#[must_use]
pub struct Launch {
    program: Program,
    build: Build,
    bus: String,
    rig: PathBuf,
    experiment: PathBuf,
    out: PathBuf,
    /// `None`: a rehearsal, which knows no bus and no pace.
    pace: Option<Pace>,
    more: Vec<OsString>,
    shell: Option<String>,
    user: Option<u32>,
}

impl Launch {
    pub(crate) fn new(program: Program, scene: &Scene, pace: Option<Pace>) -> Self {
        Self {
            program,
            build: Build::Shipped,
            bus: scene.url(),
            rig: scene.path("rig.toml"),
            experiment: scene.path("experiment.toml"),
            out: scene.path(program.name()),
            pace,
            more: Vec::new(),
            shell: None,
            user: None,
        }
    }

    pub fn bus(mut self, url: impl Into<String>) -> Self {
        self.bus = url.into();
        self
    }

    pub fn rig(mut self, path: &Path) -> Self {
        self.rig = path.into();
        self
    }

    pub fn experiment(mut self, path: &Path) -> Self {
        self.experiment = path.into();
        self
    }

    pub fn out(mut self, folder: &Path) -> Self {
        self.out = folder.into();
        self
    }

    pub fn build(mut self, build: Build) -> Self {
        self.build = build;
        self
    }

    /// More options, separated by spaces.
    pub fn with(mut self, options: &str) -> Self {
        self.more.extend(options.split_whitespace().map(OsString::from));
        self
    }

    /// The shipped programs, for what names them.
    pub fn with_shipped_programs(self) -> Self {
        self.with(&format!("--programs {}", workspace().join("controller/programs").display()))
    }

    /// A line of shell that is run first, in the same process: `ulimit` and the like.
    pub fn after_shell(mut self, line: &str) -> Self {
        self.shell = Some(line.into());
        self
    }

    /// As another user, which only root can ask for.
    pub fn as_user(mut self, user: u32) -> Self {
        self.user = Some(user);
        self
    }

    pub fn start(&self) -> Running {
        let program = executable(self.program, self.build);
        let mut command = match &self.shell {
            Some(line) => {
                let mut shell = Command::new("sh");
                shell.arg("-c").arg(format!("{line} && exec \"$0\" \"$@\"")).arg(program);
                shell
            }
            None => Command::new(program),
        };
        match self.pace {
            None => command.arg("rehearse"),
            Some(Pace::Real) => command.args(["run", "--pace", "real", "--bus"]).arg(&self.bus),
            Some(Pace::Lockstep) => command.args(["run", "--pace", "lockstep", "--bus"]).arg(&self.bus),
        };
        command.arg("--rig").arg(&self.rig).arg("--experiment").arg(&self.experiment);
        command.arg("--out").arg(&self.out).args(&self.more);
        if let Some(user) = self.user {
            command.uid(user).gid(user);
        }
        Running::start(self.program.name(), &mut command)
    }
}
