//! Real-time runs take turns: two of them on two processors would disturb each other, in one test file or in two.

use crate::binaries::workspace;
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
use std::path::PathBuf;

/// What a controller says that was left without a processor for too long (`axis/src/chains/fault.rs`); `scripts/vm/job-functions`
/// knows the same.
pub const LATENESS: [&str; 3] = ["exceeded its time limit", "fell silent", "did not come to rest"];

/// The machine, as long as it is held.
pub struct MachineLock {
    _lock: File,
}

/// What whoever has the machine has locked.
pub fn path() -> PathBuf {
    workspace().join("target/turn.lock")
}

/// Waits for the machine; it is this test's until the turn goes, or its process.
pub fn take() -> MachineLock {
    let path = path();
    let made = std::fs::create_dir_all(path.parent().expect("a folder")).and_then(|()| File::create(&path));
    let lock = made.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    // Each opening of the file has a lock of its own, so that threads of one process wait for each other too.
    flock(&lock, FlockOperation::LockExclusive).unwrap_or_else(|error| panic!("turn.lock: {error}"));
    MachineLock { _lock: lock }
}
