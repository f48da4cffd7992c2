//! `airbench find-effect`: hides an effect in the rig, measures over the bus, runs the workflow, adds the named effect to the
//! model, compares the gaps, and opens the seal.
//!
//! ```text
//!   emulator seal ──► measured: fitted, held-out ──► discrepancy close ──► baseline and extended: fitted, held-out
//!                                                                           ──► repeated: held-out ──► bench compare ──► judge
//! ```

mod judge;

use crate::children::Children;
use crate::cli::FindEffectArguments;
use crate::pair::{PairError, ProgramPair};
use crate::private::RunBus;
use crate::{Front, FrontError, last_lines, logs, make_folder, say};
use protocol::exit::Exit;
use runlog::Axis;
use runlog::run_folder::{REPORT_HTML, REPORT_JSON, TRUTH_CSV};
use std::ffi::OsStr;
use std::fs::{self, DirBuilder, File};
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The searches of a command, one rig after the other.
struct Search<'a> {
    arguments: &'a FindEffectArguments,
    children: Children,
    out: PathBuf,
    bus: String,
    bench: PathBuf,
    emulator: PathBuf,
    controller: PathBuf,
    discrepancy: PathBuf,
    rig: PathBuf,
    /// Content of --hidden, in place of a draw.
    hidden: Option<String>,
    programs: PathBuf,
    /// Experiments of the fit and of the comparison, with the names of their folders.
    experiments: [(&'static str, PathBuf); 2],
}

/// Runs the searches. Returns the exit code.
pub(crate) fn find_effect(arguments: &FindEffectArguments, front: &Front) -> Result<u8, FrontError> {
    if arguments.lockstep && arguments.bus.as_ref().is_some_and(|bus| bus.starts_with("can://")) {
        let bus = arguments.bus.as_deref().unwrap_or_default();
        return Err(FrontError::Input(format!("--bus {bus}: lockstep needs an embedded bus")));
    }
    let experiment = |option: &str, name: &Path| {
        front.experiment(name, |name| format!("{option} {name}: no such experiment"))
    };
    let fitted = experiment("--experiment", &arguments.experiment)?;
    let held_out = match &arguments.held_out {
        Some(name) => experiment("--held-out", name)?,
        None => front.places.data("held-out.toml")?,
    };
    let of_environment = std::env::var_os("AIRBENCH_DISCREPANCY").filter(|program| !program.is_empty());
    let discrepancy = match arguments.discrepancy.clone().or(of_environment.map(PathBuf::from)) {
        Some(program) if !is_program(&program) => {
            return Err(FrontError::Input(format!("--discrepancy {}: no program", program.display())));
        }
        Some(program) => program,
        None => front.places.program("discrepancy")?,
    };
    let first = format!("seed-{}", arguments.seed);
    let out = front.results(arguments.out.as_deref(), "find-effect", ("search", first.as_str()))?;
    let read = |file: &PathBuf| fs::read_to_string(file).map_err(FrontError::input(file));
    let hidden = arguments.hidden.as_ref().map(read).transpose()?;
    arguments.suspects.as_ref().map(read).transpose()?;
    let bus = RunBus::of_its_own(arguments.bus.as_deref(), arguments.lockstep)?;
    let mut search = Search {
        children: Children::watch()?,
        out,
        bus: bus.url.clone(),
        bench: front.places.program("bench")?,
        emulator: front.places.program("emulator")?,
        controller: front.places.program("controller")?,
        discrepancy,
        rig: front.places.data("rig.toml")?,
        hidden,
        programs: front.places.data("programs")?,
        experiments: [("fitted", fitted), ("held-out", held_out)],
        arguments,
    };
    let mut right = 0;
    for seed in arguments.seed..arguments.seed + arguments.count {
        right += u64::from(search.one(seed)?);
    }
    if arguments.count > 1 {
        say(&format!("{right} of {} right", arguments.count));
    }
    let expected = !arguments.expect_right || right == arguments.count;
    Ok(if expected { Exit::Good } else { Exit::BoundBroken } as u8)
}

fn is_program(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| found.is_file() && found.permissions().mode() & 0o111 != 0)
}

