//! A sequence of calls that bytes select: what a fuzzer varies.

use crate::operation;
use crate::world::{Tally, World};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::sync::Once;

/// Bytes that select a call, as the seed of its random numbers; maximum number of calls.
const BYTES: usize = 4;
const MOST: usize = 300;

/// Panics of the model are intended: they stay quiet.
pub(crate) fn quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let text = info.payload().downcast_ref::<&str>().copied().unwrap_or_default();
            if !["thirteen is bad luck", "the model panicked"].contains(&text) {
                hook(info);
            }
        }));
    });
}

/// The calls of these bytes.
pub(crate) fn operations(bytes: &[u8]) -> Vec<operation::Operation> {
    let all = operation::operation();
    let of = |chunk: &[u8]| {
        let mut seed = [0; 32];
        seed[..chunk.len()].copy_from_slice(chunk);
        let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
        let mut runner = TestRunner::new_with_rng(Config::default(), rng);
        Some(all.new_tree(&mut runner).ok()?.current())
    };
    bytes.chunks(BYTES).take(MOST).filter_map(of).collect()
}

/// Makes the calls on two instances; the first byte selects their standards.
pub(crate) fn sequence(bytes: &[u8]) {
    let Some((standards, bytes)) = bytes.split_first() else { return };
    let mut world = World::new([2 + (standards & 1), 2 + (standards >> 1 & 1)]);
    let mut tally = Tally::default();
    for operation in operations(bytes) {
        world.perform(&operation, &mut tally);
    }
}
