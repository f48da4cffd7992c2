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

use super::{EVERY_CYCLES, GivingWay, Program, Slot, Variable};
use crate::chains::{force, matching, settled};
use crate::post_controller::{self, Output, PostController};
use crate::pre_controller::{self, Geometry, PreController};
use algorithms::algorithm::{Algorithm, Quantity};
use algorithms::guard::Guarded;
use algorithms::linearisation::{Law, Linearisation};
use nominal::{Axis, RigParameters};
use realtime::MonotonicClock;
use serde::Deserialize;
use settings::parameters::Parameter;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A program file that cannot be used: file, line, key, value and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ProgramError(String);

type Section = BTreeMap<String, Spanned<toml::Value>>;

/// Texts of a program by their full key, such as `algorithm.name`.
pub type FixedSettings = BTreeMap<String, String>;

const LINEARISATION: &str = "post-controller.linearisation";

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct File {
    title: String,
    #[serde(default)]
    pre_controller: Section,
    algorithm: Spanned<Section>,
    #[serde(default)]
    post_controller: Section,
    giving_way: Option<Spanned<Section>>,
    #[serde(default)]
    force_chain: Section,
    #[serde(default)]
    matching_chain: Section,
    #[serde(default)]
    settled: Section,
}

#[derive(Clone, Debug, serde::Serialize)]
pub struct Source {
    pub path: PathBuf,
    pub title: String,
    pub text: String,
}

impl Source {
    pub fn read(path: &Path) -> Result<Self, ProgramError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| ProgramError(format!("cannot read {}: {error}", path.display())))?;
        let mut source = Self { path: path.into(), title: String::new(), text };
        source.title = source.parse()?.title;
        Ok(source)
    }

    /// The program of an axis of which nothing is asked.
    pub fn shut() -> Self {
        let text = "title = \"valve held shut\"\n[algorithm]\nname = \"position-p\"\n";
        Self { path: "(none)".into(), title: "valve held shut".into(), text: text.into() }
    }

    fn parse(&self) -> Result<File, ProgramError> {
        toml::from_str(&self.text).map_err(|error| ProgramError(format!("{}: {error}", self.path.display())))
    }

    /// What the file says besides numbers, by its full key: what a program is made of, and cannot change while it runs.
    pub fn makings(&self) -> Result<FixedSettings, ProgramError> {
        let File { algorithm, post_controller, giving_way, .. } = self.parse()?;
        let giving_way = giving_way.map(Spanned::into_inner).unwrap_or_default();
        let sections = [
            ("algorithm", algorithm.into_inner()),
            ("giving-way", giving_way),
            ("post-controller", post_controller),
        ];
        let mut makings =
            FixedSettings::from([(LINEARISATION.to_owned(), Law::ChokedExhaust.name().to_owned())]);
        for (name, section) in sections {
            for (key, value) in section {
                if let toml::Value::String(text) = value.into_inner() {
                    makings.insert(format!("{name}.{key}"), text);
                }
            }
        }
        Ok(makings)
    }

    /// The program of `axis` that the file describes, for a rig of these nominal numbers. The time that an algorithm takes is
    /// watched where it is `real_time`.
    pub fn program(&self, axis: Axis, rig: &RigParameters, real_time: bool) -> Result<Program, ProgramError> {
        let file = self.parse()?;
        let mut reader = Reader { source: self, rig, real_time, variables: Vec::new(), values: Vec::new() };
        let pre = reader.section("pre-controller", file.pre_controller, pre_controller::Parameters::TABLE)?;
        let user = reader.slot("algorithm", file.algorithm)?;
        let mut section = file.post_controller;
        let linearisation = reader.linearisation(section.remove("linearisation"))?;
        let post = reader.section("post-controller", section, post_controller::Parameters::TABLE)?;
        let giving_way = file.giving_way.map(|section| reader.giving_way(section)).transpose()?;
        let force_chain = reader.section(force::TABLE, file.force_chain, force::Parameters::TABLE)?;
        let matching_chain =
            reader.section(matching::TABLE, file.matching_chain, matching::Parameters::TABLE)?;
        let settled = reader.section(settled::TABLE, file.settled, settled::Bounds::TABLE)?;
        let Reader { variables, values, .. } = reader;
        Ok(Program {
            pre: PreController::new(Geometry::new(axis, rig.cylinder().stroke_m)),
            post: PostController::new(linearisation),
            user,
            giving_way,
            variables,
            values,
            tasks: [pre, post, force_chain, matching_chain, settled],
            ready: algorithms::algorithm::Ready::default(),
            observed: None,
            post_stepped: None,
            output: Output::default(),
        })
    }
}

/// Collects variables and their values, section by section.
struct Reader<'a> {
    source: &'a Source,
    rig: &'a RigParameters,
    real_time: bool,
    variables: Vec<Variable>,
    values: Vec<f64>,
}

