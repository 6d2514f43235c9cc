//! FMI 3.0.2: its own calls, and the table of its functions.

use super::callbacks::{Callbacks, Request};
use super::gate::{Entry, Function, Steps, enter, enter_parts, open};
use super::logger::{Fmi3Logger, Fmi3Sink};
use super::pointer::{array, place, room, text};
use super::types::{Fmi3Boolean, InstancePointer, References, Text};
use super::{Abi, Answer, credentials};
use crate::inside::{Pause, Then};
use crate::instance::{Instance, Refusal};
use crate::log::Log;
use fmu_core::{Exported, Fault, Interface, Model};
use std::ffi::c_int;

/// Errors and safety as in `calls.rs`.
#[allow(missing_docs, reason = "named as in the standards")]
#[allow(clippy::missing_safety_doc, clippy::missing_errors_doc, reason = "the sections above cover all")]
impl<E: Exported> Abi<'_, E> {
    /// FMI 3.0.2, 2.3.1. `refused` names a requested feature that this FMU lacks.
    #[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
    pub unsafe fn fmi3_instantiate(
        entry: &'static Entry,
        name: Text,
        token: Text,
        resources: Text,
        logging_on: Fmi3Boolean,
        logger: Option<Fmi3Logger>,
        interface: Interface,
        early_return: bool,
        callbacks: Callbacks,
        (required, n_required): (References, usize),
        refused: Option<&str>,
    ) -> InstancePointer {
        // SAFETY: the importer's texts and array, valid during this call.
        let (name, token, resources, required) =
            unsafe { (text(name), text(token), text(resources), array(required, n_required, "variables")) };
        let unused = const { E::CAN.intermediate.is_none() } && n_required > 0;
        let environment = callbacks.environment;
        let used = const { E::CAN.intermediate.is_some() || E::CAN.scheduled };
        let callbacks = if used { callbacks } else { Callbacks::NONE };
        let refused = refused.or(match interface {
            _ if unused => Some("nRequiredIntermediateVariables must be 0: providesIntermediateUpdate = false"),
            Interface::ModelExchange if !E::CAN.model_exchange() => {
                Some("not supported: Model Exchange; this FMU is for Co-Simulation")
            }
            Interface::ScheduledExecution if !E::CAN.scheduled => Some("not supported: Scheduled Execution"),
            Interface::ScheduledExecution if callbacks.clock_update.is_none() && announces::<E>() => {
                Some("clockUpdate is NULL, and the model has output or countdown clocks")
            }
            Interface::CoSimulation if E::CAN.clocked.is_some() => {
                Some("eventModeUsed = false is not allowed: the model has clocks")
            }
            Interface::CoSimulation | Interface::EventMode if E::CAN.exchange_only => {
                Some("not supported: Co-Simulation; this FMU is for Model Exchange")
            }
            Interface::EventMode if !E::CAN.event_mode() => {
                Some("eventModeUsed = true is not allowed: hasEventMode = false")
            }
            _ => None,
        });
        let judged = credentials::<E>(name, token);
        let judged = judged.and_then(|wanted| refused.map_or(Ok(wanted), |why| Err(Fault::new(why))));
        let (judged, required) = match required {
            Ok(required) => (judged, required),
            Err(fault) => (Err(fault), &[][..]),
        };
        let sink = Fmi3Sink { logger, environment };
        let steps = Steps { early_return, callbacks, required };
        open::<E>(entry, Log::new(Box::new(sink), logging_on.0 != 0), judged, resources, interface, steps)
    }

    /// FMI 3.0.2, 4.2.1. Without Event Mode and early return, only the time carries information. If the importer has requested
    /// intermediate updates, the step is taken in parts.
    ///
    /// # Safety
    /// As [`enter`](Self::enter), and the importer's variables.
    #[inline]
    #[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
    pub unsafe fn fmi3_do_step<F: Function>(
        instance: InstancePointer,
        t: f64,
        h: f64,
        event: *mut Fmi3Boolean,
        terminate: *mut Fmi3Boolean,
        early: *mut Fmi3Boolean,
        time: *mut f64,
        unusual: impl Fn() -> c_int,
    ) -> c_int {
        if const { E::CAN.intermediate.is_none() } {
            let step = |mut abi: Abi<'_, E>| {
                // SAFETY: the caller's promise.
                unsafe {
                    abi.report_step(event, terminate, early, time, |instance| instance.do_step(t, h).map(Then::Done))?;
                }
                Ok(())
            };
            // SAFETY: the caller's promise.
            return unsafe { enter::<E, F>(instance, step, unusual) };
        }
        let mut under_way = None;
        let part = |mut abi: Abi<'_, E>, reply| {
            // SAFETY: the caller's promise.
            let update = unsafe {
                abi.report_step(event, terminate, early, time, |instance| {
                    if instance.inside.is_none() {
                        return instance.do_step(t, h).map(Then::Done);
                    }
                    instance.step_part((t, h), &mut under_way, reply)
                })
            }?;
            Ok(update.map(Request::Intermediate))
        };
        // SAFETY: the caller's promise.
        unsafe { enter_parts::<E, F>(instance, part, unusual) }
    }

    /// Takes a step or a part of it and writes how it ended, or returns the update for the importer inside it.
    #[inline]
    unsafe fn report_step(
        &mut self,
        event_handling_needed: *mut Fmi3Boolean,
        terminate_simulation: *mut Fmi3Boolean,
        early_return: *mut Fmi3Boolean,
        last_successful_time: *mut f64,
        step: impl FnOnce(&mut Instance<E>) -> Result<Then, Fault>,
    ) -> Result<Option<Pause>, Fault> {
        // SAFETY: the importer's variables.
        let (time, event, early, terminate) = unsafe {
            (
                place(last_successful_time, "lastSuccessfulTime")?,
                place(event_handling_needed, "eventHandlingNeeded")?,
                place(early_return, "earlyReturn")?,
                place(terminate_simulation, "terminateSimulation")?,
            )
        };
        terminate.write(false.into());
        event.write(false.into());
        early.write(false.into());
        time.write(self.0.current.end);
        let stepped = match step(self.0)? {
            Then::Done(stepped) => stepped,
            Then::Call(update) => return Ok(Some(update)),
        };
        event.write(stepped.event.into());
        early.write(stepped.early.into());
        terminate.write(stepped.terminate.into());
        time.write(self.0.current.end);
        Ok(None)
    }

    /// FMI 3.0.2, 5.2.2. The importer is notified of clocks that ticked, and of future ticks, before the call returns.
    ///
    /// # Safety
    /// As [`enter`](Self::enter).
    pub unsafe fn fmi3_activate<F: Function>(
        instance: InstancePointer,
        clock: u32,
        t: f64,
        unusual: impl Fn() -> c_int,
    ) -> c_int {
        if const { !E::CAN.scheduled } {
            // SAFETY: the caller's promise.
            return unsafe { enter::<E, F>(instance, |mut abi| abi.unsupported("Scheduled Execution"), unusual) };
        }
        let mut done = false;
        let part = |mut abi: Abi<'_, E>, _| {
            if std::mem::replace(&mut done, true) {
                return Ok(None);
            }
            Ok(abi.activate_partition(clock, t).map_err(as_error)?.then_some(Request::Clocks))
        };
        // SAFETY: the caller's promise.
        unsafe { enter_parts::<E, F>(instance, part, unusual) }
    }

    pub unsafe fn fmi3_get_clock(&mut self, vr: References, n: usize, values: *mut Fmi3Boolean) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (out, vr) = unsafe { (room(values, n, "values")?, array(vr, n, "value references")?) };
        Ok(self.0.get_clocks(vr, out)?)
    }

    pub unsafe fn fmi3_set_clock(&mut self, vr: References, n: usize, values: *const Fmi3Boolean) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (values, vr) = unsafe { (array(values, n, "values")?, array(vr, n, "value references")?) };
        Ok(self.0.set_clocks(vr, values)?)
    }

    pub unsafe fn fmi3_get_interval(
        &mut self,
        vr: References,
        n: usize,
        intervals: *mut f64,
        qualifiers: *mut c_int,
    ) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (vr, intervals, qualifiers) = unsafe {
            (array(vr, n, "value references")?, room(intervals, n, "intervals")?, room(qualifiers, n, "qualifiers")?)
        };
        Ok(self.0.get_intervals(vr, intervals, qualifiers)?)
    }

    pub unsafe fn fmi3_get_fraction(
        &mut self,
        vr: References,
        n: usize,
        counters: *mut u64,
        resolutions: *mut u64,
        qualifiers: *mut c_int,
    ) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (vr, counters, resolutions, qualifiers) = unsafe {
            (
                array(vr, n, "value references")?,
                room(counters, n, "counters")?,
                room(resolutions, n, "resolutions")?,
                room(qualifiers, n, "qualifiers")?,
            )
        };
        Ok(self.0.get_fractions(vr, counters, resolutions, qualifiers)?)
    }

    pub unsafe fn fmi3_get_shift(&mut self, vr: References, n: usize, shifts: *mut f64) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (out, vr) = unsafe { (room(shifts, n, "shifts")?, array(vr, n, "value references")?) };
        Ok(self.0.get_shifts(vr, out)?)
    }

    pub unsafe fn fmi3_get_shift_fraction(
        &mut self,
        vr: References,
        n: usize,
        counters: *mut u64,
        resolutions: *mut u64,
    ) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (vr, counters, resolutions) = unsafe {
            (array(vr, n, "value references")?, room(counters, n, "counters")?, room(resolutions, n, "resolutions")?)
        };
        Ok(self.0.get_shift_fractions(vr, counters, resolutions)?)
    }

    pub unsafe fn fmi3_set_interval(&mut self, vr: References, n: usize, intervals: *const f64) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (values, vr) = unsafe { (array(intervals, n, "intervals")?, array(vr, n, "value references")?) };
        Ok(self.0.set_intervals(vr, values)?)
    }

    pub unsafe fn fmi3_set_shift(&mut self, vr: References, n: usize, shifts: *const f64) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (values, vr) = unsafe { (array(shifts, n, "shifts")?, array(vr, n, "value references")?) };
        Ok(self.0.set_shifts(vr, values)?)
    }

    /// No clock lets its importer choose a fraction.
    pub unsafe fn fmi3_no_fraction(&mut self, vr: References, n: usize) -> Answer {
        // SAFETY: the importer's array, of this length.
        Ok(self.0.refuse_fractions(unsafe { array(vr, n, "value references")? })?)
    }

    pub unsafe fn fmi3_update_discrete_states(
        &mut self,
        again: *mut Fmi3Boolean,
        terminate: *mut Fmi3Boolean,
        nominals: *mut Fmi3Boolean,
        values: *mut Fmi3Boolean,
        next_defined: *mut Fmi3Boolean,
        next: *mut f64,
    ) -> Answer {
        // SAFETY: the importer's variables.
        let (again, terminate, nominals, values, next_defined, next) = unsafe {
            (
                place(again, "discreteStatesNeedUpdate")?,
                place(terminate, "terminateSimulation")?,
                place(nominals, "nominalsOfContinuousStatesChanged")?,
                place(values, "valuesOfContinuousStatesChanged")?,
                place(next_defined, "nextEventTimeDefined")?,
                place(next, "nextEventTime")?,
            )
        };
        let update = self.0.update_discrete()?;
        again.write(update.outcome.again.into());
        terminate.write(update.outcome.terminate.into());
        nominals.write(false.into());
        values.write(update.outcome.states_changed.into());
        next_defined.write(update.next.is_some().into());
        next.write(update.next.unwrap_or(0.0));
        Ok(())
    }

    /// A sample that the importer did not request is taken by the next step; an active clock ticks now.
    pub fn fmi3_enter_step(&mut self) -> Answer {
        if const { E::CAN.clocked.is_some() } && self.0.has_active_clocks() {
            self.0.leave_event()?;
        }
        self.0.current.pending = false;
        Ok(())
    }

    pub fn fmi3_evaluate(&mut self) -> Answer {
        Ok(())
    }

    pub unsafe fn fmi3_count(&mut self, count: *mut usize, of_indicators: bool) -> Answer {
        let number = if of_indicators { E::CAN.indicators().len() } else { self.0.state_count() };
        // SAFETY: the importer's variable.
        unsafe { place(count, "the number")? }.write(number);
        Ok(())
    }
}

