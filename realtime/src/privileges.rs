//! What a real-time thread asks of the system, what it got, and what to do about the rest.
//!
//! A 1 kHz loop on a desktop is late for reasons that can be switched off one by one: another thread runs (FIFO
//! priority), the thread moves (pinning), a page is not there (locked memory), the CPU is in a deep sleep (DMA latency),
//! the kernel gathers timers to save power (timer slack; measured in November 2026: median 77 us with it, 25 us without,
//! without FIFO). Each needs a right that a user may not have. A refusal never ends a run: it is a warning with a remedy,
//! and it stands in the run's record, so that nobody wonders about the figures later.
//!
//! # Order
//! Threads inherit priority, CPU and timer slack from the one that starts them. So start the helpers first, and call
//! [`acquire`] on the real-time thread itself. Memory is locked for the whole process.
//!
//! # Source
//! `man 7 sched`, `man 2 mlockall`, `man 2 prctl` (`PR_SET_TIMERSLACK`), and in the kernel's tree
//! `Documentation/power/pm_qos_interface.rst`.

use crate::machine::text::stored_as_text;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::num::NonZeroU64;
use std::ops::RangeInclusive;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id, thread_schedule_policy_param,
};

/// Priorities of SCHED_FIFO on Linux, the larger the more urgent. [man 7 sched]
pub const FIFO_PRIORITIES: RangeInclusive<u8> = 1..=99;

const DMA_LATENCY_FILE: &str = "/dev/cpu_dma_latency";
const ONLINE_CPUS_FILE: &str = "/sys/devices/system/cpu/online";

/// Real-time settings that a thread requests.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// SCHED_FIFO with this priority, 1 to 99, for the calling thread.
    pub fifo_priority: Option<u8>,
    /// The only CPU that the calling thread may run on.
    pub cpu: Option<usize>,
    /// All memory of the process, now and later, stays in RAM.
    pub lock_memory: bool,
    /// No CPU goes into a sleep that takes time to leave, for as long as the [`Grants`] live.
    pub dma_latency: bool,
    /// The kernel wakes the calling thread on time, not up to 50 us later; only matters without FIFO.
    pub timer_slack: bool,
}

impl Request {
    /// Everything that a 1 ms loop wants.
    #[must_use]
    pub fn for_a_loop(fifo_priority: u8, cpu: Option<usize>) -> Self {
        Self {
            fifo_priority: Some(fifo_priority),
            cpu,
            lock_memory: true,
            dma_latency: true,
            timer_slack: true,
        }
    }

    /// What a thread asks for that answers others: a bus host, an answering thread.
    #[must_use]
    pub fn for_a_server(fifo_priority: Option<u8>) -> Self {
        Self { fifo_priority, timer_slack: true, ..Self::default() }
    }
}

/// Something that the system gave. Its text is the line in the records of a run, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum Grant {
    /// All memory of the process, now and later, stays in RAM.
    LockedMemory,
    /// No CPU goes into a sleep that takes time to leave.
    DmaLatency,
    /// The kernel wakes the thread at most this much late without FIFO, ns.
    TimerSlack(u64),
    /// The only CPU that the thread may run on.
    Cpu(usize),
    /// SCHED_FIFO with this priority.
    Fifo(u8),
    /// A line that this version does not write.
    Other(String),
}

impl Grant {
    /// The only CPU that the thread may run on.
    #[must_use]
    pub fn cpu(&self) -> Option<usize> {
        if let Self::Cpu(cpu) = self { Some(*cpu) } else { None }
    }

    /// The priority under SCHED_FIFO.
    #[must_use]
    pub fn fifo_priority(&self) -> Option<u8> {
        if let Self::Fifo(priority) = self { Some(*priority) } else { None }
    }
}

impl fmt::Display for Grant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LockedMemory => write!(f, "memory locked, current and future"),
            Self::DmaLatency => write!(f, "{DMA_LATENCY_FILE} held at 0 us"),
            Self::TimerSlack(slack_ns) => write!(f, "timer slack {slack_ns} ns"),
            Self::Cpu(cpu) => write!(f, "pinned to CPU {cpu}"),
            Self::Fifo(priority) => write!(f, "SCHED_FIFO priority {priority}"),
            Self::Other(line) => write!(f, "{line}"),
        }
    }
}

