//! The terms that a search goes over: products of what varies in a model, and of what it remembers, each as a suspect in the
//! words of a model file.
//!
//! ```text
//!   x over its rms:   x, |x|, x^2, x |x|, x^3, sign x
//!   memory of x:      low-passed (three times), change (x less its fastest low pass), side of a play, integral
//!   two of them:      x y, x |y|, x sign y, x^2 y, memory(x) y
//! ```
//! Names of their own end in `_found`, which no file is likely to have. Variables are the inputs and the states; places are the
//! equations that are no bare name (`derivative = "speed"` is exact) and the
//! outputs. A sign of a state is `tanh`, so that it can be integrated.
//!
//! Source: Brunton, Proctor, Kutz 2016, PNAS 113(15) (library of candidate terms).

use super::super::select::Fitted;
use super::super::sensors::part_values;
use model::{Model, Part, Target};
use std::fmt::Write as _;

/// Most terms of a search: names and numbers of a file are limited.
const MOST: usize = 300;
/// Most terms of all places.
const MOST_OF_GROUPS: usize = 600;
/// Low passes from three samples to a tenth of the shortest record.
const LOW_PASSES: usize = 3;
/// Half width of the play over the rms of its variable, and width of a sign that is integrated.
const PLAY: f64 = 0.5;
const SIGN: f64 = 0.05;
/// A variable changes its sign when it is beyond this share of its largest size on both sides.
const BOTH_SIDES: f64 = 0.05;

/// Before the variable whose fastest low pass is taken from it, in its name.
const CHANGE: &str = "change of ";
/// Before the time from which a low pass is fitted, in its name.
const FROM: &str = " (from ";

/// A quantity that terms are made of.
pub(super) struct Variable {
    pub(super) name: String,
    unit: String,
    /// Root mean square, mean and first value, in its unit.
    size: f64,
    mean: f64,
    first: f64,
    has_both_signs: bool,
    is_state: bool,
}

#[derive(Clone)]
pub(super) struct Term {
    pub(super) name: String,
    pub(super) variables: Vec<String>,
    /// Factors, counting a power as so many and memory as two.
    pub(super) complexity: usize,
    /// As `[[suspects]]` of a model file.
    pub(super) text: String,
}

impl Term {
    /// Whether it stands for a lag.
    pub(super) fn is_of_change(&self) -> bool {
        self.name.starts_with(CHANGE)
    }
}

/// A factor of a product: what it is called, its expression, and the memory that it needs.
#[derive(Clone)]
struct Factor {
    name: String,
    variable: String,
    expression: String,
    members: String,
    complexity: usize,
}

/// What varies in the model as it was fitted.
pub(super) fn variables(baseline: &Fitted<'_>) -> Vec<Variable> {
    let model = baseline.fitting.model;
    let records = baseline.fitting.records;
    let inputs = model.inputs.iter().enumerate().filter_map(|(index, input)| {
        let values = records.iter().flat_map(|record| record.inputs[index].iter().copied()).collect();
        variable((&input.name, &input.unit, false), values)
    });
    let states = model.states.iter().enumerate().filter(|(_, state)| state.suspect.is_none());
    let states = states.filter_map(|(index, state)| {
        variable((&state.name, &state.unit, true), part_values(baseline, Part::State(index))?)
    });
    inputs.chain(states).collect()
}

/// `None` of one that rests.
fn variable((name, unit, is_state): (&str, &model::Unit, bool), values_si: Vec<f64>) -> Option<Variable> {
    let values: Vec<f64> = values_si.iter().map(|value| value / unit.factor).collect();
    let count = values.len() as f64;
    let size = rounded((values.iter().map(|value| value * value).sum::<f64>() / count).sqrt());
    let mean = rounded(values.iter().sum::<f64>() / count);
    let [least, most] = [
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    ];
    let edge = BOTH_SIDES * most.abs().max(least.abs());
    let varies = size.is_finite() && most - least > 1e-9 * size;
    varies.then(|| Variable {
        name: name.into(),
        unit: unit.text.clone(),
        size,
        mean,
        first: values[0],
        has_both_signs: least < -edge && most > edge,
        is_state,
    })
}

