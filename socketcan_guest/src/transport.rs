//! Sockets of the transport protocol, `CAN_ISOTP`: their addresses, and the calls that send and wait.
//!
//! One message is sent at a time. A further call waits, as does one that requests the result (`CAN_ISOTP_WAIT_TX_DONE`); native
//! writes, of 8 and 16 bytes, wait in the guest's queue and, some hundred of them, here. A guest that closes the socket or ends
//! does not truncate a message. The kernel makes `close` wait; here the next socket of the same channel waits instead. Queued
//! messages are sent as long as the peer answers.
//!
//! Source: Linux 6.1 `net/can/isotp.c` (`isotp_bind`, `isotp_sendmsg`, `isotp_release`).

use crate::abi::{self, u32_at};
use crate::caller::Caller;
use crate::isotp::{Event, Identifiers, IsoTp, LONGEST_PDU};
use crate::notification::{Answer, Notification};
use crate::socket::{GuestSocket, Kind, MessageMetadata};
use crate::supervisor::{Supervisor, wall_clock_ns};
use rustix::io::Errno;
use std::collections::{BTreeSet, VecDeque};
use std::os::fd::BorrowedFd;
use std::time::Instant;

/// Bytes of an address with both identifiers: `CAN_REQUIRED_SIZE(struct sockaddr_can, can_addr.tp)`.
pub(crate) const ADDRESS_BYTES: usize = 16;
/// Most frames sent in a row without a gap, so that others have their turn.
const BURST: usize = 16;
/// Most messages of a socket that wait here, about as many as its queue holds; further ones stay in that queue.
const MOST_WAITING: usize = 300;

/// A sending call: its notification, and its return value on success.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SendingCall {
    pub(crate) id: u64,
    pub(crate) value: i64,
    /// Whether it may wait for the message before it.
    pub(crate) may_wait: bool,
}

/// State of a transport socket besides its protocol.
#[derive(Debug, Default)]
pub(crate) struct Transport {
    pub(crate) protocol: IsoTp,
    /// Messages that wait for the one in transfer, with their calls; native ones have none.
    waiting: VecDeque<(Option<SendingCall>, Vec<u8>)>,
    /// The call that waits for the end of the message in transfer.
    awaiting_end: Option<SendingCall>,
}

impl Transport {
    /// Whether a message is in transfer or waits.
    fn has_more_to_send(&self) -> bool {
        self.protocol.is_sending() || !self.waiting.is_empty()
    }

    /// Whether no further message may wait.
    pub(crate) fn is_full(&self) -> bool {
        self.waiting.len() >= MOST_WAITING
    }

    /// Drops waiting native messages; returns their number.
    pub(crate) fn forget_native(&mut self) -> usize {
        let before = self.waiting.len();
        self.waiting.retain(|(call, _)| call.is_some());
        before - self.waiting.len()
    }

    /// Puts a message back that the bus did not accept, as the next one.
    pub(crate) fn put_back(&mut self, message: &[u8]) {
        self.waiting.push_front((None, message.to_vec()));
    }

    /// The call that gets an error: the one that waits for the end, or the next, whose message is not sent then.
    fn take_call_for_an_error(&mut self) -> Option<SendingCall> {
        let next = self.waiting.front().and_then(|(call, _)| *call).filter(|_| self.awaiting_end.is_none());
        if next.is_some() {
            self.waiting.pop_front();
        }
        self.awaiting_end.take().or(next)
    }

    /// The address of the channel: family, interface, both identifiers.
    pub(crate) fn address(&self, interface: u32) -> [u8; ADDRESS_BYTES] {
        let mut address = [0; ADDRESS_BYTES];
        address[..abi::ADDRESS_BYTES].copy_from_slice(&abi::address(interface));
        if let Some(Identifiers { sent, received }) = self.protocol.identifiers {
            address[8..12].copy_from_slice(&received.to_ne_bytes());
            address[12..].copy_from_slice(&sent.to_ne_bytes());
        }
        address
    }
}

impl Supervisor {
    fn transport(&mut self, inode: u64) -> Option<&mut Transport> {
        self.sockets.get_mut(&inode)?.transport_mut()
    }

    /// `bind` of a transport socket: to an interface and two identifiers.
    pub(crate) fn bind_transport(
        &mut self,
        notification: &Notification,
        inode: u64,
    ) -> Result<Answer, Errno> {
        if notification.int(2) < ADDRESS_BYTES as i32 {
            return Err(Errno::INVAL);
        }
        let address: [u8; ADDRESS_BYTES] =
            Caller::new(notification.thread).read_array(notification.arguments[1])?;
        let interface = abi::interface_of(&address).ok_or(Errno::INVAL)?;
        let wanted = Identifiers { received: u32_at(&address, 8), sent: u32_at(&address, 12) };
        let known = self.interfaces.iter().find(|known| known.index == interface);
        let (is_interface, is_down) = (known.is_some(), known.is_some_and(|known| !known.is_up));
        let Some(transport) = self.transport(inode) else { return Ok(Answer::Continue) };
        let protocol = &mut transport.protocol;
        protocol.check(wanted)?;
        if interface == 0 {
            return Err(Errno::NODEV);
        }
        protocol.bind(wanted, is_interface)?;
        if let Some(socket) = self.sockets.get_mut(&inode) {
            socket.interface = Some(interface);
        }
        if is_down {
            self.deliver_error(inode, interface, Errno::NETDOWN);
        }
        Ok(Answer::Value(0))
    }

