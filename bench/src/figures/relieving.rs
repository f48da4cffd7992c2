//! Relieving stress from the linked system before an experiment: the force before and after, and the time it takes.

use super::force::NOISE_S;
use super::{Definition, Family, Figures};
use crate::record::{Record, common};
use crate::series::Span;

/// Over which the force before and after is averaged.
const BEFORE_S: f64 = 0.02;
const AFTER_S: f64 = 0.05;
/// Relieved: below this share of the force before, or below this force, whichever is larger.
const RELIEVED_SHARE: f64 = 0.1;
const RELIEVED_N: f64 = 10.0;
/// States of the force chain while it relieves.
const AT_WORK: &[&str] = &["limited", "standstill", "moving"];

/// The family.
pub(super) const FAMILY: Family = Family {
    title: "relieving (force chain at work while the main chain prepares)",
    definitions: &[
        Definition {
            name: "relieve_force_before_n",
            unit: "N",
            meaning: "mean force of the load sensor in the 20 ms before",
        },
        Definition {
            name: "relieve_force_after_n",
            unit: "N",
            meaning: "mean force of the load sensor in the last 50 ms",
        },
        Definition {
            name: "relieve_s",
            unit: "s",
            meaning: "until |force| (smoothed over 5 ms) stays below a tenth of that before or 10 N, whichever is larger; absent when it does not",
        },
    ],
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let preparing = record.load.in_state("main_chain", &["preparing"]);
    let at_work = common(&record.load.in_state("force_chain", AT_WORK), &preparing);
    let Some(span) = at_work.first() else { return };
    let force = record.measured.numbers("load_force_N");
    let before = force.within(&Span { from_s: span.from_s - BEFORE_S, to_s: span.from_s }).mean();
    figures.put("relieve_force_before_n", before);
    figures.put("relieve_force_after_n", force.within(&span.last(AFTER_S)).mean());
    let bound = before.map_or(RELIEVED_N, |before| RELIEVED_N.max(RELIEVED_SHARE * before.abs()));
    let relieved_s = force.smoothed(NOISE_S).within(span).stays_from(|force| force.abs() <= bound);
    figures.put("relieve_s", relieved_s.map(|time| time - span.from_s));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};
    use crate::tables_read::Table;

    #[test]
    fn a_force_that_decays_is_relieved_by_the_logarithm() {
        let mut load = Table::default();
        load.set_states("main_chain", chain(&[("initial-positioning", 0.0), ("preparing", 1.0), ("", 3.0)]));
        load.set_states(
            "force_chain",
            chain(&[("idle", 0.0), ("limited", 1.0), ("standstill", 1.5), ("", 3.0)]),
        );
        let force = each_ms(0.0, 3.0, |time| 400.0 * (-(time - 1.0).max(0.0) / 0.2).exp());
        let measured = table(&[("load_force_N", &force)]);
        let figures = super::super::of(&Record { load, measured, ..Record::default() });
        assert!((figures.get("relieve_force_before_n").unwrap() - 400.0).abs() < 1e-9);
        assert!(figures.get("relieve_force_after_n").unwrap() < 0.1);
        // A tenth is left after tau ln 10, seen within a sample.
        assert!((figures.get("relieve_s").unwrap() - 0.2 * 10_f64.ln()).abs() < 2e-3);
    }
}
