//! Disturbances injected into a run in real time, whose causes `bench report` has to name from what the run left behind.
//!
//! Each is done from outside, as it happens to people: a debugger stops a process, another real-time program takes the CPU, a
//! customer's algorithm faults pages, a logger does not read, the wire loses frames, somebody sets the clock. The report is made
//! of the run's folder alone; `bench cause` sees the report alone.

use crate::binaries::Program;
use crate::c_algorithm;
use crate::launch::Pace;
use crate::process::Running;
use crate::records;
use crate::scene::{RESTLESS, Scene};
use realtime::Request;
use rustix::process::Signal;
use rustix::time::{ClockId, Timespec, clock_gettime, clock_settime};
use std::path::Path;
use std::time::{Duration, Instant};

/// Rows of the rig from which on a run is long enough; it goes on until the disturbance is over, however busy the machine is.
const ROWS: usize = 4000;
/// The end of a run that nobody interrupts.
const LONGEST_RUN_S: u64 = 120;
/// A process stands still for so long.
const STOP: Duration = Duration::from_millis(5);
/// Another program takes the CPU for so long, and so often.
const HOG: Duration = Duration::from_millis(8);
const HOGS: u32 = 3;
/// The wall clock is ahead by so much, until the rig has recorded so many rows more, and for so long after them: whoever records
/// also looks at the clock, and a step back that comes before the look leaves no trace.
const STEP_S: i64 = 3;
const STEP_ROWS: usize = 500;
const STEP_HOLDS: Duration = Duration::from_millis(200);
/// Where the rig's loop is pinned, and so where the hog goes.
const RIG_CPU: usize = 0;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Disturbance {
    Nothing,
    /// SIGSTOP of the rig's process for 5 ms.
    EmulatorStopped,
    /// SIGSTOP of the controllers' process for 5 ms.
    ControllerStopped,
    /// A thread of FIFO priority 99 on the rig's CPU, three times 8 ms.
    CpuContention,
    /// An own algorithm that touches fresh memory, 300 pages a cycle for 1.5 s.
    PageFaults,
    SlowListener,
    /// A wire that loses 1 % of the frames.
    FrameLoss,
    /// The wall clock is set ahead by 3 s and back.
    ClockStep,
}

impl Disturbance {
    /// All of them, each with what `bench cause` has to say.
    pub const ALL: [(Self, &str); 8] = [
        (Self::Nothing, "nothing"),
        (Self::EmulatorStopped, "emulator-stopped"),
        (Self::ControllerStopped, "controller-stopped"),
        (Self::CpuContention, "cpu-contention"),
        (Self::PageFaults, "page-faults"),
        (Self::SlowListener, "slow-listener"),
        (Self::FrameLoss, "frame-loss"),
        (Self::ClockStep, "clock-step"),
    ];

    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    pub fn needs_root(self) -> bool {
        matches!(self, Self::CpuContention | Self::ClockStep)
    }
}

#[derive(Clone, Debug)]
pub struct NamedCause {
    pub cause: String,
    pub sentence: String,
    /// The causes of all findings of the report, the named one among them.
    pub findings: Vec<String>,
}

/// Runs emulator and controller for some seconds with a disturbance after `after`, reports, and has the cause named.
pub fn run(disturbance: Disturbance, after: Duration) -> NamedCause {
    let scene = Scene::new(RESTLESS);
    if disturbance == Disturbance::PageFaults {
        c_algorithm::build_strictly(&scene, "tests/c/page_faults.c");
        scene.write("program.toml", c_algorithm::PROGRAM);
    }
    let out = scene.path("run");
    let wire = if disturbance == Disturbance::FrameLoss { "?loss=0.01&seed=1" } else { "" };
    let emulator = scene
        .emulator(Pace::Real)
        .bus(scene.url() + wire)
        .out(&out)
        .with(&format!("--full-timing --cpu {RIG_CPU} --seconds {LONGEST_RUN_S}"))
        .start();
    let controller = scene.controller(Pace::Real).out(&out).with("--full-timing --repeat").start();
    scene.wait_for_rows("run", 1000);
    std::thread::sleep(after);
    inject(disturbance, &scene, &emulator, &controller);
    scene.wait_for_rows("run", ROWS);
    // The rig says farewell, which the lossy wire may lose: then the controllers end by its silence.
    emulator.interrupt();
    controller.wait();
    name_cause(&out)
}

fn inject(disturbance: Disturbance, scene: &Scene, emulator: &Running, controller: &Running) {
    match disturbance {
        // The last two were there from the start.
        Disturbance::Nothing | Disturbance::PageFaults | Disturbance::FrameLoss => {}
        Disturbance::EmulatorStopped => stop(emulator),
        Disturbance::ControllerStopped => stop(controller),
        Disturbance::CpuContention => occupy_cpu(),
        Disturbance::SlowListener => {
            let listener = scene.peer();
            std::thread::sleep(Duration::from_millis(1500));
            drop(listener);
        }
        Disturbance::ClockStep => step_the_clock(scene),
    }
}

fn stop(process: &Running) {
    process.signal(Signal::STOP);
    std::thread::sleep(STOP);
    process.signal(Signal::CONT);
}

fn occupy_cpu() {
    let hog = std::thread::spawn(|| {
        let grants =
            realtime::acquire(&Request { fifo_priority: Some(99), cpu: Some(RIG_CPU), ..Request::default() });
        assert!(grants.refusals.is_empty(), "the hog needs root: {:?}", grants.refusals);
        for _ in 0..HOGS {
            let began = Instant::now();
            while began.elapsed() < HOG {
                std::hint::spin_loop();
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    hog.join().expect("the hog does not panic");
}

/// Sets the wall clock ahead and back again, by the monotonic clock, so that it shows the right time afterwards.
fn step_the_clock(scene: &Scene) {
    let ahead = |seconds: i64| {
        let now = clock_gettime(ClockId::Realtime);
        let then = Timespec { tv_sec: now.tv_sec + seconds, tv_nsec: now.tv_nsec };
        clock_settime(ClockId::Realtime, then).expect("root may set the clock");
    };
    ahead(STEP_S);
    scene.wait_for_more_rows("run", STEP_ROWS);
    std::thread::sleep(STEP_HOLDS);
    ahead(-STEP_S);
}

fn name_cause(out: &Path) -> NamedCause {
    let report = out.join("report");
    Program::Bench.start(&[&"report", &out, &"--out", &report]).wait().expect_code(0);
    let file = report.join("report.json");
    let named = Program::Bench.start(&[&"cause", &file]).wait().expect_code(0);
    let report = records::json(&file);
    let findings = report["findings"].as_array().expect("a report holds its findings");
    NamedCause {
        cause: named.stdout.trim().to_owned(),
        sentence: named.stderr.trim().to_owned(),
        findings: findings
            .iter()
            .map(|finding| finding["cause"].as_str().unwrap_or_default().to_owned())
            .collect(),
    }
}
