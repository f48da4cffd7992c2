//! Campaigns as a program.

fn main() -> std::process::ExitCode {
    campaign::commands::main()
}
