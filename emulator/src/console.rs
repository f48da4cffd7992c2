//! The rig's console: commands, one a line, for a run with `--console`, from standard input and from viewers of the telemetry.
//!
//! ```text
//!   standard input ── thread: read, check, answer ──┬── bounded queue ──► rig loop, one command a cycle, try_recv
//!   telemetry ─────── the same, never waiting ──────┘
//! ```
//!
//! A command acts at the start of the cycle that takes it: typed commands are not reproducible, not even in lockstep, and
//! appear among the events of `summary.json`. The end of the input closes the console, not the run. Experiments are started and
//! aborted by RunControl on the bus.

use crate::faults::overlay::on_wire;
use crate::faults::{Fault, NEEDS_HOST};
use crate::wire_limits::signal;
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use plant::scene::{Action, Part};
use protocol::frames::{HAND_FORCE, SignalSpec};
use runlog::telemetry::LONGEST_LINE;
use std::io::{self, BufRead, Read};

/// Capacity of the command queue; a piped file waits for the loop.
const QUEUE: usize = 16;

pub(crate) const HELP: &str = "stop | release        the rig's own emergency stop; others release theirs
link | unlink         the load's eye in the carriage
weights KG            weights on the carriage, in all
hand carriage N       a hand pushes in +x until the next such command; 0 lets go
hand load N           the same on the load's eye
fault NAME AT K=V …   breaks something, as 'emulator faults' lists it; without AT where there is one place
mend NAME AT          mends it; 'mend all' mends everything
help                  this list
quit                  ends the run; everything is saved";

/// A command to the rig loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Command {
    Act(Action),
    /// A hand pushes in +x from now on.
    Hand {
        on: Part,
        force_n: f64,
    },
    Break(Fault),
    /// Mends the faults of this name and place, or all.
    Mend(Option<Fault>),
    Quit,
}

/// Bounds of commands in this run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Greatest added mass on the carriage, kg.
    pub added_limit_kg: f64,
    /// Whether this emulator hosts the bus, so that it can inject faults of the bus.
    pub hosts_bus: bool,
}

/// Checks commands and queues them.
#[derive(Clone)]
pub(crate) struct Console {
    limits: Limits,
    queue: Sender<Command>,
}

/// Opens the console; the rig loop takes commands from the receiver.
#[must_use]
pub(crate) fn open(limits: Limits) -> (Console, Receiver<Command>) {
    let (queue, receiver) = bounded(QUEUE);
    (Console { limits, queue }, receiver)
}

impl Console {
    /// Executes the lines of standard input in a thread, and answers on standard error.
    pub(crate) fn listen(self) {
        let answer = |text: &str| text.lines().for_each(|line| protocol::say!("emulator: console: {line}"));
        // The thread ends with its input, with the loop, or with the process: a thread that reads a terminal cannot be joined.
        std::thread::spawn(move || {
            answer("open; 'help' lists the commands");
            self.read(&mut io::stdin().lock(), answer);
        });
    }

    /// Executes a line without waiting for the loop; returns the answer.
    pub(crate) fn execute(&self, line: &str) -> Result<&'static str, String> {
        match parse(line, self.limits)? {
            None => Ok(""),
            Some(Line::Help) => Ok(HELP),
            Some(Line::Command(command)) => match self.queue.try_send(command) {
                Ok(()) => Ok(""),
                Err(TrySendError::Full(_)) => Err("too many commands at once; try again".into()),
                Err(TrySendError::Disconnected(_)) => Err("the run is over".into()),
            },
        }
    }

    /// Executes lines until the input ends or the loop is gone.
    fn read(&self, input: &mut impl BufRead, mut answer: impl FnMut(&str)) {
        while let Ok(Some(line)) = next_line(input) {
            match line.and_then(|line| parse(&line, self.limits)) {
                Ok(None) => {}
                Ok(Some(Line::Help)) => answer(HELP),
                Ok(Some(Line::Command(command))) if self.queue.send(command).is_err() => return,
                Ok(Some(Line::Command(_))) => {}
                Err(message) => answer(&message),
            }
        }
    }
}

