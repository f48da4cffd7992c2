//! Set-points: where the axis shall be, and how fast, at a time since the experiment began.
//!
//! A [`Profile`] is a row of moves, each along a motion law and followed by a rest. A law maps z = t / T, 0 to 1, onto
//! s(z), 0 to 1, with s'(z); each law is a file of its own beside this one.

pub mod bestehorn;
pub mod modified_sine;

use serde::Deserialize;
use std::fmt;

/// A position set-point and its rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint {
    /// Position, m.
    pub position_m: f64,
    /// Its rate, m/s.
    pub velocity_m_per_s: f64,
    /// The rate of that, m/s^2.
    pub acceleration_m_per_s2: f64,
    /// Whether the set-point moves; at rest both error figures are judged otherwise.
    pub moving: bool,
}

impl SetPoint {
    /// A set-point that stays.
    #[must_use]
    pub fn at_rest(position_m: f64) -> Self {
        Self { position_m, velocity_m_per_s: 0.0, acceleration_m_per_s2: 0.0, moving: false }
    }
}

/// A force set-point and its rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceSetPoint {
    /// Force between rod and carriage, N, compression positive.
    pub force_n: f64,
    /// Its rate, N/s.
    pub rate_n_per_s: f64,
    /// Whether the set-point moves.
    pub moving: bool,
}

impl ForceSetPoint {
    /// A set-point that stays.
    #[must_use]
    pub fn at_rest(force_n: f64) -> Self {
        Self { force_n, rate_n_per_s: 0.0, moving: false }
    }
}

/// How a move gets from one position to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionLaw {
    /// Bestehorn sinoid.
    Bestehorn,
    /// Modified sine of VDI 2143.
    ModifiedSine,
}

impl MotionLaw {
    /// s(z) and s'(z) for z in 0 to 1.
    fn at(self, z: f64) -> (f64, f64) {
        match self {
            Self::Bestehorn => bestehorn::at(z),
            Self::ModifiedSine => modified_sine::at(z),
        }
    }
}

impl fmt::Display for MotionLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bestehorn => "bestehorn",
            Self::ModifiedSine => "modified-sine",
        })
    }
}

/// One move and the rest after it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Move {
    /// Where it ends, m.
    pub to_m: f64,
    /// How long it takes, s; above 0.
    pub duration_s: f64,
    /// How long the axis rests afterwards, s.
    pub rest_s: f64,
}

/// A row of moves from a start position.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    law: MotionLaw,
    start_m: f64,
    moves: Vec<Move>,
}

impl Profile {
    /// A profile along one law. The caller has checked positions and times.
    #[must_use]
    pub fn new(law: MotionLaw, start_m: f64, moves: Vec<Move>) -> Self {
        Self { law, start_m, moves }
    }

    /// Where it starts, m.
    #[must_use]
    pub fn start_m(&self) -> f64 {
        self.start_m
    }

    /// How long it takes with its rests, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.moves.iter().map(|part| part.duration_s + part.rest_s).sum()
    }

    /// The set-point `time_s` after the start; the last position from the end on.
    #[must_use]
    pub fn at(&self, time_s: f64) -> SetPoint {
        let mut from_m = self.start_m;
        let mut left_s = time_s.max(0.0);
        for part in &self.moves {
            if left_s < part.duration_s {
                let (s, ds_dz) = self.law.at(left_s / part.duration_s);
                let way_m = part.to_m - from_m;
                return SetPoint {
                    position_m: from_m + way_m * s,
                    velocity_m_per_s: way_m * ds_dz / part.duration_s,
                    acceleration_m_per_s2: 0.0,
                    moving: true,
                };
            }
            left_s -= part.duration_s;
            from_m = part.to_m;
            if left_s < part.rest_s {
                break;
            }
            left_s -= part.rest_s;
        }
        SetPoint::at_rest(from_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAWS: [MotionLaw; 2] = [MotionLaw::Bestehorn, MotionLaw::ModifiedSine];

    fn out_and_back(law: MotionLaw) -> Profile {
        let part = |to_m| Move { to_m, duration_s: 3.0, rest_s: 1.0 };
        Profile::new(law, 0.1, vec![part(0.4), part(0.1)])
    }

    #[test]
    fn a_profile_starts_rests_and_ends_where_it_says() {
        for law in LAWS {
            let profile = out_and_back(law);
            assert_eq!(profile.duration_s(), 8.0);
            assert_eq!(profile.at(-1.0).position_m, 0.1);
            assert_eq!(profile.at(3.0), SetPoint::at_rest(0.4));
            assert_eq!(profile.at(3.999), SetPoint::at_rest(0.4));
            assert!(profile.at(4.5).moving);
            assert_eq!(profile.at(100.0), SetPoint::at_rest(0.1));
        }
    }

    #[test]
    fn the_rate_is_the_derivative_of_the_position() {
        const STEP_S: f64 = 1e-5;
        for law in LAWS {
            let profile = out_and_back(law);
            for time_ms in 1..2999 {
                let time_s = f64::from(time_ms) * 1e-3;
                let ahead = profile.at(time_s + STEP_S).position_m;
                let behind = profile.at(time_s - STEP_S).position_m;
                let slope = (ahead - behind) / (2.0 * STEP_S);
                // Central difference: error s''' step^2 / 6, below 1e-9 here, and rounding of 1e-16 / step.
                assert!((slope - profile.at(time_s).velocity_m_per_s).abs() < 1e-8, "{law} at {time_s} s");
            }
        }
    }
}
