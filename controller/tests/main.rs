//! The integration tests of `controller`, one executable; `plugin` needs a process of its own: it counts allocations.

mod axis_properties;
mod axis_way_back;
mod linearisation;
mod skipped_cycles;
