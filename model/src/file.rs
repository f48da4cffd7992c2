//! A model file as data: what its tables hold, in SI, with the places of its expressions.

use crate::inputs::Hold;
use crate::rows::Rows;
use crate::units::Unit;
use crate::{check, compile, read};
pub use expression::curve::Table;
use expression::grammar::{NodeId, Nodes};
use expression::mathml::Operand;
use settings::SettingsError;
use std::path::{Path, PathBuf};

/// A plant as its file describes it.
#[derive(Clone, Debug)]
pub struct Model {
    /// What it is called in reports.
    pub name: String,
    /// How its records are laid out.
    pub record: RecordLayout,
    /// Rows that count, and how the model is compared on them.
    pub rows: Rows,
    /// Rows at the head of a held-out record on which its own numbers are fitted; they are not scored.
    pub start_samples: usize,
    /// Points from which fits start beside the values of the file.
    pub starts: usize,
    /// Method of integration, with its tolerance or its step.
    pub solver: Solver,
    /// Columns that drive the equations.
    pub inputs: Vec<Input>,
    /// Parameters of the model and of its suspects.
    pub parameters: Vec<Parameter>,
    /// States of the model and of its suspects.
    pub states: Vec<State>,
    /// Values that are kept over a step.
    pub memories: Vec<Memory>,
    /// Dry friction that sticks and slips.
    pub frictions: Vec<Friction>,
    /// `[define]`: expressions that others use by name.
    pub definitions: Vec<Definition>,
    /// Columns that the model is compared with.
    pub outputs: Vec<Output>,
    /// Terms that may be missing.
    pub suspects: Vec<Suspect>,
    /// Curves that expressions read by name.
    pub tables: Vec<Table>,
    pub(crate) nodes: Nodes,
    /// The text of the file.
    pub text: String,
    pub(crate) file: PathBuf,
}

/// How a text table is laid out, as in a mapping file.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordLayout {
    /// Distance of an even grid that the record is brought to, s; as it is where the file names none.
    pub period_s: Option<f64>,
    /// Column of the time.
    pub time_column: String,
    /// Seconds in a unit of that column.
    pub time_unit_s: f64,
    /// It holds times of a calendar, ISO 8601, which become seconds since the first row.
    pub is_calendar: bool,
    /// One character between two cells.
    pub separator: String,
    /// Whether decimals are written with a comma.
    pub is_decimal_comma: bool,
    /// What begins a comment line.
    pub comment: String,
    /// Lines before the head.
    pub skip_lines: u64,
    /// Cells that hold no value, beside empty ones.
    pub absent: Vec<String>,
}

/// Method of integration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// Dormand-Prince 5(4) with step control; no step goes over a sample.
    Adaptive {
        /// Error of a step over the largest value of its state so far.
        relative_tolerance: f64,
    },
    /// Classical Runge-Kutta of fourth order, with steps that are at most so long and end at samples.
    Fixed {
        /// Longest step, s.
        step_s: f64,
    },
}

/// An expression of the file.
#[derive(Clone, Debug)]
pub struct Expression {
    /// As it is written in the file.
    pub text: String,
    pub(crate) root: NodeId,
    pub(crate) at: usize,
}

/// A measured input.
#[derive(Clone, Debug)]
pub struct Input {
    /// Its name in expressions.
    pub name: String,
    /// Its column in the record; none for a rate.
    pub column: String,
    /// What stands in it times this is in the unit.
    pub scale: f64,
    /// The input whose rate of change it is, by central differences.
    pub rate_of: Option<usize>,
    /// How its samples are smoothed.
    pub smoothing: Smoothing,
    /// Unit of that column.
    pub unit: Unit,
    /// What it does between samples.
    pub hold: Hold,
}

/// What is done to the samples of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Edge of a zero-phase Butterworth, Hz; 0 for none.
    pub low_pass_hz: f64,
    /// Order of the Butterworth.
    pub low_pass_order: usize,
    /// Samples of a mean around each, odd; 1 for none.
    pub moving_average: usize,
}

/// A number of the model.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Its name in expressions.
    pub name: String,
    /// Unit in which it is written.
    pub unit: Unit,
    /// Values from which a fit starts, the first that of the model.
    pub values_si: Vec<f64>,
    /// Standard deviation of what is known about it.
    pub tolerance_si: Option<f64>,
    /// Least and largest value.
    pub range_si: [f64; 2],
    /// It is known and not fitted.
    pub is_fixed: bool,
    /// Each record has its own.
    pub is_per_record: bool,
    /// Known values that differ by record: the end of its path, and the value in SI. Empty where all share one.
    pub of_records_si: Vec<(String, f64)>,
    /// A time constant of a library, whose range the file leaves to it: samples bound it from below.
    pub is_bound_by_samples: bool,
    /// The suspect that it belongs to.
    pub suspect: Option<usize>,
}

