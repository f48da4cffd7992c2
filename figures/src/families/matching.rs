//! The matching chain: the offset that it found between both measured positions, and what is left of it.

use super::{Family, Figures};
use crate::record::Record;
use crate::series::Span;

/// How long after matching the rest is averaged: the axes are still linked then.
const AFTER_S: f64 = 0.5;

pub(super) const FAMILY: Family = Family {
    title: "matching of positions",
    definitions: definitions! {
        matching_offset_m: "m", Farthest, "offset taken off the load's position sensor, as last matched";
        matching_residual_m: "m", Farthest,
            "mean of load position (offset taken off) less drive position in the 0.5 s after matching";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let matched = record.load.in_state("matching_chain", &["matched"]);
    let Some(last) = matched.last() else { return };
    let load = record.load.numbers("position_m");
    let offset = record.measured.numbers("load_position_m").minus(load).within(last);
    figures.put("matching_offset_m", offset.values().last().copied());
    // Half a second; the chain's edge and the offset's first use may be a cycle apart.
    let after = Span { from_s: last.from_s + 0.002, to_s: last.to_s.min(last.from_s + AFTER_S) };
    let apart = load.minus(record.measured.numbers("drive_position_m")).within(&after);
    figures.put("matching_residual_m", apart.mean());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};

    #[test]
    fn offset_and_residual_are_computed() {
        let position_m = each_ms(0.0, 2.0, |time| 0.3008 - if time < 1.0 { 0.0 } else { 0.00075 });
        let mut load = table(&[("position_m", &position_m)]);
        load.set_states("matching_chain", chain(&[("averaging", 0.0), ("matched", 1.0), ("", 2.0)]));
        let measured = table(&[
            ("load_position_m", &each_ms(0.0, 2.0, |_| 0.3008)),
            ("drive_position_m", &each_ms(0.0, 2.0, |_| 0.3)),
        ]);
        let figures = super::super::of(&Record { load, measured, ..Record::default() });
        assert!((figures.get("matching_offset_m").unwrap() - 0.00075).abs() < 1e-12);
        assert!((figures.get("matching_residual_m").unwrap() - 0.00005).abs() < 1e-12);
    }
}
