//! The mapping file: meaning of the columns of a foreign CSV.
//!
//! ```text
//! value in SI = sign * (cell * scale + offset) * unit          + atmospheric pressure, if the column is a gauge pressure
//! ```
//!
//! All keys with their defaults: `discrepancy/docs/records.md`; examples: `discrepancy/mappings/`.

use super::table::{Layout, Separator};
use super::{Channel, Quantity, RigSetup};
use crate::description_error::DescriptionError;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Clone, Debug)]
pub struct Mapping {
    pub(super) layout: Layout,
    pub(super) decimal_comma: bool,
    pub(super) absent: Vec<String>,
    pub(super) ignore: Vec<String>,
    pub(super) setup: RigSetup,
    pub(super) time: Time,
    pub(super) nominal_period_s: Option<f64>,
    pub(super) channels: Vec<MappedChannel>,
}

/// Source of the time of a row.
#[derive(Clone, Debug)]
pub(super) enum Time {
    Column {
        column: String,
        factor: f64,
    },
    /// No column: rows are this far apart.
    Counted {
        period_s: f64,
    },
}

#[derive(Clone, Debug)]
pub(super) struct MappedChannel {
    pub(super) channel: Channel,
    pub(super) column: String,
    /// SI value = cell * slope + intercept.
    pub(super) slope: f64,
    pub(super) intercept: f64,
    pub(super) optional: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default = "comma")]
    separator: String,
    #[serde(default = "point")]
    decimal: String,
    #[serde(default)]
    comment: Option<String>,
    #[serde(default)]
    skip_lines: u64,
    #[serde(default = "yes")]
    head: bool,
    #[serde(default)]
    absent: Vec<String>,
    #[serde(default)]
    ignore: Vec<String>,
    #[serde(default = "atmosphere")]
    #[serde(rename = "atmospheric_pressure_Pa")]
    atmospheric_pressure_pa: f64,
    #[serde(default)]
    setup: RigSetup,
    time: FileTime,
    channels: BTreeMap<String, FileChannel>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileTime {
    column: Option<String>,
    unit: Option<String>,
    period_s: Option<f64>,
    nominal_period_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileChannel {
    column: String,
    unit: String,
    #[serde(default = "one")]
    sign: f64,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    offset: f64,
    pressure: Option<String>,
    #[serde(default)]
    optional: bool,
}

fn comma() -> String {
    ",".into()
}

fn point() -> String {
    ".".into()
}

const fn yes() -> bool {
    true
}

const fn one() -> f64 {
    1.0
}

/// Standard atmosphere, Pa [ISO 2533].
const fn atmosphere() -> f64 {
    101_325.0
}

/// Units of time, in s.
const TIMES: &[(&str, f64)] = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0)];

/// Units of a quantity, in SI.
const fn units(quantity: Quantity) -> &'static [(&'static str, f64)] {
    match quantity {
        Quantity::Opening => &[("1", 1.0), ("%", 0.01)],
        Quantity::Length => &[("m", 1.0), ("cm", 0.01), ("mm", 1e-3), ("um", 1e-6), ("in", 0.0254)],
        Quantity::Force => &[("N", 1.0), ("kN", 1e3), ("kgf", 9.806_65), ("lbf", 4.448_221_615_260_5)],
        Quantity::Pressure => &[
            ("Pa", 1.0),
            ("hPa", 1e2),
            ("kPa", 1e3),
            ("MPa", 1e6),
            ("mbar", 1e2),
            ("bar", 1e5),
            ("psi", 6_894.757_293_168),
        ],
    }
}

impl Mapping {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// [`DescriptionError`] with file, key, value and what is allowed.
    pub fn read(file: &Path) -> Result<Self, DescriptionError> {
        Self::from_toml(&DescriptionError::read("mapping", file)?, file)
    }

