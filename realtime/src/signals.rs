//! Ctrl-C and SIGTERM as a flag that a loop looks at.
//!
//! The loop ends at its next cycle and everything is saved, however many signals follow: Ctrl-C reaches a process through its
//! terminal and again through whoever started it. There is no forced end here; Ctrl-\ is for a process that hangs.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set once somebody asked the process to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Starts watching.
    ///
    /// # Errors
    /// What the system says when it takes no handler.
    pub fn watch() -> io::Result<Self> {
        let interrupt = Self::default();
        for signal in [SIGINT, SIGTERM] {
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

    /// A second signal once ended the process with its rows unsaved: both kinds shared the flag that armed a forced end.
    #[test]
    fn however_many_signals_come_they_only_set_the_flag() {
        let interrupt = Interrupt::watch().unwrap();
        assert!(!interrupt.came());
        for signal in [SIGINT, SIGTERM, SIGINT, SIGTERM] {
            signal_hook::low_level::raise(signal).unwrap();
            assert!(interrupt.came());
        }
    }
}
