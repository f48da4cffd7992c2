//! What a run reads before it starts: rig, experiment and programs, checked; and the controllers made of them.

use crate::axis::{AxisController, AxisParts, ForcePlan, Plan, PlannedChange};
use crate::chains::main::{Lengths, MainConfig, approach_s};
use crate::chains::matching;
use crate::chains::settled::Bounds;
use crate::chains::{AfterStop, force};
use crate::experiment::{AxisExperiment, Experiment, Prepare, SetPoints};
use crate::parameter_set::{self, Setting};
use crate::program::file::Source;
use crate::program::{Program, Task};
use crate::set_point::ForceSource;
use algorithms::algorithm::Quantity;
use clap::Args;
use nominal::{Axis, RigParameters};
use protocol::frames::DRIVE_CHAIN_VALUES;
use runlog::run_folder;
use std::path::{Path, PathBuf};

/// A file that cannot be used, or files that do not go together: file, line, key, value and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct InputError(String);

impl InputError {
    fn of(error: impl ToString) -> Self {
        Self(error.to_string())
    }
}

/// What is controlled, how, and where the files go.
#[derive(Args, Clone, Debug, Default)]
pub struct FileArguments {
    /// Rig file, of which nominal numbers are read: valve characteristic, areas, stroke.
    #[arg(long)]
    pub rig: PathBuf,
    /// Experiment file: set-points, programs, settling, repetitions.
    #[arg(long)]
    pub experiment: PathBuf,
    /// Folder for the run's files, made if missing; give both programs the same. Default: a new one named by the time.
    #[arg(long, default_value_os_t = run_folder::new_folder())]
    pub out: PathBuf,
    /// Folder of the programs that the experiment names; by default "programs" beside the experiment's folder.
    #[arg(long)]
    pub programs: Option<PathBuf>,
    /// Program file of the drive, in place of the experiment's.
    #[arg(long)]
    pub drive_program: Option<PathBuf>,
    /// Program file of the load axis, in place of the experiment's.
    #[arg(long)]
    pub load_program: Option<PathBuf>,
    /// Parameter set that overrides the programs' parameters, as written by 'controller parameters' or XCP; --set overrides it.
    #[arg(long, value_name = "FILE")]
    pub parameters: Option<PathBuf>,
    /// A variable in place of the program's, such as drive.algorithm.gain_per_s=30; may be repeated.
    #[arg(long, value_name = "AXIS.TASK.NAME=VALUE")]
    pub set: Vec<String>,
    /// Repeat the experiment until the rig ends; never report Done.
    #[arg(long)]
    pub repeat: bool,
    /// What follows an emergency stop that was released, in place of the experiment's.
    #[arg(long, value_enum)]
    pub after_emergency_stop: Option<AfterStop>,
}

/// Rig, experiment and programs of a run.
pub struct Inputs {
    /// Numbers of the rig file, its effects among them; no controller reads those.
    pub rig: RigParameters,
    /// The rig file as it stands; empty where there is none.
    pub rig_toml: String,
    /// The experiment; what follows an emergency stop is the command line's, where that says it.
    pub experiment: Experiment,
    /// The experiment file as it stands.
    pub experiment_toml: String,
    /// Programs of drive and load, as they stand; `None` for an axis that the experiment leaves out.
    pub programs: [Option<Source>; 2],
    /// Variables set by a parameter set or on the command line, in this order.
    overrides: Vec<Setting>,
    experiment_file: PathBuf,
}

/// Circumstances of a run that no file holds.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// The other axis's controller is waited for, and its silence is a fault.
    pub partner_needed: bool,
    /// Time is real: an algorithm that takes too long is a fault.
    pub real_time: bool,
    /// The experiment is repeated until the rig ends.
    pub forever: bool,
}

