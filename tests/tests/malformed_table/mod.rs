//! The table of malformed frames: what is wrong with each, its packet, and the one counter that must count it.

use protocol::can::{CanFrame, ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG};
use protocol::checksum;

const DRIVE: u16 = 0x110;
const LOAD: u16 = 0x111;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Counter {
    /// Not as `rig.dbc` says.
    Malformed,
    /// An identifier that `rig.dbc` does not know, extended, remote.
    Unknown,
    /// An error frame of an interface.
    ErrorFrame,
    /// No frame at all: the host stops it.
    Host,
    /// A good drive command whose echo is too old, or of no cycle.
    StaleDrive,
    /// The same of the load.
    StaleLoad,
}

pub(crate) const COUNTERS: [Counter; 6] = [
    Counter::Malformed,
    Counter::Unknown,
    Counter::ErrorFrame,
    Counter::Host,
    Counter::StaleDrive,
    Counter::StaleLoad,
];

impl Counter {
    pub(crate) fn in_summary(self) -> &'static str {
        match self {
            Self::Malformed => "/frames_ignored/malformed",
            Self::Unknown => "/frames_ignored/unknown",
            Self::ErrorFrame => "/bus/error_frames",
            Self::Host => "/bus_host/malformed",
            Self::StaleDrive => "/drive_commands/refused_stale",
            Self::StaleLoad => "/load_commands/refused_stale",
        }
    }

    /// The controller hears the same frames; a stale command is none of its business.
    pub(crate) fn in_controller(self) -> Option<&'static str> {
        matches!(self, Self::Malformed | Self::Unknown | Self::ErrorFrame).then(|| self.in_summary())
    }
}

pub(crate) struct Injection {
    pub(crate) what: String,
    pub(crate) counter: Counter,
    /// The packet as it is sent in a cycle.
    pub(crate) packet: Box<dyn Fn(u32) -> Vec<u8>>,
}

fn line(what: impl Into<String>, counter: Counter, packet: impl Fn(u32) -> Vec<u8> + 'static) -> Injection {
    Injection { what: what.into(), counter, packet: Box::new(packet) }
}

fn frame(what: impl Into<String>, counter: Counter, id: u16, data: &[u8]) -> Injection {
    let bytes = CanFrame::new(id, data).to_bytes().to_vec();
    line(what, counter, move |_| bytes.clone())
}

/// A command that opens its valve fully, and answers `echo`; right in every bit unless it is changed afterwards.
fn command(id: u16, echo: u32) -> [u8; 5] {
    with_checksum(id, [0xFF, 0x37, echo as u8, 0x10 | (echo >> 8) as u8 & 0xF])
}

fn with_checksum(id: u16, [a, b, c, d]: [u8; 4]) -> [u8; 5] {
    [a, b, c, d, checksum::of(id, &[a, b, c, d])]
}

/// A command of the cycle, spoiled by `spoil` before or after its checksum as it likes.
fn spoiled(what: impl Into<String>, id: u16, spoil: impl Fn(&mut [u8; 5]) + 'static) -> Injection {
    line(what, Counter::Malformed, move |cycle| {
        let mut data = command(id, cycle);
        spoil(&mut data);
        CanFrame::new(id, &data).to_bytes().to_vec()
    })
}

pub(crate) fn table() -> Vec<Injection> {
    [commands(), stops_and_others(), identifiers(), packets(), stale()].into_iter().flatten().collect()
}

/// Valve commands that are wrong in their form.
fn commands() -> Vec<Injection> {
    let mut table = Vec::new();
    for id in [DRIVE, LOAD] {
        for length in [0, 1, 2, 3, 4, 6, 7, 8] {
            table.push(line(format!("{id:#x} of {length} bytes"), Counter::Malformed, move |cycle| {
                let [a, b, c, d, crc] = command(id, cycle);
                CanFrame::new(id, &[a, b, c, d, crc, 0, 0, 0][..length]).to_bytes().to_vec()
            }));
        }
        for byte in 0..5 {
            table.push(spoiled(format!("{id:#x}, byte {byte} inverted"), id, move |data| data[byte] ^= 0xFF));
        }
        let other = DRIVE ^ LOAD ^ id;
        table.push(spoiled(format!("{id:#x} with the checksum of {other:#x}"), id, move |data| {
            data[4] = checksum::of(other, &data[..4]);
        }));
        table.push(spoiled(format!("{id:#x}, opening -2048, right checksum"), id, move |data| {
            *data = with_checksum(id, [0x00, 0x38, data[2], data[3]]);
        }));
        for bit in [5, 6, 7] {
            table.push(spoiled(
                format!("{id:#x}, reserved bit {}, right checksum", 24 + bit),
                id,
                move |data| {
                    *data = with_checksum(id, [data[0], data[1], data[2], data[3] | 1 << bit]);
                },
            ));
        }
    }
    for bit in 0..40 {
        let what = format!("{DRIVE:#x}, bit {bit} inverted");
        table.push(spoiled(what, DRIVE, move |data| data[bit / 8] ^= 1 << (bit % 8)));
    }
    table
}

