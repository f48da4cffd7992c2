//! Reads `[[suspects]]` and `[[terms]]`: written out, or from a library with its variables bound.

use super::Reader;
use crate::check::{dimension, target_dimension};
use crate::file::{Change, Expression, Memory, Parameter, Start, State, Suspect, Target};
use crate::library::{Entry, EntryFriction, Library, LibrarySuspect, PLACE, Quantity};
use crate::names::{Symbol, marked_name, named_parts};
use crate::units::{Dimension, Unit};
use expression::grammar::{Binding, ExpressionError, Kind, NodeId, is_name_character, renamed};
use settings::{Result, Section, SettingsError, Text};
use std::path::Path;

/// A suspect of a library in a model, and what its variables are bound to.
struct LibraryBinding<'a> {
    entry: &'a Entry,
    index: usize,
    target: Target,
    /// Where the file names the library: what goes wrong in its expressions goes wrong there.
    at: usize,
    bound: Vec<(&'a str, NodeId)>,
    /// Text that each variable is bound to, as the file has it.
    texts: Vec<(&'a str, String)>,
    /// Dimensions of the variables, of the place and of time.
    dimensions: Vec<(&'a str, Dimension)>,
}

impl LibraryBinding<'_> {
    fn unit(&self, quantity: &Quantity) -> (Unit, bool) {
        let of = |name: &str| self.dimensions.iter().find(|(other, _)| *other == name);
        quantity.unit_of(&|name| of(name).map_or(Dimension::NONE, |(_, dimension)| *dimension))
    }

    /// What is bound to a name of the library's expressions.
    fn binding(&self, name: &str) -> Option<Binding> {
        let variable = self.bound.iter().find(|(variable, _)| *variable == name);
        let part = || self.entry.defines(name).then(|| Binding::Name(marked_name(name)));
        variable.map(|(_, place)| Binding::Expression(*place)).or_else(part)
    }

    /// An expression of the library in the words of the file.
    fn written(&self, text: &str) -> String {
        let of = |name: &str| self.texts.iter().find(|(variable, _)| *variable == name);
        let written = renamed(text, &|name| of(name).map(|(_, text)| text.clone()));
        // `abs(v)` has its brackets already.
        let doubled = self.texts.iter().map(|(_, text)| text).filter(|text| text.starts_with('('));
        doubled.fold(written, |written, text| written.replace(&format!("({text})"), text))
    }
}

/// Where an expression is put in place of a name: in brackets unless it is a name, a number or a call.
fn bracketed(text: &str) -> String {
    let name = text.find(|character| !is_name_character(character)).unwrap_or(text.len());
    let mut depth = 0_i32;
    let closes = text.find(|character| {
        depth += i32::from(character == '(') - i32::from(character == ')');
        character == ')' && depth == 0
    });
    let is_call = name > 0 && text[name..].starts_with('(') && closes == Some(text.len() - 1);
    if name == text.len() || is_call { text.to_owned() } else { format!("({text})") }
}

impl Reader<'_> {
    pub(super) fn suspect(&mut self, mut section: Section<'_>, is_term: bool) -> Result<()> {
        let index = self.model.suspects.len();
        let used = section.text("use")?;
        let found = used.as_ref().map(|used| self.found(used)).transpose()?;
        let library = found.as_ref().map(|found| (&*found.library, found.entry()));
        let name = match (&library, section.text("name")?) {
            (_, Some(name)) => name.text,
            (Some((_, entry)), None) => entry.name.clone(),
            (None, None) => section.needed_text("name", "what reports call it")?.text,
        };
        if self.model.suspects.iter().any(|other| other.name == name) {
            return Err(section.wrong_at("name", "name: the name is taken by another suspect"));
        }
        let place = section.needed_text("place", "the input, state, definition or output that it changes")?;
        let target = self.target(&place)?;
        let (twins, is_decoy) = (section.texts("twins")?, section.flag("decoy")?);
        let effect = section.text("effect")?.map(|text| text.text);
        let is_local = section.flag("local")?;
        let (change, expression, effect, is_local) = match library.zip(used.as_ref()) {
            Some(((library, entry), used)) => {
                let effect = effect.or_else(|| entry.effect.clone());
                let expression = self.instance(&mut section, (library, entry), (index, target, used.at))?;
                (entry.change, expression, effect, is_local || entry.is_local)
            }
            None => {
                let (change, expression) = self.written_out(&mut section, index)?;
                (change, expression, effect, is_local)
            }
        };
        section.finish()?;
        let library = used.map(|used| used.text);
        self.model.suspects.push(Suspect {
            name,
            target,
            change,
            expression,
            is_term,
            effect,
            is_local,
            library,
            twins,
            is_decoy,
        });
        Ok(())
    }

    /// A suspect whose law the file has.
    fn written_out(&mut self, section: &mut Section<'_>, index: usize) -> Result<(Change, Expression)> {
        self.members(section, Some(index))?;
        let mut found = None;
        for (key, change) in
            [("add", Change::Add), ("multiply", Change::Multiply), ("replace", Change::Replace)]
        {
            let Some(text) = section.text(key)? else { continue };
            if found.is_some() {
                return Err(
                    section.wrong_at(key, &format!("{key}: a suspect has one of add, multiply, replace"))
                );
            }
            found = Some((change, self.expression(text)?));
        }
        found.ok_or_else(|| {
            section.wrong("one of add, multiply, replace is missing: what the suspect does at its place")
        })
    }

    fn found(&self, used: &Text) -> Result<LibrarySuspect> {
        let folder = self.model.file.parent().unwrap_or(Path::new(""));
        Library::find(&used.text, folder)
            .map_err(|why| self.source.wrong_from(used.at, &format!("use: {why}")))
    }

    /// The expression of a suspect of a library, whose numbers, states and memories become those of the model.
    fn instance(
        &mut self,
        section: &mut Section<'_>,
        (library, entry): (&Library, &Entry),
        (index, target, at): (usize, Target, usize),
    ) -> Result<Expression> {
        if entry.reads_place() && matches!(target, Target::State(_)) {
            let name = &entry.name;
            return Err(section.wrong_at(
                "place",
                &format!("place: {name} changes an input, a definition or an output; this is a state"),
            ));
        }
        let (texts, dimensions) = (Vec::new(), vec![("time", Dimension::TIME)]);
        let mut bound = LibraryBinding { entry, index, target, at, bound: Vec::new(), texts, dimensions };
        let mut of_place = target_dimension(&self.model, target).map_err(|wrong| self.wrong(&wrong))?;
        let times = match section.text("times")? {
            Some(_) if entry.change != Change::Add => {
                return Err(section.wrong_at("times", "times: a factor or a replacement has none"));
            }
            Some(text) => {
                let times = self.expression(text)?;
                let factor = dimension(&self.model, times.root).map_err(|wrong| self.wrong(&wrong))?;
                of_place = of_place.over(factor);
                Some(times)
            }
            None => None,
        };
        bound.dimensions.push((PLACE, of_place));
        if !matches!(target, Target::State(_)) {
            let name = self.model.target_name(target).to_owned();
            let place = self.model.nodes.name(&name, at).map_err(|wrong| self.wrong(&wrong))?;
            bound.bound.push((PLACE, place));
            bound.texts.push((PLACE, name));
        }
        self.bind(section, library, &mut bound)?;
        self.numbers(section, &bound)?;
        self.states(section, &bound)?;
        for memory in &entry.memories {
            let update = self.of_library(&bound, &memory.update)?;
            let (name, unit) = (memory.name.clone(), bound.unit(&memory.quantity).0);
            let (start_si, start, suspect) = (0.0, None, Some(index));
            self.model.memories.push(Memory { name, unit, start_si, start, update, suspect });
        }
        for friction in &entry.frictions {
            self.friction_of_library(&bound, friction)?;
        }
        let mut expression = self.of_library(&bound, &entry.expression)?;
        if let Some(times) = times {
            let product = self.model.nodes.product(times.root, expression.root, at);
            expression.root = product.map_err(|wrong| self.wrong(&wrong))?;
            expression.text = format!("{}*({})", times.text, expression.text);
        }
        Ok(expression)
    }

    /// A friction of a library, which holds the state that its variable is bound to.
    fn friction_of_library(&mut self, bound: &LibraryBinding<'_>, friction: &EntryFriction) -> Result<()> {
        let variable = &friction.velocity;
        let place = bound.bound.iter().find(|(name, _)| name == variable).map(|(_, place)| *place);
        let node = self.model.nodes.get(place.expect("a test binds each of a library")).clone();
        let Kind::Name(state) = node.kind else {
            let why = format!("with.{variable}: friction holds a state at rest: allowed is the name of one");
            return Err(self.source.wrong_from(node.at, &why));
        };
        let sliding = self.of_library(bound, &friction.sliding)?;
        let breakaway = self.of_library(bound, &friction.breakaway)?;
        let named = (friction.name.clone(), bound.unit(&friction.quantity).0);
        self.friction(named, (&state, node.at), [sliding, breakaway], Some(bound.index))
    }

    fn wrong(&self, wrong: &ExpressionError) -> SettingsError {
        self.source.wrong_from(wrong.at, &wrong.why)
    }

    /// Binds the variables that the suspect uses.
    fn bind<'b>(
        &mut self,
        section: &mut Section<'_>,
        library: &'b Library,
        bound: &mut LibraryBinding<'b>,
    ) -> Result<()> {
        let variables = library.variables_of(bound.entry);
        let mut with = section.section("with")?;
        let mut without = Vec::new();
        for variable in &variables {
            let given = with.as_mut().map(|with| with.text(&variable.name)).transpose()?.flatten();
            match (given, &variable.default) {
                (Some(text), _) => {
                    let expression = self.expression(text)?;
                    let text = bracketed(&expression.text);
                    self.put(bound, &variable.name, (expression.root, text))?;
                }
                (None, Some(default)) => without.push((&variable.name, default)),
                (None, None) => {
                    let (name, about, unit) = (&variable.name, &variable.about, &variable.unit.text);
                    let why = format!("with.{name} is missing: {about}, usually in {unit}");
                    return Err(section.wrong(&why));
                }
            }
        }
        if let Some(with) = with {
            with.finish()?;
        }
        for (name, default) in without {
            let expression = self.of_library(bound, default)?;
            self.put(bound, name, (expression.root, bracketed(&expression.text)))?;
        }
        Ok(())
    }

    fn put<'b>(
        &self,
        bound: &mut LibraryBinding<'b>,
        name: &'b str,
        (root, text): (NodeId, String),
    ) -> Result<()> {
        let measured = dimension(&self.model, root).map_err(|wrong| self.wrong(&wrong))?;
        bound.bound.push((name, root));
        bound.texts.push((name, text));
        bound.dimensions.push((name, measured));
        Ok(())
    }

    fn of_library(&mut self, bound: &LibraryBinding<'_>, text: &str) -> Result<Expression> {
        let root = self.model.nodes.parse_bound(text, bound.at, &|name| bound.binding(name));
        let root = root.map_err(|wrong| self.wrong(&wrong))?;
        Ok(Expression { text: bound.written(text), root, at: bound.at })
    }

    /// The numbers of a suspect of a library, with what the file says of them.
    fn numbers(&mut self, section: &mut Section<'_>, bound: &LibraryBinding<'_>) -> Result<()> {
        let mut given = section.section("parameters")?;
        for number in &bound.entry.parameters {
            let (unit, is_usual) = bound.unit(&number.quantity);
            // In another dimension 0 and no bound are the same, and nothing else is.
            let stays = |value: f64| is_usual || value == 0.0 || value.is_infinite();
            let [least, most] = number.range_si;
            let parameter = Parameter {
                name: number.name.clone(),
                values_si: if number.values_si.iter().all(|value| stays(*value)) {
                    number.values_si.clone()
                } else {
                    Vec::new()
                },
                tolerance_si: None,
                range_si: [
                    if stays(least) { least } else { f64::NEG_INFINITY },
                    if stays(most) { most } else { f64::INFINITY },
                ],
                is_fixed: number.is_fixed,
                is_per_record: false,
                of_records_si: Vec::new(),
                is_bound_by_samples: !bound.entry.states.is_empty() && unit.dimension == Dimension::TIME,
                suspect: Some(bound.index),
                unit,
            };
            let table = given.as_mut().map(|given| given.section(&number.name)).transpose()?.flatten();
            match table {
                Some(table) => self.parameter(table, parameter)?,
                None if parameter.values_si.is_empty() => {
                    let (name, unit) = (&number.name, &parameter.unit.text);
                    return Err(section.wrong(&format!(
                        "parameters.{name}.value is missing: the library has none for this place, in {unit}; or name its unit"
                    )));
                }
                None => self.model.parameters.push(parameter),
            }
        }
        given.map_or(Ok(()), |given| given.finish())
    }

    /// The states of a suspect of a library; the file may say where they start.
    fn states(&mut self, section: &mut Section<'_>, bound: &LibraryBinding<'_>) -> Result<()> {
        let mut given = section.section("states")?;
        for state in &bound.entry.states {
            let mut unit = bound.unit(&state.quantity).0;
            let table = given.as_mut().map(|given| given.section(&state.name)).transpose()?.flatten();
            let start = match (table, bound.target) {
                (Some(mut table), _) => {
                    let given = super::unit(&mut table, self.source)?;
                    if table.has("unit") {
                        unit = given;
                    }
                    let start = self.start(&mut table, &unit)?;
                    table.finish()?;
                    start
                }
                (None, _) if state.is_zero_at_start => Start::Known { value_si: 0.0 },
                (None, Target::Input(input)) => Start::Input { input },
                (None, Target::Output(output)) => Start::Record { output },
                (None, _) => {
                    let name = &state.name;
                    return Err(section.wrong(&format!(
                        "states.{name}.start is missing, and no record has it at this place: a number or \"fitted\" with a guess"
                    )));
                }
            };
            let derivative = self.of_library(bound, &state.derivative)?;
            let (name, suspect) = (state.name.clone(), Some(bound.index));
            self.model.states.push(State { name, unit, start, derivative, suspect });
        }
        given.map_or(Ok(()), |given| given.finish())
    }

    fn target(&self, text: &Text) -> Result<Target> {
        let model = &self.model;
        let name = &text.text;
        let parts = named_parts(model).filter(|(_, _, suspect)| suspect.is_none());
        let parts = parts.filter_map(|(symbol, name, _)| match symbol {
            Symbol::Input(index) => Some((Target::Input(index), name)),
            Symbol::State(index) => Some((Target::State(index), name)),
            Symbol::Definition(index) => Some((Target::Definition(index), name)),
            _ => None,
        });
        let outputs = model.outputs.iter().enumerate();
        let outputs = outputs.map(|(index, one)| (Target::Output(index), &one.name));
        let all: Vec<(Target, &String)> = parts.chain(outputs).collect();
        all.iter().find(|(_, other)| *other == name).map(|(target, _)| *target).ok_or_else(|| {
            let all = all.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ");
            let why =
                format!("'{name}' is no input, state, definition or output of this model; it has {all}");
            self.source.wrong_from(text.at, &why)
        })
    }
}