/// Two digits, so that a formula can be read.
fn rounded(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// All terms, the simplest first, and how many were left out.
pub(super) fn terms(
    model: &Model,
    variables: &[Variable],
    period_s: f64,
    length_s: f64,
) -> (Vec<Term>, usize) {
    let mut all = Vec::new();
    for (target, unit) in places(model) {
        for factors in products(variables, period_s, length_s) {
            all.push(term(model.target_name(target), &unit, &factors, variables));
        }
    }
    // Within the same complexity in the order of the places.
    all.sort_by_key(|term| term.complexity);
    let left_out = all.len().saturating_sub(MOST);
    all.truncate(MOST);
    (all, left_out)
}

/// Terms of which a place and its variables are judged, see [`super::place`].
pub(super) fn group_terms(model: &Model, variables: &[Variable], period_s: f64) -> Vec<Term> {
    let mut all = Vec::new();
    for (target, unit) in places(model).into_iter().chain(parts(model)) {
        let name = model.target_name(target);
        let is_output = matches!(target, Target::Output(_));
        let mut add = |factors: &[Factor]| all.push(term(name, &unit, factors, variables));
        add(&[]);
        for (place, one) in variables.iter().enumerate() {
            let x = plain(one);
            add(std::slice::from_ref(&x));
            add(&[x.clone(), x.clone()]);
            add(&[x.clone(), x.clone(), x.clone()]);
            if one.has_both_signs {
                add(&[size(one)]);
                add(&[sign(one)]);
                add(&[x.clone(), size(one)]);
            }
            // What an input was a moment ago acts as a lag of it.
            if matches!(target, Target::Input(_)) && name == one.name {
                memories(one, period_s, 30.0 * period_s)
                    .iter()
                    .filter(|low| low.name.starts_with(CHANGE))
                    .for_each(|low| add(std::slice::from_ref(low)));
            }
            for other in variables[place + 1..].iter().filter(|_| !is_output) {
                let y = plain(other);
                add(&[x.clone(), y.clone()]);
                add(&[x.clone(), x.clone(), y.clone()]);
                add(&[x.clone(), y.clone(), y.clone()]);
            }
        }
    }
    all.truncate(MOST_OF_GROUPS);
    all
}

/// Inputs and definitions with their units.
fn parts(model: &Model) -> Vec<(Target, String)> {
    let inputs = model.inputs.iter().enumerate();
    let inputs = inputs.map(|(index, input)| (Target::Input(index), input.unit.text.clone()));
    let definitions = (0..model.definitions.len())
        .map(|index| (Target::Definition(index), model.definition_unit(index).text));
    inputs.chain(definitions).collect()
}

/// Where a term may stand, with its unit there.
fn places(model: &Model) -> Vec<(Target, String)> {
    let is_name = |text: &str| {
        model.states.iter().any(|state| state.name == text)
            || model.inputs.iter().any(|input| input.name == text)
    };
    let states = model.states.iter().enumerate();
    let states = states.filter(|(_, state)| state.suspect.is_none() && !is_name(&state.derivative.text));
    let rate = |unit: &str| format!("{unit}/s");
    let states = states.map(|(index, state)| (Target::State(index), rate(&state.unit.text)));
    let outputs = model.outputs.iter().enumerate();
    states.chain(outputs.map(|(index, output)| (Target::Output(index), output.unit.text.clone()))).collect()
}

fn measured(value: f64, unit: &str) -> String {
    if unit == "1" { format!("{value}") } else { format!("{value}[{unit}]") }
}

fn products(variables: &[Variable], period_s: f64, length_s: f64) -> Vec<Vec<Factor>> {
    let mut all = Vec::new();
    for (place, one) in variables.iter().enumerate() {
        let x = plain(one);
        all.push(vec![x.clone()]);
        all.push(vec![x.clone(), x.clone()]);
        all.push(vec![x.clone(), x.clone(), x.clone()]);
        if one.has_both_signs {
            all.push(vec![size(one)]);
            all.push(vec![sign(one)]);
            all.push(vec![x.clone(), size(one)]);
        }
        for other in &variables[place + 1..] {
            let y = plain(other);
            all.push(vec![x.clone(), y.clone()]);
            all.push(vec![x.clone(), x.clone(), y.clone()]);
            all.push(vec![x.clone(), y.clone(), y.clone()]);
        }
        for other in variables.iter().filter(|other| other.has_both_signs && other.name != one.name) {
            all.push(vec![x.clone(), size(other)]);
            all.push(vec![x.clone(), sign(other)]);
        }
        for memory in memories(one, period_s, length_s) {
            all.push(vec![memory.clone()]);
            all.extend(variables.iter().map(|other| vec![memory.clone(), plain(other)]));
        }
    }
    all
}

fn plain(variable: &Variable) -> Factor {
    let Variable { name, unit, size, .. } = variable;
    let expression = format!("({name}/{})", measured(*size, unit));
    Factor { name: name.clone(), variable: name.clone(), expression, members: String::new(), complexity: 1 }
}

fn size(variable: &Variable) -> Factor {
    let Factor { name, expression, .. } = plain(variable);
    Factor {
        name: format!("|{name}|"),
        variable: name,
        expression: format!("abs{expression}"),
        members: String::new(),
        complexity: 1,
    }
}

fn sign(variable: &Variable) -> Factor {
    let Variable { name, unit, size, is_state, .. } = variable;
    let expression = match is_state {
        true => format!("tanh({name}/{})", measured(rounded(SIGN * size), unit)),
        false => format!("sign({name})"),
    };
    Factor {
        name: format!("sign {name}"),
        variable: name.clone(),
        expression,
        members: String::new(),
        complexity: 1,
    }
}

fn memories(variable: &Variable, period_s: f64, length_s: f64) -> Vec<Factor> {
    let Variable { name, unit, size, mean, first, .. } = variable;
    let over = measured(*size, unit);
    let unit_key = |unit: &str| format!("unit = \"{unit}\"");
    let factor = |called: String, expression: String, members: String| Factor {
        name: called,
        variable: name.clone(),
        expression,
        members,
        complexity: 2,
    };
    let [shortest_s, longest_s] = [3.0 * period_s, (0.1 * length_s).max(6.0 * period_s)];
    let time_s = |number: usize| {
        rounded(shortest_s * (longest_s / shortest_s).powf((number as f64 + 0.5) / LOW_PASSES as f64))
    };
    let low = |time_s: f64| {
        format!(
            "parameters.lag_found = {{ unit = \"s\", value = {time_s:e}, range = [{period_s:e}, {length_s:e}] }}\n\
             states.low_found = {{ {}, start = {first:e}, derivative = \"({name} - low_found)/lag_found\" }}\n",
            unit_key(unit)
        )
    };
    let mut all: Vec<Factor> = (0..LOW_PASSES)
        .map(|number| {
            let time_s = time_s(number);
            factor(format!("{name} low-passed{FROM}{time_s} s)"), format!("(low_found/{over})"), low(time_s))
        })
        .collect();
    all.push(factor(format!("{CHANGE}{name}"), format!("(({name} - low_found)/{over})"), low(time_s(0))));
    let half = measured(rounded(PLAY * size), unit);
    let play = format!(
        "memory.play_found = {{ {}, start = {first:e}, update = \"min(max(play_found, {name} - {half}), {name} + {half})\" }}\n",
        unit_key(unit)
    );
    all.push(factor(format!("hysteresis of {name}"), format!("(({name} - play_found)/{half})"), play));
    let product = if unit == "1" { "s".to_owned() } else { format!("{unit} s") };
    let sum = format!(
        "states.sum_found = {{ {}, start = 0, derivative = \"{name} - ({})\" }}\n",
        unit_key(&product),
        measured(*mean, unit)
    );
    let over = measured(rounded(size * length_s), &product);
    all.push(factor(format!("integral of {name}"), format!("(sum_found/{over})"), sum));
    all
}

fn term(place: &str, unit: &str, factors: &[Factor], variables: &[Variable]) -> Term {
    let power = |factors: &[Factor]| match factors.len() {
        1 => factors[0].name.clone(),
        count => format!("{}^{count}", factors[0].name),
    };
    let named: Vec<String> = factors.chunk_by(|one, other| one.name == other.name).map(power).collect();
    let named = if named.is_empty() { "constant".to_owned() } else { named.join(" * ") };
    let name = format!("{named} in {place}");
    let product: Vec<&str> = factors.iter().map(|factor| factor.expression.as_str()).collect();
    let product = if product.is_empty() { "1".to_owned() } else { product.join("*") };
    let mut text =
        format!("\n[[suspects]]\nname = \"{name}\"\nplace = \"{place}\"\nadd = \"k_found*{product}\"\n");
    let _ = writeln!(text, "parameters.k_found = {{ unit = \"{unit}\", value = 0 }}");
    factors.iter().for_each(|factor| text.push_str(&factor.members));
    let reads = |variable: &&Variable| factors.iter().any(|factor| factor.variable == variable.name);
    Term {
        variables: variables.iter().filter(reads).map(|variable| variable.name.clone()).collect(),
        complexity: factors.iter().map(|factor| factor.complexity).sum(),
        name,
        text,
    }
}

impl Term {
    /// Its name without the times from which low passes are fitted: terms of one form are one.
    pub(super) fn form(&self) -> String {
        let mut parts = self.name.split(FROM);
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |all, part| all + part.split_once(')').map_or("", |(_, rest)| rest))
    }
}
