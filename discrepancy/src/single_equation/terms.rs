//! The terms of a balance: the baseline's columns, the candidates with their shapes, and decoys.
//!
//! ```text
//!   mass       F_applied = M a + b v + F_sli sgn(v) + F_0                        + sum c_i column_i(x, v)
//!   friction   F_ext     = A p + F_sli sgn(v) + F_0                              + sum c_i column_i(x, v, p)
//!   chamber    d(p (A x + V_0))/dt / p_N - q  =  0                               + sum c_i column_i(x, v, p, q)
//! ```
//!
//! Every column is linear in its number; what shapes it (a pitch, a Stribeck velocity) is scanned, and its look-elsewhere paid
//! for in selection. Names are the catalogue's; `decoy:` columns are in no catalogue, and a search that prefers one has found
//! nothing.
//!
//! Pressure-dependent friction has two forms that two levels of pressure cannot tell apart: the root first (a round ring is a
//! line contact, whose width grows with the root of the load, Hertz 1881, and with it the adhesive friction, Schallamach 1952,
//! Proc. Phys. Soc. B 65), then the catalogue's straight line. Sources of the others: their files in `plant/src/effects/`.

use super::BalanceError;
use super::model::{Kind, Model, TermEntry};
use super::runs::{ATMOSPHERE_PA, Run, gradient};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

pub(super) struct BaseColumn {
    pub(super) name: &'static str,
    pub(super) unit: &'static str,
    pub(super) of: fn(&Run) -> Vec<f64>,
}

/// Candidates of one effect and form, alike but for what shapes them.
pub(super) struct Family {
    pub(super) variants: Vec<TermEntry>,
    /// Whether a variant may be preferred to a later one that is no worse: the order is a prior.
    pub(super) ordered: bool,
    /// Whether its number must not be negative.
    pub(super) positive: bool,
    /// Whether folds in bands of position and of speed test it: not what lives in one band.
    pub(super) over_position: bool,
    pub(super) over_speed: bool,
}

pub(super) fn term(effect: &str, form: &str, shape: &[(&str, f64)]) -> TermEntry {
    let shape = shape.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
    TermEntry { effect: effect.into(), form: form.into(), shape, _fitted: toml::Table::new() }
}

/// The baseline's columns, in order.
pub(super) fn baseline(model: &Model) -> Vec<BaseColumn> {
    let mut columns = Vec::new();
    match model.kind {
        Kind::Mass => {
            columns.push(BaseColumn { name: "mass", unit: "kg", of: |run| run.a_m_per_s2.clone() });
        }
        Kind::Friction => {
            columns.push(BaseColumn { name: "area", unit: "m^2", of: |run| run.gauge_pa.clone() });
        }
        Kind::Chamber => return columns,
    }
    if has_viscous(model) {
        columns.push(BaseColumn { name: "viscous", unit: "N s/m", of: |run| run.v_m_per_s.clone() });
    }
    if model.baseline.sliding {
        columns.push(BaseColumn { name: "sliding", unit: "N", of: |run| signs(run) });
    }
    if model.baseline.offset {
        columns.push(BaseColumn { name: "offset", unit: "N", of: |run| vec![1.0; run.x_m.len()] });
    }
    columns
}

fn has_viscous(model: &Model) -> bool {
    model.baseline.viscous.unwrap_or(model.kind == Kind::Mass)
}

