//! Units that cannot be: pressures in bar, positions in mm, a valve in % or volts.
//!
//! Bounds follow from the rig file: a chamber's pressure lies between exhaust and supply, a position within the stroke, a command
//! in [-1, 1]. A channel out of bounds is reported with the unit that explains it. A force has no such bounds; its sign and size
//! are tested elsewhere.

use super::notes::Notes;
use model_fit::stats::quantile;
use plant::{Axis, RigParameters};
use records::{Channel, Signal};

/// How far beyond the supply a pressure may read: sensors and supplies are off by a tenth.
const ABOVE_SUPPLY: f64 = 1.5;
/// The same below the exhaust, for chambers that were drawn apart.
const BELOW_EXHAUST: f64 = 0.5;
/// How far beyond the stroke a position may read, shares of it: zeros are set by hand.
const BEYOND_STROKE: f64 = 0.2;
/// Units of pressure, Pa each.
const PRESSURES: [(&str, f64); 5] =
    [("bar", 1e5), ("kPa", 1e3), ("MPa", 1e6), ("mbar or hPa", 1e2), ("psi", 6894.757)];
/// Units of length, m each, the largest first: a small one would explain every position.
const LENGTHS: [(&str, f64); 4] = [("inch", 0.0254), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)];

pub(super) fn check(notes: &mut Notes, rig: &RigParameters) {
    for axis in Axis::ALL.into_iter().filter(|axis| notes.is_of_rig(*axis)).collect::<Vec<_>>() {
        pressure(notes, rig, Channel::Of(axis, Signal::PressureA));
        pressure(notes, rig, Channel::Of(axis, Signal::PressureB));
        position(notes, rig, Channel::Of(axis, Signal::Position));
        valve(notes, Channel::Of(axis, Signal::Valve));
    }
    pressure(notes, rig, Channel::SupplyPressure);
}

/// Values near both ends and in the middle: 1, 50 and 99 %.
fn quantiles(notes: &Notes, channel: Channel) -> Option<[f64; 3]> {
    let mut values: Vec<f64> = (0..notes.record.len()).filter_map(|row| notes.value(channel, row)).collect();
    let [low, middle, high] = [0.01, 0.5, 0.99].map(|share| quantile(&mut values, share));
    Some([low?, middle?, high?])
}

fn add_finding(notes: &mut Notes, channel: Channel, beyond: impl Fn(f64) -> bool, text: &str) {
    let row = (0..notes.record.len()).find(|row| notes.value(channel, *row).is_some_and(&beyond));
    notes.add("wrong-unit", channel, row, true, text);
}

fn pressure(notes: &mut Notes, rig: &RigParameters, channel: Channel) {
    let Some([low, middle, high]) = quantiles(notes, channel) else { return };
    let supply = rig.supply();
    let (least, most) = (BELOW_EXHAUST * supply.exhaust_pressure_pa, ABOVE_SUPPLY * supply.pressure_pa);
    let fits = |low: f64, high: f64| low > least && high < most;
    if fits(low, high) {
        return;
    }
    let beyond = |value: f64| !fits(value, value);
    if let Some((unit, factor)) = PRESSURES.into_iter().find(|(_, factor)| fits(low * factor, high * factor))
    {
        let text = format!("{middle} Pa cannot be, it reads as {unit}: multiply the column by {factor}");
        return add_finding(notes, channel, beyond, &text);
    }
    let atmosphere = supply.atmospheric_pressure_pa;
    if let Some((unit, factor)) = [("Pa", 1.0)].into_iter().chain(PRESSURES).find(|(_, factor)| {
        low * factor > -0.1 * atmosphere && fits(middle * factor, high * factor + atmosphere)
    }) {
        let text = format!(
            "down to {low}: it reads as a gauge pressure in {unit}: multiply the column by {factor} and add {atmosphere} Pa"
        );
        return add_finding(notes, channel, beyond, &text);
    }
    let text = format!(
        "{low} to {high} Pa cannot be with a supply of {} Pa: look at unit and scale",
        supply.pressure_pa
    );
    add_finding(notes, channel, beyond, &text);
}

fn position(notes: &mut Notes, rig: &RigParameters, channel: Channel) {
    let Some([low, middle, high]) = quantiles(notes, channel) else { return };
    let stroke = rig.cylinder().stroke_m;
    let fits = |value: f64| value > -BEYOND_STROKE * stroke && value < (1.0 + BEYOND_STROKE) * stroke;
    // Minus the position is a sign and no unit.
    if (fits(low) && fits(high)) || (fits(-low) && fits(-high)) {
        return;
    }
    let unit = LENGTHS.into_iter().find(|(_, factor)| fits(low * factor) && fits(high * factor));
    let text = match unit {
        Some((unit, factor)) => {
            format!(
                "{middle} m cannot be on a stroke of {stroke} m, it reads as {unit}: multiply the column by {factor}"
            )
        }
        None => format!("{low} to {high} m cannot be on a stroke of {stroke} m: look at unit and zero"),
    };
    add_finding(notes, channel, |value| !fits(value), &text);
}

fn valve(notes: &mut Notes, channel: Channel) {
    let Some([low, middle, high]) = quantiles(notes, channel) else { return };
    let mut all: Vec<f64> = (0..notes.record.len()).filter_map(|row| notes.value(channel, row)).collect();
    let (Some(least), Some(most)) = (quantile(&mut all, 0.0), quantile(&mut all, 1.0)) else { return };
    let size = most.abs().max(least.abs());
    if size < 1.05 {
        return;
    }
    let text = if low > -0.1 && high < 10.1 && (1.0..9.0).contains(&middle) && most < 10.1 {
        "reads as 0 to 10 V around 5 V: take 5 from the column and divide it by 5".to_owned()
    } else if size < 10.1 {
        format!("up to {size}: reads as -10 to 10 V: divide the column by 10 (by 100 if it is %)")
    } else if size < 101.0 {
        format!("up to {size}: reads as %: divide the column by 100")
    } else if size < 2049.0 {
        format!("up to {size}: reads as counts of 12 bits: divide the column by 2047")
    } else {
        format!("up to {size}: a command lies between -1 and 1: look at its scale")
    };
    add_finding(notes, channel, |value| value.abs() > 1.05, &text);
}
