//! Every call of both standards, once.
//!
//! Two types use them: [`Live`](super::live::Live), the instances of the facade, and [`Raw`](super::raw::Raw), the checker's
//! calls with arguments that a well-behaved importer never passes. The argument types keep both from undefined behavior:
//! [`Given`] is a pointer from the FMU, [`Array`] and [`ArrayMut`] are NULL or at least as long as their count. Getters,
//! setters and instantiation take bare pointers and are `unsafe`.

use super::arguments::{Answer, Array, ArrayMut, Given};
use super::functions::{CType, Calls, Function, Way};
use super::raw::{Count, Interface, Sensitivity, Simple, StepResults, StepStatus, UpdateResults, Vector};
use super::signatures::{InstancePointer, OfInstance, StatePlace, StatePointer, v2, v3};
use libloading::Library;
use model_description::FmiVersion;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr;

/// The arguments of an instantiation in both standards.
#[expect(clippy::struct_excessive_bools, reason = "the arguments of the standards")]
pub(super) struct Request<'a> {
    /// Name, token, resources.
    pub(super) texts: [Option<&'a CStr>; 3],
    pub(super) interface: Interface,
    pub(super) logging: bool,
    pub(super) visible: bool,
    pub(super) event_mode: bool,
    pub(super) early_return: bool,
    /// FMI 2.0's.
    pub(super) callbacks: *const v2::Callbacks,
    /// FMI 3.0's, with its environment.
    pub(super) logger: Option<v3::LogMessage>,
    pub(super) environment: *mut c_void,
    /// FMI 3.0's callbacks that may call the FMU again, and the variables that are used in steps.
    pub(super) updates: Updates<'a>,
}

/// Actions of an importer during a call (FMI 3.0).
#[derive(Default)]
pub(super) struct Updates<'a> {
    pub(super) intermediate: Option<v3::IntermediateUpdate>,
    pub(super) required: &'a [u32],
    pub(super) clocks: Option<v3::ClockUpdate>,
    /// Lock and unlock.
    pub(super) preemption: [Option<v3::Preemption>; 2],
}

/// `fmi3ClockActive`.
static ACTIVE: u8 = 1;

impl Calls {
    /// The library, to be unloaded.
    pub(super) fn into_library(self) -> Library {
        self.library
    }

    /// Whether there is a function of this full name.
    pub(super) fn has(&self, name: &str) -> bool {
        // SAFETY: only the existence of the symbol is checked; this type is never called.
        unsafe { self.library.get::<OfInstance>(name) }.is_ok()
    }

    /// A function of this full name, which only the checker calls.
    ///
    /// # Safety
    /// The standard gives the name this type.
    pub(super) unsafe fn function<T: Copy>(&self, name: &str) -> Option<T> {
        // SAFETY: the caller promises the type.
        unsafe { self.library.get::<T>(name) }.ok().map(|symbol| *symbol)
    }

    /// Creates an instance: the function's name, and the pointer that it returned; `None` if it is missing.
    ///
    /// # Safety
    /// The callbacks are NULL or live as long as the instance, and so does the target of the environment.
    pub(super) unsafe fn instantiate(&self, r: &Request<'_>) -> (&'static str, Option<InstancePointer>) {
        let [name, token, resources] = r.texts.map(|text| text.map_or(ptr::null(), CStr::as_ptr));
        let (e, log, Updates { intermediate, required, clocks, preemption: [lock, unlock] }) =
            (r.environment, r.logger, &r.updates);
        let (list, n) = (required.as_ptr(), required.len());
        // SAFETY: all calls pass the standards' types; the texts are NULL or C strings that outlive the call, and so does the
        // list of variables; the caller promises the rest.
        unsafe {
            match (self.version, r.interface) {
                (FmiVersion::V2, interface) => {
                    let kind = c_int::from(interface == Interface::CoSimulation);
                    let (Function(full, f), logging) = (&self.instantiate, c_int::from(r.logging));
                    (*full, f.map(|f| f(name, kind, token, resources, r.callbacks, c_int::from(r.visible), logging)))
                }
                (FmiVersion::V3, Interface::CoSimulation) => {
                    let (Function(full, f), event_mode, early) = (&self.co_simulation, r.event_mode, r.early_return);
                    let call = |f: v3::InstantiateCoSimulation| {
                        f(
                            name,
                            token,
                            resources,
                            r.visible,
                            r.logging,
                            event_mode,
                            early,
                            list,
                            n,
                            e,
                            log,
                            *intermediate,
                        )
                    };
                    (*full, f.map(call))
                }
                (FmiVersion::V3, Interface::ModelExchange) => {
                    let Function(full, f) = &self.model_exchange;
                    (*full, f.map(|f| f(name, token, resources, r.visible, r.logging, e, log)))
                }
                (FmiVersion::V3, Interface::ScheduledExecution) => {
                    let Function(full, f) = &self.scheduled_execution;
                    (*full, f.map(|f| f(name, token, resources, r.visible, r.logging, e, log, *clocks, *lock, *unlock)))
                }
            }
        }
    }