impl From<&str> for Grant {
    fn from(line: &str) -> Self {
        let slack_ns = || line.strip_prefix("timer slack ")?.strip_suffix(" ns")?.parse().ok();
        let cpu = || line.strip_prefix("pinned to CPU ")?.parse().ok();
        let priority = || line.strip_prefix("SCHED_FIFO priority ")?.parse().ok();
        let fixed =
            [Self::LockedMemory, Self::DmaLatency].into_iter().find(|grant| grant.to_string() == line);
        fixed
            .or_else(|| slack_ns().map(Self::TimerSlack))
            .or_else(|| cpu().map(Self::Cpu))
            .or_else(|| priority().map(Self::Fifo))
            .unwrap_or_else(|| Self::Other(line.to_owned()))
    }
}

stored_as_text!(Grant);

/// Granted and refused requests. Dropping it gives the DMA latency back; the rest stays.
#[derive(Debug, Default)]
pub struct Grants {
    /// Keeps the CPUs out of deep sleep while it is open.
    dma_latency: Option<File>,
    /// Granted requests, for the run's record.
    pub granted: Vec<Grant>,
    /// Refused requests, to be shown to a person.
    pub refusals: Vec<Refusal>,
}

impl Grants {
    fn note(&mut self, outcome: Result<Grant, Refusal>) {
        match outcome {
            Ok(grant) => self.granted.push(grant),
            Err(refusal) => self.refusals.push(refusal),
        }
    }
}

/// Something that the system did not give. Displays as one line that a person can act on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Refused request.
    pub what: &'static str,
    /// Why it was not given.
    pub reason: String,
    /// Remedy for a person.
    pub remedy: &'static str,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, reason, remedy } = self;
        write!(f, "no {what}: {reason}; {remedy}")
    }
}

/// Asks the system for everything in `request`, for the calling thread and its process.
pub fn acquire(request: &Request) -> Grants {
    let mut grants = Grants::default();
    // Memory first, so that later steps run on locked pages; FIFO last, so that setting up disturbs nobody.
    if request.lock_memory {
        grants.note(lock_memory());
    }
    if request.dma_latency {
        let outcome = hold_dma_latency().map(|file| {
            grants.dma_latency = Some(file);
            Grant::DmaLatency
        });
        grants.note(outcome);
    }
    if request.timer_slack {
        grants.note(shorten_timer_slack());
    }
    if let Some(cpu) = request.cpu {
        grants.note(pin(cpu));
    }
    if let Some(priority) = request.fifo_priority {
        grants.note(set_fifo(priority));
    }
    grants
}

fn lock_memory() -> Result<Grant, Refusal> {
    const REMEDY: &str = "run as root, or: setcap cap_ipc_lock+ep PROGRAM, or 'memlock unlimited' for this user in \
                          /etc/security/limits.d and a new login";
    let refusal = |reason| Refusal { what: "locked memory", reason, remedy: REMEDY };
    // With a limit the lock may succeed now and make an allocation fail later, in the middle of a run: "future" pages
    // count against it. So under a limit it is not even tried.
    let may_exceed =
        rustix::thread::capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    if let (Some(limit), false) = (getrlimit(Resource::Memlock).current, may_exceed) {
        return Err(refusal(format!(
            "this user may lock {} KiB only, and a later allocation beyond that would fail",
            limit / 1024
        )));
    }
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|errno| refusal(errno.to_string()))?;
    Ok(Grant::LockedMemory)
}

fn hold_dma_latency() -> Result<File, Refusal> {
    let open = || -> io::Result<File> {
        let mut file = OpenOptions::new().write(true).open(DMA_LATENCY_FILE)?;
        // A 32-bit number in the machine's byte order; the wish lasts while the file is open.
        file.write_all(&0_i32.to_ne_bytes())?;
        Ok(file)
    };
    open().map_err(|error| Refusal {
        what: "DMA latency of 0 us",
        reason: format!("{DMA_LATENCY_FILE}: {error}"),
        remedy: "run as root, or give this user write access to the file by a udev rule; \
                 without it an idle CPU may take long to wake",
    })
}

