//! An importer for tests: the C functions of both standards behind one set of names.
#![allow(dead_code, unreachable_pub, reason = "a module of every test crate, each of which uses a part")]

pub mod journal;
pub mod model;
pub mod unsupported;

pub(crate) use fmi::*;
use fmu_core::Exported;
use fmu_export::abi::types::*;
pub use journal::*;
use model::Probe;
use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};
use std::rc::Rc;
use std::sync::Once;

fmu_export::export!(Probe);

pub const OK: c_int = 0;
pub const DISCARD: c_int = 2;
pub const ERROR: c_int = 3;

pub fn token() -> CString {
    CString::new(fmi::This::TOKEN.as_str()).unwrap()
}

/// Set in a process that keeps the library's panic hook.
pub const CHILD: &str = "FMU_EXPORT_TEST_CHILD";

/// The library silences panics; a test needs its own.
pub fn loud() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if std::env::var_os(CHILD).is_none() {
            fmu_export::abi::quiet();
            drop(std::panic::take_hook());
        }
    });
}

/// An instance of one of the standards.
pub struct Fmu {
    pub version: u8,
    pub it: InstancePointer,
    pub journal: Rc<Journal>,
}

impl Fmu {
    pub fn new(version: u8) -> Self {
        let journal = Rc::<Journal>::default();
        let it = Self::open(version, c"probe", &token(), &*journal, true, false);
        assert!(!it.is_null());
        Self { version, it, journal }
    }

    pub fn open(
        version: u8,
        name: &CStr,
        token: &CStr,
        journal: *const Journal,
        logger: bool,
        logging_on: bool,
    ) -> InstancePointer {
        loud();
        let environment = journal.cast_mut().cast();
        let (name, token, on) = (name.as_ptr(), token.as_ptr(), u8::from(logging_on));
        if version == 2 {
            let mut callbacks = Fmi2Callbacks {
                logger: (logger && has_logger(2)).then(|| variadic(log2)),
                allocate_memory: null(),
                free_memory: null(),
                step_finished: null(),
                environment,
            };
            let it =
                unsafe { fmi2Instantiate(name, 1, token, null(), &callbacks, Fmi2Boolean(0), Fmi2Boolean(on.into())) };
            // The importer may reuse its struct afterwards (FMI 2.0.5, 2.1.5).
            unsafe { std::ptr::write_bytes(&mut callbacks, 0xdd, 1) };
            return it;
        }
        let (no, logger) = (Fmi3Boolean(0), logger.then_some(log3 as Fmi3Logger));
        unsafe {
            fmi3InstantiateCoSimulation(
                name,
                token,
                null(),
                no,
                Fmi3Boolean(on),
                no,
                no,
                null(),
                0,
                environment,
                logger,
                None,
            )
        }
    }

    /// In Initialization Mode, from 0 s without a stop time.
    pub fn entered(version: u8) -> Self {
        let fmu = Self::new(version);
        assert_eq!(fmu.enter(0.0, None), OK);
        fmu
    }

    /// In Step Mode at 0 s.
    pub fn started(version: u8) -> Self {
        let fmu = Self::entered(version);
        assert_eq!(fmu.exit(), OK);
        fmu
    }

    /// In one of the five states, by its letter.
    pub fn in_state(version: u8, state: char) -> Self {
        match state {
            'i' => Self::new(version),
            'n' => Self::entered(version),
            's' => Self::started(version),
            't' => {
                let fmu = Self::started(version);
                assert_eq!(fmu.terminate(), OK);
                fmu
            }
            'e' => {
                let fmu = Self::started(version);
                assert_eq!(fmu.step(0.0, -1.0), ERROR);
                fmu.journal.0.borrow_mut().clear();
                fmu
            }
            _ => unreachable!(),
        }
    }

    pub fn enter(&self, start: f64, stop: Option<f64>) -> c_int {
        let (defined, stop) = (stop.is_some(), stop.unwrap_or_default());
        unsafe {
            if self.version == 3 {
                let defined = Fmi3Boolean(defined.into());
                return fmi3EnterInitializationMode(self.it, Fmi3Boolean(0), 0.0, start, defined, stop);
            }
            match fmi2SetupExperiment(self.it, Fmi2Boolean(0), 0.0, start, Fmi2Boolean(defined.into()), stop) {
                OK => fmi2EnterInitializationMode(self.it),
                status => status,
            }
        }
    }

    pub fn exit(&self) -> c_int {
        unsafe {
            if self.version == 2 { fmi2ExitInitializationMode(self.it) } else { fmi3ExitInitializationMode(self.it) }
        }
    }

    pub fn terminate(&self) -> c_int {
        unsafe { if self.version == 2 { fmi2Terminate(self.it) } else { fmi3Terminate(self.it) } }
    }

    pub fn reset(&self) -> c_int {
        unsafe { if self.version == 2 { fmi2Reset(self.it) } else { fmi3Reset(self.it) } }
    }

    pub fn step(&self, t: f64, h: f64) -> c_int {
        self.step_promising(t, h, true)
    }

