//! A record as rows of a balance: processed signals, and which rows count.
//!
//! ```text
//!   record ─► even grid ─► position: low pass or moving average ─► v, a by central differences ─► columns of each term
//!          ─► zero-phase Chebyshev I and every n-th sample, columns and target alike ─► rows that are fast and inside
//! ```
//!
//! A chamber's target is the residual of its flow balance, `d(p (A x + V_0))/dt / p_N - q`, with q of the baseline: edge flow of
//! the plant at the measured pressures, behind both lags.
//!
//! Source: Janot, Gautier, Brunot 2019 (processing of EMPS); effects.md, Real records; rig-model.md, One axis.

use super::BalanceError;
use super::filter::LowPass;
use super::model::{Kind, Model};
use crate::check::{FEWEST_ROWS, SPARSEST};
use plant::{Inputs, Plant, RigParameters, Setup};
use records::{Channel, Record};

/// Standard atmosphere, Pa [ISO 2533]: what readers add to gauge pressures.
pub(super) const ATMOSPHERE_PA: f64 = 101_325.0;

/// A processed record, at the full rate; columns of terms are made of it and thinned by [`Run::rows`].
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) name: String,
    /// Distance of samples, s.
    pub(super) period_s: f64,
    pub(super) time_s: Vec<f64>,
    pub(super) x_m: Vec<f64>,
    pub(super) v_m_per_s: Vec<f64>,
    pub(super) a_m_per_s2: Vec<f64>,
    /// Gauge, Pa; empty for a mass.
    pub(super) gauge_pa: Vec<f64>,
    /// Force, N, or missing flow, m^3/s.
    pub(super) target: Vec<f64>,
    pub(super) chamber: Option<ChamberRun>,
    thinning: Option<LowPass>,
    /// Samples that are rows.
    pub(super) kept: Vec<usize>,
    /// Whether selection looks at the row.
    pub(super) in_score: Vec<bool>,
}

/// What a chamber's terms need.
#[derive(Clone, Debug)]
pub(super) struct ChamberRun {
    pub(super) area_m2: f64,
    pub(super) normal_pa: f64,
    /// Absolute, of the other chamber, Pa.
    pub(super) other_pa: Vec<f64>,
    /// dp/dt, Pa/s.
    pub(super) rate_pa_per_s: Vec<f64>,
    /// The baseline's flow, m^3/s.
    pub(super) flow_m3_per_s: Vec<f64>,
}

impl Run {
    pub(super) fn of(
        record: &Record,
        model: &Model,
        rig: Option<&RigParameters>,
    ) -> Result<Self, BalanceError> {
        let name = record.file().display().to_string();
        let processing = &model.processing;
        let period_s = processing.period_s;
        let grid = Grid::of(record, &name, period_s)?;
        let values = |quantity: &str| -> Result<Vec<f64>, BalanceError> {
            grid.values(record, &name, model.channels[quantity])
        };
        let low_pass = (processing.low_pass_hz > 0.0).then(|| {
            LowPass::butterworth(processing.low_pass_order, processing.low_pass_hz * 2.0 * period_s)
        });
        let smooth = |samples: Vec<f64>| match &low_pass {
            Some(filter) => filter.zero_phase(&samples),
            None => samples,
        };
        let x_m = smooth(values("position")?);
        let v_m_per_s = gradient(&moving_average(&x_m, processing.moving_average), period_s);
        let a_m_per_s2 = gradient(&v_m_per_s, period_s);
        let (mut gauge_pa, mut chamber) = (Vec::new(), None);
        let target = match model.kind {
            Kind::Mass => values("force")?,
            Kind::Friction => {
                gauge_pa = values("pressure")?.iter().map(|pa| pa - ATMOSPHERE_PA).collect();
                values("force")?
            }
            Kind::Chamber => {
                let rig = rig.ok_or_else(|| BalanceError::NoRig { name: model.name.clone() })?;
                let pa = smooth(values("pressure")?);
                let other_pa = smooth(values("other_pressure")?);
                let commands = values("valve")?;
                let flow = smooth(modelled_flow(rig, &commands, &pa, &other_pa, period_s)?);
                let (area_m2, dead_m3) = (rig.cylinder().piston_area_m2, rig.cylinder().dead_volume_m3);
                let normal_pa = rig.gas().normal_pressure_pa;
                let stored_j: Vec<f64> =
                    pa.iter().zip(&x_m).map(|(p, x)| p * (area_m2 * x + dead_m3)).collect();
                let stored = gradient(&stored_j, period_s);
                let target =
                    stored.iter().zip(&flow).map(|(rate_w, flow)| rate_w / normal_pa - flow).collect();
                let rate_pa_per_s = gradient(&pa, period_s);
                gauge_pa = pa.iter().map(|pa| pa - ATMOSPHERE_PA).collect();
                chamber =
                    Some(ChamberRun { area_m2, normal_pa, other_pa, rate_pa_per_s, flow_m3_per_s: flow });
                target
            }
        };
        let step = processing.decimate;
        let thinning = (step > 1).then(|| {
            let edge = processing.decimate_edge / step as f64;
            LowPass::chebyshev(processing.decimate_order, processing.decimate_ripple_decibel, edge)
        });
        let [from_m, to_m] = processing.position_mm.map(|mm| mm * 1e-3);
        let slowest = processing.speed_above_mm_per_s * 1e-3;
        let counts = |at: &usize| {
            let fast = slowest <= 0.0 || v_m_per_s[*at].abs() > slowest;
            fast && x_m[*at] > from_m && x_m[*at] < to_m
        };
        let kept: Vec<usize> = (0..x_m.len()).step_by(step).filter(counts).collect();
        if kept.len() < FEWEST_ROWS {
            return Err(BalanceError::Few { file: name, rows: kept.len() });
        }
        let (first_s, last_s) = (grid.time_s[0], grid.time_s[grid.time_s.len() - 1]);
        let ends_s = processing.ends_s;
        let inside = |at: &usize| grid.time_s[*at] - first_s >= ends_s && last_s - grid.time_s[*at] >= ends_s;
        let in_score = kept.iter().map(inside).collect();
        let time_s = grid.time_s;
        Ok(Self {
            name,
            period_s,
            time_s,
            x_m,
            v_m_per_s,
            a_m_per_s2,
            gauge_pa,
            target,
            chamber,
            thinning,
            kept,
            in_score,
        })
    }

