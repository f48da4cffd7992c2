//! Sine and chirp: a deviation to either side of where the row stands, at one frequency or at one that sweeps linearly over time,
//! faded in and out if asked. It starts upwards and ends where it started.
//!
//! ```text
//!   x  = x_0 + A w sin(phi)                          phi = 2 pi (f_0 t + (f_1 - f_0) t^2 / (2 T))
//!   x' = A (w' sin(phi) + w phi' cos(phi))
//!   x" = A (w" sin(phi) + (2 w' phi' + w phi") cos(phi) - w phi'^2 sin(phi))
//! ```
//!
//! A: amplitude_m or amplitude_n. f_0, f_1: from_hz, to_hz; of the sine both are frequency_hz. T: duration_s. w: fade, 1 except
//! along a Bestehorn sinoid at either end for fade_s. Without a fade the rate jumps at either end, and the phase must end at a
//! multiple of pi, so that the row goes on where it stood; with one it begins and ends at rest.

use super::bestehorn;
use super::law::{BOTH, Extent, Kind, Law, ProfilePoint, SegmentReader};
use settings::SettingsError;
use settings::parameters::Parameter;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

pub(super) const SINE: Kind = Kind {
    name: "sine",
    about: "to either side at one frequency",
    serves: BOTH,
    read: |reader| {
        let frequency_hz = reader.number(&FREQUENCY)?;
        Oscillation::read(reader, [frequency_hz; 2])
    },
};

pub(super) const CHIRP: Kind = Kind {
    name: "chirp",
    about: "to either side at a frequency that sweeps",
    serves: BOTH,
    read: |reader| {
        let frequencies_hz = [reader.number(&FROM)?, reader.number(&TO)?];
        Oscillation::read(reader, frequencies_hz)
    },
};

static FREQUENCY: Parameter =
    Parameter::new(("frequency_hz", "Hz"), [0.001, 200.0], 1.0, "periods in a second");
static FROM: Parameter = Parameter::new(("from_hz", "Hz"), [0.001, 200.0], 0.1, "frequency at the start");
static TO: Parameter = Parameter::new(("to_hz", "Hz"), [0.001, 200.0], 10.0, "frequency at the end");
static FADE: Parameter = Parameter::new(("fade_s", "s"), [0.0, 3600.0], 0.0, "how long it fades in, and out");
/// How far the last phase may be off a multiple of pi, as share of pi.
const PHASE_TOLERANCE: f64 = 1e-6;

#[derive(Debug)]
pub(super) struct Oscillation {
    from: f64,
    amplitude: f64,
    from_hz: f64,
    to_hz: f64,
    duration_s: f64,
    fade_s: f64,
}

impl Oscillation {
    pub(super) fn read(
        reader: &mut SegmentReader<'_, '_>,
        [from_hz, to_hz]: [f64; 2],
    ) -> Result<Arc<dyn Law>, SettingsError> {
        let amplitude = reader.amplitude()?;
        let duration_s = reader.duration_s(0.01)?;
        let fade_s = reader.section.number_or_default(&FADE)?;
        if 2.0 * fade_s > duration_s {
            let most_s = 0.5 * duration_s;
            let message = format!("fade_s = {fade_s} s; allowed is 0 to {most_s} s, half of duration_s");
            return Err(reader.section.wrong_at("fade_s", &message));
        }
        let halves = (from_hz + to_hz) * duration_s;
        if fade_s == 0.0 && (halves - halves.round()).abs() > PHASE_TOLERANCE {
            let mean_hz = 0.5 * (from_hz + to_hz);
            let [shorter_s, longer_s] = [halves.floor(), halves.ceil()].map(|whole| whole / (2.0 * mean_hz));
            let message = format!(
                "duration_s = {duration_s} s ends off the middle; allowed is a multiple of half a period, such as {shorter_s} \
                 or {longer_s} s, or a fade_s above 0"
            );
            return Err(reader.section.wrong_at("duration_s", &message));
        }
        Ok(Arc::new(Self { from: reader.from, amplitude, from_hz, to_hz, duration_s, fade_s }))
    }

    /// Fade with its two derivatives.
    fn fade(&self, time_s: f64) -> [f64; 3] {
        let fade_s = self.fade_s;
        let left_s = self.duration_s - time_s;
        if fade_s == 0.0 || (time_s >= fade_s && left_s >= fade_s) {
            return [1.0, 0.0, 0.0];
        }
        let (nearer_s, sign) = if time_s < left_s { (time_s, 1.0) } else { (left_s, -1.0) };
        let [w, rate, acceleration] = bestehorn::at((nearer_s / fade_s).clamp(0.0, 1.0));
        [w, sign * rate / fade_s, acceleration / (fade_s * fade_s)]
    }
}

impl Law for Oscillation {
    fn at(&self, time_s: f64) -> ProfilePoint {
        let sweep_hz_per_s = (self.to_hz - self.from_hz) / self.duration_s;
        let turns = (self.from_hz + 0.5 * sweep_hz_per_s * time_s) * time_s;
        let phase_rate = TAU * (self.from_hz + sweep_hz_per_s * time_s);
        // Whole turns taken off first: the sine of a large angle loses digits.
        let phase = TAU * (turns - turns.floor());
        let (sine, cosine) = (libm::sin(phase), libm::cos(phase));
        let [w, w1, w2] = self.fade(time_s);
        let along = w2 - w * phase_rate * phase_rate;
        let across = 2.0 * w1 * phase_rate + w * TAU * sweep_hz_per_s;
        ProfilePoint {
            value: self.from + self.amplitude * w * sine,
            rate: self.amplitude * (w1 * sine + w * phase_rate * cosine),
            acceleration: self.amplitude * (along * sine + across * cosine),
            moving: self.amplitude != 0.0,
        }
    }

    fn extent(&self) -> Extent {
        Extent::around(self.from, self.amplitude, self.duration_s)
    }
}

// The tolerance of the phase is of no account beside a sensor's step: 1e-6 pi of half a metre is 0.8 um.
const _: () = assert!(PHASE_TOLERANCE * PI * 0.25 < 1e-6);