/// The candidates of a model for records that span these positions, m.
pub(super) fn families(model: &Model, [from_m, to_m]: [f64; 2]) -> Vec<Family> {
    let free = |variants: Vec<TermEntry>| Family {
        variants,
        ordered: false,
        positive: false,
        over_position: true,
        over_speed: true,
    };
    let plain = |effect: &str, form: &str| free(vec![term(effect, form, &[])]);
    let positive = |family: Family| Family { positive: true, ..family };
    if model.kind == Kind::Chamber {
        return vec![
            plain("dead-volume", ""),
            plain("parameter:kv-scale", ""),
            plain("parameter:flow-lag", ""),
            positive(plain("piston-leakage", "")),
            positive(plain("rod-leakage", "")),
            plain("pressure-sensor-offset", ""),
            plain("decoy:drift", ""),
            plain("decoy:position", ""),
        ];
    }
    let span_mm = (to_m - from_m) * 1e3;
    let mut families = vec![plain("friction-asymmetry", "viscous")];
    if !has_viscous(model) {
        families.push(positive(plain("parameter:viscous-friction", "")));
    }
    if !model.baseline.sliding {
        families.push(positive(plain("parameter:sliding-friction", "")));
    }
    if !model.baseline.offset {
        families.push(plain("inclination", ""));
    }
    let speeds_mm_per_s = [2.0, 5.0, 10.0, 20.0, 50.0];
    let stribeck = speeds_mm_per_s.into_iter().flat_map(|velocity| {
        [1.0, 2.0].map(|exponent| {
            term("stribeck-friction", "", &[("velocity_mm_per_s", velocity), ("exponent", exponent)])
        })
    });
    families.push(Family { over_speed: false, ..positive(free(stribeck.collect())) });
    let presliding = [0.02, 0.1, 0.5].map(|mm| term("presliding", "", &[("deflection_mm", mm)]));
    families.push(Family { over_speed: false, ..positive(free(presliding.into())) });
    if model.kind == Kind::Friction {
        let forms = ["root", "linear"].map(|form| term("pressure-dependent-friction", form, &[]));
        families.push(Family { ordered: true, ..positive(free(forms.into())) });
    }
    for effect in ["position-dependent-friction", "position-dependent-force"] {
        families.push(plain(effect, "slope"));
        // A bump that is seen whole; half of one at an end of the path may be anything.
        let bumps = [(0.1, 2..=8), (0.2, 4..=6)].into_iter().flat_map(|(width, tenths)| {
            tenths.map(move |tenth| {
                let centre = from_m * 1e3 + span_mm * f64::from(tenth) / 10.0;
                term(effect, "bump", &[("centre_mm", centre), ("width_mm", width * span_mm)])
            })
        });
        families.push(Family { over_position: false, ..free(bumps.collect()) });
        let ripple = |mm: f64| term(effect, "ripple", &[("pitch_mm", mm)]);
        families.push(free(pitches(span_mm).map(ripple).collect()));
        // One that is known pays for no search.
        families.extend(model.selection.pitches_mm.iter().map(|mm| free(vec![ripple(*mm)])));
    }
    families.extend(
        ["decoy:drift", "decoy:speed-squared", "decoy:acceleration-sign"].map(|name| plain(name, "")),
    );
    families
}

/// Pitches from 1 mm to a third of the span, a quarter of a period over the span apart.
fn pitches(span_mm: f64) -> impl Iterator<Item = f64> {
    let (least, step) = (3.0 / span_mm, 0.25 / span_mm);
    let count = if least < 1.0 { ((1.0 - least) / step) as usize + 1 } else { 0 };
    (0..count).map(move |at| 1.0 / (least + at as f64 * step))
}

fn signs(run: &Run) -> Vec<f64> {
    run.v_m_per_s.iter().map(|v| sign(*v)).collect()
}

/// -1, 0 or 1.
fn sign(v: f64) -> f64 {
    if v == 0.0 { 0.0 } else { v.signum() }
}