fn shorten_timer_slack() -> Result<Grant, Refusal> {
    let refusal = |reason| Refusal {
        what: "timer slack of 1 ns",
        reason,
        remedy: "ask for FIFO priority instead, which has no timer slack",
    };
    rustix::thread::set_current_timer_slack(NonZeroU64::new(1))
        .map_err(|errno| refusal(errno.to_string()))?;
    match rustix::thread::current_timer_slack() {
        // A thread that is real-time already has 0.
        Ok(slack_ns @ 0..=1) => Ok(Grant::TimerSlack(slack_ns)),
        Ok(slack_ns) => Err(refusal(format!("it stayed at {slack_ns} ns"))),
        Err(errno) => Err(refusal(errno.to_string())),
    }
}

fn pin(cpu: usize) -> Result<Grant, Refusal> {
    let refusal = |reason| Refusal {
        what: "CPU of its own",
        reason,
        remedy: "ask for a CPU that is listed; in a container or service, widen its cpuset",
    };
    let online = online_cpus();
    // The mask of the C library holds 1024 CPUs, and core_affinity panics beyond: so look before asking.
    if !online.contains(&cpu) || cpu >= CpuSet::MAX_CPU {
        return Err(refusal(format!("CPU {cpu} does not exist, online are {}", listed(&online))));
    }
    let accepted = core_affinity::set_for_current(core_affinity::CoreId { id: cpu });
    // It says only yes or no, so the mask is read back: it must hold this CPU and no other.
    match rustix::thread::sched_getaffinity(None) {
        Ok(mask) if accepted && mask.count() == 1 && mask.is_set(cpu) => Ok(Grant::Cpu(cpu)),
        Ok(mask) => {
            let allowed: Vec<usize> = (0..CpuSet::MAX_CPU).filter(|&cpu| mask.is_set(cpu)).collect();
            Err(refusal(format!(
                "CPU {cpu} was not given, the thread may run on {} (online are {})",
                listed(&allowed),
                listed(&online)
            )))
        }
        Err(errno) => Err(refusal(format!("CPU {cpu}: the affinity cannot be read back: {errno}"))),
    }
}

/// The CPUs that the kernel can run something on, or those that this thread may use if /sys is not mounted.
fn online_cpus() -> Vec<usize> {
    std::fs::read_to_string(ONLINE_CPUS_FILE).ok().and_then(|text| parse_cpu_list(&text)).unwrap_or_else(
        || {
            let allowed = core_affinity::get_core_ids().unwrap_or_default();
            allowed.into_iter().map(|core| core.id).collect()
        },
    )
}

/// Reads the kernel's list format, as in `0-3,8`; `None` when it is something else.
#[must_use]
pub fn parse_cpu_list(text: &str) -> Option<Vec<usize>> {
    let mut cpus = Vec::new();
    for part in text.trim().split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        cpus.extend(first.parse::<usize>().ok()?..=last.parse().ok()?);
    }
    Some(cpus)
}

