//! Keeps processors busy, so that what must not depend on speed is tried at another speed.

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

pub struct BusyLoops {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl BusyLoops {
    pub fn on_every_processor() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let count = std::thread::available_parallelism().map_or(2, usize::from);
        let threads =
            (0..count).map(|_| Arc::clone(&stop)).map(|stop| std::thread::spawn(move || spin(&stop)));
        Self { stop: Arc::clone(&stop), threads: threads.collect() }
    }
}

impl Drop for BusyLoops {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| thread.join().expect("a busy loop does not panic"));
    }
}

fn spin(stop: &AtomicBool) {
    let mut count = 0_u64;
    while !stop.load(Ordering::Relaxed) {
        count = black_box(count.wrapping_mul(3).wrapping_add(1));
    }
}