impl Inputs {
    /// Reads the files that the command line names, and the experiment's programs. Programs are checked by [`Self::controller`].
    ///
    /// # Errors
    /// [`InputError`] for files that cannot be read or are wrong, a stroke beyond what the bus carries, and a variable of an axis
    /// that the experiment leaves out.
    pub fn read(files: &FileArguments) -> Result<Self, InputError> {
        let rig_toml = run_folder::read_text(&files.rig).map_err(InputError::of)?;
        let rig =
            RigParameters::from_toml(&rig_toml, &files.rig.display().to_string()).map_err(InputError::of)?;
        let (stroke_m, most_m) = (rig.cylinder().stroke_m, DRIVE_CHAIN_VALUES.signals[0].max);
        if stroke_m > most_m {
            let file = files.rig.display();
            return Err(InputError(format!(
                "{file}: cylinder.stroke_mm: {stroke_m} m; rig.dbc carries positions of at most {most_m} m"
            )));
        }
        let experiment_toml = run_folder::read_text(&files.experiment).map_err(InputError::of)?;
        let given = [&files.drive_program, &files.load_program];
        let source_of = |axis: Axis, section: &AxisExperiment| {
            let path = match (given[axis.index()], &files.programs) {
                (Some(path), _) => path.clone(),
                (None, Some(folder)) if !section.program.written.ends_with(".toml") => {
                    folder.join(format!("{}.toml", section.program.written))
                }
                (None, _) => section.program_path(&files.experiment),
            };
            Source::read(&path).map_err(|error| {
                let place = format!("{}:{}", files.experiment.display(), section.program.line);
                InputError(format!("{place}: program of the {} axis: {error}", axis.name()))
            })
        };
        let mut inputs = Self::without_overrides(rig, &files.experiment, experiment_toml, source_of)?;
        inputs.rig_toml = rig_toml;
        let run = &mut inputs.experiment.run;
        run.after_emergency_stop = files.after_emergency_stop.unwrap_or(run.after_emergency_stop);
        if let Some(path) = &files.parameters {
            inputs.overrides = parameter_set::read(path).map_err(InputError::of)?;
        }
        inputs.set(&files.set)?;
        if let Some(Setting { axis, name, place, .. }) =
            inputs.overrides.iter().find(|setting| inputs.programs[setting.axis.index()].is_none())
        {
            let axis = axis.name();
            return Err(InputError(format!(
                "{place}{axis}.{name}: {} has no [{axis}], so that axis has no variables",
                files.experiment.display()
            )));
        }
        Ok(inputs)
    }

    fn without_overrides(
        rig: RigParameters,
        file: &Path,
        experiment_toml: String,
        source_of: impl Fn(Axis, &AxisExperiment) -> Result<Source, InputError>,
    ) -> Result<Self, InputError> {
        let experiment =
            Experiment::from_toml(&experiment_toml, file, rig.cylinder().stroke_m).map_err(InputError::of)?;
        let mut programs = [None, None];
        for (axis, section) in sections(&experiment) {
            programs[axis.index()] = Some(source_of(axis, section)?);
        }
        let (rig_toml, overrides, experiment_file) = (String::new(), Vec::new(), file.to_owned());
        Ok(Self { rig, rig_toml, experiment, experiment_toml, programs, overrides, experiment_file })
    }

    fn set(&mut self, texts: &[impl AsRef<str>]) -> Result<(), InputError> {
        for text in texts {
            self.overrides.push(parse_override(text.as_ref())?);
        }
        Ok(())
    }

    /// The same for texts that no file holds: an experiment under a name for messages, and the text of a program by its name.
    ///
    /// # Errors
    /// [`InputError`] as for files, and for a program that `text_of` does not know.
    pub fn of_texts(
        rig: &RigParameters,
        (name, experiment_toml): (&str, &str),
        text_of: impl Fn(&str) -> Option<String>,
        set: &[&str],
    ) -> Result<Self, InputError> {
        let source_of = |_, written: &str| {
            text_of(written).map(|text| Source { path: written.into(), title: written.to_owned(), text })
        };
        Self::of_sources(rig, (Path::new(name), experiment_toml), source_of, set)
    }

    /// The same for an experiment whose text is not that of its file, which tables are read beside, and for programs by axis and
    /// by what the experiment names.
    ///
    /// # Errors
    /// [`InputError`] as for files, and for a program that `source_of` does not know.
    pub fn of_sources(
        rig: &RigParameters,
        (file, experiment_toml): (&Path, &str),
        source_of: impl Fn(Axis, &str) -> Option<Source>,
        set: &[impl AsRef<str>],
    ) -> Result<Self, InputError> {
        let source_of = |axis, section: &AxisExperiment| {
            let written = &section.program.written;
            source_of(axis, written)
                .ok_or_else(|| InputError(format!("{}: no program {written} is known here", file.display())))
        };
        let mut inputs = Self::without_overrides(rig.clone(), file, experiment_toml.to_owned(), source_of)?;
        inputs.set(set)?;
        Ok(inputs)
    }

