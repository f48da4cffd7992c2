//! The state as Prometheus reads it: text, version 0.0.4. Made of the page's own state, so that both say the same.

use super::columns::COLUMNS;
use super::view::{Audience, View};
use serde_json::Value;
use std::fmt::{Display, Write as _};

/// The text of `/metrics`.
pub fn text(view: &View, audience: Audience, bus_is_up: bool) -> String {
    let state = view.state(audience);
    let mut text = String::new();
    let mut one = |name: &str, kind: &str, help: &str, value: &Value| {
        if let Some(value) = number(value) {
            head(&mut text, name, kind, help);
            let _ = writeln!(text, "airbench_{name} {value}");
        }
    };
    let (timing, bus) = (&state["timing"], &state["bus"]);
    one("up", "gauge", "Whether this program runs.", &1.into());
    one("bus_connected", "gauge", "Whether the bus is there.", &bus_is_up.into());
    one("telemetry_connected", "gauge", "Whether an emulator tells its cycles.", &view.telemetry.into());
    one("cycles_total", "counter", "Cycles of the rig.", &state["cycle"]);
    one("skipped_cycles_total", "counter", "Cycles computed late and not sent.", &timing["skipped"]);
    one("overruns_total", "counter", "Wake-ups that missed at least one cycle.", &timing["overruns"]);
    one("frames_lost_total", "counter", "Sensor frames that did not come here.", &bus["lost"]);
    one("frames_malformed_total", "counter", "Frames that are not as rig.dbc says.", &bus["malformed"]);
    one(
        "bus_load_percent",
        "gauge",
        "Load of the bus in the last second, worst-case stuffing.",
        &bus["load_percent"],
    );
    one(
        "emergency_stop",
        "gauge",
        "Whether the emergency stop is tripped.",
        &state["emergency_stop"]["active"],
    );
    one("linked", "gauge", "Whether the rods are linked.", &state["linked"]);
    one("weights_kg", "gauge", "Weights on the carriage.", &state["weights_kg"]);
    let faults = state["faults_active"].as_array().map_or(0, Vec::len);
    one("faults_active", "gauge", "Faults that are put into the run.", &faults.into());
    let supported = state["claim"]["supported"] == "yes";
    one("latency_claim_supported", "gauge", "Whether the run supports a latency claim.", &supported.into());
    one("viewers", "gauge", "Listeners to events.", &audience.viewers.into());
    one(
        "viewer_events_missed_total",
        "counter",
        "Events that listeners were too slow for.",
        &audience.missed.into(),
    );
    let lost = &state["telemetry_records_lost"];
    one("telemetry_records_lost_total", "counter", "Records of the emulator that did not come here.", lost);
    for column in COLUMNS.iter() {
        one(
            &column.name,
            "gauge",
            &format!("Column of the page, in {}.", column.unit),
            &state["last"][&column.name],
        );
    }
    head(&mut text, "frames_total", "counter", "Frames of the bus.");
    for (frame, count) in view.wire.totals() {
        let _ = writeln!(text, "airbench_frames_total{{frame=\"{frame}\"}} {count}");
    }
    for (name, samples) in view.rhythm.samples() {
        head(&mut text, format!("{name}_seconds"), "summary", "Latency since this program looks on.");
        let reported = samples.percentiles_ns();
        for (quantile, ns) in
            [(0.5, reported.p50), (0.9, reported.p90), (0.99, reported.p99), (0.999, reported.p999)]
        {
            // One that there are too few samples for has no line, as it is null in the state.
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

/// A number, or a flag as 0 or 1; what is null has no line.
fn number(value: &Value) -> Option<f64> {
    value.as_bool().map(|flag| f64::from(u8::from(flag))).or_else(|| value.as_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use latency::hlog::{self, Interval};
    use runlog::telemetry::Packet;

    #[test]
    fn a_quantile_that_too_few_samples_cannot_tell_has_no_line() {
        let mut view = View::new(None);
        let quantiles = |view: &View| {
            let text = text(view, Audience::default(), true);
            text.lines().filter(|line| line.contains("wake_up_seconds{quantile=")).count()
        };
        assert_eq!(quantiles(&view), 0, "nothing was measured, and nothing took 0 s");
        let samples = std::iter::repeat_n(20_000, 100).collect();
        let interval = Interval { tag: "emulator-wakeup".into(), start_s: 0.0, duration_s: 1.0, samples };
        let mut log = Vec::new();
        hlog::write(&mut log, 0.0, [&interval]).unwrap();
        for line in String::from_utf8(log).unwrap().lines() {
            view.packet(Packet::Histogram(line.to_owned()));
        }
        assert_eq!(quantiles(&view), 3, "all but p99.9, which wants a thousand");
    }
}