/// The next line, or why it is invalid; `None` at the end of the input.
fn next_line(input: &mut impl BufRead) -> io::Result<Option<Result<String, String>>> {
    let mut bytes = Vec::new();
    if input.by_ref().take(LONGEST_LINE as u64).read_until(b'\n', &mut bytes)? == 0 {
        return Ok(None);
    }
    let whole = bytes.ends_with(b"\n") || bytes.len() < LONGEST_LINE;
    if !whole {
        input.skip_until(b'\n')?;
        return Ok(Some(Err(too_long())));
    }
    Ok(Some(Ok(String::from_utf8_lossy(&bytes).into_owned())))
}

/// Message about a line that is longer than any command.
pub(crate) fn too_long() -> String {
    format!("a line of more than {LONGEST_LINE} bytes is no command")
}

#[derive(Debug, PartialEq)]
enum Line {
    Help,
    Command(Command),
}

fn parse(line: &str, limits: Limits) -> Result<Option<Line>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let act = |action| Ok(Some(Line::Command(Command::Act(action))));
    match words[..] {
        [] => Ok(None),
        ["help"] => Ok(Some(Line::Help)),
        ["quit"] => Ok(Some(Line::Command(Command::Quit))),
        ["stop"] => act(Action::EmergencyStop),
        ["release"] => act(Action::Release),
        ["link"] => act(Action::Link { until_s: None }),
        ["unlink"] => act(Action::Unlink),
        ["fault", name, ref rest @ ..] => {
            let fault = fault(name, rest, limits)?;
            Ok(Some(Line::Command(Command::Break(fault))))
        }
        ["mend", "all"] => Ok(Some(Line::Command(Command::Mend(None)))),
        ["mend", name, ref rest @ ..] if rest.len() < 2 => {
            let like = Fault::like(name, rest.first().copied()).map_err(|error| error.to_string())?;
            Ok(Some(Line::Command(Command::Mend(Some(like)))))
        }
        ["weights", kg] => {
            act(Action::Weights { added_mass_kg: number("weights", kg, (0.0, limits.added_limit_kg), "kg")? })
        }
        ["hand", on @ ("carriage" | "load"), newtons] => {
            let (on, name) = if on == "load" { (Part::LoadEye, "load_eye") } else { (Part::Carriage, on) };
            let SignalSpec { min, max, .. } = signal(HAND_FORCE, name);
            let force_n = number("hand", newtons, (*min, *max), "N")?;
            Ok(Some(Line::Command(Command::Hand { on, force_n })))
        }
        ["weights", ..] => Err(format!("'{}': weights takes one number, KG", line.trim())),
        ["hand", ..] => Err(format!("'{}': hand takes 'carriage' or 'load', and a number, N", line.trim())),
        _ => Err(format!(
            "'{}' is none of stop, release, link, unlink, weights KG, hand carriage N, hand load N, fault NAME AT K=V, \
             mend NAME AT, mend all, help, quit",
            line.trim()
        )),
    }
}

/// Parses a fault: its name, its place, and numbers as `key=value`.
fn fault(name: &str, words: &[&str], limits: Limits) -> Result<Fault, String> {
    let (numbers, places): (Vec<&str>, Vec<&str>) = words.iter().partition(|word| word.contains('='));
    let ([] | [_]) = places[..] else {
        return Err(format!("fault {name}: one place, not '{}'", places.join(" ")));
    };
    let numbers: Vec<_> = numbers
        .into_iter()
        .filter_map(|word| word.split_once('='))
        .map(|(key, value)| (key.to_owned(), value.parse().ok(), value.to_owned()))
        .collect();
    let fault = Fault::new(name, places.first().copied(), &numbers).map_err(|error| error.to_string())?;
    if on_wire(&fault).is_some() && !limits.hosts_bus {
        return Err(format!("{name}: {NEEDS_HOST}"));
    }
    Ok(fault)
}

