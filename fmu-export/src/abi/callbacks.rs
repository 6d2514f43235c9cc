//! The importer's callbacks that may call the instance again. The gate calls them while nothing of the instance is borrowed.

use super::types::Fmi3Boolean;
use crate::inside::{Reply, Update};
use std::ffi::c_void;

/// `fmi3IntermediateUpdateCallback`.
pub type Fmi3IntermediateUpdate = unsafe extern "C" fn(
    environment: *mut c_void,
    time: f64,
    set_requested: Fmi3Boolean,
    get_allowed: Fmi3Boolean,
    step_finished: Fmi3Boolean,
    can_return_early: Fmi3Boolean,
    return_requested: *mut Fmi3Boolean,
    return_time: *mut f64,
);

/// The callbacks of an instance.
#[derive(Clone, Copy, Debug)]
pub struct Callbacks {
    /// Passed back to them.
    pub environment: *mut c_void,
    /// `intermediateUpdate`.
    pub intermediate: Option<Fmi3IntermediateUpdate>,
}

impl Callbacks {
    /// No callback.
    pub const NONE: Self = Self { environment: std::ptr::null_mut(), intermediate: None };

    /// Calls `intermediateUpdate` at the end of a part of a step.
    pub(crate) fn intermediate(&self, update: Update) -> Reply {
        let callback = self.intermediate?;
        let (mut requested, mut time) = (Fmi3Boolean(0), update.time);
        let yes = Fmi3Boolean(1);
        // SAFETY: the importer's function of this type; it returns before the two variables end.
        unsafe {
            callback(
                self.environment,
                update.time,
                yes,
                yes,
                yes,
                update.can_return.into(),
                &raw mut requested,
                &raw mut time,
            );
        }
        (requested.0 != 0 && update.can_return).then_some(time)
    }
}
