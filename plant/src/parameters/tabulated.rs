//! Reads `[[tabulated]]` of a rig file.
//!
//! ```text
//! [[tabulated]]
//! balance = "drive.force"      # drive or load; force, flow-a or flow-b
//! variable = "x"               # x, v, |v|, sign(v), u, p_a, p_b, p_a-p_b, x sign(v) of that axis
//! at = [0.0, 0.1, 0.4]         # strictly growing: m, m/s, a plain number, Pa
//! value_n = [0.0, -4.0, -9.5]  # along the axis' own extension; value_nl_per_min into a chamber
//! ```

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::reader::{ParameterError, Place as Text};
use crate::effects::tabulated::{Balance, POINTS, Tabulated, Variable};
use crate::state::Axis;

/// Largest number that a variable can have: pressures are far below.
const MOST_AT: f64 = 1e8;

/// All tables of the file, in its order.
pub(super) fn read(root: &DeTable<'_>, text: &Text<'_>) -> Result<Vec<Tabulated>, ParameterError> {
    let Some((_, value)) = root.iter().find(|(name, _)| name.get_ref() == "tabulated") else {
        return Ok(Vec::new());
    };
    let tables = || text.wrong("tabulated", value, "tables, each under [[tabulated]]");
    let DeValue::Array(items) = value.get_ref() else { return Err(tables()) };
    items.iter().map(|item| read_one(item.get_ref().as_table().ok_or_else(tables)?, item, text)).collect()
}

fn read_one(
    table: &DeTable<'_>,
    item: &Spanned<DeValue<'_>>,
    text: &Text<'_>,
) -> Result<Tabulated, ParameterError> {
    let line = text.line(item.span().start);
    let places = || -> Vec<(String, Axis, Balance)> {
        let axes = Axis::ALL.into_iter();
        axes.flat_map(|axis| Balance::ALL.map(|own| (format!("{}.{}", axis.name(), own.name()), axis, own)))
            .collect()
    };
    let known = places().into_iter().map(|(name, ..)| name).collect::<Vec<_>>().join(", ");
    let balance = word(table, "balance", line, text, &known)?;
    let (_, axis, balance) = places()
        .into_iter()
        .find(|(name, ..)| *name == balance.0)
        .ok_or_else(|| text.wrong("tabulated.balance", balance.1, &known))?;
    let known = Variable::ALL.map(Variable::name).join(", ");
    let variable = word(table, "variable", line, text, &known)?;
    let variable = Variable::ALL
        .into_iter()
        .find(|own| own.name() == variable.0)
        .ok_or_else(|| text.wrong("tabulated.variable", variable.1, &known))?;
    let keys = ["balance", "variable", "at", balance.key()];
    if let Some((name, value)) = table.iter().find(|(name, _)| !keys.contains(&name.get_ref().as_ref())) {
        let path = format!("tabulated.{}", name.get_ref());
        return Err(text.unknown(name, &path, value, &keys.join(", ")));
    }
    let at = numbers(table, "at", MOST_AT, line, text)?;
    let value = numbers(table, balance.key(), balance.most(), line, text)?;
    let broken = |key: &str, rule: &str| {
        let value = table.get(key).expect("it was read");
        text.of_value(&format!("tabulated.{key}"), value, &format!("contradicts another key: {rule}"))
    };
    if at.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(broken("at", "each number must be above the one before"));
    }
    if at.len() != value.len() {
        let rule = format!("it must hold as many numbers as tabulated.at, {}, not {}", at.len(), value.len());
        return Err(broken(balance.key(), &rule));
    }
    Ok(Tabulated { axis, balance, variable, at, value })
}

/// The word of a key, and its value for a message.
fn word<'v>(
    table: &'v DeTable<'_>,
    key: &str,
    line: usize,
    text: &Text<'_>,
    known: &str,
) -> Result<(&'v str, &'v Spanned<DeValue<'v>>), ParameterError> {
    let path = format!("tabulated.{key}");
    let value = table.get(key).ok_or_else(|| text.missing(line, &path, known))?;
    let word = value.get_ref().as_str();
    Ok((word.ok_or_else(|| text.wrong(&path, value, known))?, value))
}

/// The numbers of a key, each within `most` of 0.
fn numbers(
    table: &DeTable<'_>,
    key: &str,
    most: f64,
    line: usize,
    text: &Text<'_>,
) -> Result<Vec<f64>, ParameterError> {
    let [fewest, many] = POINTS;
    let range = format!("{fewest} to {many} numbers, each -{most} to {most}");
    let path = format!("tabulated.{key}");
    let value = table.get(key).ok_or_else(|| text.missing(line, &path, &range))?;
    let numbers: Option<Vec<f64>> = match value.get_ref() {
        DeValue::Array(items) => items.iter().map(|item| settings::number(item.get_ref())).collect(),
        _ => None,
    };
    let numbers = numbers.ok_or_else(|| text.wrong(&path, value, &range))?;
    // Written so that a NaN, which TOML admits, fails.
    if (fewest..=many).contains(&numbers.len()) && numbers.iter().all(|own| own.abs() <= most) {
        return Ok(numbers);
    }
    Err(text.out_of_range(&path, value, &range))
}
