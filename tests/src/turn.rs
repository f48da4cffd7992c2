//! Real-time runs of one test file take turns: two of them on two processors would disturb each other.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Waits for the machine; it is this test's until the guard goes.
pub fn take() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    // A test that failed while it held the machine has left it.
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}
