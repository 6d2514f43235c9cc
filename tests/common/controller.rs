//! A controller with a clock through the C functions of its test program, which exports it.
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions")]
#![allow(unreachable_pub, reason = "a module of several test programs")]

use super::fmi::{This, *};
use fmu_core::{Exported, Model};
use fmu_export::abi::types::*;
use std::ffi::CString;
use std::ptr::{null, null_mut};

pub const OK: c_int = 0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Cs,
    Me,
    Se,
}

/// The value reference of a variable.
pub fn reference(name: &str) -> u32 {
    let table = <This as Exported>::Model::TABLE;
    let index = (0..table.len()).position(|i| table.locate(i).is_some_and(|(other, ..)| other == name));
    u32::try_from(index.unwrap_or_else(|| panic!("{name}"))).unwrap() + 1
}

pub struct Controller {
    kind: Kind,
    pub it: InstancePointer,
}

impl Controller {
    /// In Initialization Mode at `start` (s); with a `clockUpdate` of Scheduled Execution and its environment.
    pub fn new(kind: Kind, start: f64, clock_update: Option<Fmi3ClockUpdate>, environment: *mut c_void) -> Self {
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token, no, yes) = (c"c".as_ptr(), token.as_ptr(), Fmi3Boolean(0), Fmi3Boolean(1));
        let it = unsafe {
            match kind {
                Kind::Cs => {
                    fmi3InstantiateCoSimulation(name, token, null(), no, no, yes, no, null(), 0, null_mut(), None, None)
                }
                Kind::Me => fmi3InstantiateModelExchange(name, token, null(), no, no, null_mut(), None),
                Kind::Se => {
                    let update = clock_update;
                    fmi3InstantiateScheduledExecution(
                        name,
                        token,
                        null(),
                        no,
                        no,
                        environment,
                        None,
                        update,
                        None,
                        None,
                    )
                }
            }
        };
        assert!(!it.is_null());
        assert_eq!(unsafe { fmi3EnterInitializationMode(it, no, 0.0, start, no, 0.0) }, OK);
        Self { kind, it }
    }

    pub fn exit(&self) -> c_int {
        unsafe { fmi3ExitInitializationMode(self.it) }
    }

    pub fn update(&self) {
        let ([mut a, mut b, mut c, mut d, mut e], mut next) = ([Fmi3Boolean(9); 5], 0.0);
        let status = unsafe { fmi3UpdateDiscreteStates(self.it, &mut a, &mut b, &mut c, &mut d, &mut e, &mut next) };
        assert_eq!((status, a.0, e.0), (OK, 0, 0));
    }

    /// From Event Mode at `t` to Event Mode at `end`.
    pub fn proceed(&self, t: f64, h: f64, end: f64) {
        let ([mut a, mut b, mut c], mut last) = ([Fmi3Boolean(9); 3], 0.0);
        unsafe {
            if self.kind == Kind::Cs {
                assert_eq!(fmi3EnterStepMode(self.it), OK);
                assert_eq!(fmi3DoStep(self.it, t, h, Fmi3Boolean(1), &mut a, &mut b, &mut c, &mut last), OK);
            } else {
                assert_eq!((fmi3EnterContinuousTimeMode(self.it), fmi3SetTime(self.it, end)), (OK, OK));
            }
            assert_eq!(fmi3EnterEventMode(self.it), OK);
        }
    }

    pub fn set(&self, vr: &[u32], values: &[f64]) {
        assert_eq!(unsafe { fmi3SetFloat64(self.it, vr.as_ptr(), vr.len(), values.as_ptr(), values.len()) }, OK);
    }

    pub fn get(&self, vr: &[u32]) -> Vec<f64> {
        let mut values = vec![f64::NAN; vr.len()];
        assert_eq!(unsafe { fmi3GetFloat64(self.it, vr.as_ptr(), vr.len(), values.as_mut_ptr(), vr.len()) }, OK);
        values
    }

    pub fn get_booleans<const N: usize>(&self, vr: [u32; N]) -> [bool; N] {
        let mut values = [Fmi3Boolean(9); N];
        assert_eq!(unsafe { fmi3GetBoolean(self.it, vr.as_ptr(), N, values.as_mut_ptr(), N) }, OK);
        values.map(|value| value.0 != 0)
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.it) }
    }
}
