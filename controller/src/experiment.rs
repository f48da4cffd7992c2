//! The part of an experiment file that concerns the controllers: motion, repetitions, algorithm.
//!
//! ```toml
//! [drive]
//! law = "bestehorn"
//! start_m = 0.1
//! moves = [{ to_m = 0.4, duration_s = 3.0, rest_s = 1.0 }]
//!
//! [drive.position-p]
//! gain_per_s = 40.0
//! velocity_feed_forward = 1.0
//! ```
//!
//! `[rig]` is the emulator's and `[passed]` the report's; they may hold what they like.

use crate::set_point::{MotionLaw, Move, Profile};
use serde::{Deserialize, Serialize};
use toml::Spanned;

/// `[drive]` of an experiment file, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveExperiment {
    /// What the experiment is called.
    pub title: String,
    /// The drive's motion.
    pub profile: Profile,
    /// How often it is driven through.
    pub repetitions: u32,
    /// How long the axis must stand still before and after, s.
    pub settling_s: f64,
    /// The algorithm's parameters.
    pub position_p: PositionGains,
}

/// Gains of the position control.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PositionGains {
    /// Velocity for each error, 1/s; 0 to 200.
    pub gain_per_s: f64,
    /// Share of the set-point's rate that is fed forward; 0 to 2.
    pub velocity_feed_forward: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    title: String,
    drive: Drive,
    #[serde(rename = "rig", default)]
    _rig: toml::Table,
    #[serde(rename = "passed", default)]
    _passed: toml::Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Drive {
    law: MotionLaw,
    start_m: Spanned<f64>,
    moves: Vec<Spanned<Move>>,
    #[serde(default = "once")]
    repetitions: Spanned<u32>,
    #[serde(default = "half_a_second")]
    settling_s: Spanned<f64>,
    #[serde(rename = "position-p")]
    position_p: Gains,
}

/// [`PositionGains`] with the place of each value.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Gains {
    gain_per_s: Spanned<f64>,
    velocity_feed_forward: Spanned<f64>,
}

fn once() -> Spanned<u32> {
    Spanned::new(0..0, 1)
}

fn half_a_second() -> Spanned<f64> {
    Spanned::new(0..0, 0.5)
}

/// An experiment that cannot be run: file, line, key, value and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ExperimentError(String);

impl DriveExperiment {
    /// The drive's part of the experiment in `text`, for a stroke of `stroke_m`. `file` is for messages.
    ///
    /// # Errors
    /// [`ExperimentError`] for TOML that does not parse, unknown or missing keys, and values out of range.
    pub fn from_toml(text: &str, file: &str, stroke_m: f64) -> Result<Self, ExperimentError> {
        let parsed: File =
            toml::from_str(text).map_err(|error| ExperimentError(format!("{file}: {error}")))?;
        let drive = parsed.drive;
        let check = Check { text, file };
        check.range("drive.start_m", &drive.start_m, *drive.start_m.as_ref(), 0.0, stroke_m, "m")?;
        if drive.moves.is_empty() {
            return Err(ExperimentError(format!(
                "{file}: drive.moves is empty; at least one move is needed"
            )));
        }
        for part in &drive.moves {
            let values = part.as_ref();
            check.range("drive.moves.to_m", part, values.to_m, 0.0, stroke_m, "m")?;
            check.range("drive.moves.duration_s", part, values.duration_s, 0.01, 3600.0, "s")?;
            check.range("drive.moves.rest_s", part, values.rest_s, 0.0, 3600.0, "s")?;
        }
        let repetitions = &drive.repetitions;
        check.range("drive.repetitions", repetitions, f64::from(*repetitions.as_ref()), 1.0, 1e6, "times")?;
        check.range("drive.settling_s", &drive.settling_s, *drive.settling_s.as_ref(), 0.0, 60.0, "s")?;
        let Gains { gain_per_s, velocity_feed_forward } = &drive.position_p;
        let position_p = PositionGains {
            gain_per_s: *gain_per_s.as_ref(),
            velocity_feed_forward: *velocity_feed_forward.as_ref(),
        };
        let key = "drive.position-p.gain_per_s";
        check.range(key, gain_per_s, position_p.gain_per_s, 0.0, 200.0, "1/s")?;
        let key = "drive.position-p.velocity_feed_forward";
        check.range(key, velocity_feed_forward, position_p.velocity_feed_forward, 0.0, 2.0, "(no unit)")?;
        Ok(Self {
            title: parsed.title,
            profile: Profile::new(
                drive.law,
                drive.start_m.into_inner(),
                drive.moves.into_iter().map(Spanned::into_inner).collect(),
            ),
            repetitions: drive.repetitions.into_inner(),
            settling_s: drive.settling_s.into_inner(),
            position_p,
        })
    }
}

struct Check<'a> {
    text: &'a str,
    file: &'a str,
}

impl Check<'_> {
    fn range<T>(
        &self,
        key: &str,
        place: &Spanned<T>,
        value: f64,
        least: f64,
        most: f64,
        unit: &str,
    ) -> Result<(), ExperimentError> {
        // NaN is in no range.
        if (least..=most).contains(&value) {
            return Ok(());
        }
        let line = 1 + self.text[..place.span().start.min(self.text.len())].matches('\n').count();
        Err(ExperimentError(format!(
            "{}:{line}: {key} = {value} {unit}; allowed is {least} to {most} {unit}",
            self.file
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"title = "t"
[rig]
carriage_position_m = 0.1
[drive]
law = "modified-sine"
start_m = 0.1
moves = [{ to_m = 0.4, duration_s = 3.0, rest_s = 1.0 }]
[drive.position-p]
gain_per_s = 40.0
velocity_feed_forward = 1.0
[passed]
anything = 1
"#;

    #[test]
    fn a_good_file_is_read_with_its_defaults() {
        let experiment = DriveExperiment::from_toml(GOOD, "e.toml", 0.5).unwrap();
        assert_eq!((experiment.repetitions, experiment.settling_s), (1, 0.5));
        assert_eq!(experiment.profile.duration_s(), 4.0);
        assert_eq!(experiment.position_p.gain_per_s, 40.0);
    }

    #[test]
    fn a_bad_value_is_told_with_file_line_key_value_and_range() {
        for (good, bad, hints) in [
            ("start_m = 0.1", "start_m = 0.6", ["e.toml:6", "drive.start_m = 0.6 m", "0 to 0.5 m"]),
            ("to_m = 0.4", "to_m = -1.0", ["e.toml:7", "to_m = -1 m", "0 to 0.5 m"]),
            ("duration_s = 3.0", "duration_s = 0.0", ["e.toml:7", "duration_s = 0 s", "0.01 to 3600 s"]),
            ("gain_per_s = 40.0", "gain_per_s = nan", ["gain_per_s = NaN 1/s", "0 to 200", "e.toml:9"]),
            ("gain_per_s", "gain", ["e.toml", "line 9", "unknown field `gain`"]),
            ("law = \"modified-sine\"", "law = \"jerk\"", ["e.toml", "jerk", "bestehorn"]),
        ] {
            assert!(GOOD.contains(good));
            let message =
                DriveExperiment::from_toml(&GOOD.replace(good, bad), "e.toml", 0.5).unwrap_err().to_string();
            for hint in hints {
                assert!(message.contains(hint), "'{hint}' is missing in: {message}");
            }
        }
    }
}