    /// A controller of `axis` before its first cycle; of an axis that the experiment leaves out, one that holds the valve shut.
    ///
    /// # Errors
    /// [`InputError`] for a program that is wrong or does not control the quantity of the set-points, for set-points of forces
    /// without `[giving-way]`, and for overrides and planned changes that the variables of the program do not allow.
    pub fn controller(&self, axis: Axis, mode: Mode) -> Result<AxisController, InputError> {
        let section =
            sections(&self.experiment).find(|(other, _)| *other == axis).map(|(_, section)| section);
        let mut program = self.program(axis, mode.real_time)?;
        self.check_kind(axis, section, &program)?;
        for Setting { name, value, place: at, .. } in self.overrides.iter().filter(|one| one.axis == axis) {
            let reported = |error: String| InputError(format!("{at}{error}"));
            let place = place(&program, axis, name).map_err(|error| reported(error.to_string()))?;
            program.set(place, *value).map_err(|error| reported(format!("{}.{error}", axis.name())))?;
        }
        let changes = section.map_or(Ok(Vec::new()), |section| self.changes(axis, section, &program))?;
        let main = self.main_config(section, &program, mode);
        Ok(AxisController::new(AxisParts {
            axis,
            program,
            plan: section.map_or(Plan::Shut, plan),
            main,
            supply_pressure_pa: self.rig.supply().pressure_pa,
            changes,
            record_every: u64::from(self.experiment.record_every_cycles),
        }))
    }

    /// The program of an axis; one that nothing is asked of for an axis that the experiment leaves out.
    fn program(&self, axis: Axis, real_time: bool) -> Result<Program, InputError> {
        let shut = Source::shut();
        let source = self.programs[axis.index()].as_ref().unwrap_or(&shut);
        source.program(axis, &self.rig, real_time).map_err(InputError::of)
    }

    /// Title of the program of an axis; `valve held shut` where the experiment leaves the axis out.
    pub fn program_title(&self, axis: Axis) -> String {
        self.programs[axis.index()]
            .as_ref()
            .map_or_else(|| Source::shut().title, |source| source.title.clone())
    }

    fn check_kind(
        &self,
        axis: Axis,
        section: Option<&AxisExperiment>,
        program: &Program,
    ) -> Result<(), InputError> {
        let Some(section) = section else { return Ok(()) };
        let (asked, able) = (section.set_points.quantity(), program.controls());
        if asked != able {
            return Err(InputError(format!(
                "{}:{}: the {} axis has set-points of {}s, and its program controls {}s; choose another program",
                self.experiment_file.display(),
                section.program.line,
                axis.name(),
                asked.name(),
                able.name()
            )));
        }
        // An axis that presses gives way too: on linked rods while the drive is positioned, to relieve stress, to a hand.
        if asked == Quantity::Position || program.has_force_chain_slot() {
            return Ok(());
        }
        let source = self.programs[axis.index()].as_ref();
        Err(InputError(format!(
            "{}: no [giving-way]: the {} axis has set-points of forces ({}:{}), and its force chain needs an algorithm to \
             relieve stress and to give way; add\n[giving-way]\nname = \"force-manual\"",
            source.map_or(Path::new("(none)"), |source| source.path.as_path()).display(),
            axis.name(),
            self.experiment_file.display(),
            section.program.line,
        )))
    }

    fn changes(
        &self,
        axis: Axis,
        section: &AxisExperiment,
        program: &Program,
    ) -> Result<Vec<PlannedChange>, InputError> {
        let planned = section.changes.iter().map(|change| {
            let at = format!("{}:{}", self.experiment_file.display(), change.line);
            let place = place(program, axis, &change.parameter)
                .map_err(|error| InputError(format!("{at}: {error}")))?;
            let value = program.variables()[place]
                .parameter
                .check_change(change.value)
                .map_err(|error| InputError(format!("{at}: {error}")))?;
            Ok(PlannedChange { at_s: change.at_s, place, value })
        });
        planned.collect()
    }

