//! Derivatives of a model without a tangent: central differences.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use solver::ball::Ball;
use solver::slopes::Exactness;

fmu_export::export!(Ball: ContinuousTime + Events);

solver::slopes::derivatives!(Exactness { at_standstill: 1e-5, linear: 1e-6 });