    /// A column of the full rate as rows.
    pub(super) fn rows(&self, column: &[f64]) -> Vec<f64> {
        match &self.thinning {
            Some(filter) => {
                let filtered = filter.zero_phase(column);
                self.kept.iter().map(|at| filtered[*at]).collect()
            }
            None => self.kept.iter().map(|at| column[*at]).collect(),
        }
    }
}

/// An even grid of a record's time.
struct Grid {
    time_s: Vec<f64>,
    /// Whether its samples are the record's rows as they are.
    as_is: bool,
}

impl Grid {
    fn of(record: &Record, name: &str, period_s: f64) -> Result<Self, BalanceError> {
        let times = record.time_s();
        if let Some(row) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(BalanceError::Time { file: name.into(), line: record.line(row + 1) });
        }
        let Some((first, last)) = times.first().zip(times.last()).filter(|_| times.len() > 2) else {
            return Err(BalanceError::Few { file: name.into(), rows: times.len() });
        };
        let as_is = times.windows(2).all(|pair| (pair[1] - pair[0] - period_s).abs() < 0.01 * period_s);
        let time_s = if as_is {
            times.to_vec()
        } else {
            let samples = ((last - first) / period_s).ceil();
            // Finite they are: times are, and grow.
            if samples > (SPARSEST * times.len()) as f64 {
                return Err(BalanceError::Far {
                    file: name.into(),
                    line: record.line(times.len() - 1),
                    time_s: *last,
                    rows: times.len(),
                    period_s,
                });
            }
            (0..samples as usize).map(|at| first + at as f64 * period_s).collect()
        };
        Ok(Self { time_s, as_is })
    }

    /// A channel on the grid, interpolated linearly.
    fn values(&self, record: &Record, name: &str, channel: Channel) -> Result<Vec<f64>, BalanceError> {
        let missing = || BalanceError::Missing { file: name.into(), column: channel.column() };
        let values = record.channel(channel).ok_or_else(missing)?;
        if self.as_is && values.iter().all(Option::is_some) {
            return Ok(values.iter().flatten().copied().collect());
        }
        let known: Vec<(f64, f64)> =
            record.time_s().iter().zip(values).filter_map(|(time, value)| Some((*time, (*value)?))).collect();
        if known.is_empty() {
            return Err(missing());
        }
        let mut next = 0;
        Ok(self
            .time_s
            .iter()
            .map(|time| {
                while next < known.len() && known[next].0 < *time {
                    next += 1;
                }
                match (next.checked_sub(1).map(|before| known[before]), known.get(next)) {
                    (Some((t0, y0)), Some((t1, y1))) => y0 + (y1 - y0) * (time - t0) / (t1 - t0),
                    (Some((_, y)), None) => y,
                    (None, Some((_, y))) => *y,
                    (None, None) => unreachable!("there is a known value"),
                }
            })
            .collect())
    }
}

