//! Model Exchange, event mode and derivatives in either standard.

use super::Instance;
use crate::Error;
use crate::abi::journal::Call;
use crate::abi::live::Live;
use crate::abi::raw::{Sensitivity, Simple, Vector};
use crate::standard::{CompletedStep, Directions, Stepped, Update};

impl Instance {
    /// Steps from `t` to `t + h`, or to an earlier time if the FMU may return early.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn advance(&mut self, t: f64, h: f64) -> Result<Stepped, Error> {
        let stepped = self.call(Call::Step, |s| s.do_step(t, h))?;
        if let Some(clocks) = &mut self.clocks {
            clocks.time = stepped.last;
        }
        Ok(stepped)
    }

    /// Enters event mode: from continuous-time mode, or from step mode of an instance that uses event mode.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_event_mode(&mut self) -> Result<(), Error> {
        self.call(Call::Events, |s| s.simple(Simple::EnterEventMode))?;
        self.tick()
    }

    /// Updates the discrete states once, in event mode (`fmi2NewDiscreteStates`, `fmi3UpdateDiscreteStates`).
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn update_discrete_states(&mut self) -> Result<Update, Error> {
        let update = self.call(Call::Events, Live::update_discrete_states)?;
        self.tock(update)
    }

    /// Leaves event mode for continuous-time mode (Model Exchange).
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_continuous_time_mode(&mut self) -> Result<(), Error> {
        self.leave_events();
        self.call(Call::Events, |s| s.simple(Simple::EnterContinuousTimeMode))
    }

    /// Leaves event mode for step mode (Co-Simulation of FMI 3.0).
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_step_mode(&mut self) -> Result<(), Error> {
        self.leave_events();
        self.call(Call::Events, |s| s.simple(Simple::EnterStepMode))
    }

    fn leave_events(&mut self) {
        if let Some(clocks) = &mut self.clocks {
            clocks.leave_event();
        }
    }

    /// Numbers of continuous states and of event indicators. In FMI 3.0 they come from the FMU, in FMI 2.0 from the
    /// description.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn state_and_indicator_counts(&mut self) -> Result<(usize, usize), Error> {
        let counts = self.call(Call::Evaluation, Live::counts)?;
        let indicators = || self.description.number_of_event_indicators.unwrap_or(0) as usize;
        Ok(counts.unwrap_or_else(|| (self.description.derivatives.len(), indicators())))
    }

    /// Sets the time (s) in continuous-time mode.
    ///
    /// # Errors
    /// The FMU refuses.
    #[inline]
    pub fn set_time(&mut self, t: f64) -> Result<(), Error> {
        if let Some(clocks) = &mut self.clocks {
            clocks.time = t;
        }
        self.call(Call::Evaluation, |s| s.set_time(t))
    }

    /// Sets all continuous states.
    ///
    /// # Errors
    /// The FMU refuses; a state that it does not take in a trial step is discarded: see [`Error::is_discard`].
    #[inline]
    pub fn set_continuous_states(&mut self, x: &[f64]) -> Result<(), Error> {
        if x.is_empty() { Ok(()) } else { self.call(Call::Evaluation, |s| s.set_states(x)) }
    }

    /// Reads all continuous states.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_continuous_states(&mut self, x: &mut [f64]) -> Result<(), Error> {
        self.vector(Vector::GetContinuousStates, x)
    }

    /// Computes the derivatives of all continuous states.
    ///
    /// # Errors
    /// As [`set_continuous_states`](Self::set_continuous_states).
    #[inline]
    pub fn get_derivatives(&mut self, dx: &mut [f64]) -> Result<(), Error> {
        if dx.is_empty() { Ok(()) } else { self.call(Call::Evaluation, |s| s.derivatives(dx)) }
    }

    /// Computes all event indicators.
    ///
    /// # Errors
    /// As [`set_continuous_states`](Self::set_continuous_states).
    pub fn get_event_indicators(&mut self, z: &mut [f64]) -> Result<(), Error> {
        self.vector(Vector::GetEventIndicators, z)
    }

    /// Reads the nominal values of all continuous states.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_nominals(&mut self, nominals: &mut [f64]) -> Result<(), Error> {
        self.vector(Vector::GetNominalsOfContinuousStates, nominals)
    }

    /// Reports a completed integrator step.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn completed_integrator_step(&mut self) -> Result<CompletedStep, Error> {
        self.call(Call::Events, Live::completed_integrator_step)
    }

    /// Partial derivatives of the unknowns in the direction of the seed of the knowns, both by value reference.
    ///
    /// # Errors
    /// The FMU refuses or has no such values, or an array differs in length from its list.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<(), Error> {
        self.sensitivity(Sensitivity::GetDirectionalDerivative, Directions { unknowns, knowns, seed }, sensitivity)
    }

    /// The seed of the unknowns times the partial derivatives: one number for each of the knowns (FMI 3.0 only).
    ///
    /// # Errors
    /// As [`directional_derivative`](Self::directional_derivative).
    pub fn adjoint_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<(), Error> {
        self.sensitivity(Sensitivity::GetAdjointDerivative, Directions { unknowns, knowns, seed }, sensitivity)
    }

    fn sensitivity(&mut self, name: Sensitivity, d: Directions<'_>, results: &mut [f64]) -> Result<(), Error> {
        self.call(Call::Evaluation, |s| s.sensitivity(name, d, results))
    }

    /// Derivatives of outputs with respect to time at the end of the last step (Co-Simulation).
    ///
    /// # Errors
    /// The FMU refuses or has no such derivatives, or the arrays have different lengths.
    pub fn output_derivatives(&mut self, references: &[u32], orders: &[i32], values: &mut [f64]) -> Result<(), Error> {
        self.call(Call::Evaluation, |s| s.output_derivatives(references, orders, values))
    }

    /// Derivatives of inputs with respect to time at the beginning of the next step (Co-Simulation of FMI 2.0 only).
    ///
    /// # Errors
    /// The FMU refuses or does not support this, or the arrays have different lengths.
    pub fn set_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> Result<(), Error> {
        self.call(Call::Evaluation, |s| s.set_input_derivatives(references, orders, values))
    }

    /// An FMU without states or indicators is not queried for them.
    #[inline]
    fn vector(&mut self, which: Vector, values: &mut [f64]) -> Result<(), Error> {
        if values.is_empty() { Ok(()) } else { self.call(Call::Evaluation, |s| s.vector(which, values)) }
    }
}
