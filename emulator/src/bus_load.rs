//! `emulator bus-load`: load and response times of the bus as text, or with the values of a run as a table for the docs.

use crate::cli::BusLoadArguments;
use crate::run::RunError;
use protocol::bus_load::BusLoad;
use protocol::frames::BIT_RATE_PER_S;
use protocol::response_time::rig::{RigAnalysis, arrivals_text, in_us};
use protocol::response_time::{Response, critical};
use protocol::wire_time::{IdentifierReport, WireTimeReport};
use runlog::summary::Summary;
use std::fmt::Write as _;
use std::path::Path;

/// The bus load of the rig's messages and the response times, or the page's table.
///
/// # Errors
/// [`RunError::Input`] when the run's summary cannot be read, or has no wire times.
pub(crate) fn text(arguments: &BusLoadArguments) -> Result<String, RunError> {
    let analysis = RigAnalysis::worst_case(BIT_RATE_PER_S);
    Ok(match &arguments.markdown {
        None => format!("{BusLoad}\n\n{analysis}"),
        Some(summary) => markdown(&analysis, &wire_time(summary)?),
    })
}

fn wire_time(summary: &Path) -> Result<WireTimeReport, RunError> {
    let read = Summary::read(summary).map_err(|error| RunError::Input(error.to_string()))?;
    read.bus_host.and_then(|host| host.wire_time).ok_or_else(|| {
        let file = summary.display();
        RunError::Input(format!("{file}: the bus of this run took no time; run with ?bitrate=1000000"))
    })
}

fn markdown(analysis: &RigAnalysis, run: &WireTimeReport) -> String {
    let mut text = String::from(
        "| frame | id | bits, worst case | comes at most | bound, us | in a run, us | bound as it came there, us | bits there | \
         critical instant, us | bound of these frames, us |\n|---|---|---:|---|---:|---:|---:|---:|---:|---:|\n",
    );
    let as_it_came = analysis.clone().with(|frame| {
        let arrivals = identifier_report(run, frame.message.id).map(|seen| seen.arrivals).unwrap_or_default();
        frame.allow_for(arrivals.least_distance_ns, arrivals.release_jitter_ns);
        true
    });
    let bounds = analysis.responses().into_iter().zip(as_it_came.responses());
    for (place, (frame, (bound, as_it_came))) in analysis.frames.iter().zip(bounds).enumerate() {
        let message = frame.message;
        let seen = identifier_report(run, message.id);
        let critical = critical::simulate(analysis, place, 1);
        let bits = seen.map_or_else(String::new, |seen| format!("{} to {}", seen.bits[0], seen.bits[1]));
        let in_ns = |bound: Option<Response>| in_us(bound.map(|found| found.response_ns));
        let measured = seen.map_or_else(|| "not sent".into(), |seen| in_us(Some(seen.response_ns.max)));
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
    let _infallible = write!(
        text,
        "\nThe run: {:.1} s, {} frames, {:.1} % of the wire busy, {} errors.",
        run.observed_ns as f64 * 1e-9,
        run.frames,
        run.load_ppm as f64 / 1e4,
        run.errors,
    );
    text
}

fn identifier_report(run: &WireTimeReport, id: u16) -> Option<&IdentifierReport> {
    run.identifiers.get(&format!("{id:03X}"))
}
