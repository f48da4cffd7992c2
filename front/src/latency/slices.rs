//! One slice of a measurement, which has the machine for itself.

use crate::children::{Children, Event};
use crate::pair::{PairError, ProgramPair};
use crate::{Front, FrontError, last_lines, logs};
use runlog::run_folder::{CYCLICTEST_JSON, PING_PONG_JSON, PROBE_CSV};
use rustix::process::Pid;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// A load generator that ends within this time has failed.
const LOAD_STARTS: Duration = Duration::from_millis(500);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slice {
    /// The reference of wake-ups.
    Cyclictest,
    /// Emulator and controller.
    Run,
    /// Emulator and controller, with a rig that wakes early and spins.
    Spin,
    /// Round trips on the same bus.
    Bus,
    /// Round trips on an embedded bus, beside a real one.
    Embedded,
    /// Round trips on a bare pair of sockets.
    Socketpair,
}

impl Slice {
    /// Its name in progress lines, and that of the ping-pong.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Cyclictest => "cyclictest",
            Self::Run => "run",
            Self::Spin => "spin",
            Self::Bus => "bus",
            Self::Embedded => "embedded",
            Self::Socketpair => "socketpair",
        }
    }
}

/// Programs and conditions common to all slices.
pub(super) struct SliceRunner {
    pub(super) children: Children,
    pub(super) emulator: PathBuf,
    pub(super) controller: PathBuf,
    pub(super) bench: PathBuf,
    pub(super) rig: PathBuf,
    pub(super) programs: PathBuf,
    pub(super) experiment: PathBuf,
    /// URL of the bus of the runs and their round trips.
    pub(super) bus: String,
    /// URL of an embedded bus, for round trips beside a real one.
    pub(super) embedded: String,
    /// CPUs of the rig and of the controller.
    pub(super) cpus: [usize; 2],
    pub(super) seconds: u64,
    pub(super) priority: u64,
    pub(super) spin_us: u64,
    pub(super) probe: bool,
    pub(super) reference_missing: Option<String>,
}

impl SliceRunner {
    /// Measures a slice into the folder of its pair.
    pub(super) fn measure(&mut self, slice: Slice, folder: &Path, front: &Front) -> Result<(), FrontError> {
        match slice {
            Slice::Cyclictest => self.cyclictest(folder, front),
            Slice::Run => self.run(&folder.join("run"), 0),
            Slice::Spin => self.run(&folder.join("run-spin"), self.spin_us),
            Slice::Bus => self.ping_pong(folder, slice, Some(&self.bus.clone())),
            Slice::Embedded => self.ping_pong(folder, slice, Some(&self.embedded.clone())),
            Slice::Socketpair => self.ping_pong(folder, slice, None),
        }
    }

    /// Starts the load generator in a process group of its own, so that its children end with it.
    pub(super) fn start_load(&mut self, words: &[String], log: &Path) -> Result<Option<Pid>, FrontError> {
        let [program, arguments @ ..] = words else { return Ok(None) };
        let (out, error) = logs(File::options().create(true).append(true).open(log), log)?;
        let load =
            self.children.start_group(Command::new(program).args(arguments).stdout(out).stderr(error))?;
        let deadline = Instant::now() + LOAD_STARTS;
        loop {
            match self.children.next(Some(deadline)) {
                Event::Ended(ended, _) if ended == load => {
                    let output = last_lines(log, 1);
                    return Err(FrontError::Input(format!("the load generator ended at once: {output}")));
                }
                Event::Ended(..) => {}
                Event::Interrupted | Event::TimeUp => return Ok(Some(load)),
            }
        }
    }

    /// Ends a process that would not end by itself, and waits for its end.
    pub(super) fn end(&mut self, child: Pid) {
        self.children.stop(child);
        if self.children.count(&[child]) > 0 {
            let _ = self.children.finish(child);
        }
    }

    /// Options for nanoseconds, and for a histogram up to 1 ms in steps of 1 ns; cyclictest's counters of cycles and its
    /// maximum cover larger values.
    pub(super) fn cyclictest_words(&self) -> Vec<String> {
        let (priority, cpu, seconds) = (self.priority, self.cpus[0], self.seconds);
        let words =
            format!("cyclictest -m -p {priority} -a {cpu} -t 1 -i 1000 -D {seconds} -q -N -h 1000000");
        words.split(' ').map(str::to_owned).collect()
    }

