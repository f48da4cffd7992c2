//! Reads `[effects.NAME.PLACE]` of a rig file against the data sheets of the effects.
//!
//! ```text
//! [effects.piston-leakage.drive]            an effect of an axis
//! leakage_nl_per_min = 2.5
//! [effects.pressure-sensor-offset.drive.a]  one of a chamber or a channel
//! offset_mbar = -30
//! ```
//!
//! A place of two words is a table in a table; what stands under an effect's name is walked down to its keys.

use settings::{Result, Section};

use crate::effects::sheet::{ActiveEffect, EffectKey, Place, Sheet};
use crate::effects::{SHEETS, sheet};

/// All effects that the file switches on, in the order of the catalogue and of its places.
pub(super) fn read(root: &mut Section<'_>) -> Result<Vec<ActiveEffect>> {
    let mut effects = Vec::new();
    let mut table = root.section_or_empty("effects")?;
    for name in table.keys() {
        let Some(sheet) = sheet(&name) else {
            table.allow(&SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>())?;
            continue;
        };
        let names = sheet.place.names();
        let allowed = format!("allowed are tables of {}", names.join(", "));
        let example = format!("[effects.{}.PLACE], PLACE one of {}", sheet.name, names.join(", "));
        let Some(mut places) = table.section_as(sheet.name, Some(&example))? else { continue };
        // A table without a place would switch on nothing, and the file would not say so.
        if places.keys().is_empty() {
            return Err(table.refused(sheet.name, &allowed));
        }
        let mut parts: Vec<_> = names.iter().filter_map(|name| name.split('.').next()).collect();
        parts.dedup();
        for part in parts {
            let Some(mut inner) = places.section(part)? else { continue };
            if let Some(place) = sheet.place_named(part) {
                effects.push(switched(sheet, place, &inner)?);
                continue;
            }
            if inner.keys().is_empty() {
                return Err(places.refused(part, &allowed));
            }
            for name in &names {
                let Some(element) = name.strip_prefix(part).and_then(|rest| rest.strip_prefix('.')) else {
                    continue;
                };
                if let (Some(place), Some(keys)) = (sheet.place_named(name), inner.section(element)?) {
                    effects.push(switched(sheet, place, &keys)?);
                }
            }
            inner.finish()?;
        }
        places.finish()?;
    }
    sort(&mut effects);
    Ok(effects)
}

/// The effect with one number for each key of its sheet.
fn switched(sheet: &Sheet, place: Place, section: &Section<'_>) -> Result<ActiveEffect> {
    section.allow(&sheet.keys.iter().map(|key| key.name).collect::<Vec<_>>())?;
    let numbers = sheet.keys.iter().map(|key| number(section, key)).collect::<Result<_>>()?;
    Ok(ActiveEffect { name: sheet.name, place, numbers })
}

fn number(section: &Section<'_>, key: &EffectKey) -> Result<f64> {
    match (section.peek_number(key.name), key.default) {
        // A NaN, which TOML admits, lies in no range.
        (Some(number), _) if (key.min..=key.max).contains(&number) => Ok(number),
        (Some(_), _) => {
            let (name, written, range) = (key.name, section.written(key.name), key.range());
            let message = format!("{name} = {written} is out of range; allowed: {range}");
            Err(section.wrong_at(name, &message))
        }
        (None, Some(default)) if !section.has(key.name) => Ok(default),
        _ => Err(section.refused(key.name, &format!("allowed is {}", key.range()))),
    }
}

/// Into the order of the catalogue, and of the places of an effect.
pub(super) fn sort(effects: &mut [ActiveEffect]) {
    effects.sort_by_key(|effect| (SHEETS.iter().position(|sheet| sheet.name == effect.name), effect.place));
}
