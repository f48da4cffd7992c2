//! The state in the text format of Prometheus, version 0.0.4, made from the state of the page.

use super::columns::COLUMNS;
use super::light::Support;
use super::state::State;
use super::view::{ServerStatus, View};
use std::fmt::{Display, Write as _};

/// The text of `/metrics`.
pub(crate) fn text(view: &View, server_status: ServerStatus, bus_is_up: bool) -> String {
    let state = view.state(server_status);
    let mut text = String::new();
    let mut one = |name: &str, kind: &str, help: &str, value: Option<f64>| {
        // Unknown values have no line.
        if let Some(value) = value.filter(|value| value.is_finite()) {
            head(&mut text, name, kind, help);
            let _ = writeln!(text, "airbench_{name} {value}");
        }
    };
    let count = |count: u64| Some(count as f64);
    let flag = |flag: bool| Some(f64::from(u8::from(flag)));
    let State { timing, bus, .. } = &state;
    one("up", "gauge", "Whether this program runs.", count(1));
    one("bus_connected", "gauge", "Whether the bus is there.", flag(bus_is_up));
    one("telemetry_connected", "gauge", "Whether an emulator sends telemetry.", flag(view.telemetry));
    one("cycles_total", "counter", "Cycles of the rig.", state.cycle.and_then(count));
    one("skipped_cycles_total", "counter", "Cycles computed late and not sent.", count(timing.skipped));
    one("overruns_total", "counter", "Wake-ups that missed at least one cycle.", count(timing.overruns));
    one("frames_lost_total", "counter", "Sensor frames lost on the way to this program.", count(bus.lost));
    one("frames_malformed_total", "counter", "Frames that are not as rig.dbc says.", count(bus.malformed));
    one(
        "bus_load_percent",
        "gauge",
        "Load of the bus in the last second, worst-case stuffing.",
        bus.load_percent,
    );
    let stopped = state.emergency_stop.active.and_then(flag);
    one("emergency_stop", "gauge", "Whether the emergency stop is tripped.", stopped);
    one("linked", "gauge", "Whether the rods are linked.", flag(state.linked));
    one("weights_kg", "gauge", "Weights on the carriage.", Some(state.weights_kg));
    let faults = state.faults_active.len() as u64;
    one("faults_active", "gauge", "Faults that are put into the run.", count(faults));
    let is_supported = state.claim.as_ref().is_some_and(|claim| claim.supported == Support::Yes);
    one("latency_claim_supported", "gauge", "Whether the run supports a latency claim.", flag(is_supported));
    one("viewers", "gauge", "Clients subscribed to events.", count(state.viewers as u64));
    one(
        "viewer_events_missed_total",
        "counter",
        "Events that listeners were too slow for.",
        count(state.dropped),
    );
    let lost = count(state.telemetry_records_lost);
    one("telemetry_records_lost_total", "counter", "Telemetry records lost on the way.", lost);
    for column in COLUMNS.iter() {
        let help = format!("Column of the page, in {}.", column.unit);
        one(&column.name, "gauge", &help, state.last.get(&column.name).copied().flatten());
    }
    head(&mut text, "frames_total", "counter", "Frames of the bus.");
    for (frame, count) in view.wire.totals() {
        let _ = writeln!(text, "airbench_frames_total{{frame=\"{frame}\"}} {count}");
    }
    for (name, samples) in view.latencies.samples() {
        head(&mut text, format!("{name}_seconds"), "summary", "Latency since this program started.");
        let reported = samples.percentiles_ns();
        for (quantile, ns) in
            [(0.5, reported.p50), (0.9, reported.p90), (0.99, reported.p99), (0.999, reported.p999)]
        {
            // A percentile with too few samples has no line; it is null in the state.
            if let Some(ns) = ns {
                let seconds = ns as f64 * 1e-9;
                let _ = writeln!(text, "airbench_{name}_seconds{{quantile=\"{quantile}\"}} {seconds}");
            }
        }
        let count = samples.count();
        let sum_s = samples.histogram().mean() * count as f64 * 1e-9;
        let _ = writeln!(text, "airbench_{name}_seconds_sum {sum_s}\nairbench_{name}_seconds_count {count}");
    }
    text
}

fn head(text: &mut String, name: impl Display, kind: &str, help: &str) {
    let _ = writeln!(text, "# HELP airbench_{name} {help}\n# TYPE airbench_{name} {kind}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rhythm;
    use runlog::telemetry::Packet;

    #[test]
    fn a_quantile_that_too_few_samples_cannot_tell_has_no_line() {
        let mut view = View::new(None);
        let quantiles = |view: &View| {
            let text = text(view, ServerStatus::default(), true);
            text.lines().filter(|line| line.contains("wake_up_seconds{quantile=")).count()
        };
        assert_eq!(quantiles(&view), 0, "nothing was measured, and nothing took 0 s");
        for line in rhythm::tests::lines("emulator-wakeup", 0.0, 20_000) {
            view.packet(Packet::Histogram(line));
        }
        assert_eq!(quantiles(&view), 3, "all but p99.9, which wants a thousand");
    }
}
