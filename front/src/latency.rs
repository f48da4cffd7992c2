//! `airbench latency`: measures latency beside references. cyclictest, airbench and ping-pongs alternate, and a report compares
//! them.
//!
//! ```text
//!   pair 1: cyclictest, run, bus, socketpair, spin │ pair 2: the same in reverse │ … ──► bench report, bench latency-table
//! ```

mod slices;

use crate::children::Children;
use crate::cli::LatencyArguments;
use crate::private::PrivateFolder;
use crate::{Front, FrontError, last_lines, logs, say};
use protocol::exit::Exit;
use runlog::conditions::Conditions;
use runlog::run_folder::{
    CONDITIONS_JSON, CYCLICTEST_JSON, PING_PONG_JSON, REPORT_JSON, SCHEMA_VERSION, SUMMARY_JSON, write_json,
};
use rustix::thread::{CpuSet, sched_getaffinity};
use slices::{Slice, SliceRunner};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Measures and reports. Returns the exit code.
pub(crate) fn latency(arguments: &LatencyArguments, front: &Front) -> Result<u8, FrontError> {
    let plan = Plan::of(arguments, front)?;
    let out = front.results(arguments.out.as_deref(), "latency", ("measurement", "pair-01"))?;
    let mut children = Children::watch()?;
    let log = out.join("install.log");
    let reference_missing = get("cyclictest", "rt_tests", front, &mut children, &log)?;
    reference_missing.iter().for_each(|missing| front.warn(&format!("warning: {missing}")));
    let load: Vec<_> = arguments.load.split_whitespace().map(str::to_owned).collect();
    if load.first().is_some_and(|program| program == "stress-ng") {
        let _ = get("stress-ng", "stress_ng", front, &mut children, &log)?;
    }
    if let Some(program) = load.first().filter(|program| !on_path(program)) {
        return Err(FrontError::Input(format!("--load: no program {program}")));
    }
    if children.interrupted() {
        return Err(FrontError::Interrupted);
    }
    let private = PrivateFolder::make()?;
    let mut measurement = Measurement {
        runner: SliceRunner {
            children,
            emulator: front.places.program("emulator")?,
            controller: front.places.program("controller")?,
            bench: front.places.program("bench")?,
            rig: front.places.data("rig.toml")?,
            programs: front.places.data("programs")?,
            experiment: plan.experiment.clone(),
            bus: arguments.bus.clone().unwrap_or_else(|| private.bus()),
            embedded: private.bus(),
            cpus: plan.cpus,
            seconds: arguments.seconds,
            priority: arguments.priority,
            spin_us: arguments.spin_us,
            probe: arguments.probe,
            reference_missing,
        },
        front,
        arguments,
        out,
        load,
    };
    measurement.measure()?;
    measurement.report(&plan)
}

/// The checked command line.
struct Plan {
    experiment: PathBuf,
    /// CPUs of the rig and of the controller.
    cpus: [usize; 2],
    bounds: Option<PathBuf>,
    spin_bounds: Option<PathBuf>,
}

impl Plan {
    fn of(arguments: &LatencyArguments, front: &Front) -> Result<Self, FrontError> {
        let refused = |why: &str| Err(FrontError::Input(why.into()));
        let cpus = allowed_cpus();
        let last = cpus.last().copied().unwrap_or(0);
        let cpu = arguments.cpu.unwrap_or(last);
        // The CPU before it, or the one after the first.
        let other = cpus.iter().copied().rfind(|other| *other != cpu).unwrap_or(cpu);
        let cpus_asked = [cpu, arguments.controller_cpu.unwrap_or(other)];
        if let Some(missing) = cpus_asked.iter().find(|cpu| !cpus.contains(cpu)) {
            let there = cpus.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
            return refused(&format!("this process may not use CPU {missing}; it may use {there}"));
        }
        let (mut bounds, mut spin_bounds) = (arguments.bounds.clone(), None);
        if arguments.claims {
            if bounds.is_some() {
                return refused("--claims and --bounds are two files for one report; leave one out");
            }
            if arguments.spin_us == 0 {
                return refused("--claims also needs the spinning runs (bound 1 us); leave out --spin-us 0");
            }
            bounds = Some(front.places.data("latency-bounds.toml")?);
            spin_bounds = Some(front.places.data("latency-bounds-spin.toml")?);
        }
        if let Some(file) = bounds.as_ref().filter(|file| File::open(file).is_err()) {
            return refused(&format!("--bounds {}: cannot be read", file.display()));
        }
        if arguments.write && front.places.checkout().is_none() {
            return refused("--write: there is no checkout with bench/docs/latency.md");
        }
        let experiment = front.experiment(&arguments.experiment, |name| format!("no experiment '{name}'"))?;
        Ok(Self { experiment, cpus: cpus_asked, bounds, spin_bounds })
    }
}

