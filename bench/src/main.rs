//! Process beside plant and controller: sums up, judges, draws and compares what they left behind.

fn main() -> std::process::ExitCode {
    bench::program::main()
}
