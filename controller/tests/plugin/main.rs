//! Algorithms from shared libraries: the example in C from its build line to the set-point, and a table of libraries that each do
//! one thing wrong.

mod build;
mod example;
mod latched;
#[allow(dead_code, reason = "the example keeps the first of these laws; wind-up is tested with the plant")]
#[path = "../../../algorithms/src/laws.rs"]
mod laws;
mod position_pi;
mod refused;

/// So that `position_pi.rs` compiles as it would beside the shipped algorithms.
use algorithms::algorithm;

/// Counts what a test allocates inside a scope.
#[global_allocator]
static ALLOCATOR: realtime::allocations::CountingAllocator = realtime::allocations::CountingAllocator;
