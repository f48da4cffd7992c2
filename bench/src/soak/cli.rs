//! The command line of `bench soak`.

use clap::{Args, ValueEnum};
use protocol::bus::BusUrl;
use std::path::PathBuf;

/// How to soak.
#[derive(Args, Clone, Debug)]
pub(crate) struct SoakArguments {
    /// Length of the soak in hours, what an earlier start with the same --out did included.
    #[arg(long, value_parser = length, conflicts_with = "minutes", required_unless_present = "minutes")]
    pub hours: Option<f64>,
    /// The same in minutes.
    #[arg(long, value_parser = length)]
    pub minutes: Option<f64>,
    /// Bus: can://IFACE (SocketCAN) or unix:///PATH (embedded, hosted by the emulator).
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub bus: BusUrl,
    /// Folder of the soak, made if missing; one that holds a soak already goes on with it. Default: a new one named by the time.
    #[arg(long, default_value_os_t = new_folder())]
    pub out: PathBuf,
    /// Length of a segment with its start and end, s; by default 300, and a quarter of a soak that is shorter than four of them.
    #[arg(long, value_parser = segment_length)]
    pub segment_seconds: Option<f64>,
    /// Experiments by their names, in turn.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "damper-load,point-to-point,soak,spring-load,load-step"
    )]
    pub experiments: Vec<String>,
    /// Folder of the experiment files.
    #[arg(long, default_value = "controller/experiments")]
    pub experiment_folder: PathBuf,
    /// Rig file with the plant's numbers.
    #[arg(long, default_value = "plant/rig.toml")]
    pub rig: PathBuf,
    /// Load generator that runs beside every other segment, as one command line; 'none' for none.
    #[arg(long, default_value = "stress-ng --cpu 2 --vm 1 --vm-bytes 128M --switch 1")]
    pub load: String,
    /// Inject frame loss into every fourth segment; embedded bus only.
    #[arg(long, value_enum, default_value_t = YesNo::Yes)]
    pub loss_segments: YesNo,
    /// Probability that a frame is lost in these segments.
    #[arg(long, default_value_t = 0.01, value_parser = probability)]
    pub loss: f64,
    /// Whether a broken bound on a position error fails the segment, unless a process stood still for 5 ms in it.
    #[arg(long, value_enum, default_value_t = YesNo::No)]
    pub judge_positions: YesNo,
    /// Newest segments that keep their big files (logs and tables).
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    pub keep: u64,
    /// Failed segments that keep their big files, the newest ones.
    #[arg(long, default_value_t = 10)]
    pub keep_failed: u64,
    /// Ends the soak while this much of the disk is still free, in MB.
    #[arg(long, default_value_t = 512)]
    pub min_free_mb: u64,
    /// More options of the emulator, separated by spaces, such as "--cpu 1 --full-timing".
    #[arg(long, default_value = "", allow_hyphen_values = true)]
    pub emulator_options: String,
    /// More options of the controllers.
    #[arg(long, default_value = "", allow_hyphen_values = true)]
    pub controller_options: String,
    /// Folder of emulator and controller; by default that of bench itself.
    #[arg(long, value_name = "DIR")]
    pub bin_dir: Option<PathBuf>,
    /// Go on with a soak that was begun with other settings.
    #[arg(long)]
    pub anyway: bool,
}

/// A program that must not outlive the one that started it.
#[derive(Args, Clone, Debug)]
pub(crate) struct ChildArguments {
    /// Process number of the one that starts it.
    pub parent: i32,
    /// The program and its arguments.
    #[arg(required = true, trailing_var_arg = true, allow_hyphen_values = true)]
    pub command: Vec<std::ffi::OsString>,
}

/// A switch whose both sides have a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum YesNo {
    #[value(help = "On")]
    Yes,
    #[value(help = "Off")]
    No,
}

impl SoakArguments {
    /// Length of the soak.
    pub(crate) fn planned_s(&self) -> f64 {
        self.hours.map_or(0.0, |hours| hours * 3600.0) + self.minutes.map_or(0.0, |minutes| minutes * 60.0)
    }
}

fn new_folder() -> PathBuf {
    let folder = runlog::run_folder::new_folder();
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    folder.with_file_name(format!("soak-{name}"))
}

fn within(text: &str, least: f64, most: f64, what: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| (least..=most).contains(value));
    value.ok_or_else(|| format!("'{text}' is not {what} from {least} to {most}"))
}

fn length(text: &str) -> Result<f64, String> {
    within(text, 0.1, 100_000.0, "a length")
}

fn segment_length(text: &str) -> Result<f64, String> {
    within(text, super::plan::SHORTEST_SEGMENT_S, 86_400.0, "a length in seconds")
}

fn probability(text: &str) -> Result<f64, String> {
    within(text, 1e-6, 0.2, "a probability")
}
