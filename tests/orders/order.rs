//! The call orders of importers, as data. Each row has its source; calls that no source describes follow the standard.

/// When an importer sets every parameter to its start value in the description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Starts {
    /// It sets none.
    Never,
    /// In Initialization Mode.
    Before,
    /// After `ExitInitializationMode`, including fixed ones.
    After,
}

/// When an importer calls `CompletedIntegratorStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Completes {
    /// Never, although the FMU requests it.
    Never,
    /// At the end of an accepted step.
    Steps,
    /// At every evaluation, including rejected steps and bisections.
    Evaluations,
}

/// The order of an importer's calls in Model Exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "habits that do not depend on each other")]
pub struct Order {
    pub name: &'static str,
    /// Source of the order.
    pub source: &'static str,
    /// For FMI 2.0 and for FMI 3.0.
    pub standards: [bool; 2],
    pub starts: Starts,
    /// It updates the discrete states after the initialization; without, the FMU stays in Event Mode until the first event.
    pub settles: bool,
    /// It updates the discrete states until no longer needed; otherwise once per event.
    pub iterates: bool,
    pub completes: Completes,
    /// It also sets the continuous states in Event Mode.
    pub states_in_event: bool,
    /// It also reads derivatives in Event Mode.
    pub derivatives_in_event: bool,
    /// It sets discrete inputs at every evaluation outside of Continuous-Time Mode, not only at events.
    pub discrete_inputs: bool,
    /// It locates time events as roots, this many seconds late; 0: its steps end there.
    pub late: f64,
    /// It reads `nextEventTime` without `nextEventTimeDefined`.
    pub blind: bool,
    /// Evaluations at each point.
    pub repeats: u8,
    /// It restarts its solver from the states before a rejected step with a call at that point.
    pub returns: bool,
}

/// The order of the standards.
pub const STRICT: Order = Order {
    name: "strict",
    source: "FMI 2.0.5, 3.2.4; FMI 3.0.2, 3.3",
    standards: [true, true],
    starts: Starts::Never,
    settles: true,
    iterates: true,
    completes: Completes::Steps,
    states_in_event: false,
    derivatives_in_event: true,
    discrete_inputs: false,
    late: 0.0,
    blind: false,
    repeats: 1,
    returns: false,
};

/// The wrapper that `importFMU` of the development version writes for FMI 2.0.
const OPENMODELICA: Order = Order {
    name: "OpenModelica of August 2026, FMI 2.0",
    source: "CodegenFMU.tpl and FMI2ModelExchange.c of 2026-08-22; parameters before ExitInitializationMode since pull request 16357",
    standards: [true, false],
    starts: Starts::Before,
    settles: false,
    iterates: false,
    completes: Completes::Evaluations,
    states_in_event: true,
    derivatives_in_event: false,
    discrete_inputs: true,
    late: 1e-10,
    blind: true,
    repeats: 2,
    returns: false,
};

/// All orders.
pub const ORDERS: &[Order] = &[
    STRICT,
    Order {
        name: "OpenModelica 1.20",
        source: "CodegenFMU.tpl of the tag v1.20.0: parameters before ExitInitializationMode, all else as later",
        ..OPENMODELICA
    },
    Order {
        name: "OpenModelica 1.21 to 1.27",
        source: "CodegenFMU.tpl of the tags v1.21.0 to v1.27.0; issue 16354: all parameters after ExitInitializationMode",
        starts: Starts::After,
        ..OPENMODELICA
    },
    OPENMODELICA,
    Order {
        name: "OpenModelica of August 2026, FMI 3.0",
        source: "CodegenFMU.tpl and FMI3ModelExchange.c of 2026-08-22: SetTime and EnterEventMode in Event Mode",
        standards: [false, true],
        iterates: true,
        states_in_event: false,
        derivatives_in_event: true,
        blind: false,
        ..OPENMODELICA
    },
    Order {
        name: "states in Event Mode",
        source: "Dymola, by the comment at fmi2SetContinuousStates in OpenModelica's fmu2_model_interface.c",
        states_in_event: true,
        starts: Starts::Before,
        ..STRICT
    },
    Order {
        name: "a completed step after each SetContinuousStates",
        source: "MBDyn, module-fmu: fmu2::SetStates",
        completes: Completes::Evaluations,
        ..STRICT
    },
];
