//! Reads `[[tabulated]]` of a rig file.
//!
//! ```text
//! [[tabulated]]
//! balance = "drive.force"      # drive or load; force, flow-a or flow-b
//! variable = "x"               # x, v, |v|, sign(v), u, p_a, p_b, p_a-p_b, x sign(v) of that axis
//! at = [0.0, 0.1, 0.4]         # strictly growing: m, m/s, a plain number, Pa
//! value_n = [0.0, -4.0, -9.5]  # along the axis' own extension; value_nl_per_min into a chamber
//! ```

use settings::{Result, Section};

use crate::effects::tabulated::{Balance, POINTS, Tabulated, Variable};
use crate::state::Axis;

/// Largest number that a variable can have: pressures are far below.
const MOST_AT: f64 = 1e8;

/// All tables of the file, in its order.
pub(super) fn read(root: &mut Section<'_>) -> Result<Vec<Tabulated>> {
    root.sections("tabulated")?.into_iter().map(read_one).collect()
}

fn read_one(mut section: Section<'_>) -> Result<Tabulated> {
    let balances = Axis::ALL.map(|axis| {
        Balance::ALL.map(|balance| (format!("{}.{}", axis.name(), balance.name()), (axis, balance)))
    });
    let balances: Vec<_> = balances.iter().flatten().map(|(name, place)| (name.as_str(), *place)).collect();
    let (axis, balance) = section.needed_choice("balance", &balances)?;
    let variable =
        section.needed_choice("variable", &Variable::ALL.map(|variable| (variable.name(), variable)))?;
    section.allow(&["balance", "variable", "at", balance.key()])?;
    let at = numbers(&section, "at", MOST_AT)?;
    let value = numbers(&section, balance.key(), balance.most())?;
    if at.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(section.refused("at", "each number must be above the one before"));
    }
    if at.len() != value.len() {
        let rule = format!("it must hold as many numbers as at, {}, not {}", at.len(), value.len());
        return Err(section.refused(balance.key(), &rule));
    }
    Ok(Tabulated { axis, balance, variable, at, value })
}

/// The numbers of a key, each within `most` of 0.
fn numbers(section: &Section<'_>, key: &str, most: f64) -> Result<Vec<f64>> {
    let [fewest, many] = POINTS;
    // A NaN, which TOML admits, is within nothing.
    let fits = |numbers: &Vec<f64>| {
        (fewest..=many).contains(&numbers.len()) && numbers.iter().all(|number| number.abs() <= most)
    };
    let allowed = format!("allowed are {fewest} to {many} numbers, each -{most} to {most}");
    section.peek_numbers(key).filter(fits).ok_or_else(|| section.refused(key, &allowed))
}
