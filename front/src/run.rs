//! `airbench run`: an experiment with emulator and controllers as processes on one bus, and its companion programs.
//!
//! ```text
//!   bounds checked ──► emulator, controller (one or one for each axis) ──► joined, judged, drawn
//!                      bench gateway, bench watch: end with the run
//! ```
//!
//! A process that fails ends the others, after [`GRACE`], in which they notice the failure, report it and trip the emergency
//! stop. The exit code is that of the first failure, which is the cause of the later ones.

use crate::children::{Children, Event, code};
use crate::cli::RunArguments;
use crate::private::{PrivateFolder, RunBus};
use crate::{Front, FrontError, make_folder, say};
use figures::{sum_up, thresholds};
use protocol::exit::Exit;
use runlog::Axis;
use runlog::run_folder::{GATEWAY_JSON, SUMMARY_JSON};
use rustix::process::Pid;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Time for the others to notice a failure.
const GRACE: Duration = Duration::from_secs(3);

/// Runs an experiment. Returns the exit code.
pub(crate) fn run(arguments: &RunArguments, front: &Front) -> Result<u8, FrontError> {
    if arguments.list {
        return list(front).map(|()| Exit::Good as u8);
    }
    check(arguments)?;
    let file = front.experiment(&arguments.experiment, |name| format!("no experiment '{name}'"))?;
    let program = |name: &str| front.places.program(name);
    let (emulator, controller) = (program("emulator")?, program("controller")?);
    // Gateway and page alone are commands of this one.
    let bench = if arguments.gateway || arguments.watch { program("bench")? } else { PathBuf::new() };
    let (rig, programs) = (front.places.data("rig.toml")?, front.places.data("programs")?);
    let children = Children::watch()?;

    // A typo in the bounds is reported before the run, not after it.
    thresholds::check_file(&file).map_err(|error| FrontError::Input(error.to_string()))?;
    if children.interrupted() {
        return Ok(Exit::Interrupted as u8);
    }
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => newest(front, &name)?,
    };
    make_folder(&out)?;
    // The emulator clears the folder of an earlier run; if it fails before, old results must not be taken for this run's.
    let _ = fs::remove_file(out.join(SUMMARY_JSON));

    let RunBus { url: bus, mut private, reservation } =
        RunBus::for_others(arguments.bus.as_deref(), arguments.lockstep || arguments.rehearse)?;
    let mut control = Command::new(&controller);
    control.arg(if arguments.rehearse { "rehearse" } else { "run" });
    for_controller(&mut control, arguments);
    control.arg("--rig").arg(&rig).arg("--experiment").arg(&file);
    control.arg("--programs").arg(programs).arg("--out").arg(&out);

    let mut run = Run { children, members: Vec::new(), stopped: false };
    if arguments.rehearse {
        say(&format!("rehearsing {name}, files in {}", out.display()));
        add(&mut control, "--seed", arguments.seed.as_ref());
        add(&mut control, "--seconds", arguments.seconds.as_ref());
        run.join(&mut control)?;
    } else {
        say(&format!("running {name} on {bus}, files in {}", out.display()));
        let mut emulate = Command::new(&emulator);
        emulate.args(["run", "--bus", &bus, "--rig"]).arg(&rig);
        emulate.arg("--experiment").arg(&file).arg("--out").arg(&out);
        for_emulator(&mut emulate, arguments);
        if arguments.gateway {
            let mut gateway = Command::new(&bench);
            gateway.args(["gateway", "--bus", &bus, "--report"]).arg(out.join(GATEWAY_JSON));
            let _ = run.children.start(&mut gateway)?;
        }
        if arguments.watch {
            // Beside the socket of a private bus, or in a folder that only this user can read.
            let folder = match &private {
                Some(folder) => folder,
                None => private.insert(PrivateFolder::make()?),
            };
            let telemetry = folder.0.join("telemetry");
            start_page(&mut run.children, &bench, [&bus, &arguments.http], &telemetry)?;
            emulate.arg("--console").arg("--telemetry").arg(telemetry);
        }
        run.join(&mut emulate)?;
        for axis in if arguments.two { &Axis::NAMES[..] } else { &["both"] } {
            let mut one = Command::new(&controller);
            one.args(control.get_args()).args(["--bus", &bus, "--axis", axis]);
            run.join(&mut one)?;
        }
    }
    let first_code = run.wait(front);
    let interrupted = run.children.interrupted();
    // Ends gateway and page, and removes the bus: a signal from now on ends this process at once.
    drop(run);
    drop((private, reservation));

    // A run that did not start has no results.
    if first_code == Exit::BadInput as u8 {
        return Ok(first_code);
    }
    let summary_code = sum_up(&out, front);
    Ok(match (first_code, interrupted) {
        (0, false) => summary_code,
        (0, true) => Exit::Interrupted as u8,
        (failed, _) => failed,
    })
}

