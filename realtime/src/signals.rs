//! Signals as values that a loop or a thread looks at.
//!
//! | signal | value | means |
//! |---|---|---|
//! | SIGINT, SIGTERM | [`Interrupt`] | end, with everything saved |
//! | SIGUSR1 | [`Freeze`] | write down the last seconds |
//! | SIGCONT | [`Continued`] | the process had been stopped, which explains a late cycle |
//!
//! The loop ends at its next cycle and everything is saved, however many signals follow: Ctrl-C reaches a process through its
//! terminal and again through whoever started it. There is no forced end here; Ctrl-\ is for a process that hangs.

use signal_hook::consts::{SIGCONT, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Set once somebody asked the process to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Installs the handlers of SIGINT and SIGTERM.
    ///
    /// # Errors
    /// What the system says when it takes no handler.
    pub fn install() -> io::Result<Self> {
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

/// Somebody asked for the last seconds to be written down.
#[derive(Clone, Debug, Default)]
pub struct Freeze(Arc<AtomicBool>);

impl Freeze {
    /// Installs the handler; from then on SIGUSR1 does not end the process.
    ///
    /// # Errors
    /// What the system says when it takes no handler.
    pub fn install() -> io::Result<Self> {
        let freeze = Self::default();
        flag::register(SIGUSR1, Arc::clone(&freeze.0))?;
        Ok(freeze)
    }

    /// Whether a signal came since the last look.
    #[must_use]
    pub fn take(&self) -> bool {
        self.0.swap(false, Ordering::Relaxed)
    }
}

/// How often the process was continued after a stop.
#[derive(Clone, Debug, Default)]
pub struct Continued(Arc<AtomicU64>);

impl Continued {
    /// Installs the handler and starts counting.
    ///
    /// # Errors
    /// What the system says when it takes no handler.
    pub fn install() -> io::Result<Self> {
        let continued = Self::default();
        let count = Arc::clone(&continued.0);
        let raise = move || {
            count.fetch_add(1, Ordering::Relaxed);
        };
        #[allow(unsafe_code, reason = "signal-hook counts no signals without a handler of one's own")]
        // SAFETY: the handler does nothing but raise an atomic, which is async-signal-safe and cannot panic.
        unsafe {
            signal_hook::low_level::register(SIGCONT, raise)?;
        }
        Ok(continued)
    }

    /// Signals so far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second signal once ended the process with its rows unsaved: both kinds shared the flag that armed a forced end.
    #[test]
    fn however_many_signals_come_they_only_set_the_flag() {
        let interrupt = Interrupt::install().unwrap();
        assert!(!interrupt.came());
        for signal in [SIGINT, SIGTERM, SIGINT, SIGTERM] {
            signal_hook::low_level::raise(signal).unwrap();
            assert!(interrupt.came());
        }
    }

    #[test]
    fn each_continuation_is_counted() {
        let continued = Continued::install().unwrap();
        for count in 1..=3 {
            signal_hook::low_level::raise(SIGCONT).unwrap();
            assert_eq!(continued.count(), count);
        }
    }

    #[test]
    fn a_freeze_is_taken_once_and_ends_nothing() {
        let freeze = Freeze::install().unwrap();
        assert!(!freeze.take());
        signal_hook::low_level::raise(SIGUSR1).unwrap();
        assert!(freeze.take());
        assert!(!freeze.take());
    }
}
