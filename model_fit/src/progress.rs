//! Progress of work that takes long: a line every ten seconds, from the thread that waits for it.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

const EVERY: Duration = Duration::from_secs(10);

/// Parts of the work that are done.
pub(super) struct ProgressCounter(AtomicUsize);

impl ProgressCounter {
    pub(super) fn increment(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// Does work on another thread, and says every ten seconds how much of it is done.
pub(super) fn with_progress<T: Send>(
    progress: &mut dyn FnMut(&str),
    (what, parts): (&str, usize),
    work: impl FnOnce(&ProgressCounter) -> T + Send,
) -> T {
    every(EVERY, progress, (what, parts), work)
}

fn every<T: Send>(
    period: Duration,
    progress: &mut dyn FnMut(&str),
    (what, parts): (&str, usize),
    work: impl FnOnce(&ProgressCounter) -> T + Send,
) -> T {
    let done = ProgressCounter(AtomicUsize::new(0));
    std::thread::scope(|scope| {
        let (working, ended) = channel::<()>();
        let seen = &done;
        let worker = scope.spawn(move || {
            // Dropped when the work ends, by a panic too.
            let _working = working;
            work(seen)
        });
        while ended.recv_timeout(period) == Err(RecvTimeoutError::Timeout) {
            progress(&format!("{what}: {} of {parts} done", done.0.load(Ordering::Relaxed)));
        }
        worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn work_says_how_much_is_done_until_it_ends() {
        let (sender, receiver) = sync_channel(1);
        let mut lines = Vec::new();
        let mut progress = |line: &str| {
            lines.push(line.to_owned());
            let _ = sender.try_send(());
        };
        let result = every(Duration::from_millis(1), &mut progress, ("fits", 2), move |done| {
            done.increment();
            // Until a line was printed.
            receiver.recv().expect("the other end waits");
            7
        });
        assert_eq!(result, 7);
        assert!(
            lines.iter().all(|line| line.starts_with("fits: ") && line.ends_with(" of 2 done")),
            "{lines:?}"
        );
    }

    #[test]
    #[should_panic(expected = "of the work")]
    fn a_panic_of_the_work_is_that_of_the_caller() {
        every::<()>(Duration::from_secs(1), &mut |_| {}, ("fits", 1), |_| panic!("of the work"));
    }
}