/// Numbers of the CPUs that this process may use.
fn allowed_cpus() -> Vec<usize> {
    let allowed = sched_getaffinity(None).unwrap_or_default();
    (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu)).collect()
}

/// Whether a command exists, by its path or on `PATH`.
fn on_path(program: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders).any(|folder| folder.join(program).is_file());
    found || (program.contains('/') && Path::new(program).is_file())
}

/// Why a program of Debian is missing; `None` when it exists. In a checkout it is installed first, by `scripts/tools.sh`.
fn get(
    program: &str,
    package: &str,
    front: &Front,
    children: &mut Children,
    log: &Path,
) -> Result<Option<String>, FrontError> {
    let Some(checkout) = front.places.checkout().filter(|_| !on_path(program)) else {
        return Ok(
            (!on_path(program)).then(|| format!("{program} is not there; install it from Debian's packages"))
        );
    };
    say(&format!("getting {program} …"));
    let install = "tools=$1/target/tools; mkdir -p \"$tools\"; . \"$1/scripts/tools.sh\"; \"install_$2\"";
    let (out, error) = logs(File::create(log), log)?;
    let mut bash = Command::new("bash");
    bash.args(["-euc", install, "bash"]).arg(checkout).arg(package).stdout(out).stderr(error);
    let _ = children.call(&mut bash)?;
    let package = package.replace('_', "-");
    let why =
        || format!("{program} is not there, and Debian's {package} cannot be had: {}", last_lines(log, 1));
    Ok((!on_path(program)).then(why))
}

struct Measurement<'a> {
    runner: SliceRunner,
    front: &'a Front,
    arguments: &'a LatencyArguments,
    out: PathBuf,
    load: Vec<String>,
}

