//! A process without a descriptor left: the host turns newcomers away, and neither turns without rest nor harms the others.
//!
//! In a test binary of its own, because the limit is that of the whole process.

use protocol::bus::WireOptions;
use protocol::bus::host::Host;
use protocol::can::CanFrame;
use rustix::fs::{Mode, OFlags};
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use rustix::time::{ClockId, clock_gettime};
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

fn socket() -> OwnedFd {
    let socket =
        rustix::net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
            .unwrap();
    let limit = Some(Duration::from_secs(10));
    rustix::net::sockopt::set_socket_timeout(&socket, rustix::net::sockopt::Timeout::Recv, limit).unwrap();
    socket
}

/// Length of the next packet; 0 when the host has closed.
fn next_length(socket: &OwnedFd) -> usize {
    let mut bytes = [0_u8; 16];
    rustix::net::recv(socket, &mut bytes, RecvFlags::empty()).expect("the host answers in time").0
}

fn processor_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ProcessCPUTime)).unwrap()
}

/// Ends the host's thread also when the test fails.
struct StopWhenDropped<'a>(&'a AtomicBool);

impl Drop for StopWhenDropped<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_host_without_descriptors_turns_newcomers_away_and_serves_the_others() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("bus0");
    let host = Host::bind(&path, WireOptions::default(), None).unwrap();
    let stop = AtomicBool::new(false);
    let address = SocketAddrUnix::new(&path).unwrap();
    let frame = CanFrame::new(0x110, &[1]).to_bytes();
    std::thread::scope(|scope| {
        scope.spawn(|| host.serve(&stop).unwrap());
        let _stop = StopWhenDropped(&stop);
        let [one, two, three, early, late] = [(); 5].map(|()| socket());
        rustix::net::connect(&one, &address).unwrap();
        rustix::net::connect(&two, &address).unwrap();
        // Sent by the second, so both are in when it is heard.
        rustix::net::send(&two, &frame, SendFlags::NOSIGNAL).unwrap();
        assert_eq!(next_length(&one), 16);

        let before = getrlimit(Resource::Nofile);
        setrlimit(Resource::Nofile, Rlimit { current: Some(64), ..before }).unwrap();
        let null = || rustix::fs::open("/dev/null", OFlags::CLOEXEC, Mode::empty());
        let hoard: Vec<_> = std::iter::from_fn(|| null().ok()).collect();
        for newcomer in [&three, &early] {
            rustix::net::connect(newcomer, &address).unwrap();
            assert_eq!(next_length(newcomer), 0, "turned away");
            // A test that sleeps through the wait uses next to nothing of it; a host that spins uses all.
            let used = processor_time();
            std::thread::sleep(Duration::from_millis(300));
            let used = processor_time() - used;
            assert!(used < Duration::from_millis(150), "the host used {used:?} of 300 ms");
            rustix::net::send(&two, &frame, SendFlags::NOSIGNAL).unwrap();
            assert_eq!(next_length(&one), 16);
        }
        drop(hoard);
        setrlimit(Resource::Nofile, before).unwrap();

        rustix::net::connect(&late, &address).unwrap();
        rustix::net::send(&late, &frame, SendFlags::NOSIGNAL).unwrap();
        assert_eq!(next_length(&one), 16, "with descriptors again, newcomers are let in");
    });
}
