//! Candidates: every effect of the catalogue at every observable place, and the scaling of its numbers.
//!
//! Fits use dimensionless coordinates: 0 is the baseline, 1 about the strongest amplitude that occurs:
//!
//! ```text
//!   neutral value n      z = (a - n) / largest drawn change
//!   neutral at infinity  z = drawn least / a                    (stiffness, conductance, rate: the smaller the stronger)
//!   far from neutral     z = ln(a / n) / ln(largest drawn ratio)  (where the range spans decades on both sides)
//!   shape                z = (a - default) / drawn width          (changes nothing while the amplitude is 0)
//! ```
//!
//! The coordinates of an effect that the rig file already has count from the file's numbers.

use crate::suspects::Suspect;
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Part, Place, Sheet};
use plant::parameters::ParameterError;
use plant::{Axis, RigParameters};

/// Ratio of the largest to the smallest drawn value above which a key is scaled logarithmically.
const DECADES: f64 = 30.0;
/// Neutral values from which on a key counts as neutral at infinity, as a multiple of the largest drawn one.
const FAR: f64 = 10.0;
/// Largest coordinate of a fit, three times the strongest that is drawn: one standard deviation of the prior.
const FARTHEST: f64 = 3.0;

/// Keys of a sheet at most.
const MOST_KEYS: usize = 6;

/// An effect or a suspect at a place, as a term that a fit may add.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Its data sheet: name, keys with units and ranges.
    pub sheet: &'static Sheet,
    /// Where it acts.
    pub place: Place,
    /// The suspect that it is of; `None` for an effect of the catalogue.
    pub(crate) suspect: Option<&'static Suspect>,
    /// Numbers of its keys in the rig file, in the file's units; `None` where it is not on there.
    present: Option<[f64; MOST_KEYS]>,
}

#[derive(Clone, Copy, Debug)]
enum Scale {
    Linear { neutral: f64, unit: f64 },
    Reciprocal { least: f64, neutral: f64 },
    Logarithm { neutral: f64, unit: f64 },
}

impl Scale {
    fn of(key: &EffectKey, present: Option<f64>) -> Scale {
        let [least, most] = key.drawn;
        let neutral = key.neutral.or(if key.default.is_none() { Some(f64::INFINITY) } else { None });
        match present.or(neutral) {
            Some(neutral) if neutral > FAR * most => Scale::Reciprocal { least, neutral },
            Some(neutral) if neutral > 0.0 && most / least > DECADES => {
                let unit = (most / neutral).ln().abs().max((least / neutral).ln().abs());
                Scale::Logarithm { neutral, unit }
            }
            Some(neutral) => {
                Scale::Linear { neutral, unit: (most - neutral).abs().max((least - neutral).abs()) }
            }
            None => Scale::Linear { neutral: key.default.unwrap_or(0.0), unit: most - least },
        }
    }

    fn number(self, z: f64) -> f64 {
        match self {
            Scale::Linear { neutral, unit } => neutral + z * unit,
            Scale::Reciprocal { least, neutral } => 1.0 / (z / least + 1.0 / neutral).max(1e-9 / least),
            Scale::Logarithm { neutral, unit } => neutral * (z * unit).exp(),
        }
    }

    fn coordinate(self, number: f64) -> f64 {
        match self {
            Scale::Linear { neutral, unit } => (number - neutral) / unit,
            Scale::Reciprocal { least, neutral } => least * (1.0 / number - 1.0 / neutral),
            Scale::Logarithm { neutral, unit } => (number / neutral).ln() / unit,
        }
    }

    /// d number / d z.
    fn slope(self, z: f64) -> f64 {
        match self {
            Scale::Linear { unit, .. } => unit,
            Scale::Reciprocal { least, .. } => {
                let number = self.number(z);
                -number * number / least
            }
            Scale::Logarithm { unit, .. } => self.number(z) * unit,
        }
    }
}

