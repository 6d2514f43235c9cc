//! Calls of Model Exchange, event mode and derivatives with any arguments.

use super::library::Raw;
use super::names::{Count, Sensitivity, Vector};
use super::owned::Handle;
use super::results::{UNTOUCHED, UNTOUCHED_NUMBER, UpdateResults};
use crate::abi::arguments::{Array, ArrayMut};
use crate::abi::log::Status;
use std::ffi::c_int;

/// Arguments of a directional or adjoint derivative. An array may be NULL; its count may be less than its length.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensitivityArguments<'a> {
    /// Value references of the unknowns and their number.
    pub unknowns: (Option<&'a [u32]>, usize),
    /// Value references of the knowns and their number.
    pub knowns: (Option<&'a [u32]>, usize),
    /// The seed and its length, which FMI 2.0 takes from the knowns.
    pub seed: (Option<&'a [f64]>, usize),
}

impl Raw {
    /// `fmi2NewDiscreteStates` or `fmi3UpdateDiscreteStates`; with `null`, all results get NULL.
    pub fn update_discrete_states(&self, instance: Handle, null: bool) -> Option<(Status, UpdateResults)> {
        self.calls.update_discrete_states(self.owned().pointer(instance), null, (UNTOUCHED, UNTOUCHED_NUMBER)).result()
    }

    /// `SetTime`.
    pub fn set_time(&self, instance: Handle, t: f64) -> Option<Status> {
        self.calls.set_time(self.owned().pointer(instance), t).status()
    }

    /// States, derivatives, event indicators or nominals: an array, which may be NULL, and its length.
    ///
    /// # Panics
    /// The array has fewer than `n` elements.
    pub fn vector(&self, name: Vector, instance: Handle, values: Option<&mut [f64]>, n: usize) -> Option<Status> {
        self.calls.vector(name, self.owned().pointer(instance), ArrayMut::of(values, n)).status()
    }

    /// `CompletedIntegratorStep`: `enterEventMode` and `terminateSimulation` as the FMU wrote them; with `null`, both get NULL.
    pub fn completed_integrator_step(
        &self,
        instance: Handle,
        no_prior: bool,
        null: bool,
    ) -> Option<(Status, [i32; 2])> {
        self.calls.completed(self.owned().pointer(instance), no_prior, null, UNTOUCHED).result()
    }

    /// Number of states or event indicators (FMI 3.0 only); with `null`, the result gets NULL.
    pub fn count(&self, name: Count, instance: Handle, null: bool) -> Option<(Status, usize)> {
        self.calls.count(name, self.owned().pointer(instance), null).result()
    }

    /// Directional or adjoint derivatives.
    ///
    /// # Panics
    /// An array is shorter than its count.
    pub fn sensitivity(
        &self,
        name: Sensitivity,
        instance: Handle,
        arguments: SensitivityArguments<'_>,
        sensitivity: Option<&mut [f64]>,
        n_sensitivity: usize,
    ) -> Option<Status> {
        let SensitivityArguments { unknowns: (unknowns, n_unknowns), knowns: (knowns, n_knowns), seed: (seed, n_seed) } =
            arguments;
        let lists = [Array::of(unknowns, n_unknowns), Array::of(knowns, n_knowns)];
        let (seed, results) = (Array::of(seed, n_seed), ArrayMut::of(sensitivity, n_sensitivity));
        self.calls.sensitivity(name, self.owned().pointer(instance), lists, seed, results).status()
    }

    /// Derivatives of outputs with respect to time.
    pub fn output_derivatives(&self, instance: Handle, references: &[u32], order: c_int) -> Option<(Status, Vec<f64>)> {
        let (orders, mut values) = (vec![order; references.len()], vec![UNTOUCHED_NUMBER; references.len()]);
        let i = self.owned();
        let status = self.calls.output_derivatives(i.pointer(instance), references, &orders, &mut values).status()?;
        Some((status, values))
    }

    /// `fmi2SetRealInputDerivatives`.
    ///
    /// # Panics
    /// An array has fewer than `n` elements.
    pub fn input_derivatives(
        &self,
        instance: Handle,
        references: Option<&[u32]>,
        n: usize,
        orders: Option<&[c_int]>,
        values: Option<&[f64]>,
    ) -> Option<Status> {
        let (list, orders, values) = (Array::of(references, n), Array::of(orders, n), Array::of(values, n));
        self.calls.input_derivatives(self.owned().pointer(instance), list, orders, values).status()
    }
}
