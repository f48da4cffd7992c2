//! The command line of the study.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::str::FromStr;
use study::draws::Shape;
use study::folder::Plan;

/// The study: judges a program that names missing effects, on records whose truth it never sees.
#[derive(Parser)]
#[command(name = "scripts/study", bin_name = "scripts/study")]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Writes down which draws a study has: effects, amplitudes, places and difficulties, from a seed.
    Draws(DrawsArguments),
    /// Computes the detection limits of the ideal observer.
    Limits(LimitsArguments),
    /// Computes for each draw which effects leave the same signature.
    Cosines(CosinesArguments),
    /// Computes what the catalogue's law leaves of the other forms of each effect.
    Forms(FormsArguments),
    /// Draws pairs of effects that a record leaves alike and an experiment tells apart: twins.json, written at the end.
    Twins(TwinsArguments),
    /// Takes a step with one draw, for a campaign: its number comes as a line of JSON, what came of it goes out as one.
    One(OneArguments),
    /// Scores the results: score-LABEL.json and score-LABEL.html.
    Score(ScoreArguments),
    /// Both worlds of a study side by side: worlds-LABEL.json and worlds-LABEL.md, of the draws that have a result.
    Worlds(WorldsArguments),
    /// Several scores side by side, as tables in Markdown: ours beside the competitors.
    Compare(CompareArguments),
    /// How rates fall over noise and amplitude: curve-LABEL.md and curve-LABEL.svg.
    Curve(CurveArguments),
    /// Which seeds were opened, with the figures of their first opening beside later ones.
    Ledger(LedgerArguments),
    /// What came of the experiments that the program proposed where it could not tell effects apart: resolve-LABEL.json and .md.
    Resolve(ResolveArguments),
}

/// Results under a label, in one folder or in several.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    /// What the results are called.
    pub(crate) label: String,
    /// Folders of the study.
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
            _ => Err("write LABEL@FOLDER, and of several folders LABEL@FOLDER,FOLDER".to_owned()),
        }
    }
}

/// What defines a study; of one that was begun it must be the same, or be left out.
#[derive(Args, Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlanArguments {
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
    /// Exact and background world in turn, both axes recorded.
    #[arg(long)]
    worlds: bool,
    /// Draws of another form have the far one.
    #[arg(long)]
    far_forms: bool,
}

impl PlanArguments {
    pub(crate) fn plan(&self) -> Plan {
        let Self { each, nulls, parameters, pairs, triples, noise, weaker, worlds, far_forms, .. } = *self;
        let shape = Shape {
            each,
            nulls,
            parameters,
            pairs,
            triples,
            noise_factor: noise,
            weaker_factor: weaker,
            worlds,
            far_forms,
        };
        Plan::new(self.seed, shape)
    }
}

#[derive(Args)]
pub(crate) struct DrawsArguments {
    /// Folder of the study.
    #[arg(long)]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) plan: PlanArguments,
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
    /// Only of draws that have a result under this label.
    #[arg(long, conflicts_with = "write")]
    pub(crate) done: Option<String>,
    /// Writes tests/study/classes.json and the table of tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct FormsArguments {
    /// Only of this effect; may be repeated.
    #[arg(long = "effect", conflicts_with = "write")]
    pub(crate) effects: Vec<String>,
    /// At this place of theirs, as the catalogue names it.
    #[arg(long, conflicts_with = "write", requires = "effects")]
    pub(crate) place: Option<String>,
    /// Fits at once.
    #[arg(long, default_value_t = 2)]
    pub(crate) jobs: usize,
    /// Without the near forms.
    #[arg(long, conflicts_with = "write")]
    pub(crate) far_only: bool,
    /// Writes the table of tests/docs/record-maker.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct TwinsArguments {
    /// Folder of the twins.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..1 << 53))]
    pub(crate) seed: u64,
    /// How many are wanted.
    #[arg(long, default_value_t = 40)]
    pub(crate) count: usize,
    /// Starts at once.
    #[arg(long, default_value_t = 2)]
    pub(crate) jobs: usize,
}

