//! Reads a program file.
//!
//! ```toml
//! title = "P with velocity feed-forward, as in the paper"
//! [pre-controller]
//! velocity_filter_hz = 60.0
//! [algorithm]
//! name = "position-p"
//! gain_per_s = 25.0
//! [post-controller]
//! linearisation = "choked-exhaust"
//! [giving-way]                     # optional: the algorithm that the force chain uses, to relieve and for a hand
//! name = "force-manual"
//! [force-chain]                    # numbers of the chains
//! high_force_n = 150.0
//! [matching-chain]
//! [settled]
//! ```
//!
//! What is left out takes the default of its table. In place of a name, `library = "FILE"`, from the program's folder, takes the
//! algorithm of a shared library (controller/docs/own-algorithm.md).

use super::{AlgorithmSlot, EVERY_CYCLES, ForceChainSlot, Program, Variable};
use crate::chains::{force, matching, settled};
use crate::post_controller::{self, Output, PostController};
use crate::pre_controller::{self, Geometry, PreController};
use algorithms::algorithm::{Algorithm, Quantity};
use algorithms::guard::Guarded;
use algorithms::linearisation::{Law, Linearisation};
use nominal::{Axis, RigParameters};
use realtime::MonotonicClock;
use settings::parameters::Parameter;
use settings::{Section, SettingsError};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Texts of a program by their full key, such as `algorithm.name`.
pub type FixedSettings = BTreeMap<String, String>;

const LINEARISATION: &str = "post-controller.linearisation";

/// Keys of the file itself.
const KEYS: [&str; 8] = [
    "title",
    "pre-controller",
    "algorithm",
    "post-controller",
    "giving-way",
    force::TABLE,
    matching::TABLE,
    settled::TABLE,
];

/// The text of a program file; [`Self::program`] checks it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Source {
    /// Path of the file, for messages; the program's libraries are found from its folder.
    pub path: PathBuf,
    /// Name for people; [`Self::read`] takes it from the key `title`.
    pub title: String,
    /// Content of the file.
    pub text: String,
}

impl Source {
    /// Reads the file and its title.
    ///
    /// # Errors
    /// [`SettingsError`] for a file that cannot be read, TOML that does not parse, unknown sections, and no title.
    pub fn read(path: &Path) -> Result<Self, SettingsError> {
        let text = std::fs::read_to_string(path).map_err(|error| SettingsError::unreadable(path, &error))?;
        let title =
            root(&settings::Source::parse(&text, path)?)?.needed_text("title", "what it is called")?;
        Ok(Self { path: path.into(), title: title.text, text })
    }

    /// The program of an axis without a request.
    pub fn shut() -> Self {
        let text = "title = \"valve held shut\"\n[algorithm]\nname = \"position-p\"\n";
        Self { path: "(none)".into(), title: "valve held shut".into(), text: text.into() }
    }

    /// Settings of the file other than numbers, by full key: they are fixed while the program runs.
    ///
    /// # Errors
    /// [`SettingsError`] for TOML that does not parse, unknown sections, and a section that is no table.
    pub fn fixed_settings(&self) -> Result<FixedSettings, SettingsError> {
        let source = settings::Source::parse(&self.text, &self.path)?;
        let mut root = root(&source)?;
        let mut fixed_settings =
            FixedSettings::from([(LINEARISATION.to_owned(), Law::ChokedExhaust.name().to_owned())]);
        for name in ["algorithm", "giving-way", "post-controller"] {
            let section = root.section_or_empty(name)?;
            for key in section.keys() {
                if let Some(text) = section.peek(&key) {
                    fixed_settings.insert(format!("{name}.{key}"), text.to_owned());
                }
            }
        }
        Ok(fixed_settings)
    }

