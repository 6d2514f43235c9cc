//! Random calls of both standards, right and wrong, on two instances in turn, against `reference.rs`: after every call the
//! status, the message, the values, the state of the life cycle, and that the other instance is unaffected.
//!
//! 1e5 calls; `FMU_CALLS=10000000 cargo test --release -p fmu-export --test sequences` for more, `FMU_SEED=n` for others.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

#[path = "../common/mod.rs"]
mod common;
mod from_bytes;
mod operation;
mod perform;
mod reference;
#[path = "../common/state.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod state;
mod world;

use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::cell::RefCell;
use world::{Tally, World};

/// Calls of one sequence, on average.
const LENGTH: usize = 250;

/// A number from the environment.
fn asked(name: &str, otherwise: u64) -> u64 {
    let number = std::env::var(name).ok();
    number.map_or(otherwise, |text| text.parse().unwrap_or_else(|_| panic!("{name} = {text:?} is not a whole number")))
}

#[test]
fn random_calls() {
    common::loud();
    from_bytes::quiet();
    let calls = asked("FMU_CALLS", 100_000);
    let config = Config { cases: 100, failure_persistence: None, ..Config::default() };
    let seed = asked("FMU_SEED", 1);
    let tally = RefCell::new(Tally::default());
    // Sequences of different lengths make a failure easier to shorten.
    let sequences = (2..=3_u8, 2..=3_u8, proptest::collection::vec(operation::operation(), 0..2 * LENGTH));
    for round in 0_u64.. {
        if tally.borrow().calls() >= calls {
            break;
        }
        let mut bytes = [0; 32];
        bytes[..16].copy_from_slice(&[seed.to_le_bytes(), round.to_le_bytes()].concat());
        let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
        let mut runner = TestRunner::new_with_rng(config.clone(), rng);
        let outcome = runner.run(&sequences, |(one, two, operations)| {
            let mut world = World::new([one, two]);
            for operation in &operations {
                world.perform(operation, &mut tally.borrow_mut());
            }
            Ok(())
        });
        if let Err(error) = outcome {
            let text: String = error.to_string().lines().map(str::trim_start).collect::<Vec<_>>().join(" ");
            panic!("{}", text.replace("Operation {", "\nOperation {"));
        }
    }
    let tally = tally.into_inner();
    println!("{tally}");
    // 44 and 75 functions of the standards, without GetVersion and GetTypesPlatform.
    assert_eq!(tally.functions(), 44 + 75 - 3);
    assert!(tally.share_of_success() > 0.5, "most sequences end in errors");
}

/// The sequences that the fuzz target `calls` has found to matter.
#[test]
fn sequences_of_the_corpus() {
    common::loud();
    from_bytes::quiet();
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/calls");
    let files: Vec<_> = std::fs::read_dir(corpus).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(files.len() > 5, "{} sequences", files.len());
    for file in files {
        println!("{}", file.display());
        from_bytes::sequence(&std::fs::read(file).unwrap());
    }
}
