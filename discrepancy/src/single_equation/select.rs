//! Which terms the training records ask for: forward, one at a time, each through every gate.
//!
//! A term is taken when all of these hold, on training records alone:
//!
//! | gate | asks | why |
//! |---|---|---|
//! | sign | a number that cannot be negative is not | a Stribeck curve that rises is another law |
//! | penalty | `n_eff ln(P_0 / P_1) > k ln n_eff + 2 ln(variants tried)` | scans find something in any residual |
//! | folds in time | takes `share_floor` of what the baseline leaves out, at 3 clustered standard errors | size, significance |
//! | folds in bands of position, of speed | half of that share, at 2 | it must hold where it was not fitted |
//!
//! A record that repeats its path repeats its error in every block of time; bands ask for places and speeds not seen. They are
//! asked of shapes that reach beyond a band, and of speed only when it varies by more than a factor of 3 (deciles). The best of
//! what passes is taken; another effect that passes and leaves no more on the same folds (3 clustered standard errors) explains
//! the records as well.
//!
//! Source: Chen, Chen 2008, Biometrika 95(3) (penalty: extended BIC); discrepancy-notes.md, 3, 5 and Pipeline 5; Roberts et al.
//! 2017, Ecography 40(8) (blocked folds).

use super::fit::{Columns, Cut, Rows, clustered_t};
use super::model::{Selection, TermEntry};
use super::terms::{Family, amplitude};

/// Clustered standard errors that folds in time ask, and those in bands. Folds are taken as independent, although their training
/// rows overlap [Bengio, Grandvalet 2004, JMLR 5]; for ten folds 2 is about 4 % one-sided.
pub(crate) const T_TIME: f64 = 3.0;
const T_BANDS: f64 = 2.0;
/// Least share of the power left out that a term must explain on folds, unless its model says another.
pub(crate) const SHARE_FLOOR: f64 = 0.1;
/// Significance of a difference between two effects, in clustered standard errors.
const T_APART: f64 = 3.0;
/// Twice the difference of log likelihoods that does the same. "Very strong" is 10 for twice the log Bayes factor [Kass, Raftery
/// 1995, JASA 90(430)], which this difference approximates for equal numbers of parameters only.
pub(crate) const GAIN_APART: f64 = 10.0;

/// A family with its columns over the training rows.
pub(super) struct Prepared {
    pub(super) family: Family,
    /// Of each variant.
    pub(super) columns: Vec<Columns>,
}

impl Prepared {
    fn is_decoy(&self) -> bool {
        self.family.variants.iter().any(|variant| variant.effect.starts_with("decoy:"))
    }
}

/// The cuts into folds.
pub(super) struct Cuts {
    pub(super) time: Cut,
    pub(super) position: Cut,
    pub(super) speed: Option<Cut>,
}

/// How a family did in a round.
#[derive(Clone, Debug)]
pub(super) struct CandidateEvaluation {
    pub(super) place: usize,
    pub(super) variant: usize,
    /// Of the variant, the first where it has two; its spread when the columns cannot be distinguished is not here.
    pub(super) number: f64,
    /// Share of the power left out in time that it takes.
    pub(super) share: f64,
    /// Smallest ratio of a statistic to its threshold; above 1 passes.
    pub(super) score: f64,
    /// The gate that decided.
    pub(super) gate: String,
    pub(super) passes: bool,
    /// Whether it is identifiable beside the baseline.
    pub(super) is_excited: bool,
    /// Squares left out of each fold in time.
    left: Vec<f64>,
    /// Power that its fit leaves, and how many rows that is worth.
    rss: f64,
    effective: f64,
    /// Other forms that do no worse.
    pub(super) ties: Vec<usize>,
}

/// A term that was taken.
#[derive(Clone, Debug)]
pub(super) struct Taken {
    pub(super) evaluation: CandidateEvaluation,
    /// Other effects that explain the same: place and variant.
    pub(super) alternatives: Vec<(usize, usize)>,
}

