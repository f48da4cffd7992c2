//! The spin-gap probe: a thread on each CPU that reads the clock continuously and records when it could not.
//!
//! A process that wakes late cannot tell whether the machine stood still or another thread had the CPU. A spinning thread
//! can: all processes share `CLOCK_MONOTONIC`, so its gaps can be compared with the late cycles of the same run.
//!
//! ```text
//!   a thread for each CPU (SCHED_IDLE, pinned)          main
//!     read clock … gap! ── bounded queue, try_send ──►  polls, writes probe.csv, ends on a signal
//! ```
//! # Effect on the machine
//! The CPUs never idle, so there is no exit from sleep states and no rescheduling by the hypervisor: wake-ups get *faster*. A
//! sibling hyperthread loses up to half its speed, and a shared power budget gets tighter. SCHED_IDLE yields to every other
//! thread at once. The probe therefore explains runs; figures that are claimed are measured without it.
//!
//! # Limits
//! While the thread under observation has the CPU, the probe of that CPU has not: a stall in that time shows as a gap in which
//! another thread ran. If the whole machine stalls, the probes of the other CPUs show it.
//!
//! # Source
//! The idea is that of `hwlat_detector` (`Documentation/trace/hwlat_detector.rst` of the kernel) and of `sysjitter`, from user
//! space and with interrupts enabled.

pub(crate) mod cli;
mod gaps;

use crate::say;
use cli::ProbeArguments;
use crossbeam_channel::{Receiver, Sender, bounded};
use gaps::{GapDetector, GapTotal};
use protocol::exit::Exit;
use realtime::privileges::parse_cpu_list;
use realtime::signals::Continued;
use realtime::vitals::VitalsReader;
use realtime::{Clock, Interrupt, MonotonicClock, Request};
use runlog::probe::{Gap, write_head, write_row};
use runlog::run_folder::LineFile;
use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use thread_priority::{
    NormalThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};

/// Capacity of the queue of gaps: what all CPUs can produce in several periods of the writer.
const QUEUE: usize = 65_536;
const WRITE_PERIOD: Duration = Duration::from_millis(50);
/// Most rows of the table, so that a forgotten probe does not fill the disk.
const MOST_ROWS: u64 = 2_000_000;

/// Why the probe cannot run.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProbeError {
    #[error("--cpus {0}: not a list of CPUs such as 0-3,8")]
    Cpus(String),
    #[error("CPU {cpu}: {reason}")]
    Thread { cpu: usize, reason: String },
    #[error("cannot write the gaps: {0}; choose another file with --out")]
    Write(io::Error),
    #[error("cannot watch for signals: {0}")]
    Signals(io::Error),
}

/// Sums of the gaps of one CPU, by cause.
#[derive(Clone, Copy, Debug, Default)]
struct CpuGaps {
    stood_still: GapTotal,
    another_ran: GapTotal,
}

/// State shared by the spinning threads and the writer.
struct ProbeState {
    stop: Interrupt,
    dropped: AtomicU64,
}

pub(crate) fn run(arguments: &ProbeArguments) -> Result<Exit, ProbeError> {
    let cpus = cpus(arguments.cpus.as_deref())?;
    let interrupt = Interrupt::install().map_err(ProbeError::Signals)?;
    let continued = Continued::install().map_err(ProbeError::Signals)?;
    let mut file = LineFile::create(&arguments.out).map_err(ProbeError::Write)?;
    write_head(file.lines()).and_then(|()| file.write_out()).map_err(ProbeError::Write)?;
    // A page fault would be a gap caused by the probe.
    realtime::acquire(&Request { lock_memory: true, ..Request::default() });

    let state = ProbeState { stop: Interrupt::default(), dropped: AtomicU64::new(0) };
    let (sender, gaps) = bounded(QUEUE);
    let began_ns = MonotonicClock.now().as_nanos();
    let mut table =
        Table { file, rows: 0, by_cpu: cpus.iter().map(|&cpu| (cpu as u64, CpuGaps::default())).collect() };
    std::thread::scope(|scope| {
        let (ready, all_ready) = bounded(cpus.len());
        for &cpu in &cpus {
            let (sender, ready, continued, state) =
                (sender.clone(), ready.clone(), continued.clone(), &state);
            let gap_ns = arguments.gap_us * 1000;
            scope.spawn(move || {
                let begun = begin(cpu);
                let good = begun.is_ok();
                // The first reading comes before the report, so that no gap after the report is missed.
                let looking = SpinningThread::begin(cpu, gap_ns, continued);
                // The main thread takes one result of each.
                let _ = ready.send(begun);
                if good {
                    looking.spin(&sender, state);
                }
            });
        }
        drop((sender, ready));
        let begun = all_ready.iter().take(cpus.len()).collect::<Result<(), _>>();
        let reported = begun.and_then(|()| {
            table.name_cpus(&cpus, MonotonicClock.now().as_nanos())?;
            eprintln!("bench: probe watches {}, gaps over {} us", named(&cpus), arguments.gap_us);
            let until_ns = arguments.seconds.map(|seconds| began_ns + (seconds * 1e9) as u64);
            let time_up = || until_ns.is_some_and(|until_ns| MonotonicClock.now().as_nanos() >= until_ns);
            while !time_up() && !interrupt.came() {
                std::thread::sleep(WRITE_PERIOD);
                table.take(&gaps)?;
            }
            Ok(())
        });
        state.stop.ask();
        reported
    })?;
    // A gap that was open at the end was recorded when its thread ran again.
    table.take(&gaps)?;
    let Table { rows, by_cpu, .. } = table;
    print_sums(&by_cpu, MonotonicClock.now().as_nanos() - began_ns);
    let dropped = state.dropped.load(Ordering::Relaxed);
    if dropped > 0 {
        eprintln!("bench: warning: {dropped} gaps were seen and not kept: the queue to the writer was full");
    }
    if rows > MOST_ROWS {
        eprintln!(
            "bench: warning: the table ends after {MOST_ROWS} of {rows} gaps; ask for longer ones with --gap-us"
        );
    }
    Ok(if interrupt.came() { Exit::Interrupted } else { Exit::Good })
}

