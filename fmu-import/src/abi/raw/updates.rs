//! The callbacks of FMI 3.0 in which an importer may call the FMU again: `intermediateUpdate` in a step, `clockUpdate` in the
//! activation of a partition; and the two that lock the scheduler.
//!
//! The calls made in them are planned before the step or the activation. During that call, the instance cannot be freed.

use super::super::functions::{CType, Calls, Way};
use super::super::log::Status;
use super::library::Raw;
use super::names::Simple;
use super::owned::Handle;
use super::results::{StepResults, UNTOUCHED, UNTOUCHED_NUMBER};
use crate::abi::arguments::Given;
use std::ffi::c_void;
use std::fmt;
use std::ptr;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A call of a callback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heard {
    /// `intermediateUpdate`; flags as the bytes that the FMU passed.
    Intermediate {
        /// The environment of the instance.
        environment: usize,
        /// `intermediateUpdateTime` in s.
        time: f64,
        /// `intermediateVariableSetRequested`.
        set_requested: u8,
        /// `intermediateVariableGetAllowed`.
        get_allowed: u8,
        /// `intermediateStepFinished`.
        finished: u8,
        /// `canReturnEarly`.
        can_return: u8,
    },
    /// `clockUpdate`, with the environment of the instance.
    Clocks(usize),
    /// `lockPreemption`.
    Lock,
    /// `unlockPreemption`.
    Unlock,
}

impl fmt::Display for Heard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Intermediate { environment, time, set_requested, get_allowed, finished, can_return } => write!(
                f,
                "intermediateUpdate(environment={environment:#x}, time={time:?}, setRequested={set_requested}, getAllowed={get_allowed}, \
                 stepFinished={finished}, canReturnEarly={can_return})"
            ),
            Self::Clocks(environment) => write!(f, "clockUpdate(environment={environment:#x})"),
            Self::Lock => f.write_str("lockPreemption"),
            Self::Unlock => f.write_str("unlockPreemption"),
        }
    }
}

/// Actions of the importer in `intermediateUpdate` and in `clockUpdate`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inside {
    /// Requests, if it may, that the step ends at this time in s.
    Return(f64),
    /// Gets a Float64.
    Get(u32),
    /// Calls a function that takes only the instance.
    Call(Simple),
    /// Gets whether a clock is active.
    Clock(u32),
    /// Gets the interval of a clock, in s.
    Interval(u32),
}

/// The answer to a call in a callback: its status, the value, the qualifier of an interval.
pub type Answered = (Status, f64, i32);

/// Record of a call in progress.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Meanwhile {
    /// The callbacks, in their order.
    pub heard: Vec<Heard>,
    /// The answers to the calls made in them, in their order.
    pub answers: Vec<(Inside, Answered)>,
}

/// The call in progress: the functions and the instance, by their addresses, and the plan of the importer.
#[derive(Clone)]
struct Plan {
    calls: usize,
    instance: usize,
    acts: Vec<Inside>,
}

struct Scene {
    plan: Option<Plan>,
    meanwhile: Meanwhile,
}

static SCENE: Mutex<Scene> =
    Mutex::new(Scene { plan: None, meanwhile: Meanwhile { heard: Vec::new(), answers: Vec::new() } });

fn scene() -> MutexGuard<'static, Scene> {
    SCENE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Records a callback; returns the call in progress.
fn hear(heard: Heard) -> Option<Plan> {
    let mut scene = scene();
    if scene.meanwhile.heard.len() < 100_000 {
        scene.meanwhile.heard.push(heard);
    }
    scene.plan.clone()
}

impl Plan {
    /// Executes the importer's plan; returns the requested end of the step, if any.
    fn play(&self) -> Option<f64> {
        // SAFETY: `Raw::under_way` lends the functions and the instance until it takes the plan back.
        let (calls, instance) = unsafe {
            let calls = &*ptr::with_exposed_provenance::<Calls>(self.calls);
            (calls, Given::new(ptr::with_exposed_provenance_mut(self.instance)))
        };
        let mut end = None;
        for &act in &self.acts {
            let (mut value, mut qualifier) = (UNTOUCHED_NUMBER, 0);
            let status = match act {
                Inside::Return(time) => {
                    end = Some(time);
                    continue;
                }
                Inside::Get(reference) => calls.float(instance, reference, &mut value),
                Inside::Call(name) => calls.simple(name, instance).status(),
                Inside::Clock(clock) => calls.clock(instance, clock, UNTOUCHED).result().map(|(status, active)| {
                    value = active.into();
                    status
                }),
                Inside::Interval(clock) => calls
                    .interval(instance, clock, (UNTOUCHED_NUMBER, UNTOUCHED.into()))
                    .result()
                    .map(|(status, answer)| {
                        (value, qualifier) = answer;
                        status
                    }),
            };
            if let Some(status) = status {
                scene().meanwhile.answers.push((act, (status, value, qualifier)));
            }
        }
        end
    }
}

