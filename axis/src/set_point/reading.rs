//! Rows of set-points from the tables of an experiment file.

use super::force::{self, ForceProfile, Segment, at_position::AtPosition};
use super::law::{self, Law, Scale, SegmentReader};
use super::row::{Row, RowSegment};
use super::{Motion, table};
use algorithms::algorithm::Quantity;
use settings::{Section, SettingsError};
use std::sync::Arc;

/// Keys from which the quantity of a law follows, where its name alone does not say it.
const QUANTITY_KEYS: [(&str, Quantity); 4] = [
    ("to_m", Quantity::Position),
    ("amplitude_m", Quantity::Position),
    ("to_n", Quantity::Force),
    ("amplitude_n", Quantity::Force),
];

/// Quantity of the row; `None` when none of its segments says it.
pub(crate) fn quantity(segments: &[Section<'_>]) -> Result<Option<Quantity>, SettingsError> {
    let mut first = None;
    for segment in segments {
        let Some(stated) = stated_quantity(segment) else { continue };
        let (quantity, line) = *first.get_or_insert((stated, segment.line()));
        if stated != quantity {
            let (stated, other) = (stated.name(), quantity.name());
            let message =
                format!("law is of {stated}s, line {line} of {other}s: a row mixes no positions and forces");
            return Err(segment.wrong_at("law", &message));
        }
    }
    Ok(first.map(|(quantity, _)| quantity))
}

fn stated_quantity(segment: &Section<'_>) -> Option<Quantity> {
    let name = segment.peek("law")?;
    if force::KINDS.iter().any(|kind| kind.name == name) {
        return Some(Quantity::Force);
    }
    let kind = law::KINDS.iter().find(|kind| kind.name == name)?;
    if let [only] = kind.serves {
        return Some(*only);
    }
    if name == table::KIND.name {
        return table::quantity_of(&segment.sibling_path(segment.peek("file")?));
    }
    QUANTITY_KEYS.iter().find(|(key, _)| segment.has(key)).map(|(_, quantity)| *quantity)
}

/// A row of positions within the stroke.
pub(crate) fn motion(
    start_m: f64,
    sections: Vec<Section<'_>>,
    stroke_m: f64,
) -> Result<Motion, SettingsError> {
    let scale = Scale { quantity: Quantity::Position, stroke_m, force_limit_n: 0.0 };
    Ok(Motion { row: row(start_m, sections, scale, timed)? })
}

/// A row of forces up to a limit: from an initial force and the limit, both in N.
pub(crate) fn forces(
    [initial_n, limit_n]: [f64; 2],
    sections: Vec<Section<'_>>,
    stroke_m: f64,
) -> Result<ForceProfile, SettingsError> {
    let scale = Scale { quantity: Quantity::Force, stroke_m, force_limit_n: limit_n };
    let segment = |name: &str, reader: &mut SegmentReader<'_, '_>| {
        let at_position = name == super::step::KIND.name && reader.section.has(force::at_position::KEY);
        Ok(match force::KINDS.iter().find(|kind| kind.name == name) {
            Some(kind) => Segment::read_load(kind, reader)?,
            None if at_position => Segment::AtPosition(AtPosition::read(reader)?),
            None => Segment::Timed(timed(name, reader)?),
        })
    };
    Ok(ForceProfile { row: row(initial_n, sections, scale, segment)?, limit_n })
}

/// A row from `start` on, whose segments are read by their names, each from where the one before it ends.
fn row<S: RowSegment>(
    start: f64,
    sections: Vec<Section<'_>>,
    scale: Scale,
    read: impl Fn(&str, &mut SegmentReader<'_, '_>) -> Result<S, SettingsError>,
) -> Result<Row<S>, SettingsError> {
    let mut from = start;
    let mut segments = Vec::new();
    for mut section in sections {
        let name = section.needed_text("law", &names(scale.quantity))?.text;
        let segment = read(&name, &mut SegmentReader { section: &mut section, from, scale })?;
        section.finish()?;
        (_, from) = segment.duration_and_end();
        segments.push(segment);
    }
    Ok(Row::new(start, segments))
}

/// The law called `name`, within the limits of its row.
fn timed(name: &str, reader: &mut SegmentReader<'_, '_>) -> Result<Arc<dyn Law>, SettingsError> {
    let quantity = reader.scale.quantity;
    let kind = law::KINDS.iter().find(|kind| kind.name == name && kind.serves.contains(&quantity));
    let Some(kind) = kind else {
        let message = format!("law = \"{name}\"; allowed is {}", names(quantity));
        return Err(reader.section.wrong_at("law", &message));
    };
    let law = (kind.read)(reader)?;
    let ([least, most], unit) = (law.extent().reach, reader.scale.unit());
    if least >= 0.0 && most <= reader.scale.most() {
        return Ok(law);
    }
    let allowed = reader.scale.most();
    let message =
        format!("law = \"{name}\" goes from {least} to {most} {unit}; allowed is 0 to {allowed} {unit}");
    Err(reader.section.wrong_at("law", &message))
}

fn names(quantity: Quantity) -> String {
    let timed = law::KINDS.iter().filter(|kind| kind.serves.contains(&quantity)).map(|kind| kind.name);
    let loads = force::KINDS.iter().filter(|_| quantity == Quantity::Force).map(|kind| kind.name);
    timed.chain(loads).collect::<Vec<_>>().join(", ")
}
