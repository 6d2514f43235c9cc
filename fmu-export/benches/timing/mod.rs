//! Duration of a call of some nanoseconds.

use fmu_export::abi::types::c_int;
use std::time::Instant;

/// Nanoseconds per call, the best of several rounds.
pub(crate) fn time(mut call: impl FnMut() -> c_int) -> f64 {
    const CALLS: u32 = 50_000;
    let rounds = (0..200).map(|_| {
        let start = Instant::now();
        for _ in 0..CALLS {
            assert_eq!(call(), 0);
        }
        start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS)
    });
    rounds.fold(f64::INFINITY, f64::min)
}