impl Measurement<'_> {
    fn pair_folder(&self, pair: u64) -> PathBuf {
        self.out.join(format!("pair-{pair:02}"))
    }

    /// Measures all pairs, until the last or a signal.
    fn measure(&mut self) -> Result<(), FrontError> {
        let mut slices = vec![Slice::Cyclictest, Slice::Run, Slice::Bus, Slice::Socketpair];
        slices.extend((self.arguments.spin_us != 0).then_some(Slice::Spin));
        // On a real CAN bus the claim is about that bus; an embedded bus is measured beside it.
        slices.extend(self.runner.bus.starts_with("can://").then_some(Slice::Embedded));
        let (pairs, seconds) = (self.arguments.pairs, self.arguments.seconds);
        let total = pairs * slices.len() as u64;
        let [cpu, controller_cpu] = self.runner.cpus;
        say(&format!(
            "{pairs} pairs of {} slices of {seconds} s on CPU {cpu} (controller {controller_cpu}), about {} min; files in {}",
            slices.len(),
            (total * (seconds + 1)).div_ceil(60),
            self.out.display()
        ));
        let (began, mut done) = (Instant::now(), 0);
        for pair in 1..=pairs {
            let folder = self.pair_folder(pair);
            fs::create_dir(&folder).map_err(FrontError::output(&folder))?;
            // Alternating order, so that slow drifts (heat, other load) do not always affect the same slice.
            let mut order = slices.clone();
            if pair % 2 == 0 {
                order.reverse();
            }
            for slice in order {
                if self.runner.children.interrupted() {
                    break;
                }
                // Estimated from the slices so far; from their length before the first.
                let left = match done {
                    0 => total * (seconds + 1),
                    done => began.elapsed().as_secs() * (total - done) / done,
                };
                let (minutes, seconds) = (left / 60, left % 60);
                say(&format!(
                    "pair {pair} of {pairs}, {:<11} {minutes} min {seconds:02} s left",
                    format!("{}:", slice.name())
                ));
                let load = self.runner.start_load(&self.load, &self.out.join("load.log"))?;
                self.runner.measure(slice, &folder, self.front)?;
                load.iter().for_each(|load| self.runner.end(*load));
                done += 1;
            }
            self.gather(&folder, pair)?;
            if self.runner.children.interrupted() {
                break;
            }
        }
        Ok(())
    }

    /// Copies the measurements beside a run into the run's folder.
    fn gather(&self, folder: &Path, pair: u64) -> Result<(), FrontError> {
        let (run, spin) = (folder.join("run"), folder.join("run-spin"));
        if !run.is_dir() {
            return Ok(());
        }
        for path in fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let histogram = name.starts_with("ping-pong-") && name.ends_with(".hlog");
            if histogram || [CYCLICTEST_JSON, PING_PONG_JSON].contains(&name.as_str()) {
                let kept = run.join(&name);
                fs::rename(&path, &kept).map_err(FrontError::output(&kept))?;
            }
        }
        let reference = run.join(CYCLICTEST_JSON);
        let (command, missing) = match (reference.is_file(), &self.runner.reference_missing) {
            (true, _) => (Some(self.runner.cyclictest_words().join(" ")), None),
            (false, Some(why)) => (None, Some(why.clone())),
            (false, None) => (None, Some("interrupted before cyclictest's turn".into())),
        };
        let write = |folder: &Path, group: String| {
            let conditions = Conditions {
                command: Some(self.front.typed.clone()),
                group: Some(group),
                load_generator: Some(if self.load.is_empty() { "none" } else { &self.arguments.load }.into()),
                pair: Some(pair),
                probe: self.arguments.probe,
                reference_command: command.clone(),
                reference_missing_because: missing.clone(),
                schema_version: SCHEMA_VERSION,
                uncommitted_files: self.front.places.checkout().and_then(uncommitted_files),
            };
            let file = folder.join(CONDITIONS_JSON);
            write_json(&file, &conditions).map_err(FrontError::output(&file))
        };
        write(&run, "plain".into())?;
        if !spin.is_dir() {
            return Ok(());
        }
        // The one reference of the pair belongs to both of its runs.
        if reference.is_file() {
            let copy = spin.join(CYCLICTEST_JSON);
            fs::copy(&reference, &copy).map_err(FrontError::output(&copy))?;
        }
        write(&spin, format!("spin {} us", self.arguments.spin_us))
    }

    /// Makes the reports and the table of ratios.
    fn report(&mut self, plan: &Plan) -> Result<u8, FrontError> {
        let pairs: Vec<_> = (1..=self.arguments.pairs).map(|pair| self.pair_folder(pair)).collect();
        // The files of a killed slice are no run: the emulator writes its report at its end.
        let runs = |name: &str| -> Vec<PathBuf> {
            let runs = pairs.iter().map(|pair| pair.join(name));
            runs.filter(|run| run.join(SUMMARY_JSON).is_file()).collect()
        };
        let (plain, spinning) = (runs("run"), runs("run-spin"));
        let interrupted = self.runner.children.interrupted();
        if plain.is_empty() {
            let nothing = FrontError::Process("no run was measured".into());
            return Err(if interrupted { FrontError::Interrupted } else { nothing });
        }
        let report = |runs: &[PathBuf], out: &Path, bounds: &Option<PathBuf>| {
            let mut command = Command::new(&self.runner.bench);
            command.arg("report").args(runs).arg("--out").arg(out);
            if let Some(bounds) = bounds {
                command.arg("--bounds").arg(bounds);
            }
            command
        };
        let made = self.out.join(REPORT_JSON);
        let mut plain = report(&plain, &self.out, &plan.bounds);
        let mut code = self.runner.children.call(&mut plain)?;
        let mut table = Command::new(&self.runner.bench);
        table.arg("latency-table").arg(&made);
        if !spinning.is_empty() {
            let (out, log) = (self.out.join("spin"), self.out.join("spin.log"));
            let file = File::create(&log).map_err(FrontError::output(&log))?;
            let mut spinning = report(&spinning, &out, &plan.spin_bounds);
            match self.runner.children.call(spinning.stdout(file))? {
                0 => {}
                1 => {
                    let page = out.join("report.md");
                    self.front.warn(&format!(
                        "warning: a claim about the spinning runs is broken; see {}",
                        page.display()
                    ));
                    code = if code == 0 { 1 } else { code };
                }
                _ => self
                    .front
                    .warn(&format!("warning: no report of the spinning runs; see {}", log.display())),
            }
            if out.join(REPORT_JSON).is_file() {
                table.arg("--spin").arg(out.join(REPORT_JSON));
            }
        }
        if !made.is_file() {
            return Ok(code);
        }
        let file = self.out.join("table.md");
        let written = File::create(&file).map_err(FrontError::output(&file))?;
        if self.runner.children.call(table.args(["--made-by", &self.front.typed]).stdout(written))? != 0 {
            return Err(FrontError::Input("no table of ratios could be made".into()));
        }
        say(&format!("\n{}", last_lines(&file, usize::MAX)));
        let interrupted = self.runner.children.interrupted();
        if let Some(checkout) = self.front.places.checkout().filter(|_| self.arguments.write && !interrupted)
        {
            // The marks in pages are replaced by the scripts.
            let put =
                "root=$1; . \"$root/scripts/tables.sh\"; put_table latency \"$2\" bench/docs/latency.md";
            let put = self
                .runner
                .children
                .call(Command::new("bash").args(["-euc", put, "bash"]).arg(checkout).arg(&file))?;
            code = if put == 0 { code } else { put };
        }
        Ok(if interrupted { Exit::Interrupted as u8 } else { code })
    }
}

/// Number of changed files of a source tree; `None` outside git.
fn uncommitted_files(checkout: &Path) -> Option<u64> {
    let listed = Command::new("git").arg("-C").arg(checkout).args(["status", "--porcelain"]).output().ok()?;
    listed.status.success().then(|| listed.stdout.iter().filter(|byte| **byte == b'\n').count() as u64)
}
