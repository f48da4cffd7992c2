//! Process 1: the plant behind a bus, in real time.

fn main() -> std::process::ExitCode {
    emulator::program::main()
}
