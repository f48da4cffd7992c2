//! Checks whether a foreign controller keeps the contract of the bus: the check takes the place of the rig and injects
//! disturbances.
//!
//! ```text
//!   session 1   regular operation ── noise on the bus ── skipped cycles
//!   session 2   … its valve opens ── emergency stop
//!   session 3   … its valve opens ── its sensors fall silent, and come back
//! ```
//!
//! Each session has a controller that was restarted, if the check has its command line; else the user resets it. Faults are
//! injected while the valve is open, since nothing can be observed on a shut valve.
//!
//! | file | holds |
//! |---|---|
//! | `rig_bus` | the bus from the side of the rig, cycle by cycle |
//! | `stand_in` | the frames of a rig, and a carriage that follows |
//! | `observer` | what the controller sent |
//! | `judge` | the checks |
//! | [`cli`] | the command line |

pub(crate) mod cli;
mod judge;
mod observer;
mod rig_bus;
mod stand_in;

use crate::junit::{self, Case};
use crate::say;
use crate::soak::model::CheckResult;
use cli::{CheckPace, ConformanceArguments};
use judge::{Phase, case};
use observer::Observer;
use protocol::bus::{BusError, BusUrl, WireOptions};
use protocol::can::CanFrame;
use protocol::exit::Exit;
use realtime::{Interrupt, Request};
use rig_bus::{ExchangeError, RigBus};
use runlog::run_folder::FileError;
use rustix::process::{Pid, Signal, kill_process};
use stand_in::{Disturbance, RigStandIn};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Cycles of each part of the first session after regular operation.
const NOISE_CYCLES: u64 = 200;
const AFTER_SKIP_CYCLES: u64 = 100;
/// Skipped cycles: within the range of a 4-bit counter, and beyond it.
const SKIPS: [u64; 2] = [7, 40];
/// Cycles without judgement, in which a controller may start.
const SETTLING_CYCLES: u64 = 100;
/// A deliberate opening, and the number of cycles that it must last.
const OPEN: f64 = 0.02;
const OPEN_CYCLES: u64 = 10;
/// Cycles of an emergency stop, of a loss of sensors, and of the observation after it.
const STOP_CYCLES: u64 = 500;
const LOSS_CYCLES: u64 = 200;
const BACK_CYCLES: u64 = 200;
/// When no valve opens for so many cycles, the carriage is moved by [`PUSH_M`], repeatedly.
const PUSH_EVERY_CYCLES: u64 = 5000;
const PUSH_M: f64 = 0.02;
/// FIFO priority of the check in real time; that of the emulator.
const FIFO_PRIORITY: u8 = 80;
/// Time that a controller may take to end after SIGTERM.
const TERMINATION_TIMEOUT: Duration = Duration::from_secs(2);

/// Why the check cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ConformanceError {
    #[error("{0}; the check takes the place of the rig: end the emulator on this bus first")]
    Bus(#[from] BusError),
    #[error("the controller '{command}' does not start: {reason}")]
    Command { command: String, reason: String },
    /// The system gave no signal handler, or no folder for a bus.
    #[error("{0}")]
    System(io::Error),
    #[error(transparent)]
    Write(#[from] FileError),
    #[error("interrupted before the last check; nothing was written")]
    Interrupted,
}

impl ConformanceError {
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Bus(_) => Exit::BusFailed,
            Self::Interrupted => Exit::Interrupted,
            _ => Exit::BadInput,
        }
    }
}

/// Checks a controller, prints the results, and writes them as JUnit XML if asked.
///
/// # Errors
/// [`ConformanceError`] when the check could not be made; violations of the controller are results.
pub(crate) fn run(arguments: &ConformanceArguments) -> Result<Exit, ConformanceError> {
    let interrupt = Interrupt::install().map_err(ConformanceError::System)?;
    let began = Instant::now();
    // Dropping it at the end removes the folder.
    let (url, _folder) = match arguments.bus.clone() {
        Some(url) => (url, None),
        None => {
            let folder = TemporaryFolder::new().map_err(ConformanceError::System)?;
            (folder.url(), Some(folder))
        }
    };
    let real = arguments.pace == CheckPace::Real;
    let mut cases: Vec<Case> = Vec::new();
    let sessions: [SessionSteps; 3] = [regular, emergency_stop, sensor_loss];
    for steps in sessions {
        let at = Instant::now();
        let session = Session::open(&url, arguments, &interrupt)?;
        let mut found = if real { with_priority(session, steps, cases.is_empty()) } else { steps(session) }?;
        if let Some(first) = found.first_mut() {
            first.time_s = at.elapsed().as_secs_f64();
        }
        cases.append(&mut found);
    }
    print_results(&cases);
    if let Some(file) = &arguments.junit {
        let text = junit::text("controller", &cases, began.elapsed().as_secs_f64());
        std::fs::write(file, text).map_err(|error| FileError::write(file, error))?;
    }
    let failed = cases.iter().any(|case| case.check.result == CheckResult::Failed);
    Ok(if failed { Exit::BoundBroken } else { Exit::Good })
}

