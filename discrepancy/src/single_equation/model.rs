//! A model file: which balance, which columns, how they are processed; checked once.
//!
//! Keys with defaults, and two examples that run: `discrepancy/docs/one-balance.md`, `discrepancy/models/`.

use super::BalanceError;
use super::select::SHARE_FLOOR;
use records::description_error::DescriptionError;
use records::{Channel, Mapping};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Which balance a model is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Kind {
    /// One mass: `m a = F_applied - F_friction - F_offset`.
    Mass,
    /// Slow strokes of one chamber: `F_ext = A p + F_friction + F_offset`.
    Friction,
    /// One chamber: `d(p V)/dt / p_N = q`.
    Chamber,
}

/// A checked model file.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) kind: Kind,
    /// What it is called in reports.
    pub(crate) name: String,
    /// Mapping of its records; `None` for `measurement.csv`.
    pub(crate) mapping: Option<PathBuf>,
    /// Rig file that a chamber's numbers come from.
    pub(crate) rig: Option<PathBuf>,
    /// Where each quantity is.
    pub(super) channels: BTreeMap<String, Channel>,
    /// How records are processed.
    pub(crate) processing: Processing,
    /// Folds and thresholds of the selection.
    pub(crate) selection: Selection,
    /// Which of the baseline's columns are fitted.
    pub(crate) baseline: Baseline,
    /// What was added.
    pub(crate) terms: Vec<TermEntry>,
}

/// How a record becomes rows.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Processing {
    /// Samples are interpolated linearly to this distance, s.
    pub(crate) period_s: f64,
    /// Edge of the position's (and pressure's) zero-phase Butterworth, Hz; 0 for none.
    pub(crate) low_pass_hz: f64,
    pub(crate) low_pass_order: usize,
    /// Samples of a moving average of the position before its speed is taken; 1 for none.
    pub(crate) moving_average: usize,
    /// Every how many samples there is a row; more than 1 goes through a zero-phase Chebyshev I.
    pub(crate) decimate: usize,
    pub(crate) decimate_order: usize,
    /// Its ripple, dB.
    pub(super) decimate_ripple_decibel: f64,
    /// Its edge over the Nyquist frequency of the rows.
    pub(super) decimate_edge: f64,
    /// Rows that are slower are left out, mm/s.
    pub(crate) speed_above_mm_per_s: f64,
    /// Rows outside are left out, mm.
    pub(crate) position_mm: [f64; 2],
    /// Rows within this of an end of a record are fitted but not judged, s: the ends of a zero-phase filter.
    pub(crate) ends_s: f64,
}

impl Default for Processing {
    fn default() -> Self {
        Self {
            period_s: 1e-3,
            low_pass_hz: 0.0,
            low_pass_order: 4,
            moving_average: 1,
            decimate: 1,
            decimate_order: 4,
            decimate_ripple_decibel: 0.5,
            decimate_edge: 0.8,
            speed_above_mm_per_s: 0.0,
            position_mm: [f64::NEG_INFINITY, f64::INFINITY],
            ends_s: 0.0,
        }
    }
}

/// What selection asks.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Selection {
    /// Folds in time of each record.
    pub(crate) blocks: usize,
    /// Bands of position, and of speed, that are folds as well.
    pub(crate) bands: usize,
    /// Least share of the residual's power that a term must take on folds in time; half of it on bands.
    pub(super) share_floor: f64,
    /// Maximum number of terms; 0 reports the residuals of the model as it is.
    pub(crate) most: usize,
    /// Pitches that the machine has, of a screw or of teeth, mm: further candidates for ripples beside the scan.
    pub(crate) pitches_mm: Vec<f64>,
}

impl Default for Selection {
    fn default() -> Self {
        Self { blocks: 10, bands: 10, share_floor: SHARE_FLOOR, most: 3, pitches_mm: Vec::new() }
    }
}

/// Which columns the baseline has besides mass or area.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Baseline {
    /// Viscous friction; by default of a mass.
    pub(crate) viscous: Option<bool>,
    pub(crate) sliding: bool,
    /// Constant force or flow.
    pub(crate) offset: bool,
}

impl Default for Baseline {
    fn default() -> Self {
        Self { viscous: None, sliding: true, offset: true }
    }
}

/// A term that was added to the model; its numbers are for information and refitted with the others.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TermEntry {
    pub(crate) effect: String,
    /// Which form of it; empty where there is one.
    #[serde(default)]
    pub(crate) form: String,
    /// Numbers that shape it, in the units of their names.
    #[serde(default)]
    pub(crate) shape: BTreeMap<String, f64>,
    /// What [`super::extended_model_text`] writes for people.
    #[serde(default, rename = "fitted")]
    pub(super) _fitted: toml::Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    kind: Kind,
    #[serde(default)]
    name: Option<String>,
    mapping: Option<PathBuf>,
    rig: Option<PathBuf>,
    #[serde(default)]
    channels: BTreeMap<String, String>,
    #[serde(default)]
    processing: Processing,
    #[serde(default)]
    selection: Selection,
    #[serde(default)]
    baseline: Baseline,
    #[serde(default)]
    terms: Vec<TermEntry>,
}

