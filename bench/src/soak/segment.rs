//! Runs one segment: emulator, controllers and load are started in order, sampled once a second, and ended together.
//!
//! The controllers start first, so that on can:// all listen before the first frame; the rig ends after its time, and its last
//! tick ends the controllers. When one of them ends early, the others are ended too: their records stay, and the next segment
//! is independent.

use super::cli::SoakArguments;
use super::memory::Sample;
use super::plan::SegmentSpec;
use super::processes::{RunningProgram, end_in_words};
use super::procfs;
use super::{EMULATOR, SoakError};
use protocol::bus::BusUrl;
use realtime::Interrupt;
use runlog::process::Process;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Period of the polls of the processes.
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// Period of the samples of memory and files.
const SAMPLE_PERIOD: Duration = Duration::from_secs(1);
/// Number of samples between two of the proportional set size.
const PSS_EVERY: usize = 10;
/// Longest time until controllers listen on can://.
const LISTEN_TIMEOUT: Duration = Duration::from_secs(20);
/// Longest time for programs to save and end.
const SAVE_TIMEOUT: Duration = Duration::from_secs(20);

/// Properties common to all segments of a soak.
pub(super) struct SegmentContext<'a> {
    pub arguments: &'a SoakArguments,
    pub bin_dir: PathBuf,
    /// Command line of the load generator, program first; empty without one.
    pub load: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum SegmentEnd {
    TimeUp,
    /// The soak was asked to end.
    Interrupted,
    /// The disk is nearly full: free bytes.
    DiskFull(u64),
    /// A program ended early or did not end; the reason in words.
    ProgramFailure(String),
}

/// Results of a segment besides its files.
pub(super) struct Outcome {
    pub end: SegmentEnd,
    /// Process number, exit code (`None` after a signal) and end in words of each program, by name.
    pub exits: BTreeMap<String, (u32, Option<i32>, String)>,
    pub memory: BTreeMap<String, Vec<Sample>>,
    /// Frames that the interface sent meanwhile; `None` on the embedded bus, and where the system does not report them.
    pub sent_by_interface: Option<u64>,
}

/// Reports progress: seconds since the start of the segment.
pub(super) type Progress<'a> = dyn FnMut(f64) + 'a;

/// Runs a segment of `rig_s` in `folder`, which is created.
pub(super) fn run(
    context: &SegmentContext<'_>,
    spec: &SegmentSpec,
    rig_s: f64,
    folder: &Path,
    interrupt: &Interrupt,
    progress: &mut Progress<'_>,
) -> Result<Outcome, SoakError> {
    std::fs::create_dir_all(folder).map_err(|error| SoakError::output(folder, &error))?;
    let interface = context.arguments.bus.interface();
    let sent_before = interface.and_then(procfs::sent_by_interface);
    let launcher = SegmentLauncher { context, spec, folder };
    let mut running = launcher.controllers()?;
    let load = if spec.load { launcher.load()? } else { None };
    running.insert(0, launcher.emulator(rig_s)?);
    let mut monitor = ProcessMonitor { began: Instant::now(), samples: 0, memory: BTreeMap::new() };
    let end = monitor.wait_for_end(
        &mut running,
        rig_s,
        |free| free < context.arguments.min_free_mb * 1_000_000,
        interrupt,
        progress,
        folder,
    );
    if end != SegmentEnd::TimeUp {
        // The rig's last tick ends the controllers after they received everything; so the rig ends first.
        running[0].interrupt();
        running[0].wait_until(Instant::now() + SAVE_TIMEOUT / 2);
    }
    let controllers_end = Instant::now() + Duration::from_secs(2);
    for program in running.iter_mut().skip(1) {
        if !program.wait_until(controllers_end) {
            program.interrupt();
        }
    }
    let exits = running.iter_mut().map(|program| {
        let status = program.end(SAVE_TIMEOUT);
        (program.name.clone(), (program.pid(), status.and_then(|status| status.code()), end_in_words(status)))
    });
    let exits = exits.collect();
    drop(load);
    let sent_after = interface.and_then(procfs::sent_by_interface);
    let sent_by_interface = sent_before.zip(sent_after).map(|(before, after)| after.saturating_sub(before));
    Ok(Outcome { end, exits, memory: monitor.memory, sent_by_interface })
}

/// Starts the programs of a segment.
struct SegmentLauncher<'a> {
    context: &'a SegmentContext<'a>,
    spec: &'a SegmentSpec,
    folder: &'a Path,
}