/// Whether the model notifies the importer of clocks.
const fn announces<E: Exported>() -> bool {
    E::Model::TABLE.announces()
}

/// Scheduled Execution has no status Discard (FMI 3.0.2, 5.2).
fn as_error(refusal: Refusal) -> Refusal {
    match refusal {
        Refusal::Discard(fault) | Refusal::Error(fault) => Refusal::Error(fault),
    }
}

/// The functions of `fmi3Functions.h`, in the form of the table of FMI 2.0.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi3 {
    ($exported:ty) => {
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn fmi3GetVersion() -> Text {
            c"3.0".as_ptr()
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3InstantiateCoSimulation(
            name: Text,
            token: Text,
            resources: Text,
            visible: Fmi3Boolean,
            logging_on: Fmi3Boolean,
            event_mode_used: Fmi3Boolean,
            early_return_allowed: Fmi3Boolean,
            required: References,
            n_required: usize,
            environment: *mut c_void,
            logger: Option<Fmi3Logger>,
            intermediate: Option<Fmi3IntermediateUpdate>,
        ) -> InstancePointer {
            $crate::abi::quiet();
            const ENTRY: &Entry = &Entry::new(Standard::Fmi3, Call::Instantiate, "fmi3InstantiateCoSimulation");
            let interface =
                if event_mode_used.0 != 0 { Interface::EventMode } else { Interface::CoSimulation };
            let (early, callbacks) = (early_return_allowed.0 != 0, Callbacks { environment, intermediate, ..Callbacks::NONE });
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::record::open_logged::<$exported>(
                    ENTRY,
                    || vec![
                        ("name", Argument::text(name)),
                        ("token", Argument::text(token)),
                        ("resources", Argument::text(resources)),
                        ("visible", visible.argument()),
                        ("logging_on", logging_on.argument()),
                        ("event_mode_used", event_mode_used.argument()),
                        ("early_return_allowed", early_return_allowed.argument()),
                        ("required", required.argument()),
                        ("n", n_required.argument()),
                        ("logger", Argument::given(logger.is_some())),
                        ("intermediate", Argument::given(intermediate.is_some())),
                    ],
                    || $crate::abi::Abi::<$exported>::fmi3_instantiate(
                        ENTRY, name, token, resources, logging_on, logger, interface, early, callbacks,
                        (required, n_required), None,
                    ),
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3InstantiateModelExchange(
            name: Text,
            token: Text,
            resources: Text,
            visible: Fmi3Boolean,
            logging_on: Fmi3Boolean,
            environment: *mut c_void,
            logger: Option<Fmi3Logger>,
        ) -> InstancePointer {
            $crate::abi::quiet();
            const ENTRY: &Entry = &Entry::new(Standard::Fmi3, Call::Instantiate, "fmi3InstantiateModelExchange");
            let (interface, callbacks) = (Interface::ModelExchange, Callbacks { environment, ..Callbacks::NONE });
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::record::open_logged::<$exported>(
                    ENTRY,
                    || vec![
                        ("name", Argument::text(name)),
                        ("token", Argument::text(token)),
                        ("resources", Argument::text(resources)),
                        ("visible", visible.argument()),
                        ("logging_on", logging_on.argument()),
                        ("logger", Argument::given(logger.is_some())),
                    ],
                    || $crate::abi::Abi::<$exported>::fmi3_instantiate(
                        ENTRY, name, token, resources, logging_on, logger, interface, false, callbacks, (null(), 0), None,
                    ),
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3InstantiateScheduledExecution(
            name: Text,
            token: Text,
            resources: Text,
            visible: Fmi3Boolean,
            logging_on: Fmi3Boolean,
            environment: *mut c_void,
            logger: Option<Fmi3Logger>,
            clock_update: Option<Fmi3ClockUpdate>,
            lock: Option<Fmi3Preemption>,
            unlock: Option<Fmi3Preemption>,
        ) -> InstancePointer {
            $crate::abi::quiet();
            const ENTRY: &Entry = &Entry::new(Standard::Fmi3, Call::Instantiate, "fmi3InstantiateScheduledExecution");
            let interface = Interface::ScheduledExecution;
            let preemption = lock.zip(unlock).map(|(lock, unlock)| [lock, unlock]);
            let callbacks = Callbacks { environment, clock_update, preemption, ..Callbacks::NONE };
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::record::open_logged::<$exported>(
                    ENTRY,
                    || vec![
                        ("name", Argument::text(name)),
                        ("token", Argument::text(token)),
                        ("resources", Argument::text(resources)),
                        ("visible", visible.argument()),
                        ("logging_on", logging_on.argument()),
                        ("logger", Argument::given(logger.is_some())),
                        ("clock_update", Argument::given(clock_update.is_some())),
                        ("lock", Argument::given(lock.is_some())),
                        ("unlock", Argument::given(unlock.is_some())),
                    ],
                    || $crate::abi::Abi::<$exported>::fmi3_instantiate(
                        ENTRY, name, token, resources, logging_on, logger, interface, false, callbacks, (null(), 0), None,
                    ),
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3FreeInstance(instance: InstancePointer) {
            // SAFETY: what the standard demands of the importer.
            unsafe { $crate::abi::Abi::<$exported>::free_instance(instance, "fmi3FreeInstance") }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3DoStep(
            instance: InstancePointer,
            t: f64,
            h: f64,
            no_set_state_prior: Fmi3Boolean,
            event_handling_needed: *mut Fmi3Boolean,
            terminate_simulation: *mut Fmi3Boolean,
            early_return: *mut Fmi3Boolean,
            last_successful_time: *mut f64,
        ) -> c_int {
            struct Here;
            impl Function for Here {
                const ENTRY: Entry = Entry::new(Standard::Fmi3, Call::DoStep, "fmi3DoStep");
            }
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::Abi::<$exported>::fmi3_do_step::<Here>(
                    instance, t, h, event_handling_needed, terminate_simulation, early_return, last_successful_time,
                    $crate::unusual!($exported, fmi3DoStep(
                        instance, t: f64, h: f64, no_set_state_prior: Fmi3Boolean, event_handling_needed: *mut Fmi3Boolean,
                        terminate_simulation: *mut Fmi3Boolean, early_return: *mut Fmi3Boolean, last_successful_time: *mut f64
                    )),
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3ActivateModelPartition(instance: InstancePointer, clock: u32, t: f64) -> c_int {
            struct Here;
            impl Function for Here {
                const ENTRY: Entry = Entry::new(
                    Standard::Fmi3,
                    Call::Activate.of(<$exported as Exported>::CAN.scheduled),
                    "fmi3ActivateModelPartition",
                );
            }
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::Abi::<$exported>::fmi3_activate::<Here>(
                    instance, clock, t,
                    $crate::unusual!($exported, fmi3ActivateModelPartition(instance, clock: u32, t: f64)),
                )
            }
        }

        $crate::functions! { Fmi3 $exported;
            fmi3SetDebugLogging(on: Fmi3Boolean, n: usize, categories: *const Text)
                => SetDebugLogging: set_debug_logging(on.0 != 0, n, categories);
            fmi3EnterInitializationMode(tolerance_defined: Fmi3Boolean, tolerance: f64, start: f64, stop_defined: Fmi3Boolean, stop: f64)
                => EnterInitialization: set_up(start, (stop_defined.0 != 0).then_some(stop));
            fmi3ExitInitializationMode() => ExitInitialization: exit_initialization();
            fmi3Terminate() => Terminate: terminate();
            fmi3Reset() => Reset: reset();

            fmi3GetFloat64(vr: References, n: usize, values: *mut f64, m: usize) => Get: get(vr, n, values, m);
            fmi3GetInt32(vr: References, n: usize, values: *mut i32, m: usize) => Get: get(vr, n, values, m);
            fmi3GetInt64(vr: References, n: usize, values: *mut i64, m: usize) => Get: get(vr, n, values, m);
            fmi3GetBoolean(vr: References, n: usize, values: *mut Fmi3Boolean, m: usize) => Get: get(vr, n, values, m);
            fmi3GetFloat32(vr: References, n: usize, values: *mut f32, m: usize) => Get: get(vr, n, values, m);
            fmi3GetInt8(vr: References, n: usize, values: *mut i8, m: usize) => Get: get(vr, n, values, m);
            fmi3GetUInt8(vr: References, n: usize, values: *mut u8, m: usize) => Get: get(vr, n, values, m);
            fmi3GetInt16(vr: References, n: usize, values: *mut i16, m: usize) => Get: get(vr, n, values, m);
            fmi3GetUInt16(vr: References, n: usize, values: *mut u16, m: usize) => Get: get(vr, n, values, m);
            fmi3GetUInt32(vr: References, n: usize, values: *mut u32, m: usize) => Get: get(vr, n, values, m);
            fmi3GetUInt64(vr: References, n: usize, values: *mut u64, m: usize) => Get: get(vr, n, values, m);
            fmi3GetString(vr: References, n: usize, values: *mut Text, m: usize) => Get: get_texts(vr, n, values, m);
            fmi3GetBinary(vr: References, n: usize, sizes: *mut usize, values: *mut *const u8, m: usize)
                => Get: get_bytes(vr, n, sizes, values, m);
            fmi3GetClock(vr: References, n: usize, values: *mut Fmi3Boolean)
                => GetClock if clocked: fmi3_get_clock(vr, n, values);

            fmi3SetFloat64(vr: References, n: usize, values: *const f64, m: usize) => Set: set(vr, n, values, m);
            fmi3SetInt32(vr: References, n: usize, values: *const i32, m: usize) => Set: set(vr, n, values, m);
            fmi3SetInt64(vr: References, n: usize, values: *const i64, m: usize) => Set: set(vr, n, values, m);
            fmi3SetBoolean(vr: References, n: usize, values: *const Fmi3Boolean, m: usize) => Set: set(vr, n, values, m);
            fmi3SetFloat32(vr: References, n: usize, values: *const f32, m: usize) => Set: set(vr, n, values, m);
            fmi3SetInt8(vr: References, n: usize, values: *const i8, m: usize) => Set: set(vr, n, values, m);
            fmi3SetUInt8(vr: References, n: usize, values: *const u8, m: usize) => Set: set(vr, n, values, m);
            fmi3SetInt16(vr: References, n: usize, values: *const i16, m: usize) => Set: set(vr, n, values, m);
            fmi3SetUInt16(vr: References, n: usize, values: *const u16, m: usize) => Set: set(vr, n, values, m);
            fmi3SetUInt32(vr: References, n: usize, values: *const u32, m: usize) => Set: set(vr, n, values, m);
            fmi3SetUInt64(vr: References, n: usize, values: *const u64, m: usize) => Set: set(vr, n, values, m);
            fmi3SetString(vr: References, n: usize, values: *const Text, m: usize) => Set: set_texts(vr, n, values, m);
            fmi3SetBinary(vr: References, n: usize, sizes: *const usize, values: *const *const u8, m: usize)
                => Set: set_bytes(vr, n, sizes, values, m);
            fmi3SetClock(vr: References, n: usize, values: *const Fmi3Boolean)
                => SetClock if clocked: fmi3_set_clock(vr, n, values);

            fmi3GetFMUState(state: *mut FmuState) => SaveState: save_state(state);
            fmi3SetFMUState(state: FmuState) => RestoreState: restore_state(state);
            fmi3FreeFMUState(state: *mut FmuState) => UseState: free_state(state);
            fmi3SerializedFMUStateSize(state: FmuState, size: *mut usize) => UseState: serialized_size(state, size);
            fmi3SerializeFMUState(state: FmuState, bytes: *mut u8, size: usize) => UseState: serialize(state, bytes, size);
            fmi3DeserializeFMUState(bytes: *const u8, size: usize, state: *mut FmuState)
                => UseState: deserialize(bytes, size, state);

            fmi3EnterStepMode() => EnterStep: fmi3_enter_step();
            fmi3EnterEventMode() => EnterEvent: enter_event();
            fmi3EvaluateDiscreteStates() => EvaluateDiscrete: fmi3_evaluate();
            fmi3UpdateDiscreteStates(
                again: *mut Fmi3Boolean, terminate: *mut Fmi3Boolean, nominals: *mut Fmi3Boolean,
                values: *mut Fmi3Boolean, next_defined: *mut Fmi3Boolean, next: *mut f64
            ) => UpdateDiscrete: fmi3_update_discrete_states(again, terminate, nominals, values, next_defined, next);
            fmi3GetOutputDerivatives(vr: References, n: usize, orders: *const i32, values: *mut f64, m: usize)
                => OutputDerivatives: output_derivatives(vr, n, orders, values, m);
            fmi3GetDirectionalDerivative(
                unknowns: References, n_unknowns: usize, knowns: References, n_knowns: usize,
                seed: *const f64, n_seed: usize, sensitivity: *mut f64, n_sensitivity: usize
            ) => Sensitivity: directional(
                (unknowns, n_unknowns), (knowns, n_knowns), (seed, n_seed), (sensitivity, n_sensitivity), false
            );
            fmi3GetAdjointDerivative(
                unknowns: References, n_unknowns: usize, knowns: References, n_knowns: usize,
                seed: *const f64, n_seed: usize, sensitivity: *mut f64, n_sensitivity: usize
            ) => Sensitivity: directional(
                (unknowns, n_unknowns), (knowns, n_knowns), (seed, n_seed), (sensitivity, n_sensitivity), true
            );
            fmi3GetNumberOfVariableDependencies(vr: u32, n: *mut usize)
                => Unsupported: unsupported("providesPerElementDependencies = false");
            fmi3GetVariableDependencies(
                dependent: u32, elements: *mut usize, independents: *mut u32, of_independents: *mut usize,
                kinds: *mut c_int, n: usize
            ) => Unsupported: unsupported("providesPerElementDependencies = false");
            fmi3EnterConfigurationMode() => EnterConfiguration if resizable: enter_configuration();
            fmi3ExitConfigurationMode() => ExitConfiguration if resizable: exit_configuration();

            fmi3GetIntervalDecimal(vr: References, n: usize, intervals: *mut f64, qualifiers: *mut c_int)
                => GetInterval if clocked: fmi3_get_interval(vr, n, intervals, qualifiers);
            fmi3GetIntervalFraction(
                vr: References, n: usize, counters: *mut u64, resolutions: *mut u64, qualifiers: *mut c_int
            ) => GetInterval if clocked: fmi3_get_fraction(vr, n, counters, resolutions, qualifiers);
            fmi3GetShiftDecimal(vr: References, n: usize, shifts: *mut f64)
                => Shift if clocked: fmi3_get_shift(vr, n, shifts);
            fmi3GetShiftFraction(vr: References, n: usize, counters: *mut u64, resolutions: *mut u64)
                => Shift if clocked: fmi3_get_shift_fraction(vr, n, counters, resolutions);
            fmi3SetIntervalDecimal(vr: References, n: usize, intervals: *const f64)
                => SetInterval if clocked: fmi3_set_interval(vr, n, intervals);
            fmi3SetIntervalFraction(vr: References, n: usize, counters: *const u64, resolutions: *const u64)
                => SetInterval if clocked: fmi3_no_fraction(vr, n);
            fmi3SetShiftDecimal(vr: References, n: usize, shifts: *const f64)
                => Shift if clocked: fmi3_set_shift(vr, n, shifts);
            fmi3SetShiftFraction(vr: References, n: usize, counters: *const u64, resolutions: *const u64)
                => Shift if clocked: fmi3_no_fraction(vr, n);

            fmi3EnterContinuousTimeMode() => EnterContinuous: leave_event();
            fmi3CompletedIntegratorStep(no_set_state_prior: Fmi3Boolean, event: *mut Fmi3Boolean, end: *mut Fmi3Boolean)
                => CompletedStep: completed_step(event, end);
            fmi3SetTime(time: f64) => SetTime: set_time(time);
            fmi3SetContinuousStates(x: *const f64, n: usize) => SetStates: set_states(x, n);
            fmi3GetContinuousStateDerivatives(dx: *mut f64, n: usize) => GetContinuous: derivatives(dx, n);
            fmi3GetEventIndicators(z: *mut f64, n: usize) => GetContinuous: indicators(z, n);
            fmi3GetContinuousStates(x: *mut f64, n: usize) => GetContinuous: get_states(x, n);
            fmi3GetNominalsOfContinuousStates(x: *mut f64, n: usize) => GetNominals: nominals(x, n);
            fmi3GetNumberOfEventIndicators(n: *mut usize) => Count: fmi3_count(n, true);
            fmi3GetNumberOfContinuousStates(n: *mut usize) => Count: fmi3_count(n, false);
        }
    };
}
