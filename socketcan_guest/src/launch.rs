//! Starts a program under the filter and serves it until it ends.
//!
//! A thread of this process takes the filter upon itself, and starts the program, which inherits it. What the thread itself
//! does while it starts the program is answered like a guest's calls. So the listener needs no way from one process to the other.
//!
//! The program does not outlive this process: the kernel kills it when the thread ends that started it (`PR_SET_PDEATHSIG`), so
//! the thread waits for the end of [`run`]. The program's own children are not reached so: without a listener their notified
//! calls get `ENOSYS`, and their sockets are at their end.

#![allow(unsafe_code)] // what the new process does before exec, nothing else

use crate::caller::Caller;
use crate::interface::{Interface, free_indices};
use crate::supervisor::{MOST_INTERFACES, Supervisor};
use crate::{Guest, GuestError, Named, filter};
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

/// How often a bus is looked for before the program starts.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Code of a program that a signal ended, above the signal's number, as shells have it.
const SIGNALLED: i32 = 128;

/// Signals that a person sends to this process and means for the program.
struct Signals {
    /// Of the keyboard: the program has had it too.
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

/// What the starting thread reports.
enum Started {
    /// The filter is in place; here its calls arrive.
    Listening(OwnedFd),
    /// The program runs, or could not be started.
    Program(io::Result<Child>),
}

/// Runs the guest so that its CAN sockets meet `interfaces`, each an embedded bus. `started` is called in the thread that answers
/// once the program runs: what it changes of the thread is not inherited. Gives the program's exit code, 128 and the signal's
/// number if a signal ended it; `None` when a person ended the waiting.
///
/// # Errors
/// [`GuestError`].
pub fn run(
    interfaces: &[Named],
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
    // What is refused here is refused for every guest: it is said now and not when the first of them opens a socket.
    let looked = Caller::new(here)
        .descriptor(0)
        .and_then(|_| Caller::new(here).read_array::<4>(&raw const here as u64));
    if let Err(error @ (Errno::PERM | Errno::ACCESS | Errno::NOSYS)) = looked {
        return Err(GuestError::Looking(error.into()));
    }
    let (report, reports) = channel();
    // Dropped when this function returns, whichever way.
    let (_still_here, end) = channel();
    let (command, name) = (guest.command.to_vec(), guest.command[0].clone());
    let starter = thread::spawn(move || start(&command, &report, &end)).thread().clone();
    let listener = match reports.recv() {
        Ok(Started::Listening(listener)) => listener,
        Ok(Started::Program(Err(error))) => return Err(GuestError::Filter(error)),
        Ok(Started::Program(Ok(_))) | Err(_) => {
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

/// True when all buses have a host; false when a person ended the waiting.
fn wait_for_hosts(
    interfaces: &mut [Interface],
    patience: Duration,
    signals: &Signals,
) -> Result<bool, GuestError> {
    let until = Instant::now() + patience;
    let mut told = false;
    loop {
        for interface in &mut *interfaces {
            interface.bus.look_for_host();
        }
        let Some(missing) = interfaces.iter().find(|interface| interface.bus.socket().is_none()) else {
            return Ok(true);
        };
        let path = missing.bus.path().display().to_string();
        if Instant::now() >= until {
            let waited_s = patience.as_secs();
            return Err(GuestError::NoHost { name: missing.name.clone(), path, waited_s });
        }
        if signals.is_over() {
            return Ok(false);
        }
        if !std::mem::replace(&mut told, true) {
            eprintln!("bench can: {} has no host yet at unix://{path}; waiting for it", missing.name);
        }
        thread::sleep(LOOK_EVERY);
    }
}

/// In a thread of its own, which the filter holds from then on, until the `end`.
fn start(command: &[OsString], report: &Sender<Started>, end: &Receiver<()>) {
    // Whoever waits for the reports is there until the last one.
    let _ = match filter::install() {
        Ok(listener) => {
            let _ = report.send(Started::Listening(listener));
            report.send(Started::Program(spawn(command)))
        }
        Err(error) => report.send(Started::Program(Err(error))),
    };
    // Returns when the sender is dropped: nothing is ever sent.
    let _ = end.recv();
}

/// Starts the program, which the kernel kills when the calling thread ends.
fn spawn(command: &[OsString]) -> io::Result<Child> {
    let parent = getpid();
    let end_with_parent = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // It may have ended before.
        if getppid() == Some(parent) { Ok(()) } else { Err(Errno::SRCH.into()) }
    };
    let mut program = Command::new(&command[0]);
    // SAFETY: between fork and exec it makes two system calls, and takes no lock and no memory.
    unsafe { program.args(&command[1..]).pre_exec(end_with_parent) }.spawn()
}

/// Answers the starting thread until the program runs.
fn serve_the_start(
    supervisor: &mut Supervisor,
    reports: &Receiver<Started>,
    name: &OsStr,
) -> Result<Child, GuestError> {
    let failed = |error| GuestError::Command { name: name.into(), error };
    loop {
        supervisor.turn_for(LOOK_EVERY).map_err(GuestError::System)?;
        match reports.try_recv() {
            Ok(Started::Program(Ok(child))) => return Ok(child),
            Ok(Started::Program(Err(error))) => return Err(failed(error)),
            Ok(Started::Listening(_)) => {}
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => {
                return Err(failed(io::Error::other("the thread that starts it has ended")));
            }
        }
    }
}

/// Each socket of a guest costs a descriptor here. The program has been started with the limit as it was.
fn raise_limit_of_files() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // Without it, `socket` fails earlier.
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
            // What a person had to say to the program is done with; Ctrl-C now means this process.
            signals.interrupted.store(false, Ordering::Relaxed);
            supervisor.finish(|| signals.is_over())?;
            return Ok(status);
        }
        let a_bus_went = std::mem::take(&mut supervisor.a_bus_went);
        if signals.terminated.swap(false, Ordering::Relaxed) || (ends_with_bus && a_bus_went) {
            // It may have ended meanwhile.
            let _ = kill_process(pid, Signal::TERM);
        }
    }
}
