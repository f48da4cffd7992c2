//! The host's own end: the account is closed before the last peer goes.

use super::Host;
use std::io;

/// How long a wire that keeps time may still take for what waits in front of it, ns of its own clock: longer than two full
/// transmit queues.
const LAST_FRAMES_NS: u64 = 50_000_000;

impl Host {
    /// Frames that peers have sent are still carried to the peers that are there. Frames that they send from now on are refused,
    /// and the sender counts the refusal. So every frame of a peer was either accepted and carried, or refused.
    pub(super) fn close(&mut self) -> io::Result<()> {
        self.closing = true;
        for peer in self.peers.values() {
            // One that has gone meanwhile is read to its end like the others.
            let _ = rustix::net::shutdown(&peer.socket, rustix::net::Shutdown::Read);
        }
        let peers: Vec<_> = self.peers.keys().copied().collect();
        let wire_to_ns = self.wire_in_real_time().map(|timed| timed.time_ns(0));
        for id in &peers {
            while self.take_from(*id, wire_to_ns) {}
        }
        if let Some(to_ns) = wire_to_ns {
            self.advance_wire(to_ns + LAST_FRAMES_NS)?;
        }
        self.release_all();
        peers.into_iter().for_each(|id| self.remove(id));
        for (place, on_wire_by_then) in self.gone.drain(..) {
            self.report.peers[place].after_it_left.add_difference(&self.report.on_wire, &on_wire_by_then);
        }
        Ok(())
    }
}
