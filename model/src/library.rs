//! Libraries of suspects: laws in variables of their own, which a model file binds to its names.
//!
//! ```text
//!   suspects/friction.toml: excess*direction*exp(-abs(v)/velocity)     use = "friction/stribeck", with.v = "speed"
//!        ──► excess*sign(speed)*exp(-abs(speed)/velocity), its numbers with it, at a place of the model
//! ```
//! A quantity of a library has the unit that it usually has, in which its values are written, and says of what it is made: where
//! `dimension = "place/v"` is another dimension in a model than that of the unit, the unit becomes the SI one of place over v,
//! and values other than 0 are the model's to give.

mod user;

pub use user::LibrarySuspect;

use crate::file::Change;
use crate::read::named;
use crate::units::{Dimension, Unit};
use expression::grammar::renamed;
use settings::{Result, Section, Source};
use std::path::Path;
use std::sync::OnceLock;

/// The libraries, by name.
const FILES: [(&str, &str); 8] = [
    ("friction", include_str!("../suspects/friction.toml")),
    ("stiffness", include_str!("../suspects/stiffness.toml")),
    ("damping", include_str!("../suspects/damping.toml")),
    ("actuator", include_str!("../suspects/actuator.toml")),
    ("sensor", include_str!("../suspects/sensor.toml")),
    ("flow", include_str!("../suspects/flow.toml")),
    ("electrical", include_str!("../suspects/electrical.toml")),
    ("heat", include_str!("../suspects/heat.toml")),
];

/// What a library calls the value without the suspect, and in dimensions what stands at its place.
pub(crate) const PLACE: &str = "place";

/// A library of suspects.
#[derive(Clone, Debug)]
pub struct Library {
    /// Its name, the first part of `use`; of a library of a user the path of its file as `use` has it.
    pub name: String,
    /// What its suspects are about.
    pub about: String,
    /// Unit that the place of a suspect usually has.
    pub place: Unit,
    /// Variables that a model binds to its names.
    pub variables: Vec<Variable>,
    /// Suspects, in the order of the file.
    pub entries: Vec<Entry>,
}

/// A variable of a library.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name in expressions of the library.
    pub name: String,
    /// What it means.
    pub about: String,
    /// Unit that it usually has.
    pub unit: Unit,
    /// Expression of other variables that stands for it where a model binds nothing to it.
    pub default: Option<String>,
}

/// A suspect of a library.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its name, the second part of `use`.
    pub name: String,
    /// Its law in words.
    pub about: String,
    /// How it changes its place.
    pub change: Change,
    /// The term, the factor or the replacement.
    pub expression: String,
    /// What it is one form of.
    pub effect: Option<String>,
    /// It acts in a part of what folds go over.
    pub is_local: bool,
    /// Numbers that a fit estimates.
    pub parameters: Vec<EntryParameter>,
    /// Differential states that it adds to the model.
    pub states: Vec<EntryState>,
    /// What it keeps over a step.
    pub memories: Vec<EntryMemory>,
    /// Its dry friction that sticks and slips.
    pub frictions: Vec<EntryFriction>,
}

/// A unit, and of what it is made.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// The unit that it usually has.
    pub unit: Unit,
    /// A product of variables and `place`; none where the unit is the same in every model.
    pub dimension: Option<String>,
}

/// A number of a suspect of a library.
#[derive(Clone, Debug)]
pub struct EntryParameter {
    /// As expressions of the entry write it.
    pub name: String,
    /// Unit, and of which variables it is made.
    pub quantity: Quantity,
    /// Values from which a fit starts, in SI.
    pub values_si: Vec<f64>,
    /// Least and largest value, in SI.
    pub range_si: [f64; 2],
    /// It is known and not fitted.
    pub is_fixed: bool,
}

/// A state of a suspect of a library.
#[derive(Clone, Debug)]
pub struct EntryState {
    /// As expressions of the entry write it.
    pub name: String,
    /// Unit, and of which variables it is made.
    pub quantity: Quantity,
    /// It starts at 0, or where the input or output at the place of the suspect starts.
    pub is_zero_at_start: bool,
    /// Its rate of change.
    pub derivative: String,
}

