//! `emulator bus-load`: load and response times of the bus as text, or beside what a run showed as a table for the docs.

use crate::cli::BusLoadArguments;
use crate::run::RunError;
use protocol::bus_load::BusLoad;
use protocol::exit::Exit;
use protocol::frames::BIT_RATE_PER_S;
use protocol::response_time::critical;
use protocol::response_time::rig::{RigAnalysis, arrivals_text, in_us};
use serde_json::Value;
use std::fmt::Write;
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
    #[allow(clippy::print_stdout)] // the table is the command's result
    {
        println!("{text}");
    }
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
        "| frame | id | bits, worst case | comes at most | bound, us | in a run, us | bits in it | critical instant, us | \
         bound of these frames, us |\n|---|---|---:|---|---:|---:|---:|---:|---:|\n",
    );
    for (place, (frame, bound)) in analysis.frames().iter().zip(analysis.responses()).enumerate() {
        let (message, seen) = (frame.message, &run["identifiers"][format!("{:03X}", frame.message.id)]);
        let critical = critical::play(analysis, place, 1);
        let bits = |which: usize| seen["bits"][which].as_u64();
        let bits =
            bits(0).zip(bits(1)).map_or_else(String::new, |(least, most)| format!("{least} to {most}"));
        let measured =
            seen["response_ns"]["max"].as_u64().map_or_else(|| "not sent".into(), |ns| in_us(Some(ns)));
        let _infallible = writeln!(
            text,
            "| {} | 0x{:03X} | {} | {} | {} | {measured} | {bits} | {} | {} |",
            message.name,
            message.id,
            frame.bits,
            arrivals_text(&frame.arrivals),
            in_us(bound.map(|found| found.response_ns)),
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
