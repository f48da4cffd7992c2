//! Everything that `rig.dbc` does not allow is refused by name, when it is sent and when it is received.

use protocol::can::{CanFrame, ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG};
use protocol::checksum;
use protocol::frames::{EncodeError, Frame, MESSAGES, SignalKind, ValveCommand};

#[test]
fn each_physical_signal_refuses_what_is_out_of_range_or_not_finite() {
    let mut refused = 0;
    for spec in MESSAGES {
        for (index, signal) in spec.signals.iter().enumerate().filter(|(_, s)| s.kind == SignalKind::Physical)
        {
            // Two millionths of a step: just beyond the one that is forgiven.
            let beyond = 2e-6 * signal.factor;
            let cases = [
                (signal.min - beyond, false),
                (signal.max + beyond, false),
                (signal.min - signal.factor, false),
                (signal.max + signal.factor, false),
                (-f64::MAX, false),
                (f64::MAX, false),
                (f64::NAN, true),
                (f64::INFINITY, true),
                (f64::NEG_INFINITY, true),
            ];
            for (value, not_finite) in cases {
                let mut values: Vec<_> = spec.signals.iter().map(|signal| signal.min).collect();
                values[index] = value;
                let error = Frame::from_values(spec.id, &values).unwrap().encode().unwrap_err();
                match error {
                    EncodeError::NotFinite { message, signal: named, .. } if not_finite => {
                        assert_eq!((message.name, named.name), (spec.name, signal.name));
                    }
                    EncodeError::OutOfRange { message, signal: named, value: reported } if !not_finite => {
                        assert_eq!((message.name, named.name, reported), (spec.name, signal.name, value));
                    }
                    other => panic!("{}.{} = {value}: {other}", spec.name, signal.name),
                }
                let text = error.to_string();
                for part in
                    [spec.name, signal.name, signal.unit, &signal.min.to_string(), &signal.max.to_string()]
                {
                    assert!(text.contains(part), "{part} is not in: {text}");
                }
                refused += 1;
            }
        }
    }
    assert_eq!(refused, 9 * (2 + 2 * 4 + 1 + 2 * 4 + 2 + 1 + 2), "physical signals of all messages");
}

#[test]
fn each_integer_refuses_counts_beyond_its_bits() {
    for spec in MESSAGES {
        for (index, signal) in spec.signals.iter().enumerate().filter(|(_, s)| s.kind == SignalKind::Integer)
        {
            let mut values = vec![0.0; spec.signals.len()];
            values[index] = signal.max + 1.0;
            match Frame::from_values(spec.id, &values) {
                // Where the field is as wide as the signal, the type itself refuses.
                None => assert!([8, 16, 32].contains(&signal.length), "{}.{}", spec.name, signal.name),
                Some(frame) => {
                    let error = frame.encode().unwrap_err();
                    assert!(
                        matches!(error, EncodeError::OutOfRange { signal: named, .. } if named == signal)
                    );
                }
            }
        }
    }
}

#[test]
fn encode_errors_tell_name_value_unit_and_range() {
    let command =
        |opening, alive| Frame::DriveValveCommand(ValveCommand { opening, alive, ..Default::default() });
    let text = |frame: Frame| frame.encode().unwrap_err().to_string();
    assert_eq!(text(command(1.5, 0)), "DriveValveCommand.opening is 1.5; allowed is -1 to 1");
    assert_eq!(text(command(0.0, 16)), "DriveValveCommand.alive is 16; allowed is 0 to 15");
    assert_eq!(
        text(command(f64::NAN, 0)),
        "DriveValveCommand.opening is NaN, which is not finite; allowed is -1 to 1"
    );
    let weights = Frame::from_values(0x182, &[20.5]).unwrap();
    assert_eq!(text(weights), "Weights.added_mass is 20.5 kg; allowed is 0 to 20 kg");
}

/// A valve command whose checksum is right, whatever its first four bytes are.
fn sealed(id: u16, data: [u8; 4]) -> CanFrame {
    let [a, b, c, d] = data;
    CanFrame::new(id, &[a, b, c, d, checksum::of(id, &data)])
}

