//! The equations of the extended model as MathML: what a report adds to the model is marked.
//!
//! A term stands in the equation of its place. One at an input has none, and one that reads the value of its place without it
//! would be read as a circle: these stand by themselves, with an arrow. Each equation has its plain text as title.

use model::{Change, Expression, Model, Operand, Target, in_brackets, is_name_character, mathml_name};
use pagekit::page::escaped;

/// Most bytes of an equation that is set; a longer one is easier to read in the file.
const LONGEST: usize = 20_000;

/// Equations of states, definitions and outputs with the terms of the file and the suspects of these names, which are marked, and
/// what these bring; each a block.
pub(crate) fn equations(model: &Model, named: &[&str]) -> String {
    let is_named = |index: &usize| named.contains(&model.suspects[*index].name.as_str());
    let named: Vec<usize> = (0..model.suspects.len()).filter(is_named).collect();
    let page = Typeset { model, named };
    let of_states = (0..model.states.len()).map(|index| {
        let state = &model.states[index];
        (state.suspect, Target::State(index), &state.derivative)
    });
    let of_definitions = (0..model.definitions.len()).map(|index| {
        let definition = &model.definitions[index];
        (definition.suspect, Target::Definition(index), &definition.value)
    });
    let of_outputs =
        (0..model.outputs.len()).map(|index| (None, Target::Output(index), &model.outputs[index].value));
    let all = of_states.chain(of_definitions).chain(of_outputs);
    let there = all.filter(|(suspect, ..)| suspect.is_none_or(|suspect| page.is_there(suspect)));
    let equations: String =
        there.map(|(suspect, target, value)| page.equation(suspect, target, value)).collect();
    let inputs: String = (0..model.inputs.len()).map(|index| page.alone(Target::Input(index))).collect();
    inputs + &equations
}

/// What a suspect does to its place, and the equations of its own states and definitions.
pub(crate) fn of_suspect(model: &Model, index: usize) -> String {
    let page = Typeset { model, named: Vec::new() };
    let target = model.suspects[index].target;
    let change = if matches!(target, Target::Input(_)) || page.reads_its_place(index) {
        page.by_itself(target, index)
    } else {
        let (left, left_text) = page.left_side(target);
        let rest = || "<mo>…</mo>".to_owned();
        let side = RightHandSide { whole: rest(), term: rest(), factor: rest(), text: "…".to_owned() };
        let side = page.changed(side, index);
        block(&left, "=", &side.whole, &format!("{left_text} = {}", side.text))
    };
    let states = model.states.iter().enumerate().filter(|(_, one)| one.suspect == Some(index));
    let states = states.map(|(place, one)| page.equation(None, Target::State(place), &one.derivative));
    let definitions = model.definitions.iter().enumerate().filter(|(_, one)| one.suspect == Some(index));
    let definitions =
        definitions.map(|(place, one)| page.equation(None, Target::Definition(place), &one.value));
    change + &states.chain(definitions).collect::<String>()
}

struct Typeset<'a> {
    model: &'a Model,
    named: Vec<usize>,
}

/// The right-hand side of an equation: by itself, as first term of a sum, as first factor of a product, and in plain text.
struct RightHandSide {
    whole: String,
    term: String,
    factor: String,
    text: String,
}