/// Steps of a session.
type SessionSteps = for<'a> fn(Session<'a>) -> Result<Vec<Case>, ConformanceError>;

/// Runs the steps in a thread of FIFO priority. In the main thread the controllers that it starts would inherit the priority
/// and appear better than they are.
fn with_priority(
    session: Session<'_>,
    steps: SessionSteps,
    report_refusals: bool,
) -> Result<Vec<Case>, ConformanceError> {
    std::thread::scope(|scope| {
        let thread = scope.spawn(move || {
            let grants = realtime::acquire(&Request::for_a_loop(FIFO_PRIORITY, None));
            let refusals = grants.refusals.iter().filter(|_| report_refusals);
            refusals.for_each(|refusal| eprintln!("bench: warning: {refusal}"));
            steps(session)
        });
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn print_results(cases: &[Case]) {
    for case in cases {
        let result = match case.check.result {
            CheckResult::Passed => "passed ",
            CheckResult::Failed => "FAILED ",
            CheckResult::Skipped => "skipped",
        };
        let name = format!("{} {}", case.class.trim_start_matches("controller."), case.check.name);
        say(&format!("  {result}  {name:<30} {}", case.check.detail));
    }
}

/// A running controller and the record of its frames.
struct Session<'a> {
    arguments: &'a ConformanceArguments,
    interrupt: &'a Interrupt,
    // Before the bus: the controller is terminated while its bus still exists.
    controller: Option<Controller>,
    bus: RigBus,
    rig: RigStandIn,
    observer: Observer,
    /// Cycles that were sent, with their stamps; no stamp where this process was late.
    cycles: Vec<(u64, Option<u64>)>,
    cycle: u64,
    exchange_error: Option<ExchangeError>,
    frames: Vec<CanFrame>,
}

/// Regular operation, then disturbances that must have no effect.
fn regular(mut session: Session<'_>) -> Result<Vec<Case>, ConformanceError> {
    let answers = session.wait_for_answers()?;
    let result = if answers { CheckResult::Passed } else { CheckResult::Failed };
    let mut cases = vec![case("regular", "answers", result, session.answers_detail())];
    if !answers {
        return Ok(cases);
    }
    session.cycles(SETTLING_CYCLES, Disturbance::default())?;
    let from = session.cycle;
    session.cycles((session.arguments.seconds * 1000.0) as u64, Disturbance::default())?;
    cases.extend(judge::regular(&session.phase(from), session.arguments));
    let from = session.cycle;
    session.cycles(NOISE_CYCLES, Disturbance { noise: true, ..Disturbance::default() })?;
    cases.push(judge::every_cycle("noise", &session.phase(from), session.arguments));
    if session.arguments.pace == CheckPace::Real {
        let from = session.cycle;
        for skipped in SKIPS {
            session.cycle += skipped;
            session.cycles(1, Disturbance { skipped, ..Disturbance::default() })?;
            session.cycles(AFTER_SKIP_CYCLES, Disturbance::default())?;
        }
        cases.push(judge::every_cycle("skipped-cycles", &session.phase(from), session.arguments));
    } else {
        let detail = "no cycle is skipped in simulated time: check it with --pace real".into();
        cases.push(case("skipped-cycles", "every-cycle", CheckResult::Skipped, detail));
    }
    cases.push(session.completion_case("regular"));
    Ok(cases)
}

/// The valve opens, and the emergency stop is tripped.
fn emergency_stop(mut session: Session<'_>) -> Result<Vec<Case>, ConformanceError> {
    if !session.wait_for_open_valve()? {
        return Ok(vec![session.valve_shut_case("emergency-stop")]);
    }
    let from = session.cycle;
    session.cycles(STOP_CYCLES, Disturbance { stopped_since: Some(from), ..Disturbance::default() })?;
    let mut cases = judge::emergency_stop(&session.observer.received, from..session.cycle);
    cases.push(session.completion_case("emergency-stop"));
    Ok(cases)
}

/// The valve opens, the sensors fall silent, and come back.
fn sensor_loss(mut session: Session<'_>) -> Result<Vec<Case>, ConformanceError> {
    if session.arguments.pace == CheckPace::LockstepEcho {
        let detail = "a controller that joins by its echo needs sensors to answer: check it with --pace real";
        return Ok(vec![case("sensor-loss", "valve-shut", CheckResult::Skipped, detail.into())]);
    }
    if !session.wait_for_open_valve()? {
        return Ok(vec![session.valve_shut_case("sensor-loss")]);
    }
    let from = session.cycle;
    session.cycles(LOSS_CYCLES, Disturbance { sensors_lost: true, ..Disturbance::default() })?;
    let back = session.cycle;
    session.cycles(BACK_CYCLES, Disturbance::default())?;
    let mut cases = judge::sensor_loss(&session.observer.received, from..back, back..session.cycle);
    cases.push(session.completion_case("sensor-loss"));
    Ok(cases)
}

impl<'a> Session<'a> {
    fn open(
        url: &BusUrl,
        arguments: &'a ConformanceArguments,
        interrupt: &'a Interrupt,
    ) -> Result<Self, ConformanceError> {
        let bus = RigBus::open(url, arguments)?;
        let controller = Controller::start(url, arguments)?;
        if controller.is_none() {
            eprintln!("bench: waiting for the controller on {url}; reset it if it ran before");
        }
        let lockstep = arguments.pace != CheckPace::Real;
        let mut session = Self {
            arguments,
            interrupt,
            controller,
            bus,
            rig: RigStandIn::new(arguments.axis, lockstep),
            observer: Observer::new(arguments.axis, arguments.both_axes),
            cycles: Vec::new(),
            cycle: 0,
            exchange_error: None,
            frames: Vec::new(),
        };
        session.exchange_error = session.bus.begin().err();
        Ok(session)
    }

    /// Runs `count` cycles, or fewer when the controller leaves the barrier, times out in it, or floods the bus.
    fn cycles(&mut self, count: u64, disturbance: Disturbance) -> Result<(), ConformanceError> {
        for _ in 0..count {
            if self.interrupt.came() {
                return Err(ConformanceError::Interrupted);
            }
            if self.exchange_error.is_some() || self.observer.babbles() {
                return Ok(());
            }
            self.rig.frames(self.cycle, &disturbance, &mut self.frames);
            self.observer.note_sent(self.cycle, !disturbance.sensors_lost);
            let observer = &mut self.observer;
            match self.bus.exchange(&self.frames, |frame, stamp_ns| observer.take(frame, stamp_ns)) {
                Ok(sent) => self.cycles.push((self.cycle, (!sent.disturbed).then_some(sent.stamp_ns))),
                Err(error) => {
                    self.exchange_error = Some(error);
                    return Ok(());
                }
            }
            let opening = if disturbance.stopped_since.is_some() { 0.0 } else { self.observer.opening };
            self.rig.advance(opening);
            self.cycle += 1;
        }
        Ok(())
    }

    fn patience_cycles(&self) -> u64 {
        (self.arguments.patience * 1000.0) as u64
    }

    fn wait_for_answers(&mut self) -> Result<bool, ConformanceError> {
        for _ in 0..self.patience_cycles() {
            self.cycles(1, Disturbance::default())?;
            if !self.observer.received.is_empty() || self.exchange_error.is_some() {
                break;
            }
        }
        Ok(!self.observer.received.is_empty())
    }

    /// Waits until the valve has been open for a while; moves the carriage when that takes long.
    fn wait_for_open_valve(&mut self) -> Result<bool, ConformanceError> {
        let mut open_cycles = 0;
        for waited in 1..=self.patience_cycles() {
            self.cycles(1, Disturbance::default())?;
            open_cycles = if self.observer.opening.abs() > OPEN { open_cycles + 1 } else { 0 };
            if open_cycles >= OPEN_CYCLES && waited > SETTLING_CYCLES {
                return Ok(true);
            }
            if self.exchange_error.is_some() {
                return Ok(false);
            }
            if waited % PUSH_EVERY_CYCLES == 0 {
                self.rig.push(PUSH_M);
            }
        }
        Ok(false)
    }

    fn phase(&self, from: u64) -> Phase<'_> {
        let first = self.cycles.partition_point(|(cycle, _)| *cycle < from);
        let received = self.observer.received.partition_point(|received| received.cycle < from);
        Phase { cycles: &self.cycles[first..], received: &self.observer.received[received..] }
    }

    fn answers_detail(&self) -> String {
        match (&self.exchange_error, self.observer.received.first()) {
            (_, Some(first)) => format!("the first frame came in cycle {}", first.cycle),
            (Some(ExchangeError::NobodyThere), _) => "nobody is in the barrier".into(),
            (Some(ExchangeError::TimedOut(name)), _) => format!("{name} did not answer cycle {}", self.cycle),
            (None, None) => format!("nothing came in {} cycles", self.cycle),
        }
    }

    /// Whether the controller ran to the end. A crash shuts the valve too, and must not pass for the right reaction.
    fn completion_case(&mut self, class: &str) -> Case {
        let ended = self.controller.as_mut().and_then(Controller::ended);
        let why = match (&self.exchange_error, ended) {
            (Some(error), _) => error.to_string(),
            (None, _) if self.observer.babbles() => {
                format!("it babbles, {} frames", self.observer.received.len())
            }
            (None, Some(status)) => format!("its process has ended: {status}"),
            (None, None) => {
                let detail = format!("{} cycles", self.cycles.len());
                return case(class, "to-the-end", CheckResult::Passed, detail);
            }
        };
        case(class, "to-the-end", CheckResult::Failed, format!("in cycle {}: {why}", self.cycle))
    }

    fn valve_shut_case(&self, class: &str) -> Case {
        let why = match &self.exchange_error {
            Some(error) => format!("in cycle {}: {error}", self.cycle),
            None => format!(
                "its valve did not open by more than {OPEN} for {OPEN_CYCLES} cycles within {} s: not judged; let it move",
                self.arguments.patience
            ),
        };
        case(class, "valve-shut", CheckResult::Failed, why)
    }
}

struct Controller(Child);

impl Controller {
    fn start(url: &BusUrl, arguments: &ConformanceArguments) -> Result<Option<Self>, ConformanceError> {
        let place = match url {
            BusUrl::Can { interface } => interface.clone(),
            BusUrl::Unix { path, .. } => path.display().to_string(),
        };
        let filled = |text: &std::ffi::OsString| match text.to_str() {
            Some(text) => text.replace("{bus}", &url.to_string()).replace("{path}", &place).into(),
            None => text.clone(),
        };
        let mut words = arguments.command.iter().map(filled);
        let Some(program) = words.next() else { return Ok(None) };
        let mut command = Command::new(&program);
        command.args(words).stdin(Stdio::null()).stdout(Stdio::null()).process_group(0);
        let child = command.spawn().map_err(|error| ConformanceError::Command {
            command: program.to_string_lossy().into_owned(),
            reason: error.to_string(),
        })?;
        Ok(Some(Self(child)))
    }

    fn ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().ok().flatten()
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        if self.ended().is_some() {
            // The process number may have been reused.
            return;
        }
        let _ = kill_process(Pid::from_child(&self.0), Signal::TERM);
        let until = Instant::now() + TERMINATION_TIMEOUT;
        while Instant::now() < until {
            if matches!(self.0.try_wait(), Ok(Some(_)) | Err(_)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct TemporaryFolder(std::path::PathBuf);

impl TemporaryFolder {
    fn new() -> io::Result<Self> {
        let folder = std::env::temp_dir().join(format!("airbench-check-{}", std::process::id()));
        std::fs::DirBuilder::new().mode(0o700).create(&folder)?;
        Ok(Self(folder))
    }

    fn url(&self) -> BusUrl {
        BusUrl::Unix { path: self.0.join("bus"), wire: WireOptions::default() }
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        // A failure leaves a folder in the temporary directory.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
