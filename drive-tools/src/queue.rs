//! A work queue: every thread takes the next job when it is free; results are returned in the order of the jobs.

use fmu_import::threads;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Runs `work` on every job, on all cores.
///
/// # Panics
/// If `work` panics.
pub fn map<J: Sync, R: Send>(jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    map_on(threads::available(), jobs, work)
}

/// Runs `work` on every job, on up to `count` threads.
///
/// # Panics
/// If `work` panics.
pub fn map_on<J: Sync, R: Send>(count: usize, jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(jobs.len())));
    let worker = || {
        while let index = next.fetch_add(1, Ordering::Relaxed)
            && let Some(job) = jobs.get(index)
        {
            let result = work(job);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
        }
    };
    threads::share(count.min(jobs.len()), |_| worker());
    let mut all = done.into_inner().unwrap_or_else(PoisonError::into_inner);
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
        assert_eq!(super::map_on(0, &jobs[..2], |j| *j), [0, 1]);
    }
}
