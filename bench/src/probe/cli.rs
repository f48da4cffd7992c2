//! The probe's command line.

use clap::Args;
use std::path::PathBuf;

/// How to watch the machine.
#[derive(Args, Debug)]
pub(crate) struct ProbeArguments {
    /// Table to write: cpu, from_ns, to_ns, another_ran.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// End after this time; without it, on Ctrl-C or SIGTERM.
    #[arg(long, value_parser = seconds)]
    pub seconds: Option<f64>,
    /// A pause between two looks at the clock that is longer than this is a gap.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub gap_us: u64,
    /// CPUs to watch, as in 0-3,8; by default all that this process may use.
    #[arg(long, value_name = "LIST")]
    pub cpus: Option<String>,
}

pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let allowed = |seconds: &f64| *seconds > 0.0 && *seconds <= 1e7;
    text.parse()
        .ok()
        .filter(allowed)
        .ok_or_else(|| format!("'{text}' is not a time in seconds above 0, at most 1e7"))
}
