//! Sensors of one axis in the record maker: lag, age, gain, offset, sampling instant, noise, rounding.
//!
//! ```text
//!   truth, each step ─► lags ─► ring of the last milliseconds ─► at t_k (- age) (+ jitter) ─► gain, offset ─► noise ─► rounded
//! ```
//!
//! A period is integrated before it is sampled, so that the value shortly after t_k is known too.

use super::Form;
use super::noise::{Noise, Stream};
use plant::parameters::SensorParameters;
use plant::{AxisReadings, Reading};

/// Position, force, pressure a, pressure b.
pub(super) const CHANNELS: usize = 4;

/// Effects on the sensors that are on, for each channel; SI.
#[derive(Debug, Clone, Default)]
pub(super) struct SensingLaws {
    pub(super) form: Form,
    pub(super) lag_s: [f64; CHANNELS],
    pub(super) age_s: [f64; CHANNELS],
    pub(super) gain: [f64; CHANNELS],
    pub(super) offset: [f64; CHANNELS],
}

#[derive(Debug, Clone)]
pub(super) struct Sensing {
    laws: SensingLaws,
    parameters: SensorParameters,
    /// Error of the reading by the mounting of the sensor, m.
    mounted_m: f64,
    step_s: f64,
    /// Up to three lags in series.
    lags: [[Option<Lag>; 3]; CHANNELS],
    before: [f64; CHANNELS],
    ring: Vec<[f64; CHANNELS]>,
    steps: usize,
    noise: [Noise; CHANNELS],
}

#[derive(Debug, Clone, Copy)]
struct Lag {
    rising: LagTime,
    falling: LagTime,
    shown: f64,
}

/// Time constant of a lag, s, and the share of a difference that remains after a step.
#[derive(Debug, Clone, Copy)]
struct LagTime {
    s: f64,
    kept: f64,
}

/// Share of the near form's skew that is a first-order lag.
const AGE_LAG_SHARE: f64 = 0.25;
/// The far form's skew is a sawtooth about its mean, as between two clocks that are not synchronised: relative amplitude, and
/// period, s.
const AGE_SLIDES: [f64; CHANNELS] = [0.28, 0.5, 0.8, 0.8];
const AGE_BEAT_S: f64 = 0.37;
/// The far form's position sensor samples with a period of so many of its lags and holds the value; its lag is shorter by half
/// of that period.
const HOLDS_LAGS: f64 = 0.36;
/// Relative drift of the far forms' offsets.
const DRIFTS: [f64; CHANNELS] = [0.55, 0.7, 0.7, 0.7];
/// The far form's pressure sensor is slower by this share as the pressure falls, and faster as it rises.
const SNUBBER_DIFFERS: f64 = 0.5;
/// Curvature of the forms' gains over position, force and pressure.
const FORCE_BENDS: [f64; 3] = [0.0, 0.1, 0.85];
const POSITION_BENDS: [f64; 2] = [-0.4, 2.8];
/// Relative drift of the far form's gain of a pressure.
const GAIN_DRIFTS: f64 = 0.7;
/// Farthest sample back or ahead, ms.
const REACH_MS: usize = 14;
/// Half of the usual pressure range, where the near form's gain equals the catalogue's, Pa, and a usual force, N.
const GAIN_AGREES_PA: f64 = 4e5;
const GAIN_BENDS_N: f64 = 40.0;

impl Sensing {
    pub(super) fn new(
        laws: SensingLaws,
        parameters: &SensorParameters,
        axis: usize,
        step_s: f64,
        streams: impl Fn(usize) -> Stream,
        (noise, coloured, slow): (f64, bool, Option<f64>),
    ) -> Self {
        let time = |s: f64| LagTime { s, kept: libm::exp(-step_s / s) };
        let between = |s: f64, differs: f64| {
            let of = |rises: bool| time(laws.form.side(!rises, differs) * s);
            (s > 0.0).then(|| Lag { rising: of(true), falling: of(false), shown: 0.0 })
        };
        let lag = |s: f64| between(s, 0.0);
        let lags = std::array::from_fn(|channel| {
            let (lag_s, age_s) = (laws.lag_s[channel], laws.age_s[channel]);
            match laws.form {
                Form::Catalogue => [lag(lag_s), None, None],
                // Two equal lags in series, as in an anti-aliasing filter; a skew with a smooth step response.
                Form::Near => [lag(lag_s / 2.0), lag(lag_s / 2.0), lag(AGE_LAG_SHARE * age_s)],
                Form::Far if channel == 0 => [lag((1.0 - HOLDS_LAGS / 2.0) * lag_s), None, None],
                Form::Far => [between(lag_s, SNUBBER_DIFFERS), None, None],
            }
        });
        let rms = [
            parameters.position_noise_m,
            parameters.force_noise_n,
            parameters.pressure_noise_pa,
            parameters.pressure_noise_pa,
        ];
        let per_ms = (1e-3 / step_s).round() as usize;
        let longest_s =
            (0..CHANNELS).map(|of| 2.0 * laws.age_s[of] + HOLDS_LAGS * laws.lag_s[of]).fold(0.0, f64::max);
        let reach_ms =
            if laws.form.is_far() { REACH_MS.max(2 + (1e3 * longest_s) as usize) } else { REACH_MS };
        Sensing {
            laws,
            parameters: *parameters,
            mounted_m: [0.0, parameters.load_position_offset_m][axis],
            step_s,
            lags,
            before: [0.0; CHANNELS],
            ring: vec![[0.0; CHANNELS]; (reach_ms * per_ms).next_power_of_two()],
            steps: 0,
            noise: std::array::from_fn(|channel| {
                Noise::new(streams(channel), noise * rms[channel], coloured, slow)
            }),
        }
    }

