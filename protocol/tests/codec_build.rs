//! A `rig.dbc` that is broken, or says what the generator does not know, is refused with file and line;
//! `src/frames/payloads.rs` and `messages.rs` are what the generator makes of the file itself.

use crate::emit;
use crate::model;
use crate::source;

const RIG: &str = include_str!("../rig.dbc");

/// The two files that the generator makes.
fn build(text: &str) -> Result<[(&'static str, String); 2], String> {
    let catalogue = model::Catalogue::read(&source::Source::new("rig.dbc", text))?;
    Ok([("payloads.rs", emit::payloads(&catalogue)), ("messages.rs", emit::messages(&catalogue))])
}

/// Replaces the first `from` behind `after` in rig.dbc; what the build says, and the line that was changed.
fn break_it(after: &str, from: &str, to: &str) -> (String, usize) {
    let place = RIG.find(after).unwrap_or_else(|| panic!("{after} is not in rig.dbc"));
    let place = place + RIG[place..].find(from).unwrap_or_else(|| panic!("{from} is not behind {after}"));
    let text = format!("{}{to}{}", &RIG[..place], &RIG[place + from.len()..]);
    (build(&text).expect_err("a broken file"), RIG[..place].matches('\n').count() + 1)
}

#[test]
fn the_file_itself_builds_the_same_text_twice() {
    let files = build(RIG).unwrap();
    assert!(files[1].1.contains("pub enum Frame"));
    assert_eq!(build(RIG).unwrap(), files);
}

/// A file is written when it is out of date, so that a second run passes with the new frames compiled in.
#[test]
fn the_committed_frames_are_generated_from_rig_dbc() {
    let fresh = build(RIG).unwrap_or_else(|problem| panic!("protocol/{problem}"));
    let mut written = Vec::new();
    for (name, text) in fresh {
        let path = format!("{}/src/frames/{name}", env!("CARGO_MANIFEST_DIR"));
        if std::fs::read_to_string(&path).ok().as_deref() != Some(&text) {
            std::fs::write(&path, text).unwrap();
            written.push(path);
        }
    }
    assert!(
        written.is_empty(),
        "out of date, and written anew: {}; build and test again",
        written.join(", ")
    );
}

#[test]
fn each_problem_is_reported_with_file_and_line() {
    let valve = "BO_ 272 ";
    let cases = [
        (valve, "0|12@1-", "0|12@@1-", "expected"),
        (valve, "0|12@1-", "0|12@0-", "Motorola"),
        (valve, "12|4@1+", "11|4@1+", "overlaps"),
        (valve, "32|8@1+", "33|8@1+", "lies within its message"),
        (valve, "SG_ alive :", "SG_ alive m0 :", "multiplexed"),
        (valve, "[-1|1]", "[-1.00001|1]", "range"),
        (valve, "[0|4095]", "[0|4096]", "range"),
        (valve, "\"\" Rig", "\"bar\" Rig", "unit \"bar\" is unknown"),
        (valve, "\"\" Rig", "\"\" Nobody", "receiver Nobody"),
        (valve, "BO_ 272 ", "BO_ 2048 ", "exceeds 11 bits"),
        (valve, "BO_ 272 ", "BO_ 65808 ", "exceeds 11 bits"),
        (valve, "BO_ 272 ", "BO_ 2147483920 ", "extended"),
        (valve, "BO_ 272 ", "BO_ 129 ", "kept for CANopen"),
        (valve, "272 DriveValve", "272 DriveValveButWithFarTooLongANameFor", "characters"),
        (valve, ": 5 Drive", ": 9 Drive", "allowed are 1 to 8"),
        (valve, "DriveController\n", "Nobody\n", "not in BU_"),
        ("BO_ 273 ", "16|12@1+", "16|11@1+", "range"),
        ("BO_ 384 ", "BO_ 384 HandForce", "BO_ 352 HandForce", "identifier 0x160 is taken"),
        ("VAL_TABLE_ RunControlCommand", "2 \"abort\"", "3 \"abort\"", "count from 0"),
        ("VAL_TABLE_ RunControlCommand", "2 \"abort\"", "2 \"start\"", "same name"),
    ];
    for (after, from, to, expected) in cases {
        let (problem, line) = break_it(after, from, to);
        assert!(problem.contains(expected), "{from} -> {to}: {problem}");
        assert!(problem.contains(&format!("rig.dbc:{line}:")), "{from} -> {to}, line {line}: {problem}");
    }
}

#[test]
fn problems_of_attributes_are_reported_at_their_message() {
    let line_of = |text: &str| RIG[..RIG.find(text).unwrap()].matches('\n').count() + 1;
    let cases = [
        ("BA_ \"GenMsgCycleTime\" BO_ 304 10;", "", "BO_ 304 Tick", "GenMsgCycleTime is not set"),
        (
            "BA_ \"GenMsgSendType\" BO_ 304 3;",
            "BA_ \"GenMsgSendType\" BO_ 304 9;",
            "BO_ 304 Tick",
            "GenMsgSendType",
        ),
        ("CM_ BO_ 304", "CM_ BO_ 999", "BO_ 304 Tick", "no CM_"),
        ("BO_ 272 \"SAE J1850\"", "BO_ 272 \"XOR\"", "BO_ 272 ", "Checksum \"XOR\""),
        ("BO_ 272 \"crc\"", "BO_ 272 \"alive\"", "BO_ 272 ", "ChecksumSignal \"alive\""),
        ("VAL_ 352 command 0", "VAL_ 352 command 9", " SG_ command", "equals no VAL_TABLE_"),
    ];
    for (from, to, blamed, expected) in cases {
        assert!(RIG.contains(from), "{from}");
        let problem = build(&RIG.replacen(from, to, 1)).unwrap_err();
        assert!(problem.contains(expected), "{from} -> {to}: {problem}");
        assert!(problem.contains(&format!("rig.dbc:{}:", line_of(blamed))), "{from} -> {to}: {problem}");
    }
}

#[test]
fn messages_of_one_name_share_one_layout() {
    let (problem, _) = break_it("BO_ 289 ", "16|16@1-", "16|15@1-");
    assert!(problem.contains("range"), "{problem}");
    let text = RIG.replacen("CM_ SG_ 289 force \"", "CM_ SG_ 289 force \"Other. ", 1);
    let problem = build(&text).unwrap_err();
    assert!(problem.contains("LoadSensors and DriveSensors share the name Sensors"), "{problem}");
}