    /// The program of `axis` that the file describes, for a rig of these nominal numbers. The time that an algorithm takes is
    /// checked where it is `real_time`.
    ///
    /// # Errors
    /// [`SettingsError`] for unknown keys and algorithms, values out of range, a library that cannot be loaded, and an algorithm
    /// of `[giving-way]` that does not control a force or lacks the parameters `moving` and `limit_m_per_s`.
    pub fn program(
        &self,
        axis: Axis,
        rig: &RigParameters,
        real_time: bool,
    ) -> Result<Program, SettingsError> {
        let source = settings::Source::parse(&self.text, &self.path)?;
        let mut root = root(&source)?;
        let _ = root.needed_text("title", "what it is called")?;
        let mut reader = Reader { rig, real_time, variables: Vec::new(), values: Vec::new() };
        let pre =
            reader.section(root.section_or_empty("pre-controller")?, pre_controller::Parameters::TABLE)?;
        let user = reader.slot(root.needed_section("algorithm", "its name and its numbers")?)?;
        let mut section = root.section_or_empty("post-controller")?;
        let law = section.choice("linearisation", &Law::ALL.map(|law| (law.name(), law)))?;
        let post = reader.section(section, post_controller::Parameters::TABLE)?;
        let force_chain_slot =
            root.section("giving-way")?.map(|section| reader.force_chain_slot(section)).transpose()?;
        let force_chain = reader.section(root.section_or_empty(force::TABLE)?, force::Parameters::TABLE)?;
        let matching_chain =
            reader.section(root.section_or_empty(matching::TABLE)?, matching::Parameters::TABLE)?;
        let settled = reader.section(root.section_or_empty(settled::TABLE)?, settled::Bounds::TABLE)?;
        let Reader { variables, values, .. } = reader;
        Ok(Program {
            pre: PreController::new(Geometry::new(axis, rig.cylinder().stroke_m)),
            post: PostController::new(Linearisation::new(rig, law)),
            user_slot: user,
            force_chain_slot,
            variables,
            values,
            tasks: [pre, post, force_chain, matching_chain, settled],
            input: algorithms::algorithm::AlgorithmInput::default(),
            observed_cycle: None,
            post_stepped_cycle: None,
            output: Output::default(),
        })
    }
}

/// The whole file, if it has no other keys.
fn root<'a>(source: &'a settings::Source<'a>) -> Result<Section<'a>, SettingsError> {
    let root = source.root();
    root.allow(&KEYS)?;
    Ok(root)
}

/// Collects variables and their values, section by section.
struct Reader<'a> {
    rig: &'a RigParameters,
    real_time: bool,
    variables: Vec<Variable>,
    values: Vec<f64>,
}

impl Reader<'_> {
    /// Reads the values of `table`, the rest of the section.
    fn section(
        &mut self,
        mut section: Section<'_>,
        table: &[Parameter],
    ) -> Result<Range<usize>, SettingsError> {
        let first = self.values.len();
        for parameter in table {
            self.values.push(section.number_or_default(parameter)?);
            let name = format!("{}.{}", section.path(), parameter.name);
            self.variables.push(Variable { name, parameter: parameter.clone() });
        }
        section.finish()?;
        Ok(first..self.values.len())
    }

    fn slot(&mut self, mut section: Section<'_>) -> Result<AlgorithmSlot, SettingsError> {
        let (name, library) = (section.text("name")?, section.text("library")?);
        let (algorithm, controls, parameters): (Box<dyn Algorithm>, _, _) = match (name, library) {
            (Some(name), None) => {
                let kind = algorithms::by_name(&name.text).ok_or_else(|| {
                    let problem = format!("name = \"{}\"; allowed is {}", name.text, names());
                    section.wrong_at("name", &problem)
                })?;
                ((kind.make)(self.rig), kind.controls, kind.parameters.to_vec())
            }
            (None, Some(library)) => {
                let plugin = plugin::load(&section.sibling_path(&library.text), self.rig)
                    .map_err(|error| section.wrong_at("library", &format!("library: {error}")))?;
                let description = plugin.description.clone();
                (Box::new(plugin), description.controls, description.parameters)
            }
            _ => {
                let problem = format!("name or library, one of both, is needed; names are {}", names());
                return Err(section.wrong(&problem));
            }
        };
        let table: Vec<_> =
            std::iter::once(Parameter::declared("every_cycles", EVERY_CYCLES)).chain(parameters).collect();
        let values = self.section(section, &table)?;
        let clock = self.real_time.then(|| Box::new(MonotonicClock) as _);
        let algorithm = Guarded::new(algorithm, clock);
        Ok(AlgorithmSlot { algorithm, controls, values, stepped_cycle: None, wanted_m_per_s: 0.0 })
    }

    fn force_chain_slot(&mut self, section: Section<'_>) -> Result<ForceChainSlot, SettingsError> {
        let unfit = section.wrong(
            "name: an algorithm of force with the parameters moving and limit_m_per_s is needed, such as force-manual",
        );
        let slot = self.slot(section)?;
        let find = |name: &str| {
            let name = format!("giving-way.{name}");
            self.variables[slot.values.clone()].iter().position(|variable| variable.name == name)
        };
        let (Quantity::Force, Some(moving_index), Some(limit_index)) =
            (slot.controls, find("moving"), find("limit_m_per_s"))
        else {
            return Err(unfit);
        };
        let effective = self.values[slot.values.clone()].to_vec();
        Ok(ForceChainSlot { slot, moving_index, limit_index, chain_output: (false, None), effective })
    }
}

