//! The program `bench`: tools around emulator and controller.

fn main() -> std::process::ExitCode {
    bench::program::main()
}
