//! Exit codes of all programs as the documentation promises them, not as `protocol` has them: a change there has to break a test.

pub const GOOD: i32 = 0;
pub const BOUND_BROKEN: i32 = 1;
pub const BAD_INPUT: i32 = 2;
pub const BUS_FAILED: i32 = 3;
pub const LOCKSTEP_TIMEOUT: i32 = 4;
pub const INTERRUPTED: i32 = 130;
