//! Ctrl-C and SIGTERM as a flag that a loop looks at.
//!
//! The first one sets the flag, so that the loop ends at its next cycle and everything is saved; a second one of the
//! same kind ends the process at once, for whoever does not want to wait.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set once somebody asked the process to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Starts watching; `exit_code` is what a second signal ends the process with.
    ///
    /// # Errors
    /// What the system says when it takes no handler.
    pub fn watch(exit_code: i32) -> io::Result<Self> {
        let interrupt = Self::default();
        for signal in [SIGINT, SIGTERM] {
            // In this order: the shutdown looks at the flag that the handler after it sets.
            flag::register_conditional_shutdown(signal, exit_code, Arc::clone(&interrupt.0))?;
            flag::register(signal, Arc::clone(&interrupt.0))?;
        }
        Ok(interrupt)
    }

    /// Whether a signal came.
    #[must_use]
    pub fn came(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Asks for the end from inside, as a signal would.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_sets_the_flag_and_the_process_goes_on() {
        let interrupt = Interrupt::watch(130).unwrap();
        assert!(!interrupt.came());
        signal_hook::low_level::raise(SIGTERM).unwrap();
        assert!(interrupt.came());
    }
}