/// Starts the live page of a run on `bus`, served at `http`; the emulator publishes its telemetry at `telemetry`.
fn start_page(
    children: &mut Children,
    bench: &Path,
    [bus, http]: [&str; 2],
    telemetry: &Path,
) -> Result<(), FrontError> {
    let mut watch = Command::new(bench);
    watch.args(["watch", "--bus", bus, "--http", http, "--control", "--telemetry"]).arg(telemetry);
    let _ = children.start(&mut watch)?;
    Ok(())
}

/// Judges and draws the run in `out`; the exit code is good where the run left no results.
fn sum_up(out: &Path, front: &Front) -> u8 {
    if !out.join(SUMMARY_JSON).is_file() {
        return Exit::Good as u8;
    }
    match sum_up::sum_up(out) {
        Ok(summed_up) => {
            say(summed_up.text.trim_end());
            if summed_up.passed { Exit::Good as u8 } else { Exit::BoundBroken as u8 }
        }
        Err(error) => {
            front.warn(&error.to_string());
            Exit::BadInput as u8
        }
    }
}

/// Prints name and subject of each shipped experiment.
fn list(front: &Front) -> Result<(), FrontError> {
    let folder = front.places.data("experiments")?;
    let unreadable = |reason| FrontError::Input(format!("{}: {reason}", folder.display()));
    let entries =
        fs::read_dir(&folder).and_then(Iterator::collect::<Result<Vec<_>, _>>).map_err(unreadable)?;
    let mut files: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    files.sort();
    for file in files.iter().filter(|file| file.extension() == Some(OsStr::new("toml"))) {
        let text = fs::read_to_string(file).map_err(unreadable)?;
        let subject = text.lines().find_map(|line| line.strip_prefix("about = \"")?.strip_suffix('"'));
        say(&format!(
            "{:<18} {}",
            file.file_stem().unwrap_or_default().to_string_lossy(),
            subject.unwrap_or_default()
        ));
    }
    Ok(())
}

/// Refuses options that exclude each other, and files that cannot be read.
fn check(arguments: &RunArguments) -> Result<(), FrontError> {
    let refused = [
        (
            arguments.sealed.is_some(),
            "--sealed: a rehearsal runs the plant inside the controller, which must not read it; use --lockstep",
        ),
        (
            arguments.faults.is_some(),
            "--faults: a rehearsal has no rig process that could break; use --lockstep",
        ),
        (arguments.lockstep, "--lockstep and --rehearse exclude each other; see --help"),
        (arguments.gateway, "--gateway: a rehearsal has no bus; use --lockstep"),
        (arguments.watch, "--watch: a rehearsal is over before anybody could look; use --lockstep"),
    ];
    if let Some((_, why)) = refused.iter().find(|(given, _)| *given && arguments.rehearse) {
        return Err(FrontError::Input((*why).into()));
    }
    for (option, file) in [("--sealed", &arguments.sealed), ("--faults", &arguments.faults)] {
        if let Some(file) = file.as_ref().filter(|file| File::open(file).is_err()) {
            return Err(FrontError::Input(format!("{option} {}: cannot be read", file.display())));
        }
    }
    Ok(())
}

