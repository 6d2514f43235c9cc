//! The libraries of an FMU, and the functions of a standard that they export.

use crate::fmu_file::{Binary, FmuFile};
use model_description::FmiVersion;

/// Functions of FMI 2.0 for both interfaces.
pub(crate) const COMMON2: &str = "\
    GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance \
    SetupExperiment EnterInitializationMode ExitInitializationMode Terminate Reset \
    GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean SetString \
    GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate \
    GetDirectionalDerivative";
pub(crate) const COSIMULATION2: &str = "\
    SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep \
    GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus";
pub(crate) const EXCHANGE2: &str = "\
    EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime \
    SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates";
/// Functions of FMI 3.0, which every FMU has.
pub(crate) const ALL3: &str = "\
    GetVersion SetDebugLogging \
    InstantiateModelExchange InstantiateCoSimulation InstantiateScheduledExecution FreeInstance \
    EnterInitializationMode ExitInitializationMode EnterEventMode Terminate Reset \
    GetFloat32 GetFloat64 GetInt8 GetUInt8 GetInt16 GetUInt16 GetInt32 GetUInt32 GetInt64 GetUInt64 \
    GetBoolean GetString GetBinary GetClock \
    SetFloat32 SetFloat64 SetInt8 SetUInt8 SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64 \
    SetBoolean SetString SetBinary SetClock \
    GetNumberOfVariableDependencies GetVariableDependencies \
    GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize SerializeFMUState DeserializeFMUState \
    GetDirectionalDerivative GetAdjointDerivative \
    EnterConfigurationMode ExitConfigurationMode \
    GetIntervalDecimal GetIntervalFraction GetShiftDecimal GetShiftFraction \
    SetIntervalDecimal SetIntervalFraction SetShiftDecimal SetShiftFraction \
    EvaluateDiscreteStates UpdateDiscreteStates \
    EnterContinuousTimeMode CompletedIntegratorStep SetTime \
    SetContinuousStates GetContinuousStateDerivatives GetEventIndicators GetContinuousStates \
    GetNominalsOfContinuousStates GetNumberOfEventIndicators GetNumberOfContinuousStates \
    EnterStepMode GetOutputDerivatives DoStep ActivateModelPartition";

/// Every function of a standard, without prefix.
pub(crate) fn functions(version: FmiVersion) -> Vec<&'static str> {
    let lists: &[&'static str] = match version {
        FmiVersion::V2 => &[COMMON2, COSIMULATION2, EXCHANGE2],
        FmiVersion::V3 => &[ALL3],
    };
    lists.iter().flat_map(|list| list.split_whitespace()).collect()
}

/// The libraries named after a modelIdentifier; other libraries in their folders are helpers.
pub(crate) fn libraries(fmu: &FmuFile) -> Vec<&Binary> {
    let description = fmu.description.as_ref().ok();
    let names: Vec<&str> = description.map_or_else(Vec::new, |d| {
        let interfaces = [&d.co_simulation, &d.model_exchange, &d.scheduled_execution].into_iter().flatten();
        interfaces.map(|interface| interface.model_identifier.as_str()).collect()
    });
    let base = |b: &Binary| b.name.rsplit('/').next().and_then(|f| f.rsplit_once('.')).map(|(base, _)| base.to_owned());
    fmu.binaries.iter().filter(|b| base(b).is_some_and(|base| names.contains(&base.as_str()))).collect()
}
