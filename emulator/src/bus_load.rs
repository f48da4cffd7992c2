//! `emulator bus-load`: load and response times of the bus as text, or beside what a run showed as a table for the docs.

use crate::cli::BusLoadArguments;
use crate::run::RunError;
use protocol::bus_load::BusLoad;
use protocol::exit::Exit;
use protocol::frames::BIT_RATE_PER_S;
use protocol::response_time::rig::{RigAnalysis, arrivals_text, in_us};
use protocol::response_time::{Response, critical};
use serde_json::Value;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Prints what was asked for.
///
/// # Errors
/// [`RunError::Input`] when the run's summary cannot be read, or is of a bus that took no time.
pub fn print(arguments: &BusLoadArguments) -> Result<Exit, RunError> {
    let analysis = RigAnalysis::worst_case(BIT_RATE_PER_S);
    let text = match &arguments.markdown {
        None => format!("{}\n\n{analysis}", BusLoad::of_rig()),
        Some(summary) => markdown(&analysis, &wire_time(summary)?),
    };
    // Whoever closed the pipe, such as `head`, has read enough.
    let _ = writeln!(std::io::stdout(), "{text}");
    Ok(Exit::Good)
}

fn wire_time(summary: &Path) -> Result<Value, RunError> {
    let refused = |reason: String| RunError::Input(format!("{}: {reason}", summary.display()));
    let text = std::fs::read_to_string(summary).map_err(|error| refused(error.to_string()))?;
    let mut summary: Value = serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
    match summary["bus_host"]["wire_time"].take() {
        Value::Null => Err(refused("the bus of this run took no time; run with ?bitrate=1000000".into())),
        wire_time => Ok(wire_time),
    }
}

fn markdown(analysis: &RigAnalysis, run: &Value) -> String {
    let mut text = String::from(
        "| frame | id | bits, worst case | comes at most | bound, us | in a run, us | bound as it came there, us | bits there | \
         critical instant, us | bound of these frames, us |\n|---|---|---:|---|---:|---:|---:|---:|---:|---:|\n",
    );
    let as_it_came = analysis.clone().with(|frame| {
        let arrivals = &run["identifiers"][format!("{:03X}", frame.message.id)]["arrivals"];
        frame.allow_for(arrivals["least_distance_ns"].as_u64(), arrivals["release_jitter_ns"].as_u64());
        true
    });
    let bounds = analysis.responses().into_iter().zip(as_it_came.responses());
    for (place, (frame, (bound, as_it_came))) in analysis.frames().iter().zip(bounds).enumerate() {
        let (message, seen) = (frame.message, &run["identifiers"][format!("{:03X}", frame.message.id)]);
        let critical = critical::play(analysis, place, 1);
        let bits = |which: usize| seen["bits"][which].as_u64();
        let bits =
            bits(0).zip(bits(1)).map_or_else(String::new, |(least, most)| format!("{least} to {most}"));
        let in_ns = |bound: Option<Response>| in_us(bound.map(|found| found.response_ns));
        let measured =
            seen["response_ns"]["max"].as_u64().map_or_else(|| "not sent".into(), |ns| in_us(Some(ns)));
        let _infallible = writeln!(
            text,
            "| {} | 0x{:03X} | {} | {} | {} | {measured} | {} | {bits} | {} | {} |",
            message.name,
            message.id,
            frame.bits,
            arrivals_text(&frame.arrivals),
            in_ns(bound),
            in_ns(as_it_came),
            in_us(critical.map(|played| played.measured_ns)),
            in_us(critical.map(|played| played.bound_ns)),
        );
    }
    let number = |key: &str| run[key].as_u64().unwrap_or(0);
    let _infallible = write!(
        text,
        "\nThe run: {:.1} s, {} frames, {:.1} % of the wire busy, {} errors.",
        number("observed_ns") as f64 * 1e-9,
        number("frames"),
        number("load_ppm") as f64 / 1e4,
        number("errors"),
    );
    text
}
