//! Load: thousands of instances at once, a thousand threads, a day in one instance. A separate test program: it measures the whole process.
#![cfg(target_os = "linux")]
#![allow(missing_docs)]

mod common;

use fmu_import::{Fmu, Instance, Kind};
use std::sync::{Barrier, Mutex, MutexGuard, PoisonError};

/// Growth in bytes that is no leak: tables of the allocator and of the loader.
const SLACK: u64 = 512 << 10;

/// Rounds in which the memory is measured.
const ROUNDS: u32 = 4;

/// The tests run one by one, because each measures the memory of the whole process.
fn in_turn() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Resident memory in bytes.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    text.split(' ').nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

fn open(standard: &str, name: &str) -> Fmu {
    Fmu::open(common::archives().join(standard).join(name).with_extension("fmu")).unwrap()
}

/// An instance whose speed, and so every bit of its results, depends on its number.
fn started(fmu: &Fmu, number: u32) -> Instance {
    let mut it = fmu.instantiate(&format!("instance {number}"), false).unwrap();
    it.set("initial.speed", vec![f64::from(number % 97)]).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    it
}

/// The bits of the speed after some steps from `from` on.
fn stepped(it: &mut Instance, from: u32, steps: u32) -> u64 {
    for k in from..from + steps {
        let _ = it.do_step(f64::from(k) * 1e-4, 1e-4).unwrap();
    }
    it.get_as::<f64>("speed").unwrap().to_bits()
}

/// The bits of each of the 97 instances that differ, run alone.
fn alone(fmu: &Fmu) -> Vec<u64> {
    (0..97).map(|number| stepped(&mut started(fmu, number), 0, 4)).collect()
}

/// All live at once, step in turn, and have the bits of an instance alone.
fn instances(standard: &str, count: u32) {
    let fmu = open(standard, "PmsmPlant");
    let expected = alone(&fmu);
    let run = || {
        let mut all: Vec<Instance> = (0..count).map(|number| started(&fmu, number)).collect();
        for it in &mut all {
            let _ = stepped(it, 0, 2);
        }
        let most = resident();
        for (number, it) in all.iter_mut().enumerate().rev() {
            assert_eq!(stepped(it, 2, 2), expected[number % 97], "{standard}, instance {number} of {count}");
        }
        most
    };
    // The first round leaves the allocator's arenas, which grow by leaps later; a leak grows in every round.
    let (least, most) = (resident(), run());
    let grown = (0..ROUNDS).map(|_| {
        let before = resident();
        run();
        resident().saturating_sub(before)
    });
    let grown: Vec<u64> = grown.collect();
    let each = (most.saturating_sub(least) / u64::from(count)) >> 10;
    println!("{standard}: {count} instances, {each} KiB each, bytes more after each round: {grown:?}");
    assert!(grown.iter().min().unwrap() < &SLACK, "{standard}: {grown:?} bytes more after {count} instances");
}

/// Each thread creates, steps and frees instances of the same library, all at the same time.
fn threads(standard: &str, count: u32, each: u32) {
    let fmu = open(standard, "PmsmPlant");
    let (expected, together) = (alone(&fmu), Barrier::new(count as usize));
    std::thread::scope(|scope| {
        for thread in 0..count {
            let (fmu, expected, together) = (&fmu, &expected, &together);
            let run = move || {
                together.wait();
                for round in 0..each {
                    let number = thread + round;
                    let mut it = started(fmu, number);
                    assert_eq!(stepped(&mut it, 0, 4), expected[number as usize % 97], "{standard}, thread {thread}");
                }
            };
            std::thread::Builder::new().stack_size(256 << 10).spawn_scoped(scope, run).unwrap();
        }
    });
    println!("{standard}: {count} threads, {} instances", count * each);
}

/// A simulation of this many steps of `h` (s), with saved and stored states on the way; the memory does not grow after its first tenth.
fn long(standard: &str, name: &str, h: f64, steps: u32) {
    let fmu = open(standard, name);
    let mut it = fmu.instantiate_as(Kind::default(), "it", false).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    let (input, begun, mut first) = (it.variable("speed_ref").unwrap().value_reference, std::time::Instant::now(), 0);
    for k in 0..steps {
        // A cycle of a hundred seconds: forward, at rest, and back.
        let phase = (f64::from(k) * h / 25.0) % 4.0;
        it.set_reals(&[input], &[[100.0, 0.0, -50.0, 20.0][[1.0, 2.0, 3.0].iter().filter(|x| phase >= **x).count()]])
            .unwrap();
        let _ = it.do_step(f64::from(k) * h, h).unwrap();
        if k % 1000 == 0 {
            let state = it.get_state().unwrap();
            let stored = it.serialize_state(state).unwrap();
            let again = it.deserialize_state(&stored).unwrap();
            it.set_state(again).unwrap();
            it.free_state(again).unwrap();
            it.free_state(state).unwrap();
        }
        if k == steps / 10 {
            first = resident();
        }
    }
    let grown = resident().saturating_sub(first);
    let speed: f64 = it.get_as(if name.contains("Controller") { "speed_est" } else { "speed" }).unwrap();
    let seconds = f64::from(steps) * h;
    println!(
        "{standard} {name}: {seconds} s in {steps} steps, {:?}, {grown} bytes more, speed {speed}",
        begun.elapsed()
    );
    assert!(speed.is_finite() && grown < SLACK, "{standard} {name}: {grown} bytes more, speed {speed}");
}

#[test]
fn some_instances_threads_and_minutes() {
    let _turn = in_turn();
    for standard in ["fmi2", "fmi3"] {
        instances(standard, 500);
        threads(standard, 50, 2);
    }
    long("fmi3", "PmsmDriveMean", 0.1, 3_000);
    long("fmi2", "SensorlessController", 1e-4, 30_000);
}

#[test]
#[ignore = "takes minutes and gigabytes"]
fn ten_thousand_instances() {
    let _turn = in_turn();
    for standard in ["fmi2", "fmi3"] {
        instances(standard, 10_000);
    }
}

#[test]
#[ignore = "takes a minute"]
fn a_thousand_threads() {
    let _turn = in_turn();
    for standard in ["fmi2", "fmi3"] {
        threads(standard, 1000, 10);
    }
}

#[test]
#[ignore = "takes minutes"]
fn a_day() {
    let _turn = in_turn();
    let day = |h: f64, steps: u32| assert!((f64::from(steps) * h - 86_400.0).abs() < 1e-3);
    day(0.1, 864_000);
    long("fmi3", "PmsmDriveMean", 0.1, 864_000);
    day(1e-2, 8_640_000);
    long("fmi2", "MappedDrive", 1e-2, 8_640_000);
}