impl Parameter {
    /// The known value of a record, which may differ by record; `None` where the file lists records, and not this one. Of two
    /// ends of its path the longer is meant.
    #[must_use]
    pub fn known_si(&self, record: &Path) -> Option<f64> {
        if self.of_records_si.is_empty() {
            return self.values_si.first().copied();
        }
        let of_record = self.of_records_si.iter().filter(|(name, _)| record.ends_with(name));
        of_record.max_by_key(|(name, _)| Path::new(name).components().count()).map(|(_, value_si)| *value_si)
    }
}

/// Value of a state at the first sample of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// A number of the file, which is not fitted.
    Known {
        /// In the SI unit of the state.
        value_si: f64,
    },
    /// Fitted, for each record.
    Fitted {
        /// Value before the first step of the fit.
        guess_si: f64,
        /// Least and largest value; infinite where the file has none.
        range_si: [f64; 2],
    },
    /// The first sample of an output.
    Record {
        /// Index into [`Model::outputs`].
        output: usize,
    },
    /// The first sample of an input.
    Input {
        /// Index into [`Model::inputs`].
        input: usize,
    },
}

/// A state with its equation.
#[derive(Clone, Debug)]
pub struct State {
    /// Its name in expressions.
    pub name: String,
    /// Unit in which it is written and reported.
    pub unit: Unit,
    /// Value at the first sample.
    pub start: Start,
    /// Rate of change, in the unit of the state per second.
    pub derivative: Expression,
    /// The suspect that it belongs to.
    pub suspect: Option<usize>,
}

/// A value that is kept over a step and renewed at its end.
#[derive(Clone, Debug)]
pub struct Memory {
    /// Its name in expressions.
    pub name: String,
    /// Unit in which it is written and reported.
    pub unit: Unit,
    /// Its value before the first step, where that is a number of the file.
    pub start_si: f64,
    /// The same as an expression of parameters.
    pub start: Option<Expression>,
    /// Its value after a step, from what holds at its end and its own old value.
    pub update: Expression,
    /// The suspect that it belongs to.
    pub suspect: Option<usize>,
}

/// Dry friction that holds a speed at rest until the break-away force is reached.
#[derive(Clone, Debug)]
pub struct Friction {
    /// What its force is called in expressions: positive along the speed.
    pub name: String,
    /// Unit in which the force is written and reported.
    pub unit: Unit,
    /// The state that it holds at rest, by its index.
    pub velocity: usize,
    /// Its size while the speed is not 0.
    pub sliding: Expression,
    /// What it holds at most, the sliding force at least.
    pub breakaway: Expression,
    /// The suspect that it belongs to.
    pub suspect: Option<usize>,
}

/// A named part of equations.
#[derive(Clone, Debug)]
pub struct Definition {
    /// Its name in expressions.
    pub name: String,
    /// Its value at an instant.
    pub value: Expression,
    /// The suspect that it belongs to.
    pub suspect: Option<usize>,
}

/// A measured output.
#[derive(Clone, Debug)]
pub struct Output {
    /// What it is called.
    pub name: String,
    /// Its column in the record.
    pub column: String,
    /// What stands in it times this is in the unit.
    pub scale: f64,
    /// Unit of that column.
    pub unit: Unit,
    /// What the model says it is.
    pub value: Expression,
    /// The suspect whose own names that may use.
    pub(crate) suspect: Option<usize>,
    /// Standard deviation of the sensor's noise; estimated where it is absent.
    pub noise_si: Option<f64>,
    /// Error of the model, or of who simulated the record, that is no term: standard deviation.
    pub model_error_si: f64,
}

/// What a model is asked to report beside its outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// An input, with what changes it.
    Input(usize),
    /// A state, by its place in the file.
    State(usize),
    /// The expression of a suspect, before it acts on its place.
    Suspect(usize),
}

/// A part of the model that a suspect changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// An input, before anything reads it.
    Input(usize),
    /// The equation of a state.
    State(usize),
    /// A definition, by its place in the file.
    Definition(usize),
    /// The value that an output reports.
    Output(usize),
}

/// How a suspect changes its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Added to the target.
    Add,
    /// Multiplies the target.
    Multiply,
    /// Stands instead of the target; the name of its target is the value without it.
    Replace,
}

