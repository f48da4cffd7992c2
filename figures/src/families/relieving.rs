//! Relieving stress from the linked system before an experiment: the force before and after, and the time it takes.
//!
//! The force chain gives way from the initial positioning on, so what an earlier repetition left is relieved there, and what is
//! brought in later while preparing. Of all reliefs of a run the one counts that began with the highest force.

use super::force::NOISE_S;
use super::{Family, Figures};
use crate::record::{Record, common};
use crate::series::Span;

/// Over which the force before and after is averaged.
const BEFORE_S: f64 = 0.02;
const AFTER_S: f64 = 0.05;
/// Relieved: below this share of the force before, or below this force, whichever is larger.
const RELIEVED_SHARE: f64 = 0.1;
const RELIEVED_N: f64 = 10.0;
/// States of the force chain at work: it relieves, or lets a hand move the axis.
pub(super) const AT_WORK: &[&str] = &["limited", "standstill", "moving"];
/// States of the main chain in which it relieves.
const BEFORE_EXPERIMENT: &[&str] = &["initial-positioning", "preparing"];

pub(super) const FAMILY: Family = Family {
    title: "relieving (force chain at work before an experiment; the relief that begins with the highest force)",
    definitions: definitions! {
        relieve_force_before_n: "N", Run, "mean force of the load sensor in the 20 ms before";
        relieve_force_after_n: "N", Run, "mean force of the load sensor in the last 50 ms";
        relieve_s: "s", Run,
            "until |force| (smoothed over 5 ms) stays below a tenth of that before or 10 N, whichever is \
             larger; absent when it does not";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let before_experiment = record.load.in_state("main_chain", BEFORE_EXPERIMENT);
    let at_work = common(&record.load.in_state("force_chain", AT_WORK), &before_experiment);
    let force = record.measured.numbers("load_force_N");
    let before_n =
        |span: &Span| force.within(&Span { from_s: span.from_s - BEFORE_S, to_s: span.from_s }).mean();
    let size_n = |span: &Span| before_n(span).map_or(0.0, f64::abs);
    let Some(span) = at_work.iter().max_by(|one, other| size_n(one).total_cmp(&size_n(other))) else {
        return;
    };
    let before = before_n(span);
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

    /// 400 N that decay from 1 s on.
    fn decaying(main: &[(&str, f64)], force_chain: &[(&str, f64)]) -> Figures {
        let mut load = Table::default();
        load.set_states("main_chain", chain(main));
        load.set_states("force_chain", chain(force_chain));
        let force = each_ms(0.0, 3.0, |time| 400.0 * (-(time - 1.0).max(0.0) / 0.2).exp());
        super::super::of(&Record { load, measured: table(&[("load_force_N", &force)]), ..Record::default() })
    }

    #[test]
    fn a_force_that_decays_is_relieved_by_the_logarithm() {
        let figures = decaying(
            &[("initial-positioning", 0.0), ("preparing", 1.0), ("", 3.0)],
            &[("idle", 0.0), ("limited", 1.0), ("standstill", 1.5), ("", 3.0)],
        );
        assert!((figures.get("relieve_force_before_n").unwrap() - 400.0).abs() < 1e-9);
        assert!(figures.get("relieve_force_after_n").unwrap() < 0.1);
        // A tenth is left after tau ln 10, seen within a sample.
        assert!((figures.get("relieve_s").unwrap() - 0.2 * 10_f64.ln()).abs() < 2e-3);
    }
    #[test]
    fn what_an_experiment_left_is_relieved_from_the_next_positioning_on() {
        let figures = decaying(
            &[
                ("preparing", 0.0),
                ("experiment", 0.2),
                ("initial-positioning", 1.0),
                ("preparing", 1.5),
                ("", 3.0),
            ],
            &[("limited", 0.0), ("load-profile", 0.2), ("limited", 1.0), ("standstill", 1.2), ("", 3.0)],
        );
        assert!((figures.get("relieve_force_before_n").unwrap() - 400.0).abs() < 1e-9);
        assert!((figures.get("relieve_s").unwrap() - 0.2 * 10_f64.ln()).abs() < 2e-3);
    }
}
