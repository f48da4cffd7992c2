//! Where a baseline and records disagree, a line for each balance: `locate_dev RIG.toml RECORD.csv...`

#![allow(clippy::print_stdout, clippy::print_stderr)] // what it is for

use discrepancy::{check, course::Course, locate::locate, outside::outside, records};
use plant::RigParameters;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut files = std::env::args().skip(1);
    let rig_file = files.next().ok_or("locate_dev RIG.toml RECORD.csv...")?;
    let rig = RigParameters::from_toml(&std::fs::read_to_string(&rig_file)?, &rig_file)?;
    let mut courses = Vec::new();
    for file in files {
        let record = records::read(file.as_ref(), &records::ReadOptions::default())?;
        courses.push(Course::of(&record, &check::check(&record, &rig), &rig)?);
    }
    let start = std::time::Instant::now();
    let located = locate(&rig, &courses, &mut |_| ());
    eprintln!("{:.2} s", start.elapsed().as_secs_f64());
    for bar in &located.location.balances {
        print!("{} {:.2} {:.3} {} |", bar.balance, bar.over_noise, bar.rms, bar.unit);
        for cell in located.location.regimes.iter().filter(|cell| cell.balance == bar.balance) {
            print!(" {} {:.2} ({})", cell.regime, cell.over_noise, cell.windows);
        }
        println!();
    }
    if let Some(note) = &located.location.sensor_ratio {
        println!("{note}");
    }
    if let Some(outside) = outside(&rig, &courses, &located.unknowns, &mut |_| ()) {
        let variables = outside.variables.iter().take(4);
        let told: Vec<String> =
            variables.map(|own| format!("{} {:.3} (p {:.3})", own.variable, own.r2, own.p_value)).collect();
        println!(
            "OUTSIDE {} | {} | {}",
            outside.balance,
            told.join(", "),
            outside.formula.unwrap_or_default()
        );
    }
    eprintln!("{:.2} s", start.elapsed().as_secs_f64());
    Ok(())
}
