//! The client end of the emulator's telemetry: connects whenever there is an emulator, and sends console lines.

use super::client::is_not_ready;
use runlog::telemetry::{Decoder, Packet};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time between two attempts to connect.
const RETRY_PERIOD: Duration = Duration::from_millis(100);
/// Bytes read in one poll: more than the emulator sends in 100 ms.
const BYTES_PER_POLL: usize = 256 << 10;

pub(super) struct TelemetryClient {
    path: PathBuf,
    stream: Option<UnixStream>,
    decoder: Decoder,
    next_attempt: Instant,
    partial_line_sent: bool,
    bytes: Vec<u8>,
}

impl TelemetryClient {
    /// A client of the emulator's socket at `path`; the first poll connects.
    pub(super) fn new(path: PathBuf) -> Self {
        Self {
            path,
            stream: None,
            decoder: Decoder::default(),
            next_attempt: Instant::now(),
            partial_line_sent: false,
            bytes: vec![0; BYTES_PER_POLL],
        }
    }

    /// Passes on what was received, and connects when an attempt is due. Returns whether the connection has ended because the
    /// emulator ended or restarted.
    pub(super) fn poll(&mut self, mut take: impl FnMut(Packet)) -> bool {
        if std::mem::take(&mut self.partial_line_sent) {
            return self.disconnect();
        }
        let Some(stream) = &mut self.stream else {
            self.try_to_connect();
            return false;
        };
        let read = match stream.read(&mut self.bytes) {
            Ok(read) if read > 0 => read,
            Err(error) if is_not_ready(&error) => return false,
            Ok(_) | Err(_) => return self.disconnect(),
        };
        self.decoder.take(&self.bytes[..read]);
        loop {
            match self.decoder.packet() {
                Ok(Some(packet)) => take(packet),
                Ok(None) => return false,
                Err(error) => {
                    eprintln!("bench watch: {}: {error}", self.path.display());
                    return self.disconnect();
                }
            }
        }
    }

    /// Sends a console line; returns whether it was sent.
    pub(super) fn command(&mut self, line: &str) -> bool {
        let Some(stream) = &mut self.stream else { return false };
        match stream.write(format!("{line}\n").as_bytes()) {
            Ok(written) if written > line.len() => true,
            // Part of a line would corrupt the next one, so the connection is closed; a new one begins without input.
            Ok(_) => {
                self.partial_line_sent = true;
                false
            }
            // A full socket belongs to an emulator that does not run.
            Err(_) => false,
        }
    }

    fn disconnect(&mut self) -> bool {
        (self.stream, self.decoder) = (None, Decoder::default());
        self.next_attempt = Instant::now() + RETRY_PERIOD;
        true
    }

    fn try_to_connect(&mut self) {
        let now = Instant::now();
        if now >= self.next_attempt {
            self.next_attempt = now + RETRY_PERIOD;
            // Fails until an emulator listens.
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
