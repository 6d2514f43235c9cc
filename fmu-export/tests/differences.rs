//! Derivatives of a model without a tangent: central differences.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use solver::ball::Ball;
use solver::slopes::{self, Exactness};

fmu_export::export!(Ball: ContinuousTime + Events);

const EXACTNESS: Exactness = Exactness { at_standstill: 1e-5, linear: 1e-6 };

#[test]
fn directional_derivatives_are_those_of_set_and_get() {
    slopes::directional_derivatives_are_those_of_set_and_get(EXACTNESS);
}

#[test]
fn superposition_and_adjoint() {
    slopes::superposition_and_adjoint(EXACTNESS);
}

#[test]
fn columns_without_dependency_are_zero() {
    slopes::columns_without_dependency_are_zero();
}

#[test]
fn knowns_of_other_modes() {
    slopes::knowns_of_other_modes();
}

#[test]
fn output_derivatives() {
    slopes::output_derivatives(EXACTNESS);
}

#[test]
fn input_derivatives() {
    slopes::input_derivatives();
}
