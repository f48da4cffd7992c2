//! Expressions as MathML Core, which browsers set without a script.
//!
//! Brackets stand where they are needed: fractions, roots and powers bring their own. `p_a` is p with the index a, and names of
//! Greek letters are these letters.
//!
//! Source: W3C MathML Core, Candidate Recommendation.

use crate::grammar::{Binary, Kind, NodeId, Nodes};

/// How tightly a node holds: one in a place that asks for more stands in brackets.
/// Cases end with their last line, so that whatever stands behind would read as a part of it.
const CASES: u8 = 5;
const OR: u8 = 10;
const AND: u8 = 20;
const COMPARISON: u8 = 30;
const SUM: u8 = 40;
const NEGATION: u8 = 45;
const PRODUCT: u8 = 50;
const FRACTION: u8 = 60;
const POWER: u8 = 70;
const ATOM: u8 = 90;

/// Names of Greek letters from α on, in the order of Unicode; - has no name here.
const GREEK: &str = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi - pi rho - sigma tau upsilon \
                     phi chi psi omega";

/// Where an expression stands: as an operand it is in brackets where what stands beside it would be read as a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operand {
    /// By itself.
    None,
    /// First summand: conditions and `if` are in brackets, a leading minus is not.
    FirstTerm,
    /// Summand behind a sign: sums and negations are in brackets too.
    Term,
    /// First factor: as [`Operand::Term`].
    FirstFactor,
    /// Factor behind another one: products are in brackets too.
    Factor,
}

/// An expression, without the element `math` around it.
#[must_use]
pub fn expression(nodes: &Nodes, root: NodeId, operand: Operand) -> String {
    let least = match operand {
        Operand::None => 0,
        Operand::FirstTerm => SUM,
        Operand::Term | Operand::FirstFactor => PRODUCT,
        Operand::Factor => FRACTION,
    };
    at_least(nodes, root, least)
}

/// A name, with what stands behind its first `_` as index.
#[must_use]
pub fn name(name: &str) -> String {
    let name = name.trim_start_matches('#');
    let letter = |part: &str| match GREEK.split(' ').position(|word| word == part && word != "-") {
        _ if part == "Delta" => "<mi>Δ</mi>".to_owned(),
        Some(place) => format!("<mi>{}</mi>", ('α'..='ω').nth(place).expect("a name for each letter")),
        None => format!("<mi>{}</mi>", escaped(part)),
    };
    match name.split_once('_').filter(|(base, index)| !base.is_empty() && !index.is_empty()) {
        Some((base, index)) => {
            format!("<msub>{}<mtext>{}</mtext></msub>", letter(base), escaped(&index.replace('_', " ")))
        }
        None => letter(name),
    }
}

/// A text as it may stand in XML, between tags or in an attribute's double quotes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn row(inner: &str) -> String {
    format!("<mrow>{inner}</mrow>")
}

/// In brackets, which grow with what is tall alone.
#[must_use]
pub fn bracketed(inner: &str) -> String {
    let is_tall = ["<mfrac", "<mtable", "<msqrt"].iter().any(|tall| inner.contains(tall));
    let mo = if is_tall { "<mo>" } else { "<mo stretchy=\"false\">" };
    format!("{mo}(</mo>{inner}{mo})</mo>")
}

fn at_least(nodes: &Nodes, place: NodeId, least: u8) -> String {
    let (written, holds) = written(nodes, place);
    if holds < least { row(&bracketed(&written)) } else { written }
}

/// A node and how tightly it holds.
fn written(nodes: &Nodes, place: NodeId) -> (String, u8) {
    match &nodes.get(place).kind {
        Kind::Number(si, unit) => {
            let value = unit.as_ref().map_or(*si, |unit| si / unit.factor);
            // As many digits as somebody writes; a factor leaves rounding in the last ones.
            let value: f64 = format!("{value:.9e}").parse().unwrap_or(value);
            let number = format!("<mn>{value}</mn>");
            match unit.as_ref().filter(|unit| unit.text != "1") {
                Some(unit) => {
                    let unit = format!("<mspace width=\"0.2em\"/><mtext>{}</mtext>", escaped(&unit.text));
                    (row(&(number + &unit)), PRODUCT)
                }
                None => (number, ATOM),
            }
        }
        Kind::Name(text) => (name(text), ATOM),
        Kind::Negation(inner) => (row(&format!("<mo>−</mo>{}", at_least(nodes, *inner, PRODUCT))), NEGATION),
        Kind::Binary(operator, left, right) => binary(nodes, *operator, [*left, *right]),
        Kind::Call(function, arguments) => call(nodes, function, arguments),
    }
}