/// The columns of a term over a run, at the full rate: one, or sine and cosine of a ripple.
pub(super) fn columns(model: &Model, entry: &TermEntry, run: &Run) -> Result<Vec<Vec<f64>>, BalanceError> {
    let unknown = || BalanceError::Term { effect: entry.effect.clone(), form: entry.form.clone() };
    let shape = |key: &str| entry.shape.get(key).copied().filter(|v| v.is_finite()).ok_or_else(unknown);
    let each = |of: &dyn Fn(usize) -> f64| vec![(0..run.x_m.len()).map(of).collect::<Vec<f64>>()];
    let (x, v) = (&run.x_m, &run.v_m_per_s);
    if let Some(chamber) = &run.chamber {
        let absolute = |at: usize| run.gauge_pa[at] + ATMOSPHERE_PA;
        let normal_pa = chamber.normal_pa;
        let lag = || gradient(&chamber.flow_m3_per_s, run.period_s).iter().map(|rate| -rate).collect();
        return Ok(match entry.effect.as_str() {
            "dead-volume" => each(&|at| -chamber.rate_pa_per_s[at] / normal_pa),
            "parameter:kv-scale" => vec![chamber.flow_m3_per_s.clone()],
            "parameter:flow-lag" => vec![lag()],
            // Leakage from 6 to 1 bar, m^3/s, as the catalogue's laminar gap.
            "piston-leakage" => each(&|at| -(absolute(at).powi(2) - chamber.other_pa[at].powi(2)) / 35e10),
            "rod-leakage" => each(&|at| -(absolute(at).powi(2) - ATMOSPHERE_PA.powi(2)) / 35e10),
            "pressure-sensor-offset" => each(&|at| chamber.area_m2 * v[at] / normal_pa),
            "decoy:drift" => each(&|at| run.time_s[at]),
            "decoy:position" => each(&|at| x[at]),
            _ => return Err(unknown()),
        });
    }
    let ripple = |along: &dyn Fn(usize) -> f64, pitch_m: f64| {
        let phase = |at: usize| TAU * x[at] / pitch_m;
        vec![
            (0..x.len()).map(|at| along(at) * phase(at).sin()).collect::<Vec<f64>>(),
            (0..x.len()).map(|at| along(at) * phase(at).cos()).collect(),
        ]
    };
    let friction = entry.effect == "position-dependent-friction";
    let along = |at: usize| if friction { sign(v[at]) } else { 1.0 };
    Ok(match (entry.effect.as_str(), entry.form.as_str()) {
        ("friction-asymmetry", "viscous") => each(&|at| v[at].abs()),
        ("inclination", "") => each(&|_| 1.0),
        ("parameter:viscous-friction", "") => vec![v.clone()],
        ("parameter:sliding-friction", "") => vec![signs(run)],
        ("stribeck-friction", "") => {
            let (velocity, exponent) = (shape("velocity_mm_per_s")? * 1e-3, shape("exponent")?);
            each(&|at| sign(v[at]) * (-(v[at].abs() / velocity).powf(exponent)).exp())
        }
        ("presliding", "") => vec![presliding(run, shape("deflection_mm")? * 1e-3)],
        ("pressure-dependent-friction", "root") if !run.gauge_pa.is_empty() => {
            each(&|at| sign(v[at]) * (run.gauge_pa[at].max(0.0) / 1e5).sqrt())
        }
        ("pressure-dependent-friction", "linear") if !run.gauge_pa.is_empty() => {
            each(&|at| sign(v[at]) * run.gauge_pa[at].max(0.0) / 1e5)
        }
        ("position-dependent-friction" | "position-dependent-force", "slope") => {
            each(&|at| along(at) * x[at])
        }
        ("position-dependent-friction" | "position-dependent-force", "bump") => {
            let (centre_m, width_m) = (shape("centre_mm")? * 1e-3, shape("width_mm")? * 1e-3);
            each(&|at| along(at) * (-((x[at] - centre_m) / width_m).powi(2)).exp())
        }
        ("position-dependent-friction" | "position-dependent-force", "ripple") => {
            ripple(&along, shape("pitch_mm")? * 1e-3)
        }
        ("decoy:drift", "") => each(&|at| run.time_s[at]),
        ("decoy:speed-squared", "") => each(&|at| v[at] * v[at].abs()),
        ("decoy:acceleration-sign", "") => each(&|at| sign(run.a_m_per_s2[at])),
        _ => {
            debug_assert!(model.kind != Kind::Chamber, "a chamber's terms are above");
            return Err(unknown());
        }
    })
}