    /// The same from a text; `file` is only its name for messages.
    ///
    /// # Errors
    /// As [`Mapping::read`].
    pub fn from_toml(text: &str, file: &Path) -> Result<Self, DescriptionError> {
        let syntax = |error: toml::de::Error| DescriptionError::Syntax {
            file: file.into(),
            reason: error.to_string(),
        };
        let read: File = toml::from_str(text).map_err(syntax)?;
        let check = Check { file };
        let layout = check.layout(&read)?;
        let decimal_comma = check.decimal_comma(&read, layout.separator)?;
        let key = "atmospheric_pressure_Pa";
        let atmosphere_pa = check.above(key, read.atmospheric_pressure_pa, 5e4, "more than 50000")?;
        let mass_kg = read.setup.added_mass_kg;
        check.above("setup.added_mass_kg", mass_kg, -f64::MIN_POSITIVE, "0 or more")?;
        let (time, nominal_period_s) = check.time(read.time)?;
        let channels = read.channels.into_iter();
        let channels = channels.map(|(name, channel)| check.channel(&name, channel, atmosphere_pa));
        let channels = channels.collect::<Result<_, _>>()?;
        let mut absent = read.absent;
        absent.push(String::new());
        Ok(Self {
            layout,
            decimal_comma,
            absent,
            ignore: read.ignore,
            setup: read.setup,
            time,
            nominal_period_s,
            channels,
        })
    }
}

/// Checks what a file says, part by part.
struct Check<'a> {
    file: &'a Path,
}

impl Check<'_> {
    fn refuse(&self, key: &str, value: &dyn std::fmt::Debug, allowed: &str) -> DescriptionError {
        let (key, value, allowed) = (key.into(), format!("{value:?}"), allowed.into());
        DescriptionError::Value { file: self.file.into(), key, value, allowed }
    }

    fn above(&self, key: &str, value: f64, least: f64, allowed: &str) -> Result<f64, DescriptionError> {
        if value.is_finite() && value > least { Ok(value) } else { Err(self.refuse(key, &value, allowed)) }
    }

    fn layout(&self, read: &File) -> Result<Layout, DescriptionError> {
        let separator = match read.separator.as_bytes() {
            [character] if character.is_ascii() && *character != b' ' => Separator::Character(*character),
            _ if read.separator == "whitespace" => Separator::Whitespace,
            _ => {
                let allowed = "one character such as \",\", \";\", \"\\t\", or \"whitespace\"";
                return Err(self.refuse("separator", &read.separator, allowed));
            }
        };
        let (comment, skip_lines, head) = (read.comment.clone(), read.skip_lines, read.head);
        Ok(Layout { separator, comment, skip_lines, head })
    }

    fn decimal_comma(&self, read: &File, separator: Separator) -> Result<bool, DescriptionError> {
        match read.decimal.as_str() {
            "." => Ok(false),
            "," if separator != Separator::Character(b',') => Ok(true),
            _ => Err(self.refuse("decimal", &read.decimal, "\".\", or \",\" when the separator is another")),
        }
    }

    /// Where the time comes from, and the period that was meant.
    fn time(&self, read: FileTime) -> Result<(Time, Option<f64>), DescriptionError> {
        let nominal_period_s = read.nominal_period_s;
        let nominal_period_s = nominal_period_s
            .map(|period_s| self.above("time.nominal_period_s", period_s, 0.0, "more than 0"))
            .transpose()?;
        match (read.column, read.unit, read.period_s) {
            (Some(column), unit, None) => {
                let unit = unit.unwrap_or_else(|| "s".into());
                let factor = factor(TIMES, &unit);
                let factor = factor.ok_or_else(|| self.refuse("time.unit", &unit, &names(TIMES)))?;
                Ok((Time::Column { column, factor }, nominal_period_s))
            }
            (None, None, Some(period_s)) => {
                let period_s = self.above("time.period_s", period_s, 0.0, "more than 0")?;
                Ok((Time::Counted { period_s }, Some(nominal_period_s.unwrap_or(period_s))))
            }
            (column, ..) => {
                let allowed = "a column with its unit, or period_s alone for rows without time";
                Err(self.refuse("time.column", &column, allowed))
            }
        }
    }

    fn channel(
        &self,
        name: &str,
        read: FileChannel,
        atmosphere_pa: f64,
    ) -> Result<MappedChannel, DescriptionError> {
        let key = |field: &str| format!("channels.{name}{field}");
        let channel = Channel::of_mapping(name).ok_or_else(|| {
            let known: Vec<_> = Channel::ALL.into_iter().map(Channel::column).collect();
            self.refuse(&key(""), &read.column, &format!("one of the channels {}", known.join(", ")))
        })?;
        let units = units(channel.quantity());
        let unit = factor(units, &read.unit);
        let unit = unit.ok_or_else(|| self.refuse(&key(".unit"), &read.unit, &names(units)))?;
        if read.sign.abs() != 1.0 {
            return Err(self.refuse(&key(".sign"), &read.sign, "1 or -1"));
        }
        if !read.scale.is_finite() || read.scale == 0.0 || !read.offset.is_finite() {
            let allowed = "finite numbers, scale not 0";
            return Err(self.refuse(&key(".scale, offset"), &(read.scale, read.offset), allowed));
        }
        let above_pa = match (channel.quantity(), read.pressure.as_deref()) {
            (Quantity::Pressure, Some("absolute")) => 0.0,
            (Quantity::Pressure, Some("gauge")) => atmosphere_pa,
            (Quantity::Pressure, other) => {
                return Err(self.refuse(&key(".pressure"), &other, "\"absolute\" or \"gauge\""));
            }
            (_, None) => 0.0,
            (_, other) => {
                return Err(self.refuse(&key(".pressure"), &other, "nothing: the channel is no pressure"));
            }
        };
        Ok(MappedChannel {
            channel,
            column: read.column,
            slope: read.sign * unit * read.scale,
            intercept: read.sign * unit * read.offset + above_pa,
            optional: read.optional,
        })
    }
}

