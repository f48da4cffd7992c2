//! What a reading of the vitals costs: the 1 ms path pays it once a cycle.
//!
//! ```text
//! cargo run --release -p realtime --example vitals
//! ```

use realtime::{Clock, Continued, MonotonicClock, Recorder, VitalsReader};

const READINGS: u32 = 20_000;

#[allow(clippy::print_stdout)] // the figures are the result
fn main() -> std::io::Result<()> {
    let mut vitals = VitalsReader::new(Continued::install()?);
    let (mut reading, mut clock) = (Recorder::new(), Recorder::new());
    for _ in 0..READINGS {
        let before = MonotonicClock.now();
        let between = MonotonicClock.now();
        std::hint::black_box(vitals.read());
        let after = MonotonicClock.now();
        clock.record((between - before).as_nanos() as u64);
        reading.record((after - between).as_nanos() as u64);
    }
    println!("reading, with the clock's  {}", reading.percentiles());
    println!("the clock's alone          {}", clock.percentiles());
    Ok(())
}