/// What each kind needs, and the column it is in when the file does not say.
fn needed(kind: Kind) -> &'static [(&'static str, &'static str)] {
    match kind {
        Kind::Mass => &[("position", "drive_position_m"), ("force", "drive_applied_force_N")],
        Kind::Friction => &[
            ("position", "drive_position_m"),
            ("force", "drive_force_N"),
            ("pressure", "drive_pressure_a_Pa"),
        ],
        Kind::Chamber => &[
            ("position", "drive_position_m"),
            ("pressure", "drive_pressure_a_Pa"),
            ("other_pressure", "drive_pressure_b_Pa"),
            ("valve", "drive_valve"),
        ],
    }
}

impl Model {
    pub(crate) fn read(file: &Path) -> Result<Self, BalanceError> {
        Self::from_toml(&DescriptionError::read("model", file)?, file)
    }

    /// The same from a text; paths in it are relative to `file`'s folder.
    pub(crate) fn from_toml(text: &str, file: &Path) -> Result<Self, BalanceError> {
        let read: File = toml::from_str(text)
            .map_err(|error| DescriptionError::Syntax { file: file.into(), reason: error.to_string() })?;
        let refuse = |key: &str, value: String, allowed: &str| {
            let (key, allowed) = (key.into(), allowed.into());
            BalanceError::from(DescriptionError::Value { file: file.into(), key, value, allowed })
        };
        let Processing { period_s, low_pass_hz, low_pass_order, moving_average, .. } = read.processing;
        let Processing { decimate, decimate_order, decimate_ripple_decibel, decimate_edge, .. } =
            read.processing;
        let nyquist_hz = 0.5 / period_s;
        let asked: [(bool, &str, String, &str); 8] = [
            ((1e-6..=10.0).contains(&period_s), "period_s", period_s.to_string(), "1e-6 to 10 s"),
            (
                (0.0..nyquist_hz).contains(&low_pass_hz),
                "low_pass_hz",
                low_pass_hz.to_string(),
                "0 for none, below half the sampling frequency",
            ),
            ((1..=10).contains(&low_pass_order), "low_pass_order", low_pass_order.to_string(), "1 to 10"),
            (moving_average % 2 == 1, "moving_average", moving_average.to_string(), "an odd number"),
            ((1..=1000).contains(&decimate), "decimate", decimate.to_string(), "1 to 1000"),
            ((1..=10).contains(&decimate_order), "decimate_order", decimate_order.to_string(), "1 to 10"),
            (
                decimate_ripple_decibel > 0.0 && decimate_ripple_decibel <= 3.0,
                "decimate_ripple_decibel",
                decimate_ripple_decibel.to_string(),
                "above 0, at most 3",
            ),
            (
                decimate_edge > 0.0 && decimate_edge <= 1.0,
                "decimate_edge",
                decimate_edge.to_string(),
                "above 0, at most 1",
            ),
        ];
        if let Some((_, key, value, allowed)) = asked.into_iter().find(|(good, ..)| !good) {
            return Err(refuse(&format!("processing.{key}"), value, allowed));
        }
        if !(3..=1000).contains(&read.selection.blocks) || !(3..=1000).contains(&read.selection.bands) {
            let value = format!("{}, {}", read.selection.blocks, read.selection.bands);
            return Err(refuse("selection.blocks, bands", value, "3 to 1000"));
        }
        let share = read.selection.share_floor;
        if !(0.0..=1.0).contains(&share) {
            return Err(refuse("selection.share_floor", share.to_string(), "0 to 1"));
        }
        let ends_s = read.processing.ends_s;
        if !(0.0..=1e6).contains(&ends_s) {
            return Err(refuse("processing.ends_s", ends_s.to_string(), "0 or more"));
        }
        let folder = file.parent().unwrap_or(Path::new(""));
        let names = needed(read.kind);
        let mut channels = BTreeMap::new();
        for (name, column) in names {
            let column = read.channels.get(*name).map_or(*column, String::as_str);
            let known: Vec<_> = Channel::ALL.into_iter().map(Channel::column).collect();
            let channel = Channel::of_mapping(column).ok_or_else(|| {
                refuse(&format!("channels.{name}"), column.into(), &format!("one of {}", known.join(", ")))
            })?;
            channels.insert((*name).to_owned(), channel);
        }
        if let Some((name, column)) = read.channels.iter().find(|(name, _)| !channels.contains_key(*name)) {
            let known: Vec<_> = names.iter().map(|(name, _)| *name).collect();
            return Err(refuse(&format!("channels.{name}"), column.clone(), &known.join(", ")));
        }
        if let Some(mapping) = &read.mapping {
            Mapping::read(&folder.join(mapping)).map_err(records::ReadError::from)?;
        }
        let stem = file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        Ok(Self {
            kind: read.kind,
            name: read.name.unwrap_or(stem),
            mapping: read.mapping.map(|mapping| folder.join(mapping)),
            rig: read.rig.map(|rig| folder.join(rig)),
            channels,
            processing: read.processing,
            selection: read.selection,
            baseline: read.baseline,
            terms: read.terms,
        })
    }
}