fn factor(units: &[(&str, f64)], name: &str) -> Option<f64> {
    units.iter().find(|(unit, _)| *unit == name).map(|(_, factor)| *factor)
}

fn names(units: &[(&str, f64)]) -> String {
    let names: Vec<_> = units.iter().map(|(name, _)| *name).collect();
    format!("one of {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "[time]\ncolumn = \"t\"\n[channels.drive_position_m]\ncolumn = \"x\"\nunit = \"mm\"\n";

    fn refused(text: &str) -> String {
        Mapping::from_toml(text, Path::new("m.toml")).expect_err(text).to_string()
    }

    #[test]
    fn a_short_mapping_is_enough() {
        let mapping = Mapping::from_toml(GOOD, Path::new("m.toml")).unwrap();
        assert_eq!((mapping.channels.len(), mapping.channels[0].slope), (1, 1e-3));
        assert_eq!(mapping.nominal_period_s, None);
    }

    #[test]
    fn sign_scale_offset_and_gauge_pressure_come_together() {
        let text = r#"
            time.period_s = 0.001
            [channels.drive_pressure_a_Pa]
            column = "u"
            unit = "bar"
            scale = 2
            offset = -1
            pressure = "gauge"
            [channels.drive_force_N]
            column = "f"
            unit = "kN"
            sign = -1
        "#;
        let mapping = Mapping::from_toml(text, Path::new("m.toml")).unwrap();
        let si = |place: usize, cell: f64| {
            mapping.channels[place].slope * cell + mapping.channels[place].intercept
        };
        assert_eq!(mapping.channels[0].column, "f");
        assert_eq!(si(0, 0.5), -500.0);
        // 2 * 2 V - 1 bar above the atmosphere.
        assert!((si(1, 2.0) - 401_325.0).abs() < 1e-6);
    }

    #[test]
    fn what_makes_no_sense_is_reported_with_key_value_and_what_does() {
        for (from, to, hint) in [
            (
                "\"mm\"",
                "\"bar\"",
                "channels.drive_position_m.unit = \"bar\"; allowed is one of m, cm, mm, um, in",
            ),
            (
                "drive_position_m",
                "rod",
                "channels.rod = \"x\"; allowed is one of the channels drive_valve, drive_position_m",
            ),
            ("column = \"t\"", "", "time.column = None"),
            ("column = \"t\"", "column = \"t\"\nunit = \"h\"", "time.unit = \"h\"; allowed is one of s, ms"),
            (
                "unit = \"mm\"",
                "unit = \"mm\"\nsign = 2",
                "channels.drive_position_m.sign = 2.0; allowed is 1 or -1",
            ),
            ("unit = \"mm\"", "unit = \"mm\"\nscale = nan", "finite numbers"),
            ("unit = \"mm\"", "unit = \"mm\"\npressure = \"gauge\"", "the channel is no pressure"),
            (
                "drive_position_m]\ncolumn = \"x\"\nunit = \"mm\"",
                "supply_pressure_Pa]\ncolumn = \"x\"\nunit = \"bar\"",
                "\"absolute\" or \"gauge\"",
            ),
            ("[time]", "decimal = \",\"\n[time]", "decimal = \",\"; allowed is"),
            ("[time]", "separator = \"ab\"\n[time]", "separator = \"ab\"; allowed is one character"),
            ("[time]", "[tyme]", "unknown field `tyme`"),
        ] {
            let message = refused(&GOOD.replace(from, to));
            assert!(message.contains(hint), "{message}");
        }
    }
}
