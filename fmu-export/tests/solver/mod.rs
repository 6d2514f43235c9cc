//! An importer for tests that integrates and handles events: the C functions of both standards behind one set of names,
//! for the model that the test program exports.
#![allow(
    dead_code,
    unreachable_pub,
    unused_imports,
    unused_macros,
    reason = "a module of several test programs, each of which uses a part"
)]
#![allow(clippy::float_cmp, reason = "values that are set or counted, to the last bit")]

/// The function of one of the standards.
macro_rules! either {
    ($fmu:expr, $two:ident($($a:expr),*), $three:ident($($b:expr),*)) => {
        if $fmu.kind.version() == 2 { unsafe { $two($fmu.it $(, $a)*) } } else { unsafe { $three($fmu.it $(, $b)*) } }
    };
}

pub mod ball;
#[path = "../common/journal.rs"]
pub mod journal;
pub mod rk4;
pub mod sampler;
mod saved;
pub mod slopes;
pub mod table;

use crate::fmi::{This, *};
use fmu_core::Exported;
use fmu_export::abi::types::*;
pub use journal::*;
use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::rc::Rc;

pub const OK: c_int = 0;
pub const DISCARD: c_int = 2;
pub const ERROR: c_int = 3;

/// How an importer uses the FMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Me2,
    Me3,
    Cs2,
    Cs3 { event: bool, early: bool },
}

pub const ME: [Kind; 2] = [Kind::Me2, Kind::Me3];
pub const CS: [Kind; 2] = [Kind::Cs2, Kind::Cs3 { event: false, early: false }];

impl Kind {
    pub fn version(self) -> u8 {
        if matches!(self, Self::Me2 | Self::Cs2) { 2 } else { 3 }
    }

    pub fn exchanges(self) -> bool {
        matches!(self, Self::Me2 | Self::Me3)
    }

    pub fn handles_events(self) -> bool {
        self.exchanges() || matches!(self, Self::Cs3 { event: true, .. })
    }
}

/// Result of an update of the discrete states, nominals aside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Update {
    pub again: bool,
    pub terminate: bool,
    pub states_changed: bool,
    pub next: Option<f64>,
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stepped {
    pub event: bool,
    pub early: bool,
    pub end: f64,
}

pub struct Fmu {
    pub kind: Kind,
    pub it: InstancePointer,
    pub journal: Rc<Journal>,
}

impl Fmu {
    pub fn new(kind: Kind) -> Self {
        Self::with(kind, true, false)
    }

    /// With or without a logger, for all messages or only errors.
    pub fn with(kind: Kind, logger: bool, on: bool) -> Self {
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let journal = Rc::<Journal>::default();
        let it = Self::open(kind, &journal, logger, on);
        assert!(!it.is_null(), "{kind:?}: {:?}", journal.0.borrow());
        Self { kind, it, journal }
    }

