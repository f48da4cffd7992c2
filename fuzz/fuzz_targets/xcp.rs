//! XCP commands: any packets get an answer or none, nothing is written without the key, and what is written is a number.
//!
//! Half of the sessions begin unlocked, since no fuzzer finds the key: it is writing, arming and loading that do most. They end
//! as others do, with a DISCONNECT or with a CONNECT.
#![no_main]

use xcp::alone::slave;
use xcp::image::ParameterActions;
use xcp::lock;
use xcp::signals::COUNT;
use xcp::slave::Slave;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

/// A key that is not in the seeds.
const SECRET: &[u8] = b"known to no fuzzer";
/// Made once: the A2L file that comes with it takes milliseconds.
static LOCKED: LazyLock<Slave> = LazyLock::new(|| slave(Some(SECRET)));
static OPEN: LazyLock<Slave> = LazyLock::new(|| unlocked(LOCKED.clone()));

/// Connects and unlocks.
fn unlocked(mut slave: Slave) -> Slave {
    let mut say = |packet: &[u8]| slave.command(packet, 0, &mut AccessChecker { open: false });
    say(&[0xFF, 0]);
    let [first, second] = [0, 1].map(|rest| say(&[0xF8, rest, 1]).expect("a seed"));
    let seed = [&first[2..8], &second[2..4]].concat().try_into().expect("8 bytes");
    let [a, b, c, d, e, f, g, h] = lock::key(SECRET, seed);
    say(&[0xF7, 8, a, b, c, d, e, f]);
    say(&[0xF7, 2, g, h]);
    assert!(slave.is_unlocked());
    slave
}

/// Who acts on what is written, and whether somebody may write.
struct AccessChecker {
    open: bool,
}

impl ParameterActions for AccessChecker {
    fn set(&mut self, _place: usize, value: f64) {
        assert!(self.open, "written without the key");
        assert!(value.is_finite(), "{value}");
    }

    fn store(&mut self, _values: &[f64]) -> bool {
        assert!(self.open, "stored without the key");
        true
    }

    fn load(&mut self) -> bool {
        assert!(self.open, "loaded without the key");
        true
    }
}

fuzz_target!(|input: (bool, Vec<(u8, [u8; 8])>)| {
    let (open, packets) = input;
    let mut slave = if open { OPEN.clone() } else { LOCKED.clone() };
    for (cycle, (length, packet)) in (0..).zip(packets) {
        // It stays open no longer than the session that was opened.
        let mut actions = AccessChecker { open: open && slave.is_unlocked() };
        let _ = slave.command(&packet[..usize::from(length).min(packet.len())], cycle, &mut actions);
        let parameters = slave.image.parameters().to_vec();
        slave.cycle(cycle, &[1.0; COUNT], &parameters);
        let mut packets = 0;
        while slave.next_daq().is_some() {
            packets += 1;
            assert!(packets <= 1_000, "a cycle's packets end");
        }
    }
});