/// Options that end the initial positioning by time, whatever a hidden effect does to standstill and error, so that all runs of
/// an experiment have the same times. An axis without set-points has no settling.
fn without_settling(experiment: &str) -> Vec<String> {
    let driven = Axis::NAMES
        .into_iter()
        .filter(|axis| experiment.lines().any(|line| line.starts_with(&format!("[{axis}]"))));
    let limits = ["still_m=0.1", "position_error_m=0.5", "force_error_n=2000"];
    driven.flat_map(|axis| limits.map(|limit| format!("{axis}.settled.{limit}"))).collect()
}

impl Search<'_> {
    /// The search of one rig; returns whether the hidden effects were named.
    fn one(&mut self, seed: u64) -> Result<bool, FrontError> {
        let folder = self.out.join(format!("seed-{seed}"));
        let hidden = folder.join("hidden");
        make_folder(&folder)?;
        DirBuilder::new().mode(0o700).create(&hidden).map_err(FrontError::output(&hidden))?;
        say(&format!("== seed {seed}: files in {}", folder.display()));
        let sealed = hidden.join("sealed.toml");
        match &self.hidden {
            Some(text) => fs::write(&sealed, text).map_err(FrontError::output(&sealed))?,
            // Nothing was measured: the folder is removed for another try, unless it has other files.
            None => self.draw(seed, &sealed).inspect_err(|_| {
                drop(fs::remove_dir_all(&hidden));
                drop(fs::remove_dir(&folder));
            })?,
        }
        for ((name, file), noise) in self.experiments.clone().iter().zip([1000, 2000]) {
            say(&format!("measuring {name} on the sealed rig …"));
            // With independent noise, as of two measurements.
            self.sealed(&folder, &format!("{name}/measured"), file, noise + seed)?;
        }
        say("identifying the missing effect …");
        let workflow = folder.join("workflow");
        self.close(&folder, &workflow)?;
        for (name, file) in self.experiments.clone() {
            say(&format!("running {name} without the effect and with the extended model …"));
            self.baseline(&folder.join(name).join("baseline"), name, &file)?;
            let extended = workflow.join("rig.toml");
            if !extended.is_file() {
                let workflow = workflow.display();
                return Err(FrontError::Process(format!("discrepancy close left no rig.toml in {workflow}")));
            }
            // With the noise of the baseline, so that the models differ by the added effect alone.
            self.drive(&folder.join(name).join("extended"), &file, &extended, 1, &[])?;
        }
        say("measuring held-out on the sealed rig once more …");
        let (name, file) = self.experiments[1].clone();
        self.sealed(&folder, "held-out/repeated", &file, 1)?;
        let mut compare = Command::new(&self.bench);
        compare.args(["compare", "--differences"]);
        compare.args(["measured", "baseline", "extended", "repeated"].map(|run| folder.join(name).join(run)));
        self.call(compare.arg("--out").arg(folder.join("gap.html")), "no picture of the gap")?;

        let report = judge::read(&workflow.join(REPORT_JSON))?;
        let sealed = fs::read_to_string(&sealed).map_err(FrontError::input(&sealed))?;
        let judgement = judge::judge(&sealed, &report)?;
        let path = folder.join("told.txt");
        fs::write(&path, judgement.lines.join("\n") + "\n").map_err(FrontError::output(&path))?;
        judgement.lines.iter().for_each(|line| say(&format!("  {line}")));
        say(&format!("  report: {}", workflow.join(REPORT_HTML).display()));
        Ok(judgement.right)
    }

    /// Draws the hidden effects.
    fn draw(&mut self, seed: u64, sealed: &Path) -> Result<(), FrontError> {
        let mut seal = Command::new(&self.emulator);
        seal.args(["seal", "--seed", &seed.to_string(), "--effects", &self.arguments.effects.to_string()]);
        seal.args(["--axis", &self.arguments.axis, "--out"]).arg(sealed).stdout(Stdio::null());
        let code = self.children.call(&mut seal)?;
        self.check_interrupt()?;
        match code {
            0 => Ok(()),
            // It knows the catalogue and has reported the reason.
            2 => Err(FrontError::Input(format!("--effects {}: cannot be drawn", self.arguments.effects))),
            _ => Err(FrontError::Process("emulator seal failed".into())),
        }
    }

    /// A run of the rig with the hidden effects of the folder's sealed file.
    fn sealed(&mut self, folder: &Path, name: &str, file: &Path, noise: u64) -> Result<(), FrontError> {
        let (run, hidden) = (folder.join(name), folder.join("hidden"));
        let (rig, sealed) = (self.rig.clone(), hidden.join("sealed.toml"));
        self.drive(&run, file, &rig, noise, &[OsStr::new("--sealed"), sealed.as_os_str()])?;
        // Its names are the terms of the hidden effects.
        let truth = hidden.join(format!("truth-{}.csv", name.replace('/', "-")));
        fs::rename(run.join(TRUTH_CSV), &truth).map_err(FrontError::output(&truth))
    }

    /// Without the effect all rigs are equal: run once, and copied for the others.
    fn baseline(&mut self, run: &Path, name: &str, file: &Path) -> Result<(), FrontError> {
        let kept = self.out.join("baseline").join(name);
        if kept.is_dir() {
            return copy_folder(&kept, run);
        }
        let rig = self.rig.clone();
        self.drive(run, file, &rig, 1, &[])?;
        if self.arguments.count > 1 { copy_folder(run, &kept) } else { Ok(()) }
    }

    /// Makes a run in a folder. The controllers have the parameters of the shipped rig in every run.
    fn drive(
        &mut self,
        run: &Path,
        file: &Path,
        rig: &Path,
        noise: u64,
        more: &[&OsStr],
    ) -> Result<(), FrontError> {
        let experiment = fs::read_to_string(file).map_err(FrontError::input(file))?;
        let pace = if self.arguments.lockstep { &["--pace", "lockstep"][..] } else { &[] };
        let mut pair =
            ProgramPair::new([&self.emulator, &self.controller], [rig, &self.rig], file, run, &self.bus);
        pair.emulator.args(["--seed", &noise.to_string()]).args(pace).args(more);
        pair.controller.arg("--programs").arg(&self.programs).args(pace);
        pair.controller.args(without_settling(&experiment).iter().flat_map(|variable| ["--set", variable]));
        let console = pair.run(&mut self.children).map_err(|error| match error {
            PairError::Failed { code, console } => {
                eprintln!("{}", last_lines(&console, 5));
                FrontError::Process(format!("a run failed with code {code}; see {}", console.display()))
            }
            PairError::Other(error) => error,
        })?;
        self.check_interrupt()?;
        let (out, error) = logs(File::options().append(true).open(&console), &console)?;
        let mut summary = Command::new(&self.bench);
        summary.arg("summary").arg(run).stdout(out).stderr(error);
        // Bounds of an experiment are for the baseline and do not matter here.
        match self.children.call(&mut summary)? {
            0 | 1 => self.check_interrupt(),
            _ => Err(FrontError::Process(format!("no summary of {}", run.display()))),
        }
    }

    /// Runs the workflow.
    fn close(&mut self, folder: &Path, workflow: &Path) -> Result<(), FrontError> {
        make_folder(workflow)?;
        let console = workflow.join("console.log");
        let (out, error) = logs(File::create(&console), &console)?;
        let measured = |name: &str| folder.join(name).join("measured/measurement.csv");
        let mut close = Command::new(&self.discrepancy);
        close.arg("close").arg("--rig").arg(&self.rig).arg("--train").arg(measured("fitted"));
        close.arg("--test").arg(measured("held-out")).arg("--out").arg(workflow);
        if let Some(suspects) = &self.arguments.suspects {
            close.arg("--suspects").arg(suspects);
        }
        let code = self.children.call(close.stdout(out).stderr(error))?;
        self.check_interrupt()?;
        if code != 0 {
            eprintln!("{}", last_lines(&console, 5));
            return Err(FrontError::Process(format!("discrepancy close failed; see {}", console.display())));
        }
        Ok(())
    }

    fn call(&mut self, command: &mut Command, otherwise: &str) -> Result<(), FrontError> {
        let code = self.children.call(command)?;
        self.check_interrupt()?;
        if code == 0 { Ok(()) } else { Err(FrontError::Process(otherwise.into())) }
    }

    fn check_interrupt(&self) -> Result<(), FrontError> {
        if self.children.interrupted() { Err(FrontError::Interrupted) } else { Ok(()) }
    }
}

fn copy_folder(from: &Path, to: &Path) -> Result<(), FrontError> {
    make_folder(to)?;
    for entry in fs::read_dir(from).map_err(FrontError::input(from))?.flatten() {
        let (path, copy) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy_folder(&path, &copy)?;
        } else {
            fs::copy(&path, &copy).map_err(FrontError::output(&copy))?;
        }
    }
    Ok(())
}
