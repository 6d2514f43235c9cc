//! Calls during a simulation do not allocate. A separate test program: it replaces the allocator.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;
mod counting;

use common::model::*;
use common::*;
use counting::{calls, neighbor};
use std::ptr::null_mut;

#[test]
fn no_allocation_while_simulating() {
    let _neighbor = neighbor();
    for version in [2, 3] {
        let fmu = Fmu::started(version);
        let mut state = null_mut();
        assert_eq!(fmu.save(&mut state), OK);
        let mut values = [0.0; 5];
        let before = calls();
        for k in 0..100 {
            let t = f64::from(k) * 0.1;
            assert_eq!(fmu.set(&[U, K, U, K, U, GAIN], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), OK);
            assert_eq!(fmu.step(t, 0.1), OK);
            assert_eq!(fmu.try_get(&[X, U, K, GAIN, DOUBLE_GAIN], &mut values), OK);
            assert_eq!((fmu.save(&mut state), fmu.restore(state)), (OK, OK));
        }
        assert_eq!(calls(), before);
        // The counter counts.
        assert_eq!(fmu.step(0.0, -1.0), ERROR);
        assert!(calls() > before);
        assert_eq!(fmu.free_state(&mut state), OK);
    }
}