/// What a suspect of a library keeps over a step; it starts at 0.
#[derive(Clone, Debug)]
pub struct EntryMemory {
    /// As expressions of the entry write it.
    pub name: String,
    /// Unit, and of which variables it is made.
    pub quantity: Quantity,
    /// Its value after a step.
    pub update: String,
}

/// Dry friction of a suspect of a library.
#[derive(Clone, Debug)]
pub struct EntryFriction {
    /// What its force is called.
    pub name: String,
    /// Unit, and of which variables it is made.
    pub quantity: Quantity,
    /// The variable that it holds at rest; a model binds it to a state.
    pub velocity: String,
    /// Its size while it slides.
    pub sliding: String,
    /// What it holds at most.
    pub breakaway: String,
}

impl Library {
    /// The libraries that ship.
    ///
    /// # Panics
    /// Where a file is no library, which a test excludes.
    #[must_use]
    pub fn all() -> &'static [Self] {
        static ALL: OnceLock<Vec<Library>> = OnceLock::new();
        let read = |(name, text): &(&'static str, &str)| {
            library(name, text, Path::new(&format!("{name}.toml")))
                .unwrap_or_else(|error| panic!("a library that ships is one: {error}"))
        };
        ALL.get_or_init(|| FILES.iter().map(read).collect())
    }

    /// What `use = "LIBRARY/SUSPECT"` names.
    #[must_use]
    pub fn entry(used: &str) -> Option<(&'static Self, &'static Entry)> {
        let (library, suspect) = used.split_once('/')?;
        let library = Self::all().iter().find(|one| one.name == library)?;
        Some((library, library.entries.iter().find(|entry| entry.name == suspect)?))
    }

    /// The variables that a suspect uses, those of defaults too.
    #[must_use]
    pub fn variables_of(&self, entry: &Entry) -> Vec<&Variable> {
        let mut used: Vec<&Variable> = Vec::new();
        let mut texts = entry.texts();
        while let Some(text) = texts.pop() {
            for variable in &self.variables {
                let is_new = used.iter().all(|other| other.name != variable.name);
                if is_new && names(text).contains(&variable.name) {
                    used.push(variable);
                    texts.extend(variable.default.as_deref());
                }
            }
        }
        // In the order of the file.
        used.sort_by_key(|one| self.variables.iter().position(|variable| variable.name == one.name));
        used
    }
}

impl Entry {
    /// Whether it has a number of this name.
    #[must_use]
    pub fn has_parameter(&self, name: &str) -> bool {
        self.parameters.iter().any(|parameter| parameter.name == name)
    }

    /// Its expressions, and the names of what its friction holds.
    fn texts(&self) -> Vec<&str> {
        let states = self.states.iter().map(|state| state.derivative.as_str());
        let memories = self.memories.iter().map(|memory| memory.update.as_str());
        let frictions = self.frictions.iter();
        let frictions =
            frictions.flat_map(|one| [one.velocity.as_str(), one.sliding.as_str(), one.breakaway.as_str()]);
        states.chain(memories).chain(frictions).chain([self.expression.as_str()]).collect()
    }

    /// Whether it has a number, a state, a memory or a friction of this name.
    pub(crate) fn defines(&self, name: &str) -> bool {
        self.has_parameter(name)
            || self.states.iter().any(|state| state.name == name)
            || self.memories.iter().any(|memory| memory.name == name)
            || self.frictions.iter().any(|friction| friction.name == name)
    }

    /// Whether its expressions read the value that its place has without it.
    #[must_use]
    pub fn reads_place(&self) -> bool {
        self.texts().iter().any(|text| names(text).iter().any(|name| name == PLACE))
    }
}

impl Quantity {
    /// The unit in a model, and whether it is the usual one.
    pub(crate) fn unit_of(&self, of: &dyn Fn(&str) -> Dimension) -> (Unit, bool) {
        let Some(text) = &self.dimension else { return (self.unit.clone(), true) };
        let made = product(text, of);
        if made == self.unit.dimension {
            return (self.unit.clone(), true);
        }
        (Unit { text: made.to_string(), dimension: made, factor: 1.0 }, false)
    }
}

