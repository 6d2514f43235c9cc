//! An allocator that counts the calls of each thread, and records the largest: calls of the test runner's thread are not
//! counted.
#![allow(clippy::undocumented_unsafe_blocks, reason = "an allocator that counts and passes on")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

struct Counting;

thread_local! {
    /// Creating this start value or dropping a number does not allocate.
    static CALLS: Cell<u64> = const { Cell::new(0) };
    static LARGEST: Cell<usize> = const { Cell::new(0) };
}

/// Counts one call; a thread that ends may have no counter anymore.
fn count() {
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        let _ = LARGEST.try_with(|largest| largest.set(largest.get().max(layout.size())));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Number of allocations and deallocations of this thread.
pub(crate) fn calls() -> u64 {
    CALLS.get()
}

/// The largest allocation of this thread since the last call, in bytes.
#[allow(dead_code, reason = "a module of several test programs, one of which asks")]
pub(crate) fn largest() -> usize {
    LARGEST.take()
}

/// Another thread that allocates until this is dropped, as the test runner's thread may at any time.
#[must_use]
pub(crate) fn neighbor() -> Arc<AtomicU64> {
    let done = Arc::new(AtomicU64::new(0));
    let seen = Arc::downgrade(&done);
    std::thread::spawn(move || {
        while let Some(done) = seen.upgrade() {
            drop(black_box(Box::new(done.fetch_add(1, Relaxed))));
        }
    });
    while done.load(Relaxed) < 2 {
        std::thread::yield_now();
    }
    done
}
