//! Manual pages and shell completions of all programs, made from the command lines that the programs parse.
//!
//! `manuals DIR` writes, below DIR, what a package installs below `/usr/share`:
//!
//! | file | for |
//! |---|---|
//! | `man/man1/airbench[-COMMAND…].1` | `man airbench-run`, `man airbench-bench-export` |
//! | `bash-completion/completions/airbench` | bash |
//! | `zsh/vendor-completions/_airbench` | zsh |
//! | `fish/vendor_completions.d/airbench.fish` | fish |
//!
//! It is a crate of its own, so that no shipped program carries the generators.

use clap::{Command, CommandFactory};
use clap_complete::{Shell, generate_to};
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What could not be written, and why.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
struct WriteError {
    path: PathBuf,
    reason: io::Error,
}

/// Where each shell looks below `/usr/share`, as Debian's packages of the shells say.
const COMPLETIONS: [(Shell, &str); 3] = [
    (Shell::Bash, "bash-completion/completions"),
    (Shell::Zsh, "zsh/vendor-completions"),
    (Shell::Fish, "fish/vendor_completions.d"),
];

/// `airbench` with the command lines of the programs where it hands all arguments on to one.
fn airbench() -> Command {
    let programs = [
        emulator::cli::Cli::command(),
        controller::cli::Cli::command(),
        bench::cli::Cli::command(),
        discrepancy::cli::Cli::command(),
        campaign::cli::Cli::command().name("campaign"),
    ];
    let inner = |program: usize, name: &str| programs[program].find_subcommand(name).cloned();
    let close = inner(3, "close").expect("discrepancy closes");
    let can = inner(2, "can").expect("bench runs SocketCAN programs");
    let commands = programs.iter().cloned().chain([close, can]);
    let whole = commands.fold(front::cli::command(), |front, command| {
        let name = command.get_name().to_owned();
        front.mut_subcommand(&name, |_| command.disable_help_subcommand(true))
    });
    whole.disable_help_subcommand(true)
}

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [folder] = &arguments[..] else {
        eprintln!("usage: manuals DIR");
        return ExitCode::from(2);
    };
    match write_all(Path::new(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("manuals: {error}");
            ExitCode::from(2)
        }
    }
}

fn write_all(share: &Path) -> Result<(), WriteError> {
    for (shell, place) in COMPLETIONS {
        let completions = folder(share, place)?;
        let written =
            generate_to(shell, &mut airbench(), "airbench", &completions).map_err(failed(&completions))?;
        if shell == Shell::Bash {
            // bash-completion looks for the program's name, without an extension.
            std::fs::rename(&written, completions.join("airbench")).map_err(failed(&written))?;
        }
    }
    let pages = folder(share, "man/man1")?;
    clap_mangen::generate_to(airbench(), &pages).map_err(failed(&pages))
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> WriteError {
    let path = path.to_owned();
    move |reason| WriteError { path, reason }
}

fn folder(share: &Path, place: &str) -> Result<PathBuf, WriteError> {
    let path = share.join(place);
    std::fs::create_dir_all(&path).map_err(failed(&path))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of all commands that people may call, as their manual pages are called.
    fn commands_of(command: &Command, prefix: &str) -> Vec<String> {
        let name = if prefix.is_empty() {
            command.get_name().to_owned()
        } else {
            format!("{prefix}-{}", command.get_name())
        };
        let shown = command.get_subcommands().filter(|inner| !inner.is_hide_set());
        let below: Vec<_> = shown.flat_map(|inner| commands_of(inner, &name)).collect();
        [name].into_iter().chain(below).collect()
    }

    #[test]
    fn every_command_has_a_manual_page_and_stands_in_every_completion() {
        let share = tempfile::tempdir().expect("a temporary folder");
        write_all(share.path()).expect("written");
        let read = |place: &str| {
            let path = share.path().join(place);
            std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{place}: {error}"))
        };
        let completions = [
            read("bash-completion/completions/airbench"),
            read("zsh/vendor-completions/_airbench"),
            read("fish/vendor_completions.d/airbench.fish"),
        ];
        let commands = commands_of(&airbench(), "");
        for name in [
            "airbench-run",
            "airbench-close",
            "airbench-can",
            "airbench-bench-export",
            "airbench-emulator-run",
        ] {
            assert!(commands.iter().any(|command| command == name), "{name}: {commands:?}");
        }
        for command in commands {
            let page = read(&format!("man/man1/{command}.1"));
            assert!(page.contains(".SH NAME") && page.contains(".SH SYNOPSIS"), "{command}");
            let last = command.rsplit('-').next().expect("a word");
            assert!(completions.iter().all(|text| text.contains(last)), "{command}");
        }
    }

    #[test]
    fn commands_that_hand_their_arguments_on_have_the_options_of_the_program() {
        let share = tempfile::tempdir().expect("a temporary folder");
        write_all(share.path()).expect("written");
        for (page, option) in
            [("airbench-close", "held"), ("airbench-emulator-run", "sealed"), ("airbench-can", "bus")]
        {
            let text =
                std::fs::read_to_string(share.path().join(format!("man/man1/{page}.1"))).expect("a page");
            assert!(text.contains(option), "{page}: {text}");
        }
    }

    #[test]
    fn hidden_commands_have_no_manual_page() {
        let share = tempfile::tempdir().expect("a temporary folder");
        write_all(share.path()).expect("written");
        let page = |name: &str| share.path().join("man/man1").join(name).exists();
        assert!(page("airbench-controller-check-library.1") && !page("airbench-controller-probe-library.1"));
    }
}
