//! Starts a program under the filter and serves it until it ends.
//!
//! A thread of this process installs the filter and starts the program, which inherits it. The calls of the thread itself are
//! answered like those of a guest, so that the listener's descriptor need not be passed between processes.
//!
//! The program does not outlive this process: the kernel kills it at the end of the thread that started it
//! (`PR_SET_PDEATHSIG`), so the thread waits for the end of [`run`]. This does not reach the program's children: without a
//! listener their notified calls return `ENOSYS`, and their sockets are closed.

#![allow(unsafe_code)] // what the new process does before exec, nothing else

use crate::caller::Caller;
use crate::interface::{Interface, free_indices};
use crate::supervisor::{MOST_INTERFACES, Supervisor};
use crate::{Guest, GuestError, NamedInterface, filter};
use rustix::io::Errno;
use rustix::process::{
    Pid, PidfdFlags, Resource, Signal, getpid, getppid, getrlimit, kill_process, pidfd_open,
    set_parent_process_death_signal, setrlimit,
};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::ffi::{OsStr, OsString};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Period of the attempts to connect to a bus before the program starts.
const POLL_PERIOD: Duration = Duration::from_millis(20);

/// Base of the exit code of a program that a signal ended, as in a shell.
const SIGNALLED: i32 = 128;

/// Signals to this process that are meant for the program.
struct Signals {
    /// From the keyboard: the program has received it too.
    interrupted: Arc<AtomicBool>,
    terminated: Arc<AtomicBool>,
}

impl Signals {
    fn catch() -> io::Result<Self> {
        let signals = Self { interrupted: Arc::default(), terminated: Arc::default() };
        flag::register(SIGINT, Arc::clone(&signals.interrupted))?;
        flag::register(SIGTERM, Arc::clone(&signals.terminated))?;
        Ok(signals)
    }

    fn is_over(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed) || self.terminated.load(Ordering::Relaxed)
    }
}

/// Reports of the starting thread.
enum StartReport {
    /// The filter is installed; its notifications arrive here.
    Listening(OwnedFd),
    /// The program runs, or could not be started.
    Program(io::Result<Child>),
}

/// Runs the guest with `interfaces`, each an embedded bus, as its CAN interfaces. `started` is called in the answering thread
/// once the program runs: the program does not inherit what it changes of the thread. Returns the program's exit code, 128 and
/// the signal's number if a signal ended it; `None` when the user interrupted the wait for a host.
///
/// # Errors
/// [`GuestError`].
pub fn run(
    interfaces: &[NamedInterface],
    guest: &Guest<'_>,
    started: impl FnOnce(),
) -> Result<Option<i32>, GuestError> {
    if interfaces.len() > MOST_INTERFACES {
        return Err(GuestError::TooMany(MOST_INTERFACES));
    }
    let signals = Signals::catch().map_err(GuestError::System)?;
    let named = interfaces.iter().zip(free_indices());
    let mut interfaces: Vec<_> =
        named.map(|(named, index)| Interface::new(&named.name, &named.path, index)).collect();
    if !wait_for_hosts(&mut interfaces, guest.patience, &signals)? {
        return Ok(None);
    }
    let here = rustix::thread::gettid().as_raw_nonzero().get();
    // A missing permission affects every guest: it is detected now and not at the first socket.
    let looked = Caller::new(here)
        .descriptor(0)
        .and_then(|_| Caller::new(here).read_array::<4>(&raw const here as u64));
    if let Err(error @ (Errno::PERM | Errno::ACCESS | Errno::NOSYS)) = looked {
        return Err(GuestError::ProcessAccess(error.into()));
    }
    let (report, reports) = channel();
    // Dropped when this function returns.
    let (_still_here, end) = channel();
    let (command, name) = (guest.command.to_vec(), guest.command[0].clone());
    let starter = thread::spawn(move || start(&command, &report, &end)).thread().clone();
    let listener = match reports.recv() {
        Ok(StartReport::Listening(listener)) => listener,
        Ok(StartReport::Program(Err(error))) => return Err(GuestError::Filter(error)),
        Ok(StartReport::Program(Ok(_))) | Err(_) => {
            unreachable!("the filter comes first, and {starter:?} reports")
        }
    };
    let mut supervisor = Supervisor::new(listener, interfaces).map_err(GuestError::System)?;
    let mut child = serve_the_start(&mut supervisor, &reports, &name)?;
    raise_limit_of_files();
    started();
    let status =
        serve(&mut supervisor, &mut child, &signals, guest.ends_with_bus).map_err(GuestError::System)?;
    supervisor.account();
    Ok(Some(status.code().unwrap_or_else(|| SIGNALLED + status.signal().unwrap_or(0))))
}

