//! `bench can`: runs any SocketCAN program on embedded buses, on a machine whose kernel may have no CAN.
//!
//! The crate `socketcan-guest` answers the system calls; this module has the command line, the bus of a pair of programs
//! without a rig, and the exit code, which is that of the program.

pub(crate) mod cli;

use crate::warn;
use cli::{CanArguments, InterfaceArgument};
use protocol::bus::host::Host;
use protocol::bus::{BusError, BusUrl, HostThread};
use protocol::exit::Exit;
use realtime::{Interrupt, Request};
use socketcan_guest::{Guest, GuestError, NamedInterface};
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// The interface of `--bus`.
const FIRST_INTERFACE: &str = "vcan0";
/// Priority of the thread that answers: above programs without real-time priority, since one with real-time priority blocks in
/// its calls; below the rig, its host and its controllers.
const FIFO_PRIORITY: u8 = 1;
/// Period of the polls for the end while a bus is hosted.
const POLL_PERIOD: Duration = Duration::from_millis(20);

#[derive(Debug, thiserror::Error)]
pub(crate) enum CanError {
    /// A bus of the kernel.
    #[error("{0}: 'bench can' opens embedded buses, unix:///PATH; a program reaches {0} without it")]
    KernelBus(BusUrl),
    /// Two interfaces of one name.
    #[error("interface {0} is given twice")]
    Duplicate(String),
    /// Neither a program nor a bus to open.
    #[error("no command: bench can -- COMMAND ARGUMENT…, or bench can --pair to open a bus alone")]
    NoCommand,
    /// The bus of a pair.
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Guest(#[from] GuestError),
    /// The system gave no signal handler, or the host ended.
    #[error(transparent)]
    System(#[from] io::Error),
}

impl CanError {
    /// Exit code of the program.
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Bus(_) | Self::Guest(GuestError::NoHost { .. }) => Exit::BusFailed,
            _ => Exit::BadInput,
        }
    }
}

/// Runs the program; returns its exit code.
pub(crate) fn run(arguments: &CanArguments) -> ExitCode {
    match try_to_run(arguments) {
        Ok(code) => ExitCode::from(u8::try_from(code).unwrap_or(u8::MAX)),
        Err(error) => {
            warn(&error.to_string());
            error.exit().into()
        }
    }
}

fn try_to_run(arguments: &CanArguments) -> Result<i32, CanError> {
    let named = interfaces(arguments)?;
    if !arguments.pair {
        if arguments.command.is_empty() {
            return Err(CanError::NoCommand);
        }
        return run_program(arguments, &named);
    }
    let BusUrl::Unix { path, wire } = &arguments.bus else {
        return Err(CanError::KernelBus(arguments.bus.clone()));
    };
    let host = Host::bind(path, *wire, None)?;
    let host = HostThread::start(host, || realtime::acquire(&answering()));
    let ran = if arguments.command.is_empty() {
        wait_for_the_end(&arguments.bus)
    } else {
        run_program(arguments, &named)
    };
    let report = host.stop()?;
    if arguments.command.is_empty() {
        let dropped: u64 = report.peers.iter().map(|peer| peer.dropped_at_queue.total()).sum();
        warn(&format!("the bus carried {} frames; {dropped} did not fit the queue of a peer", report.frames));
    }
    ran
}

fn run_program(arguments: &CanArguments, named: &[NamedInterface]) -> Result<i32, CanError> {
    let guest = Guest {
        command: &arguments.command,
        patience: Duration::from_secs(arguments.wait_s.into()),
        ends_with_bus: arguments.end_with_bus,
    };
    let code = socketcan_guest::run(named, &guest, || {
        let _grants = realtime::acquire(&answering());
    })?;
    Ok(code.unwrap_or(Exit::Interrupted as i32))
}

/// Real-time request of the answering threads. An unprivileged user is refused, and the program runs without it.
fn answering() -> Request {
    Request::for_a_server(Some(FIFO_PRIORITY))
}

fn wait_for_the_end(bus: &BusUrl) -> Result<i32, CanError> {
    let interrupt = Interrupt::install()?;
    warn(&format!("hosting {bus}; Ctrl-C ends it"));
    while !interrupt.came() {
        std::thread::sleep(POLL_PERIOD);
    }
    Ok(Exit::Interrupted as i32)
}

/// The interfaces in order: those that are named, or the one of `--bus`.
fn interfaces(arguments: &CanArguments) -> Result<Vec<NamedInterface>, CanError> {
    let first = InterfaceArgument { name: FIRST_INTERFACE.into(), bus: arguments.bus.clone() };
    let asked =
        if arguments.interfaces.is_empty() { std::slice::from_ref(&first) } else { &arguments.interfaces };
    let mut named: Vec<NamedInterface> = Vec::new();
    for InterfaceArgument { name, bus } in asked {
        let path: PathBuf = match bus {
            BusUrl::Unix { path, .. } => path.clone(),
            BusUrl::Can { .. } => return Err(CanError::KernelBus(bus.clone())),
        };
        if named.iter().any(|other| other.name == *name) {
            return Err(CanError::Duplicate(name.clone()));
        }
        named.push(NamedInterface { name: name.clone(), path });
    }
    Ok(named)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;

    fn arguments(line: &str) -> CanArguments {
        match Cli::parse_from(line.split(' ')).command {
            Command::Can(arguments) => *arguments,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_first_interface_is_vcan0_unless_others_are_named() {
        let one = interfaces(&arguments("bench can --bus unix:///a -- x")).unwrap();
        assert_eq!(one, [NamedInterface { name: "vcan0".into(), path: "/a".into() }]);
        let two = "bench can --interface can0=unix:///a --interface can1=unix:///b -- x";
        let two: Vec<_> = interfaces(&arguments(two)).unwrap().into_iter().map(|named| named.name).collect();
        assert_eq!(two, ["can0", "can1"]);
    }

    #[test]
    fn what_cannot_be_is_refused_with_a_word_on_what_can() {
        for (line, hint) in [
            ("bench can --bus can://vcan0 -- x", "unix:///PATH"),
            ("bench can --interface a=unix:///a --interface a=unix:///b -- x", "twice"),
        ] {
            let refused = interfaces(&arguments(line)).unwrap_err();
            assert!(refused.to_string().contains(hint), "{line}: {refused}");
            assert_eq!(refused.exit(), Exit::BadInput);
        }
        assert!(matches!(try_to_run(&arguments("bench can")), Err(CanError::NoCommand)));
    }
}