/// What came of the search.
pub(super) struct SearchResult {
    pub(super) taken: Vec<Taken>,
    /// All families alone, in their order.
    pub(super) first: Vec<CandidateEvaluation>,
    /// All families beside the selected terms.
    pub(super) last: Vec<CandidateEvaluation>,
    /// The decoy that did better than every effect, where that ended the search.
    pub(super) decoy: Option<CandidateEvaluation>,
}

/// Searches beside `base`; sizes count in what `plain`, the baseline without terms that were added before, leaves out.
pub(super) fn search(
    rows: &Rows,
    cuts: &Cuts,
    [plain, base]: [&Columns; 2],
    families: &[Prepared],
    selection: &Selection,
    progress: &mut dyn FnMut(&str),
) -> SearchResult {
    let mut found = SearchResult { taken: Vec::new(), first: Vec::new(), last: Vec::new(), decoy: None };
    let mut columns = base.clone();
    let excess = Excess::of(rows, cuts, plain);
    loop {
        let round: Vec<CandidateEvaluation> = (0..families.len())
            .filter(|place| found.taken.iter().all(|taken| taken.evaluation.place != *place))
            .map(|place| judge(rows, cuts, &columns, (families, place), selection, &excess))
            .collect();
        if found.first.is_empty() {
            found.first.clone_from(&round);
        }
        found.last.clone_from(&round);
        let best =
            round.iter().filter(|evaluation| evaluation.passes).max_by(|a, b| a.share.total_cmp(&b.share));
        let Some(best) = best.filter(|_| found.taken.len() < selection.most) else { return found };
        if families[best.place].is_decoy() {
            found.decoy = Some(best.clone());
            return found;
        }
        let entry = &families[best.place].family.variants[best.variant];
        progress(&format!("takes {} ({:.0} % of the power left out)", describe(entry), best.share * 100.0));
        let alternatives = round
            .iter()
            .filter(|other| other.place != best.place && other.passes && !families[other.place].is_decoy())
            .filter(|other| !apart(best, other))
            .map(|other| (other.place, other.variant))
            .collect();
        columns.extend(families[best.place].columns[best.variant].iter().cloned());
        found.taken.push(Taken { evaluation: best.clone(), alternatives });
    }
}