#[test]
fn each_malformed_frame_is_refused_by_name() {
    let raw = CanFrame::from_raw;
    let valve = sealed(0x110, [0; 4]);
    let mut corrupt = [0; 5];
    corrupt.copy_from_slice(valve.data());
    corrupt[0] ^= 1;
    // Checksums expected: crccheck 1.3.1, `Crc8SaeJ1850.calc(id.to_bytes(2, "little") + data[:4])`.
    let malformed = [
        (raw(0x000, &[]), "identifier 0x000 is unknown"),
        (raw(0x112, valve.data()), "identifier 0x112 is unknown"),
        (raw(0x154, &[0; 5]), "identifier 0x154 is unknown"),
        (raw(0x7FF, &[0; 8]), "identifier 0x7ff is unknown"),
        (raw(0x110, &[]), "DriveValveCommand has 0 bytes; expected 5"),
        (raw(0x110, &valve.data()[..4]), "DriveValveCommand has 4 bytes; expected 5"),
        (raw(0x121, &[0; 7]), "LoadSensors has 7 bytes; expected 8"),
        (raw(0x130, &[0; 8]), "Tick has 8 bytes; expected 7"),
        (raw(0x160, &[0; 1]), "RunControl has 1 bytes; expected 2"),
        (raw(0x1E0, &[0xFF, 0]), "DriveXcpCommand has 2 bytes; expected 8"),
        (raw(0x110, &corrupt), "DriveValveCommand has checksum 0x88; expected 0x15"),
        (raw(0x111, valve.data()), "LoadValveCommand has checksum 0x88; expected 0xce"),
        (raw(0x110, &[0xFF; 5]), "DriveValveCommand has checksum 0xff; expected 0xa5"),
        (sealed(0x110, [0, 0, 0, 0x20]), "DriveValveCommand has reserved bits set: 0x20000000"),
        (sealed(0x111, [0, 0, 0, 0xE0]), "LoadValveCommand has reserved bits set: 0xe0000000"),
        (raw(0x108, &[0, 2]), "ConsoleEmergencyStop has reserved bits set: 0x200"),
        (raw(0x140, &[0, 0, 0, 0x80]), "RigStatus has reserved bits set: 0x80000000"),
        (raw(0x181, &[3]), "Link has reserved bits set: 0x2"),
        (
            sealed(0x110, [0x00, 0x08, 0, 0]),
            "DriveValveCommand.opening has raw value -2048; allowed is -2047 to 2047",
        ),
        (
            raw(0x120, &[0, 0, 0x00, 0x80, 0, 0, 0, 0]),
            "DriveSensors.force has raw value -32768; allowed is -32767 to 32767",
        ),
        (
            raw(0x153, &[0, 0, 0, 0, 0, 0, 0x00, 0x80]),
            "LoadChainValues.control_error has raw value -32768; allowed is -32767 to 32767",
        ),
        (
            raw(0x180, &[0, 0, 0x00, 0x80]),
            "HandForce.load_eye has raw value -32768; allowed is -32767 to 32767",
        ),
        (raw(0x10A, &[8, 0]), "DriveEmergencyStop.reason has raw value 8; its value table ends at 7"),
        (
            raw(0x150, &[0x0A, 0, 0, 0, 0]),
            "DriveChainStatus.main_chain has raw value 10; its value table ends at 9",
        ),
        (
            raw(0x152, &[0x80, 0, 0, 0, 0]),
            "LoadChainStatus.force_chain has raw value 8; its value table ends at 7",
        ),
        (raw(0x160, &[255, 1]), "RunControl.command has raw value 255; its value table ends at 2"),
    ];
    let refused = |frame: CanFrame, expected: &str| match Frame::decode(&frame) {
        Ok(decoded) => panic!("{frame} was taken for {decoded:?}"),
        Err(error) => assert_eq!(error.to_string(), expected, "{frame}"),
    };
    malformed.into_iter().for_each(|(frame, expected)| refused(frame, expected));
    for (frame, kind) in [
        (raw(0x110 | EXTENDED_FLAG, valve.data()), "0x80000110 is extended"),
        (raw(0x120 | REMOTE_FLAG, &[]), "0x40000120 is a remote request"),
        (raw(ERROR_FLAG | 4, &[0; 8]), "0x20000004 is an error frame"),
    ] {
        refused(frame, &format!("frame {kind}, not a data frame with an 11-bit identifier"));
    }
}
