//! Signals as a CSV table on one time axis.
//!
//! Either a row for each stamp, with empty cells for signals not sent then; or a row every fixed period with the last value at
//! or before it. No interpolation.

use super::signals::{MessageFrames, Signals, name, value};
use std::io::{self, Write};

/// Time axis of the rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeAxis {
    /// Stamp of time 0, ns.
    pub(super) origin_ns: u64,
    /// Time between two rows; `None` for a row for each stamp.
    pub(super) every_ms: Option<u32>,
}

/// Writes the table; returns its number of rows.
pub(super) fn write(out: &mut impl Write, signals: &Signals, axis: TimeAxis) -> io::Result<u64> {
    write!(out, "time_s")?;
    for message in &signals.messages {
        for signal in message.spec.signals {
            write!(out, ",{}", name(message.spec, signal))?;
        }
    }
    writeln!(out)?;
    match axis.every_ms {
        Some(every_ms) => held(out, signals, axis.origin_ns, u64::from(every_ms) * 1_000_000),
        None => as_stamped(out, signals, axis.origin_ns),
    }
}

/// A row for each stamp; a second frame of a message at one stamp makes a second row.
fn as_stamped(out: &mut impl Write, signals: &Signals, origin_ns: u64) -> io::Result<u64> {
    let messages = &signals.messages;
    // Stamp, number of earlier frames of this message and stamp, message, data.
    let mut all: Vec<(u64, u32, u32, u64)> = Vec::new();
    for (place, message) in messages.iter().enumerate() {
        let begin = all.len();
        all.extend(message.frames.iter().map(|(stamp_ns, word)| (*stamp_ns, 0, place as u32, *word)));
        // Stable, so that frames of one stamp keep their order.
        all[begin..].sort_by_key(|frame| frame.0);
        for at in begin + 1..all.len() {
            if all[at].0 == all[at - 1].0 {
                all[at].1 = all[at - 1].1 + 1;
            }
        }
    }
    all.sort_by_key(|frame| (frame.0, frame.1));
    let mut count = 0;
    let mut cells: Vec<Option<u64>> = vec![None; messages.len()];
    for frames in all.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1)) {
        cells.fill(None);
        frames.iter().for_each(|(_, _, place, word)| cells[*place as usize] = Some(*word));
        row(out, messages, frames[0].0, origin_ns, &cells)?;
        count += 1;
    }
    Ok(count)
}

/// A row every `every_ns`, from the last multiple before the first stamp.
fn held(out: &mut impl Write, signals: &Signals, origin_ns: u64, every_ns: u64) -> io::Result<u64> {
    let mut messages = signals.messages.clone();
    messages.iter_mut().for_each(|message| message.frames.sort_by_key(|frame| frame.0));
    let stamps = || messages.iter().flat_map(|message| &message.frames).map(|frame| frame.0);
    let (Some(first), Some(last)) = (stamps().min(), stamps().max()) else { return Ok(0) };
    // Back from the origin by whole rows, so that rows are at multiples of the period.
    let rows_before = origin_ns.saturating_sub(first).div_ceil(every_ns);
    let mut at_ns = match origin_ns.checked_sub(rows_before * every_ns) {
        Some(start) => start + (first.max(start) - start) / every_ns * every_ns,
        None => origin_ns,
    };
    let mut cells: Vec<Option<u64>> = vec![None; messages.len()];
    let mut next = vec![0; messages.len()];
    let mut count = 0;
    while at_ns <= last.saturating_add(every_ns - 1) {
        for ((message, cell), next) in messages.iter().zip(&mut cells).zip(&mut next) {
            while let Some((stamp_ns, word)) = message.frames.get(*next).filter(|frame| frame.0 <= at_ns) {
                debug_assert!(*stamp_ns <= at_ns);
                *cell = Some(*word);
                *next += 1;
            }
        }
        row(out, &messages, at_ns, origin_ns, &cells)?;
        count += 1;
        at_ns += every_ns;
    }
    Ok(count)
}