    fn main_config(&self, section: Option<&AxisExperiment>, program: &Program, mode: Mode) -> MainConfig {
        let run = &self.experiment.run;
        let all: Vec<_> = sections(&self.experiment).map(|(_, section)| lengths(section, program)).collect();
        let most = |of: fn(&Lengths) -> f64| all.iter().map(of).fold(0.0, f64::max);
        MainConfig {
            experiment: self.experiment.number,
            partner_needed: mode.partner_needed,
            start_m: section.and_then(|section| match &section.set_points {
                SetPoints::Positions(motion) => Some(motion.start_m()),
                SetPoints::Forces(_) => None,
            }),
            prepares: section.is_some_and(|section| !section.prepare.is_empty()),
            lengths: Lengths {
                // Both axes end together, whichever has the longer row.
                experiment_s: self.experiment.duration_s(),
                ..section.map_or(Lengths::default(), |section| lengths(section, program))
            },
            longest_lengths: Lengths {
                prepare_s: most(|lengths| lengths.prepare_s),
                initial_force_s: most(|lengths| lengths.initial_force_s),
                experiment_s: self.experiment.duration_s(),
            },
            approach_longest_s: approach_s(0.0, self.rig.cylinder().stroke_m),
            repetitions: (!mode.forever).then_some(run.repetitions()),
            settling_s: run.numbers.settling_s,
            settling_timeout_s: run.numbers.settling_timeout_s,
            start: run.start,
            after_emergency_stop: run.after_emergency_stop,
            settled: Bounds::of(program.task(Task::Settled)),
        }
    }
}

/// Axes that the experiment speaks of.
fn sections(experiment: &Experiment) -> impl Iterator<Item = (Axis, &AxisExperiment)> {
    let sections = [(Axis::Drive, &experiment.drive), (Axis::Load, &experiment.load)];
    sections.into_iter().filter_map(|(axis, section)| Some((axis, section.as_ref()?)))
}

/// How long the states before the experiment may take.
fn lengths(section: &AxisExperiment, program: &Program) -> Lengths {
    let step_s = |step: &Prepare| match step {
        Prepare::Relieve => force::Parameters::of(program.task(Task::ForceChain)).relieve_timeout_s,
        Prepare::Match => matching::Parameters::of(program.task(Task::MatchingChain)).match_timeout_s,
    };
    let ramps = section.initial_force_n() > 0.0;
    Lengths {
        prepare_s: section.prepare.iter().map(step_s).sum(),
        initial_force_s: if ramps { section.force.initial_ramp_s } else { 0.0 },
        experiment_s: section.set_points.duration_s(),
    }
}

fn plan(section: &AxisExperiment) -> Plan {
    match &section.set_points {
        SetPoints::Positions(motion) => Plan::Position { motion: motion.clone(), by_hand: section.by_hand },
        SetPoints::Forces(profile) => Plan::Force(ForcePlan {
            source: ForceSource::new(profile.clone()),
            initial_ramp_s: section.force.initial_ramp_s,
            prepare: section.prepare.clone(),
            manual: section.manual,
            by_hand: section.by_hand,
        }),
    }
}

fn place(program: &Program, axis: Axis, name: &str) -> Result<usize, InputError> {
    program.place(name).ok_or_else(|| {
        let known: Vec<_> = program.variables().iter().map(|variable| variable.name.as_str()).collect();
        InputError(format!("{}.{name}: no such variable; there are {}", axis.name(), known.join(", ")))
    })
}

fn parse_override(text: &str) -> Result<Setting, InputError> {
    let parse = || {
        let (name, value) = text.split_once('=')?;
        let (axis, name) = name.split_once('.')?;
        let axis = Axis::ALL.into_iter().find(|known| known.name() == axis)?;
        let (name, value) = (name.trim().to_owned(), value.trim().parse().ok()?);
        Some(Setting { axis, name, value, place: "--set ".into() })
    };
    parse().ok_or_else(|| {
        InputError(format!(
            "--set {text}: expected AXIS.TASK.NAME=NUMBER, such as drive.algorithm.gain_per_s=30"
        ))
    })
}

#[cfg(test)]
mod tests;