impl SegmentLauncher<'_> {
    /// The bus of this segment; the seed is its number, so that losses differ between segments.
    fn bus(&self) -> BusUrl {
        let mut bus = self.context.arguments.bus.clone();
        if let (BusUrl::Unix { wire, .. }, Some(loss)) = (&mut bus, self.spec.loss) {
            (wire.loss, wire.seed) = (loss, u64::from(self.spec.number));
        }
        bus
    }

    fn program(&self, name: &str, program: &str, more: Vec<OsString>) -> Result<RunningProgram, SoakError> {
        let (path, asked) = (self.context.bin_dir.join(program), self.context.arguments);
        let experiment = asked.experiment_folder.join(format!("{}.toml", self.spec.experiment));
        let mut arguments: Vec<OsString> = vec!["run".into(), "--bus".into(), self.bus().to_string().into()];
        for (option, value) in [("--rig", &asked.rig), ("--experiment", &experiment)] {
            arguments.extend([option.into(), value.into()]);
        }
        arguments.extend(["--out".into(), self.folder.into()]);
        arguments.extend(more);
        self.start(name, &path, &arguments)
    }

    fn start(&self, name: &str, path: &Path, arguments: &[OsString]) -> Result<RunningProgram, SoakError> {
        RunningProgram::start(name, path, arguments, &self.folder.join(format!("{name}.txt")))
            .map_err(|error| SoakError::Program { program: path.into(), reason: error.to_string() })
    }

    fn emulator(&self, rig_s: f64) -> Result<RunningProgram, SoakError> {
        let mut more: Vec<OsString> = vec!["--seconds".into(), rig_s.to_string().into()];
        more.extend(self.context.arguments.emulator_options.split_whitespace().map(Into::into));
        self.program(EMULATOR, "emulator", more)
    }

    fn controllers(&self) -> Result<Vec<RunningProgram>, SoakError> {
        let interface = self.context.arguments.bus.interface();
        let before = interface.and_then(procfs::listeners);
        let mut controllers = Vec::new();
        for process in Process::controllers(self.spec.two_processes) {
            let axis = if let Process::ControllerOf(axis) = process { axis.name() } else { "both" };
            let mut more: Vec<OsString> = vec!["--axis".into(), axis.into(), "--repeat".into()];
            more.extend(self.context.arguments.controller_options.split_whitespace().map(Into::into));
            controllers.push(self.program(process.name(), "controller", more)?);
        }
        if let Some((interface, before)) = interface.zip(before) {
            let until = Instant::now() + LISTEN_TIMEOUT;
            let wanted = before + controllers.len();
            while procfs::listeners(interface).is_some_and(|now| now < wanted) && Instant::now() < until {
                std::thread::sleep(POLL_PERIOD);
            }
        }
        Ok(controllers)
    }

    fn load(&self) -> Result<Option<RunningProgram>, SoakError> {
        let Some((program, arguments)) = self.context.load.split_first() else { return Ok(None) };
        let arguments: Vec<OsString> = arguments.iter().map(Into::into).collect();
        self.start("load", Path::new(program), &arguments).map(Some)
    }
}

/// Samples taken while programs run.
struct ProcessMonitor {
    began: Instant,
    samples: usize,
    memory: BTreeMap<String, Vec<Sample>>,
}

impl ProcessMonitor {
    /// Waits until the emulator, the first of `running`, has ended, or the segment ends early.
    fn wait_for_end(
        &mut self,
        running: &mut [RunningProgram],
        rig_s: f64,
        too_full: impl Fn(u64) -> bool,
        interrupt: &Interrupt,
        progress: &mut Progress<'_>,
        folder: &Path,
    ) -> SegmentEnd {
        let latest = self.began + Duration::from_secs_f64(rig_s) + SAVE_TIMEOUT;
        loop {
            if self.began.elapsed() >= SAMPLE_PERIOD * self.samples as u32 {
                self.sample(running);
                if let Some(free) = procfs::free_bytes(folder).filter(|free| too_full(*free)) {
                    return SegmentEnd::DiskFull(free);
                }
                progress(self.began.elapsed().as_secs_f64());
            }
            if interrupt.came() {
                return SegmentEnd::Interrupted;
            }
            let gone: Vec<_> =
                running.iter_mut().filter_map(|one| (!one.is_running()).then(|| one.name.clone())).collect();
            let in_time = self.began.elapsed().as_secs_f64() >= rig_s;
            if gone.iter().any(|name| name == EMULATOR) && in_time {
                return SegmentEnd::TimeUp;
            }
            // Controllers receive the last tick slightly before the rig ends.
            if !gone.is_empty() && !in_time {
                let after_s = self.began.elapsed().as_secs_f64();
                return SegmentEnd::ProgramFailure(format!(
                    "{} ended after {after_s:.1} of {rig_s} s",
                    gone.join(" and ")
                ));
            }
            if Instant::now() > latest {
                return SegmentEnd::ProgramFailure("the emulator did not end in time".into());
            }
            std::thread::sleep(POLL_PERIOD);
        }
    }

    fn sample(&mut self, running: &mut [RunningProgram]) {
        let at_s = self.began.elapsed().as_secs_f64();
        let pss = self.samples.is_multiple_of(PSS_EVERY);
        for program in running.iter_mut() {
            if let Some(sample) = procfs::memory(program.pid(), at_s, pss) {
                self.memory.entry(program.name.clone()).or_default().push(sample);
            }
        }
        self.samples += 1;
    }
}
