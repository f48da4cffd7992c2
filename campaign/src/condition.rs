//! Inputs of a run: the campaign's files with the values of the run.
//!
//! Rig and experiment are texts in the form of their files, so that processes and rehearsal read the same input. The simulated
//! rig has the values of the run; the controllers know the unchanged rig file, as they know a real rig.

use crate::edits::{self, EditError};
use crate::factor::{Changes, FaultNumber, FileChoice, NONE_HIDDEN, Value};
use crate::inputs::{CampaignInputs, RigFile, TextFile};
use crate::points::{Point, Points};
use axis_control::program::file::Source;
use plant::effects::draw::{AxisSelection, EffectSampler};
use plant::effects::sheet;
use plant::{Axis, RigParameters, Scene};
use std::fmt::Write as _;

#[derive(Debug)]
pub(crate) struct Condition<'s> {
    /// The rig that controllers know.
    pub nominal: &'s RigFile,
    pub rig: RigParameters,
    pub rig_toml: String,
    /// The experiment, with its path.
    pub experiment: &'s TextFile,
    /// Its text with the run's values.
    pub experiment_toml: String,
    /// How the rig is set up.
    pub scene: Scene,
    /// Programs in place of the experiment's.
    pub programs: [Option<&'s Source>; 2],
    /// Variables of controllers, as `--set` takes them.
    pub set: Vec<String>,
    /// Script of the faults; empty without any.
    pub faults_toml: String,
    /// Seed of the sensors' noise.
    pub seed: u64,
}

/// Values of a run that a file's reader rejects.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("run {run}: {message}")]
pub(crate) struct ConditionError {
    pub run: u64,
    /// Message of the reader.
    pub message: String,
}

pub(crate) fn condition<'s>(
    inputs: &'s CampaignInputs,
    points: &Points,
    point: &Point,
) -> Result<Condition<'s>, ConditionError> {
    let refused = |message: String| ConditionError { run: point.run, message };
    let mut sorted = ValuesByTarget::default();
    for (factor, value) in points.factors.iter().zip(&point.values) {
        sorted.take(&factor.changes, value, point);
    }
    let nominal = inputs.rig(sorted.file(FileChoice::Rig));
    let experiment = inputs.experiment(sorted.file(FileChoice::Experiment));
    let edited = |file: &TextFile, numbers: &[(String, f64)]| {
        let numbers = numbers.iter().map(|(path, number)| (path.as_str(), *number));
        edits::with(&file.text, numbers)
            .map_err(|error: EditError| refused(format!("{}: {error}", file.path.display())))
    };
    let rig_toml = edited(&nominal.file, &sorted.rig)?;
    let rig_name = nominal.file.path.display().to_string();
    let rig = RigParameters::from_toml(&rig_toml, &rig_name).map_err(|error| refused(error.to_string()))?;
    let experiment_toml = edited(experiment, &sorted.experiment)?;
    let file = experiment.path.display().to_string();
    let scene =
        Scene::from_toml(&experiment_toml, &file, &rig).map_err(|error| refused(error.to_string()))?;
    if scene.sealed.is_some() {
        return Err(refused(format!(
            "{file}: rig.sealed: a campaign says itself what is hidden, by choose = \"hidden\""
        )));
    }
    let program = |choice| sorted.file(choice).map(|name| inputs.chosen_program(name));
    Ok(Condition {
        programs: [program(FileChoice::DriveProgram), program(FileChoice::LoadProgram)],
        set: sorted.set.clone(),
        faults_toml: sorted.faults_toml(),
        seed: point.seed,
        nominal,
        rig,
        rig_toml,
        experiment,
        experiment_toml,
        scene,
    })
}

impl Condition<'_> {
    /// The program of an axis that the experiment calls `written`.
    pub(crate) fn program(&self, inputs: &CampaignInputs, axis: Axis, written: &str) -> Option<Source> {
        self.programs[axis.index()].or_else(|| inputs.program(written, self.experiment)).cloned()
    }
}

/// Values of a run, grouped by the file or program that they change.
#[derive(Default)]
struct ValuesByTarget<'p> {
    rig: Vec<(String, f64)>,
    experiment: Vec<(String, f64)>,
    set: Vec<String>,
    faults: Vec<(&'p FaultNumber, f64)>,
    files: Vec<(FileChoice, &'p str)>,
}

impl<'p> ValuesByTarget<'p> {
    fn take(&mut self, changes: &'p Changes, value: &'p Value, point: &Point) {
        match (changes, value) {
            (Changes::Rig(path), Value::Number(number)) => self.rig.push((path.clone(), *number)),
            (Changes::Experiment(path), Value::Number(number)) => {
                self.experiment.push((path.clone(), *number));
            }
            (Changes::Variable(name), Value::Number(number)) => self.set.push(format!("{name}={number}")),
            (Changes::Fault(fault), Value::Number(number)) => self.faults.push((fault, *number)),
            (Changes::File(choice), Value::Text(name)) => self.files.push((*choice, name)),
            (Changes::Hidden(among), Value::Text(name)) => {
                self.rig.extend(hidden(name, *among, point.hidden_seed));
            }
            // `factor.rs` checks that each kind of change has values of its type.
            _ => {}
        }
    }

    fn file(&self, choice: FileChoice) -> Option<&'p str> {
        self.files.iter().find(|(changed, _)| *changed == choice).map(|(_, name)| *name)
    }

    /// The fault script; numbers of one fault at one place form one entry.
    fn faults_toml(&self) -> String {
        let mut text = String::new();
        for (place, (fault, _)) in self.faults.iter().enumerate() {
            let same = |other: &FaultNumber| {
                (&other.fault, &other.at, other.from_s, other.to_s)
                    == (&fault.fault, &fault.at, fault.from_s, fault.to_s)
            };
            if self.faults[..place].iter().any(|(other, _)| same(other)) {
                continue;
            }
            // Writing to a text cannot fail.
            let _ = writeln!(text, "[[fault]]\nname = {:?}\nfrom_s = {:?}", fault.fault, fault.from_s);
            if let Some(at) = &fault.at {
                let _ = writeln!(text, "at = {at:?}");
            }
            if let Some(to_s) = fault.to_s {
                let _ = writeln!(text, "to_s = {to_s:?}");
            }
            for (fault_number, value) in self.faults.iter().filter(|(other, _)| same(other)) {
                let _ = writeln!(text, "{} = {value}", fault_number.key);
            }
        }
        text
    }
}

