//! Events and derivatives in FMI 3.0 (FMI 3.0.2, 2.2.12, 2.3.5, 3.2 and 4.2).

use super::super::shared::missing;
use super::super::signatures::v3;
use super::Instance;
use crate::instance::{CompletedStep, Update};
use crate::standard::{Equations, Outcome, Refusal, Sensitivity, judge, same_length};

impl Instance {
    /// `fmi3GetDirectionalDerivative` or `fmi3GetAdjointDerivative`.
    fn sensitivity(
        &self,
        name: &'static str,
        function: Option<v3::Sensitivity>,
        s: Sensitivity<'_>,
        sensitivity: &mut [f64],
    ) -> Outcome {
        let function = function.ok_or_else(|| missing(name))?;
        // SAFETY: the instance is alive; every array goes with its length.
        judge(name, unsafe {
            function(
                self.shared.pointer(),
                s.unknowns.as_ptr(),
                s.unknowns.len(),
                s.knowns.as_ptr(),
                s.knowns.len(),
                s.seed.as_ptr(),
                s.seed.len(),
                sensitivity.as_mut_ptr(),
                sensitivity.len(),
            )
        })
    }

    fn count(&self, name: &'static str, function: Option<v3::Count>) -> Outcome<usize> {
        let (function, mut count) = (function.ok_or_else(|| missing(name))?, 0);
        // SAFETY: the instance is alive, there is room for the result.
        judge(name, unsafe { function(self.shared.pointer(), &raw mut count) }).map(|()| count)
    }
}

impl Equations for Instance {
    fn update_discrete_states(&mut self) -> Outcome<Update> {
        const NAME: &str = "fmi3UpdateDiscreteStates";
        let function = self.functions.api.update_discrete_states.ok_or_else(|| missing(NAME))?;
        let (mut flags, mut next) = ([0_u8; 5], 0.0);
        let [again, terminate, nominals, states, defined] = &mut flags;
        // SAFETY: the instance is alive, there is room for each result.
        let status =
            unsafe { function(self.shared.pointer(), again, terminate, nominals, states, defined, &raw mut next) };
        judge(NAME, status)?;
        let [again, terminate, nominals_changed, states_changed, defined] = flags.map(|flag| flag != 0);
        let next_event_time = defined.then_some(next);
        Ok(Update { again, terminate, nominals_changed, states_changed, next_event_time })
    }

    fn completed_integrator_step(&mut self) -> Outcome<CompletedStep> {
        const NAME: &str = "fmi3CompletedIntegratorStep";
        let function = self.functions.api.completed_integrator_step.ok_or_else(|| missing(NAME))?;
        let (mut event, mut terminate) = (0, 0);
        // SAFETY: the instance is alive, there is room for each result. "No set state before this point" is false: a state
        // may be set at any time.
        judge(NAME, unsafe { function(self.shared.pointer(), false, &raw mut event, &raw mut terminate) })?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate: terminate != 0 })
    }

    fn counts(&mut self) -> Outcome<Option<(usize, usize)>> {
        let api = &self.functions.api;
        let states = self.count("fmi3GetNumberOfContinuousStates", api.number_of_states)?;
        Ok(Some((states, self.count("fmi3GetNumberOfEventIndicators", api.number_of_indicators)?)))
    }

    fn directional_derivative(&mut self, s: Sensitivity<'_>, sensitivity: &mut [f64]) -> Outcome {
        self.sensitivity("fmi3GetDirectionalDerivative", self.functions.api.get_directional_derivative, s, sensitivity)
    }

    fn adjoint_derivative(&mut self, s: Sensitivity<'_>, sensitivity: &mut [f64]) -> Outcome {
        self.sensitivity("fmi3GetAdjointDerivative", self.functions.api.get_adjoint_derivative, s, sensitivity)
    }

    fn output_derivatives(&mut self, references: &[u32], orders: &[i32], values: &mut [f64]) -> Outcome {
        const NAME: &str = "fmi3GetOutputDerivatives";
        let function = self.functions.api.get_output_derivatives.ok_or_else(|| missing(NAME))?;
        same_length("references and orders", &[references.len(), orders.len()])?;
        let (n, count) = (references.len(), values.len());
        // SAFETY: the instance is alive; the arrays have the lengths that are passed.
        judge(NAME, unsafe {
            function(self.shared.pointer(), references.as_ptr(), n, orders.as_ptr(), values.as_mut_ptr(), count)
        })
    }

    fn set_input_derivatives(&mut self, _: &[u32], _: &[i32], _: &[f64]) -> Outcome {
        Err(Refusal::Impossible("FMI 3.0 has no input derivatives".into()))
    }
}
