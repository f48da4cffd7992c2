//! What the columns of a table are: the time, inputs, outputs, their names and units.

use super::columns::Table;
use super::{NewError, Roles};
use crate::stats::median;
use model::{RESERVED, Unit, with_powers};
use records::{ColumnOptions, read_columns};
use std::path::Path;

/// Words in the names of columns that drive a plant.
const INPUT_WORDS: [&str; 23] = [
    "u",
    "in",
    "input",
    "cmd",
    "command",
    "set",
    "setpoint",
    "ref",
    "reference",
    "target",
    "valve",
    "ventil",
    "pump",
    "control",
    "duty",
    "pwm",
    "heater",
    "power",
    "torque",
    "throttle",
    "excitation",
    "actuator",
    "stimulus",
];
/// Share of the samples that are as the one before in a column of steps.
const STEPWISE: f64 = 0.5;

/// Why a column has the role that the user gave it.
const ASKED: &str = "named on the command line";

/// The column of the time.
pub(super) struct TimeColumn {
    pub(super) column: String,
    pub(super) unit: String,
    /// Median distance of samples, and that of the last from the first, s.
    pub(super) step_s: f64,
    pub(super) length_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Input,
    Output,
    LeftOut,
}

/// A column beside the time.
pub(super) struct Column {
    pub(super) column: String,
    pub(super) name: String,
    pub(super) unit: String,
    /// What is to be said of the unit.
    pub(super) remark: Option<&'static str>,
    pub(super) role: Role,
    /// Why it has its role.
    pub(super) why: &'static str,
    pub(super) is_stepwise: bool,
    /// Its name is that of something that drives.
    pub(super) is_of_a_drive: bool,
    pub(super) mean: f64,
    pub(super) largest: f64,
    /// Time in which it forgets itself to 1/e, s.
    pub(super) correlation_s: f64,
    /// Its samples, a hole filled with the one before.
    values: Vec<f64>,
}

impl Column {
    /// Why it has its role, as a comment.
    pub(super) fn reason(&self) -> String {
        if self.why == ASKED { ASKED.into() } else { format!("guessed: {}", self.why) }
    }
}

pub(super) fn columns(
    record: &Path,
    table: &Table,
    roles: Roles<'_>,
) -> Result<(TimeColumn, Vec<Column>), NewError> {
    let file = || record.display().to_string();
    let numbers: Vec<&str> = (0..table.head.len())
        .filter(|index| table.is_number[*index])
        .map(|index| table.head[index].as_str())
        .collect();
    let Some(first) = numbers.first() else { return Err(NewError::Head { file: file() }) };
    let calendar = table.head.iter().zip(&table.is_calendar).find(|(_, is)| **is).map(|(name, _)| name);
    let options = ColumnOptions {
        time: calendar.map_or(first, String::as_str),
        time_unit_s: 1.0,
        is_calendar: calendar.is_some(),
        columns: &numbers,
        separator: &table.separator,
        is_decimal_comma: table.is_decimal_comma,
        comment: "#",
        skip_lines: table.skip_lines,
        absent: &table.absent,
    };
    let read = read_columns(record, &options)?;
    let values: Vec<Vec<f64>> = read.values.into_iter().map(filled).collect();
    let grows =
        |index: &usize| values[*index].len() > 1 && values[*index].windows(2).all(|pair| pair[0] < pair[1]);
    let is_time = |index: &usize| {
        let name = numbers[*index].to_lowercase();
        name.starts_with("time")
            || name.starts_with("zeit")
            || name == "t"
            || name.starts_with("t_")
            || name.starts_with("t ")
    };
    let growing: Vec<usize> = (0..numbers.len()).filter(grows).collect();
    let named = growing.iter().find(|index| is_time(index)).copied();
    let is_growing = read.time_s.len() > 1 && read.time_s.windows(2).all(|pair| pair[0] < pair[1]);
    let time = match (named, calendar.filter(|_| is_growing)) {
        (None, Some(column)) => {
            TimeColumn { column: column.into(), unit: "iso8601".into(), ..time(("", None), &read.time_s) }
        }
        _ => {
            let Some(place) = named.or(growing.first().copied()) else {
                return Err(NewError::Time { file: file() });
            };
            let at = table.head.iter().position(|name| name == numbers[place]).unwrap_or(0);
            time((numbers[place], table.unit(at)), &values[place])
        }
    };
    let mut all: Vec<Column> = Vec::new();
    for (index, name) in table.head.iter().enumerate().filter(|(_, name)| **name != time.column) {
        let samples = numbers.iter().position(|number| number == name).filter(|_| table.is_number[index]);
        let samples = samples.map_or(Vec::new(), |number| values[number].clone());
        let column = column((name, table.unit(index)), samples, time.step_s, &all);
        all.push(column);
    }
    let inputs = roles.inputs.iter().map(|name| (name, Role::Input));
    for (name, role) in inputs.chain(roles.outputs.iter().map(|name| (name, Role::Output))) {
        let asked = all.iter_mut().find(|column| column.column == *name && !column.values.is_empty());
        let Some(column) = asked else {
            let known = all.iter().filter(|column| !column.values.is_empty());
            let known = known.map(|column| column.column.as_str()).collect::<Vec<_>>().join(", ");
            return Err(NewError::Column { file: file(), name: name.clone(), known });
        };
        (column.role, column.why) = (role, ASKED);
    }
    // Something must be measured.
    if all.iter().all(|column| column.role != Role::Output) {
        let last = all.iter_mut().rev().find(|column| column.role == Role::Input);
        let Some(last) = last else { return Err(NewError::Flat { file: file(), name: time.column }) };
        (last.role, last.why) = (Role::Output, "the last column, where none looks like an output");
    }
    Ok((time, all))
}

