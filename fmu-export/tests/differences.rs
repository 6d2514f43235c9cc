//! Derivatives of a model without a tangent: central differences.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use solver::ball::{Ball, E, H, V};
use solver::slopes::Exactness;
use solver::{Fmu, ME, OK};

fmu_export::export!(Ball: ContinuousTime + Events);

solver::slopes::derivatives!(Exactness { at_standstill: 1e-5, linear: 1e-6 });

/// A direction as long as the states' magnitudes, 1 m and 5 m/s: the energy at rest changes by m g dh.
#[test]
fn a_direction_as_long_as_the_state_has_a_difference() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!((fmu.get(H), fmu.get(V)), (1.0, 0.0));
        for (along, wanted) in [([1.0, 0.0], 2.0 * 9.81), ([3.0, 0.0], 6.0 * 9.81), ([1.0, 5.0], 2.0 * 9.81)] {
            let mut change = [f64::NAN];
            assert_eq!(fmu.directional(&[E], &[H, V], &along, &mut change), OK);
            assert!((change[0] - wanted).abs() < 1e-6, "{along:?}: {change:?}");
        }
    }
}
