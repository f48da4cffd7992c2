//! The host of an embedded bus in a thread of its own.

use super::host::{Host, HostReport};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Serves a bus until it is stopped or dropped.
pub struct HostThread {
    stop: Arc<AtomicBool>,
    /// `None` once it was joined.
    thread: Option<JoinHandle<io::Result<HostReport>>>,
}

impl HostThread {
    /// Starts the thread. `prepare` runs in it first, to ask for real-time priority; what it returns is kept until the end.
    #[must_use]
    pub fn start<G>(host: Host, prepare: impl FnOnce() -> G + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let _grants = prepare();
            host.serve(&stopped)
        });
        Self { stop, thread: Some(thread) }
    }

    /// Stops the host and returns its counters. A panic of the thread goes on in the caller.
    ///
    /// # Errors
    /// The reason why the host ended by itself: epoll or the wire's timer failed.
    pub fn stop(self) -> io::Result<HostReport> {
        self.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    /// As [`stop`](Self::stop), but returns a panic of the thread: a destructor must not panic.
    ///
    /// # Errors
    /// What the thread panicked with.
    pub fn join(mut self) -> std::thread::Result<io::Result<HostReport>> {
        self.end().expect("joined here alone")
    }

    fn end(&mut self) -> Option<std::thread::Result<io::Result<HostReport>>> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join)
    }
}

impl Drop for HostThread {
    fn drop(&mut self) {
        // Whoever wants its result stops it.
        let _ = self.end();
    }
}