fn filled(values: Vec<Option<f64>>) -> Vec<f64> {
    let mut last = values.iter().flatten().next().copied().unwrap_or(0.0);
    let fill = |value: Option<f64>| {
        last = value.unwrap_or(last);
        last
    };
    values.into_iter().map(fill).collect()
}

fn time((column, unit): (&str, Option<&str>), values: &[f64]) -> TimeColumn {
    let (_, unit, _) = named_with(column, unit);
    let is_time = Unit::parse(&unit).is_ok_and(|unit| unit.dimension == model::Dimension::TIME);
    let unit = if is_time { unit } else { "s".to_owned() };
    let factor = Unit::parse(&unit).map_or(1.0, |unit| unit.factor);
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let step = median(&mut steps).expect("a time that grows has two values");
    let length = values[values.len() - 1] - values[0];
    TimeColumn { column: column.into(), unit, step_s: step * factor, length_s: length * factor }
}

fn column((column, unit): (&str, Option<&str>), values: Vec<f64>, step_s: f64, others: &[Column]) -> Column {
    let (base, unit, remark) = named_with(column, unit);
    let mut name: String =
        base.chars().map(|character| if character.is_alphanumeric() { character } else { '_' }).collect();
    name = name.trim_matches('_').chars().take(40).collect();
    if name.is_empty() || name.starts_with(|first: char| first.is_numeric()) {
        name = format!("column_{name}").trim_end_matches('_').to_owned();
    }
    while RESERVED.contains(&name.as_str()) || others.iter().any(|other| other.name == name) {
        name.push('_');
    }
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let same = values.windows(2).filter(|pair| pair[0] == pair[1]).count() as f64 / count;
    let is_flat = values.windows(2).all(|pair| pair[0] == pair[1]);
    let words: Vec<String> =
        base.split(|character: char| !character.is_alphanumeric()).map(str::to_lowercase).collect();
    let is_named = words.iter().any(|word| INPUT_WORDS.contains(&word.as_str()));
    let is_stepwise = same > STEPWISE;
    let (role, why) = match () {
        () if values.is_empty() => (Role::LeftOut, "it holds no numbers"),
        () if is_flat => (Role::LeftOut, "it keeps one value"),
        () if is_named => (Role::Input, "its name is that of something that drives"),
        () if is_stepwise => (Role::Input, "it keeps its value over most samples"),
        () => (Role::Output, "neither its name nor steps in it say that it drives"),
    };
    let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let correlation_s = forgotten(&values, mean) as f64 * step_s;
    Column {
        column: column.into(),
        name,
        unit,
        remark,
        role,
        why,
        is_stepwise,
        is_of_a_drive: is_named,
        mean,
        largest,
        correlation_s,
        values,
    }
}

/// Samples after which the autocovariance has fallen to 1/e, at most a tenth of all.
fn forgotten(values: &[f64], mean: f64) -> usize {
    let covariance = |lag: usize| -> f64 {
        let pairs = values.iter().zip(&values[lag..]);
        pairs.map(|(one, other)| (one - mean) * (other - mean)).sum()
    };
    if values.is_empty() {
        return 1;
    }
    // Each lag is a third more than the one before: a first value needs no more.
    let (most, variance) = (values.len() / 10, covariance(0));
    let mut lag = 1;
    while lag < most && covariance(lag) > variance * core::f64::consts::E.recip() {
        lag += 1 + lag / 3;
    }
    lag
}