    fn cyclictest(&mut self, folder: &Path, front: &Front) -> Result<(), FrontError> {
        if self.reference_missing.is_some() {
            return Ok(());
        }
        let (log, part) = (folder.join("cyclictest.log"), folder.join("cyclictest.json.part"));
        let words = self.cyclictest_words();
        let (out, error) = logs(File::create(&log), &log)?;
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]).arg(format!("--json={}", part.display())).stdout(out).stderr(error);
        let code = self.children.call(&mut command)?;
        if self.children.interrupted() {
            return Ok(());
        }
        // Its log repeats the histogram, one line for each nanosecond.
        let is_bin =
            |line: &str| line.bytes().all(|byte| byte.is_ascii_digit() || byte == b' ') && line.contains(' ');
        let output = fs::read_to_string(&log).unwrap_or_default();
        let output: Vec<_> = output.lines().filter(|line| !is_bin(line)).collect();
        fs::write(&log, output.join("\n") + "\n").map_err(FrontError::output(&log))?;
        if code == 0 && part.metadata().is_ok_and(|part| part.len() > 0) {
            let whole = folder.join(CYCLICTEST_JSON);
            return fs::rename(&part, &whole).map_err(FrontError::output(&whole));
        }
        let first = output.into_iter().find(|line| !line.is_empty()).unwrap_or("it said nothing");
        let why = format!("cyclictest ended with code {code}: {first}");
        front.warn(&format!("warning: {why}"));
        self.reference_missing = Some(why);
        Ok(())
    }

    fn run(&mut self, run: &Path, spin_us: u64) -> Result<(), FrontError> {
        let watching = if self.probe { Some(self.start_probe(run)?) } else { None };
        let [cpu, controller_cpu] = self.cpus.map(|cpu| cpu.to_string());
        let (seconds, priority) = (self.seconds.to_string(), self.priority.to_string());
        let programs = [self.emulator.as_path(), &self.controller];
        let mut pair = ProgramPair::new(programs, [&self.rig, &self.rig], &self.experiment, run, &self.bus);
        pair.emulator.args(["--seconds", &seconds]);
        pair.controller.arg("--repeat").arg("--programs").arg(&self.programs);
        for (program, cpu) in [(&mut pair.emulator, cpu), (&mut pair.controller, controller_cpu)] {
            program.args(["--cpu", &cpu, "--fifo-priority", &priority, "--full-timing"]);
        }
        if spin_us > 0 {
            pair.emulator.args(["--spin-us", &spin_us.to_string()]);
        }
        let ended = pair.run(&mut self.children);
        if let Some(watching) = watching {
            self.end(watching);
            let _ = fs::rename(run.with_extension(PROBE_CSV), run.join(PROBE_CSV));
        }
        match ended {
            Ok(_) => Ok(()),
            Err(PairError::Other(error)) => Err(error),
            Err(PairError::Failed { code, console }) => {
                let output = fs::read_to_string(&console).unwrap_or_default();
                let lines =
                    output.lines().filter(|line| !line.contains("warning") && !line.contains("simulated"));
                lines.for_each(|line| eprintln!("{line}"));
                let console = console.display();
                Err(FrontError::Process(format!("a run failed with code {code}; see {console}")))
            }
        }
    }

    /// Starts the probe, which records gaps until the run is over.
    fn start_probe(&mut self, run: &Path) -> Result<Pid, FrontError> {
        let log = run.with_extension("probe.log");
        let (out, error) = logs(File::create(&log), &log)?;
        let mut probe = Command::new(&self.bench);
        probe.args(["probe", "--out"]).arg(run.with_extension(PROBE_CSV)).stdout(out).stderr(error);
        self.children.start(&mut probe)
    }

    fn ping_pong(&mut self, folder: &Path, slice: Slice, bus: Option<&str>) -> Result<(), FrontError> {
        let name = slice.name();
        let file = |ending: &str| folder.join(format!("{name}.{ending}"));
        let mut host = None;
        if let Some(bus) = bus.filter(|bus| bus.starts_with("unix://")) {
            let (json, log) = (file("host.json"), file("host.log"));
            let mut command = Command::new(&self.emulator);
            command.args(["bus", "--bus", bus]);
            command.stdout(File::create(&json).map_err(FrontError::output(&json))?);
            command.stderr(File::create(&log).map_err(FrontError::output(&log))?);
            host = Some(self.children.start(&mut command)?);
        }
        let [cpu, peer_cpu] = self.cpus.map(|cpu| cpu.to_string());
        let (seconds, priority) = (self.seconds.to_string(), self.priority.to_string());
        let mut command = Command::new(&self.bench);
        command.arg("ping-pong");
        match bus {
            Some(bus) => command.args(["--bus", bus]),
            None => command.arg("--socketpair"),
        };
        command.args(["--name", name, "--priority", &priority, "--cpu", &cpu, "--peer-cpu", &peer_cpu]);
        command
            .args(["--interval-us", "1000", "--seconds", &seconds, "--json"])
            .arg(folder.join(PING_PONG_JSON));
        command.arg("--out").arg(folder.join(format!("ping-pong-{name}.hlog")));
        let (out, error) = logs(File::create(file("log")), &file("log"))?;
        let code = self.children.call(command.stdout(out).stderr(error))?;
        host.into_iter().for_each(|host| self.end(host));
        if code == 0 || self.children.interrupted() {
            return Ok(());
        }
        let output = last_lines(&file("log"), 1);
        Err(FrontError::Process(format!("the ping-pong '{name}' failed: {output}")))
    }
}
