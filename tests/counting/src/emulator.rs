//! The emulator, whose allocations in the 1 ms path are counted.

use realtime::allocations::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> std::process::ExitCode {
    emulator::program::main()
}
