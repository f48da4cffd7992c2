//! An allocator that counts, for the proof that a cycle allocates nothing.
//!
//! A call to the allocator inside the 1 ms path can take a lock, fault a page or ask the kernel for memory; it shows as
//! one late cycle in a million. Reading the code for hidden allocations misses those in libraries. So a program may
//! register [`CountingAllocator`] (those of `tests/counting/` do), the real-time thread opens a [`count_scope`] once it
//! has warmed up, and [`counted`] must then stay 0.
//!
//! A freed block counts too: giving memory back takes the same locks. Without the registration nothing is counted and
//! [`counted`] is 0, which then proves nothing; [`is_registered`] distinguishes the two.
//!
//! # Source
//! The contract of `std::alloc::GlobalAlloc`: an allocator must not unwind and must not allocate through itself.

#![allow(
    unsafe_code,
    reason = "GlobalAlloc is an unsafe trait; every method hands over to the system's allocator"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Calls counted since the start or the last [`reset`], of all threads together.
static COUNTED: AtomicU64 = AtomicU64::new(0);

/// Whether a call has come through [`CountingAllocator`]; the first comes before `main`.
static REGISTERED: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// How many scopes this thread has open. Const and without a destructor, so that reading it never allocates.
    static SCOPES: Cell<u32> = const { Cell::new(0) };
}

/// The system's allocator, and a count of the calls made inside a [`CountScope`].
#[derive(Clone, Copy, Debug, Default)]
pub struct CountingAllocator;

// SAFETY: each method passes its arguments unchanged to `System`, which upholds the contract; counting neither
// allocates nor unwinds.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_if_in_scope();
        // SAFETY: the caller upholds the contract of `alloc`, which is the same for `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count_if_in_scope();
        // SAFETY: the caller upholds the contract of `alloc_zeroed`, which is the same for `System`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count_if_in_scope();
        // SAFETY: the caller upholds the contract of `realloc`; `pointer` came from `System`, as every block here does.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count_if_in_scope();
        // SAFETY: the caller upholds the contract of `dealloc`; `pointer` came from `System`, as every block here does.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn count_if_in_scope() {
    if !REGISTERED.load(Ordering::Relaxed) {
        REGISTERED.store(true, Ordering::Relaxed);
    }
    // At the very end of a thread its locals may be gone: then nothing is counted.
    if SCOPES.try_with(Cell::get).is_ok_and(|scopes| scopes > 0) {
        COUNTED.fetch_add(1, Ordering::Relaxed);
    }
}

/// Counts the calls of this thread to the allocator for as long as it lives. Scopes may be nested.
#[must_use = "the scope ends when it is dropped"]
#[derive(Debug)]
pub struct CountScope {
    /// Keeps the scope on its own thread, whose counter it must take back.
    not_send: PhantomData<*const ()>,
}

/// Opens a scope on this thread.
pub fn count_scope() -> CountScope {
    SCOPES.set(SCOPES.get() + 1);
    CountScope { not_send: PhantomData }
}

impl Drop for CountScope {
    fn drop(&mut self) {
        SCOPES.set(SCOPES.get() - 1);
    }
}

/// Calls to the allocator that threads have made inside a [`CountScope`].
pub fn counted() -> u64 {
    COUNTED.load(Ordering::Relaxed)
}

/// Whether this program's allocator counts.
pub fn is_registered() -> bool {
    REGISTERED.load(Ordering::Relaxed)
}

/// Starts counting at 0 again.
pub fn reset() {
    COUNTED.store(0, Ordering::Relaxed);
}
