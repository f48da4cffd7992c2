//! Rates over all cases with an effect left out.

use super::LeaveOutJudgement;
use crate::interval::Rate;
use crate::score::Case;
use crate::score::tables::{Line, QuantileSummary, hidden, parts};
use plant::effects::SHEETS;
use serde::Serialize;
use std::collections::BTreeMap;

/// Share of the gap that must close for effects without memory.
pub(crate) const STILL_CLOSED: f64 = 0.6;

/// Tables of the cases with an effect left out.
#[derive(Debug, Serialize)]
pub struct Tables {
    /// By memory, amplitude and difficulties.
    pub(crate) splits: Vec<Split>,
    pub(crate) effects: Vec<Split>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Split {
    pub(crate) name: String,
    pub(crate) no_wrong_name: Rate,
    pub(crate) balance_right: Rate,
    pub(crate) variable_right: Rate,
    pub(crate) both_right: Rate,
    /// Share of the gap that the program claims to have closed, of the worst signal.
    pub(crate) claimed_closed_ratio: QuantileSummary,
    /// The same for all signals together, each in units of its noise.
    pub(crate) claimed_joint_ratio: QuantileSummary,
    pub(crate) verdicts: BTreeMap<&'static str, usize>,
}

impl Tables {
    /// The tables of the cases with an effect left out; others are ignored.
    pub(crate) fn of(cases: &[Case]) -> Self {
        let pairs = || cases.iter().filter_map(|case| Some((case, case.left_out.as_ref()?)));
        let split = |name: &str, is: &dyn Fn(&Case, &LeaveOutJudgement) -> bool| {
            split(name, &pairs().filter(|(case, left)| is(case, left)).collect::<Vec<_>>())
        };
        let mut splits = vec![
            split("without memory", &|_, left| !left.with_memory),
            split("with memory", &|_, left| left.with_memory),
        ];
        splits.extend(parts().iter().map(|(name, is)| split(name, &|case, _| is(case))));
        let of_sheet = |name: &'static str| split(name, &|case, _| hidden(case).effect == name);
        Tables { splits, effects: SHEETS.iter().map(|sheet| of_sheet(sheet.name)).collect() }
    }
}

fn split(name: &str, cases: &[(&Case, &LeaveOutJudgement)]) -> Split {
    let rate = |is: &dyn Fn(&LeaveOutJudgement) -> bool| Rate::of(cases, |(_, left)| is(left));
    let mut verdicts = BTreeMap::new();
    for (_, left) in cases {
        *verdicts.entry(left.verdict).or_default() += 1;
    }
    let claims = || cases.iter().map(|(case, _)| &case.judgement);
    Split {
        name: name.to_owned(),
        no_wrong_name: rate(&|left| left.no_wrong_name),
        balance_right: rate(&|left| left.balance_right),
        variable_right: rate(&|left| left.variable_right),
        both_right: rate(&|left| left.balance_right && left.variable_right),
        claimed_closed_ratio: QuantileSummary::of(claims().filter_map(|claim| claim.claimed_closed_ratio)),
        claimed_joint_ratio: QuantileSummary::of(claims().filter_map(|claim| claim.claimed_joint_ratio)),
        verdicts,
    }
}

pub(crate) fn headline(cases: &[Case]) -> Vec<Line> {
    let left = || cases.iter().filter_map(|case| case.left_out.as_ref());
    let no_memory =
        || cases.iter().filter(|case| case.left_out.as_ref().is_some_and(|left| !left.with_memory));
    let worst = || no_memory().filter_map(|case| case.judgement.claimed_closed_ratio);
    let joint = || no_memory().filter_map(|case| case.judgement.claimed_joint_ratio);
    let has_gap = |case: &Case| case.judgement.claimed_closed_ratio.is_some();
    let closed = |ratio: f64| ratio >= STILL_CLOSED;
    let both_right = |left: &LeaveOutJudgement| left.balance_right && left.variable_right;
    let variable = "the same: right variable among the first two";
    let both = "the same: right balance, and right variable among the first two";
    vec![
        Line::of("one effect left out: no wrong name", "at least 85 %", left(), |left| left.no_wrong_name),
        Line::of(both, "at least 85 %", left(), both_right),
        Line::of("the same: right balance", "no target", left(), |left| left.balance_right),
        Line::of(variable, "no target", left(), |left| left.variable_right),
        Line::of("effects without memory: a gap told", "all", no_memory(), has_gap),
        Line::of("the same, gap told: all signals together closed by at least 60 %", "all", joint(), closed),
        Line::of("the same, gap told: every signal closed by at least 60 %", "no target", worst(), closed),
        Line::of_errors(cases),
    ]
}