/// A term that may be missing.
#[derive(Clone, Debug)]
pub struct Suspect {
    /// What it is called in reports.
    pub name: String,
    /// The input, equation, definition or output that it changes.
    pub target: Target,
    /// Added, a factor, or in its place.
    pub change: Change,
    /// The term, the factor or the replacement, in the unit of the target or, as a factor, without one.
    pub expression: Expression,
    /// It stands under `[[terms]]`: a part of the model and no suspect.
    pub is_term: bool,
    /// What it is one form of; forms that cannot be told apart are one finding.
    pub effect: Option<String>,
    /// It acts in a part of what the folds go over, so that only folds in time judge it.
    pub is_local: bool,
    /// Library and suspect in it that it is an instance of, as `use` names them.
    pub library: Option<String>,
    /// Suspects that are known to do the same.
    pub twins: Vec<String>,
    /// Carried to be rejected: one that does better than every suspect ends the search.
    pub is_decoy: bool,
}

impl Model {
    /// Reads a model file and checks its names, its units and its numbers; `file` is for messages.
    ///
    /// # Errors
    /// File, line, column, what stands there and what is allowed.
    pub fn parse(text: &str, file: &Path) -> Result<Self, SettingsError> {
        let source = settings::Source::parse(text, file)?.with_columns();
        let model = read::model(&source, file)?;
        check::check(&model).map_err(|wrong| source.wrong_from(wrong.at, &wrong.why))?;
        Ok(model)
    }

    pub(crate) fn wrong(&self, at: usize, why: &str) -> SettingsError {
        // The text parsed before.
        settings::Source::parse(&self.text, &self.file)
            .map_or_else(|error| error, |source| source.with_columns().wrong_from(at, why))
    }

    /// File, line and column of an expression.
    #[must_use]
    pub fn place_of(&self, expression: &Expression) -> String {
        let (line, column) =
            (settings::line_of(&self.text, expression.at), settings::column_of(&self.text, expression.at));
        format!("{}:{line}:{column}", self.file.display())
    }

    /// The same model with a part of it as its last output; `None` where the file is full.
    #[must_use]
    pub fn measuring(&self, part: Part) -> Option<Self> {
        let mut other = self.clone();
        let mut named = |name: &str, at: usize| {
            let root = other.nodes.name(name, at).ok()?;
            Some(Expression { text: name.into(), root, at })
        };
        let (name, unit, value, suspect) = match part {
            Part::Input(index) => {
                let Input { name, unit, .. } = &self.inputs[index];
                (name, unit.clone(), named(name, 0)?, None)
            }
            Part::State(index) => {
                let State { name, unit, derivative, .. } = &self.states[index];
                (name, unit.clone(), named(name, derivative.at)?, None)
            }
            Part::Suspect(index) => {
                let Suspect { name, expression, .. } = &self.suspects[index];
                (name, check::suspect_unit(self, index), expression.clone(), Some(index))
            }
        };
        let (name, column) = (name.clone(), name.clone());
        let (scale, noise_si, model_error_si) = (1.0, None, 0.0);
        other.outputs.push(Output { name, column, scale, unit, value, suspect, noise_si, model_error_si });
        Some(other)
    }

    /// An expression as MathML, without the element `math` around it.
    #[must_use]
    pub fn mathml(&self, of: &Expression, operand: Operand) -> String {
        expression::mathml::expression(&self.nodes, of.root, operand)
    }

    /// What a target is called.
    #[must_use]
    pub fn target_name(&self, target: Target) -> &str {
        match target {
            Target::Input(index) => &self.inputs[index].name,
            Target::State(index) => &self.states[index].name,
            Target::Definition(index) => &self.definitions[index].name,
            Target::Output(index) => &self.outputs[index].name,
        }
    }

    /// Whether a part of the file is there with these suspects: terms always are.
    pub(crate) fn is_there(&self, owner: Option<usize>, suspects: &[usize]) -> bool {
        owner.is_none_or(|owner| self.suspects[owner].is_term || suspects.contains(&owner))
    }

    /// Terms and switched-on suspects at a place in the order in which they act: those that delay an input come first, since no
    /// earlier value is kept of a lag or of a play in front of them.
    #[must_use]
    pub fn changes_of(&self, target: Target, suspects: &[usize]) -> Vec<usize> {
        let terms = (0..self.suspects.len()).filter(|index| self.suspects[*index].is_term);
        let all = terms.chain(suspects.iter().copied());
        let mut all: Vec<usize> = all.filter(|index| self.suspects[*index].target == target).collect();
        all.sort_by_key(|index| !compile::delays_its_place(self, *index));
        all
    }

    /// Parameters that are read with these suspects, by their index.
    pub fn parameters_of<'a>(&'a self, suspects: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
        let is_read = |parameter: &Parameter| self.is_there(parameter.suspect, suspects);
        (0..self.parameters.len()).filter(move |index| is_read(&self.parameters[*index]))
    }
}
