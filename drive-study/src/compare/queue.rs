//! A work queue: every core takes the next job when it is free; results are returned in the order of the jobs.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Runs `work` on every job, on all cores.
pub fn map<J: Sync, R: Send>(jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    map_on(thread::available_parallelism().map_or(1, NonZero::get), jobs, work)
}

/// Runs `work` on every job, on this many threads.
pub fn map_on<J: Sync, R: Send>(threads: usize, jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut mine = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else { return mine };
            mine.push((index, work(job)));
        }
    };
    let mut all: Vec<(usize, R)> = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.max(1).min(jobs.len())).map(|_| scope.spawn(worker)).collect();
        let join = |w: thread::ScopedJoinHandle<'_, _>| w.join().unwrap_or_else(|p| std::panic::resume_unwind(p));
        workers.into_iter().flat_map(join).collect()
    });
    all.sort_unstable_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_job_is_done_once_and_in_order() {
        let jobs: Vec<u32> = (0..1000).collect();
        assert_eq!(super::map(&jobs, |j| 2 * j), jobs.iter().map(|j| 2 * j).collect::<Vec<_>>());
        assert!(super::map(&[] as &[u32], |j| *j).is_empty());
    }
}