/// The dimension of a product such as `place/v^2`.
fn product(text: &str, of: &dyn Fn(&str) -> Dimension) -> Dimension {
    let mut made = Dimension::NONE;
    for (index, part) in text.split('/').enumerate() {
        for factor in part.split_whitespace().filter(|factor| *factor != "1") {
            let (name, power) = factor.split_once('^').unwrap_or((factor, "1"));
            let power = power.parse().unwrap_or(1.0);
            // One that no unit can have is refused where the expression is checked.
            let dimension = of(name).to_the(power).unwrap_or_default();
            made = if index == 0 { made.times(dimension) } else { made.over(dimension) };
        }
    }
    made
}

/// The names in an expression.
pub(crate) fn names(text: &str) -> Vec<String> {
    let found = std::cell::RefCell::new(Vec::new());
    let _ = renamed(text, &|part| {
        if part.starts_with(|first: char| first.is_alphabetic() || first == '_') {
            found.borrow_mut().push(part.to_owned());
        }
        None
    });
    found.into_inner()
}

fn library(name: &str, text: &str, file: &Path) -> Result<Library> {
    let source = Source::parse(text, file)?.with_columns();
    let mut root = source.root();
    let about = root.needed_text("about", "what it is about")?.text;
    let place = unit(&mut root, "unit")?;
    let mut variables = Vec::new();
    for (name, mut section) in named(&mut root, "variables")? {
        let about = section.needed_text("about", "what it means")?.text;
        let default = section.text("default")?.map(|text| text.text);
        variables.push(Variable { name, about, unit: unit(&mut section, "unit")?, default });
        section.finish()?;
    }
    let entries = root.sections("suspects")?.into_iter().map(entry).collect::<Result<_, _>>()?;
    root.finish()?;
    Ok(Library { name: name.to_owned(), about, place, variables, entries })
}