/// Differences over two periods, over one at the ends; per second.
pub(super) fn gradient(samples: &[f64], period_s: f64) -> Vec<f64> {
    let last = samples.len() - 1;
    (0..samples.len())
        .map(|at| {
            let (from, to) = (at.saturating_sub(1), (at + 1).min(last));
            (samples[to] - samples[from]) / ((to - from) as f64 * period_s)
        })
        .collect()
}

/// Mean of `width` samples around each, of those that are there at the ends.
fn moving_average(samples: &[f64], width: usize) -> Vec<f64> {
    let reach = width / 2;
    (0..samples.len())
        .map(|at| {
            let part = &samples[at.saturating_sub(reach)..(at + reach + 1).min(samples.len())];
            part.iter().sum::<f64>() / part.len() as f64
        })
        .collect()
}

/// The baseline's net flow into chamber a of the drive, m^3/s: edge flow at the measured pressures, spool and flow lagged.
fn modelled_flow(
    rig: &RigParameters,
    commands: &[f64],
    pa: &[f64],
    other_pa: &[f64],
    period_s: f64,
) -> Result<Vec<f64>, BalanceError> {
    let rig = rig.without_effects();
    let unusable = |error: plant::SetupError| BalanceError::Rig { reason: error.to_string() };
    let mut plant = Plant::new(&rig, &Setup::default()).map_err(unusable)?;
    let start = *plant.state();
    let (cylinder, valve) = (rig.cylinder(), rig.valve());
    // Pressures alone matter to an edge; any volume carries them.
    let volume_m3 = cylinder.dead_volume_m3 + cylinder.piston_area_m2 * start.axes[0].extension_m;
    let other_m3 =
        cylinder.dead_volume_m3 + cylinder.annulus_area_m2 * (cylinder.stroke_m - start.axes[0].extension_m);
    let follow = |time_constant_s: f64| 1.0 - (-period_s / time_constant_s).exp();
    let (spool_share, flow_share) =
        (follow(valve.spool_time_constant_s), follow(valve.flow_lag_time_constant_s));
    let mut spool = commands.first().copied().unwrap_or(0.0).clamp(-1.0, 1.0);
    let mut before: Option<(f64, f64)> = None;
    let mut flows = Vec::with_capacity(commands.len());
    for at in 0..commands.len() {
        let mut state = start;
        state.axes[0].spool = spool;
        state.axes[0].stored_air_a_j = pa[at].max(1e3) * volume_m3;
        state.axes[0].stored_air_b_j = other_pa[at].max(1e3) * other_m3;
        plant.go_on_in(&state).map_err(unusable)?;
        let edge = plant.truth(&Inputs::default()).axes[0].edge_flow_a_m3_per_s;
        // The mean of both ends of a period: either end alone would be half a period off, and be found as a lag.
        let lagged =
            before.map_or(edge, |(lagged, last)| lagged + flow_share * (0.5 * (last + edge) - lagged));
        flows.push(lagged);
        before = Some((lagged, edge));
        spool += spool_share * (commands[at].clamp(-1.0, 1.0) - spool);
    }
    Ok(flows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_has_its_slope_everywhere() {
        let line: Vec<f64> = (0..20).map(|at| 0.5 * f64::from(at)).collect();
        assert!(gradient(&line, 0.01).iter().all(|slope| (slope - 50.0).abs() < 1e-9));
        let smooth = moving_average(&line, 5);
        assert!((smooth[10] - line[10]).abs() < 1e-12);
        // At an end the mean of the three that are there.
        assert_eq!(smooth[0], 0.5);
    }

    #[test]
    fn a_shut_valve_passes_nothing_and_an_open_one_fills_from_the_supply() {
        let rig = RigParameters::baseline();
        let flow = |u: f64| modelled_flow(&rig, &[u; 400], &[3e5; 400], &[3e5; 400], 1e-3).unwrap()[399];
        assert_eq!(flow(0.0), 0.0);
        // 12.95 K_V p_up with K_V 0.36 m^3/h at half opening and 7 bar: 3 bar is below half of it.
        let by_hand = 12.95 * 0.36 * 7.0 / 3600.0;
        assert!((flow(0.5) / by_hand - 1.0).abs() < 1e-9, "{} {by_hand}", flow(0.5));
        assert!(flow(-0.5) < 0.0);
    }
}
