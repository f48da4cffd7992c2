//! `controller.csv`: what only the controller knows, a row for each cycle it answered.
//!
//! A thread of its own polls the queues, so that the 1 ms path wakes nobody.

use crate::axes::DriveRecord;
use crate::station::News;
use crossbeam_channel::{Receiver, TryRecvError};
use protocol::run_folder::LineFile;
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// Pause between two looks at the queues.
const POLL_PERIOD: Duration = Duration::from_millis(4);
/// Longest time that a row stays in memory.
const FLUSH_PERIOD: Duration = Duration::from_millis(200);
const HEAD: &str = "time_s,chain_state,drive_set_point_m,drive_set_point_velocity_m_per_s,drive_position_m,\
drive_wanted_velocity_m_per_s,drive_opening";

/// Writes rows and tells news until the senders are gone. Returns the news, and why writing stopped, if it did.
pub fn run(
    mut table: LineFile,
    records: &Receiver<DriveRecord>,
    news: &Receiver<News>,
    failed: impl Fn(),
) -> (Vec<News>, Option<String>) {
    let mut told = Vec::new();
    let mut last_flush = Instant::now();
    let mut failure = writeln!(table.lines(), "{HEAD}").err().map(|error| error.to_string());
    loop {
        let finished = loop {
            match records.try_recv() {
                Ok(record) if failure.is_none() => {
                    if let Err(error) = write_row(&mut table, &record) {
                        failure = Some(error.to_string());
                    }
                }
                Ok(_) => {}
                Err(TryRecvError::Empty) => break false,
                Err(TryRecvError::Disconnected) => break true,
            }
        };
        for item in news.try_iter() {
            eprintln!("controller: {}", sentence(item));
            told.push(item);
        }
        if failure.is_none() && (finished || last_flush.elapsed() > FLUSH_PERIOD) {
            last_flush = Instant::now();
            failure = table.write_out().err().map(|error| error.to_string());
        }
        if let Some(failure) = &failure {
            eprintln!("controller: cannot write {failure}; free space or choose another --out");
            failed();
            return (told, Some(failure.clone()));
        }
        if finished {
            return (told, None);
        }
        std::thread::sleep(POLL_PERIOD);
    }
}

fn write_row(table: &mut LineFile, record: &DriveRecord) -> io::Result<()> {
    let DriveRecord { cycle, state, set_point, position_m, wanted_velocity_m_per_s, opening } = record;
    let out = table.lines();
    write!(out, "{}.{:03},{state},", cycle / 1000, cycle % 1000)?;
    match set_point {
        Some(point) => write!(out, "{},{}", point.position_m, point.velocity_m_per_s)?,
        None => write!(out, ",")?,
    }
    writeln!(out, ",{position_m},{wanted_velocity_m_per_s},{opening}")?;
    table.write_when_full()
}

fn sentence(news: News) -> String {
    match news {
        News::State(state, cycle) => format!("cycle {cycle}: {state}"),
        News::RigRestarted => "the rig started anew; starting over".into(),
        News::BusLost => "the bus is gone; trying to come back".into(),
        News::BusBack => "the bus is back".into(),
        News::SensorsSilent => "no sensors for 0.2 s; waiting for the rig".into(),
    }
}
