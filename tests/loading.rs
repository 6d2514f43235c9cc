//! A thousand times loaded, run and unloaded, by eight threads with a hundred instances at once, without leftovers. A
//! separate test program: it measures the whole process.
#![cfg(target_os = "linux")]
#![allow(missing_docs)]

mod common;

use fmu_import::Fmu;
use std::path::Path;
use std::sync::Barrier;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

const THREADS: u32 = 8;
const INSTANCES: u32 = 100;
const CYCLES: u32 = 1000;
/// Cycles after which the memory of a process is stable: arenas of the threads, tables of the loader.
const WARM: u32 = 300;
/// The remaining cycles are measured in blocks: a leak grows in each of them, whereas the allocator's arenas grow by leaps, here
/// or there.
const BLOCKS: u32 = 7;
/// Allowed growth in bytes in the block that grows least; over a thousand instances exist in a block, so a leak of a kilobyte each
/// would be 1 MB.
const GROWTH: u64 = 256 << 10;

/// Resident memory in bytes.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    text.split(' ').nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

/// One loading with `instances` lives at once.
fn cycle(path: &Path, instances: u32) {
    // Each opening unpacks its own copy, so that this loads and unloads a library regardless of the other threads.
    let fmu = Fmu::open(path).unwrap();
    let mut all: Vec<_> = (0..instances)
        .map(|k| {
            let mut it = fmu.instantiate(&format!("instance {k}"), false).unwrap();
            it.setup(0.0, None).unwrap();
            it.enter_initialization().unwrap();
            it.exit_initialization().unwrap();
            it
        })
        .collect();
    for it in &mut all {
        let _ = it.do_step(0.0, 1e-4).unwrap();
        let state = it.get_state().unwrap();
        let _ = it.do_step(1e-4, 1e-4).unwrap();
        it.set_state(state).unwrap();
        let stored = it.serialize_state(state).unwrap();
        let again = it.deserialize_state(&stored).unwrap();
        it.free_state(again).unwrap();
        it.free_state(state).unwrap();
        // An error leaves a message and its text.
        assert!(it.do_step(5.0, 1e-4).is_err());
    }
}

/// `cycles` of them, shared by the threads.
fn run(path: &Path, cycles: u32) {
    let (next, together) = (AtomicU32::new(0), Barrier::new(THREADS as usize));
    std::thread::scope(|scope| {
        for thread in 0..THREADS {
            let (next, together) = (&next, &together);
            scope.spawn(move || {
                together.wait();
                let mine = INSTANCES / THREADS + u32::from(thread < INSTANCES % THREADS);
                while next.fetch_add(1, Relaxed) < cycles {
                    cycle(path, mine);
                }
            });
        }
    });
}

#[test]
fn a_thousand_loadings_leave_nothing_behind() {
    let path = common::archives().join("fmi3/SensorlessController.fmu");
    run(&path, WARM);
    let cycles = (CYCLES - WARM) / BLOCKS;
    let grown: Vec<u64> = (0..BLOCKS)
        .map(|_| {
            let before = resident();
            run(&path, cycles);
            resident().saturating_sub(before)
        })
        .collect();
    println!("bytes more in each of {BLOCKS} blocks of {cycles} loadings after the first {WARM}: {grown:?}");
    assert!(grown.iter().min().unwrap() < &GROWTH, "{grown:?} bytes more in blocks of {cycles} loadings");
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let left: Vec<_> = maps.lines().filter(|line| line.contains("SensorlessController")).collect();
    assert!(left.is_empty(), "still loaded: {left:?}");
    // The measurement works: a loaded binary is in the list.
    let fmu = Fmu::open(&path).unwrap();
    assert!(std::fs::read_to_string("/proc/self/maps").unwrap().contains("SensorlessController"));
    drop(fmu);
}
