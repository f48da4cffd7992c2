//! The gateway among clients that mean it no good: many, slow, half there, babbling, or of another protocol.
//!
//! What must hold: bounded memory, a well-behaved client beside them that misses nothing, and an account of it all.

use protocol::can::CanFrame;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::time::Duration;
use system_tests::gateway::{GatewayClient, GatewayProcess};
use system_tests::{Peer, Scene, count, find, wait_until};

/// What the gateway may need over what it had before, KiB: 32 clients with full queues would be 14 MiB.
const MORE_MEMORY_KIB: u64 = 24 << 10;

/// Sends numbered frames, no faster than the client takes them, which must miss none.
fn misses_nothing(peer: &Peer, client: &mut GatewayClient, numbers: std::ops::Range<u32>) {
    for n in numbers {
        peer.send(&CanFrame::new(0x5A5, &n.to_be_bytes()).to_bytes());
        if n % 256 == 255 {
            (n - 255..=n).for_each(|n| assert_eq!(client.frame(), ("5A5".into(), format!("{n:08X}"))));
        }
    }
}

#[test]
fn a_thousand_connections_leave_the_memory_and_the_clients_as_they_were() {
    let (scene, _host, peer) = Scene::with_bus();
    let mut gateway = GatewayProcess::open(&scene, "");
    let mut good = GatewayClient::connect_raw(&gateway);
    misses_nothing(&peer, &mut good, 0..256);
    let before_kib = gateway.peak_memory_kib();

    let many: Vec<TcpStream> =
        (0..1000).map(|_| TcpStream::connect(gateway.address).expect("a place in the queue")).collect();
    misses_nothing(&peer, &mut good, 256..1024);
    gateway.wait_for_times("connections refused so far", 1);
    // Those who were let in say half a word and stay; the others have been parted with.
    for stream in &many {
        let _ = { stream }.write(b"< op");
    }
    misses_nothing(&peer, &mut good, 1024..2048);
    let more_kib = gateway.peak_memory_kib() - before_kib;
    assert!(more_kib < MORE_MEMORY_KIB, "{more_kib} KiB more for a thousand connections");

    drop(many);
    // There is room again.
    wait_until("a client after the thousand", || {
        let mut client = GatewayClient::connect(&gateway);
        client.receive().as_deref() == Some("< hi >")
    });
    let report = gateway.close();
    assert_eq!(count(&report, "/clients_at_a_time_max"), 32);
    assert!(count(&report, "/connections_refused") >= 1000 - 31, "{report:#}");
    assert_eq!(count(&report, "/frames_lost"), 0);
}

/// What was counted of the client that came from this connection.
fn of_client<'a>(report: &'a Value, stream: &TcpStream) -> &'a Value {
    let address = stream.local_addr().expect("connected").to_string();
    find(&report["clients"], "address", &address)
}

#[test]
fn a_client_that_does_not_read_loses_frames_alone_and_each_is_counted() {
    const FRAMES: u32 = 1 << 17;
    let (scene, _host, peer) = Scene::with_bus();
    let mut gateway = GatewayProcess::open(&scene, "--queue-frames 1000");
    let slow: Vec<GatewayClient> = (0..4).map(|_| GatewayClient::connect_raw(&gateway)).collect();
    let half_open = GatewayClient::connect_raw(&gateway);
    half_open.stream.shutdown(Shutdown::Write).expect("half of it");
    let mut good = GatewayClient::connect_raw(&gateway);
    gateway.wait_for_times("is on the bus", 6);
    let before_kib = gateway.peak_memory_kib();
    misses_nothing(&peer, &mut good, 0..FRAMES);
    let more_kib = gateway.peak_memory_kib() - before_kib;
    assert!(more_kib < MORE_MEMORY_KIB, "{more_kib} KiB more for clients that do not read");
    gateway.wait_for_times("reads too slowly", 4);

    let report = gateway.close();
    for client in &slow {
        let counted = of_client(&report, &client.stream);
        let (had, lost) = (count(counted, "/frames_to_client"), count(counted, "/frames_lost"));
        assert_eq!(had + lost, u64::from(FRAMES), "{counted}");
        assert!(lost > 0, "{counted}");
    }
    assert_eq!(count(of_client(&report, &good.stream), "/frames_lost"), 0);
    assert_eq!(of_client(&report, &half_open.stream)["ended"], "by-client");
}

#[test]
fn babble_and_other_protocols_are_parted_with_and_put_nothing_on_the_bus() {
    let (scene, _host, peer) = Scene::with_bus();
    let gateway = GatewayProcess::open(&scene, "");
    let mut good = GatewayClient::connect_raw(&gateway);
    let post = "POST /x HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n< open bus >< rawmode >< send 108 2 1 0 >";
    let flood = "< x >".repeat(10_000);
    let other_bus = "< open can7 >< send 108 2 1 0 >";
    for (text, why) in [(post, "not-the-protocol"), (&flood, "too-many-refused"), (other_bus, "unknown-bus")]
    {
        let mut client = GatewayClient::connect(&gateway);
        // It may be parted with before it has said all.
        let _ = client.stream.write_all(text.as_bytes());
        assert!(client.is_disconnected(), "{why}");
    }
    let mut random = Pcg64Mcg::seed_from_u64(7);
    for _ in 0..200 {
        let mut bytes = [0; 512];
        random.fill_bytes(&mut bytes);
        bytes[0] = b'<';
        let mut client = GatewayClient::connect(&gateway);
        let _ = client.stream.write_all(&bytes);
    }
    // Who asks and does not read the answers.
    let mut asking = GatewayClient::connect_raw(&gateway);
    asking.stream.set_write_timeout(Some(Duration::from_millis(200))).expect("a time-out");
    let echoes = "< echo >".repeat(1000);
    let before_kib = gateway.peak_memory_kib();
    for _ in 0..5000 {
        if asking.stream.write_all(echoes.as_bytes()).is_err() {
            break;
        }
    }
    let more_kib = gateway.peak_memory_kib() - before_kib;
    assert!(more_kib < MORE_MEMORY_KIB, "{more_kib} KiB more");
    misses_nothing(&peer, &mut good, 0..256);
    assert_eq!(peer.receive(Duration::from_millis(50)), None, "something was put on the bus");
    let report = gateway.close();
    assert_eq!(count(&report, "/frames_from_clients"), 0);
    let ended: Vec<_> =
        report["clients"].as_array().unwrap().iter().map(|client| client["ended"].clone()).collect();
    for why in ["reads-nothing", "by-client"] {
        assert!(ended.contains(&why.into()), "{why} is not in {ended:?}");
    }
}
