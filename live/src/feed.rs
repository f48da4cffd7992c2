//! The telemetry of an emulator as a viewer has it: connected whenever there is one, asked for nothing but commands.

use runlog::telemetry::{Decoder, Packet};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time between two attempts to connect.
const RETRY_PERIOD: Duration = Duration::from_millis(100);
/// Bytes taken in one turn: more than the emulator tells in 100 ms.
const READ_A_TURN: usize = 256 << 10;

pub(super) struct Feed {
    path: PathBuf,
    stream: Option<UnixStream>,
    decoder: Decoder,
    next_attempt: Instant,
    half_a_line: bool,
    bytes: Vec<u8>,
}

impl Feed {
    /// A feed from the emulator's socket at `path`; the first turn connects.
    pub(super) fn new(path: PathBuf) -> Self {
        Self {
            path,
            stream: None,
            decoder: Decoder::default(),
            next_attempt: Instant::now(),
            half_a_line: false,
            bytes: vec![0; READ_A_TURN],
        }
    }

    /// Hands out what has come, and connects if it is time to; whether the connection has gone, since the emulator ended or
    /// started anew.
    pub(super) fn turn(&mut self, mut take: impl FnMut(Packet)) -> bool {
        if std::mem::take(&mut self.half_a_line) {
            return self.part();
        }
        let Some(stream) = &mut self.stream else {
            self.try_to_connect();
            return false;
        };
        let read = match stream.read(&mut self.bytes) {
            Ok(read) if read > 0 => read,
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {
                return false;
            }
            Ok(_) | Err(_) => return self.part(),
        };
        self.decoder.take(&self.bytes[..read]);
        loop {
            match self.decoder.packet() {
                Ok(Some(packet)) => take(packet),
                Ok(None) => return false,
                Err(error) => {
                    eprintln!("bench watch: {}: {error}", self.path.display());
                    return self.part();
                }
            }
        }
    }

    /// Sends a command of the console; whether it left.
    pub(super) fn command(&mut self, line: &str) -> bool {
        let Some(stream) = &mut self.stream else { return false };
        match stream.write(format!("{line}\n").as_bytes()) {
            Ok(written) if written > line.len() => true,
            // Half a line would be the beginning of the next one; a new connection begins with none.
            Ok(_) => {
                self.half_a_line = true;
                false
            }
            // A socket that takes no line is that of an emulator that stands still.
            Err(_) => false,
        }
    }

    fn part(&mut self) -> bool {
        (self.stream, self.decoder) = (None, Decoder::default());
        self.next_attempt = Instant::now() + RETRY_PERIOD;
        true
    }

    fn try_to_connect(&mut self) {
        let now = Instant::now();
        if now >= self.next_attempt {
            self.next_attempt = now + RETRY_PERIOD;
            // Mostly nobody listens yet.
            self.stream = connected(&self.path).ok();
        }
    }
}

fn connected(path: &Path) -> rustix::io::Result<UnixStream> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    connect(&socket, &SocketAddrUnix::new(path)?)?;
    Ok(socket.into())
}
