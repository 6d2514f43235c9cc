//! Derivatives of a model without a tangent: central differences.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use solver::ball::{Ball, E, H, V};
use solver::slopes::Exactness;
use solver::{Fmu, ME, OK};

fmu_export::export!(Ball: ContinuousTime + Events);

solver::slopes::derivatives!(Exactness { at_standstill: 1e-5, linear: 1e-6 });

/// The step of a difference suits the length of the direction, also that of the states' magnitudes, 1 m and 5 m/s, and the size of the
/// state: the energy at rest changes by m g dh, near the ground and 40 km above it.
#[test]
fn the_step_of_a_difference_suits_its_direction_and_the_state() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        let mut change = [f64::NAN];
        assert_eq!(fmu.set_states(&[40e3, 0.0]), OK);
        assert_eq!(fmu.directional(&[E], &[H], &[1.0], &mut change), OK);
        assert!((change[0] - 2.0 * 9.81).abs() < 1e-6, "{change:?}");
        assert_eq!(fmu.set_states(&[1.0, 0.0]), OK);
        assert_eq!((fmu.get(H), fmu.get(V)), (1.0, 0.0));
        for (along, share) in [([1.0, 0.0], 1.0), ([3.0, 0.0], 3.0), ([1.0, 5.0], 1.0), ([1e-9, 0.0], 1e-9)] {
            let (mut change, wanted) = ([f64::NAN], share * 2.0 * 9.81);
            assert_eq!(fmu.directional(&[E], &[H, V], &along, &mut change), OK);
            assert!((change[0] / wanted - 1.0).abs() < 5e-8, "{along:?}: {change:?}");
        }
    }
}