pub(super) unsafe extern "C" fn intermediate_update(
    environment: *mut c_void,
    time: f64,
    set_requested: u8,
    get_allowed: u8,
    finished: u8,
    can_return: u8,
    return_requested: *mut u8,
    return_time: *mut f64,
) {
    let environment = environment.addr();
    let heard = Heard::Intermediate { environment, time, set_requested, get_allowed, finished, can_return };
    let end = hear(heard).and_then(|plan| plan.play()).filter(|_| can_return != 0);
    // SAFETY: NULL, or variables of the FMU, as the standard prescribes.
    unsafe {
        if let Some(requested) = return_requested.as_mut() {
            *requested = end.is_some().into();
        }
        if let (Some(end), Some(place)) = (end, return_time.as_mut()) {
            *place = end;
        }
    }
}

pub(super) unsafe extern "C" fn clock_update(environment: *mut c_void) {
    if let Some(plan) = hear(Heard::Clocks(environment.addr())) {
        plan.play();
    }
}

pub(super) unsafe extern "C" fn lock_preemption() {
    hear(Heard::Lock);
}

pub(super) unsafe extern "C" fn unlock_preemption() {
    hear(Heard::Unlock);
}

impl Raw {
    /// The callbacks since the previous query, outside of the calls below.
    pub fn take_heard(&self) -> Vec<Heard> {
        std::mem::take(&mut scene().meanwhile).heard
    }

    /// Makes a call, in whose callbacks the importer executes its plan.
    fn under_way<T>(&self, instance: Handle, acts: &[Inside], call: impl FnOnce(Given<'_>) -> T) -> (T, Meanwhile) {
        // Locked until the plan is cleared, so that the instance is not freed.
        let owned = self.owned();
        let given = owned.pointer(instance);
        let (calls, address) = (ptr::from_ref(&self.calls).expose_provenance(), given.0.expose_provenance());
        scene().plan = Some(Plan { calls, instance: address, acts: acts.to_vec() });
        let result = call(given);
        let mut scene = scene();
        scene.plan = None;
        (result, std::mem::take(&mut scene.meanwhile))
    }

    /// `DoStep` of an instance with `intermediateUpdate`, in which the importer takes these actions.
    pub fn do_step_updated(
        &self,
        instance: Handle,
        (t, h): (f64, f64),
        acts: &[Inside],
    ) -> Option<(Status, (StepResults, Meanwhile))> {
        let before = StepResults { event: UNTOUCHED, terminate: UNTOUCHED, early: UNTOUCHED, last: UNTOUCHED_NUMBER };
        let step = |given: Given<'_>| self.calls.do_step(given, (t, h), false, [true; 4], before).result();
        let (result, meanwhile) = self.under_way(instance, acts, step);
        result.map(|(status, stepped)| (status, (stepped, meanwhile)))
    }

    /// `fmi3ActivateModelPartition`; in `clockUpdate`, the importer takes these actions.
    pub fn activate_partition(
        &self,
        instance: Handle,
        clock: u32,
        t: f64,
        acts: &[Inside],
    ) -> Option<(Status, Meanwhile)> {
        let (status, meanwhile) =
            self.under_way(instance, acts, |given| self.calls.activate_partition(given, clock, t).status());
        status.map(|status| (status, meanwhile))
    }

    /// `fmi3GetClock` of one clock: the byte that the FMU wrote, 0xc5 if it did not.
    pub fn clock(&self, instance: Handle, clock: u32) -> Option<(Status, u8)> {
        self.calls.clock(self.owned().pointer(instance), clock, UNTOUCHED).result()
    }

    /// `fmi3SetClock` of one clock, to active.
    pub fn tick(&self, instance: Handle, clock: u32) -> Option<Status> {
        self.calls.activate(self.owned().pointer(instance), clock).status()
    }

    /// `fmi3GetIntervalDecimal` of one clock: interval in s, and qualifier.
    pub fn interval(&self, instance: Handle, clock: u32) -> Option<(Status, (f64, i32))> {
        self.calls.interval(self.owned().pointer(instance), clock, (UNTOUCHED_NUMBER, UNTOUCHED.into())).result()
    }

    /// `fmi3SetIntervalDecimal` of one clock.
    pub fn set_interval(&self, instance: Handle, clock: u32, interval: f64) -> Option<Status> {
        self.calls.set_interval(self.owned().pointer(instance), clock, interval).status()
    }

    /// `fmi3GetShiftDecimal` of one clock.
    pub fn shift(&self, instance: Handle, clock: u32) -> Option<(Status, f64)> {
        self.calls.shift(self.owned().pointer(instance), clock, UNTOUCHED_NUMBER).result()
    }
}

impl Calls {
    /// Gets one Float64.
    fn float(&self, i: Given<'_>, reference: u32, value: &mut f64) -> Option<Status> {
        // SAFETY: one reference, one double.
        unsafe { self.transfer(Way::Get, i, CType::DOUBLE, [reference][..].into(), ptr::from_mut(value).cast(), 1) }
            .status()
    }
}