/// True when all buses have a host; false when the user interrupted the wait.
fn wait_for_hosts(
    interfaces: &mut [Interface],
    patience: Duration,
    signals: &Signals,
) -> Result<bool, GuestError> {
    let until = Instant::now() + patience;
    let mut announced = false;
    loop {
        for interface in &mut *interfaces {
            interface.bus.try_to_connect();
        }
        let Some(missing) = interfaces.iter().find(|interface| interface.bus.socket().is_none()) else {
            return Ok(true);
        };
        let path = missing.bus.path.display().to_string();
        if Instant::now() >= until {
            let waited_s = patience.as_secs();
            return Err(GuestError::NoHost { name: missing.name.clone(), path, waited_s });
        }
        if signals.is_over() {
            return Ok(false);
        }
        if !std::mem::replace(&mut announced, true) {
            eprintln!("bench can: {} has no host yet at unix://{path}; waiting for it", missing.name);
        }
        thread::sleep(POLL_PERIOD);
    }
}

/// In a thread of its own, which keeps the filter until the `end`.
fn start(command: &[OsString], report: &Sender<StartReport>, end: &Receiver<()>) {
    // The receiver of the reports lives until the last one.
    let _ = match filter::install() {
        Ok(listener) => {
            let _ = report.send(StartReport::Listening(listener));
            report.send(StartReport::Program(spawn(command)))
        }
        Err(error) => report.send(StartReport::Program(Err(error))),
    };
    // Returns when the sender is dropped: nothing is ever sent.
    let _ = end.recv();
}

/// Starts the program, which the kernel kills at the end of the calling thread.
fn spawn(command: &[OsString]) -> io::Result<Child> {
    let parent = getpid();
    let end_with_parent = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // The parent may have ended before.
        if getppid() == Some(parent) { Ok(()) } else { Err(Errno::SRCH.into()) }
    };
    let mut program = Command::new(&command[0]);
    // SAFETY: between fork and exec it makes two system calls, and takes no lock and no memory.
    unsafe { program.args(&command[1..]).pre_exec(end_with_parent) }.spawn()
}

/// Answers the starting thread until the program runs.
fn serve_the_start(
    supervisor: &mut Supervisor,
    reports: &Receiver<StartReport>,
    name: &OsStr,
) -> Result<Child, GuestError> {
    let failed = |error| GuestError::Command { name: name.into(), error };
    loop {
        supervisor.turn_for(POLL_PERIOD).map_err(GuestError::System)?;
        match reports.try_recv() {
            Ok(StartReport::Program(Ok(child))) => return Ok(child),
            Ok(StartReport::Program(Err(error))) => return Err(failed(error)),
            Ok(StartReport::Listening(_)) | Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => {
                return Err(failed(io::Error::other("the thread that starts it has ended")));
            }
        }
    }
}

/// Each socket of a guest needs a descriptor here. The program has the original limit.
fn raise_limit_of_files() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // Without it `socket` fails earlier.
    let _ = setrlimit(Resource::Nofile, limit);
}

fn serve(
    supervisor: &mut Supervisor,
    child: &mut Child,
    signals: &Signals,
    ends_with_bus: bool,
) -> io::Result<ExitStatus> {
    let pid = Pid::from_child(child);
    let end = pidfd_open(pid, PidfdFlags::empty())?;
    supervisor.watch_child(end.as_fd())?;
    loop {
        if supervisor.turn()? {
            let status = child.wait()?;
            // The signals for the program were handled; from now on Ctrl-C means this process.
            signals.interrupted.store(false, Ordering::Relaxed);
            supervisor.finish(|| signals.is_over())?;
            return Ok(status);
        }
        let bus_lost = std::mem::take(&mut supervisor.bus_lost);
        if signals.terminated.swap(false, Ordering::Relaxed) || (ends_with_bus && bus_lost) {
            // The program may have ended meanwhile.
            let _ = kill_process(pid, Signal::TERM);
        }
    }
}