/// A new folder that `runs/latest` points to.
fn newest(front: &Front, name: &str) -> Result<PathBuf, FrontError> {
    let out = front.run_folder(name)?;
    make_folder(&out)?;
    let latest = front.places.runs().join("latest");
    let _ = fs::remove_file(&latest);
    let _ = std::os::unix::fs::symlink(out.file_name().unwrap_or_default(), latest);
    Ok(out)
}

/// Appends `--NAME VALUE`, if there is a value.
fn add(command: &mut Command, name: &str, value: Option<impl AsRef<OsStr>>) {
    if let Some(value) = value {
        command.arg(name).arg(value);
    }
}

fn for_emulator(command: &mut Command, arguments: &RunArguments) {
    add(command, "--seed", arguments.seed.as_ref());
    add(command, "--seconds", arguments.seconds.as_ref());
    add(command, "--cpu", arguments.cpu.as_ref());
    add(command, "--spin-us", arguments.spin_us.as_ref());
    add(command, "--sealed", arguments.sealed.as_ref());
    add(command, "--faults", arguments.faults.as_ref());
    add(command, "--pace", arguments.lockstep.then_some("lockstep"));
    add(command, "--members", (arguments.lockstep && arguments.two).then_some("2"));
    command.args(arguments.full_timing.then_some("--full-timing"));
}

fn for_controller(command: &mut Command, arguments: &RunArguments) {
    add(command, "--drive-program", arguments.drive_program.as_ref());
    add(command, "--load-program", arguments.load_program.as_ref());
    arguments.set.iter().for_each(|variable| add(command, "--set", Some(variable)));
    add(command, "--parameters", arguments.parameters.as_ref());
    command.args(arguments.seconds.is_some().then_some("--repeat"));
    // With a page the way back from a stop needs a click.
    let with_page = arguments.watch.then_some("on-start");
    add(command, "--after-emergency-stop", arguments.after_emergency_stop.as_deref().or(with_page));
    if !arguments.rehearse {
        add(command, "--xcp", arguments.xcp.as_ref());
        add(command, "--cpu", arguments.controller_cpu.as_ref());
        add(command, "--pace", arguments.lockstep.then_some("lockstep"));
        command.args(arguments.watch_programs.then_some("--watch"));
        command.args(arguments.full_timing.then_some("--full-timing"));
    }
}

/// The processes of a run.
struct Run {
    children: Children,
    members: Vec<Pid>,
    stopped: bool,
}

impl Run {
    fn join(&mut self, command: &mut Command) -> Result<(), FrontError> {
        self.members.push(self.children.start(command)?);
        Ok(())
    }

    /// Asks the members to end, once.
    fn pass_on(&mut self) {
        if !std::mem::replace(&mut self.stopped, true) {
            self.members.iter().for_each(|member| self.children.stop(*member));
        }
    }

    /// Waits until all members have ended. Returns the exit code of the first that failed before any was asked to end.
    fn wait(&mut self, front: &Front) -> u8 {
        let (mut first_code, mut deadline) = (0, None);
        while self.children.count(&self.members) > 0 {
            // A signal before the first process was not passed on.
            if self.children.interrupted() {
                self.pass_on();
            }
            match self.children.next(deadline.filter(|_| !self.stopped)) {
                Event::Ended(member, status) if self.members.contains(&member) => {
                    if !status.success() && !self.stopped && !self.children.interrupted() && first_code == 0 {
                        first_code = self.failed(front, status);
                        deadline = Some(Instant::now() + GRACE);
                    }
                    // The emulator alone waits for no partner.
                    if deadline.is_some() && self.children.count(&self.members) <= 1 {
                        self.pass_on();
                    }
                }
                Event::Ended(..) => {}
                Event::Interrupted | Event::TimeUp => self.pass_on(),
            }
        }
        first_code
    }

    /// The exit code for a failed member: a signal counts as a failed partner; after bad input the others are ended at once.
    fn failed(&mut self, front: &Front, status: std::process::ExitStatus) -> u8 {
        if let Some(signal) = status.signal() {
            front.warn(&format!("a process was ended by signal {signal}"));
            return Exit::BusFailed as u8;
        }
        let code = code(status);
        if code == Exit::BadInput as u8 {
            self.pass_on();
        }
        code
    }
}
