//! The requests of the page, parsed from JSON; they are carried out by the bus, by the emulator's console, or here. No input or
//! output.
//!
//! Ranges are not checked here: the console of the emulator checks them, and its answer is passed on.

use super::minute::LONGEST_S;
use protocol::frames::{Frame, HandSetPointAxis, RunControl, RunControlCommand};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
enum Request {
    EmergencyStop {},
    Release {},
    Start {},
    Abort {},
    Link {},
    Unlink {},
    Weights {
        kg: f64,
    },
    Hand {
        on: String,
        newton: f64,
    },
    Fault {
        name: String,
        place: Option<String>,
        #[serde(default)]
        values: BTreeMap<String, f64>,
    },
    Mend {
        name: Option<String>,
        place: Option<String>,
        #[serde(default)]
        all: bool,
    },
    SetPoint {
        axis: RequestAxis,
        position_m: Option<f64>,
        force_n: Option<f64>,
    },
    Save {
        seconds: f64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RequestAxis {
    Drive,
    Load,
}

/// How a request is carried out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Order {
    /// A stop by the console, sent again until the release.
    Stop,
    Release,
    Frame(Frame),
    /// A set-point by hand on the bus, sent once: position or force.
    SetPoint {
        axis: HandSetPointAxis,
        /// Target position, m.
        position_m: Option<f64>,
        /// Target force, N.
        force_n: Option<f64>,
    },
    Line(String),
    /// Save a record of the last seconds, of this length.
    Save(f64),
}

pub(crate) fn read(body: &[u8]) -> Result<Order, String> {
    let request: Request = serde_json::from_slice(body).map_err(|error| error.to_string())?;
    let run = |command| Order::Frame(Frame::RunControl(RunControl { command, experiment: 0 }));
    let line = |line: &str| Order::Line(line.to_owned());
    Ok(match request {
        Request::EmergencyStop {} => Order::Stop,
        Request::Release {} => Order::Release,
        Request::Start {} => run(RunControlCommand::Start),
        Request::Abort {} => run(RunControlCommand::Abort),
        Request::Link {} => line("link"),
        Request::Unlink {} => line("unlink"),
        Request::Weights { kg } => Order::Line(format!("weights {kg}")),
        Request::Hand { on, newton } => Order::Line(format!("hand {} {newton}", word(&on)?)),
        Request::Fault { name, place, values } => {
            let mut text = format!("fault {}", at(&name, place.as_deref())?);
            for (key, value) in &values {
                let _ = write!(text, " {}={value}", word(key)?);
            }
            Order::Line(text)
        }
        Request::Mend { all: true, name: None, place: None } => line("mend all"),
        Request::Mend { all: false, name: Some(name), place } => {
            Order::Line(format!("mend {}", at(&name, place.as_deref())?))
        }
        Request::Mend { .. } => return Err("mend takes a name and a place, or \"all\": true".into()),
        Request::SetPoint { axis, position_m, force_n } => {
            let (axis, is_fitting) = match axis {
                RequestAxis::Drive => (HandSetPointAxis::Drive, position_m.is_some() && force_n.is_none()),
                RequestAxis::Load => (HandSetPointAxis::Load, position_m.is_some() != force_n.is_some()),
            };
            if !is_fitting {
                return Err(
                    "set-point takes position_m for the drive; for the load either force_n or position_m"
                        .into(),
                );
            }
            Order::SetPoint { axis, position_m, force_n }
        }
        Request::Save { seconds } if seconds > 0.0 && seconds <= LONGEST_S => Order::Save(seconds),
        Request::Save { .. } => return Err(format!("seconds: more than 0, at most {LONGEST_S}")),
    })
}

fn at(name: &str, place: Option<&str>) -> Result<String, String> {
    let name = word(name)?;
    Ok(match place {
        Some(place) => format!("{name} {}", word(place)?),
        None => name.to_owned(),
    })
}

/// Checks that a text is a single word of a console line.
fn word(text: &str) -> Result<&str, String> {
    let good = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    if !text.is_empty() && text.chars().all(good) { Ok(text) } else { Err(format!("{text:?} is no name")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(json: &str) -> String {
        match read(json.as_bytes()) {
            Ok(Order::Line(line)) => line,
            other => panic!("{json}: {other:?}"),
        }
    }

    #[test]
    fn each_command_has_its_line() {
        assert_eq!(line(r#"{"command": "link"}"#), "link");
        assert_eq!(line(r#"{"command": "weights", "kg": 2.5}"#), "weights 2.5");
        assert_eq!(line(r#"{"command": "hand", "on": "load", "newton": -40}"#), "hand load -40");
        let fault =
            r#"{"command": "fault", "name": "hose-burst", "place": "load.b", "values": {"kv_m3_per_h": 2}}"#;
        assert_eq!(line(fault), "fault hose-burst load.b kv_m3_per_h=2");
        assert_eq!(line(r#"{"command": "mend", "name": "bus-loss"}"#), "mend bus-loss");
        assert_eq!(line(r#"{"command": "mend", "all": true}"#), "mend all");
    }

    #[test]
    fn what_goes_on_the_bus_or_stays_here() {
        assert_eq!(read(br#"{"command": "emergency-stop"}"#), Ok(Order::Stop));
        assert_eq!(read(br#"{"command": "release"}"#), Ok(Order::Release));
        let start = RunControl { command: RunControlCommand::Start, experiment: 0 };
        assert_eq!(read(br#"{"command": "start"}"#), Ok(Order::Frame(Frame::RunControl(start))));
        assert_eq!(read(br#"{"command": "save", "seconds": 60}"#), Ok(Order::Save(60.0)));
        let press = Order::SetPoint { axis: HandSetPointAxis::Load, position_m: None, force_n: Some(150.0) };
        assert_eq!(read(br#"{"command": "set-point", "axis": "load", "force_n": 150}"#), Ok(press));
        let go = Order::SetPoint { axis: HandSetPointAxis::Drive, position_m: Some(0.0), force_n: None };
        assert_eq!(read(br#"{"command": "set-point", "axis": "drive", "position_m": 0}"#), Ok(go));
    }

    #[test]
    fn a_set_point_that_is_not_given_is_asked_for_and_never_taken_for_0() {
        for given in [
            r#""axis": "drive""#,
            r#""axis": "drive", "position_m": null"#,
            r#""axis": "drive", "force_n": 100"#,
            r#""axis": "drive", "position_m": 0.2, "force_n": 0"#,
            r#""axis": "load""#,
            r#""axis": "load", "position_m": 0.2, "force_n": 100"#,
        ] {
            let refused = read(format!(r#"{{"command": "set-point", {given}}}"#).as_bytes());
            assert!(refused.is_err_and(|why| why.starts_with("set-point takes position_m")), "{given}");
        }
    }

    #[test]
    fn nothing_smuggles_a_second_command() {
        for bad in [
            r#"{"command": "fault", "name": "bus-loss\nquit"}"#,
            r#"{"command": "fault", "name": "valve-stuck", "place": "drive load"}"#,
            r#"{"command": "hand", "on": "load 5\nquit", "newton": 1}"#,
            r#"{"command": "fault", "name": "", "values": {}}"#,
            r#"{"command": "fault", "name": "x", "values": {"a b": 1}}"#,
            r#"{"command": "quit"}"#,
            r#"{"command": "link", "and": "more"}"#,
            r#"{"command": "mend"}"#,
            r#"{"command": "save", "seconds": 61}"#,
            r#"{"command": "save", "seconds": 0}"#,
            r#"{"command": "weights"}"#,
            r#"{"command": "set-point", "axis": "both"}"#,
            "nothing",
        ] {
            assert!(read(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
