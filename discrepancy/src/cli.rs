//! The command line: the whole workflow, and its steps alone.

use clap::{Args, Parser, Subcommand};
use protocol::exit::EXIT_CODE_HELP;
use records::{ReadOptions, UnlistedColumns};
use std::path::PathBuf;

/// Finds where model and records disagree, names the missing effect, adds it to the model and shows the gap shrink.
#[derive(Debug, Parser)]
#[command(name = "discrepancy", version, about, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The workflow and its steps.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run the whole workflow: report.json, report.html, the extended rig or model file, and next-NAME.toml where an experiment
    /// is proposed for a rig file.
    #[command(
        override_usage = "discrepancy close <--model MODEL | --rig RIG> --train TRAIN... [--test TEST...] [OPTIONS]"
    )]
    Close(CloseArguments),
    /// Check whether records can be used, and estimate their noise.
    #[command(override_usage = "discrepancy check <--model MODEL | --rig RIG> --train TRAIN... [OPTIONS]")]
    Check(RecordArguments),
    /// Estimate the baseline's parameters from records, with standard errors, and list those that cannot be identified.
    Calibrate(RecordArguments),
    /// Locate which balance disagrees, in which regime, over which variables.
    Locate(RecordArguments),
    /// Name the missing effects: like 'close', without a held-out record.
    #[command(override_usage = "discrepancy name <--model MODEL | --rig RIG> --train TRAIN... [OPTIONS]")]
    Name(NameArguments),
    /// Write the rig file, or the model file, extended by what a report names.
    Extend(ExtendArguments),
    /// Judge an extended rig file on a record that it was not fitted on.
    Verify(VerifyArguments),
    /// Print a model file's equations, numbers, units and suspects; with records, which of them these can tell apart.
    Explain(ExplainArguments),
    /// Simulate a model file over a record with the values of the file, without fit and suspects: what it says beside what was
    /// measured.
    Simulate(SimulateArguments),
    /// Write a first model file from the columns of a record: units from their names, inputs and outputs guessed.
    New(NewArguments),
    /// List the ready suspects that model files use: laws, what they are bound to, numbers with unit and range.
    Suspects(SuspectsArguments),
    /// Propose the experiment that distinguishes the effects that a report could not.
    Next(NextArguments),
}

/// Records and the model.
#[derive(Args, Clone, Debug)]
pub(crate) struct RecordArguments {
    /// Rig file: the model. For close, name and check also a model file, of any plant.
    #[arg(long, visible_alias = "model")]
    pub(crate) rig: PathBuf,
    /// Training records: measurement.csv, bus.log, or any CSV with --mapping.
    #[arg(long, required = true, num_args = 1..)]
    pub(crate) train: Vec<PathBuf>,
    /// Folder for the results, made if missing. Where none is given, close and name write into this folder: discrepancy-results;
    /// the other steps write no files.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) read: ReadArguments,
    /// Threads; the results do not depend on them. Default: all cores.
    #[arg(long)]
    pub(crate) threads: Option<usize>,
}

/// How records are read.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReadArguments {
    /// Mapping file of foreign CSV records, for a rig file; [record] of a model file says how its records are read.
    #[arg(long)]
    pub(crate) mapping: Option<PathBuf>,
    /// Refuse records with columns that the measurement file does not know (a model file reads its own alone); with
    /// close, exit code 1 too where the held-out record contradicts the verdict, or no suspect of a model file explains what is
    /// left.
    #[arg(long)]
    pub(crate) strict: bool,
}

impl ReadArguments {
    /// The same for the reader.
    pub(crate) fn options(&self) -> ReadOptions {
        let unknown = if self.strict { UnlistedColumns::Refused } else { UnlistedColumns::Ignored };
        ReadOptions { unknown, mapping: self.mapping.clone(), ..ReadOptions::default() }
    }
}

/// What naming is given.
#[derive(Args, Clone, Debug)]
pub(crate) struct NameArguments {
    /// Model and training records.
    #[command(flatten)]
    pub(crate) records: RecordArguments,
    /// An effect that is no candidate; may be given several times.
    #[arg(long, value_name = "EFFECT")]
    pub(crate) without: Vec<String>,
    /// File of suspects beside the rig file: terms as expressions that may be missing, candidates beside the effects.
    #[arg(long, value_name = "FILE")]
    pub(crate) suspects: Option<PathBuf>,
    /// Give each explanation its marginal likelihood beside the probability that decides.
    #[arg(long)]
    pub(crate) marginal_likelihoods: bool,
    /// Of a model file: wherever no suspect is named, search for terms that none of them describes; without it, where more
    /// than noise is left.
    #[arg(long)]
    pub(crate) discover: bool,
    /// Of a model file: no such search.
    #[arg(long, conflicts_with = "discover")]
    pub(crate) no_discover: bool,
}

