//! An interface as a guest sees it: its name, its index, answers to ioctls, and the bus behind it.
//!
//! It behaves as a vcan after `ip link set vcan0 mtu 16`: classic CAN without CAN FD. It is up while its bus has a host.

use crate::bus_peer::BusPeer;
use rustix::io::Errno;
use std::path::Path;

/// `sizeof(struct ifreq)`.
pub(crate) const REQUEST_BYTES: usize = 40;
/// `IFNAMSIZ`.
const NAME_BYTES: usize = 16;

/// Requests of `ioctl` on an interface by its name; the first one asks for the name.
pub(crate) const SIOCGIFNAME: u32 = 0x8910;
const SIOCGIFFLAGS: u32 = 0x8913;
const SIOCGIFMETRIC: u32 = 0x891D;
const SIOCGIFMTU: u32 = 0x8921;
const SIOCGIFHWADDR: u32 = 0x8927;
const SIOCGIFINDEX: u32 = 0x8933;
const SIOCGIFTXQLEN: u32 = 0x8942;
const SIOCETHTOOL: u32 = 0x8946;
const SIOCSIFFLAGS: u32 = 0x8914;
const SIOCSIFMTU: u32 = 0x8922;
const SIOCSIFNAME: u32 = 0x8923;
const SIOCSIFHWADDR: u32 = 0x8924;
const SIOCSIFTXQLEN: u32 = 0x8943;

/// `IFF_NOARP`, which vcan has; and the flags of an interface that is up.
const NO_ARP: u16 = 0x80;
const UP_AND_RUNNING: u16 = 0x41;
/// `ARPHRD_CAN`, the type of the interface.
pub(crate) const HARDWARE: u16 = 280;
/// `CAN_MTU`.
pub(crate) const MTU: u32 = 16;
/// Length of vcan's transmit queue.
pub(crate) const TRANSMIT_QUEUE: u32 = 1000;

/// Lowest index of an interface, if it is free: above the usual indices of a machine.
const FIRST_INDEX: u32 = 100;

pub(crate) struct Interface {
    pub(crate) name: String,
    pub(crate) index: u32,
    pub(crate) bus: BusPeer,
    /// Whether the guests were notified that it is up.
    pub(crate) is_up: bool,
    /// Sockets of guests with a frame that waits for room at the bus.
    pub(crate) waiting: Vec<u64>,
}

impl Interface {
    pub(crate) fn new(name: &str, path: &Path, index: u32) -> Self {
        let bus = BusPeer::new(path);
        Self { name: name.into(), index, is_up: false, bus, waiting: Vec::new() }
    }

    /// The answer to a request with its name: the 24 bytes after the name; `None` for an unknown request.
    ///
    /// # Errors
    /// `EPERM` for requests that would change it, `EOPNOTSUPP` for those that a vcan lacks too.
    pub(crate) fn answer(&self, request: u32) -> Option<Result<Vec<u8>, Errno>> {
        let flags = if self.is_up { NO_ARP | UP_AND_RUNNING } else { NO_ARP };
        Some(Ok(match request {
            SIOCGIFINDEX => self.index.to_ne_bytes().to_vec(),
            SIOCGIFFLAGS => flags.to_ne_bytes().to_vec(),
            SIOCGIFMTU => MTU.to_ne_bytes().to_vec(),
            SIOCGIFTXQLEN => TRANSMIT_QUEUE.to_ne_bytes().to_vec(),
            SIOCGIFMETRIC => 0_u32.to_ne_bytes().to_vec(),
            // A `struct sockaddr` with the type in place of the family; there is no address.
            SIOCGIFHWADDR => [&HARDWARE.to_ne_bytes()[..], &[0; 14]].concat(),
            SIOCETHTOOL => return Some(Err(Errno::OPNOTSUPP)),
            SIOCSIFFLAGS | SIOCSIFMTU | SIOCSIFNAME | SIOCSIFHWADDR | SIOCSIFTXQLEN => {
                return Some(Err(Errno::PERM));
            }
            _ => return None,
        }))
    }

    /// Its name in the form of a request.
    pub(crate) fn name_field(&self) -> [u8; NAME_BYTES] {
        let mut field = [0; NAME_BYTES];
        field[..self.name.len()].copy_from_slice(self.name.as_bytes());
        field
    }
}

pub(crate) fn named<'a>(interfaces: &'a [Interface], request: &[u8; REQUEST_BYTES]) -> Option<&'a Interface> {
    let field = &request[..NAME_BYTES];
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(NAME_BYTES - 1);
    interfaces.iter().find(|interface| interface.name.as_bytes() == &field[..end])
}

/// Indices that no interface of this machine has, ascending.
pub(crate) fn free_indices() -> impl Iterator<Item = u32> {
    let socket =
        rustix::net::socket(rustix::net::AddressFamily::UNIX, rustix::net::SocketType::DGRAM, None).ok();
    let is_taken = move |index: &u32| {
        socket.as_ref().is_some_and(|socket| rustix::net::netdevice::index_to_name(socket, *index).is_ok())
    };
    (FIRST_INDEX..).filter(move |index| !is_taken(index))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_is_found_by_its_whole_name() {
        let interfaces = [Interface::new("vcan0", Path::new("/nowhere"), 100)];
        let request = |name: &str| {
            let mut request = [0; REQUEST_BYTES];
            request[..name.len()].copy_from_slice(name.as_bytes());
            request
        };
        assert_eq!(named(&interfaces, &request("vcan0")).map(|found| found.index), Some(100));
        for other in ["vcan", "vcan00", ""] {
            assert!(named(&interfaces, &request(other)).is_none(), "{other}");
        }
    }

    #[test]
    fn it_is_a_classic_interface_that_is_down_without_a_bus() {
        let interface = Interface::new("vcan0", Path::new("/nowhere"), 100);
        assert_eq!(interface.answer(SIOCGIFMTU), Some(Ok(16_u32.to_ne_bytes().to_vec())));
        assert_eq!(interface.answer(SIOCGIFFLAGS), Some(Ok(0x80_u16.to_ne_bytes().to_vec())));
        assert_eq!(interface.answer(SIOCSIFFLAGS), Some(Err(Errno::PERM)));
        assert_eq!(interface.answer(0x8912), None);
    }
}