/// Paths and numbers of a hidden effect in a rig file; empty without an effect.
fn hidden(name: &str, among: AxisSelection, seed: u64) -> Vec<(String, f64)> {
    let Some(sheet) = sheet(name).filter(|_| name != NONE_HIDDEN) else { return Vec::new() };
    let mut sampler = EffectSampler::new(seed);
    // The reader of the campaign file checked that the effect exists at such a place.
    let Some(place) = sampler.place(sheet, among) else { return Vec::new() };
    let numbers = sampler.numbers(sheet);
    let path = |key: &str| format!("effects.{name}.{place}.{key}");
    sheet.keys.iter().zip(numbers).map(|(key, number)| (path(key.name), number)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::{CampaignFile, Kind};
    use std::path::Path;

    fn read(text: &str) -> (CampaignInputs, Points) {
        let file = CampaignFile::from_toml(text, Path::new("c.toml")).unwrap();
        let Kind::Experiment(kind) = &file.kind else { panic!("an experiment") };
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../controller");
        let inputs = CampaignInputs::read(&file, kind, &shipped).unwrap();
        (inputs, Points::new(&file.factors, file.draws, file.seed).unwrap())
    }

    #[test]
    fn values_reach_the_simulated_rig_and_the_controllers_keep_the_nominal_one() {
        let (inputs, points) = read(
            "title = \"t\"\nexperiment = \"step\"\n\
             [[vary]]\nrig = \"friction.sliding_force_n\"\nlist = [20]\n\
             [[vary]]\nrig = \"effects.valve-offset.drive.offset_percent\"\nlist = [1.5]\n\
             [[vary]]\nexperiment = \"rig.added_mass_kg\"\nlist = [10]\n\
             [[vary]]\nset = \"drive.algorithm.gain_per_s\"\nlist = [30.5]\n\
             [[vary]]\nchoose = \"drive-program\"\nlist = [\"position-cascade\"]\n",
        );
        let condition = condition(&inputs, &points, &points.point(0)).unwrap();
        assert_eq!(condition.rig.friction().sliding_force_n, 20.0);
        assert_eq!(condition.nominal.nominal.friction().sliding_force_n, 26.0);
        assert_eq!(condition.rig.effects().len(), 1);
        assert_eq!(condition.scene.added_mass_kg, 10.0);
        assert_eq!(condition.set, ["drive.algorithm.gain_per_s=30.5"]);
        let program = condition.program(&inputs, Axis::Drive, "position-p").unwrap();
        assert!(program.path.ends_with("position-cascade.toml"));
    }

    #[test]
    fn a_hidden_effect_is_drawn_by_the_run_and_none_is_none() {
        let (inputs, points) = read(
            "title = \"t\"\nexperiment = \"step\"\ndraws = 3\n\
             [[vary]]\nchoose = \"hidden\"\nlist = [\"none\", \"rod-leakage\"]\n",
        );
        let effects = |run| {
            let point = points.point(run);
            condition(&inputs, &points, &point).unwrap().rig.effects().to_vec()
        };
        assert!(effects(0).is_empty());
        assert_eq!(effects(3)[0].name, "rod-leakage");
        assert_ne!(effects(3)[0].numbers, effects(4)[0].numbers);
    }

    #[test]
    fn a_value_that_the_rig_cannot_have_is_refused_with_the_run() {
        let (inputs, points) = read(
            "title = \"t\"\nexperiment = \"step\"\n[[vary]]\nrig = \"friction.sliding_force_n\"\nlist = [26, 1e6]\n",
        );
        let error = condition(&inputs, &points, &points.point(1)).unwrap_err();
        assert!(
            error.to_string().contains("run 1: rig.toml:") && error.message.contains("sliding_force_n"),
            "{error}"
        );
    }

    #[test]
    fn numbers_of_one_fault_make_one_entry_of_the_script() {
        let (inputs, points) = read(
            "title = \"t\"\nexperiment = \"step\"\npace = \"lockstep\"\n\
             [[vary]]\nfault = \"position-sensor-spike\"\nat = \"drive\"\nkey = \"spike_m\"\nfrom_s = 1\nlist = [0.1]\n\
             [[vary]]\nfault = \"position-sensor-spike\"\nat = \"drive\"\nkey = \"every_ms\"\nfrom_s = 1\nlist = [50]\n",
        );
        let text = condition(&inputs, &points, &points.point(0)).unwrap().faults_toml;
        assert_eq!(
            text,
            "[[fault]]\nname = \"position-sensor-spike\"\nfrom_s = 1.0\nat = \"drive\"\nspike_m = 0.1\nevery_ms = 50\n"
        );
    }
}