    /// Stores the true values at the start of a step.
    #[inline(always)]
    pub(super) fn store(&mut self, truth: [f64; CHANNELS]) {
        let first = self.steps == 0;
        let mut shown = truth;
        for (channel, shown) in shown.iter_mut().enumerate() {
            let mut from = self.before[channel];
            for lag in self.lags[channel].iter_mut().flatten() {
                let [before, from_now] = if first { [*shown; 2] } else { [lag.shown, from] };
                from = before;
                lag.shown = lag.after(before, from_now, *shown, self.step_s);
                *shown = lag.shown;
            }
        }
        self.before = truth;
        let size = self.ring.len();
        self.ring[self.steps & (size - 1)] = shown;
        self.steps += 1;
    }

    /// Values without noise at step `at`, for a sample of `time_s` taken `late_s` later.
    pub(super) fn without_noise(&self, at: usize, late_s: f64, time_s: f64) -> [f64; CHANNELS] {
        let laws = &self.laws;
        std::array::from_fn(|channel| {
            let back_s = match laws.form {
                Form::Catalogue => laws.age_s[channel] - late_s,
                Form::Near => (1.0 - AGE_LAG_SHARE) * laws.age_s[channel] - late_s,
                Form::Far => self.far_age_s(channel, at as f64 * self.step_s + late_s) - late_s,
            };
            let truth = self.delayed(channel, at as f64 - back_s / self.step_s);
            let mounted = if channel == 0 { self.mounted_m } else { 0.0 };
            truth
                + self.gain_error(channel, truth, time_s)
                + laws.offset[channel] * laws.form.drift(time_s, DRIFTS[channel])
                + mounted
        })
    }

    /// Age of the value of the far form at an instant, s.
    fn far_age_s(&self, channel: usize, instant_s: f64) -> f64 {
        let laws = &self.laws;
        let saw = |turns: f64| turns - turns.floor();
        let slid = 1.0 + AGE_SLIDES[channel] * (2.0 * saw(instant_s / AGE_BEAT_S) - 1.0);
        let age_s = slid * laws.age_s[channel];
        let cycle_s = if channel == 0 { HOLDS_LAGS * laws.lag_s[channel] } else { 0.0 };
        let held_s = if cycle_s > 0.0 { cycle_s * saw((instant_s - age_s) / cycle_s) } else { 0.0 };
        age_s + held_s
    }

    fn delayed(&self, channel: usize, step: f64) -> f64 {
        let last = self.steps - 1;
        let oldest = self.steps.saturating_sub(self.ring.len());
        let step = step.clamp(oldest as f64, last as f64);
        let before = (step.floor() as usize).min(last.saturating_sub(1));
        let mask = self.ring.len() - 1;
        let [one, other] = [before, (before + 1).min(last)].map(|step| self.ring[step & mask][channel]);
        one + (step - before as f64) * (other - one)
    }

    fn gain_error(&self, channel: usize, truth: f64, time_s: f64) -> f64 {
        let laws = &self.laws;
        let gain = laws.gain[channel];
        if !self.laws.form.is_foreign() || gain == 0.0 {
            return gain * truth;
        }
        let bent = match channel {
            0 => {
                let [flat, slope] = if laws.form.is_far() { POSITION_BENDS } else { [0.8, 0.4] };
                flat + slope * truth / self.parameters.position_range_m
            }
            1 => 1.0 + laws.form.of(FORCE_BENDS) * libm::tanh(truth / GAIN_BENDS_N),
            _ if laws.form.is_far() => laws.form.drift(time_s, GAIN_DRIFTS),
            _ => 0.8 + 0.2 * truth / GAIN_AGREES_PA,
        };
        gain * bent * truth
    }

    /// Readings from values without noise: noise added, rounded, clipped.
    pub(super) fn read(&mut self, values: [f64; CHANNELS]) -> AxisReadings {
        let parameters = &self.parameters;
        let pressure = [parameters.pressure_step_pa(), 0.0, parameters.pressure_counts()];
        let grids = [
            [parameters.position_step_m(), 0.0, parameters.position_counts()],
            [parameters.force_step_n(), -parameters.force_counts(), parameters.force_counts()],
            pressure,
            pressure,
        ];
        let mut reading = |channel: usize| {
            let [step, least, most] = grids[channel];
            let counts = ((values[channel] + self.noise[channel].sample()) / step).round();
            let clipped = counts.clamp(least, most);
            Reading { value: clipped * step, saturated: clipped != counts }
        };
        AxisReadings {
            position: reading(0),
            force: reading(1),
            pressure_a: reading(2),
            pressure_b: reading(3),
        }
    }
}

impl Lag {
    /// Output after a step in which the input went linearly from one value to another.
    #[inline(always)]
    fn after(&self, shown: f64, from: f64, to: f64, step_s: f64) -> f64 {
        let time = if to < shown { self.falling } else { self.rising };
        let slope = (to - from) / step_s;
        let behind = slope * time.s;
        to - behind + (shown - from + behind) * time.kept
    }
}
