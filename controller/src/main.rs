//! Process 2: the axis controllers behind a bus.

fn main() -> std::process::ExitCode {
    controller::main()
}
