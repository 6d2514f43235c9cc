//! Threads that share work.

use std::num::NonZero;
use std::thread;

/// Number of threads that the machine runs at once.
pub fn available() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

/// Calls `work` with 0, 1, 2, ... on up to that many threads; number 0 is the calling thread, because a busy system may be unable
/// to start another. No thread outlives the call, so a process may fork before and after.
pub fn share(threads: usize, work: impl Fn(usize) + Sync) {
    thread::scope(|scope| {
        let work = &work;
        for index in 1..threads {
            let _ = thread::Builder::new().spawn_scoped(scope, move || work(index));
        }
        work(0);
    });
}
