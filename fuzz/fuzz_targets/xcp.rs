//! XCP commands: any packets get an answer or none, nothing is written without the key, and what is written is a number.
#![no_main]

use controller::xcp::alone::slave;
use controller::xcp::image::Desk;
use controller::xcp::signals::COUNT;
use controller::xcp::slave::Slave;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

/// A key that is not in the seeds.
const SECRET: &[u8] = b"known to no fuzzer";
/// Made once: the A2L file that comes with it takes milliseconds.
static LOCKED: LazyLock<Slave> = LazyLock::new(|| slave(Some(SECRET)));
static OPEN: LazyLock<Slave> = LazyLock::new(|| slave(None));

/// Who acts on what is written, and whether somebody may write.
struct Strict {
    open: bool,
}

impl Desk for Strict {
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

fuzz_target!(|input: (bool, Vec<[u8; 8]>)| {
    let (open, packets) = input;
    let mut slave = if open { OPEN.clone() } else { LOCKED.clone() };
    let mut desk = Strict { open };
    for (cycle, packet) in (0..).zip(packets) {
        // A packet may be short: zeros at its end are left out.
        let length = packet.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        let _ = slave.command(&packet[..length.max(1)], cycle, &mut desk);
        let parameters = slave.image().parameters().to_vec();
        slave.cycle(cycle, &[1.0; COUNT], &parameters);
        let mut packets = 0;
        while slave.next_daq().is_some() {
            packets += 1;
            assert!(packets <= 1_000, "a cycle's packets end");
        }
    }
});
