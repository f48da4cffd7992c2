//! Precedence, the byte of an error, and hostile sizes.

use super::*;

/// A tree as a text with all its brackets.
fn shown(nodes: &Nodes, place: NodeId) -> String {
    match &nodes.get(place).kind {
        Kind::Number(value, _) => value.to_string(),
        Kind::Name(name) => name.clone(),
        Kind::Negation(inner) => format!("(-{})", shown(nodes, *inner)),
        Kind::Binary(operator, left, right) => {
            format!("({operator:?} {} {})", shown(nodes, *left), shown(nodes, *right))
        }
        Kind::Call(name, arguments) => {
            let arguments: Vec<_> = arguments.iter().map(|argument| shown(nodes, *argument)).collect();
            format!("{name}({})", arguments.join(","))
        }
    }
}

fn read(text: &str) -> Result<String> {
    let mut nodes = Nodes::default();
    nodes.parse(text, 0).map(|place| shown(&nodes, place))
}

#[test]
fn operators_bind_as_in_a_book() {
    for (text, tree) in [
        ("1 - 2 - 3", "(Subtract (Subtract 1 2) 3)"),
        ("a+b*c", "(Add a (Multiply b c))"),
        ("-x^2", "(-(Power x 2))"),
        ("2^-3^2", "(Power 2 (-(Power 3 2)))"),
        ("a < b and c >= d or e", "(Or (And (Less a b) (LessOrEqual d c)) e)"),
        ("order * andy", "(Multiply order andy)"),
        ("if(x > 0, max(a, b), f())", "if(Less 0 x),max(a,b),f())".replace("if(", "if((").as_str()),
        ("10[mm] + .5e-3", "(Add 0.01 0.0005)"),
        ("2e", "?"),
    ] {
        let expected = if tree == "?" { None } else { Some(tree.to_owned()) };
        assert_eq!(read(text).ok(), expected, "{text}");
    }
}

#[test]
fn what_is_wrong_is_reported_at_its_byte() {
    for (text, at) in [
        ("", 0),
        ("a +", 3),
        ("a ? b", 2),
        ("(a", 2),
        ("a)", 1),
        ("f(a b)", 4),
        ("3[blub]", 2),
        ("3[mm", 2),
        ("1e999", 0),
        ("a b", 2),
    ] {
        assert_eq!(read(text).map_err(|wrong| wrong.at), Err(at), "{text}");
    }
}

#[test]
fn hostile_sizes_are_refused_without_the_stack() {
    for text in [
        format!("{}1{}", "(".repeat(100_000), ")".repeat(100_000)),
        "-".repeat(100_000) + "1",
        "abs(".repeat(100_000) + "1",
        vec!["1"; 100_000].join("^"),
        vec!["1"; 1000].join("<"),
    ] {
        let why = read(&text).expect_err("too large").why;
        assert!(why.contains("deeper than 64"), "{why}");
    }
    for text in [format!("max({})", vec!["1"; 20_000].join(",")), vec!["1"; 1_000_000].join("+")] {
        assert!(read(&text).expect_err("too many").why.contains("more than 10000"));
    }
    let brackets = format!("{}1{}", "(".repeat(65), ")".repeat(65));
    assert_eq!(read(&brackets).expect_err("too deep").at, 64, "at the first bracket that is too many");
}