    /// Sends a message for a call, which may have to wait.
    pub(crate) fn send_transport(
        &mut self,
        inode: u64,
        end: BorrowedFd<'_>,
        message: Vec<u8>,
        call: SendingCall,
    ) -> Result<Answer, Errno> {
        // A call that a signal ended is repeated by its caller; its message was withdrawn and must not be sent too.
        self.forget_dead_senders();
        let transport = self.transport(inode).ok_or(Errno::BADF)?;
        if transport.protocol.identifiers.is_none() {
            return Err(Errno::ADDRNOTAVAIL);
        }
        if transport.has_more_to_send() || self.is_behind_another(inode) {
            if !call.may_wait {
                return Err(Errno::AGAIN);
            }
            self.wait_to_send(inode, Some(call), message);
            return Ok(Answer::Deferred);
        }
        // An unread error is reported to the next sender.
        let has_length = (1..=LONGEST_PDU).contains(&message.len());
        let error =
            self.sockets.get_mut(&inode).filter(|_| has_length).and_then(|socket| socket.take_error(end));
        error.map_or_else(|| self.start_for(inode, &message, call), Err)
    }

    /// Sends a native message, after those that wait.
    pub(crate) fn send_transport_natively(&mut self, inode: u64, message: &[u8]) -> Result<(), Errno> {
        let transport = self.transport(inode).ok_or(Errno::BADF)?;
        if transport.has_more_to_send() || self.is_behind_another(inode) {
            self.wait_to_send(inode, None, message.to_vec());
            return Ok(());
        }
        self.start_transport(inode, message)
    }

    fn wait_to_send(&mut self, inode: u64, call: Option<SendingCall>, message: Vec<u8>) {
        if let Some(transport) = self.transport(inode) {
            transport.waiting.push_back((call, message));
        }
        self.watch_socket(inode, false);
    }

    fn others_of_channel(&self, inode: u64) -> impl Iterator<Item = (u64, &GuestSocket, &Transport)> {
        let channel_of =
            |socket: &GuestSocket| Some((socket.interface?, socket.transport()?.protocol.identifiers?));
        let channel = self.sockets.get(&inode).and_then(channel_of);
        let others = self.sockets.iter().filter(move |(other, socket)| {
            **other != inode && channel.is_some() && channel_of(socket) == channel
        });
        others.filter_map(|(inode, socket)| Some((*inode, socket, socket.transport()?)))
    }

    /// Whether a closed socket of the same channel has a message in transfer.
    fn is_behind_another(&self, inode: u64) -> bool {
        self.others_of_channel(inode)
            .any(|(_, socket, transport)| transport.protocol.is_sending() && socket.has_hung_up())
    }

    fn start_for(&mut self, inode: u64, message: &[u8], call: SendingCall) -> Result<Answer, Errno> {
        self.start_transport(inode, message)?;
        Ok(match self.transport(inode) {
            Some(transport) if transport.protocol.is_sending() && transport.protocol.waits_for_the_end() => {
                transport.awaiting_end = Some(call);
                Answer::Deferred
            }
            _ => Answer::Value(call.value),
        })
    }

    /// Sends the first or only frame of a message. Native writes stay in the queue until the last frame.
    pub(crate) fn start_transport(&mut self, inode: u64, message: &[u8]) -> Result<(), Errno> {
        let interface = self.sockets.get(&inode).and_then(|socket| socket.interface).unwrap_or(0);
        let transport = self.transport(inode).ok_or(Errno::BADF)?;
        let frame = transport.protocol.start(message, Instant::now())?;
        let is_long = transport.protocol.is_sending();
        if is_long {
            // Before the frame: its answer may end the message at once.
            self.watch_socket(inode, false);
        }
        let sent = self.send_frame(inode, interface, &frame);
        if sent.is_err() {
            self.transport(inode).ok_or(Errno::BADF)?.protocol.give_up();
            self.watch_socket(inode, true);
        }
        sent
    }

    /// Sends the consecutive frames that are due, and ends expired transfers.
    pub(crate) fn advance_transport(&mut self, inode: u64, now: Instant) {
        let Some(socket) = self.sockets.get(&inode) else { return };
        let (Some(interface), Kind::Transport(_)) = (socket.interface, &socket.kind) else { return };
        let (mut events, mut has_sent) = (Vec::new(), false);
        for _ in 0..BURST {
            let due = self.transport(inode).and_then(|transport| transport.protocol.take_due(now));
            let Some((frame, before)) = due else { break };
            has_sent = true;
            if self.send_frame(inode, interface, &frame).is_err()
                && let Some(transport) = self.transport(inode)
            {
                transport.protocol.put_back(before, now, &mut events);
            }
        }
        let Some(transport) = self.transport(inode) else { return };
        transport.protocol.advance(now, &mut events);
        if has_sent || !events.is_empty() {
            self.carry_out_transport(inode, events);
        }
    }