fn number(what: &str, text: &str, (least, most): (f64, f64), unit: &str) -> Result<f64, String> {
    // A NaN is in no range.
    let value = text.parse().ok().filter(|value: &f64| (least..=most).contains(value));
    value.ok_or_else(|| format!("{what} '{text}': allowed are {least} to {most} {unit}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { added_limit_kg: 20.0, hosts_bus: true };

    fn run_console(input: &str) -> (Vec<Command>, Vec<String>) {
        let (console, receiver) = open(LIMITS);
        let mut answers = Vec::new();
        console.read(&mut input.as_bytes(), |text| answers.push(text.to_owned()));
        (receiver.try_iter().collect(), answers)
    }

    #[test]
    fn each_line_is_a_command() {
        let (commands, answers) = run_console(
            "stop\nrelease\n\nlink\n unlink \nweights 2.5\nhand carriage -40\nhand load 1e2\nquit\nstop",
        );
        let expected = [
            Command::Act(Action::EmergencyStop),
            Command::Act(Action::Release),
            Command::Act(Action::Link { until_s: None }),
            Command::Act(Action::Unlink),
            Command::Act(Action::Weights { added_mass_kg: 2.5 }),
            Command::Hand { on: Part::Carriage, force_n: -40.0 },
            Command::Hand { on: Part::LoadEye, force_n: 100.0 },
            Command::Quit,
            Command::Act(Action::EmergencyStop),
        ];
        assert_eq!(commands, expected);
        assert_eq!(answers, [] as [String; 0]);
    }

    #[test]
    fn faults_are_broken_and_mended_by_name_and_place() {
        let (commands, answers) = run_console(
            "fault valve-stuck drive\nfault hose-burst kv_m3_per_h=2 load.b\nfault bus-loss\nmend valve-stuck drive\n\
             mend hose-burst load.b\nmend all\n",
        );
        assert_eq!(answers, [] as [String; 0]);
        let [
            Command::Break(stuck),
            Command::Break(burst),
            Command::Break(loss),
            Command::Mend(Some(like)),
            _,
            Command::Mend(None),
        ] = commands[..]
        else {
            panic!("{commands:?}")
        };
        assert_eq!((stuck, loss.place()), (like, "bus".into()));
        assert_eq!((burst.place(), burst.values[0]), ("load.b".into(), 2.0));
    }

    #[test]
    fn a_bad_line_is_answered_with_what_is_allowed_and_the_next_one_counts() {
        let cases = [
            ("start 3", "none of stop, release"),
            ("stop now", "'stop now'"),
            ("weights", "one number, KG"),
            ("weights heavy", "0 to 20 kg"),
            ("weights 20.5", "0 to 20 kg"),
            ("weights nan", "0 to 20 kg"),
            ("hand 5", "'carriage' or 'load'"),
            ("hand elbow 5", "'carriage' or 'load'"),
            ("hand load inf", "-2000 to 2000 N"),
            ("\u{fffd}", "none of"),
            ("fault", "none of"),
            ("fault valve drive", "'emulator faults' lists"),
            ("fault valve-stuck", "one of drive, load"),
            ("fault valve-stuck drive load", "one place"),
            ("fault valve-offset drive", "needs offset; allowed: -1 to 1"),
            ("fault valve-offset drive offset=nan", "offset = nan: allowed: -1 to 1"),
            ("mend valve-stuck nowhere", "one of drive, load"),
        ];
        for (line, hint) in cases {
            let (commands, answers) = run_console(&format!("{line}\nlink\n"));
            assert_eq!(commands.len(), 1, "{line}");
            assert!(answers.len() == 1 && answers[0].contains(hint), "{line}: {answers:?}");
        }
    }

    #[test]
    fn help_names_every_command_and_an_endless_line_is_none() {
        let (_, answers) = run_console("help\n");
        for word in
            ["stop", "release", "link", "unlink", "weights KG", "hand carriage N", "hand load N", "quit"]
        {
            assert!(answers[0].contains(word), "{word}");
        }
        let (commands, answers) = run_console(&format!("{}\nunlink\n", "stop ".repeat(1000)));
        assert_eq!(commands, [Command::Act(Action::Unlink)]);
        assert!(answers.len() == 1 && answers[0].contains("200 bytes"), "{answers:?}");
    }

    #[test]
    fn a_loop_that_is_gone_ends_the_reading() {
        let (console, receiver) = open(LIMITS);
        drop(receiver);
        let mut input = "stop\nstop\n".as_bytes();
        console.read(&mut input, |_| {});
        assert_eq!(input, b"stop\n");
        assert_eq!(console.execute("stop"), Err("the run is over".into()));
    }

    #[test]
    fn a_viewer_never_waits() {
        let (console, receiver) = open(LIMITS);
        assert_eq!(console.execute("help"), Ok(HELP));
        assert!(console.execute("dance").unwrap_err().contains("is none of"));
        for _ in 0..QUEUE {
            assert_eq!(console.execute("stop"), Ok(""));
        }
        assert!(console.execute("stop").unwrap_err().contains("try again"));
        assert_eq!(receiver.try_iter().count(), QUEUE);
    }
}
