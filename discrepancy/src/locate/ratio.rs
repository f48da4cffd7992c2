//! Whether two balances move together as a fault of a pressure sensor would move them.
//!
//! ```text
//! o_F = sum g_F d / s^2 / sum g_F^2 / s^2        of the force, and the same of the chamber's flow
//! ```
//!
//! d unknown input of a window, s its deviation, g its sensitivity to an offset of 1 Pa: about -A for the force. Two significant
//! estimates that agree indicate one sensor fault.
//!
//! Source: discrepancy-notes.md, 2.

use super::UnknownSeries;
use plant::Axis;

/// Significance of an offset, in standard errors.
const MIN_OFFSET_Z: f64 = 5.0;
/// Largest relative difference: a gain or a lag is no constant offset.
const AGREES: f64 = 0.35;

/// Notes on the pressure sensors of an axis.
pub(super) fn notes(axis: Axis, series: &[UnknownSeries]) -> Vec<String> {
    let find =
        |balance: &str| series.iter().find(|series| series.balance == format!("{}.{balance}", axis.name()));
    let Some(force) = find("force") else { return Vec::new() };
    let mut notes = Vec::new();
    for (chamber, name) in ["a", "b"].into_iter().enumerate() {
        let Some(flow) = find(&format!("flow-{name}")) else { continue };
        let ((by_force, force_error), (by_flow, flow_error)) =
            (offset(force, chamber), offset(flow, chamber));
        let are_significant =
            by_force.abs() > MIN_OFFSET_Z * force_error && by_flow.abs() > MIN_OFFSET_Z * flow_error;
        let differ = (by_force - by_flow).abs();
        let bound = AGREES * by_force.abs().min(by_flow.abs()) + 3.0 * force_error.hypot(flow_error);
        if are_significant && by_force * by_flow > 0.0 && differ < bound {
            let axis = axis.name();
            notes.push(format!(
                "{axis}.force and {axis}.flow-{name} move together as by a pressure sensor {name} that reads \
                 {by_force:+.0} Pa too much (by the force; {by_flow:+.0} Pa by the flow)"
            ));
        }
    }
    notes
}

/// The offset of a pressure sensor that explains a series best, and its standard error, Pa.
fn offset(series: &UnknownSeries, chamber: usize) -> (f64, f64) {
    let (mut above, mut below) = (0.0, 0.0);
    for point in &series.points {
        let (gain, weight) = (point.per_pressure_offset[chamber], point.deviation.powi(-2));
        above += gain * point.value * weight;
        below += gain * gain * weight;
    }
    if below > 0.0 { (above / below, below.sqrt().recip()) } else { (0.0, f64::INFINITY) }
}
