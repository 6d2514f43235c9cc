//! Names of functions, each type of names for one C signature: safe code cannot call a function with wrong arguments.

/// Declares an enumeration of names without the prefix of the standard.
macro_rules! names {
    ($(#[$doc:meta])* $type:ident { $($name:ident)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the names of the standards")]
        pub enum $type { $($name),* }

        impl $type {
            /// The full names in FMI 2.0 and FMI 3.0.
            #[allow(dead_code, reason = "for names that index functions")]
            pub(in crate::abi) const ALL: [[&'static str; 2]; [$(stringify!($name)),*].len()] =
                [$([concat!("fmi2", stringify!($name)), concat!("fmi3", stringify!($name))]),*];

            /// The function of this name, if it is one of them.
            pub fn named(name: &str) -> Option<Self> {
                match name {
                    $(stringify!($name) => Some(Self::$name),)*
                    _ => None,
                }
            }

            /// The name without the prefix of the standard.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$name => stringify!($name),)*
                }
            }
        }
    };
}

names! {
    /// Functions whose only argument is the instance.
    Simple {
        Reset Terminate EnterInitializationMode ExitInitializationMode EnterConfigurationMode ExitConfigurationMode
        EnterEventMode EnterStepMode EnterContinuousTimeMode EvaluateDiscreteStates CancelStep
    }
}

names! {
    /// Functions that return a constant text.
    Text { GetVersion GetTypesPlatform }
}

names! {
    /// Functions that report on an asynchronous step (FMI 2.0).
    StepStatus { GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus }
}

names! {
    /// Functions of an instance, an array of doubles and its length (Model Exchange).
    Vector {
        GetContinuousStates SetContinuousStates GetDerivatives GetContinuousStateDerivatives GetEventIndicators
        GetNominalsOfContinuousStates
    }
}

names! {
    /// Functions that return a number of elements (FMI 3.0).
    Count { GetNumberOfContinuousStates GetNumberOfEventIndicators }
}

names! {
    /// Functions of partial derivatives.
    Sensitivity { GetDirectionalDerivative GetAdjointDerivative }
}

names! {
    /// Functions of optional capabilities.
    Optional {
        GetBinary SetBinary GetClock SetClock
        GetShiftDecimal SetShiftDecimal GetIntervalDecimal SetIntervalDecimal
        GetShiftFraction SetShiftFraction GetIntervalFraction SetIntervalFraction
        GetNumberOfVariableDependencies GetVariableDependencies GetDirectionalDerivative GetAdjointDerivative
        GetOutputDerivatives GetRealOutputDerivatives SetRealInputDerivatives
        UpdateDiscreteStates NewDiscreteStates CompletedIntegratorStep SetTime SetContinuousStates GetContinuousStates
        GetContinuousStateDerivatives GetDerivatives GetEventIndicators GetNominalsOfContinuousStates
        GetNumberOfEventIndicators GetNumberOfContinuousStates ActivateModelPartition
    }
}

/// Interface type of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Co-simulation.
    CoSimulation,
    /// Model exchange.
    ModelExchange,
    /// Scheduled execution (FMI 3.0 only).
    ScheduledExecution,
}