fn binary(nodes: &Nodes, operator: Binary, [left, right]: [NodeId; 2]) -> (String, u8) {
    let (sign, holds, [of_left, of_right]) = match operator {
        Binary::Divide => {
            let [over, under] = [left, right].map(|part| row(&at_least(nodes, part, 0)));
            return (format!("<mfrac>{over}{under}</mfrac>"), FRACTION);
        }
        Binary::Power => {
            let (base, exponent) = (at_least(nodes, left, ATOM), at_least(nodes, right, 0));
            return (format!("<msup>{}{}</msup>", row(&base), row(&exponent)), POWER);
        }
        Binary::Or => ("∨", OR, [OR, AND]),
        Binary::And => ("∧", AND, [AND, COMPARISON]),
        Binary::Less => ("&lt;", COMPARISON, [SUM, SUM]),
        Binary::LessOrEqual => ("≤", COMPARISON, [SUM, SUM]),
        Binary::Equal => ("=", COMPARISON, [SUM, SUM]),
        Binary::NotEqual => ("≠", COMPARISON, [SUM, SUM]),
        Binary::Add => ("+", SUM, [SUM, PRODUCT]),
        Binary::Subtract => ("−", SUM, [SUM, PRODUCT]),
        Binary::Multiply => ("⋅", PRODUCT, [PRODUCT, FRACTION]),
    };
    // A sign in front of a product is that of the whole.
    let (left, holds) = match written(nodes, left) {
        (signed, NEGATION) if operator == Binary::Multiply => (signed, NEGATION),
        _ => (at_least(nodes, left, of_left), holds),
    };
    let right = at_least(nodes, right, of_right);
    (row(&format!("{left}<mo>{sign}</mo>{right}")), holds)
}