impl Reader<'_> {
    fn error(&self, place: usize, problem: &str) -> ProgramError {
        let line = settings::line_of(&self.source.text, place);
        ProgramError(format!("{}:{line}: {problem}", self.source.path.display()))
    }

    /// Takes the values of `table` out of the section called `name`; what is left in it is nobody's.
    fn section(
        &mut self,
        name: &str,
        mut section: Section,
        table: &[Parameter],
    ) -> Result<Range<usize>, ProgramError> {
        let first = self.values.len();
        for parameter in table {
            let value = match section.remove(parameter.name.as_ref()) {
                None => parameter.default,
                Some(entry) => {
                    let place = entry.span().start;
                    let value = settings::number_of(entry.as_ref()).ok_or_else(|| {
                        self.error(
                            place,
                            &format!("{name}.{} = {}: not a number", parameter.name, entry.as_ref()),
                        )
                    })?;
                    parameter.check(value).map_err(|error| self.error(place, &format!("{name}.{error}")))?
                }
            };
            self.values.push(value);
            self.variables
                .push(Variable { name: format!("{name}.{}", parameter.name), parameter: parameter.clone() });
        }
        if let Some((key, entry)) = section.first_key_value() {
            let known: Vec<_> = table.iter().map(|parameter| parameter.name.as_ref()).collect();
            let problem = format!("{name}.{key}: no such parameter; there are {}", known.join(", "));
            return Err(self.error(entry.span().start, &problem));
        }
        Ok(first..self.values.len())
    }

    fn slot(&mut self, name: &str, section: Spanned<Section>) -> Result<Slot, ProgramError> {
        let place = section.span().start;
        let mut section = section.into_inner();
        let asked = self.take_text(&format!("{name}.name"), section.remove("name"))?;
        let library = self.take_text(&format!("{name}.library"), section.remove("library"))?;
        let (algorithm, controls, parameters): (Box<dyn Algorithm>, _, _) = match (asked, library) {
            (Some(asked), None) => {
                let kind = algorithms::by_name(asked.as_ref()).ok_or_else(|| {
                    let problem = format!("{name}.name = \"{}\"; there are {}", asked.as_ref(), names());
                    self.error(asked.span().start, &problem)
                })?;
                ((kind.make)(self.rig), kind.controls, kind.parameters.to_vec())
            }
            (None, Some(library)) => {
                let folder = self.source.path.parent().unwrap_or(Path::new(""));
                let plugin = plugin::load(&folder.join(library.as_ref()), self.rig)
                    .map_err(|error| self.error(library.span().start, &format!("{name}.library: {error}")))?;
                let description = plugin.description().clone();
                (Box::new(plugin), description.controls, description.parameters)
            }
            _ => {
                let problem = format!("[{name}] has one of name and library; names are {}", names());
                return Err(self.error(place, &problem));
            }
        };
        let table: Vec<_> =
            std::iter::once(Parameter::declared("every_cycles", EVERY_CYCLES)).chain(parameters).collect();
        let values = self.section(name, section, &table)?;
        let clock = self.real_time.then(|| Box::new(MonotonicClock) as _);
        let algorithm = Guarded::new(algorithm, clock);
        Ok(Slot { algorithm, controls, values, stepped: None, wanted_m_per_s: 0.0 })
    }

    fn giving_way(&mut self, section: Spanned<Section>) -> Result<GivingWay, ProgramError> {
        let place = section.span().start;
        let slot = self.slot("giving-way", section)?;
        let find = |name: &str| {
            let name = format!("giving-way.{name}");
            self.variables[slot.values.clone()].iter().position(|variable| variable.name == name)
        };
        match (slot.controls, find("moving"), find("limit_m_per_s")) {
            (Quantity::Force, Some(moving), Some(limit_m_per_s)) => {
                let effective = self.values[slot.values.clone()].to_vec();
                Ok(GivingWay { slot, moving, limit_m_per_s, decided: (false, None), effective })
            }
            _ => Err(self.error(
                place,
                "[giving-way] needs an algorithm of force with the parameters moving and limit_m_per_s, such as force-manual",
            )),
        }
    }

    fn linearisation(&self, asked: Option<Spanned<toml::Value>>) -> Result<Linearisation, ProgramError> {
        let asked = self.take_text(LINEARISATION, asked)?;
        let law = match &asked {
            None => Law::ChokedExhaust,
            Some(asked) => Law::by_name(asked.as_ref()).ok_or_else(|| {
                let names = Law::ALL.map(Law::name).join(", ");
                let problem = format!("{LINEARISATION} = \"{}\"; there are {names}", asked.as_ref());
                self.error(asked.span().start, &problem)
            })?,
        };
        Ok(Linearisation::new(self.rig, law))
    }

    fn take_text(
        &self,
        key: &str,
        entry: Option<Spanned<toml::Value>>,
    ) -> Result<Option<Spanned<String>>, ProgramError> {
        let Some(entry) = entry else { return Ok(None) };
        let span = entry.span();
        match entry.into_inner() {
            toml::Value::String(text) => Ok(Some(Spanned::new(span, text))),
            other => Err(self.error(span.start, &format!("{key} = {other}: not a text in quotes"))),
        }
    }
}

fn names() -> String {
    algorithms::SHIPPED.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::{Demand, Hand};
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

    fn program(text: &str) -> Result<Program, ProgramError> {
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
    fn what_is_wrong_is_told_with_file_line_key_value_and_what_is_allowed() {
        for (good, bad, hints) in [
            (
                "gain_per_s = 20",
                "gain_per_s = 300",
                ["p.toml:7", "algorithm.gain_per_s = 300", "0 to 200 1/s"],
            ),
            ("every_cycles = 2", "every_cycles = 2.5", ["p.toml:6", "every_cycles = 2.5", "a whole number"]),
            ("gain_per_s = 20", "gain_per_s = nan", ["p.toml:7", "NaN", "0 to 200"]),
            ("gain_per_s = 20", "gain = 20", ["p.toml:7", "algorithm.gain: no such", "gain_per_s"]),
            ("gain_per_s = 20", "gain_per_s = \"20\"", ["p.toml:7", "gain_per_s", "not a number"]),
            ("\"position-p\"", "\"position-q\"", ["p.toml:5", "position-q", "position-p"]),
            ("\"choked-exhaust\"", "\"magic\"", ["p.toml:9", "magic", "choked-exhaust"]),
            (
                "name = \"position-p\"\n",
                "",
                ["p.toml:4", "[algorithm] has one of name and library", "position-p"],
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
        let _ = program.control(cycle, &demand, Hand::User).unwrap();
        program.wanted_m_per_s(Hand::User)
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
