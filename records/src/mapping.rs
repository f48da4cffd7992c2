//! The mapping file: meaning of the columns of a foreign CSV.
//!
//! ```text
//! value in SI = sign * (cell * scale + offset) * unit          + atmospheric pressure, if the column is a gauge pressure
//! ```
//!
//! All keys with their defaults: `discrepancy/docs/records.md`; examples: `discrepancy/mappings/`.

use super::table::{Layout, Separator};
use super::{Channel, Quantity, RigSetup};
use settings::{Section, SettingsError, Source};
use std::path::Path;

/// How the columns of a foreign table map to channels.
#[derive(Clone, Debug)]
pub struct Mapping {
    pub(super) layout: Layout,
    pub(super) decimal_comma: bool,
    pub(super) absent: Vec<String>,
    pub(super) ignore: Vec<String>,
    pub(super) setup: RigSetup,
    pub(super) time: TimeSource,
    pub(super) nominal_period_s: Option<f64>,
    pub(super) channels: Vec<MappedChannel>,
}

/// Source of the time of a row.
#[derive(Clone, Debug)]
pub(super) enum TimeSource {
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

/// Standard atmosphere, Pa [ISO 2533].
const ATMOSPHERE_PA: f64 = 101_325.0;

/// Keys of the file itself.
const KEYS: [&str; 11] = [
    "separator",
    "decimal",
    "comment",
    "skip_lines",
    "head",
    "absent",
    "ignore",
    "atmospheric_pressure_Pa",
    "setup",
    "time",
    "channels",
];

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
    /// [`SettingsError`] with file, line, key, value and what is allowed.
    pub fn read(file: &Path) -> Result<Self, SettingsError> {
        let text = std::fs::read_to_string(file).map_err(|error| SettingsError::unreadable(file, &error))?;
        Self::from_toml(&text, file)
    }

    /// The same from a text; `file` is only its name for messages.
    ///
    /// # Errors
    /// As [`Mapping::read`].
    pub fn from_toml(text: &str, file: &Path) -> Result<Self, SettingsError> {
        let source = Source::parse(text, file)?;
        let mut root = source.root();
        root.allow(&KEYS)?;
        let layout = layout(&mut root)?;
        let decimal_comma = decimal_comma(&mut root, layout.separator)?;
        let atmosphere_pa = fitting(&mut root, "atmospheric_pressure_Pa", "more than 50000", |pa| pa > 5e4)?;
        let (time, nominal_period_s) = time(root.needed_section("time", "a column, or period_s")?)?;
        let channels = channels(
            root.needed_section("channels", "a table for each")?,
            atmosphere_pa.unwrap_or(ATMOSPHERE_PA),
        )?;
        let mut absent = root.texts("absent")?;
        absent.push(String::new());
        Ok(Self {
            layout,
            decimal_comma,
            absent,
            ignore: root.texts("ignore")?,
            setup: setup(root.section_or_empty("setup")?)?,
            time,
            nominal_period_s,
            channels,
        })
    }
}

/// The finite number under `key`, which must fit.
fn fitting(
    section: &mut Section<'_>,
    key: &str,
    allowed: &str,
    fits: fn(f64) -> bool,
) -> Result<Option<f64>, SettingsError> {
    let number = section.finite(key)?;
    if number.is_none_or(fits) {
        Ok(number)
    } else {
        Err(section.refused(key, &format!("allowed is {allowed}")))
    }
}

fn layout(root: &mut Section<'_>) -> Result<Layout, SettingsError> {
    let separator = root.text("separator")?.map_or_else(|| ",".into(), |separator| separator.text);
    let separator = match separator.as_bytes() {
        [character] if character.is_ascii() && *character != b' ' => Separator::Character(*character),
        _ if separator == "whitespace" => Separator::Whitespace,
        _ => {
            let allowed = "allowed is one character such as \",\", \";\", \"\\t\", or \"whitespace\"";
            return Err(root.refused("separator", allowed));
        }
    };
    Ok(Layout {
        separator,
        comment: root.text("comment")?.map(|comment| comment.text),
        skip_lines: root.whole("skip_lines", [0, u64::MAX])?.unwrap_or(0),
        head: root.flag("head")? || !root.has("head"),
    })
}

fn decimal_comma(root: &mut Section<'_>, separator: Separator) -> Result<bool, SettingsError> {
    match root.text("decimal")?.as_ref().map(|decimal| decimal.text.as_str()) {
        None | Some(".") => Ok(false),
        Some(",") if separator != Separator::Character(b',') => Ok(true),
        _ => Err(root.refused("decimal", "allowed is \".\", or \",\" when the separator is another")),
    }
}

