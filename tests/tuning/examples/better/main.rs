//! Prints, as Markdown, what the paper's programs and the better ones do in the same experiments: `scripts/better`.
#![allow(clippy::print_stdout)] // This is what it is for.

mod hand;
mod sheet;

use sheet::{Column, ComparisonTable, ControllerVariant};
use std::error::Error;

const SCALE_MM: f64 = 1e3;
const SCALE_MS: f64 = 1e3;
const SCALE_PERCENT: f64 = 1e2;

const fn column(head: &'static str, figure: &'static str, scale: f64) -> Column {
    Column { head, figure, scale }
}

fn main() -> Result<(), Box<dyn Error>> {
    point_to_point()?;
    load_step()?;
    hand::table()
}

fn point_to_point() -> Result<(), Box<dyn Error>> {
    println!("\n### point-to-point (Fig. 8)\n");
    let drive = |name, is_papers| ControllerVariant { name, drive: Some(name), load: None, is_papers };
    let variants =
        [drive("position-p", true), drive("position-pid", false), drive("position-cascade", false)];
    let columns = [
        column("dynamic, mm", "position_error_dynamic_m", SCALE_MM),
        column("rms in motion, mm", "position_error_rms_m", SCALE_MM),
        column("static, mm", "position_error_static_m", SCALE_MM),
        column("rest p-p, mm", "position_rest_peak_to_peak_smoothed_m", SCALE_MM),
    ];
    ComparisonTable {
        experiment: "point-to-point",
        variants: &variants,
        columns: &columns,
        halved: &["position_error_dynamic_m"],
    }
    .print()
}

fn load_step() -> Result<(), Box<dyn Error>> {
    println!("\n### load-step (Fig. 9)\n");
    let variant = |name, drive, load, is_papers| ControllerVariant {
        name,
        drive: Some(drive),
        load: Some(load),
        is_papers,
    };
    let variants = [
        variant("force-p", "position-linked", "force-p", true),
        variant(
            "force-paper-linked, drive position-paper-linked",
            "position-paper-linked",
            "force-paper-linked",
            true,
        ),
        variant("force-pid-map", "position-linked", "force-pid-map", false),
    ];
    let columns = [
        column("settling 5 %, ms", "force_settling_s", SCALE_MS),
        column("settling to the set-point, ms", "force_settling_to_set_point_s", SCALE_MS),
        column("overshoot, %", "force_overshoot_ratio", SCALE_PERCENT),
        column("in motion rms, N", "force_error_motion_rms_n", 1.0),
        column("speed ratio", "drive_speed_ratio_least", 1.0),
        column("peak error, mm", "position_error_peak_after_step_m", SCALE_MM),
        column("static, mm", "position_error_static_m", SCALE_MM),
        column("rest p-p, mm", "position_rest_peak_to_peak_smoothed_m", SCALE_MM),
        column("rest p-p, N", "force_rest_peak_to_peak_n", 1.0),
    ];
    ComparisonTable {
        experiment: "load-step",
        variants: &variants,
        columns: &columns,
        halved: &["force_settling_s", "force_error_motion_rms_n"],
    }
    .print()
}
