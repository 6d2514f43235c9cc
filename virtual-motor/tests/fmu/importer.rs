//! The FMU `PmsmPlant` through its C functions of FMI 3.0, as an importer calls them.

use super::fmi;
use fmu_export::Exported as _;
use fmu_export::abi::types::{Fmi3Boolean, InstancePointer};
use std::ffi::CString;
use std::ptr::null;
use std::sync::Once;

const OK: i32 = 0;

/// An instance in Initialization Mode or in Step Mode.
pub(crate) struct Plant {
    it: InstancePointer,
}

impl Plant {
    pub(crate) fn new() -> Self {
        // The exporter silences panics; a test needs its own.
        static ONCE: Once = Once::new();
        ONCE.call_once(|| {
            fmu_export::abi::quiet();
            drop(std::panic::take_hook());
        });
        let token = CString::new(fmi::This::TOKEN.as_str()).unwrap();
        let no = Fmi3Boolean(0);
        let it = unsafe {
            fmi::fmi3InstantiateCoSimulation(
                c"plant".as_ptr(),
                token.as_ptr(),
                null(),
                no,
                no,
                no,
                no,
                null(),
                0,
                std::ptr::null_mut(),
                None,
                None,
            )
        };
        assert!(!it.is_null());
        assert_eq!(unsafe { fmi::fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0) }, OK);
        Self { it }
    }

    pub(crate) fn start(&self) {
        assert_eq!(unsafe { fmi::fmi3ExitInitializationMode(self.it) }, OK);
    }

    pub(crate) fn set(&self, reference: u32, value: f64) {
        assert_eq!(unsafe { fmi::fmi3SetFloat64(self.it, &raw const reference, 1, &raw const value, 1) }, OK);
    }

    pub(crate) fn set_boolean(&self, reference: u32, value: bool) {
        let value = Fmi3Boolean(value.into());
        assert_eq!(unsafe { fmi::fmi3SetBoolean(self.it, &raw const reference, 1, &raw const value, 1) }, OK);
    }

    pub(crate) fn set_enumeration(&self, reference: u32, value: i64) {
        assert_eq!(unsafe { fmi::fmi3SetInt64(self.it, &raw const reference, 1, &raw const value, 1) }, OK);
    }

    pub(crate) fn get(&self, references: &[u32], values: &mut [f64]) {
        let (n, m) = (references.len(), values.len());
        let status = unsafe { fmi::fmi3GetFloat64(self.it, references.as_ptr(), n, values.as_mut_ptr(), m) };
        assert_eq!(status, OK);
    }

    pub(crate) fn step(&self, t: f64, h: f64) {
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(0), Fmi3Boolean(0), Fmi3Boolean(0), 0.0);
        let status = unsafe {
            fmi::fmi3DoStep(self.it, t, h, Fmi3Boolean(0), &raw mut event, &raw mut end, &raw mut early, &raw mut last)
        };
        assert_eq!((status, end.0), (OK, 0), "t = {t} s, h = {h} s");
    }
}

impl Drop for Plant {
    fn drop(&mut self) {
        unsafe { fmi::fmi3FreeInstance(self.it) }
    }
}