/// What the whole workflow is given.
#[derive(Args, Clone, Debug)]
pub(crate) struct CloseArguments {
    /// What naming is given.
    #[command(flatten)]
    pub(crate) name: NameArguments,
    /// Held-out record, used only to judge the model; a model file accepts several.
    #[arg(long, num_args = 1..)]
    pub(crate) test: Vec<PathBuf>,
}

/// What is explained.
#[derive(Args, Clone, Debug)]
pub(crate) struct ExplainArguments {
    /// Model file.
    pub(crate) model: PathBuf,
    /// Records that the model is fitted to.
    #[arg(long, num_args = 1..)]
    pub(crate) train: Vec<PathBuf>,
    /// A page of it beside the text: equations set, inputs, states, outputs, numbers with their units, suspects.
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,
}

/// What is simulated.
#[derive(Args, Clone, Debug)]
pub(crate) struct SimulateArguments {
    /// Model file.
    pub(crate) model: PathBuf,
    /// Record whose inputs drive it.
    #[arg(long)]
    pub(crate) record: PathBuf,
    /// New table: the columns of the record that the model reads, and NAME_model for each output.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}

/// What a model file begins from.
#[derive(Args, Clone, Debug)]
pub(crate) struct NewArguments {
    /// Record: a text table with names above its columns.
    pub(crate) record: PathBuf,
    /// Columns that drive the plant, separated by commas; the role of all others is guessed.
    #[arg(long, value_delimiter = ',', value_name = "COLUMN")]
    pub(crate) inputs: Vec<String>,
    /// Columns that are measured of it.
    #[arg(long, value_delimiter = ',', value_name = "COLUMN")]
    pub(crate) outputs: Vec<String>,
    /// The new model file; without it the text is printed.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}

/// Which suspects are listed.
#[derive(Args, Clone, Debug)]
pub(crate) struct SuspectsArguments {
    /// A library, such as friction, or one suspect of it, such as friction/stribeck; of a library of your own its file, and
    /// FILE.toml/SUSPECT. Without it all that ship are listed, a line each.
    pub(crate) name: Option<String>,
}

/// What a rig file is extended by.
#[derive(Args, Clone, Debug)]
pub(crate) struct ExtendArguments {
    /// Rig file or model file that the report was made with.
    #[arg(long, visible_alias = "model")]
    pub(crate) rig: PathBuf,
    /// report.json.
    #[arg(long)]
    pub(crate) report: PathBuf,
    /// The new rig file or model file.
    #[arg(long)]
    pub(crate) out: PathBuf,
}

/// What is judged on what.
#[derive(Args, Clone, Debug)]
pub(crate) struct VerifyArguments {
    /// Rig file before.
    #[arg(long)]
    pub(crate) rig: PathBuf,
    /// Rig file after.
    #[arg(long)]
    pub(crate) extended: PathBuf,
    /// The held-out record.
    #[arg(long)]
    pub(crate) test: PathBuf,
    #[command(flatten)]
    pub(crate) read: ReadArguments,
    /// Folder for verification.json, made if missing; without it nothing is written.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}

/// What is to be distinguished.
#[derive(Args, Clone, Debug)]
pub(crate) struct NextArguments {
    /// Rig file that the report was made with.
    #[arg(long)]
    pub(crate) rig: PathBuf,
    /// report.json with the verdict ambiguous.
    #[arg(long)]
    pub(crate) report: PathBuf,
    /// The experiment file.
    #[arg(long)]
    pub(crate) out: PathBuf,
}

#[cfg(test)]
mod tests {
    use super::Cli;
    use clap::CommandFactory;

    #[test]
    fn the_usage_names_a_model_file_beside_a_rig_file() {
        for step in ["close", "check", "name"] {
            let mut command = Cli::command();
            let usage = command.find_subcommand_mut(step).unwrap().render_usage().to_string();
            let expected = format!("discrepancy {step} <--model MODEL | --rig RIG> --train");
            assert!(usage.contains(&expected), "{usage}");
        }
    }
}