    /// Frees an instance; `None` if the function is missing.
    ///
    /// # Safety
    /// The instance and its states are not used afterwards.
    pub(super) unsafe fn free(&self, instance: Given<'_>) -> Option<()> {
        // SAFETY: an instance of this library or NULL; the caller promises that this is its last call.
        self.free.1.map(|f| unsafe { f(instance.0) })
    }

    /// A function whose only argument is the instance. `fmi3EnterInitializationMode` takes more: see
    /// [`experiment`](Self::experiment).
    #[inline]
    pub(super) fn simple(&self, name: Simple, i: Given<'_>) -> Answer {
        if name == Simple::EnterInitializationMode && self.version == FmiVersion::V3 {
            return Answer(self.enter_3.0, None);
        }
        // SAFETY: all functions that `Simple` names have this type.
        self.simple[name as usize].call(|f| unsafe { f(i.0) })
    }

    /// `fmi2SetupExperiment` or `fmi3EnterInitializationMode`.
    pub(super) fn experiment(&self, i: Given<'_>, tolerance: Option<f64>, start: f64, stop: Option<f64>) -> Answer {
        let (has, with) = (tolerance.is_some(), stop.is_some());
        let (tolerance, stop) = (tolerance.unwrap_or(0.0), stop.unwrap_or(0.0));
        // SAFETY: both calls pass the standard's type.
        unsafe {
            match self.version {
                FmiVersion::V2 => {
                    self.setup_2.call(|f| f(i.0, c_int::from(has), tolerance, start, c_int::from(with), stop))
                }
                FmiVersion::V3 => self.enter_3.call(|f| f(i.0, has, tolerance, start, with, stop)),
            }
        }
    }

    /// Gets or sets values.
    ///
    /// # Safety
    /// `values` is NULL or points to as many values of the type as both counts state; a getter may write to them. Texts to be set
    /// are NULL or C strings.
    #[inline]
    pub(super) unsafe fn transfer(
        &self,
        way: Way,
        i: Given<'_>,
        CType(kind): CType,
        references: Array<'_, u32>,
        values: *mut c_void,
        n_values: usize,
    ) -> Answer {
        let (list, n) = (references.pointer(), references.1);
        // SAFETY: both calls pass the standards' types for all values, which differ only in the target of the pointer.
        unsafe {
            match self.version {
                FmiVersion::V2 => self.transfer_2[kind][way as usize].call(|f| f(i.0, list, n, values)),
                FmiVersion::V3 => self.transfer_3[kind][way as usize].call(|f| f(i.0, list, n, values, n_values)),
            }
        }
    }

    /// `DoStep`. `pointers` are FMI 3.0's: the results that do not get NULL; `before` is the content of the results before the
    /// call.
    #[inline]
    pub(super) fn do_step(
        &self,
        i: Given<'_>,
        (t, h): (f64, f64),
        no_prior: bool,
        pointers: [bool; 4],
        before: StepResults,
    ) -> Answer<StepResults> {
        // SAFETY: both calls pass the standard's type; the variables are ours or NULL.
        unsafe {
            match self.version {
                FmiVersion::V2 => self.do_step_2.write(before, |f, _| f(i.0, t, h, c_int::from(no_prior))),
                FmiVersion::V3 => self.do_step_3.write(before, |f, StepResults { event, terminate, early, last }| {
                    let place = |given, place: &mut u8| if given { ptr::from_mut(place) } else { ptr::null_mut() };
                    let (event, terminate) = (place(pointers[0], event), place(pointers[1], terminate));
                    let last = if pointers[3] { ptr::from_mut(last) } else { ptr::null_mut() };
                    f(i.0, t, h, no_prior, event, terminate, place(pointers[2], early), last)
                }),
            }
        }
    }

