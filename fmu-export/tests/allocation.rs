//! Calls during a simulation do not allocate. A test crate of its own: it counts for the whole process.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

struct Counting;

static CALLS: AtomicU64 = AtomicU64::new(0);

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        CALLS.fetch_add(1, Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_allocation_while_simulating() {
    for version in [2, 3] {
        let fmu = Fmu::started(version);
        let mut state = null_mut();
        assert_eq!(fmu.save(&mut state), OK);
        let mut values = [0.0; 6];
        let before = CALLS.load(Relaxed);
        for k in 0..100 {
            let t = f64::from(k) * 0.1;
            assert_eq!(fmu.set(&[U, K, U, K, U, GAIN], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), OK);
            assert_eq!(fmu.step(t, 0.1), OK);
            assert_eq!(fmu.try_get(&[TIME, X, U, K, GAIN, DOUBLE_GAIN], &mut values), OK);
            assert_eq!((fmu.save(&mut state), fmu.restore(state)), (OK, OK));
        }
        assert_eq!(CALLS.load(Relaxed), before);
        // The counter counts.
        assert_eq!(fmu.step(0.0, -1.0), ERROR);
        assert!(CALLS.load(Relaxed) > before);
        assert_eq!(fmu.free_state(&mut state), OK);
    }
}