/// Power that the plain baseline leaves out, by cut.
struct Excess(Vec<(&'static str, f64)>);

impl Excess {
    fn of(rows: &Rows, cuts: &Cuts, plain: &Columns) -> Self {
        let all = [Some(&cuts.time), Some(&cuts.position), cuts.speed.as_ref()];
        let rss = |cut: &Cut| Some((cut.name, rows.fold_rss(plain, cut)?.iter().sum()));
        Excess(all.into_iter().flatten().filter_map(rss).collect())
    }

    /// A power as a share of it; of `left` where the baseline's own columns cannot be distinguished on this cut.
    fn share(&self, cut: &Cut, rss: f64, left: f64) -> f64 {
        let reference =
            self.0.iter().find(|(name, _)| *name == cut.name).map_or(left, |(_, reference)| *reference);
        rss / reference.max(f64::MIN_POSITIVE)
    }
}

/// Whether one is better than the other beyond doubt: on the same folds, or by its likelihood.
fn apart(best: &CandidateEvaluation, other: &CandidateEvaluation) -> bool {
    if best.effective * (other.rss / best.rss).ln() > GAIN_APART {
        return true;
    }
    let differences: Vec<f64> = other.left.iter().zip(&best.left).map(|(other, best)| other - best).collect();
    clustered_t(&differences) > T_APART
}

/// A term in words.
pub(super) fn describe(entry: &TermEntry) -> String {
    let shape: Vec<String> = entry.shape.iter().map(|(key, value)| format!("{key} {value:.4}")).collect();
    let parts = [entry.effect.clone(), entry.form.clone(), shape.join(", ")];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

fn judge(
    rows: &Rows,
    cuts: &Cuts,
    columns: &Columns,
    (families, place): (&[Prepared], usize),
    selection: &Selection,
    excess: &Excess,
) -> CandidateEvaluation {
    let Prepared { family, columns: variants } = &families[place];
    let refused = |gate: String, variant: usize, number: f64| CandidateEvaluation {
        place,
        variant,
        number,
        share: 0.0,
        score: 0.0,
        gate,
        passes: false,
        is_excited: true,
        left: Vec::new(),
        rss: f64::INFINITY,
        effective: 0.0,
        ties: Vec::new(),
    };
    let Some(before) = rows.fit(columns) else {
        return refused("the baseline's own columns cannot be told apart".into(), 0, 0.0);
    };
    let with = |variant: usize| -> Columns { columns.iter().chain(&variants[variant]).cloned().collect() };
    let tried: Vec<_> = (0..variants.len())
        .filter_map(|variant| {
            let fit = rows.fit(&with(variant))?;
            let rss = rows.rss(&fit.residual);
            Some((variant, fit, rss))
        })
        .collect();
    if tried.is_empty() {
        let alike = refused("these records cannot tell it from the baseline".into(), 0, 0.0);
        return CandidateEvaluation { is_excited: false, ..alike };
    }
    let number_of = |fit: &super::fit::Fit| fit.numbers[columns.len()];
    let allowed = tried.iter().filter(|(_, fit, _)| !family.positive || number_of(fit) >= 0.0);
    let Some((best, best_fit, least)) = allowed.min_by(|a, b| a.2.total_cmp(&b.2)) else {
        let (variant, fit, _) = &tried[0];
        return refused("its number would be negative".into(), *variant, number_of(fit));
    };
    let effective = rows.effective_sample_size(&best_fit.residual);
    let same = |other: f64| effective * (other / least).ln() < 2.0;
    let mut ties: Vec<usize> = if family.ordered {
        let no_worse =
            |(_, fit, other): &&(usize, super::fit::Fit, f64)| number_of(fit) >= 0.0 && same(*other);
        tried.iter().filter(no_worse).map(|(variant, ..)| *variant).collect()
    } else {
        vec![*best]
    };
    let variant = ties.remove(0);
    let (_, fit, rss) = tried.iter().find(|(place, ..)| *place == variant).expect("it was tried");
    let number = amplitude(&family.variants[variant], &fit.numbers[columns.len()..]);
    let rss_before = rows.rss(&before.residual);
    let more = variants[variant].len() as f64;
    let all: usize = families.iter().map(|family| family.columns.len()).sum();
    let tried_in_all = if family.variants.len() > 1 { all } else { families.len() };
    let gain = effective * (rss_before / rss.max(f64::MIN_POSITIVE)).ln();
    let penalty = more * effective.ln() + 2.0 * (tried_in_all as f64).ln();
    let mut gates = vec![(gain / penalty, format!("likelihood gain {gain:.1}, penalty {penalty:.1}"))];
    let extended = with(variant);
    let mut left = Vec::new();
    let mut share = 0.0;
    let asked = [
        (Some(&cuts.time), true, selection.share_floor, T_TIME),
        (Some(&cuts.position), family.over_position, selection.share_floor / 2.0, T_BANDS),
        (cuts.speed.as_ref(), family.over_speed, selection.share_floor / 2.0, T_BANDS),
    ];
    for (cut, applies, floor, t_floor) in asked {
        let Some(cut) = cut.filter(|_| applies) else { continue };
        let (Some(before), Some(after)) = (rows.fold_rss(columns, cut), rows.fold_rss(&extended, cut)) else {
            gates.push((0.0, format!("folds in {}: the rest cannot tell it", cut.name)));
            continue;
        };
        let differences: Vec<f64> = before.iter().zip(&after).map(|(before, after)| before - after).collect();
        let taken = excess.share(cut, differences.iter().sum(), before.iter().sum());
        let t = clustered_t(&differences);
        let words = |what: String| format!("folds in {}: {what}", cut.name);
        let percent = taken * 100.0;
        gates.push((
            taken / floor,
            words(format!("takes {percent:.1} % of the power, {:.1} asked", floor * 100.0)),
        ));
        gates.push((t / t_floor, words(format!("{t:.1} clustered standard errors, {t_floor:.1} asked"))));
        if cut.name == cuts.time.name {
            (share, left) = (taken, after);
        }
    }
    let (score, gate) =
        gates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there is one gate at least");
    CandidateEvaluation {
        place,
        variant,
        number,
        share,
        score,
        gate,
        passes: score > 1.0,
        is_excited: true,
        left,
        rss: *rss,
        effective,
        ties,
    }
}

#[cfg(test)]
mod tests {
    use super::super::terms::term;
    use super::*;

    /// A repeated path over 2 minutes: position a triangle, speed its sign; noise from a fixed sequence.
    fn path() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut seed = 1_u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let at = |k: usize| (k % 200) as f64 / 100.0;
        let x = (0..2000).map(|k| if at(k) < 1.0 { at(k) } else { 2.0 - at(k) }).collect();
        let v = (0..2000).map(|k| if at(k) < 1.0 { 1.0 } else { -1.0 }).collect();
        (x, v, (0..2000).map(|_| noise()).collect())
    }

    fn taken(target: Vec<f64>) -> Vec<String> {
        let (x, v, _) = path();
        let count = target.len();
        let rows = Rows { target, in_score: vec![true; count], records: std::iter::once(0..count).collect() };
        let free = |name: &str, column: Vec<f64>| Prepared {
            family: Family {
                variants: vec![term(name, "", &[])],
                ordered: false,
                positive: false,
                over_position: true,
                over_speed: true,
            },
            columns: vec![vec![column]],
        };
        let families = [
            free("slope", x.clone()),
            free("flipping-slope", x.iter().zip(&v).map(|(x, v)| x * v).collect()),
            free("decoy:drift", (0..count).map(|at| at as f64).collect()),
        ];
        let cuts = Cuts { time: rows.in_time(10), position: rows.in_bands("position", &x, 10), speed: None };
        let base = vec![vec![1.0; count], v];
        let found = search(&rows, &cuts, [&base, &base], &families, &Selection::default(), &mut |_| {});
        let mut names: Vec<String> = found
            .taken
            .iter()
            .map(|taken| families[taken.evaluation.place].family.variants[0].effect.clone())
            .collect();
        names.extend(found.decoy.map(|_| "decoy".to_owned()));
        names
    }

    #[test]
    fn what_is_there_is_taken_and_nothing_else() {
        let (x, v, noise) = path();
        assert!(taken(noise.clone()).is_empty());
        let slope: Vec<f64> = x.iter().zip(&noise).map(|(x, noise)| 2.0 * x + noise).collect();
        assert_eq!(taken(slope), ["slope"]);
        let flips: Vec<f64> = (0..2000).map(|at| 2.0 * x[at] * v[at] + noise[at]).collect();
        assert_eq!(taken(flips), ["flipping-slope"]);
    }

    #[test]
    fn a_drift_is_no_effect() {
        let (_, _, noise) = path();
        let drift: Vec<f64> = (0..2000).map(|at| at as f64 / 500.0 + noise[at]).collect();
        assert_eq!(taken(drift), ["decoy"]);
    }

    #[test]
    fn an_error_that_repeats_with_the_path_but_not_over_places_is_not_taken() {
        // A wiggle in one tenth of the stroke, the same in every block of time: only folds over places see that no slope is
        // there.
        let (x, _, noise) = path();
        let wiggle: Vec<f64> =
            (0..2000).map(|at| if x[at] > 0.9 { 1.0 } else { 0.0 } + 0.2 * noise[at]).collect();
        assert!(taken(wiggle).is_empty());
    }
}
