//! Laws of a library that a file of suspects uses: variables of their own, which it binds to those of the rig.
//!
//! ```text
//! use = "friction/position-dependent"      ->  add = "-1*(slope*(x)*(sign(v)))"
//! times = "-1"                                 parameters.slope = { unit = "N/m", range = [-200, 200] }
//! parameters.slope.range = [-200, 200]
//! ```
//!
//! A variable that is called as one of the rig stands for it unless `with` has another. A fixed number becomes a constant of
//! the expression; one that is called as a variable of the rig has the suspect's name before its own. Who reads the file has the
//! laws.

use super::declared::unit_at;
use crate::effects::declared::{Number, VARIABLES};
use expression::grammar::renamed;
use expression::units::Unit;
use settings::{Result, Section, Source};

/// A law of a library, as a file of suspects names it.
#[derive(Debug, Clone, PartialEq)]
pub struct Law {
    /// What reports call it unless the file has a name.
    pub name: String,
    /// What is added, over its variables and numbers.
    pub add: String,
    /// Variables that it uses.
    pub variables: Vec<LawVariable>,
    /// Its numbers, the first an amplitude.
    pub numbers: Vec<LawNumber>,
}

/// A variable of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawVariable {
    /// Its name in expressions of the library.
    pub name: String,
    /// What it means.
    pub about: String,
    /// Expression of other variables that stands for it where the file binds nothing to it.
    pub default: Option<String>,
}

/// A number of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawNumber {
    /// As the law writes it.
    pub name: String,
    /// Unit that it usually has.
    pub unit: String,
    /// Its usual size in SI, if the library has one.
    pub value_si: Option<f64>,
    /// Least and largest value in SI; infinite where the library has none.
    pub range_si: [f64; 2],
    /// It is known and not fitted.
    pub is_fixed: bool,
    /// 0 is the rig without the law.
    pub is_amplitude: bool,
}

/// Finds the law that `use` names, or says why there is none.
pub type Laws<'a> = &'a dyn Fn(&str) -> Result<Law, String>;

/// A law with what a file binds to it.
pub(super) struct BoundLaw {
    pub(super) name: String,
    pub(super) add: String,
    /// Byte of the file at which the law is named: what is wrong in its expression is reported there.
    pub(super) at: usize,
    pub(super) numbers: Vec<Number>,
}

/// Reads what stands beside `use` in a suspect; `None` where it has none.
pub(super) fn bound_law(
    section: &mut Section<'_>,
    source: &Source<'_>,
    laws: Laws<'_>,
) -> Result<Option<BoundLaw>> {
    let Some(used) = section.text("use")? else { return Ok(None) };
    let law = laws(&used.text).map_err(|why| source.wrong_from(used.at, &format!("use: {why}")))?;
    if let Some(key) = ["add", "memory"].into_iter().find(|key| section.has(key)) {
        return Err(section.wrong_at(key, &format!("{key}: the law of the library stands in its place")));
    }
    let name = section.text("name")?.map_or_else(|| law.name.clone(), |text| text.text);
    let mut bindings = variables(section, &law)?;
    let numbers = numbers(section, source, (&law, &name), &mut bindings)?;
    let of = |part: &str| bindings.iter().find(|(name, _)| name == part).map(|(_, text)| text.clone());
    let mut add = renamed(&law.add, &of);
    if let Some(times) = section.text("times")? {
        add = format!("({})*({add})", times.text);
    }
    Ok(Some(BoundLaw { name, add, at: used.at, numbers }))
}

/// The expression that each variable of the law is bound to.
fn variables(section: &mut Section<'_>, law: &Law) -> Result<Vec<(String, String)>> {
    let mut with = section.section("with")?;
    let mut given = Vec::new();
    for variable in &law.variables {
        let text = with.as_mut().map(|with| with.text(&variable.name)).transpose()?.flatten();
        given.extend(text.map(|text| (variable.name.clone(), format!("({})", text.text))));
    }
    if let Some(with) = with {
        with.finish()?;
    }
    let binding = |variable: &LawVariable| {
        binding_of(law, &given, &variable.name, law.variables.len())
            .map(|text| (variable.name.clone(), text))
            .map_err(|why| section.wrong(&why))
    };
    law.variables.iter().map(binding).collect()
}

/// The expression of a variable: what the file binds to it, the rig's variable of its name, or its default.
fn binding_of(law: &Law, given: &[(String, String)], name: &str, depth: usize) -> Result<String, String> {
    if let Some((_, text)) = given.iter().find(|(other, _)| other == name) {
        return Ok(text.clone());
    }
    if is_of_rig(name) {
        return Ok(name.to_owned());
    }
    let of = |name: &str| law.variables.iter().find(|one| one.name == name);
    let Some(default) = of(name).and_then(|one| one.default.as_ref()) else {
        let about = of(name).map_or("", |one| &one.about);
        return Err(format!("with.{name} is missing: {about}"));
    };
    if depth == 0 {
        return Err(format!("with.{name}: its default stands in itself"));
    }
    let missing = std::cell::RefCell::new(None);
    let inner = |part: &str| {
        of(part)?;
        binding_of(law, given, part, depth - 1).map_err(|why| missing.replace(Some(why))).ok()
    };
    let text = format!("({})", renamed(default, &inner));
    missing.into_inner().map_or(Ok(text), Err)
}