/// What elastic bristles lack of sliding friction, in its unit: -2 at a reversal, 0 after some deflections [Dahl 1968].
fn presliding(run: &Run, deflection_m: f64) -> Vec<f64> {
    let mut bristle = 0.0;
    let mut before_m = run.x_m.first().copied().unwrap_or(0.0);
    let mut column = Vec::with_capacity(run.x_m.len());
    for (x, v) in run.x_m.iter().zip(&run.v_m_per_s) {
        let (moved_m, way) = (x - before_m, sign(*v));
        before_m = *x;
        // Exact over a step of constant direction.
        bristle = sign(moved_m) + (bristle - sign(moved_m)) * (-moved_m.abs() / deflection_m).exp();
        column.push(bristle - way);
    }
    column
}

/// How a term's number is shown: name, unit, and factor from SI.
pub(super) fn shown(entry: &TermEntry) -> (&'static str, &'static str, f64) {
    match (entry.effect.as_str(), entry.form.as_str()) {
        ("friction-asymmetry", _) => ("difference_n_s_per_m", "N s/m", 1.0),
        ("parameter:viscous-friction", _) => ("viscous_n_s_per_m", "N s/m", 1.0),
        ("parameter:sliding-friction", _) => ("sliding_n", "N", 1.0),
        ("stribeck-friction", _) => ("excess_n", "N", 1.0),
        ("presliding", _) => ("sliding_n", "N", 1.0),
        ("pressure-dependent-friction", "root") => ("growth_n_per_root_bar", "N/bar^0.5", 1.0),
        ("pressure-dependent-friction", _) => ("slope_n_per_bar", "N/bar", 1.0),
        (_, "slope") => ("slope_n_per_mm", "N/mm", 1e-3),
        (_, "bump") => ("bump_n", "N", 1.0),
        (_, "ripple") => ("ripple_n", "N", 1.0),
        ("inclination", _) => ("force_n", "N", 1.0),
        ("dead-volume", _) => ("volume_cm3", "cm3", 1e6),
        ("parameter:kv-scale", _) => ("parameter:kv-scale", "", 1.0),
        ("parameter:flow-lag", _) => ("parameter:flow-lag", "ms", 1e3),
        ("piston-leakage" | "rod-leakage", _) => ("leakage_nl_per_min", "Nl/min", 6e4),
        ("pressure-sensor-offset", _) => ("offset_mbar", "mbar", 1e-2),
        _ => ("number", "", 1.0),
    }
}

/// The units of numbers that shape a term, by the ends of their names.
pub(super) fn shape_unit(key: &str) -> &'static str {
    let units = BTreeMap::from([("mm_per_s", "mm/s"), ("mm", "mm")]);
    units.iter().rev().find(|(end, _)| key.ends_with(*end)).map_or("", |(_, unit)| unit)
}

/// What a term does at most, by its numbers: a ripple is a sine and a cosine.
pub(super) fn amplitude(entry: &TermEntry, numbers: &[f64]) -> f64 {
    if entry.form == "ripple" { numbers[0].hypot(numbers[1]) } else { numbers[0] }
}

/// Its standard error, by those of its numbers.
pub(super) fn amplitude_error(entry: &TermEntry, numbers: &[f64], errors: &[f64]) -> f64 {
    if entry.form != "ripple" {
        return errors[0];
    }
    let whole = amplitude(entry, numbers).max(f64::MIN_POSITIVE);
    (numbers[0] * errors[0]).hypot(numbers[1] * errors[1]) / whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pitches_are_close_enough_that_none_lies_between_them() {
        let all: Vec<f64> = pitches(220.0).collect();
        // Two neighbours are a quarter of a period apart at the far end of the span.
        for pair in all.windows(2) {
            assert!((220.0 / pair[1] - 220.0 / pair[0] - 0.25).abs() < 1e-9);
        }
        assert!(all[0] > 70.0 && all[all.len() - 1] < 1.01);
        assert!(pitches(2.0).count() == 0, "a span shorter than three pitches has none");
    }

    #[test]
    fn units_of_shapes_follow_from_their_names() {
        assert_eq!(["velocity_mm_per_s", "pitch_mm", "exponent"].map(shape_unit), ["mm/s", "mm", ""]);
    }
}
