//! What is encoded comes back within half a step, for every signal of every message of `rig.dbc`.

use proptest::prelude::*;
use protocol::can::CanFrame;
use protocol::frames::{Frame, MESSAGES, MessageSpec, SignalKind, SignalSpec};

/// A physical value of `signal` from two numbers of 0 to 1: which count, and where in the step around it.
fn value(signal: &SignalSpec, (count, within): (f64, f64)) -> f64 {
    let raw = signal.raw_min + (count * (signal.raw_max - signal.raw_min) as f64).round() as i64;
    let value = signal.physical(raw);
    match signal.kind {
        SignalKind::Physical => (value + (within - 0.5) * signal.factor).clamp(signal.min, signal.max),
        _ => value,
    }
}

fn values(spec: &MessageSpec, random: &[(f64, f64)]) -> Vec<f64> {
    spec.signals.iter().zip(random).map(|(signal, random)| value(signal, *random)).collect()
}

fn signals(frame: &Frame) -> Vec<(&'static SignalSpec, f64)> {
    let mut signals = Vec::new();
    frame.for_each_signal(|signal, value| signals.push((signal, value)));
    signals
}

/// Two numbers of 0 to 1 for each signal; ends, middle and half steps come up often.
fn random() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let unit = || prop_oneof![4 => 0.0..=1.0, 1 => Just(0.0), 1 => Just(0.5), 1 => Just(1.0)];
    prop::collection::vec((unit(), unit()), 32)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn every_signal_comes_back_within_half_a_step(random in random()) {
        for spec in MESSAGES {
            let values = values(spec, &random);
            let frame = Frame::from_values(spec.id, &values).expect("values fit their fields");
            let encoded = frame.encode().expect("values are in range");
            prop_assert_eq!(encoded.data().len(), usize::from(spec.length));
            let decoded = Frame::decode(&encoded).expect("what was encoded decodes");
            prop_assert_eq!(decoded.name(), spec.name);
            for ((signal, decoded), value) in signals(&decoded).into_iter().zip(values) {
                // Half a step, and the rounding errors of two divisions of numbers up to 2^32 counts.
                let bound = if signal.kind == SignalKind::Physical { (0.5 + 1e-9) * signal.factor } else { 0.0 };
                let error = (decoded - value).abs();
                prop_assert!(error <= bound, "{}.{}: {value} came back as {decoded}", spec.name, signal.name);
            }
        }
    }

    #[test]
    fn what_was_decoded_encodes_to_the_same_bytes(random in random()) {
        for spec in MESSAGES {
            let frame = Frame::from_values(spec.id, &values(spec, &random)).expect("values fit their fields");
            let encoded = frame.encode().expect("values are in range");
            let again = Frame::decode(&encoded).expect("what was encoded decodes").encode();
            prop_assert_eq!(again, Ok(encoded));
        }
    }

    #[test]
    fn no_frame_makes_decode_panic(id in 0_u32..0x800, flags in 0_u32..8, data in prop::collection::vec(any::<u8>(), 0..=8)) {
        let frame = CanFrame::from_raw(id | flags << 29, &data);
        if let Ok(decoded) = Frame::decode(&frame) {
            prop_assert_eq!(decoded.encode(), Ok(frame));
        }
    }
}

#[test]
fn both_ends_of_every_range_come_back_exactly() {
    for spec in MESSAGES {
        for end in [|signal: &SignalSpec| signal.min, |signal: &SignalSpec| signal.max] {
            let values: Vec<_> = spec.signals.iter().map(end).collect();
            let frame = Frame::from_values(spec.id, &values).unwrap();
            let decoded = Frame::decode(&frame.encode().unwrap()).unwrap();
            assert_eq!(signals(&decoded).iter().map(|(_, value)| *value).collect::<Vec<_>>(), values);
        }
    }
}

#[test]
fn shut_valve_is_exactly_zero_counts() {
    let shut = Frame::DriveValveCommand(Default::default()).encode().unwrap();
    assert_eq!(shut.data()[..4], [0, 0, 0, 0]);
}