    /// `fmi2Get...Status` with a buffer for any of its results; returns the first eight bytes of it, which are `before` at
    /// first.
    pub(super) fn step_status(&self, name: StepStatus, i: Given<'_>, kind: c_int, before: u64) -> Answer<u64> {
        let full = StepStatus::ALL[name as usize][0];
        // SAFETY: both calls pass FMI 2.0's type except for the buffer, which is large enough for each of its values.
        unsafe {
            Function(full, self.function::<v2::GetStatus<u64>>(full)).write(before, |f, place| f(i.0, kind, place))
        }
    }

    /// `SetDebugLogging`. The categories are C strings, or NULL.
    pub(super) fn debug_logging(
        &self,
        i: Given<'_>,
        on: bool,
        categories: Option<&[Option<&CStr>]>,
        n: usize,
    ) -> Answer {
        let list: Vec<*const c_char> =
            categories.unwrap_or_default().iter().map(|c| c.map_or(ptr::null(), CStr::as_ptr)).collect();
        let list = Array::of(categories.map(|_| &list[..]), n).pointer();
        // SAFETY: both calls pass the standard's type, and as many strings as stated, or NULL.
        unsafe {
            match self.version {
                FmiVersion::V2 => self.debug_logging_2.call(|f| f(i.0, c_int::from(on), n, list)),
                FmiVersion::V3 => self.debug_logging_3.call(|f| f(i.0, on, n, list)),
            }
        }
    }

    /// `GetFMUState`: offers a state, or NULL for a new one, to be overwritten; `None` passes NULL for the pointer.
    pub(super) fn get_state(&self, i: Given<'_>, place: Option<Given<'_>>) -> Answer<StatePointer> {
        Self::with_place(&self.get_state, i, place)
    }

    /// `FreeFMUState`: returns the content of the variable afterwards; `None` passes NULL for its address.
    ///
    /// # Safety
    /// The state is not used afterwards.
    pub(super) unsafe fn free_state(&self, i: Given<'_>, place: Option<Given<'_>>) -> Answer<StatePointer> {
        Self::with_place(&self.free_state, i, place)
    }

    fn with_place(function: &Function<StatePlace>, i: Given<'_>, place: Option<Given<'_>>) -> Answer<StatePointer> {
        // SAFETY: the standards' type; the variable is ours or NULL, and the state alive or NULL.
        function.write(place.unwrap_or(Given::NULL).0, |f, state| unsafe {
            f(i.0, if place.is_some() { state } else { ptr::null_mut() })
        })
    }

    /// `SetFMUState`.
    pub(super) fn set_state(&self, i: Given<'_>, state: Given<'_>) -> Answer {
        // SAFETY: the standards' type.
        self.set_state.call(|f| unsafe { f(i.0, state.0) })
    }

    /// `SerializedFMUStateSize`.
    pub(super) fn state_size(&self, i: Given<'_>, state: Given<'_>) -> Answer<usize> {
        // SAFETY: the standards' type; the variable is ours.
        self.state_size.write(0, |f, size| unsafe { f(i.0, state.0, size) })
    }

    /// `SerializeFMUState`.
    pub(super) fn serialize(&self, i: Given<'_>, state: Given<'_>, mut bytes: ArrayMut<'_, u8>) -> Answer {
        // SAFETY: the standards' type; the array is as long as stated.
        self.serialize.call(|f| unsafe { f(i.0, state.0, bytes.pointer(), bytes.1) })
    }

    /// `DeserializeFMUState`.
    pub(super) fn deserialize(&self, i: Given<'_>, bytes: Array<'_, u8>) -> Answer<StatePointer> {
        // SAFETY: the standards' type; the array is NULL or as long as stated; the variable is ours.
        self.deserialize.write(ptr::null_mut(), |f, state| unsafe { f(i.0, bytes.pointer(), bytes.1, state) })
    }

    /// `fmi3GetClock` of one clock, with a result that is `before` at first.
    pub(super) fn clock(&self, i: Given<'_>, clock: u32, before: u8) -> Answer<u8> {
        // SAFETY: the standard's type; one reference, one variable of ours.
        self.get_clock.write(before, |f, active| unsafe { f(i.0, &raw const clock, 1, active) })
    }

    /// `fmi3SetClock` of one clock.
    pub(super) fn activate(&self, i: Given<'_>, clock: u32) -> Answer {
        // SAFETY: the standard's type; one reference, one value.
        self.set_clock.call(|f| unsafe { f(i.0, &raw const clock, 1, &raw const ACTIVE) })
    }