fn entry(mut section: Section<'_>) -> Result<Entry> {
    let name = section.needed_text("name", "the second part of use")?.text;
    let about = section.needed_text("about", "its law in words")?.text;
    let all = [("add", Change::Add), ("multiply", Change::Multiply), ("replace", Change::Replace)];
    let given = all.into_iter().find(|(key, _)| section.has(key));
    let (key, change) = given.ok_or_else(|| section.wrong("one of add, multiply, replace is missing"))?;
    let expression = section.needed_text(key, "an expression")?.text;
    let effect = section.text("effect")?.map(|text| text.text);
    let is_local = section.flag("local")?;
    let mut parameters = Vec::new();
    for (name, mut section) in named(&mut section, "parameters")? {
        let quantity = quantity(&mut section)?;
        let factor = quantity.unit.factor;
        let values_si = section.numbers("value")?.iter().map(|value| value * factor).collect();
        let range_si = match section.numbers("range")?.as_slice() {
            [least, most] => [least * factor, most * factor],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let is_fixed = section.flag("fixed")?;
        section.finish()?;
        parameters.push(EntryParameter { name, quantity, values_si, range_si, is_fixed });
    }
    let mut states = Vec::new();
    for (name, mut section) in named(&mut section, "states")? {
        let quantity = quantity(&mut section)?;
        let is_zero_at_start = section.choice("start", &[("zero", true), (PLACE, false)])?;
        let derivative = section.needed_text("derivative", "an expression")?.text;
        section.finish()?;
        states.push(EntryState { name, quantity, is_zero_at_start, derivative });
    }
    let mut memories = Vec::new();
    for (name, mut section) in named(&mut section, "memory")? {
        let quantity = quantity(&mut section)?;
        let update = section.needed_text("update", "an expression")?.text;
        section.finish()?;
        memories.push(EntryMemory { name, quantity, update });
    }
    let mut frictions = Vec::new();
    for (name, mut section) in named(&mut section, "friction")? {
        let quantity = quantity(&mut section)?;
        let mut text = |key| section.needed_text(key, "an expression").map(|text| text.text);
        let [velocity, sliding, breakaway] = [text("velocity")?, text("sliding")?, text("breakaway")?];
        section.finish()?;
        frictions.push(EntryFriction { name, quantity, velocity, sliding, breakaway });
    }
    section.finish()?;
    Ok(Entry { name, about, change, expression, effect, is_local, parameters, states, memories, frictions })
}

fn quantity(section: &mut Section<'_>) -> Result<Quantity> {
    Ok(Quantity { unit: unit(section, "unit")?, dimension: section.text("dimension")?.map(|text| text.text) })
}

fn unit(section: &mut Section<'_>, key: &str) -> Result<Unit> {
    let Some(text) = section.text(key)? else { return Ok(Unit::one()) };
    Unit::parse(&text.text).map_err(|error| section.wrong_at(key, &error.why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;

    /// A model with a place of the usual unit, everything that a suspect is bound to being an input.
    fn using(library: &Library, entry: &Entry) -> String {
        let inputs = library
            .variables
            .iter()
            .map(|variable| format!("[inputs.in_{}]\nunit = \"{}\"\n", variable.name, variable.unit.text));
        if let [friction] = entry.frictions.as_slice() {
            // It holds a state, in whose equation it stands.
            let velocity = &friction.velocity;
            return format!(
                "[inputs.was]\nunit = \"N\"\n[define]\nthere = \"was\"\n[states.in_{velocity}]\nunit = \"m/s\"\nstart = 0\n\
                 derivative = \"-there/1[kg]\"\n[outputs.o]\nunit = \"N\"\nvalue = \"was\"\n\
                 [[suspects]]\nuse = \"{}/{}\"\nplace = \"there\"\nwith.{velocity} = \"in_{velocity}\"\n",
                library.name, entry.name
            );
        }
        // What an input at its place would delay is the input itself.
        let is_input = entry.expression.contains("delay(u,");
        let place = if is_input { "in_u" } else { "there" };
        let with = library.variables_of(entry).into_iter().filter(|variable| variable.default.is_none());
        let with: String = with.map(|variable| format!("with.{0} = \"in_{0}\"\n", variable.name)).collect();
        let needed = entry.parameters.iter().filter(|one| one.values_si.is_empty());
        let needed: String =
            needed.map(|one| format!("parameters.{} = {{ value = 2 }}\n", one.name)).collect();
        // The play of a spring stands at a deflection, where others of its library stand at a force.
        let mut quantities = entry.parameters.iter().map(|one| &one.quantity);
        let of_place = quantities.find(|quantity| quantity.dimension.as_deref() == Some(PLACE));
        let unit = &of_place.map_or(&library.place, |quantity| &quantity.unit).text;
        format!(
            "{}[define]\nnothing = \"1\"\n[inputs.was]\nunit = \"{unit}\"\n[outputs.there]\nunit = \"{unit}\"\nvalue = \"was\"\n\
             [[suspects]]\nuse = \"{}/{}\"\nplace = \"{place}\"\n{with}{needed}",
            inputs.collect::<String>(),
            library.name,
            entry.name
        )
    }

    #[test]
    fn dimensions_are_made_of_what_the_suspect_is_bound_to() {
        for library in Library::all() {
            for entry in &library.entries {
                let variables = library.variables_of(entry);
                let known: Vec<&str> =
                    variables.iter().map(|one| one.name.as_str()).chain([PLACE, "time"]).collect();
                let quantities = entry.parameters.iter().map(|one| &one.quantity);
                let quantities = quantities.chain(entry.states.iter().map(|one| &one.quantity));
                let quantities = quantities.chain(entry.memories.iter().map(|one| &one.quantity));
                let quantities = quantities.chain(entry.frictions.iter().map(|one| &one.quantity));
                for text in quantities.filter_map(|quantity| quantity.dimension.as_ref()) {
                    let unknown = names(text).into_iter().find(|name| !known.contains(&name.as_str()));
                    assert_eq!(unknown, None, "{}/{}: {text}", library.name, entry.name);
                }
            }
        }
    }

    #[test]
    fn every_suspect_of_every_library_can_be_used_where_units_are_the_usual_ones() {
        for library in Library::all() {
            assert!(library.entries.len() >= 5, "{}", library.name);
            for entry in &library.entries {
                let text = using(library, entry);
                let model = Model::parse(&text, Path::new("m.toml"));
                let model =
                    model.unwrap_or_else(|error| panic!("{}/{}: {error}\n{text}", library.name, entry.name));
                for (parameter, number) in model.parameters.iter().zip(&entry.parameters) {
                    assert_eq!(parameter.unit.text, number.quantity.unit.text, "{}", entry.name);
                }
            }
        }
    }
}