impl Candidate {
    /// All candidates that records of these axes can show.
    pub fn all(rig: &RigParameters, measured: [bool; 2], linked: bool, without: &[String]) -> Vec<Candidate> {
        let shown = |place: &Place| match place.part {
            Part::Drive => measured[Axis::Drive.index()],
            Part::Load => measured[Axis::Load.index()],
            Part::Linkage => linked && measured == [true, true],
            Part::Supply => true,
        };
        SHEETS
            .iter()
            .filter(|sheet| !without.iter().any(|name| name == sheet.name))
            .flat_map(|sheet| {
                let places = sheet.place.places().iter().copied().filter(move |place| shown(place));
                places.map(move |place| Candidate::in_rig(rig, sheet, place))
            })
            .collect()
    }

    /// The suspects that records of these axes can show.
    pub fn of_suspects(
        rig: &RigParameters,
        measured: [bool; 2],
        suspects: &[&'static Suspect],
    ) -> Vec<Candidate> {
        let one = |suspect: &&'static Suspect| {
            let here = rig.terms().iter().find(|term| term.is_same(&suspect.declared));
            let present = here.map(|term| {
                let mut numbers = [0.0; MOST_KEYS];
                numbers.iter_mut().zip(term.numbers()).for_each(|(value, number)| *value = number.value);
                numbers
            });
            Candidate { sheet: &suspect.sheet, place: suspect.place, suspect: Some(suspect), present }
        };
        let shown = |suspect: &&&'static Suspect| measured[suspect.declared.axis.index()];
        suspects.iter().filter(shown).map(one).collect()
    }

    /// An effect at a place, with the numbers that the rig file has there.
    pub fn in_rig(rig: &RigParameters, sheet: &'static Sheet, place: Place) -> Candidate {
        let effect = rig.effects().iter().find(|effect| effect.name == sheet.name && effect.place == place);
        let present = effect.map(|effect| {
            let mut numbers = [0.0; MOST_KEYS];
            numbers[..effect.numbers.len()].copy_from_slice(&effect.numbers);
            numbers
        });
        Candidate { sheet, place, suspect: None, present }
    }

    fn scale(&self, key: usize) -> Scale {
        Scale::of(&self.sheet.keys[key], self.present.map(|numbers| numbers[key]))
    }

    /// Baseline value of a key: the rig file's number, else the neutral value; `None` for shapes and for effects without a
    /// neutral value.
    pub fn baseline(&self, key: usize) -> Option<f64> {
        let neutral = self.sheet.keys[key].neutral.filter(|neutral| neutral.is_finite());
        self.present.map(|numbers| numbers[key]).or(neutral)
    }

    /// Whether the rig file has it.
    pub(crate) fn is_present(&self) -> bool {
        self.present.is_some()
    }

    /// Name and place, as `piston-leakage drive`.
    pub fn name(&self) -> String {
        format!("{} {}", self.sheet.name, self.place)
    }

    /// Coordinates of the baseline: all 0.
    pub fn origin(&self) -> Vec<f64> {
        vec![0.0; self.sheet.keys.len()]
    }

    /// Whether a key has no influence at zero amplitude.
    pub(crate) fn is_shape(&self, key: usize) -> bool {
        key > 0 && !self.is_present() && self.sheet.keys[key].neutral.is_none()
    }

    /// Whether the effect vanishes continuously with its amplitude.
    pub fn vanishes_at_zero_amplitude(&self) -> bool {
        self.is_present() || self.sheet.keys[0].neutral.is_some()
    }

    /// Smallest and largest coordinate of a key.
    pub(crate) fn range(&self, key: usize) -> [f64; 2] {
        let sheet_key = &self.sheet.keys[key];
        let scale = self.scale(key);
        let ends = [scale.coordinate(sheet_key.min), scale.coordinate(sheet_key.max)];
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }

    /// Bounds of a key's coordinate in a fit.
    pub fn fit_bounds(&self, key: usize) -> [f64; 2] {
        let [least, most] = self.range(key);
        let most = most.min(FARTHEST);
        [least.max(-FARTHEST).min(most), most]
    }

    /// Whether the first key can go to both sides of the baseline.
    pub fn is_two_sided(&self) -> bool {
        let [least, most] = self.range(0);
        least < -1e-6 && most > 1e-6
    }