    /// `fmi3GetIntervalDecimal` of one clock: interval and qualifier, which are `before` before the call.
    pub(super) fn interval(&self, i: Given<'_>, clock: u32, before: (f64, c_int)) -> Answer<(f64, c_int)> {
        // SAFETY: the standard's type; one reference, variables of ours.
        self.get_interval
            .write(before, |f, (interval, qualifier)| unsafe { f(i.0, &raw const clock, 1, interval, qualifier) })
    }

    /// `fmi3SetIntervalDecimal` of one clock.
    pub(super) fn set_interval(&self, i: Given<'_>, clock: u32, interval: f64) -> Answer {
        // SAFETY: the standard's type; one reference, one value.
        self.set_interval.call(|f| unsafe { f(i.0, &raw const clock, 1, &raw const interval) })
    }

    /// `fmi3ActivateModelPartition`.
    pub(super) fn activate_partition(&self, i: Given<'_>, clock: u32, t: f64) -> Answer {
        // SAFETY: the standard's type.
        self.activate_partition.call(|f| unsafe { f(i.0, clock, t) })
    }

    /// `fmi3GetShiftDecimal` of one clock.
    pub(super) fn shift(&self, i: Given<'_>, clock: u32, before: f64) -> Answer<f64> {
        // SAFETY: the standard's type; one reference, one variable of ours.
        self.get_shift.write(before, |f, shift| unsafe { f(i.0, &raw const clock, 1, shift) })
    }

    /// `fmi2NewDiscreteStates` or `fmi3UpdateDiscreteStates`. `before` is the content of the results before the call; with
    /// `null`, all results get NULL.
    pub(super) fn update_discrete_states(
        &self,
        i: Given<'_>,
        null: bool,
        (fill, time): (u8, f64),
    ) -> Answer<UpdateResults> {
        // SAFETY: both calls pass the standard's type; the variables are ours or NULL.
        unsafe {
            match self.version {
                FmiVersion::V2 => {
                    let flag = c_int::from(fill);
                    let before = v2::EventInfo {
                        new_discrete_states_needed: flag,
                        terminate_simulation: flag,
                        nominals_changed: flag,
                        states_changed: flag,
                        next_event_time_defined: flag,
                        next_event_time: time,
                    };
                    let answer = self.update_2.write(before, |f, x| f(i.0, if null { ptr::null_mut() } else { x }));
                    answer.map(|x| UpdateResults {
                        again: x.new_discrete_states_needed,
                        terminate: x.terminate_simulation,
                        nominals_changed: x.nominals_changed,
                        states_changed: x.states_changed,
                        next_event_time_defined: x.next_event_time_defined,
                        next_event_time: x.next_event_time,
                    })
                }
                FmiVersion::V3 => {
                    let answer = self.update_3.write(([fill; 5], time), |f, (flags, time)| {
                        let [a, b, c, d, e] =
                            flags.each_mut().map(|x| if null { ptr::null_mut() } else { ptr::from_mut(x) });
                        f(i.0, a, b, c, d, e, if null { ptr::null_mut() } else { time })
                    });
                    answer.map(|(flags, next_event_time)| {
                        let [again, terminate, nominals_changed, states_changed, next_event_time_defined] =
                            flags.map(i32::from);
                        UpdateResults {
                            again,
                            terminate,
                            nominals_changed,
                            states_changed,
                            next_event_time_defined,
                            next_event_time,
                        }
                    })
                }
            }
        }
    }

    /// `CompletedIntegratorStep`: `enterEventMode` and `terminateSimulation`, which are `fill` before the call; with `null`,
    /// both get NULL.
    pub(super) fn completed(&self, i: Given<'_>, no_prior: bool, null: bool, fill: u8) -> Answer<[i32; 2]> {
        // SAFETY: both calls pass the standard's type; the variables are ours or NULL.
        unsafe {
            match self.version {
                FmiVersion::V2 => self.completed_2.write([c_int::from(fill); 2], |f, flags| {
                    let [a, b] = flags.each_mut().map(|flag| if null { ptr::null_mut() } else { ptr::from_mut(flag) });
                    f(i.0, c_int::from(no_prior), a, b)
                }),
                FmiVersion::V3 => {
                    let answer = self.completed_3.write([fill; 2], |f, flags| {
                        let [a, b] =
                            flags.each_mut().map(|flag| if null { ptr::null_mut() } else { ptr::from_mut(flag) });
                        f(i.0, no_prior, a, b)
                    });
                    answer.map(|flags| flags.map(i32::from))
                }
            }
        }
    }