impl Typeset<'_> {
    fn is_there(&self, suspect: usize) -> bool {
        self.model.suspects[suspect].is_term || self.named.contains(&suspect)
    }

    /// The equation of a place with what changes it, and behind it what stands by itself.
    fn equation(&self, owner: Option<usize>, target: Target, value: &Expression) -> String {
        let (left, left_text) = self.left_side(target);
        let mut side = RightHandSide {
            whole: self.marked(owner, self.set(value, Operand::None)),
            term: self.marked(owner, self.set(value, Operand::FirstTerm)),
            factor: self.marked(owner, self.set(value, Operand::FirstFactor)),
            text: value.text.clone(),
        };
        for index in self.changes(target).into_iter().filter(|index| !self.reads_its_place(*index)) {
            side = self.changed(side, index);
        }
        block(&left, "=", &side.whole, &format!("{left_text} = {}", side.text)) + &self.alone(target)
    }

    /// The left side of the equation of a place, and the same in plain text.
    fn left_side(&self, target: Target) -> (String, String) {
        let name = self.model.target_name(target);
        match target {
            Target::State(_) => (rate(name), format!("d{name}/dt")),
            _ => (mathml_name(name), name.to_owned()),
        }
    }

    /// What changes a place, in the order in which it acts.
    fn changes(&self, target: Target) -> Vec<usize> {
        self.model.changes_of(target, &self.named)
    }

    fn changed(&self, side: RightHandSide, index: usize) -> RightHandSide {
        let suspect = &self.model.suspects[index];
        let set = |operand| self.marked(Some(index), self.set(&suspect.expression, operand));
        let text = &suspect.expression.text;
        match suspect.change {
            Change::Add => {
                let sum = format!("{}<mo>+</mo>{}", side.term, set(Operand::Term));
                let text = format!("{} + ({text})", side.text);
                RightHandSide { whole: sum.clone(), factor: in_brackets(&sum), term: sum, text }
            }
            Change::Multiply => {
                let product = format!("{}<mo>⋅</mo>{}", side.factor, set(Operand::Factor));
                let text = format!("({})*({text})", side.text);
                RightHandSide { whole: product.clone(), term: product.clone(), factor: product, text }
            }
            Change::Replace => RightHandSide {
                whole: set(Operand::None),
                term: set(Operand::FirstTerm),
                factor: set(Operand::FirstFactor),
                text: text.clone(),
            },
        }
    }

    /// What stands by itself of the changes of a place.
    fn alone(&self, target: Target) -> String {
        let is_alone = |index: &usize| matches!(target, Target::Input(_)) || self.reads_its_place(*index);
        let all = self.changes(target).into_iter().filter(is_alone);
        all.map(|index| self.by_itself(target, index)).collect()
    }

    /// A change of a place, from what is there without it.
    fn by_itself(&self, target: Target, index: usize) -> String {
        let name = self.model.target_name(target);
        let before = || mathml_name(name);
        let side = RightHandSide { whole: before(), term: before(), factor: before(), text: name.to_owned() };
        let side = self.changed(side, index);
        block(&before(), "←", &side.whole, &format!("{name} ← {}", side.text))
    }

    /// Whether an expression has the name of the place that it changes, which is there the value without it.
    fn reads_its_place(&self, index: usize) -> bool {
        let suspect = &self.model.suspects[index];
        let name = self.model.target_name(suspect.target);
        !matches!(suspect.target, Target::State(_))
            && suspect.expression.text.split(|letter| !is_name_character(letter)).any(|word| word == name)
    }

    /// What is of a named suspect, on the ground of marked text; that of a term of the file is not.
    fn marked(&self, suspect: Option<usize>, inner: String) -> String {
        let is_named = suspect.is_some_and(|suspect| self.named.contains(&suspect));
        if is_named { format!("<mrow class=\"named\">{inner}</mrow>") } else { inner }
    }

    fn set(&self, expression: &Expression, operand: Operand) -> String {
        let set = self.model.mathml(expression, operand);
        if set.len() > LONGEST { "<mtext>…</mtext>".into() } else { set }
    }
}

fn rate(name: &str) -> String {
    let name = mathml_name(name);
    format!("<mfrac><mrow><mi>d</mi>{name}</mrow><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>")
}