    /// The effect parameters at some coordinates, in the file's units, clamped to their ranges.
    pub fn effect_parameters(&self, coordinates: &[f64]) -> Vec<f64> {
        self.sheet
            .keys
            .iter()
            .zip(coordinates)
            .enumerate()
            .map(|(at, (key, z))| self.scale(at).number(*z).clamp(key.min, key.max))
            .collect()
    }

    /// d number / d coordinate of a key.
    pub fn slope(&self, key: usize, coordinate: f64) -> f64 {
        self.scale(key).slope(coordinate)
    }

    /// Standard error of a key's number: half of the farther end of two standard errors of its coordinate, within the key's
    /// range. Where a number is not linear in its coordinate, the slope alone is too narrow towards the neutral value.
    pub(crate) fn standard_error(&self, key: usize, coordinate: f64, error: f64) -> f64 {
        let (scale, sheet_key) = (self.scale(key), &self.sheet.keys[key]);
        let number = scale.number(coordinate);
        let ends = [-2.0, 2.0].map(|errors| scale.number(coordinate + errors * error));
        let away = |end: f64| 0.5 * (end.clamp(sheet_key.min, sheet_key.max) - number).abs();
        (error * scale.slope(coordinate).abs()).max(away(ends[0])).max(away(ends[1]))
    }

    /// Coordinate of a key at a number in the file's units, not limited to its range.
    pub fn coordinate(&self, key: usize, number: f64) -> f64 {
        self.scale(key).coordinate(number)
    }

    /// The rig with this effect.
    ///
    /// # Errors
    /// [`ParameterError`] when the numbers do not fit together.
    pub fn rig(&self, rig: &RigParameters, coordinates: &[f64]) -> Result<RigParameters, ParameterError> {
        let numbers = self.effect_parameters(coordinates);
        if let Some(suspect) = self.suspect {
            return Ok(rig.with_term(&suspect.declared.with(&numbers)?));
        }
        let named: Vec<(&str, f64)> =
            self.sheet.keys.iter().map(|key| key.name).zip(numbers.iter().copied()).collect();
        rig.with_effect(self.sheet.name, &self.place.to_string(), &named)
    }