/// What is done with a draw.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// Its records are made.
    Records,
    /// The program is let loose on them.
    Run,
    /// The same without what is hidden in its catalogue, and its class: --without NAME for each; only draws of one effect.
    LeaveOut,
    /// Where the program could not tell effects apart: what it proposed is measured, and it is run on both records.
    Resolve,
    /// A twin of `twins.json`: the program is let loose on it, and what it proposed is measured at once.
    Twins,
}

#[derive(Args)]
pub(crate) struct OneArguments {
    /// What is done.
    #[arg(value_enum)]
    pub(crate) action: Action,
    /// Folder of the study; begun if there is none.
    #[arg(long)]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) plan: PlanArguments,
    /// The program, a path or a name in PATH: PROGRAM close --rig rig.toml --train train.csv --test test.csv --out out.
    #[arg(long)]
    pub(crate) program: Option<PathBuf>,
    /// More arguments for the program, after --.
    #[arg(last = true)]
    pub(crate) arguments: Vec<String>,
    /// What the results are called; those with proposed experiments stand under LABEL-resolve.
    #[arg(long, default_value = "program")]
    pub(crate) label: String,
    /// The draw, done again if it is done; without it, it comes from standard input and is done if it is missing.
    #[arg(long)]
    pub(crate) draw: Option<usize>,
    /// Longest time for one start, s.
    #[arg(long, default_value_t = 1200.0)]
    pub(crate) time_limit: f64,
    /// Keeps truth.csv, 17 MB a record.
    #[arg(long)]
    pub(crate) keep_truth: bool,
    /// Deletes the records of a draw once the program has seen them.
    #[arg(long)]
    pub(crate) drop_records: bool,
    /// Free space on the disk below which nothing is begun, MiB.
    #[arg(long, default_value_t = 1024)]
    pub(crate) least_free: u64,
}

#[derive(Args)]
pub(crate) struct ScoreArguments {
    /// Folder of the study, or all of them where machines without a common disk filled several.
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
pub(crate) struct WorldsArguments {
    /// Folder of the study, or all of them where machines without a common disk filled several.
    #[arg(required = true)]
    pub(crate) folders: Vec<PathBuf>,
    /// What the results are called.
    #[arg(long, default_value = "program")]
    pub(crate) label: String,
    /// What those are called in which the hidden effects were left out.
    #[arg(long)]
    pub(crate) left_out: Option<String>,
    /// What those of another program are called; may be repeated.
    #[arg(long)]
    pub(crate) other: Vec<String>,
    /// Writes the tables into tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct CompareArguments {
    /// LABEL@FOLDER for each program; of several folders LABEL@FOLDER,FOLDER.
    #[arg(required = true)]
    pub(crate) columns: Vec<Column>,
    /// Where the tables are written; without it they are printed.
    #[arg(long)]
    pub(crate) to: Option<PathBuf>,
    /// Writes the tables into tests/docs/study-earlier.md.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct CurveArguments {
    /// LABEL@FOLDER for each noise factor; of several folders LABEL@FOLDER,FOLDER.
    #[arg(required = true)]
    pub(crate) columns: Vec<Column>,
    /// Folder for curve-LABEL.md and curve-LABEL.svg.
    #[arg(long)]
    pub(crate) to: PathBuf,
    /// Writes the tables into tests/docs/study-earlier.md, and the picture beside it.
    #[arg(long)]
    pub(crate) write: bool,
}

#[derive(Args)]
pub(crate) struct LedgerArguments {
    /// Writes the tables into tests/docs/seeds.md.
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
    /// Of the twins of the folder.
    #[arg(long)]
    pub(crate) twins: bool,
    /// Writes the table into tests/docs/study-earlier.md, that of twins into tests/docs/study.md.
    #[arg(long)]
    pub(crate) write: bool,
}