    /// Processes events of the protocol, and continues with what waited for them.
    pub(crate) fn carry_out_transport(&mut self, inode: u64, events: Vec<Event>) {
        let interface = self.sockets.get(&inode).and_then(|socket| socket.interface).unwrap_or(0);
        for event in events {
            match event {
                // As in the kernel: frames that the interface does not accept are lost.
                Event::Reply(frame) => {
                    let _ = self.send_frame(inode, interface, &frame);
                }
                Event::Received(message) => {
                    self.deliver(inode, &message, MessageMetadata::new(interface, wall_clock_ns()));
                }
                Event::ReceivingFailed(error) => self.deliver_error(inode, interface, error),
                Event::SendingFailed(error) => {
                    let call = self.transport(inode).and_then(Transport::take_call_for_an_error);
                    match call {
                        Some(call) => _ = self.listener.answer(call.id, Answer::Error(error)),
                        None => self.deliver_error(inode, interface, error),
                    }
                    if error == Errno::COMM {
                        self.forget_what_nobody_answers(inode);
                    }
                }
            }
        }
        self.go_on_transport(inode);
    }

    /// On a closed socket each message without an answer would block the channel, and the end of this process, for a second.
    fn forget_what_nobody_answers(&mut self, inode: u64) {
        let Some(socket) = self.sockets.get_mut(&inode).filter(|socket| socket.has_hung_up()) else { return };
        let forgotten = socket.forget_unsent();
        if forgotten > 0 {
            self.refused_late += forgotten;
            self.warn_once(
                "no peer answers an ISO-TP message of a closed socket; the messages queued behind it are dropped",
            );
        }
    }

    /// Answers the call that waited for the end of a message, and sends the next one; without one, of another socket of the
    /// channel.
    pub(crate) fn go_on_transport(&mut self, inode: u64) {
        let mut left = BTreeSet::from([inode]);
        while let Some(inode) = left.pop_first() {
            self.send_next(inode);
            let has_more = self.transport(inode).is_some_and(|transport| transport.has_more_to_send());
            self.watch_socket(inode, !has_more);
            if !has_more {
                let others = self.others_of_channel(inode);
                left.extend(
                    others.filter(|(_, _, other)| !other.waiting.is_empty()).map(|(other, ..)| other),
                );
            }
        }
    }

    fn send_next(&mut self, inode: u64) {
        while let Some(transport) = self.transport(inode).filter(|transport| !transport.protocol.is_sending())
        {
            let done = transport.awaiting_end.take();
            if let Some(call) = done {
                self.listener.answer(call.id, Answer::Value(call.value));
            }
            if self.is_behind_another(inode) {
                break;
            }
            let next = self.transport(inode).and_then(|transport| transport.waiting.pop_front());
            let Some((call, message)) = next else { break };
            match call {
                None => {
                    let sent = self.start_transport(inode, &message);
                    self.note_native(inode, &message, sent);
                    if sent == Err(Errno::NOBUFS) {
                        break;
                    }
                }
                // A signal may have ended it.
                Some(call) if self.listener.is_alive(call.id) => {
                    let answer = self.start_for(inode, &message, call).unwrap_or_else(Answer::Error);
                    self.listener.answer(call.id, answer);
                }
                Some(_) => {}
            }
        }
    }

    /// After a signal, a call that waited for the end of a message withdraws the message, as in the kernel.
    pub(crate) fn forget_dead_senders(&mut self) {
        let mut ended = Vec::new();
        for (inode, socket) in &mut self.sockets {
            let Some(transport) = socket.transport_mut() else { continue };
            let waited = transport.waiting.len();
            transport.waiting.retain(|(call, _)| call.is_none_or(|call| self.listener.is_alive(call.id)));
            let mut has_ended = transport.waiting.len() < waited;
            if transport.awaiting_end.is_some_and(|call| !self.listener.is_alive(call.id)) {
                transport.awaiting_end = None;
                transport.protocol.give_up();
                has_ended = true;
            }
            // Also one that only waited: its socket may be closed by now, and is checked again.
            if has_ended {
                ended.push(*inode);
            }
        }
        ended.into_iter().for_each(|inode| self.go_on_transport(inode));
    }
}

impl GuestSocket {
    pub(crate) fn transport(&self) -> Option<&Transport> {
        match &self.kind {
            Kind::Transport(transport) => Some(transport),
            Kind::Raw(_) | Kind::Bcm(_) => None,
        }
    }

    pub(crate) fn transport_mut(&mut self) -> Option<&mut Transport> {
        match &mut self.kind {
            Kind::Transport(transport) => Some(transport),
            Kind::Raw(_) | Kind::Bcm(_) => None,
        }
    }

    /// Whether a message is in transfer or waits.
    pub(crate) fn has_more_to_send(&self) -> bool {
        self.transport().is_some_and(Transport::has_more_to_send)
    }
}