fn setup(mut section: Section<'_>) -> Result<RigSetup, SettingsError> {
    let added_mass_kg = fitting(&mut section, "added_mass_kg", "0 or more", |kg| kg >= 0.0)?;
    let setup = RigSetup { linked: section.flag("linked")?, added_mass_kg: added_mass_kg.unwrap_or(0.0) };
    section.finish()?;
    Ok(setup)
}

/// Where the time comes from, and the period that was meant.
fn time(mut section: Section<'_>) -> Result<(TimeSource, Option<f64>), SettingsError> {
    let mut period = |key| fitting(&mut section, key, "more than 0", |period_s| period_s > 0.0);
    let (nominal_period_s, period_s) = (period("nominal_period_s")?, period("period_s")?);
    let column = section.text("column")?.map(|column| column.text);
    let factor = section.choice("unit", TIMES)?;
    section.finish()?;
    match (column, period_s) {
        (Some(column), None) => Ok((TimeSource::Column { column, factor }, nominal_period_s)),
        (None, Some(period_s)) if !section.has("unit") => {
            Ok((TimeSource::Counted { period_s }, Some(nominal_period_s.unwrap_or(period_s))))
        }
        _ => {
            let allowed = "allowed is a column with its unit, or period_s alone for rows without time";
            Err(section.refused("column", allowed))
        }
    }
}

/// The channels of the file, in the order of their names.
fn channels(mut section: Section<'_>, atmosphere_pa: f64) -> Result<Vec<MappedChannel>, SettingsError> {
    let mut names = Channel::ALL.map(|channel| (channel.to_string(), channel));
    names.sort_by(|(one, _), (other, _)| one.cmp(other));
    let mut channels = Vec::new();
    for (name, channel) in names {
        if let Some(section) = section.section(&name)? {
            channels.push(mapped(section, channel, atmosphere_pa)?);
        }
    }
    section.finish()?;
    Ok(channels)
}

fn mapped(
    mut section: Section<'_>,
    channel: Channel,
    atmosphere_pa: f64,
) -> Result<MappedChannel, SettingsError> {
    let column = section.needed_text("column", "column of the channel")?.text;
    let unit = section.needed_choice("unit", units(channel.quantity()))?;
    let sign = fitting(&mut section, "sign", "1 or -1", |sign| sign.abs() == 1.0)?.unwrap_or(1.0);
    let scale = fitting(&mut section, "scale", "any number but 0", |scale| scale != 0.0)?.unwrap_or(1.0);
    let offset = section.finite("offset")?.unwrap_or(0.0);
    let above_pa = if channel.quantity() == Quantity::Pressure {
        section.needed_choice("pressure", &[("absolute", 0.0), ("gauge", atmosphere_pa)])?
    } else if section.has("pressure") {
        return Err(section.refused("pressure", "allowed is nothing: the channel is no pressure"));
    } else {
        0.0
    };
    let (slope, intercept) = (sign * unit * scale, sign * unit * offset + above_pa);
    let optional = section.flag("optional")?;
    section.finish()?;
    Ok(MappedChannel { channel, column, slope, intercept, optional })
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
                "m.toml:5: channels.drive_position_m.unit = \"bar\"; allowed is m, cm, mm, um, in",
            ),
            (
                "drive_position_m",
                "rod",
                "m.toml:3: unknown key channels.rod; allowed is drive_applied_force_N, drive_force_N, drive_position_m",
            ),
            (
                "column = \"t\"",
                "",
                "m.toml:1: time.column is missing; allowed is a column with its unit, or period_s alone",
            ),
            ("column = \"t\"", "column = \"t\"\nunit = \"h\"", "time.unit = \"h\"; allowed is s, ms"),
            (
                "unit = \"mm\"",
                "unit = \"mm\"\nsign = 2",
                "channels.drive_position_m.sign = 2; allowed is 1 or -1",
            ),
            (
                "unit = \"mm\"",
                "unit = \"mm\"\nscale = nan",
                "channels.drive_position_m.scale = nan; allowed is a finite number",
            ),
            ("unit = \"mm\"", "unit = \"mm\"\npressure = \"gauge\"", "the channel is no pressure"),
            (
                "drive_position_m]\ncolumn = \"x\"\nunit = \"mm\"",
                "supply_pressure_Pa]\ncolumn = \"x\"\nunit = \"bar\"",
                "channels.supply_pressure_Pa.pressure is missing: one of absolute, gauge",
            ),
            ("[time]", "decimal = \",\"\n[time]", "decimal = \",\"; allowed is"),
            ("[time]", "separator = \"ab\"\n[time]", "separator = \"ab\"; allowed is one character"),
            ("[time]", "[tyme]", "m.toml:1: unknown key tyme; allowed is separator, decimal"),
        ] {
            let message = refused(&GOOD.replace(from, to));
            assert!(message.contains(hint), "{message}");
        }
    }
}