fn row(
    out: &mut impl Write,
    messages: &[MessageFrames],
    stamp_ns: u64,
    origin_ns: u64,
    cells: &[Option<u64>],
) -> io::Result<()> {
    write_time(out, stamp_ns, origin_ns)?;
    for (message, cell) in messages.iter().zip(cells) {
        for signal in message.spec.signals {
            match cell {
                Some(word) => write!(out, ",{}", value(signal, *word))?,
                None => write!(out, ",")?,
            }
        }
    }
    writeln!(out)
}

/// Seconds since the origin, exact to the nanosecond where the stamp is finer than a microsecond.
fn write_time(out: &mut impl Write, stamp_ns: u64, origin_ns: u64) -> io::Result<()> {
    let (sign, ns) = match stamp_ns.checked_sub(origin_ns) {
        Some(ns) => ("", ns),
        None => ("-", origin_ns - stamp_ns),
    };
    let (seconds, fraction_ns) = (ns / 1_000_000_000, ns % 1_000_000_000);
    if fraction_ns.is_multiple_of(1000) {
        write!(out, "{sign}{seconds}.{:06}", fraction_ns / 1000)
    } else {
        write!(out, "{sign}{seconds}.{fraction_ns:09}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::{RUN_CONTROL, TICK};

    const MS: u64 = 1_000_000;

    fn signals() -> Signals {
        // RunControl: command 8 bits, number 16 bits or what the table says; Tick: cycle number in the low 32.
        let tick = |ms: u64, cycle: u64| (ms * MS, cycle);
        let ticks = MessageFrames { spec: TICK, frames: vec![tick(10, 1), tick(20, 2), tick(20, 3)] };
        let control = MessageFrames { spec: RUN_CONTROL, frames: vec![(20 * MS, 1)] };
        Signals { messages: vec![ticks, control], ..Signals::default() }
    }

    fn columns(every_ms: Option<u32>, origin_ns: u64) -> Vec<[String; 3]> {
        let mut out = Vec::new();
        let rows = write(&mut out, &signals(), TimeAxis { origin_ns, every_ms }).unwrap();
        let text = String::from_utf8(out).unwrap();
        let head: Vec<_> = text.lines().next().unwrap().split(',').map(str::to_owned).collect();
        let place = |name: &str| head.iter().position(|column| column.starts_with(name)).unwrap();
        let places = [0, place("Tick.cycle"), place("RunControl.")];
        let table: Vec<_> = text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()).collect();
        assert_eq!(table.len() as u64, rows);
        table.iter().map(|row| places.map(|place| row[place].to_owned())).collect()
    }

    fn texts(rows: &[[&str; 3]]) -> Vec<[String; 3]> {
        rows.iter().map(|row| row.map(str::to_owned)).collect()
    }

    #[test]
    fn frames_of_one_stamp_share_a_row_and_the_same_message_does_not() {
        let expected = [["0.000000", "1", ""], ["0.010000", "2", "1"], ["0.010000", "3", ""]];
        assert_eq!(columns(None, 10 * MS), texts(&expected));
    }

    #[test]
    fn a_row_every_so_often_holds_what_was_seen_last() {
        let expected = [["-0.005000", "1", ""], ["0.000000", "1", ""], ["0.005000", "3", "1"]];
        assert_eq!(columns(Some(5), 15 * MS), texts(&expected));
    }

    #[test]
    fn times_before_the_origin_are_negative_and_fine_ones_exact() {
        let text = |stamp, origin| {
            let mut out = Vec::new();
            write_time(&mut out, stamp, origin).unwrap();
            String::from_utf8(out).unwrap()
        };
        assert_eq!(text(1_500_000_000, 2_000_000_000), "-0.500000");
        assert_eq!(text(2_000_000_001, 1_000_000_000), "1.000000001");
    }
}