    /// Coordinates of the screening simulations.
    pub(crate) fn probes(&self) -> Vec<Vec<f64>> {
        let keys = self.sheet.keys.len();
        let at = |key: usize, z: f64| {
            let mut coordinates = self.origin();
            coordinates[key] = z;
            coordinates
        };
        let mut probes = if self.is_two_sided() && self.sheet.keys[0].signed {
            vec![at(0, 0.3)]
        } else if self.is_two_sided() {
            vec![at(0, 0.2), at(0, -0.2)]
        } else if self.vanishes_at_zero_amplitude() && self.sheet.nonlinear_in_amplitude {
            vec![at(0, 0.1), at(0, 0.5)]
        } else if self.vanishes_at_zero_amplitude() {
            vec![at(0, 0.25)]
        } else {
            vec![at(0, 0.6), at(0, 0.85)]
        };
        for key in (1..keys).filter(|key| !self.is_shape(*key)) {
            probes.push(at(key, 0.4));
        }
        for second in self.sheet.also_screened {
            let mut coordinates = at(0, 0.3);
            coordinates[1] = *second;
            probes.push(coordinates);
        }
        probes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_probe_of_every_effect_is_a_rig_and_its_coordinates_come_back() {
        let rig = RigParameters::baseline();
        let all = Candidate::all(&rig, [true, true], true, &[]);
        assert!(all.len() > SHEETS.len());
        for candidate in all {
            let name = candidate.name();
            for probe in candidate.probes() {
                candidate.rig(&rig, &probe).unwrap_or_else(|error| panic!("{name}: {error}"));
                let numbers = candidate.effect_parameters(&probe);
                // A stiffness without end is held at what a file may say.
                let moved = numbers.iter().zip(&probe).enumerate().filter(|(_, (_, z))| **z != 0.0);
                for (key, (number, z)) in moved {
                    let back = candidate.coordinate(key, *number);
                    assert!((back - z).abs() < 1e-6, "{name} key {key}: {z} comes back as {back}");
                }
            }
        }
    }

    #[test]
    fn a_standard_error_reaches_the_farther_end_where_a_number_is_not_linear() {
        let all = Candidate::all(&RigParameters::baseline(), [true, false], false, &[]);
        let of = |name: &str| *all.iter().find(|candidate| candidate.sheet.name == name).unwrap();
        let inclination = of("inclination");
        let slope = inclination.slope(0, 0.5).abs();
        assert!((inclination.standard_error(0, 0.5, 0.01) - 0.01 * slope).abs() < 1e-9);
        // An orifice whose neutral size is infinite: two errors up are far off, two errors down are not.
        let valve = of("check-valve-restriction");
        let z = valve.coordinate(1, 20.0);
        let [up, down] = [-0.4, 0.4].map(|share| valve.effect_parameters(&[0.0, z * (1.0 + share)])[1]);
        let error = valve.standard_error(1, z, 0.2 * z);
        assert!(
            (error - 0.5 * (up - 20.0)).abs() < 1e-9 && error > 0.7 * (20.0 - down),
            "{error} {up} {down}"
        );
    }

    #[test]
    fn a_suspect_is_a_candidate_whose_origin_is_the_rig_without_it() {
        let text = "[[suspects]]\nname = \"bump\"\nplace = \"drive.force\"\nadd = \"-f*exp(-min((x - c)^2/w^2, 50))\"\n\
                    parameters.f = { unit = \"N\", range = [-100, 100], prior = 40 }\n\
                    parameters.c = { unit = \"mm\", value = 250, range = [0, 500] }\n\
                    parameters.w = { unit = \"mm\", value = 50, range = [20, 200] }\n";
        let suspects = crate::suspects::read(text, "s.toml").unwrap();
        let rig = RigParameters::baseline();
        let all = |rig: &RigParameters, measured| Candidate::of_suspects(rig, measured, &suspects);
        assert!(all(&rig, [false, true]).is_empty());
        let candidate = all(&rig, [true, false])[0];
        assert_eq!(candidate.name(), "bump drive");
        assert_eq!([0, 1, 2].map(|key| candidate.is_shape(key)), [false, true, true]);
        assert_eq!(candidate.effect_parameters(&candidate.origin()), [0.0, 250.0, 50.0]);
        assert_eq!(candidate.effect_parameters(&[1.0, 0.0, 0.0])[0], 40.0);
        assert_eq!(candidate.probes(), [[0.3, 0.0, 0.0]]);
        let with = candidate.rig(&rig, &[0.5, 0.1, 0.0]).unwrap();
        assert_eq!(with.terms()[0].numbers()[0].value, 20.0);
        let here = all(&with, [true, false])[0];
        assert!(here.is_present());
        assert_eq!(here.rig(&with, &here.origin()).unwrap(), with);
    }

    #[test]
    fn an_effect_that_the_rig_file_has_counts_from_there() {
        let mut seen = 0;
        for candidate in Candidate::all(&RigParameters::baseline(), [true, true], true, &[]) {
            assert!(candidate.sheet.keys.len() <= MOST_KEYS, "{}", candidate.name());
            let strong = candidate.probes().remove(0);
            let Ok(rig) = candidate.rig(&RigParameters::baseline(), &strong) else { continue };
            let here = Candidate::in_rig(&rig, candidate.sheet, candidate.place);
            assert_eq!(here.rig(&rig, &here.origin()).unwrap(), rig, "{}", here.name());
            assert_eq!(here.baseline(0), Some(candidate.effect_parameters(&strong)[0]), "{}", here.name());
            for probe in here.probes() {
                assert_ne!(here.rig(&rig, &probe).unwrap(), rig, "{}: {probe:?}", here.name());
            }
            seen += 1;
        }
        assert!(seen > SHEETS.len());
    }

    #[test]
    fn the_largest_drawn_change_is_about_one() {
        for candidate in Candidate::all(&RigParameters::baseline(), [true, false], false, &[]) {
            let key = &candidate.sheet.keys[0];
            let ends = key.drawn.map(|number| candidate.coordinate(0, number).abs());
            let most = ends[0].max(ends[1]);
            assert!((most - 1.0).abs() < 1e-6, "{}: {most}", candidate.name());
        }
    }
}