fn listed(cpus: &[usize]) -> String {
    cpus.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

fn set_fifo(priority: u8) -> Result<Grant, Refusal> {
    let refusal = |reason: String, remedy| Refusal { what: "FIFO priority", reason, remedy };
    let (lowest, highest) = (FIFO_PRIORITIES.start(), FIFO_PRIORITIES.end());
    if !FIFO_PRIORITIES.contains(&priority) {
        let reason = format!("{priority} is outside {lowest} to {highest}");
        return Err(refusal(reason, "ask for a priority in that range; 80 is usual for such a loop"));
    }
    const RIGHTS: &str = "run as root, or: setcap cap_sys_nice+ep PROGRAM, or 'rtprio 99' for this user in \
                          /etc/security/limits.d and a new login";
    let failed = |error| refusal(format!("{priority}: {}", reason_of(error)), RIGHTS);
    let value = ThreadPriorityValue::try_from(priority).expect("1 to 99 was checked above");
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let thread = thread_native_id();
    set_thread_priority_and_policy(thread, ThreadPriority::Crossplatform(value), policy).map_err(failed)?;
    match thread_schedule_policy_param(thread).map_err(failed)? {
        (got, parameters) if got == policy && parameters.sched_priority == i32::from(priority) => {
            Ok(Grant::Fifo(priority))
        }
        (got, parameters) => Err(refusal(
            format!("{priority}: the thread has {got:?} {} instead", parameters.sched_priority),
            RIGHTS,
        )),
    }
}

/// The operating system's words for its number.
fn reason_of(error: thread_priority::Error) -> String {
    match error {
        thread_priority::Error::OS(number) => io::Error::from_raw_os_error(number).to_string(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_asked_is_nothing_granted_and_nothing_refused() {
        let grants = acquire(&Request::default());
        assert!(grants.granted.is_empty() && grants.refusals.is_empty() && grants.dma_latency.is_none());
    }

    #[test]
    fn a_cpu_that_does_not_exist_is_refused_with_those_that_do() {
        for cpu in [10_000, usize::MAX] {
            let grants = acquire(&Request { cpu: Some(cpu), ..Request::default() });
            let [refusal] = grants.refusals.as_slice() else {
                panic!("one refusal, not {:?}", grants.refusals)
            };
            let line = refusal.to_string();
            let online = listed(&online_cpus());
            assert!(line.contains(&format!("CPU {cpu} does not exist, online are {online}; ")), "{line}");
            assert!(!refusal.remedy.is_empty() && !line.contains('\n'));
            assert!(grants.granted.is_empty());
        }
    }

    #[test]
    fn a_priority_out_of_range_is_refused_with_the_range() {
        for priority in [0, 100, 255] {
            let grants = acquire(&Request { fifo_priority: Some(priority), ..Request::default() });
            let [refusal] = grants.refusals.as_slice() else {
                panic!("one refusal, not {:?}", grants.refusals)
            };
            let start = format!("no FIFO priority: {priority} is outside 1 to 99; ask for");
            assert!(refusal.to_string().starts_with(&start), "{refusal}");
        }
    }

    #[test]
    fn pinning_to_a_cpu_that_is_allowed_is_read_back() {
        let cpu = core_affinity::get_core_ids().expect("an affinity")[0].id;
        // On a thread of its own: the pin would stay on the test's.
        let granted = std::thread::spawn(move || {
            acquire(&Request { cpu: Some(cpu), ..Request::default() }).granted.clone()
        });
        let granted = granted.join().expect("no panic");
        assert_eq!(granted, [Grant::Cpu(cpu)]);
        assert_eq!(granted[0].to_string(), format!("pinned to CPU {cpu}"));
    }

    #[test]
    fn whatever_is_asked_is_either_granted_or_refused_with_a_remedy() {
        let outcome = std::thread::spawn(|| {
            let all = Request {
                fifo_priority: Some(1),
                cpu: Some(0),
                lock_memory: true,
                dma_latency: true,
                timer_slack: true,
            };
            let grants = acquire(&all);
            (grants.granted.len(), grants.refusals.clone())
        });
        let (granted, refusals) = outcome.join().expect("no panic");
        assert_eq!(granted + refusals.len(), 5);
        assert!(refusals.iter().all(|refusal| !refusal.reason.is_empty() && !refusal.remedy.is_empty()));
    }

    #[test]
    fn a_grant_is_read_from_the_line_that_a_record_holds() {
        let lines = [
            (Grant::LockedMemory, "memory locked, current and future"),
            (Grant::DmaLatency, "/dev/cpu_dma_latency held at 0 us"),
            (Grant::TimerSlack(1), "timer slack 1 ns"),
            (Grant::Cpu(3), "pinned to CPU 3"),
            (Grant::Fifo(80), "SCHED_FIFO priority 80"),
            (Grant::Other("pinned to CPU 0 and 1".into()), "pinned to CPU 0 and 1"),
        ];
        for (grant, line) in lines {
            let json = serde_json::to_string(&grant).unwrap();
            assert_eq!(json, format!("\"{line}\""));
            assert_eq!(serde_json::from_str::<Grant>(&json).unwrap(), grant);
        }
    }

    #[test]
    fn the_kernels_cpu_list_is_read() {
        assert_eq!(parse_cpu_list("0-3,8\n"), Some(vec![0, 1, 2, 3, 8]));
        assert_eq!(parse_cpu_list("0"), Some(vec![0]));
        assert_eq!(parse_cpu_list(""), None);
        assert_eq!(parse_cpu_list("all"), None);
    }
}
