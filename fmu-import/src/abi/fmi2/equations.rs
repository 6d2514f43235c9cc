//! Events and derivatives in FMI 2.0 (FMI 2.0.5, 2.1.9, 3.2 and 4.2.1).

use super::super::shared::missing;
use super::super::signatures::v2::EventInfo;
use super::Instance;
use crate::instance::{CompletedStep, Update};
use crate::standard::{Equations, Outcome, Refusal, Sensitivity, judge, same_length};

impl Equations for Instance {
    fn update_discrete_states(&mut self) -> Outcome<Update> {
        let function = self.functions.api.new_discrete_states.ok_or_else(|| missing("fmi2NewDiscreteStates"))?;
        let mut info = EventInfo::default();
        // SAFETY: the instance is alive; the struct is the standard's.
        judge("fmi2NewDiscreteStates", unsafe { function(self.shared.pointer(), &raw mut info) })?;
        Ok(Update {
            again: info.new_discrete_states_needed != 0,
            terminate: info.terminate_simulation != 0,
            nominals_changed: info.nominals_changed != 0,
            states_changed: info.states_changed != 0,
            next_event_time: (info.next_event_time_defined != 0).then_some(info.next_event_time),
        })
    }

    fn completed_integrator_step(&mut self) -> Outcome<CompletedStep> {
        const NAME: &str = "fmi2CompletedIntegratorStep";
        let function = self.functions.api.completed_integrator_step.ok_or_else(|| missing(NAME))?;
        let (mut event, mut terminate) = (0, 0);
        // SAFETY: the instance is alive, there is room for each result. "No set state before this point" is false: a state
        // may be set at any time.
        judge(NAME, unsafe { function(self.shared.pointer(), 0, &raw mut event, &raw mut terminate) })?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate: terminate != 0 })
    }

    fn counts(&mut self) -> Outcome<Option<(usize, usize)>> {
        Ok(None)
    }

    fn directional_derivative(&mut self, s: Sensitivity<'_>, sensitivity: &mut [f64]) -> Outcome {
        const NAME: &str = "fmi2GetDirectionalDerivative";
        let function = self.functions.api.get_directional_derivative.ok_or_else(|| missing(NAME))?;
        same_length("unknowns and sensitivity", &[s.unknowns.len(), sensitivity.len()])?;
        same_length("knowns and seed", &[s.knowns.len(), s.seed.len()])?;
        // SAFETY: the instance is alive; seed and sensitivity are as long as the lists that they go with.
        judge(NAME, unsafe {
            function(
                self.shared.pointer(),
                s.unknowns.as_ptr(),
                s.unknowns.len(),
                s.knowns.as_ptr(),
                s.knowns.len(),
                s.seed.as_ptr(),
                sensitivity.as_mut_ptr(),
            )
        })
    }

    fn adjoint_derivative(&mut self, _: Sensitivity<'_>, _: &mut [f64]) -> Outcome {
        Err(Refusal::Impossible("FMI 2.0 has no adjoint derivatives".into()))
    }

    fn output_derivatives(&mut self, references: &[u32], orders: &[i32], values: &mut [f64]) -> Outcome {
        const NAME: &str = "fmi2GetRealOutputDerivatives";
        let function = self.functions.api.get_output_derivatives.ok_or_else(|| missing(NAME))?;
        same_length("references, orders and values", &[references.len(), orders.len(), values.len()])?;
        let (n, values) = (references.len(), values.as_mut_ptr());
        // SAFETY: the instance is alive; the arrays have n elements.
        judge(NAME, unsafe { function(self.shared.pointer(), references.as_ptr(), n, orders.as_ptr(), values) })
    }

    fn set_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        const NAME: &str = "fmi2SetRealInputDerivatives";
        let function = self.functions.api.set_input_derivatives.ok_or_else(|| missing(NAME))?;
        same_length("references, orders and values", &[references.len(), orders.len(), values.len()])?;
        let (n, values) = (references.len(), values.as_ptr());
        // SAFETY: the instance is alive; the arrays have n elements.
        judge(NAME, unsafe { function(self.shared.pointer(), references.as_ptr(), n, orders.as_ptr(), values) })
    }
}
