//! The thread that hosts the embedded bus: the rig is where the cable ends.

use protocol::bus::host::{Host, HostReport};
use realtime::Request;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// A host that serves in the background.
pub(crate) struct HostThread {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<std::io::Result<HostReport>>,
}

impl HostThread {
    /// Starts serving, with FIFO priority when `fifo_priority` names one and the machine grants it.
    #[must_use]
    pub(crate) fn start(host: Host, fifo_priority: Option<u8>) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            // The rig loop asks for the same and tells the refusals; one telling is enough.
            let _grants =
                realtime::acquire(&Request { fifo_priority, timer_slack: true, ..Request::default() });
            host.serve(&stopped)
        });
        Self { stop, thread }
    }

    /// Stops serving and tells what the host counted; `None` when it failed, which it has reported.
    #[must_use]
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
