//! The command line of the study.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use std::str::FromStr;
use system_tests::study::draws::{Shape, Shard};

/// The study: judges a program that names missing effects, on records whose truth it never sees.
#[derive(Parser)]
#[command(name = "scripts/study", bin_name = "scripts/study")]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Begins a study: draws effects, amplitudes, places and difficulties from a seed.
    Draws(DrawsArguments),
    /// Computes the detection limits of the ideal observer.
    Limits(LimitsArguments),
    /// Computes for each draw which effects leave the same signature.
    Cosines(CosinesArguments),
    /// Makes records and runs the program on them; run again, it does only what is missing.
    Run(RunArguments),
    /// Scores the results: score-LABEL.json and score-LABEL.html.
    Score(ScoreArguments),
    /// Several scores side by side, as tables in Markdown: ours beside the competitors.
    Compare(CompareArguments),
    /// How rates fall over noise and amplitude: curve-LABEL.md and curve-LABEL.svg.
    Curve(CurveArguments),
    /// Runs the experiments that the program proposed where it could not tell effects apart: resolve-LABEL.json and .md.
    Resolve(ResolveArguments),
}

/// Results under a label, of a study or of all its shards.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    /// What the results are called.
    pub(crate) label: String,
    /// Folder of the study, or of all its shards.
    pub(crate) folders: Vec<PathBuf>,
}

impl FromStr for Column {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('@') {
            Some((label, folders)) if !label.is_empty() && !folders.is_empty() => {
                let folders = folders.split(',').map(PathBuf::from).collect();
                Ok(Column { label: label.to_owned(), folders })
            }
            _ => Err("write LABEL@FOLDER, and of several shards LABEL@FOLDER,FOLDER".to_owned()),
        }
    }
}

#[derive(Args)]
pub(crate) struct DrawsArguments {
    /// Folder of the study.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..1 << 53))]
    pub(crate) seed: u64,
    /// Draws of each effect.
    #[arg(long, default_value_t = Shape::default().each)]
    each: u32,
    /// Draws with nothing hidden.
    #[arg(long, default_value_t = Shape::default().nulls)]
    nulls: u32,
    /// Draws of each parameter that is off alone.
    #[arg(long, default_value_t = Shape::default().parameters)]
    parameters: u32,
    /// Draws of two effects.
    #[arg(long, default_value_t = Shape::default().pairs)]
    pairs: u32,
    /// Draws of three effects.
    #[arg(long, default_value_t = Shape::default().triples)]
    triples: u32,
    /// Sensor noise of all records, 1 is as specified.
    #[arg(long, default_value_t = 1.0)]
    noise: f64,
    /// Divides all amplitudes, counted from the baseline: 100 brings most near their limits.
    #[arg(long, default_value_t = 1.0)]
    weaker: f64,
    /// Part of the study, as 0/4: draws whose number leaves this remainder.
    #[arg(long, default_value_t = Shard::WHOLE)]
    pub(crate) shard: Shard,
}

impl DrawsArguments {
    pub(crate) fn shape(&self) -> Shape {
        let Self { each, nulls, parameters, pairs, triples, noise, weaker, .. } = *self;
        Shape { each, nulls, parameters, pairs, triples, noise_factor: noise, weaker_factor: weaker }
    }
}

#[derive(Args)]
pub(crate) struct LimitsArguments {
    /// Seed of the records with nothing hidden that the limits are computed from.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Writes tests/study/limits.json and the table of tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct CosinesArguments {
    /// Folder of the study.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Draws at once.
    #[arg(long, default_value_t = 2)]
    pub(crate) jobs: usize,
    /// Writes tests/study/classes.json and the table of tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct RunArguments {
    /// Folder of the study.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// The program: PROGRAM close --rig rig.toml --train train.csv --test test.csv --out out. Without it only records are made.
    #[arg(long)]
    pub(crate) program: Option<PathBuf>,
    /// More arguments for the program, after --.
    #[arg(last = true)]
    pub(crate) arguments: Vec<String>,
    /// What the results are called.
    #[arg(long, default_value = "program")]
    pub(crate) label: String,
    /// Leaves the hidden effect and its class out: --without NAME for each; only draws of one effect are run.
    #[arg(long)]
    pub(crate) leave_out: bool,
    /// Longest time for one draw, s.
    #[arg(long, default_value_t = 600.0)]
    pub(crate) time_limit: f64,
    /// Draws at once.
    #[arg(long, default_value_t = 1)]
    pub(crate) jobs: usize,
    /// Runs these draws, again if they are done; commas between.
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<usize>,
    /// Keeps truth.csv, 17 MB a record.
    #[arg(long)]
    pub(crate) keep_truth: bool,
    /// Deletes the records of a draw once the program has seen them.
    #[arg(long)]
    pub(crate) drop_records: bool,
    /// Free space on the disk below which the study stops, MiB.
    #[arg(long, default_value_t = 1024)]
    pub(crate) least_free: u64,
}

#[derive(Args)]
pub(crate) struct ScoreArguments {
    /// Folder of the study, or of all its shards, which are merged.
    #[arg(required = true)]
    pub(crate) folders: Vec<PathBuf>,
    /// What the results are called.
    #[arg(long, default_value = "program")]
    pub(crate) label: String,
    /// Where the score is written; the first folder without it.
    #[arg(long)]
    pub(crate) to: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct CompareArguments {
    /// LABEL@FOLDER for each program; of several shards LABEL@FOLDER,FOLDER.
    #[arg(required = true)]
    pub(crate) columns: Vec<Column>,
    /// Where the tables are written; without it they are printed.
    #[arg(long)]
    pub(crate) to: Option<PathBuf>,
    /// Writes the tables into tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct CurveArguments {
    /// LABEL@FOLDER for each noise factor; of several shards LABEL@FOLDER,FOLDER.
    #[arg(required = true)]
    pub(crate) columns: Vec<Column>,
    /// Folder for curve-LABEL.md and curve-LABEL.svg.
    #[arg(long)]
    pub(crate) to: PathBuf,
    /// Writes the tables into tests/docs/study.md, and the picture beside it.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct ResolveArguments {
    /// Folder of the study.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// What the results are called; those with the proposed experiments stand under LABEL-resolve.
    #[arg(long, default_value = "program")]
    pub(crate) label: String,
    /// The program that the results are of. Without it only the table is made of what is done.
    #[arg(long)]
    pub(crate) program: Option<PathBuf>,
    /// Its arguments, after --; the same as in the run.
    #[arg(last = true)]
    pub(crate) arguments: Vec<String>,
    /// Longest time for one start, s.
    #[arg(long, default_value_t = 1200.0)]
    pub(crate) time_limit: f64,
    /// Draws at once.
    #[arg(long, default_value_t = 1)]
    pub(crate) jobs: usize,
    /// Runs these draws, again if they are done; commas between.
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<usize>,
    /// Free space on the disk below which the study stops, MiB.
    #[arg(long, default_value_t = 1024)]
    pub(crate) least_free: u64,
    /// Writes the table into tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}