fn names() -> String {
    algorithms::SHIPPED.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::{ActiveAlgorithm, Demand};
    use crate::set_point::{ForceSetPoint, SetPoint};
    use protocol::frames::Sensors;

    const GOOD: &str = r#"title = "t"
[pre-controller]
velocity_filter_hz = 50.0
[algorithm]
name = "position-p"
every_cycles = 2
gain_per_s = 20
[post-controller]
linearisation = "choked-exhaust"
opening_limit = 0.5
"#;

    fn source(text: &str) -> Source {
        Source { path: "p.toml".into(), title: "t".into(), text: text.into() }
    }

    fn program(text: &str) -> Result<Program, SettingsError> {
        source(text).program(Axis::Drive, &RigParameters::baseline(), false)
    }

    #[test]
    fn what_is_left_out_takes_its_default() {
        let program = program(GOOD).unwrap();
        let value = |name| program.values()[program.place(name).unwrap()];
        assert_eq!(value("algorithm.gain_per_s"), 20.0);
        assert_eq!(value("algorithm.every_cycles"), 2.0);
        assert_eq!(value("algorithm.velocity_feed_forward"), 1.0);
        assert_eq!(value("pre-controller.velocity_filter_hz"), 50.0);
        assert_eq!(value("post-controller.dead_zone_m_per_s"), 0.0);
    }

    #[test]
    fn a_bad_value_is_refused_with_file_line_key_value_and_what_is_allowed() {
        for (good, bad, hints) in [
            (
                "gain_per_s = 20",
                "gain_per_s = 300",
                ["p.toml:7", "algorithm.gain_per_s = 300", "0 to 200 1/s"],
            ),
            ("every_cycles = 2", "every_cycles = 2.5", ["p.toml:6", "every_cycles = 2.5", "a whole number"]),
            ("gain_per_s = 20", "gain_per_s = nan", ["p.toml:7", "NaN", "0 to 200"]),
            ("gain_per_s = 20", "gain = 20", ["p.toml:7", "unknown key algorithm.gain;", "gain_per_s"]),
            (
                "gain_per_s = 20",
                "gain_per_s = \"20\"",
                ["p.toml:7", "algorithm.gain_per_s = \"20\"", "allowed is a number"],
            ),
            ("\"position-p\"", "\"position-q\"", ["p.toml:5", "position-q", "position-p"]),
            ("\"choked-exhaust\"", "\"magic\"", ["p.toml:9", "magic", "choked-exhaust"]),
            (
                "name = \"position-p\"\n",
                "",
                ["p.toml:4", "algorithm.name or library, one of both", "position-p"],
            ),
            ("[post-controller]", "[past-controller]", ["p.toml", "past-controller", "post-controller"]),
        ] {
            assert!(GOOD.contains(good));
            let Err(error) = program(&GOOD.replace(good, bad)) else { panic!("{bad} was taken") };
            for hint in hints {
                assert!(error.to_string().contains(hint), "'{hint}' is missing in: {error}");
            }
        }
    }

    fn wanted(program: &mut Program, cycle: u64, position_m: f64) -> f64 {
        program.observe(cycle, &Sensors { position_m, ..Sensors::default() }, 7e5);
        let demand = Demand { position: SetPoint::at_rest(0.2), force: ForceSetPoint::at_rest(0.0) };
        let _ = program.control(cycle, &demand, ActiveAlgorithm::User).unwrap();
        program.wanted_m_per_s(ActiveAlgorithm::User)
    }

    #[test]
    fn the_algorithm_runs_in_its_own_multiple_which_may_change() {
        let mut program = program(GOOD).unwrap();
        let fresh = |program: &mut Program, cycle: u64| {
            let now = 20.0 * (0.2 - 0.001 * cycle as f64);
            (wanted(program, cycle, 0.001 * cycle as f64) - now).abs() < 1e-12
        };
        let first = [0, 1, 2, 3, 4, 5].map(|cycle| fresh(&mut program, cycle));
        assert_eq!(first, [true, false, true, false, true, false]);
        let place = program.place("algorithm.every_cycles").unwrap();
        program.set(place, 3.0).unwrap();
        let second = [6, 7, 8, 9, 10, 11, 12].map(|cycle| fresh(&mut program, cycle));
        assert_eq!(second, [false, true, false, false, true, false, false]);
    }

    #[test]
    fn a_parameter_changes_between_two_cycles_and_a_bad_value_changes_nothing() {
        let mut program = program(GOOD).unwrap();
        assert!((wanted(&mut program, 0, 0.1) - 2.0).abs() < 1e-12);
        let place = program.place("algorithm.gain_per_s").unwrap();
        program.set(place, 10.0).unwrap();
        assert!(program.set(place, 1e9).is_err());
        assert!((wanted(&mut program, 2, 0.1) - 1.0).abs() < 1e-12);
    }
}
