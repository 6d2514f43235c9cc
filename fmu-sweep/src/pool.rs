//! Blocks of work for threads: scoped threads and one counter. No pool outlives the call, so a process may fork before and after.

use crate::Error;
use fmu_import::threads;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Rows that a thread claims at a time.
pub(crate) const BLOCK: u64 = 8;

/// Calls `work` for each of `blocks` on up to `threads` threads, each with its own state from `begin`. With one
/// thread it is the caller's. Ends at the first error.
pub(crate) fn run<S>(
    blocks: u64,
    threads: usize,
    begin: impl Fn(usize) -> Result<S, Error> + Sync,
    work: impl Fn(&mut S, u64) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    let next = AtomicU64::new(0);
    let failed = Mutex::new(None);
    let thread = |index: usize| {
        let all = || {
            let mut state = begin(index)?;
            loop {
                let block = next.fetch_add(1, Ordering::Relaxed);
                if block >= blocks {
                    return Ok(());
                }
                work(&mut state, block)?;
            }
        };
        if let Err(error) = all() {
            next.store(blocks, Ordering::Relaxed);
            failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    };
    threads::share(threads.min(usize::try_from(blocks).unwrap_or(usize::MAX)), thread);
    failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}

/// The rows of a block, of `count` rows.
pub(crate) fn rows_of(block: u64, count: u64) -> Range<u64> {
    block * BLOCK..((block + 1) * BLOCK).min(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_is_done_once_and_errors_end_all() {
        for threads in [1, 2, 8] {
            let done = Mutex::new(Vec::new());
            run(
                100,
                threads,
                |_| Ok(()),
                |(), block| {
                    done.lock().unwrap().push(block);
                    Ok(())
                },
            )
            .unwrap();
            let mut done = done.into_inner().unwrap();
            done.sort_unstable();
            assert_eq!(done, (0..100).collect::<Vec<_>>());
            let bad = |(): &mut (), block| if block == 10 { Err(Error::Invalid("ten".into())) } else { Ok(()) };
            assert_eq!(run(100, threads, |_| Ok(()), bad).unwrap_err().to_string(), "ten");
        }
        assert_eq!(rows_of(2, 20), 16..20);
    }
}