/// Slope of the straight line of an output over an input.
pub(super) fn slope(input: &Column, output: &Column) -> f64 {
    let pairs = input.values.iter().zip(&output.values);
    let product: f64 = pairs.map(|(x, y)| (x - input.mean) * (y - output.mean)).sum();
    let square: f64 = input.values.iter().map(|x| (x - input.mean).powi(2)).sum();
    if square > 0.0 { product / square } else { 0.0 }
}

/// Name and unit of a column: `force [N]`, `force (N)`, `force_N`, `p_bar_g`, `speed_m_per_s`.
fn named_with(column: &str, unit: Option<&str>) -> (String, String, Option<&'static str>) {
    let (name, of_name, remark) = named(column);
    let Some(unit) = unit else { return (name, of_name, remark) };
    // As if it stood in the name.
    match named(&format!("{column} [{unit}]")) {
        (base, unit, remark) if base == column.trim() => (name, unit, remark),
        _ => (name, of_name, remark),
    }
}

/// The name of a column, its unit and what is to be said of that.
fn named(column: &str) -> (String, String, Option<&'static str>) {
    let known = |text: &str| Unit::parse(text).is_ok_and(|unit| !unit.text.is_empty());
    let celsius = |name: &str, unit: &str| {
        ["degC", "°C"].contains(&unit) || unit == "C" && name.starts_with(['t', 'T'])
    };
    let found = |name: &str, unit: &str| {
        if celsius(name, unit) {
            let remark = "degrees Celsius: differences are right, the zero is not that of kelvin";
            return Some((name.trim().to_owned(), "K".to_owned(), Some(remark)));
        }
        known(unit).then(|| (name.trim().to_owned(), unit.to_owned(), None))
    };
    let unit_between = |unit: &str| if known(unit) { unit.to_owned() } else { with_powers(unit) };
    for (open, close) in [('[', ']'), ('(', ')')] {
        let inner = column.strip_suffix(close).and_then(|rest| rest.rsplit_once(open));
        if let Some(found) = inner.and_then(|(name, unit)| found(name, &unit_between(unit.trim()))) {
            return found;
        }
    }
    // Gauge and absolute pressure have the same unit.
    let stem = ["_g", "_abs", "_rel"]
        .iter()
        .find_map(|end| column.strip_suffix(end))
        .filter(|stem| stem.contains("bar") || stem.contains("Pa"));
    let stem = stem.unwrap_or(column);
    for (place, _) in stem.match_indices('_') {
        let unit = stem[place + 1..].replace("_per_", "/").replace('_', " ");
        // A unit of one letter such as `a` is none, and `1` is no unit that a name has.
        let is_word =
            unit.chars().all(|character| character.is_alphabetic() || "/ 0123456789^".contains(character));
        if let Some(found) = Some(&unit)
            .filter(|unit| is_word && !unit.starts_with(char::is_numeric))
            .and_then(|unit| found(&stem[..place], unit))
        {
            return found;
        }
    }
    (column.to_owned(), "1".into(), None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_from_names_in_the_ways_that_people_write_them() {
        for (column, name, unit) in [
            ("force [N]", "force", "N"),
            ("Speed (m/s)", "Speed", "m/s"),
            ("drive_position_m", "drive_position", "m"),
            ("p_bar_g", "p", "bar"),
            ("speed_m_per_s", "speed", "m/s"),
            ("q_ref_m", "q_ref", "m"),
            ("pulse_raw", "pulse_raw", "1"),
            ("drive_pressure_a_Pa", "drive_pressure_a", "Pa"),
            ("oven [degC]", "oven", "K"),
            ("level", "level", "1"),
            ("2", "2", "1"),
            ("stress [N/mm2]", "stress", "N/mm^2"),
            ("flow (cm³/s)", "flow", "cm^3/s"),
            ("u_V2", "u_V2", "1"),
        ] {
            let (found, written, _) = named(column);
            assert_eq!((found.as_str(), written.as_str()), (name, unit), "{column}");
        }
    }

    #[test]
    fn a_first_order_decay_forgets_itself_in_about_its_time_constant() {
        // A random telegraph through a lag of 20 samples.
        let (mut state, mut y, mut seed) = (1.0, 0.0, 7_u64);
        let mut values = Vec::new();
        for _ in 0..20_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if seed >> 60 == 0 {
                state = -state;
            }
            y += (state - y) / 20.0;
            values.push(y);
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!((8..80).contains(&forgotten(&values, mean)), "{}", forgotten(&values, mean));
    }
}