fn is_of_rig(name: &str) -> bool {
    VARIABLES.iter().any(|(variable, ..)| *variable == name)
}

/// The numbers of the law with what the file says of them; `bindings` gets what they are called in the expression.
fn numbers(
    section: &mut Section<'_>,
    source: &Source<'_>,
    (law, suspect): (&Law, &str),
    bindings: &mut Vec<(String, String)>,
) -> Result<Vec<Number>> {
    let mut given = section.section("parameters")?;
    let mut numbers = Vec::new();
    for number in &law.numbers {
        let table = given.as_mut().map(|given| given.section(&number.name)).transpose()?.flatten();
        let read = match table {
            Some(mut table) => {
                let read = read_number(number, Some((&mut table, source)))?;
                table.finish()?;
                read
            }
            None => read_number(number, None)?,
        };
        let read = read.map_err(|why| section.wrong(&format!("parameters.{}.{why}", number.name)))?;
        if number.is_fixed {
            let unit = if read.unit.text == "1" { String::new() } else { format!("[{}]", read.unit.text) };
            let constant = format!("{:?}{unit}", read.value.abs());
            let sign = if read.value < 0.0 { "-" } else { "" };
            bindings.push((number.name.clone(), format!("({sign}{constant})")));
            continue;
        }
        let name = match is_of_rig(&number.name) {
            true => format!("{}_{}", suspect.replace('-', "_"), number.name),
            false => number.name.clone(),
        };
        bindings.push((number.name.clone(), name.clone()));
        numbers.push(Number { name, ..read });
    }
    given.map_or(Ok(()), |given| given.finish())?;
    Ok(numbers)
}

/// A number of a library with what the file has in place of it, or what is missing.
fn read_number(
    number: &LawNumber,
    table: Option<(&mut Section<'_>, &Source<'_>)>,
) -> Result<Result<Number, String>> {
    let usual = Unit::parse(&number.unit).unwrap_or_else(|_| Unit::one());
    let (mut unit, mut values, mut ends, mut priors) = (usual.clone(), Vec::new(), Vec::new(), Vec::new());
    if let Some((table, source)) = table {
        let read = unit_at(table, source, "unit")?;
        if table.has("unit") {
            unit = read;
        }
        (values, ends, priors) = (table.numbers("value")?, table.numbers("range")?, table.numbers("prior")?);
    }
    // As it was written, without what the way to SI and back has left; in another dimension only 0 stays.
    let stays = |si: f64| unit.dimension == usual.dimension || si == 0.0;
    let written = |si: f64| format!("{:.9e}", si / unit.factor).parse().unwrap_or(si / unit.factor);
    let of_library = number.value_si.filter(|si| stays(*si)).map(written);
    let value = match (values.as_slice(), number.is_amplitude) {
        ([], true) => 0.0,
        (_, true) => {
            return Ok(Err("value: it is 0 where the suspect is off; prior is how large it is".into()));
        }
        ([value], false) => *value,
        ([], false) => match of_library {
            Some(value) => value,
            None => return Ok(Err(format!("value is missing: the library has none, in {}", unit.text))),
        },
        _ => return Ok(Err("value: allowed is one number".into())),
    };
    let name = number.name.clone();
    if number.is_fixed {
        return Ok(Ok(Number { name, unit, value, range: [value; 2], prior: None }));
    }
    let range = match (ends.as_slice(), number.range_si) {
        ([least, most], _) if least < most && least.abs().max(most.abs()) <= 1e12 => [*least, *most],
        ([], [least, most]) if least.is_finite() && most.is_finite() && stays(least) && stays(most) => {
            [written(least), written(most)]
        }
        ([], _) => {
            return Ok(Err(format!("range is missing: the least and the largest value, in {}", unit.text)));
        }
        _ => return Ok(Err("range: needed are the least and the largest value, within 1e12 of 0".into())),
    };
    if !(range[0]..=range[1]).contains(&value) {
        return Ok(Err(format!("range: {} to {} does not hold {value}", range[0], range[1])));
    }
    let prior = match priors.as_slice() {
        [] => of_library.filter(|prior| number.is_amplitude && *prior > 0.0 && *prior <= range[1]),
        [one] if *one > 0.0 => Some(*one),
        _ => return Ok(Err("prior: allowed is one number above 0".into())),
    };
    Ok(Ok(Number { name, unit, value, range, prior }))
}
