//! The command `airbench`.

use std::process::ExitCode;

fn main() -> ExitCode {
    front::main(std::env::args_os().collect())
}
