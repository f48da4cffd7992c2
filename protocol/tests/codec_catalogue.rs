//! `rig.dbc` says what the contract of the bus says, and leaves other protocols their identifiers.

use std::collections::BTreeSet;

use protocol::frames::{ALIVE_RANGE, BIT_RATE_PER_S, ECHO_RANGE, MESSAGES};

/// Identifier, name, sender, period in ms (0: event) and bytes.
const CONTRACT: [(u16, &str, &str, u32, u8); 24] = [
    (0x108, "ConsoleEmergencyStop", "Console", 100, 2),
    (0x109, "RigEmergencyStop", "Rig", 100, 2),
    (0x10A, "DriveEmergencyStop", "DriveController", 100, 2),
    (0x10B, "LoadEmergencyStop", "LoadController", 100, 2),
    (0x110, "DriveValveCommand", "DriveController", 1, 5),
    (0x111, "LoadValveCommand", "LoadController", 1, 5),
    (0x120, "DriveSensors", "Rig", 1, 8),
    (0x121, "LoadSensors", "Rig", 1, 8),
    (0x130, "Tick", "Rig", 10, 7),
    (0x140, "RigStatus", "Rig", 10, 4),
    (0x150, "DriveChainStatus", "DriveController", 10, 5),
    (0x151, "DriveChainValues", "DriveController", 10, 8),
    (0x152, "LoadChainStatus", "LoadController", 10, 5),
    (0x153, "LoadChainValues", "LoadController", 10, 8),
    (0x160, "RunControl", "Console", 0, 2),
    (0x180, "HandForce", "Bench", 0, 4),
    (0x181, "Link", "Bench", 0, 1),
    (0x182, "Weights", "Bench", 0, 2),
    (0x183, "FaultMark", "Bench", 0, 3),
    (0x184, "HandSetPoint", "Bench", 0, 5),
    (0x1E0, "DriveXcpCommand", "Console", 0, 8),
    (0x1E1, "DriveXcpResponse", "DriveController", 0, 8),
    (0x1E2, "LoadXcpCommand", "Console", 0, 8),
    (0x1E3, "LoadXcpResponse", "LoadController", 0, 8),
];

#[test]
fn messages_are_those_of_the_contract() {
    let messages: Vec<_> =
        MESSAGES.iter().map(|m| (m.id, m.name, m.sender, m.cycle_time_ms, m.length)).collect();
    assert_eq!(messages, CONTRACT);
    assert_eq!(BIT_RATE_PER_S, 1_000_000);
}

#[test]
fn valve_commands_alone_carry_a_checksum() {
    let with: Vec<_> = MESSAGES.iter().filter(|m| m.checksum_start.is_some()).map(|m| m.name).collect();
    assert_eq!(with, ["DriveValveCommand", "LoadValveCommand"]);
}

#[test]
fn counters_and_echoes_have_as_many_values_as_their_bits() {
    for (name, range, users) in [("alive", ALIVE_RANGE, 4), ("echo", ECHO_RANGE, 2)] {
        let signals: Vec<_> =
            MESSAGES.iter().flat_map(|m| m.signals).filter(|signal| signal.name == name).collect();
        assert_eq!(signals.len(), users, "{name}");
        for signal in signals {
            assert_eq!((1 << signal.length, signal.raw_min, signal.raw_max), (range, 0, range as i64 - 1));
        }
    }
}

#[test]
fn each_identifier_has_one_sender_who_does_not_listen_to_it() {
    let ids: BTreeSet<_> = MESSAGES.iter().map(|message| message.id).collect();
    assert_eq!(ids.len(), MESSAGES.len());
    for message in MESSAGES {
        assert!(message.signals.iter().all(|s| !s.receivers.contains(&message.sender)), "{}", message.name);
    }
}

#[test]
fn identifiers_of_canopen_and_diagnostics_stay_free() {
    let foreign = [0x000..=0x000, 0x080..=0x100, 0x580..=0x67F, 0x700..=0x77F, 0x7DF..=0x7EF];
    for message in MESSAGES {
        assert!(
            message.id < 0x800 && !foreign.iter().any(|range| range.contains(&message.id)),
            "{}",
            message.name
        );
    }
}

#[test]
fn names_fit_a_dbc_file_and_everything_has_a_comment() {
    for message in MESSAGES {
        assert!(message.name.len() <= 32 && !message.comment.is_empty(), "{}", message.name);
        for signal in message.signals {
            let named = format!("{}.{}", message.name, signal.name);
            assert!(
                signal.name.len() <= 32 && !signal.comment.is_empty() && !signal.receivers.is_empty(),
                "{named}"
            );
        }
    }
}

#[test]
fn steps_are_those_of_the_rig_model() {
    let step = |name: &str, signal: &str| {
        let message = MESSAGES.iter().find(|message| message.name == name).unwrap();
        let signal = message.signals.iter().find(|s| s.name == signal).unwrap();
        (signal.factor, signal.length, signal.min, signal.max)
    };
    assert_eq!(step("DriveValveCommand", "opening"), (1.0 / 2047.0, 12, -1.0, 1.0));
    assert_eq!(step("DriveSensors", "position"), (0.5 / 65535.0, 16, 0.0, 0.5));
    assert_eq!(step("LoadSensors", "force"), (2000.0 / 32767.0, 16, -2000.0, 2000.0));
    assert_eq!(step("LoadSensors", "pressure_b"), (1e6 / 16383.0, 14, 0.0, 1e6));
}
