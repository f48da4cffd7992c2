//! Real-time runs take turns: two of them on two processors would disturb each other, in one test file or in two.

use crate::binaries::workspace;
use rustix::fs::{FlockOperation, flock};
use std::fs::File;

/// The machine, as long as it is held.
pub struct Turn {
    _lock: File,
}

/// Waits for the machine; it is this test's until the turn goes, or its process.
pub fn take() -> Turn {
    let folder = workspace().join("target");
    let made = std::fs::create_dir_all(&folder).and_then(|()| File::create(folder.join("turn.lock")));
    let lock = made.unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    // Each opening of the file has a lock of its own, so that threads of one process wait for each other too.
    flock(&lock, FlockOperation::LockExclusive).unwrap_or_else(|error| panic!("turn.lock: {error}"));
    Turn { _lock: lock }
}
