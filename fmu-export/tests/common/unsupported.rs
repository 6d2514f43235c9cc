//! The functions that this exporter does not offer: refused in every state, regardless of the arguments.

use super::model::X;
use super::*;

/// Name and a call with arguments that are NULL where they may be.
pub type Unsupported = (&'static str, fn(InstancePointer) -> c_int);

const NO: Fmi3Boolean = Fmi3Boolean(0);

pub const FMI2_UNSUPPORTED: &[Unsupported] = &[
    ("fmi2CancelStep", |it| unsafe { fmi2CancelStep(it) }),
    ("fmi2SetRealInputDerivatives", |it| unsafe { fmi2SetRealInputDerivatives(it, null(), 0, null(), null()) }),
    ("fmi2GetRealOutputDerivatives", |it| unsafe { fmi2GetRealOutputDerivatives(it, null(), 0, null(), null_mut()) }),
    ("fmi2GetDirectionalDerivative", |it| unsafe {
        fmi2GetDirectionalDerivative(it, null(), 0, null(), 0, null(), null_mut())
    }),
    ("fmi2EnterEventMode", |it| unsafe { fmi2EnterEventMode(it) }),
    ("fmi2NewDiscreteStates", |it| unsafe { fmi2NewDiscreteStates(it, null_mut()) }),
    ("fmi2EnterContinuousTimeMode", |it| unsafe { fmi2EnterContinuousTimeMode(it) }),
    ("fmi2CompletedIntegratorStep", |it| unsafe {
        fmi2CompletedIntegratorStep(it, Fmi2Boolean(0), null_mut(), null_mut())
    }),
    ("fmi2SetTime", |it| unsafe { fmi2SetTime(it, 0.0) }),
    ("fmi2SetContinuousStates", |it| unsafe { fmi2SetContinuousStates(it, null(), 0) }),
    ("fmi2GetDerivatives", |it| unsafe { fmi2GetDerivatives(it, null_mut(), 0) }),
    ("fmi2GetEventIndicators", |it| unsafe { fmi2GetEventIndicators(it, null_mut(), 0) }),
    ("fmi2GetContinuousStates", |it| unsafe { fmi2GetContinuousStates(it, null_mut(), 0) }),
    ("fmi2GetNominalsOfContinuousStates", |it| unsafe { fmi2GetNominalsOfContinuousStates(it, null_mut(), 0) }),
];

pub const FMI3_UNSUPPORTED: &[Unsupported] = &[
    ("fmi3EnterStepMode", |it| unsafe { fmi3EnterStepMode(it) }),
    ("fmi3EnterEventMode", |it| unsafe { fmi3EnterEventMode(it) }),
    ("fmi3EvaluateDiscreteStates", |it| unsafe { fmi3EvaluateDiscreteStates(it) }),
    ("fmi3UpdateDiscreteStates", |it| unsafe {
        fmi3UpdateDiscreteStates(it, null_mut(), null_mut(), null_mut(), null_mut(), null_mut(), null_mut())
    }),
    ("fmi3GetOutputDerivatives", |it| unsafe { fmi3GetOutputDerivatives(it, null(), 0, null(), null_mut(), 0) }),
    ("fmi3GetDirectionalDerivative", |it| unsafe {
        fmi3GetDirectionalDerivative(it, null(), 0, null(), 0, null(), 0, null_mut(), 0)
    }),
    ("fmi3GetAdjointDerivative", |it| unsafe {
        fmi3GetAdjointDerivative(it, null(), 0, null(), 0, null(), 0, null_mut(), 0)
    }),
    ("fmi3GetNumberOfVariableDependencies", |it| unsafe { fmi3GetNumberOfVariableDependencies(it, X, &mut 0) }),
    ("fmi3GetVariableDependencies", |it| unsafe {
        fmi3GetVariableDependencies(it, X, null_mut(), null_mut(), null_mut(), null_mut(), 0)
    }),
    ("fmi3EnterConfigurationMode", |it| unsafe { fmi3EnterConfigurationMode(it) }),
    ("fmi3ExitConfigurationMode", |it| unsafe { fmi3ExitConfigurationMode(it) }),
    ("fmi3GetClock", |it| unsafe { fmi3GetClock(it, null(), 0, null_mut()) }),
    ("fmi3SetClock", |it| unsafe { fmi3SetClock(it, null(), 0, null()) }),
    ("fmi3GetIntervalDecimal", |it| unsafe { fmi3GetIntervalDecimal(it, null(), 0, null_mut(), null_mut()) }),
    ("fmi3GetIntervalFraction", |it| unsafe {
        fmi3GetIntervalFraction(it, null(), 0, null_mut(), null_mut(), null_mut())
    }),
    ("fmi3GetShiftDecimal", |it| unsafe { fmi3GetShiftDecimal(it, null(), 0, null_mut()) }),
    ("fmi3GetShiftFraction", |it| unsafe { fmi3GetShiftFraction(it, null(), 0, null_mut(), null_mut()) }),
    ("fmi3SetIntervalDecimal", |it| unsafe { fmi3SetIntervalDecimal(it, null(), 0, null()) }),
    ("fmi3SetIntervalFraction", |it| unsafe { fmi3SetIntervalFraction(it, null(), 0, null(), null()) }),
    ("fmi3SetShiftDecimal", |it| unsafe { fmi3SetShiftDecimal(it, null(), 0, null()) }),
    ("fmi3SetShiftFraction", |it| unsafe { fmi3SetShiftFraction(it, null(), 0, null(), null()) }),
    ("fmi3ActivateModelPartition", |it| unsafe { fmi3ActivateModelPartition(it, 1, 0.0) }),
    ("fmi3EnterContinuousTimeMode", |it| unsafe { fmi3EnterContinuousTimeMode(it) }),
    ("fmi3CompletedIntegratorStep", |it| unsafe { fmi3CompletedIntegratorStep(it, NO, null_mut(), null_mut()) }),
    ("fmi3SetTime", |it| unsafe { fmi3SetTime(it, 0.0) }),
    ("fmi3SetContinuousStates", |it| unsafe { fmi3SetContinuousStates(it, null(), 0) }),
    ("fmi3GetContinuousStateDerivatives", |it| unsafe { fmi3GetContinuousStateDerivatives(it, null_mut(), 0) }),
    ("fmi3GetEventIndicators", |it| unsafe { fmi3GetEventIndicators(it, null_mut(), 0) }),
    ("fmi3GetContinuousStates", |it| unsafe { fmi3GetContinuousStates(it, null_mut(), 0) }),
    ("fmi3GetNominalsOfContinuousStates", |it| unsafe { fmi3GetNominalsOfContinuousStates(it, null_mut(), 0) }),
    ("fmi3GetNumberOfEventIndicators", |it| unsafe { fmi3GetNumberOfEventIndicators(it, null_mut()) }),
    ("fmi3GetNumberOfContinuousStates", |it| unsafe { fmi3GetNumberOfContinuousStates(it, null_mut()) }),
];