/// Emergency stops and slower frames that are wrong in their form; a right one of each would act.
fn stops_and_others() -> Vec<Injection> {
    use Counter::Malformed;
    let mut table = Vec::new();
    for id in [0x108, 0x10A, 0x10B] {
        for data in [&[][..], &[1], &[1, 0, 0], &[1; 8]] {
            table.push(frame(format!("emergency stop {id:#x} of {} bytes", data.len()), Malformed, id, data));
        }
        for reason in [8, 0xFF] {
            table.push(frame(
                format!("emergency stop {id:#x}, reason {reason}"),
                Malformed,
                id,
                &[reason, 0],
            ));
        }
        table.push(frame(format!("emergency stop {id:#x}, reserved bits"), Malformed, id, &[1, 0x80]));
    }
    table.extend([
        frame("sensors of 7 bytes", Malformed, 0x120, &[0x55; 7]),
        frame("tick of 8 bytes", Malformed, 0x130, &[0; 8]),
        frame("tick that ends the run, reserved bits", Malformed, 0x130, &[0, 0, 0, 0, 0, 0, 0xFF]),
        frame("rig status of 3 bytes", Malformed, 0x140, &[0; 3]),
        frame("chain status of 4 bytes", Malformed, 0x150, &[7, 0, 1, 0]),
        frame("chain state 10", Malformed, 0x150, &[10, 0, 1, 0, 0]),
        frame("done, reserved bits", Malformed, 0x150, &[7, 0, 0x81, 0, 0]),
        frame("chain values of 7 bytes", Malformed, 0x151, &[0; 7]),
        frame("run control, unknown command", Malformed, 0x160, &[3, 0]),
        frame("hand force of 3 bytes", Malformed, 0x180, &[0x7F; 3]),
        frame("hand force beyond its range", Malformed, 0x180, &[0x00, 0x80, 0, 0]),
        frame("link, reserved bits", Malformed, 0x181, &[0x81]),
        frame("weights of 1 byte", Malformed, 0x182, &[0xFF]),
    ]);
    table
}

/// Good commands under identifiers that are not theirs.
fn identifiers() -> Vec<Injection> {
    let disguised = |what: &str, counter, id: u32| {
        line(what, counter, move |cycle| CanFrame::from_raw(id, &command(DRIVE, cycle)).to_bytes().to_vec())
    };
    let drive = u32::from(DRIVE);
    vec![
        disguised("identifier 0x000", Counter::Unknown, 0x000),
        disguised("identifier 0x112", Counter::Unknown, 0x112),
        disguised("identifier 0x7FF", Counter::Unknown, 0x7FF),
        disguised("identifier of 12 bits without the flag", Counter::Unknown, 0x800 | drive),
        disguised("extended identifier", Counter::Unknown, EXTENDED_FLAG | drive),
        disguised("extended identifier of 29 bits", Counter::Unknown, EXTENDED_FLAG | 0x1FFF_FFFF),
        disguised("remote frame", Counter::Unknown, REMOTE_FLAG | drive),
        disguised("extended remote frame", Counter::Unknown, EXTENDED_FLAG | REMOTE_FLAG | drive),
        disguised("error frame", Counter::ErrorFrame, ERROR_FLAG | drive),
        disguised("error frame with every flag", Counter::ErrorFrame, 0xE000_0000 | drive),
    ]
}

fn packets() -> Vec<Injection> {
    let mut table = Vec::new();
    for length in [1, 8, 15, 17, 31, 32, 33, 63, 64, 65, 72, 1000] {
        table.push(line(format!("packet of {length} bytes"), Counter::Host, move |cycle| {
            let mut bytes = CanFrame::new(DRIVE, &command(DRIVE, cycle)).to_bytes().to_vec();
            bytes.resize(length, 0);
            bytes
        }));
    }
    for length in [9, 15, 64, 255] {
        table.push(line(format!("length byte {length}"), Counter::Host, move |cycle| {
            let mut bytes = CanFrame::new(DRIVE, &command(DRIVE, cycle)).to_bytes().to_vec();
            bytes[4] = length;
            bytes
        }));
    }
    table
}

/// Commands in good form that must not act: by how many cycles their echo is off.
fn stale() -> Vec<Injection> {
    let offsets: [(&str, i64); 8] = [
        ("echo 21 cycles too old", -21),
        ("echo 22 cycles too old", -22),
        ("echo 100 cycles too old", -100),
        ("echo 700 cycles too old", -700),
        ("echo of the next cycle but one", 2),
        ("echo of a cycle to come", 100),
        ("echo of a cycle far to come", 1500),
        ("echo of no cycle yet", 2048),
    ];
    let commands = [(DRIVE, Counter::StaleDrive), (LOAD, Counter::StaleLoad)];
    let of = |(id, counter)| {
        offsets.map(|(what, offset)| {
            line(format!("{id:#x}, {what}"), counter, move |cycle| {
                let echo = (i64::from(cycle) + offset).rem_euclid(4096) as u32;
                CanFrame::new(id, &command(id, echo)).to_bytes().to_vec()
            })
        })
    };
    commands.into_iter().flat_map(of).collect()
}
