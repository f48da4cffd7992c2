//! Prints the explanations of a training record with their evidence, as JSON: what `discrepancy/study/explanations.py` collects.

use discrepancy::workflow::{Task, explained};
use std::error::Error;
use std::path::PathBuf;

const USAGE: &str = "usage: explanations RIG.toml TRAIN.csv [EFFECT left out …]";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(rig), Some(train)) = (arguments.next(), arguments.next()) else { return Err(USAGE.into()) };
    // One thread: the study counts CPU, and other draws run beside it.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let task = Task {
        rig: PathBuf::from(rig),
        train: vec![PathBuf::from(train)],
        without: arguments.collect(),
        ..Task::default()
    };
    let explanations = explained(&task, &mut |_| ())?;
    serde_json::to_writer(std::io::stdout().lock(), &explanations)?;
    Ok(())
}
