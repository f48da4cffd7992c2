//! Emulator and controller as two processes on one bus, with their output in one file.

use crate::children::{Children, Event, code};
use crate::{FrontError, logs, make_folder};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Time for the other to notice a failure by itself.
const GRACE: Duration = Duration::from_secs(1);

/// Emulator and controller before their start.
pub(crate) struct ProgramPair {
    pub(crate) emulator: Command,
    pub(crate) controller: Command,
    run: PathBuf,
}

/// Why there is no run.
pub(crate) enum PairError {
    /// One of them ended with this code; the file has their output.
    Failed { code: u8, console: PathBuf },
    /// They could not be started.
    Other(FrontError),
}

impl ProgramPair {
    /// Both programs, each with its rig file, for an experiment into a folder.
    pub(crate) fn new(
        programs: [&Path; 2],
        rigs: [&Path; 2],
        experiment: &Path,
        run: &Path,
        bus: &str,
    ) -> Self {
        let [emulator, controller] = [0, 1].map(|which| {
            let mut command = Command::new(programs[which]);
            command.args(["run", "--bus", bus, "--rig"]).arg(rigs[which]);
            command.arg("--experiment").arg(experiment).arg("--out").arg(run);
            command
        });
        Self { emulator, controller, run: run.into() }
    }

    /// Runs them to their end; a failure of one ends the other. Returns the file of their output, `console.log` of the run,
    /// also after a signal.
    pub(crate) fn run(mut self, children: &mut Children) -> Result<PathBuf, PairError> {
        // Beside the folder, which the emulator clears.
        let log = self.run.with_extension("log");
        let console = self.run.join("console.log");
        let code = self.run_into(&log, children).map_err(PairError::Other)?;
        fs::rename(&log, &console).map_err(FrontError::output(&console)).map_err(PairError::Other)?;
        if code == 0 || children.interrupted() {
            Ok(console)
        } else {
            Err(PairError::Failed { code, console })
        }
    }

    fn run_into(&mut self, log: &Path, children: &mut Children) -> Result<u8, FrontError> {
        make_folder(&self.run)?;
        let _ = fs::remove_file(log);
        let mut members = Vec::new();
        for command in [&mut self.emulator, &mut self.controller] {
            // Both append, so that neither overwrites the output of the other.
            let (out, error) = logs(File::options().create(true).append(true).open(log), log)?;
            members.push(children.start(command.stdout(out).stderr(error))?);
        }
        let (mut first_code, mut deadline) = (0, None);
        while children.count(&members) > 0 {
            match children.next(deadline) {
                Event::Ended(member, status) if members.contains(&member) && first_code == 0 => {
                    first_code = code(status);
                    deadline = (first_code != 0).then(|| Instant::now() + GRACE);
                }
                Event::Ended(..) => {}
                Event::Interrupted => children.stop_all(),
                Event::TimeUp => {
                    members.iter().for_each(|member| children.stop(*member));
                    deadline = None;
                }
            }
        }
        Ok(first_code)
    }
}
