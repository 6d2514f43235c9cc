//! The packed FMUs give what the Rust types give, in both standards, bit for bit.
#![allow(missing_docs)]

mod common;

use common::Native;
use fmu::reproduce::packed::Packed;
use fmu::reproduce::scenario::{ALL, ClosedLoop, Scenario};

fn compare(scenario: &Scenario, h: f64) {
    let native = Native.run(scenario, h).unwrap();
    for standard in ["fmi2", "fmi3"] {
        let pair = Packed::open(&common::archives().join(standard)).unwrap();
        let packed = pair.run(scenario, h).unwrap();
        for ((name, a), (_, b)) in native.columns().iter().zip(packed.columns()) {
            assert_eq!(a.len(), b.len());
            let apart = a.iter().zip(b).position(|(a, b)| a.to_bits() != b.to_bits());
            assert_eq!(apart, None, "{standard}, {}, h = {h}: {name} differs from this point on", scenario.id);
        }
    }
}

#[test]
fn every_experiment_at_the_sample_period() {
    for scenario in &ALL {
        compare(scenario, 1e-4);
    }
}

#[test]
fn other_communication_steps() {
    for h in [0.5e-4, 1e-4 / 3.0, 0.7e-4, 3e-4] {
        compare(&Scenario { duration: 0.3, ..ALL[0] }, h);
    }
}
