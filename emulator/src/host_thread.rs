//! The thread that hosts the embedded bus.

use protocol::bus::host::{Host, HostReport};
use realtime::Request;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

pub(crate) struct HostThread {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<std::io::Result<HostReport>>,
}

impl HostThread {
    /// Starts the host, with FIFO priority if `fifo_priority` is given and granted.
    #[must_use]
    pub(crate) fn start(host: Host, fifo_priority: Option<u8>) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            // The rig loop makes the same request and reports the refusals.
            let _grants =
                realtime::acquire(&Request { fifo_priority, timer_slack: true, ..Request::default() });
            host.serve(&stopped)
        });
        Self { stop, thread }
    }

    /// Stops the host and returns its counters; `None` when it failed, which it has reported.
    pub(crate) fn stop(self) -> Option<HostReport> {
        self.stop.store(true, Ordering::Relaxed);
        match self.thread.join() {
            Ok(Ok(report)) => Some(report),
            Ok(Err(error)) => {
                protocol::say!("emulator: the bus host failed: {error}");
                None
            }
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}