    /// `SetTime`.
    #[inline]
    pub(super) fn set_time(&self, i: Given<'_>, t: f64) -> Answer {
        // SAFETY: the standards' type.
        self.set_time.call(|f| unsafe { f(i.0, t) })
    }

    /// `SetContinuousStates`.
    #[inline]
    pub(super) fn set_states(&self, i: Given<'_>, x: Array<'_, f64>) -> Answer {
        // SAFETY: the standards' type; the array is NULL or as long as stated.
        self.set_states.call(|f| unsafe { f(i.0, x.pointer(), x.1) })
    }

    /// States, derivatives, event indicators or nominals.
    #[inline]
    pub(super) fn vector(&self, name: Vector, i: Given<'_>, mut values: ArrayMut<'_, f64>) -> Answer {
        // SAFETY: all functions that `Vector` names have this type, up to the mutability of the array, which is ours, NULL or
        // as long as stated.
        self.vectors[name as usize].call(|f| unsafe { f(i.0, values.pointer(), values.1) })
    }

    /// Number of states or event indicators (FMI 3.0); with `null`, the result gets NULL.
    pub(super) fn count(&self, name: Count, i: Given<'_>, null: bool) -> Answer<usize> {
        let function = match name {
            Count::GetNumberOfContinuousStates => &self.number_of_states,
            Count::GetNumberOfEventIndicators => &self.number_of_indicators,
        };
        // SAFETY: FMI 3.0's type; the variable is ours or NULL.
        function.write(usize::MAX, |f, n| unsafe { f(i.0, if null { ptr::null_mut() } else { n }) })
    }

    /// Directional or adjoint derivatives: value references of the unknowns and of the knowns, the seed, and the results.
    pub(super) fn sensitivity(
        &self,
        name: Sensitivity,
        i: Given<'_>,
        [unknowns, knowns]: [Array<'_, u32>; 2],
        seed: Array<'_, f64>,
        mut results: ArrayMut<'_, f64>,
    ) -> Answer {
        let (u, n_u, k, n_k) = (unknowns.pointer(), unknowns.1, knowns.pointer(), knowns.1);
        let function = match (self.version, name) {
            (FmiVersion::V2, Sensitivity::GetAdjointDerivative) => return Answer("fmi2GetAdjointDerivative", None),
            (FmiVersion::V2, Sensitivity::GetDirectionalDerivative) => {
                let (s, to) = (seed.holding(n_k), results.holding(n_u));
                // SAFETY: FMI 2.0's type; the lists give the lengths of seed and results.
                return self.directional_2.call(|f| unsafe { f(i.0, u, n_u, k, n_k, s, to) });
            }
            (FmiVersion::V3, Sensitivity::GetDirectionalDerivative) => &self.directional_3,
            (FmiVersion::V3, Sensitivity::GetAdjointDerivative) => &self.adjoint_3,
        };
        let (s, n_s, to, n) = (seed.pointer(), seed.1, results.pointer(), results.1);
        // SAFETY: FMI 3.0's type; arrays are NULL or as long as stated.
        function.call(|f| unsafe { f(i.0, u, n_u, k, n_k, s, n_s, to, n) })
    }

    /// Derivatives of outputs with respect to time.
    pub(super) fn output_derivatives(
        &self,
        i: Given<'_>,
        references: &[u32],
        orders: &[c_int],
        values: &mut [f64],
    ) -> Answer {
        let (r, n, orders) = (references.as_ptr(), references.len(), Array::from(orders).holding(references.len()));
        let mut values = ArrayMut::from(values);
        // SAFETY: both calls pass the standard's type; the arrays are as long as stated.
        unsafe {
            match self.version {
                FmiVersion::V2 => {
                    let values = values.holding(n);
                    self.output_derivatives_2.call(|f| f(i.0, r, n, orders, values))
                }
                FmiVersion::V3 => self.output_derivatives_3.call(|f| f(i.0, r, n, orders, values.pointer(), values.1)),
            }
        }
    }

    /// `fmi2SetRealInputDerivatives`.
    pub(super) fn input_derivatives(
        &self,
        i: Given<'_>,
        references: Array<'_, u32>,
        orders: Array<'_, c_int>,
        values: Array<'_, f64>,
    ) -> Answer {
        let (r, n) = (references.pointer(), references.1);
        let (orders, values) = (orders.holding(n), values.holding(n));
        // SAFETY: FMI 2.0's type; arrays are NULL or as long as stated.
        self.input_derivatives_2.call(|f| unsafe { f(i.0, r, n, orders, values) })
    }
}