fn block(left: &str, sign: &str, right: &str, text: &str) -> String {
    let title = escaped(text);
    format!(
        "<div title=\"{title}\"><math display=\"block\" style=\"margin:.6rem 0\"><mrow>{left}<mo>{sign}</mo>{right}</mrow></math>\
         </div>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const MODEL: &str = r#"
[inputs.force]
unit = "N"
[parameters]
mass = { unit = "kg", value = 1 }
[define]
loss = "0[N]"
[states.v]
unit = "m/s"
start = 0
derivative = "(force - loss)/mass"
[outputs.y]
unit = "m/s"
value = "v"
[[terms]]
name = "tilt"
place = "v"
add = "a"
parameters.a = { unit = "m/s^2", value = 1 }
[[suspects]]
name = "<drag> & \"co\""
place = "v"
add = "if(v < 1[m/s] and v > -1[m/s], -k*v, 0)"
parameters.k = { unit = "1/s", value = 1 }
[[suspects]]
name = "gain"
place = "v"
multiply = "g + 1"
parameters.g = { value = 1 }
[[suspects]]
name = "wire"
place = "force"
multiply = "h"
parameters.h = { value = 1 }
[[suspects]]
name = "offset"
place = "loss"
replace = "o"
parameters.o = { unit = "N", value = 1 }
[[suspects]]
name = "late"
place = "y"
replace = "y - slow"
states.slow = { unit = "m/s", start = 0, derivative = "(y - slow)/1[s]" }
"#;

    /// Title, plain characters of the equation, and those of its marked parts, of each block.
    fn equations_with(named: &[&str]) -> Vec<[String; 3]> {
        let model = Model::parse(MODEL, Path::new("m.toml")).unwrap_or_else(|error| panic!("{error}"));
        let page = format!("<page>{}</page>", equations(&model, named));
        let page = roxmltree::Document::parse(&page).unwrap_or_else(|error| panic!("{error}\n{page}"));
        let text = |node: roxmltree::Node<'_, '_>| -> String {
            node.descendants().filter(roxmltree::Node::is_text).filter_map(|one| one.text()).collect()
        };
        let of = |block: roxmltree::Node<'_, '_>| {
            let marked = block.descendants().filter(|one| one.attribute("class") == Some("named"));
            let title = block.attribute("title").unwrap().to_owned();
            [title, text(block), marked.map(text).collect::<Vec<_>>().join(" ")]
        };
        page.root_element().children().filter(roxmltree::Node::is_element).map(of).collect()
    }

    fn has(all: &[[String; 3]], wanted: [&str; 3]) {
        assert!(all.iter().any(|one| *one == wanted), "{wanted:?}\n{all:#?}");
    }

    #[test]
    fn without_a_name_the_terms_of_the_file_stand_in_their_equations_unmarked() {
        let all = equations_with(&[]);
        assert_eq!(all.len(), 3, "{all:?}");
        has(&all, ["dv/dt = (force - loss)/mass + (a)", "dvdt=force−lossmass+a", ""]);
    }

    #[test]
    fn what_is_named_is_marked_in_its_equation_and_its_text_cannot_become_markup() {
        let all = equations_with(&["<drag> & \"co\"", "gain"]);
        let text = "dv/dt = ((force - loss)/mass + (a) + (if(v < 1[m/s] and v > -1[m/s], -k*v, 0)))*(g + 1)";
        let [drag, gain] = ["({−k⋅vif v<1m/s∧−1m/s<v0otherwise)", "(g+1)"];
        has(&all, [text, &format!("dvdt=(force−lossmass+a+{drag})⋅{gain}"), &format!("{drag} {gain}")]);
    }

    #[test]
    fn a_term_that_has_no_equation_or_reads_its_place_stands_by_itself() {
        let all = equations_with(&["wire", "late", "offset"]);
        has(&all, ["force ← (force)*(h)", "force←force⋅h", "h"]);
        has(&all, ["loss = o", "loss=o", "o"]);
        has(&all, ["y = v", "y=v", ""]);
        has(&all, ["y ← y - slow", "y←y−slow", "y−slow"]);
        has(&all, ["dslow/dt = (y - slow)/1[s]", "dslowdt=y−slow1s", "y−slow1s"]);
    }
}
