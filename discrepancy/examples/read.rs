//! Reads a record of any form and says what is in it: `cargo run -p discrepancy --example read -- FILE [MAPPING]`.
#![allow(clippy::print_stdout)] // what it is for

use records::ReadOptions;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let file = arguments.next().ok_or("name a file, and for a foreign CSV its mapping")?;
    let options = ReadOptions { mapping: arguments.next(), ..ReadOptions::default() };
    let record = records::read(&file, &options)?;
    println!("{}: {:?}, {} rows, {:?}", record.file.display(), record.form, record.len(), record.setup);
    for channel in record.channels() {
        let values = record.channel(channel).unwrap_or_default();
        let there: Vec<f64> = values.iter().copied().flatten().collect();
        let least = there.iter().copied().fold(f64::INFINITY, f64::min);
        let most = there.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        println!("{channel:24} {} values of {}, {least} to {most}", there.len(), values.len());
    }
    for warning in &record.warnings {
        println!("line {:?}: {}", warning.line, warning.text);
    }
    Ok(())
}
