//! A dimension in the units that a file has, for messages: `V/s` where a file has volts, and not kg m^2 s^-4 A^-1.

use crate::file::Model;
use crate::units::{Dimension, Unit};
use expression::dimensions::familiar;

/// Powers in which a unit of the file is tried, the plainest first.
const POWERS: [f64; 10] = [1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 1.5, -1.5, 3.0, -3.0];

/// A unit of this dimension: one of the file, the shortest, or a product of powers of two of them and the second; else of SI.
pub(crate) fn unit_of(model: &Model, dimension: Dimension) -> Unit {
    if dimension == Dimension::NONE {
        return Unit::one();
    }
    let units = model.inputs.iter().map(|one| &one.unit);
    let units = units.chain(model.states.iter().map(|one| &one.unit));
    let units = units.chain(model.parameters.iter().map(|one| &one.unit));
    let units = units.chain(model.memories.iter().map(|one| &one.unit));
    let units: Vec<&Unit> = units.chain(model.outputs.iter().map(|one| &one.unit)).collect();
    let shortest = units.iter().filter(|unit| unit.dimension == dimension).min_by_key(|unit| unit.text.len());
    if let Some(shortest) = shortest {
        return (*shortest).clone();
    }
    let mut names: Vec<&str> = vec!["s"];
    for unit in units {
        let is_name = unit.text != "1" && unit.text.chars().all(char::is_alphabetic);
        if is_name && !names.contains(&unit.text.as_str()) {
            names.push(&unit.text);
        }
    }
    let of = |name: &str| Unit::parse(name).map_or(Dimension::NONE, |unit| unit.dimension);
    let powers = |name: &'_ str| {
        POWERS.into_iter().filter_map(move |power| Some((power, of(name).to_the(power)?))).collect::<Vec<_>>()
    };
    let all: Vec<(&str, Vec<(f64, Dimension)>)> = names.iter().map(|name| (*name, powers(name))).collect();
    let mut best: Option<(f64, String)> = None;
    let mut offer = |cost: f64, factors: &[(&str, f64)]| {
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, written(factors)));
        }
    };
    for (place, (name, powers)) in all.iter().enumerate() {
        for (power, made) in powers {
            if *made == dimension {
                offer(power.abs(), &[(name, *power)]);
            }
            for (other, others) in &all[..place] {
                for (second, more) in others {
                    if made.times(*more) == dimension {
                        offer(1.0 + power.abs() + second.abs(), &[(name, *power), (other, *second)]);
                    }
                }
            }
        }
    }
    let text = best.map_or_else(|| familiar(dimension), |(_, text)| text);
    Unit::parse(&text).unwrap_or(Unit { text, dimension, factor: 1.0 })
}

/// A product of powers as a unit is written.
fn written(factors: &[(&str, f64)]) -> String {
    let part = |(name, power): (&str, f64)| match power.abs() {
        1.0 => name.to_owned(),
        power => format!("{name}^{power}"),
    };
    let side = |is_above: bool| {
        let all = factors.iter().filter(|(_, power)| (*power > 0.0) == is_above);
        all.map(|one| part(*one)).collect::<Vec<_>>()
    };
    let (above, below) = (side(true), side(false));
    let above = if above.is_empty() { "1".to_owned() } else { above.join(" ") };
    below.iter().fold(above, |text, factor| format!("{text}/{factor}"))
}