    pub fn open(kind: Kind, journal: &Journal, logger: bool, on: bool) -> InstancePointer {
        let environment = std::ptr::from_ref(journal).cast_mut().cast();
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token, on, no) = (c"it".as_ptr(), token.as_ptr(), u8::from(on), Fmi3Boolean(0));
        let logger3 = logger.then_some(log3 as Fmi3Logger);
        match kind {
            Kind::Me2 | Kind::Cs2 => {
                let callbacks = Fmi2Callbacks {
                    logger: (logger && has_logger(2)).then(|| variadic(log2)),
                    allocate_memory: null(),
                    free_memory: null(),
                    step_finished: null(),
                    environment,
                };
                let (kind, on) = (c_int::from(kind == Kind::Cs2), Fmi2Boolean(on.into()));
                unsafe { fmi2Instantiate(name, kind, token, null(), &raw const callbacks, Fmi2Boolean(0), on) }
            }
            Kind::Me3 => unsafe {
                fmi3InstantiateModelExchange(name, token, null(), no, Fmi3Boolean(on), environment, logger3)
            },
            Kind::Cs3 { event, early } => {
                let (event, early) = (Fmi3Boolean(event.into()), Fmi3Boolean(early.into()));
                let (on, none) = (Fmi3Boolean(on), None);
                unsafe {
                    fmi3InstantiateCoSimulation(
                        name,
                        token,
                        null(),
                        no,
                        on,
                        event,
                        early,
                        null(),
                        0,
                        environment,
                        logger3,
                        none,
                    )
                }
            }
        }
    }

    /// In Initialization Mode.
    pub fn entered(kind: Kind, start: f64) -> Self {
        let fmu = Self::new(kind);
        assert_eq!(fmu.enter(start, None), OK);
        fmu
    }

    /// After initialization: in Event Mode or Step Mode.
    pub fn started(kind: Kind, start: f64) -> Self {
        let fmu = Self::entered(kind, start);
        assert_eq!(fmu.exit(), OK);
        fmu
    }

    /// In Continuous-Time Mode after the first event, or in Step Mode.
    pub fn running(kind: Kind, start: f64) -> Self {
        let fmu = Self::started(kind, start);
        if kind.handles_events() {
            fmu.settle();
            assert_eq!(fmu.leave(), OK);
        }
        fmu
    }

    /// In one of the states by its letter: i n v(event) c s t e.
    pub fn in_state(kind: Kind, state: char) -> Self {
        let fmu = match state {
            'i' => Self::new(kind),
            'n' => Self::entered(kind, 0.0),
            'v' => Self::started(kind, 0.0),
            'c' | 's' => Self::running(kind, 0.0),
            't' => {
                let fmu = Self::running(kind, 0.0);
                assert_eq!(fmu.terminate(), OK);
                fmu
            }
            'e' => {
                let fmu = Self::running(kind, 0.0);
                assert_eq!(fmu.exit(), ERROR);
                fmu
            }
            _ => unreachable!(),
        };
        fmu.journal.0.borrow_mut().clear();
        fmu
    }

    pub fn set_up(&self, start: f64, stop: Option<f64>) -> c_int {
        let (defined, stop) = (Fmi2Boolean(stop.is_some().into()), stop.unwrap_or(f64::NAN));
        unsafe { fmi2SetupExperiment(self.it, Fmi2Boolean(0), 0.0, start, defined, stop) }
    }

    pub fn enter(&self, start: f64, stop: Option<f64>) -> c_int {
        if self.kind.version() == 2 && self.set_up(start, stop) != OK {
            return ERROR;
        }
        let (defined, stop, no) = (Fmi3Boolean(stop.is_some().into()), stop.unwrap_or(f64::NAN), Fmi3Boolean(0));
        either!(self, fmi2EnterInitializationMode(), fmi3EnterInitializationMode(no, 0.0, start, defined, stop))
    }

    pub fn exit(&self) -> c_int {
        either!(self, fmi2ExitInitializationMode(), fmi3ExitInitializationMode())
    }

    pub fn terminate(&self) -> c_int {
        either!(self, fmi2Terminate(), fmi3Terminate())
    }

    pub fn reset(&self) -> c_int {
        either!(self, fmi2Reset(), fmi3Reset())
    }

    pub fn event(&self) -> c_int {
        either!(self, fmi2EnterEventMode(), fmi3EnterEventMode())
    }

    pub fn try_update(&self) -> (c_int, Update) {
        if self.kind.version() == 2 {
            let mut info = Fmi2EventInfo {
                new_discrete_states_needed: Fmi2Boolean(7),
                terminate_simulation: Fmi2Boolean(7),
                nominals_of_continuous_states_changed: Fmi2Boolean(7),
                values_of_continuous_states_changed: Fmi2Boolean(7),
                next_event_time_defined: Fmi2Boolean(7),
                next_event_time: f64::NAN,
            };
            let status = unsafe { fmi2NewDiscreteStates(self.it, &raw mut info) };
            let is = |b: Fmi2Boolean| b.0 == 1;
            if status == OK {
                assert_eq!(info.nominals_of_continuous_states_changed.0, 0);
            }
            let next = is(info.next_event_time_defined).then_some(info.next_event_time);
            let [again, terminate, states_changed] =
                [info.new_discrete_states_needed, info.terminate_simulation, info.values_of_continuous_states_changed]
                    .map(is);
            return (status, Update { again, terminate, states_changed, next });
        }
        let (mut flags, mut next) = ([Fmi3Boolean(7); 5], f64::NAN);
        let [a, b, c, d, e] = &mut flags;
        let status = unsafe { fmi3UpdateDiscreteStates(self.it, a, b, c, d, e, &raw mut next) };
        let is = |i: usize| flags[i].0 == 1;
        if status == OK {
            assert_eq!(flags[2].0, 0);
        }
        let next = is(4).then_some(next);
        (status, Update { again: is(0), terminate: is(1), states_changed: is(3), next })
    }

    pub fn update(&self) -> Update {
        let (status, update) = self.try_update();
        assert_eq!(status, OK, "{:?}", self.journal.0.borrow());
        update
    }

    /// Updates until no further update is needed; returns whether states changed, and the last update.
    pub fn settle(&self) -> (bool, Update) {
        let mut changed = false;
        for _ in 0..100 {
            let update = self.update();
            changed |= update.states_changed;
            if !update.again {
                return (changed, update);
            }
        }
        panic!("events without end");
    }

    /// From Event Mode to Continuous-Time Mode or Step Mode.
    pub fn leave(&self) -> c_int {
        if let Kind::Cs3 { .. } = self.kind {
            return unsafe { fmi3EnterStepMode(self.it) };
        }
        either!(self, fmi2EnterContinuousTimeMode(), fmi3EnterContinuousTimeMode())
    }

    pub fn set_time(&self, t: f64) -> c_int {
        either!(self, fmi2SetTime(t), fmi3SetTime(t))
    }

    pub fn completed(&self) -> c_int {
        let (mut two, mut three) = ([Fmi2Boolean(7); 2], [Fmi3Boolean(7); 2]);
        let ([a, b], [c, d]) = (&mut two, &mut three);
        let status = either!(
            self,
            fmi2CompletedIntegratorStep(Fmi2Boolean(1), a, b),
            fmi3CompletedIntegratorStep(Fmi3Boolean(1), c, d)
        );
        if status == OK {
            assert!(two.iter().all(|b| b.0 == 0) || three.iter().all(|b| b.0 == 0), "neither an event nor the end");
        }
        status
    }

    pub fn set_states(&self, x: &[f64]) -> c_int {
        either!(self, fmi2SetContinuousStates(x.as_ptr(), x.len()), fmi3SetContinuousStates(x.as_ptr(), x.len()))
    }

    pub fn try_states(&self, x: &mut [f64]) -> c_int {
        let (p, n) = (x.as_mut_ptr(), x.len());
        either!(self, fmi2GetContinuousStates(p, n), fmi3GetContinuousStates(p, n))
    }

    pub fn states<const N: usize>(&self) -> [f64; N] {
        let mut x = [f64::NAN; N];
        assert_eq!(self.try_states(&mut x), OK);
        x
    }

    pub fn try_derivatives(&self, dx: &mut [f64]) -> c_int {
        let (p, n) = (dx.as_mut_ptr(), dx.len());
        either!(self, fmi2GetDerivatives(p, n), fmi3GetContinuousStateDerivatives(p, n))
    }

    pub fn derivatives<const N: usize>(&self) -> [f64; N] {
        let mut dx = [f64::NAN; N];
        assert_eq!(self.try_derivatives(&mut dx), OK);
        dx
    }

    pub fn try_indicators(&self, z: &mut [f64]) -> c_int {
        let (p, n) = (z.as_mut_ptr(), z.len());
        either!(self, fmi2GetEventIndicators(p, n), fmi3GetEventIndicators(p, n))
    }

    pub fn indicators<const N: usize>(&self) -> [f64; N] {
        let mut z = [f64::NAN; N];
        assert_eq!(self.try_indicators(&mut z), OK);
        z
    }

    pub fn try_nominals(&self, x: &mut [f64]) -> c_int {
        let (p, n) = (x.as_mut_ptr(), x.len());
        either!(self, fmi2GetNominalsOfContinuousStates(p, n), fmi3GetNominalsOfContinuousStates(p, n))
    }

    pub fn step(&self, t: f64, h: f64) -> (c_int, Stepped) {
        if self.kind.version() == 2 {
            let status = unsafe { fmi2DoStep(self.it, t, h, Fmi2Boolean(1)) };
            return (status, Stepped { end: t + h, ..Stepped::default() });
        }
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(9), Fmi3Boolean(9), Fmi3Boolean(9), f64::NAN);
        let status = unsafe {
            fmi3DoStep(self.it, t, h, Fmi3Boolean(1), &raw mut event, &raw mut end, &raw mut early, &raw mut last)
        };
        if status == OK {
            assert_eq!(end.0, 0);
        }
        (status, Stepped { event: event.0 == 1, early: early.0 == 1, end: last })
    }

    pub fn set(&self, vr: &[u32], values: &[f64]) -> c_int {
        let (p, n, x) = (vr.as_ptr(), vr.len(), values.as_ptr());
        either!(self, fmi2SetReal(p, n, x), fmi3SetFloat64(p, n, x, values.len()))
    }

    pub fn try_get(&self, vr: &[u32], values: &mut [f64]) -> c_int {
        let (p, n, x, m) = (vr.as_ptr(), vr.len(), values.as_mut_ptr(), values.len());
        either!(self, fmi2GetReal(p, n, x), fmi3GetFloat64(p, n, x, m))
    }

    pub fn get(&self, vr: u32) -> f64 {
        let mut value = [f64::NAN];
        assert_eq!(self.try_get(&[vr], &mut value), OK, "{:?}", self.journal.0.borrow());
        value[0]
    }

    pub fn get_integer(&self, vr: u32) -> i32 {
        let (mut two, mut three) = (Fmi2Integer(-1), -1);
        let status = either!(
            self,
            fmi2GetInteger(&raw const vr, 1, &raw mut two),
            fmi3GetInt32(&raw const vr, 1, &raw mut three, 1)
        );
        assert_eq!(status, OK);
        if self.kind.version() == 2 { two.0 } else { three }
    }

    pub fn set_boolean(&self, vr: u32, value: bool) -> c_int {
        let (two, three) = (Fmi2Boolean(value.into()), Fmi3Boolean(value.into()));
        either!(
            self,
            fmi2SetBoolean(&raw const vr, 1, &raw const two),
            fmi3SetBoolean(&raw const vr, 1, &raw const three, 1)
        )
    }

    pub fn directional(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64], out: &mut [f64]) -> c_int {
        let (u, n, k, m) = (unknowns.as_ptr(), unknowns.len(), knowns.as_ptr(), knowns.len());
        let (s, o) = (seed.as_ptr(), out.as_mut_ptr());
        either!(
            self,
            fmi2GetDirectionalDerivative(u, n, k, m, s, o),
            fmi3GetDirectionalDerivative(u, n, k, m, s, seed.len(), o, out.len())
        )
    }

    pub fn adjoint(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64], out: &mut [f64]) -> c_int {
        let (u, n, k, m) = (unknowns.as_ptr(), unknowns.len(), knowns.as_ptr(), knowns.len());
        unsafe { fmi3GetAdjointDerivative(self.it, u, n, k, m, seed.as_ptr(), seed.len(), out.as_mut_ptr(), out.len()) }
    }

    pub fn output_derivatives(&self, vr: &[u32], orders: &[i32], out: &mut [f64]) -> c_int {
        let (p, n, r, o) = (vr.as_ptr(), vr.len(), orders.as_ptr(), out.as_mut_ptr());
        either!(self, fmi2GetRealOutputDerivatives(p, n, r, o), fmi3GetOutputDerivatives(p, n, r, o, out.len()))
    }

    /// FMI 2.0 only.
    pub fn input_derivatives(&self, vr: &[u32], orders: &[i32], values: &[f64]) -> c_int {
        unsafe { fmi2SetRealInputDerivatives(self.it, vr.as_ptr(), vr.len(), orders.as_ptr(), values.as_ptr()) }
    }

    pub fn logging(&self, on: bool, categories: &[&std::ffi::CStr]) -> c_int {
        let list: Vec<Text> = categories.iter().map(|c| c.as_ptr()).collect();
        let (n, p) = (list.len(), list.as_ptr());
        either!(
            self,
            fmi2SetDebugLogging(Fmi2Boolean(on.into()), n, p),
            fmi3SetDebugLogging(Fmi3Boolean(on.into()), n, p)
        )
    }

    /// The new messages.
    pub fn messages(&self) -> Vec<Message> {
        self.journal.0.borrow_mut().drain(..).collect()
    }

    /// The only new message, which must be an error.
    pub fn error(&self) -> String {
        let messages = self.messages();
        assert_eq!(messages.len(), 1, "{messages:?}");
        assert_eq!((messages[0].status, messages[0].category.as_str()), (ERROR, "logStatusError"));
        messages[0].text.clone()
    }

    /// The state of the instance, determined by the calls that it allows, only through the C interface.
    pub fn state(&self) -> char {
        let mut here = null_mut();
        if self.save(&mut here) == ERROR {
            return 'e';
        }
        let end = {
            let mut end = [0.0];
            // FMI 2.0 has no variable for time, and reports the last communication point.
            let read = match self.kind.version() {
                2 => unsafe { fmi2GetRealStatus(self.it, 2, &raw mut end[0]) },
                _ => self.try_get(&[0], &mut end),
            };
            if read == ERROR {
                assert_eq!(self.restore(here), OK);
            }
            end[0]
        };
        let attempts: [(char, &dyn Fn() -> c_int); 5] = [
            ('v', &|| self.try_update().0),
            ('c', &|| self.completed()),
            ('s', &|| self.step(end, 1e-3).0),
            ('n', &|| self.exit()),
            ('i', &|| self.enter(0.0, None)),
        ];
        let found = attempts.iter().find(|(_, attempt)| {
            let done = attempt();
            assert_eq!(self.restore(here), OK);
            done == OK
        });
        assert_eq!(self.free_state(&mut here), OK);
        self.journal.0.borrow_mut().clear();
        found.map_or('t', |(state, _)| *state)
    }
}

impl Drop for Fmu {
    fn drop(&mut self) {
        either!(self, fmi2FreeInstance(), fmi3FreeInstance());
    }
}