    /// A step with or without the promise never to go back before its start (noSetFMUStatePriorToCurrentPoint).
    pub fn step_promising(&self, t: f64, h: f64, promise: bool) -> c_int {
        if self.version == 2 {
            return unsafe { fmi2DoStep(self.it, t, h, Fmi2Boolean(promise.into())) };
        }
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(9), Fmi3Boolean(9), Fmi3Boolean(9), f64::NAN);
        let status = unsafe {
            fmi3DoStep(self.it, t, h, Fmi3Boolean(promise.into()), &mut event, &mut end, &mut early, &mut last)
        };
        if status == OK {
            assert_eq!((event.0, end.0, early.0, last.to_bits()), (0, 0, 0, (t + h).to_bits()));
        }
        status
    }

    pub fn set(&self, vr: &[u32], values: &[f64]) -> c_int {
        let (it, n) = (self.it, vr.len());
        unsafe {
            if self.version == 2 {
                assert_eq!(n, values.len());
                fmi2SetReal(it, vr.as_ptr(), n, values.as_ptr())
            } else {
                fmi3SetFloat64(it, vr.as_ptr(), n, values.as_ptr(), values.len())
            }
        }
    }

    /// Sets an integer (or, in FMI 2, an enumeration).
    pub fn set_integer(&self, vr: u32, value: i32) -> c_int {
        unsafe {
            if self.version == 2 {
                fmi2SetInteger(self.it, &vr, 1, &Fmi2Integer(value))
            } else {
                fmi3SetInt32(self.it, &vr, 1, &value, 1)
            }
        }
    }

    /// Sets an enumeration.
    pub fn set_mode(&self, value: i32) -> c_int {
        if self.version == 2 {
            return self.set_integer(model::MODE, value);
        }
        let value = i64::from(value);
        unsafe { fmi3SetInt64(self.it, &model::MODE, 1, &value, 1) }
    }

    pub fn try_get(&self, vr: &[u32], values: &mut [f64]) -> c_int {
        let (it, n, m) = (self.it, vr.len(), values.len());
        unsafe {
            if self.version == 2 {
                assert_eq!(n, m);
                fmi2GetReal(it, vr.as_ptr(), n, values.as_mut_ptr())
            } else {
                fmi3GetFloat64(it, vr.as_ptr(), n, values.as_mut_ptr(), m)
            }
        }
    }

    pub fn get(&self, vr: u32) -> f64 {
        let mut value = f64::NAN;
        assert_eq!(self.try_get(&[vr], std::slice::from_mut(&mut value)), OK);
        value
    }

    /// The last communication point: the variable of FMI 3.0, the status of FMI 2.0.
    pub fn try_time(&self, time: &mut f64) -> c_int {
        match self.version {
            2 => unsafe { fmi2GetRealStatus(self.it, 2, time) },
            _ => self.try_get(&[model::TIME], std::slice::from_mut(time)),
        }
    }

    pub fn time(&self) -> f64 {
        let mut time = f64::NAN;
        assert_eq!(self.try_time(&mut time), OK);
        time
    }

    pub fn save(&self, state: &mut FmuState) -> c_int {
        unsafe { if self.version == 2 { fmi2GetFMUstate(self.it, state) } else { fmi3GetFMUState(self.it, state) } }
    }

    pub fn restore(&self, state: FmuState) -> c_int {
        unsafe { if self.version == 2 { fmi2SetFMUstate(self.it, state) } else { fmi3SetFMUState(self.it, state) } }
    }

    pub fn free_state(&self, state: &mut FmuState) -> c_int {
        unsafe { if self.version == 2 { fmi2FreeFMUstate(self.it, state) } else { fmi3FreeFMUState(self.it, state) } }
    }

    pub fn size(&self, state: FmuState) -> usize {
        let mut size = 0;
        let status = unsafe {
            if self.version == 2 {
                fmi2SerializedFMUstateSize(self.it, state, &mut size)
            } else {
                fmi3SerializedFMUStateSize(self.it, state, &mut size)
            }
        };
        assert_eq!(status, OK);
        size
    }

    pub fn serialize(&self, state: FmuState, bytes: &mut [u8]) -> c_int {
        let (p, n) = (bytes.as_mut_ptr(), bytes.len());
        unsafe {
            if self.version == 2 {
                fmi2SerializeFMUstate(self.it, state, p, n)
            } else {
                fmi3SerializeFMUState(self.it, state, p, n)
            }
        }
    }

    pub fn deserialize(&self, bytes: &[u8], state: &mut FmuState) -> c_int {
        let (p, n) = (bytes.as_ptr(), bytes.len());
        unsafe {
            if self.version == 2 {
                fmi2DeSerializeFMUstate(self.it, p, n, state)
            } else {
                fmi3DeserializeFMUState(self.it, p, n, state)
            }
        }
    }

    /// The state as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut state = null_mut();
        assert_eq!(self.save(&mut state), OK);
        let mut bytes = vec![0xaa; self.size(state)];
        assert_eq!(self.serialize(state, &mut bytes), OK);
        assert_eq!(self.free_state(&mut state), OK);
        bytes
    }

    /// The only new message, which must be an error.
    pub fn error(&self) -> String {
        let messages: Vec<Message> = self.journal.0.borrow_mut().drain(..).collect();
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
        let mut end = 0.0;
        // Not allowed in every state; then the state is restored.
        self.try_time(&mut end);
        assert_eq!(self.restore(here), OK);
        let attempts: [(char, &dyn Fn() -> c_int); 3] =
            [('s', &|| self.step(end, 1e-3)), ('n', &|| self.exit()), ('i', &|| self.enter(0.0, None))];
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
        unsafe { if self.version == 2 { fmi2FreeInstance(self.it) } else { fmi3FreeInstance(self.it) } }
    }
}
