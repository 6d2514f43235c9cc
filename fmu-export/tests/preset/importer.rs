//! The calls of an importer of either standard, for either interface.

use crate::fmi::*;
use fmu_core::{Exported, preset};
use fmu_export::abi::types::*;
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::fs;
use std::path::PathBuf;
use std::ptr::{null, null_mut};
use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

thread_local! {
    pub(crate) static SAID: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

unsafe extern "C" fn log2(_: *mut c_void, _: Text, _: c_int, _: Text, message: Text) {
    log3(null_mut(), 0, null(), message);
}

extern "C" fn log3(_: *mut c_void, _: c_int, _: Text, message: Text) {
    SAID.with_borrow_mut(|said| said.push(unsafe { CStr::from_ptr(message) }.to_str().unwrap().to_owned()));
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Way {
    Two,
    TwoExchange,
    Three,
    ThreeExchange,
}

pub(crate) const WAYS: [Way; 4] = [Way::Two, Way::TwoExchange, Way::Three, Way::ThreeExchange];

/// An instance, or the messages of the logger.
pub(crate) fn open(way: Way, token: &str, resources: Option<&str>) -> Result<InstancePointer, String> {
    static LOUD: Once = Once::new();
    let (token, resources) = (CString::new(token).unwrap(), resources.map(|path| CString::new(path).unwrap()));
    let (token, resources) = (token.as_ptr(), resources.as_ref().map_or(null(), |path| path.as_ptr()));
    let (name, no, yes) = (c"it".as_ptr(), Fmi3Boolean(0), Fmi3Boolean(1));
    SAID.take();
    LOUD.call_once(|| {
        // A failed assertion is printed.
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
    });
    // The logger of FMI 2.0 has further arguments, which no message uses.
    let logger: unsafe extern "C" fn(*mut c_void, Text, c_int, Text, Text, ...) =
        unsafe { std::mem::transmute(log2 as unsafe extern "C" fn(*mut c_void, Text, c_int, Text, Text)) };
    let callbacks = Fmi2Callbacks {
        logger: Some(logger),
        allocate_memory: null(),
        free_memory: null(),
        step_finished: null(),
        environment: null_mut(),
    };
    let it = unsafe {
        match way {
            Way::Two => {
                fmi2Instantiate(name, 1, token, resources, &raw const callbacks, Fmi2Boolean(0), Fmi2Boolean(1))
            }
            Way::TwoExchange => {
                fmi2Instantiate(name, 0, token, resources, &raw const callbacks, Fmi2Boolean(0), Fmi2Boolean(1))
            }
            Way::Three => {
                let (list, logger) = (null(), Some(log3 as extern "C" fn(_, _, _, _) as _));
                fmi3InstantiateCoSimulation(name, token, resources, no, yes, no, no, list, 0, null_mut(), logger, None)
            }
            Way::ThreeExchange => {
                let logger = Some(log3 as extern "C" fn(_, _, _, _) as _);
                fmi3InstantiateModelExchange(name, token, resources, no, yes, null_mut(), logger)
            }
        }
    };
    if it.is_null() { Err(SAID.take().pop().unwrap_or_default()) } else { Ok(it) }
}

/// A folder with a preset.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(bytes: &[u8]) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("fmu-preset %41 {}-{number}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join(preset::FILE), bytes).unwrap();
        Self(path)
    }

    /// In the form of the standard: a URI, or a path.
    pub(crate) fn name(&self, way: Way) -> String {
        let path = self.0.to_str().unwrap();
        match way {
            Way::Two | Way::TwoExchange => {
                format!("file://{}", path.replace('%', "%25").replace(' ', "%20"))
            }
            Way::Three | Way::ThreeExchange => format!("{path}/"),
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub(crate) fn plain() -> String {
    This::TOKEN.as_str().into()
}

pub(crate) fn token(bytes: &[u8]) -> String {
    plain() + &preset::suffix(bytes)
}

/// An instance with a preset of these values, or the reason for the mismatch.
pub(crate) fn with(way: Way, values: &[(&str, &str)]) -> Result<InstancePointer, String> {
    let text = preset::write(values.iter().copied());
    let folder = Folder::new(text.as_bytes());
    open(way, &token(text.as_bytes()), Some(&folder.name(way)))
}

pub(crate) fn is_two(way: Way) -> bool {
    matches!(way, Way::Two | Way::TwoExchange)
}

/// In Initialization Mode, where both standards read everything.
pub(crate) fn entered(way: Way, it: InstancePointer) -> InstancePointer {
    unsafe {
        if is_two(way) {
            assert_eq!(fmi2SetupExperiment(it, Fmi2Boolean(0), 0.0, 0.0, Fmi2Boolean(0), 0.0), 0);
            assert_eq!(fmi2EnterInitializationMode(it), 0);
        } else {
            assert_eq!(fmi3EnterInitializationMode(it, Fmi3Boolean(0), 0.0, 0.0, Fmi3Boolean(0), 0.0), 0);
        }
    }
    it
}

pub(crate) fn exit(way: Way, it: InstancePointer) -> c_int {
    unsafe { if is_two(way) { fmi2ExitInitializationMode(it) } else { fmi3ExitInitializationMode(it) } }
}

pub(crate) fn reset(way: Way, it: InstancePointer) {
    assert_eq!(unsafe { if is_two(way) { fmi2Reset(it) } else { fmi3Reset(it) } }, 0);
}

pub(crate) fn free(way: Way, it: InstancePointer) {
    unsafe { if is_two(way) { fmi2FreeInstance(it) } else { fmi3FreeInstance(it) } }
}

pub(crate) fn real(way: Way, it: InstancePointer, reference: u32) -> f64 {
    let mut x = f64::NAN;
    let status = unsafe {
        if is_two(way) { fmi2GetReal(it, &reference, 1, &mut x) } else { fmi3GetFloat64(it, &reference, 1, &mut x, 1) }
    };
    assert_eq!(status, 0, "{way:?} {reference}");
    x
}

pub(crate) fn set(way: Way, it: InstancePointer, reference: u32, x: f64) {
    let status = unsafe {
        if is_two(way) { fmi2SetReal(it, &reference, 1, &x) } else { fmi3SetFloat64(it, &reference, 1, &x, 1) }
    };
    assert_eq!(status, 0);
}

/// All values as read in FMI 3.0; FMI 2.0 reads those that fit an Integer.
pub(crate) fn values(way: Way, it: InstancePointer) -> Vec<String> {
    let mut all: Vec<String> = [U, REAL, DOUBLED, Y, SEEN].map(|r| real(way, it, r).to_string()).to_vec();
    unsafe {
        let mut text = null();
        if is_two(way) {
            let (mut integers, mut on) = ([Fmi2Integer(0); 3], Fmi2Boolean(7));
            assert_eq!(fmi2GetInteger(it, [N, SMALL, FAN].as_ptr(), 3, integers.as_mut_ptr()), 0);
            assert_eq!((fmi2GetBoolean(it, &ON, 1, &mut on), fmi2GetString(it, &LABEL, 1, &mut text)), (0, 0));
            let mut weights = [0.0; 4];
            let each: Vec<u32> = (WEIGHTS..WEIGHTS + 4).collect();
            assert_eq!(fmi2GetReal(it, each.as_ptr(), 4, weights.as_mut_ptr()), 0);
            let single = real(way, it, SINGLE);
            let integers = integers.map(|x| x.0);
            all.extend([format!("{integers:?}"), (on.0 != 0).to_string(), format!("{weights:?}"), single.to_string()]);
        } else {
            let (mut n, mut small, mut fan, mut on, mut single) = (0, 0, 0, Fmi3Boolean(7), 0.0);
            assert_eq!((fmi3GetInt32(it, &N, 1, &mut n, 1), fmi3GetUInt8(it, &SMALL, 1, &mut small, 1)), (0, 0));
            assert_eq!((fmi3GetInt64(it, &FAN, 1, &mut fan, 1), fmi3GetBoolean(it, &ON, 1, &mut on, 1)), (0, 0));
            assert_eq!(fmi3GetFloat32(it, &SINGLE, 1, &mut single, 1), 0);
            let mut weights = [0.0; 4];
            assert_eq!(fmi3GetFloat64(it, &WEIGHTS, 1, weights.as_mut_ptr(), 4), 0);
            assert_eq!(fmi3GetString(it, &LABEL, 1, &mut text, 1), 0);
            let integers = [i64::from(n), i64::from(small), fan];
            all.extend([format!("{integers:?}"), (on.0 != 0).to_string(), format!("{weights:?}")]);
            all.push(f64::from(single).to_string());
        }
        all.push(CStr::from_ptr(text).to_str().unwrap().into());
    }
    all
}

pub(crate) const U: u32 = 1;
pub(crate) const REAL: u32 = 2;
pub(crate) const SINGLE: u32 = 3;
pub(crate) const N: u32 = 4;
pub(crate) const SMALL: u32 = 5;
pub(crate) const LARGE: u32 = 6;
pub(crate) const ON: u32 = 7;
pub(crate) const FAN: u32 = 8;
pub(crate) const LABEL: u32 = 9;
pub(crate) const WEIGHTS: u32 = 10;
pub(crate) const DOUBLED: u32 = 14;
pub(crate) const Y: u32 = 15;
pub(crate) const SEEN: u32 = 16;
pub(crate) const KEY: u32 = 18;