fn call(nodes: &Nodes, function: &str, arguments: &[NodeId]) -> (String, u8) {
    let of = |place: &NodeId| at_least(nodes, *place, 0);
    match (function, arguments) {
        ("sqrt", [inner]) => (format!("<msqrt>{}</msqrt>", of(inner)), ATOM),
        ("abs", [inner]) => {
            (row(&format!("<mo stretchy=\"false\">|</mo>{}<mo stretchy=\"false\">|</mo>", of(inner))), ATOM)
        }
        ("exp", [inner]) => (format!("<msup><mi>e</mi>{}</msup>", row(&of(inner))), POWER),
        ("if", [condition, yes, no]) => {
            let line =
                |value: &NodeId, when: &str| format!("<mtr><mtd>{}</mtd><mtd>{when}</mtd></mtr>", of(value));
            let condition = row(&format!("<mtext>if </mtext>{}", of(condition)));
            let lines = line(yes, &condition) + &line(no, "<mtext>otherwise</mtext>");
            (row(&format!("<mo>{{</mo><mtable>{lines}</mtable>")), CASES)
        }
        ("delay", [late, by]) => {
            let earlier = row(&format!("<mi>t</mi><mo>−</mo>{}", at_least(nodes, *by, PRODUCT)));
            match &nodes.get(*late).kind {
                Kind::Name(text) => (row(&(name(text) + &bracketed(&earlier))), ATOM),
                _ => (format!("<msub>{}{earlier}</msub>", row(&bracketed(&of(late)))), ATOM),
            }
        }
        _ => {
            let least = if arguments.len() > 1 { OR } else { 0 };
            let inner: Vec<String> = arguments.iter().map(|one| at_least(nodes, *one, least)).collect();
            let inner = inner.join("<mo>,</mo>");
            (row(&(name(function) + &bracketed(&inner))), ATOM)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(text: &str) -> String {
        let mut nodes = Nodes::default();
        let root = nodes.parse(text, 0).unwrap();
        let set = expression(&nodes, root, Operand::None).replace(" stretchy=\"false\"", "");
        set.replace("<mrow>", "").replace("</mrow>", "")
    }

    #[test]
    fn brackets_stand_where_they_are_needed() {
        let plain = |text: &str| {
            let marked = ["mi", "mn", "mo"].iter().fold(set(text), |text, tag| {
                text.replace(&format!("<{tag}>"), "").replace(&format!("</{tag}>"), "")
            });
            marked
                .replace("<mfrac>", "[")
                .replace("</mfrac>", "]")
                .replace("<msup>", "^[")
                .replace("</msup>", "]")
        };
        for (text, wanted) in [
            ("a - (b - c)", "a−(b−c)"),
            ("a - b - c", "a−b−c"),
            ("(a - b)*c", "(a−b)⋅c"),
            ("a*(b*c)", "a⋅(b⋅c)"),
            ("-(a + b)", "−(a+b)"),
            ("a + -b", "a+(−b)"),
            ("-a^2", "−^[a2]"),
            ("(-a)^2", "^[(−a)2]"),
            ("-a*b*c", "−a⋅b⋅c"),
            ("a - -b*c", "a−(−b⋅c)"),
            ("a*(-b*c)", "a⋅(−b⋅c)"),
            ("(a + b)/(c - d)", "[a+bc−d]"),
            ("(a/b)^2", "^[([ab])2]"),
            ("a^b", "^[ab]"),
            ("exp(a)^2", "^[(^[ea])2]"),
            ("2*exp(a)", "2⋅^[ea]"),
        ] {
            assert_eq!(plain(text), wanted, "{text}");
        }
    }

    #[test]
    fn an_operand_has_brackets_where_it_would_fall_apart() {
        let has_brackets = |text: &str, operand| {
            let mut nodes = Nodes::default();
            let root = nodes.parse(text, 0).unwrap();
            expression(&nodes, root, operand) != expression(&nodes, root, Operand::None)
        };
        let all = [Operand::FirstTerm, Operand::Term, Operand::FirstFactor, Operand::Factor];
        for (text, wanted) in [
            ("a", [false; 4]),
            ("a/b", [false; 4]),
            ("a*b", [false, false, false, true]),
            ("a - b", [false, true, true, true]),
            ("-a", [false, true, true, true]),
            ("if(a < 1, a, b)", [true; 4]),
        ] {
            assert_eq!(all.map(|operand| has_brackets(text, operand)), wanted, "{text}");
        }
    }

    #[test]
    fn names_numbers_and_functions_have_their_forms() {
        assert_eq!(set("p_a"), "<msub><mi>p</mi><mtext>a</mtext></msub>");
        assert_eq!(set("omega_in_x"), "<msub><mi>ω</mi><mtext>in x</mtext></msub>");
        assert_eq!(set("sqrt(x)"), "<msqrt><mi>x</mi></msqrt>");
        assert_eq!(set("abs(x)"), "<mo>|</mo><mi>x</mi><mo>|</mo>");
        assert_eq!(set("exp(x)"), "<msup><mi>e</mi><mi>x</mi></msup>");
        assert_eq!(set("tanh(x)"), "<mi>tanh</mi><mo>(</mo><mi>x</mi><mo>)</mo>");
        assert_eq!(set("delay(x, tau)"), "<mi>x</mi><mo>(</mo><mi>t</mi><mo>−</mo><mi>τ</mi><mo>)</mo>");
        assert_eq!(
            set("delay(2*x, a + b)"),
            "<msub><mo>(</mo><mn>2</mn><mo>⋅</mo><mi>x</mi><mo>)</mo><mi>t</mi><mo>−</mo><mo>(</mo><mi>a</mi><mo>+</mo><mi>b</mi>\
             <mo>)</mo></msub>"
        );
        assert_eq!(set("0.3[bar]"), "<mn>0.3</mn><mspace width=\"0.2em\"/><mtext>bar</mtext>");
        let cases = set("if(x < 1, a, b)");
        let first = "<mo>{</mo><mtable><mtr><mtd><mi>a</mi></mtd><mtd><mtext>if </mtext>";
        assert!(cases.starts_with(first), "{cases}");
        assert!(cases.contains("<mo>&lt;</mo>"), "{cases}");
        // Without brackets its last line goes on with what stands behind.
        for text in
            ["if(x < 1, a, b)*c", "if(x < 1, a, b) + c", "max(if(x < 1, a, b), c)", "if(x < 1, a, b)^2"]
        {
            let bracketed = format!("<mo>(</mo>{cases}<mo>)</mo>");
            assert!(set(text).contains(&bracketed), "{text}: {}", set(text));
        }
    }
}
