//! cantools reads `rig.dbc` without a warning and gives the bytes and values of our codec, for every signal of every message.
//!
//! Needs Python with cantools and crccheck: `AIRBENCH_PYTHON`, else `target/tools/venv`, which `scripts/test` makes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use protocol::frames::{Frame, MESSAGES, MessageSpec, SignalKind, SignalSpec};
use serde_json::{Map, Value, json};

/// Random frames of each message, besides those at the ends of the ranges.
const FRAMES: usize = 400;

fn python() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate stands in the workspace");
    let python = std::env::var_os("AIRBENCH_PYTHON")
        .map_or_else(|| root.join("target/tools/venv/bin/python"), PathBuf::from);
    let problem = "run scripts/test, which makes the Python environment";
    assert!(python.exists(), "{} is missing: {problem}", python.display());
    python
}

fn dbc() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("rig.dbc")
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success() && err.is_empty(), "{command:?}\n{out}\n{err}");
    out
}

/// A value of `signal`: at an end, on a count, half way between two (a tie), or anywhere.
fn value(signal: &SignalSpec, rng: &mut TestRng) -> f64 {
    let span = (signal.raw_max - signal.raw_min) as u64 + 1;
    let raw = signal.raw_min + (rng.next_u64() % span) as i64;
    if signal.kind != SignalKind::Physical {
        return raw as f64;
    }
    let unit = (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let value = match rng.next_u64() % 8 {
        0 => signal.min,
        1 => signal.max,
        2 => signal.physical(raw),
        3 | 4 => (raw as f64 + 0.5) * signal.factor + signal.offset,
        _ => signal.min + unit * (signal.max - signal.min),
    };
    value.clamp(signal.min, signal.max)
}

/// One line for the script: values, and the bytes and decoded values that we make of them, or that we refuse them.
fn line(spec: &MessageSpec, values: &[f64]) -> Value {
    let named = |values: &[f64]| -> Map<String, Value> {
        spec.signals
            .iter()
            .zip(values)
            .map(|(signal, value)| (signal.name.to_owned(), json!(value)))
            .collect()
    };
    let frame = Frame::from_values(spec.id, values).expect("values fit their fields");
    let Ok(encoded) = frame.encode() else {
        return json!({ "message": spec.name, "values": named(values), "refused": true });
    };
    let mut decoded = Vec::new();
    Frame::decode(&encoded)
        .expect("what was encoded decodes")
        .for_each_signal(|_, value| decoded.push(value));
    let hex: String = encoded.data().iter().map(|byte| format!("{byte:02x}")).collect();
    json!({ "message": spec.name, "values": named(values), "hex": hex, "decoded": named(&decoded) })
}

#[test]
fn cantools_gives_the_same_bytes_and_values() {
    let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut lines = Vec::new();
    for spec in MESSAGES {
        for _ in 0..FRAMES {
            let values: Vec<_> = spec.signals.iter().map(|signal| value(signal, &mut rng)).collect();
            lines.push(line(spec, &values).to_string());
        }
        // Around the ends of each range: half a millionth of a step is forgiven, two are not.
        for (index, signal) in spec.signals.iter().enumerate().filter(|(_, s)| s.kind == SignalKind::Physical)
        {
            for (end, sign) in [(signal.min, -1.0), (signal.max, 1.0)] {
                for (steps, refused) in [(5e-7, false), (2e-6, true), (0.6, true)] {
                    let mut values: Vec<_> = spec.signals.iter().map(|signal| signal.min).collect();
                    values[index] = end + sign * steps * signal.factor;
                    let line = line(spec, &values);
                    assert_eq!(line.get("refused").is_some(), refused, "{line}");
                    lines.push(line.to_string());
                }
            }
        }
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("codec_cantools.jsonl");
    fs::write(&file, lines.join("\n")).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cantools_reference.py");
    let out = run(Command::new(python()).args(["-W", "error"]).arg(script).arg(dbc()).arg(&file));
    assert_eq!(out.trim(), format!("{} frames agree", lines.len()));
}

#[test]
fn cantools_dumps_the_file() {
    let out = run(Command::new(python()).args(["-m", "cantools", "dump"]).arg(dbc()));
    for message in MESSAGES {
        assert!(out.contains(message.name), "{} is not in the dump", message.name);
    }
}