fn cpus(list: Option<&str>) -> Result<Vec<usize>, ProbeError> {
    let Some(list) = list else {
        let allowed = rustix::thread::sched_getaffinity(None).map_err(|errno| ProbeError::Thread {
            cpu: 0,
            reason: format!("cannot read the CPU affinity ({errno}); name the CPUs with --cpus"),
        })?;
        return Ok((0..rustix::thread::CpuSet::MAX_CPU).filter(|&cpu| allowed.is_set(cpu)).collect());
    };
    parse_cpu_list(list).filter(|cpus| !cpus.is_empty()).ok_or_else(|| ProbeError::Cpus(list.into()))
}

/// Pins the calling thread to its CPU, at the lowest priority.
fn begin(cpu: usize) -> Result<(), ProbeError> {
    let grants = realtime::acquire(&Request { cpu: Some(cpu), ..Request::default() });
    if let Some(refusal) = grants.refusals.first() {
        return Err(ProbeError::Thread { cpu, reason: refusal.to_string() });
    }
    let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, idle).map_err(|error| {
        ProbeError::Thread {
            cpu,
            reason: format!("SCHED_IDLE was refused: {error:?}; without it the probe disturbs"),
        }
    })
}

struct SpinningThread {
    vitals: VitalsReader,
    detector: GapDetector,
}

impl SpinningThread {
    fn begin(cpu: usize, gap_ns: u64, continued: Continued) -> Self {
        let vitals = VitalsReader::new(continued);
        Self { vitals, detector: GapDetector::new(cpu as u64, gap_ns, MonotonicClock.now().as_nanos()) }
    }

    fn spin(mut self, gaps: &Sender<Gap>, state: &ProbeState) {
        let mut going_on = true;
        while going_on {
            // Checked before the clock is read, so that a gap that outlasts the run is recorded too.
            going_on = !state.stop.came();
            if let Some(gap) = self.detector.look(MonotonicClock.now().as_nanos(), || self.vitals.read())
                && gaps.try_send(gap).is_err()
            {
                state.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// The table on the disk, and the sums of its rows.
struct Table {
    file: LineFile,
    rows: u64,
    by_cpu: BTreeMap<u64, CpuGaps>,
}

impl Table {
    /// A row of zero length for each CPU: observed from here on, with or without gaps.
    fn name_cpus(&mut self, cpus: &[usize], now_ns: u64) -> Result<(), ProbeError> {
        for cpu in cpus {
            let row = Gap::beginning(*cpu as u64, now_ns);
            write_row(self.file.lines(), &row).map_err(ProbeError::Write)?;
        }
        self.file.write_out().map_err(ProbeError::Write)
    }

    /// Writes the waiting gaps.
    fn take(&mut self, gaps: &Receiver<Gap>) -> Result<(), ProbeError> {
        for gap in gaps.try_iter() {
            self.rows += 1;
            let of_cpu = self.by_cpu.entry(gap.cpu).or_default();
            if gap.another_ran { &mut of_cpu.another_ran } else { &mut of_cpu.stood_still }.add(&gap);
            if self.rows <= MOST_ROWS {
                let written = write_row(self.file.lines(), &gap);
                written.and_then(|()| self.file.write_when_full()).map_err(ProbeError::Write)?;
            }
        }
        self.file.write_out().map_err(ProbeError::Write)
    }
}

fn print_sums(by_cpu: &BTreeMap<u64, CpuGaps>, length_ns: u64) {
    let part = |total: &GapTotal| {
        let share_percent = 100.0 * total.together_ns as f64 / length_ns.max(1) as f64;
        format!("{:>7}  {:>10.1}  {share_percent:>7.3}", total.count, total.longest_ns as f64 / 1e3)
    };
    say("       the CPU stood still             another thread ran");
    say("  CPU     gaps  longest us   time %       gaps  longest us   time %");
    for (cpu, CpuGaps { stood_still, another_ran }) in by_cpu {
        say(&format!("{cpu:>5}  {}    {}", part(stood_still), part(another_ran)));
    }
}

fn named(cpus: &[usize]) -> String {
    let list = cpus.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    if cpus.len() == 1 { format!("CPU {list}") } else { format!("CPUs {list}") }
}
