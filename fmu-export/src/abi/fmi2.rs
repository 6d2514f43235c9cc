//! FMI 2.0.5: its own calls, and the table of its functions.

use super::gate::{Entry, Steps, open};
use super::logger::Fmi2Sink;
use super::pointer::{place, text};
use super::types::{Fmi2Boolean, Fmi2Callbacks, Fmi2EventInfo, InstancePointer, Text};
use super::{Abi, Answer, credentials};
use crate::instance::Refusal;
use crate::lifecycle::State;
use crate::log::Log;
use fmu_core::{Exported, Fault, Interface};
use std::ffi::c_int;

/// `fmi2ModelExchange` of `fmi2Type`.
const MODEL_EXCHANGE: c_int = 0;
/// `fmi2CoSimulation` of `fmi2Type`.
const CO_SIMULATION: c_int = 1;
/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated` of `fmi2StatusKind`.
const TERMINATED: c_int = 3;

/// Errors and safety as in `calls.rs`.
#[allow(missing_docs, reason = "named as in the standards")]
#[allow(clippy::missing_safety_doc, clippy::missing_errors_doc, reason = "the sections above cover all")]
impl<E: Exported> Abi<'_, E> {
    /// FMI 2.0.5, 2.1.5. The callbacks' struct is copied: its pointer is valid only during this call.
    pub unsafe fn fmi2_instantiate(
        entry: &'static Entry,
        name: Text,
        fmu_type: c_int,
        token: Text,
        resources: Text,
        callbacks: *const Fmi2Callbacks,
        logging_on: bool,
    ) -> InstancePointer {
        // SAFETY: the importer's texts and struct, valid during this call.
        let (name, token, resources, callbacks) =
            unsafe { (text(name), text(token), text(resources), callbacks.as_ref()) };
        let sink = Fmi2Sink {
            logger: callbacks.and_then(|c| c.logger),
            environment: callbacks.map_or(std::ptr::null_mut(), |c| c.environment),
            instance: name.unwrap_or_default().to_owned(),
        };
        let judged = credentials::<E>(name, token).and_then(|wanted| {
            let exchange = E::CAN.model_exchange();
            let steps = !E::CAN.exchange_only;
            let fits = (steps && fmu_type == CO_SIMULATION) || (exchange && fmu_type == MODEL_EXCHANGE);
            let types = match (steps, exchange) {
                (true, true) => "fmi2CoSimulation (1) or fmi2ModelExchange (0)",
                (true, false) => "fmi2CoSimulation (1): the FMU has no Model Exchange",
                (false, _) => "fmi2ModelExchange (0): the FMU has no Co-Simulation",
            };
            let allowed = || Fault::value("fmuType", fmu_type, types);
            if fits { Ok(wanted) } else { Err(allowed()) }
        });
        let interface = if fmu_type == MODEL_EXCHANGE { Interface::ModelExchange } else { Interface::CoSimulation };
        open::<E>(entry, Log::new(Box::new(sink), logging_on), judged, resources, interface, Steps::WHOLE)
    }

    pub unsafe fn fmi2_new_discrete_states(&mut self, info: *mut Fmi2EventInfo) -> Answer {
        // SAFETY: the importer's struct.
        let info = unsafe { place(info, "fmi2EventInfo")? };
        let update = self.0.update_discrete()?;
        info.write(Fmi2EventInfo {
            new_discrete_states_needed: update.outcome.again.into(),
            terminate_simulation: update.outcome.terminate.into(),
            nominals_of_continuous_states_changed: false.into(),
            values_of_continuous_states_changed: update.outcome.states_changed.into(),
            next_event_time_defined: update.next.is_some().into(),
            next_event_time: update.next.unwrap_or(0.0),
        });
        Ok(())
    }

    /// `fmi2LastSuccessfulTime`; the other kinds belong to asynchronous steps (FMI 2.0.5, 4.2.3).
    pub unsafe fn fmi2_real_status(&mut self, kind: c_int, value: *mut f64) -> Answer {
        // SAFETY: the importer's variable.
        let value = unsafe { place(value, "value")? };
        if kind != LAST_SUCCESSFUL_TIME {
            return self.fmi2_no_status(kind);
        }
        value.write(self.0.current.end);
        Ok(())
    }

    /// FMI 2.0.5, 4.2.2: Discard, if the model has ended the simulation.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point")]
    pub fn fmi2_do_step(&mut self, t: f64, h: f64) -> Answer {
        if self.0.do_step(t, h)?.terminate {
            return Err(Refusal::Discard(Fault::new("the model has ended the simulation: see fmi2Terminated")));
        }
        Ok(())
    }

    /// `fmi2Terminated`: whether the model has ended the simulation in a step.
    pub unsafe fn fmi2_boolean_status(&mut self, kind: c_int, value: *mut Fmi2Boolean) -> Answer {
        // SAFETY: the importer's variable.
        let value = unsafe { place(value, "value")? };
        if kind != TERMINATED {
            return self.fmi2_no_status(kind);
        }
        value.write((self.0.current.life.state() == State::Ended).into());
        Ok(())
    }

    /// FMI 2.0.5, 4.2.3: Discard if the status is not available.
    pub fn fmi2_no_status(&mut self, kind: c_int) -> Answer {
        let kind = ["fmi2DoStepStatus", "fmi2PendingStatus", "fmi2LastSuccessfulTime", "fmi2Terminated"]
            .get(usize::try_from(kind).unwrap_or(usize::MAX))
            .map_or_else(|| kind.to_string(), ToString::to_string);
        Err(Refusal::Discard(Fault::new(format!("{kind} is not available: every step ends before fmi2DoStep returns"))))
    }
}

/// The functions of `fmi2Functions.h`: name, arguments, row of the lifecycle table, and the function that does the work.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi2 {
    ($exported:ty) => {
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn fmi2GetTypesPlatform() -> Text {
            c"default".as_ptr()
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn fmi2GetVersion() -> Text {
            c"2.0".as_ptr()
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi2Instantiate(
            name: Text,
            fmu_type: c_int,
            guid: Text,
            resources: Text,
            callbacks: *const Fmi2Callbacks,
            visible: Fmi2Boolean,
            logging_on: Fmi2Boolean,
        ) -> InstancePointer {
            $crate::abi::quiet();
            const ENTRY: &Entry = &Entry::new(Standard::Fmi2, Call::Instantiate, "fmi2Instantiate");
            // SAFETY: what the standard demands of the importer.
            unsafe {
                let (given, logger) = (!callbacks.is_null(), callbacks.as_ref().is_some_and(|c| c.logger.is_some()));
                $crate::abi::record::open_logged::<$exported>(
                    ENTRY,
                    || vec![
                        ("name", Argument::text(name)),
                        ("type", fmu_type.argument()),
                        ("token", Argument::text(guid)),
                        ("resources", Argument::text(resources)),
                        ("callbacks", Argument::given(given)),
                        ("logger", Argument::given(logger)),
                        ("visible", visible.argument()),
                        ("logging_on", logging_on.argument()),
                    ],
                    || $crate::abi::Abi::<$exported>::fmi2_instantiate(
                        ENTRY, name, fmu_type, guid, resources, callbacks, logging_on.0 != 0,
                    ),
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi2FreeInstance(instance: InstancePointer) {
            // SAFETY: what the standard demands of the importer.
            unsafe { $crate::abi::Abi::<$exported>::free_instance(instance, "fmi2FreeInstance") }
        }

        $crate::functions! { Fmi2 $exported;
            fmi2SetDebugLogging(on: Fmi2Boolean, n: usize, categories: *const Text)
                => SetDebugLogging: set_debug_logging(on.0 != 0, n, categories);
            fmi2SetupExperiment(tolerance_defined: Fmi2Boolean, tolerance: f64, start: f64, stop_defined: Fmi2Boolean, stop: f64)
                => SetupExperiment: set_up(start, (stop_defined.0 != 0).then_some(stop));
            fmi2EnterInitializationMode() => EnterInitialization: enter_initialization();
            fmi2ExitInitializationMode() => ExitInitialization: exit_initialization();
            fmi2Terminate() => Terminate: terminate();
            fmi2Reset() => Reset: reset();

            fmi2GetReal(vr: References, n: usize, values: *mut f64) => Get: get(vr, n, values, n);
            fmi2GetInteger(vr: References, n: usize, values: *mut Fmi2Integer) => Get: get(vr, n, values, n);
            fmi2GetBoolean(vr: References, n: usize, values: *mut Fmi2Boolean) => Get: get(vr, n, values, n);
            fmi2GetString(vr: References, n: usize, values: *mut Text) => Get: get_texts(vr, n, values, n);
            fmi2SetReal(vr: References, n: usize, values: *const f64) => Set: set(vr, n, values, n);
            fmi2SetInteger(vr: References, n: usize, values: *const Fmi2Integer) => Set: set(vr, n, values, n);
            fmi2SetBoolean(vr: References, n: usize, values: *const Fmi2Boolean) => Set: set(vr, n, values, n);
            fmi2SetString(vr: References, n: usize, values: *const Text) => Set: set_texts(vr, n, values, n);

            fmi2GetFMUstate(state: *mut FmuState) => SaveState: save_state(state);
            fmi2SetFMUstate(state: FmuState) => RestoreState: restore_state(state);
            fmi2FreeFMUstate(state: *mut FmuState) => UseState: free_state(state);
            fmi2SerializedFMUstateSize(state: FmuState, size: *mut usize) => UseState: serialized_size(state, size);
            fmi2SerializeFMUstate(state: FmuState, bytes: *mut u8, size: usize) => UseState: serialize(state, bytes, size);
            fmi2DeSerializeFMUstate(bytes: *const u8, size: usize, state: *mut FmuState)
                => UseState: deserialize(bytes, size, state);

            fmi2DoStep(t: f64, h: f64, no_set_state_prior: Fmi2Boolean) => DoStep: fmi2_do_step(t, h);
            fmi2CancelStep() => Unsupported: unsupported("no step is ever in progress");
            fmi2GetStatus(kind: c_int, value: *mut c_int) => Status: fmi2_no_status(kind);
            fmi2GetRealStatus(kind: c_int, value: *mut f64) => Status: fmi2_real_status(kind, value);
            fmi2GetIntegerStatus(kind: c_int, value: *mut Fmi2Integer) => Status: fmi2_no_status(kind);
            fmi2GetBooleanStatus(kind: c_int, value: *mut Fmi2Boolean) => Status: fmi2_boolean_status(kind, value);
            fmi2GetStringStatus(kind: c_int, value: *mut Text) => Status: fmi2_no_status(kind);
            fmi2SetRealInputDerivatives(vr: References, n: usize, orders: *const c_int, values: *const f64)
                => InputDerivatives: input_derivatives(vr, n, orders, values);
            fmi2GetRealOutputDerivatives(vr: References, n: usize, orders: *const c_int, values: *mut f64)
                => OutputDerivatives: output_derivatives(vr, n, orders, values, n);
            fmi2GetDirectionalDerivative(
                unknowns: References, n_unknowns: usize, knowns: References, n_knowns: usize,
                seed: *const f64, sensitivity: *mut f64
            ) => Sensitivity: directional(
                (unknowns, n_unknowns), (knowns, n_knowns), (seed, n_knowns), (sensitivity, n_unknowns), false
            );

            fmi2EnterEventMode() => EnterEvent: enter_event();
            fmi2NewDiscreteStates(info: *mut Fmi2EventInfo) => UpdateDiscrete: fmi2_new_discrete_states(info);
            fmi2EnterContinuousTimeMode() => EnterContinuous: leave_event();
            fmi2CompletedIntegratorStep(no_set_state_prior: Fmi2Boolean, event: *mut Fmi2Boolean, end: *mut Fmi2Boolean)
                => CompletedStep: completed_step(event, end);
            fmi2SetTime(time: f64) => SetTime: set_time(time);
            fmi2SetContinuousStates(x: *const f64, n: usize) => SetStates: set_states(x, n);
            fmi2GetDerivatives(dx: *mut f64, n: usize) => GetContinuous: derivatives(dx, n);
            fmi2GetEventIndicators(z: *mut f64, n: usize) => GetContinuous: indicators(z, n);
            fmi2GetContinuousStates(x: *mut f64, n: usize) => GetContinuous: get_states(x, n);
            fmi2GetNominalsOfContinuousStates(x: *mut f64, n: usize) => GetNominals: nominals(x, n);
        }
    };
}
